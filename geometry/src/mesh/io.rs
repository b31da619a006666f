//! Meshes on disk: PLY, OBJ and GLB, told apart by the file's extension.
//!
//! `ply`, `obj` and `glb` turn bytes into a [`Parsed`] mesh and back; what they share is here: checks,
//! welding, the atlas of a file, and writing whole files or none. Coordinates are taken as they are: no
//! axis is turned. In PLY and OBJ v points up, in GLB and in this crate down; readers and writers flip.

mod glb;
mod obj;
mod ply;

use super::half_edge::Sets;
use super::{Mesh, TexturedMesh};
use crate::atlas::overlapping_texels;
use crate::error::GeometryError;
use nalgebra::{Point2, Point3};
use std::io::Write;
use std::path::Path;

/// The size taken for the atlas of a file, none of whose formats tells it.
pub const DEFAULT_ATLAS_SIZE: [usize; 2] = [1024, 1024];

/// What a mesh file held.
#[derive(Clone, Debug)]
pub struct MeshFile {
    /// The surface. Where the file splits vertices for its texture (GLB always, PLY with texture
    /// coordinates), vertices at the same position are one again.
    pub mesh: Mesh,
    /// The surface with the file's own UVs, if every face has them, inside [0, 1], with an area, and
    /// none on another. Its atlas size is [`DEFAULT_ATLAS_SIZE`].
    pub textured: Option<TexturedMesh>,
    /// Why UVs that the file has are not used.
    pub uv_fault: Option<String>,
}

/// What a format's reader found, not yet checked.
#[derive(Debug, Default)]
struct Parsed {
    positions: Vec<Point3<f64>>,
    faces: Vec<[u32; 3]>,
    /// Per face the UVs of its corners, v down; empty if any face has none.
    corner_uvs: Vec<[Point2<f64>; 3]>,
    /// Vertices may be split where only the texture needs it.
    split: bool,
}

/// A fault inside a file and its remedy; the caller adds the path.
type Fault = (String, String);

fn fault(fault: impl Into<String>, remedy: &str) -> Fault {
    (fault.into(), remedy.to_owned())
}

const EXPORT_AGAIN: &str = "export the mesh again";

#[derive(Clone, Copy)]
enum Format {
    Ply,
    Obj,
    Glb,
}

/// Reads a mesh. Polygons become fans of triangles.
///
/// # Errors
/// [`GeometryError::Io`] if the file cannot be read; [`GeometryError::Invalid`] if its format is not
/// known, it is cut off or malformed, has no faces, a coordinate that is not finite, or an index out of
/// range. Never panics.
pub fn read_mesh(path: impl AsRef<Path>) -> Result<MeshFile, GeometryError> {
    let path = path.as_ref();
    let format = format_of(path)?;
    let bytes = std::fs::read(path).map_err(|source| GeometryError::Io { path: path.to_owned(), source })?;
    let parsed = match format {
        Format::Ply => ply::parse(&bytes),
        Format::Obj => obj::parse(&bytes),
        Format::Glb => glb::parse(&bytes),
    };
    parsed.and_then(finish).map_err(|(fault, remedy)| GeometryError::Invalid { path: path.to_owned(), fault, remedy })
}

/// Writes a mesh; the file appears whole or not at all. PLY (binary) and OBJ keep all digits, GLB is
/// `f32`.
///
/// # Errors
/// [`GeometryError::Io`] if the file cannot be written; [`GeometryError::Invalid`] if its extension is
/// not `.ply`, `.obj` or `.glb`.
pub fn write_mesh(path: impl AsRef<Path>, mesh: &Mesh) -> Result<(), GeometryError> {
    write(path.as_ref(), mesh, None)
}

/// Writes a mesh with its UVs; otherwise as [`write_mesh`].
///
/// # Errors
/// Those of [`write_mesh`].
pub fn write_textured_mesh(path: impl AsRef<Path>, mesh: &TexturedMesh) -> Result<(), GeometryError> {
    write(path.as_ref(), &mesh.mesh, Some(&mesh.uvs))
}

fn write(path: &Path, mesh: &Mesh, uvs: Option<&[Point2<f64>]>) -> Result<(), GeometryError> {
    let bytes = match format_of(path)? {
        Format::Ply => Ok(ply::to_bytes(mesh, uvs)),
        Format::Obj => Ok(obj::to_bytes(mesh, uvs)),
        Format::Glb => glb::to_bytes(mesh, uvs),
    };
    let invalid = |(fault, remedy)| GeometryError::Invalid { path: path.to_owned(), fault, remedy };
    write_whole(path, &bytes.map_err(invalid)?).map_err(|source| GeometryError::Io { path: path.to_owned(), source })
}

/// Writes beside the target, flushes, renames.
fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut file = tempfile::NamedTempFile::new_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    allow_others_to_read(file.as_file())?;
    file.persist(path)?;
    Ok(())
}

/// Temporary files are private; a mesh is not.
#[cfg(unix)]
fn allow_others_to_read(file: &std::fs::File) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn allow_others_to_read(_: &std::fs::File) -> std::io::Result<()> {
    Ok(())
}

fn format_of(path: &Path) -> Result<Format, GeometryError> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("ply") => Ok(Format::Ply),
        Some("obj") => Ok(Format::Obj),
        Some("glb") => Ok(Format::Glb),
        _ => Err(GeometryError::Invalid {
            path: path.to_owned(),
            fault: "not a known kind of mesh file".to_owned(),
            remedy: "use .ply, .obj or .glb".to_owned(),
        }),
    }
}

