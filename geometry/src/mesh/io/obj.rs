//! Wavefront OBJ. Materials are not read.

use super::{EXPORT_AGAIN, Fault, Parsed, fault};
use crate::mesh::Mesh;
use nalgebra::{Point2, Point3};
use std::fmt::Write as _;

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Fault> {
    let options =
        tobj::LoadOptions { triangulate: true, ignore_points: true, ignore_lines: true, ..Default::default() };
    let no_materials = |_: &std::path::Path| Err(tobj::LoadError::GenericFailure);
    let loaded = tobj::load_obj_buf(&mut &*bytes, &options, no_materials);
    let (models, _) = loaded.map_err(|e| fault(format!("is not an OBJ file: {e}"), EXPORT_AGAIN))?;
    // Each object of a file has vertices of its own, even where they share some.
    let mut parsed = Parsed { split: models.len() > 1, ..Parsed::default() };
    let mut all_have_uvs = true;
    for model in &models {
        all_have_uvs &= append(&mut parsed, &model.mesh);
    }
    if !all_have_uvs {
        parsed.corner_uvs.clear();
    }
    Ok(parsed)
}

/// Adds one object; false if a face has no UVs.
fn append(parsed: &mut Parsed, mesh: &tobj::Mesh) -> bool {
    let base = parsed.positions.len() as u32;
    parsed.positions.extend(mesh.positions.as_chunks::<3>().0.iter().map(|&p| Point3::from(p)));
    let corners = mesh.indices.as_chunks::<3>().0;
    parsed.faces.extend(corners.iter().map(|f| f.map(|v| base.saturating_add(v))));
    let uvs = mesh.texcoords.as_chunks::<2>().0;
    let uv = |i: u32| uvs.get(i as usize).map_or(Point2::new(f64::NAN, f64::NAN), |uv| Point2::new(uv[0], 1.0 - uv[1]));
    let indices = mesh.texcoord_indices.as_chunks::<3>().0;
    parsed.corner_uvs.extend(indices.iter().map(|f| f.map(uv)));
    indices.len() == corners.len()
}

pub(super) fn to_bytes(mesh: &Mesh, uvs: Option<&[Point2<f64>]>) -> Vec<u8> {
    let mut text = String::from("# written by turnlight\n");
    for p in &mesh.positions {
        let _ = writeln!(text, "v {} {} {}", p.x, p.y, p.z);
    }
    for uv in uvs.unwrap_or_default() {
        let _ = writeln!(text, "vt {} {}", uv.x, 1.0 - uv.y);
    }
    for f in &mesh.faces {
        let [a, b, c] = f.map(|v| u64::from(v) + 1);
        let _ = match uvs {
            Some(_) => writeln!(text, "f {a}/{a} {b}/{b} {c}/{c}"),
            None => writeln!(text, "f {a} {b} {c}"),
        };
    }
    text.into_bytes()
}
