//! Fewer triangles with nearly the same shape, by quadric errors (Garland, Heckbert 1997), as
//! meshoptimizer does it.
//!
//! meshoptimizer works in `f32` and does not test the link condition of a collapse, so sheets of a
//! thin part may end up touching: an edge of four faces, two fans at a vertex. They are told apart
//! again ([`separate_sheets`]), so that a closed manifold stays one.

use crate::error::GeometryError;
use crate::mesh::{Mesh, separate_sheets};
use meshopt::VertexDataAdapter;

/// How far a mesh is simplified. The first limit reached ends it.
#[derive(Clone, Copy, Debug)]
pub struct SimplifyOptions {
    /// Wanted number of triangles.
    pub target_faces: usize,
    /// Largest distance from the surface, in world units; `None` for as far as it takes.
    pub max_error: Option<f64>,
}

/// A mesh with fewer triangles.
#[derive(Clone, Debug)]
pub struct Simplified {
    /// Its positions are among the input's.
    pub mesh: Mesh,
    /// Estimated distance from the input's surface, in world units (root of the largest quadric error).
    pub error: f64,
}

/// Simplifies a mesh. A closed manifold stays one.
///
/// # Errors
/// [`GeometryError::Degenerate`] of a mesh without faces, with an index out of range or a coordinate
/// that is not finite.
pub fn simplify(mesh: &Mesh, options: &SimplifyOptions) -> Result<Simplified, GeometryError> {
    check(mesh, options)?;
    if mesh.faces.len() <= options.target_faces {
        return Ok(Simplified { mesh: separate_sheets(mesh), error: 0.0 });
    }
    let (faces, error) = Source::new(mesh)?.simplify(options)?;
    let simplified = separate_sheets(&Mesh { positions: mesh.positions.clone(), faces });
    if simplified.faces.is_empty() {
        return Ok(Simplified { mesh: separate_sheets(mesh), error: 0.0 });
    }
    Ok(Simplified { mesh: simplified, error })
}

fn check(mesh: &Mesh, options: &SimplifyOptions) -> Result<(), GeometryError> {
    let remedy = "repair the mesh or export it again";
    let n = mesh.positions.len();
    if mesh.faces.is_empty() {
        return Err(GeometryError::degenerate("the mesh has no faces", "check that the mesh is the one meant"));
    }
    if mesh.faces.iter().flatten().any(|&v| v as usize >= n) {
        return Err(GeometryError::degenerate(format!("a face names a vertex beyond the {n} there are"), remedy));
    }
    let broken = mesh.positions.iter().filter(|p| !p.iter().all(|x| x.is_finite())).count();
    if broken > 0 {
        return Err(GeometryError::degenerate(format!("{broken} of {n} vertices are not finite"), remedy));
    }
    match options.max_error {
        Some(error) if error.is_nan() || error < 0.0 => {
            Err(GeometryError::degenerate(format!("a largest error of {error} makes no sense"), "choose 0 or more"))
        }
        _ => Ok(()),
    }
}

/// The mesh as meshoptimizer wants it: `f32` around the centre, longest extent about 1.
struct Source {
    bytes: Vec<u8>,
    indices: Vec<u32>,
    scale: f64,
}

impl Source {
    fn new(mesh: &Mesh) -> Result<Self, GeometryError> {
        let nothing =
            || GeometryError::degenerate("all vertices are one point", "check that the mesh is the one meant");
        let aabb = mesh.aabb().ok_or_else(nothing)?;
        let (center, scale) = (aabb.min.coords / 2.0 + aabb.max.coords / 2.0, aabb.diagonal());
        if !(scale > 0.0 && scale.is_finite()) {
            return Err(nothing());
        }
        let relative = mesh.positions.iter().flat_map(|p| ((p.coords - center) / scale).data.0[0]);
        let bytes = relative.flat_map(|x| (x as f32).to_ne_bytes()).collect();
        Ok(Self { bytes, indices: mesh.faces.as_flattened().to_vec(), scale })
    }

    /// Faces over the input's vertices, and the error in world units.
    fn simplify(&self, options: &SimplifyOptions) -> Result<(Vec<[u32; 3]>, f64), GeometryError> {
        let refuse =
            |e: meshopt::Error| GeometryError::degenerate(format!("meshoptimizer: {e}"), "report this as a bug");
        let vertices = VertexDataAdapter::new(&self.bytes, 12, 0).map_err(refuse)?;
        let max_error = options.max_error.map_or(f32::MAX, |e| (e / self.scale) as f32);
        let mut error = 0.0;
        let indices = meshopt::simplify(
            &self.indices,
            &vertices,
            3 * options.target_faces,
            max_error,
            meshopt::SimplifyOptions::ErrorAbsolute,
            Some(&mut error),
        );
        let faces = indices.as_chunks::<3>().0.to_vec();
        Ok((faces, f64::from(error) * self.scale))
    }
}