/// Checks a parsed mesh and makes what the caller wants of it.
fn finish(parsed: Parsed) -> Result<MeshFile, Fault> {
    let n = parsed.positions.len();
    if parsed.faces.is_empty() {
        return Err(fault("has no faces", "export the mesh with its faces"));
    }
    if let Some(i) = parsed.positions.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        return Err(fault(format!("vertex {i} is not finite"), EXPORT_AGAIN));
    }
    if let Some(i) = parsed.faces.iter().position(|f| f.iter().any(|&v| v as usize >= n)) {
        return Err(fault(format!("triangle {i} names a vertex beyond the {n} there are"), EXPORT_AGAIN));
    }
    let (textured, uv_fault) = match textured(&parsed) {
        None => (None, None),
        Some(Ok(textured)) => (Some(textured), None),
        Some(Err(fault)) => (None, Some(fault)),
    };
    let mesh = Mesh { positions: parsed.positions, faces: parsed.faces };
    let mesh = if parsed.split { welded(&mesh) } else { mesh };
    Ok(MeshFile { mesh, textured, uv_fault })
}

/// The bits that tell two points apart; -0 is 0.
fn bits<const D: usize>(coordinates: [f64; D]) -> [u64; D] {
    coordinates.map(|x| (x + 0.0).to_bits())
}

/// One vertex per position, in order of first use.
fn welded(mesh: &Mesh) -> Mesh {
    let mut order: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    let key = |v: u32| bits(mesh.positions[v as usize].coords.data.0[0]);
    order.sort_by_key(|&v| (key(v), v));
    let mut first = vec![0; order.len()];
    for same in order.chunk_by(|&a, &b| key(a) == key(b)) {
        same.iter().for_each(|&v| first[v as usize] = same[0]);
    }
    let mut number = vec![0; first.len()];
    let mut positions = Vec::new();
    for v in (0..first.len()).filter(|&v| first[v] == v as u32) {
        number[v] = positions.len() as u32;
        positions.push(mesh.positions[v]);
    }
    let corner = |v: u32| number[first[v as usize] as usize];
    Mesh { positions, faces: mesh.faces.iter().map(|f| f.map(corner)).collect() }
}

/// The file's own atlas, `None` if it has no UVs, or what is wrong with it.
fn textured(parsed: &Parsed) -> Option<Result<TexturedMesh, String>> {
    (parsed.corner_uvs.len() == parsed.faces.len()).then(|| {
        let mesh = split_at_seams(parsed);
        check_uvs(&mesh).map(|()| mesh)
    })
}

/// One vertex per (vertex, UV) in use; charts are what hangs together by them.
fn split_at_seams(parsed: &Parsed) -> TexturedMesh {
    let vertices = parsed.faces.as_flattened();
    let uvs = parsed.corner_uvs.as_flattened();
    let key = |c: u32| (vertices[c as usize], bits([uvs[c as usize].x, uvs[c as usize].y]));
    let mut order: Vec<u32> = (0..vertices.len() as u32).collect();
    order.sort_by_key(|&c| (key(c), c));
    let mut number = vec![0; vertices.len()];
    let (mut positions, mut split_uvs) = (Vec::new(), Vec::new());
    for same in order.chunk_by(|&a, &b| key(a) == key(b)) {
        same.iter().for_each(|&c| number[c as usize] = positions.len() as u32);
        positions.push(parsed.positions[vertices[same[0] as usize] as usize]);
        split_uvs.push(uvs[same[0] as usize]);
    }
    let faces = number.as_chunks::<3>().0.to_vec();
    let face_charts = charts_by_vertices(&faces, positions.len());
    TexturedMesh { mesh: Mesh { positions, faces }, uvs: split_uvs, face_charts, atlas_size: DEFAULT_ATLAS_SIZE }
}

/// Faces that share vertices share a chart; charts are numbered by their first face.
fn charts_by_vertices(faces: &[[u32; 3]], vertices: usize) -> Vec<u32> {
    let mut sets = Sets::new(vertices);
    for f in faces {
        sets.join(f[0], f[1]);
        sets.join(f[0], f[2]);
    }
    let (mut number, mut count) = (vec![u32::MAX; vertices], 0);
    let chart = |f: &[u32; 3]| {
        let slot = &mut number[sets.find(f[0]) as usize];
        if *slot == u32::MAX {
            *slot = count;
            count += 1;
        }
        *slot
    };
    faces.iter().map(chart).collect()
}

/// Inside the unit square, every face with an area and the orientation of its chart, none on another.
fn check_uvs(mesh: &TexturedMesh) -> Result<(), String> {
    let outside = mesh.uvs.iter().filter(|uv| !uv.iter().all(|x| (0.0..=1.0).contains(x))).count();
    if outside > 0 {
        return Err(format!("{outside} texture coordinates lie outside [0, 1]"));
    }
    let mut sign_of_chart = vec![0.0; mesh.mesh.faces.len()];
    for (face, corners) in mesh.mesh.faces.iter().enumerate() {
        let [a, b, c] = corners.map(|v| mesh.uvs[v as usize]);
        let sign = (b - a).perp(&(c - a));
        let known: &mut f64 = &mut sign_of_chart[mesh.face_charts[face] as usize];
        if sign == 0.0 || sign * *known < 0.0 {
            return Err(format!("face {face} has no area in the texture, or lies upside down in its chart"));
        }
        *known = sign.signum();
    }
    match overlapping_texels(mesh) {
        0 => Ok(()),
        n => Err(format!("{n} texels of {}² show two places of the surface", DEFAULT_ATLAS_SIZE[0])),
    }
}
