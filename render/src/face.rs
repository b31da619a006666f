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
    let [a, b, c] = (*mesh.mesh.faces.get(face)?).map(|v| v as usize);
    let position = |v: usize| {
        let p = mesh.mesh.positions.get(v)?;
        p.iter().all(|x| x.abs() <= MAX_COORDINATE).then_some(*p)
    };
    let uv = |v: usize| {
        let uv = mesh.uvs.get(v)?;
        uv.iter().all(|x| x.abs() <= MAX_COORDINATE).then_some(*uv)
    };
    Some(Corners { positions: [position(a)?, position(b)?, position(c)?], uvs: [uv(a)?, uv(b)?, uv(c)?] })
}
