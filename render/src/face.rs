//! Which faces can be drawn: the one place where broken meshes are sorted out.

use geometry::TexturedMesh;
use nalgebra::{Point2, Point3};

/// Products of three coordinates must stay finite in `f64`; no object is this large in any unit.
const MAX_COORDINATE: f64 = 1e60;

/// The corners of a face with their texture coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corners {
    /// World units.
    pub(crate) positions: [Point3<f64>; 3],
    /// In [0, 1]², v down.
    pub(crate) uvs: [Point2<f64>; 3],
}

/// The corners of `face`; `None` where an index leads nowhere or a number is not finite.
pub(crate) fn corners(mesh: &TexturedMesh, face: usize) -> Option<Corners> {
    let [a, b, c] = (*mesh.mesh.faces.get(face)?).map(|v| vertex(mesh, v as usize));
    let [(a, s), (b, t), (c, u)] = [a?, b?, c?];
    Some(Corners { positions: [a, b, c], uvs: [s, t, u] })
}

/// Where a vertex lies, and its texture coordinates; `None` where a number is missing or not finite.
pub(crate) fn vertex(mesh: &TexturedMesh, vertex: usize) -> Option<(Point3<f64>, Point2<f64>)> {
    let (position, uv) = (mesh.mesh.positions.get(vertex)?, mesh.uvs.get(vertex)?);
    let is_sound = position.iter().chain(uv.iter()).all(|x| x.abs() <= MAX_COORDINATE);
    is_sound.then_some((*position, *uv))
}
