//! What of a mesh can be unfolded.

use crate::error::GeometryError;
use crate::mesh::Mesh;

/// Smallest area of a face against the squared diagonal of the mesh.
const MIN_AREA: f64 = 1e-12;

/// A mesh that segmentation and flattening can rely on.
pub(super) struct Clean {
    /// Faces with an area, indices in range; moved to the origin and scaled to a box with diagonal 1,
    /// so that all tolerances are relative.
    pub(super) unit: Mesh,
    /// World units per unit of `unit`.
    pub(super) scale: f64,
    /// Per kept face the face of the input.
    pub(super) kept: Vec<u32>,
    pub(super) degenerate: usize,
    pub(super) duplicates: usize,
}

/// Refuses broken numbers and drops faces that cannot be seen.
pub(super) fn clean(mesh: &Mesh) -> Result<Clean, GeometryError> {
    refuse_broken(mesh)?;
    let used = mesh.faces.iter().flatten().map(|&v| mesh.positions[v as usize]);
    let aabb = capture::Aabb::around(used).ok_or_else(|| nothing_left(mesh))?;
    let (center, scale) = (aabb.min.coords / 2.0 + aabb.max.coords / 2.0, aabb.diagonal());
    if !(scale.is_finite() && scale > 0.0) {
        return Err(nothing_left(mesh));
    }
    let positions = mesh.positions.iter().map(|p| ((p.coords - center) / scale).into()).collect();
    let all = Mesh { positions, faces: mesh.faces.clone() };
    let with_area: Vec<u32> =
        (0..all.faces.len()).filter(|&f| all.face_area_vector(f).norm() > 2.0 * MIN_AREA).map(|f| f as u32).collect();
    let degenerate = all.faces.len() - with_area.len();
    let kept = without_repeats(&all.faces, &with_area);
    if kept.is_empty() {
        return Err(nothing_left(mesh));
    }
    let duplicates = with_area.len() - kept.len();
    let faces = kept.iter().map(|&f| all.faces[f as usize]).collect();
    Ok(Clean { unit: Mesh { positions: all.positions, faces }, scale, kept, degenerate, duplicates })
}

fn refuse_broken(mesh: &Mesh) -> Result<(), GeometryError> {
    let broken = |p: &&nalgebra::Point3<f64>| !p.iter().all(|x| x.is_finite());
    let broken = mesh.positions.iter().filter(broken).count();
    if broken > 0 {
        let fault = format!("{broken} of {} vertices are not finite", mesh.positions.len());
        return Err(GeometryError::degenerate(fault, "repair the mesh or export it again"));
    }
    let n = mesh.positions.len();
    let wild = mesh.faces.iter().filter(|f| f.iter().any(|&v| v as usize >= n)).count();
    if wild > 0 {
        let fault = format!("{wild} of {} faces name a vertex beyond the {n} there are", mesh.faces.len());
        return Err(GeometryError::degenerate(fault, "repair the mesh or export it again"));
    }
    Ok(())
}

fn nothing_left(mesh: &Mesh) -> GeometryError {
    let fault = format!("none of the mesh's {} faces has an area", mesh.faces.len());
    GeometryError::degenerate(fault, "check that the mesh is the one meant and was exported with faces")
}

/// Of faces with the same vertices in the same direction only the first.
fn without_repeats(faces: &[[u32; 3]], candidates: &[u32]) -> Vec<u32> {
    let mut keyed: Vec<([u32; 3], u32)> = candidates.iter().map(|&f| (smallest_first(faces[f as usize]), f)).collect();
    keyed.sort_unstable();
    keyed.dedup_by_key(|e| e.0);
    let mut kept: Vec<u32> = keyed.into_iter().map(|e| e.1).collect();
    kept.sort_unstable();
    kept
}

fn smallest_first([a, b, c]: [u32; 3]) -> [u32; 3] {
    [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap_or([a, b, c])
}
