//! Fewer triangles with nearly the same shape, by quadric errors (Garland, Heckbert 1997), as
//! meshoptimizer does it.
//!
//! meshoptimizer works in `f32` and does not test the link condition of a collapse, so a closed
//! manifold may come back with an edge of four faces. Its result is therefore checked; vertices around
//! a fault are locked, and the whole is done again. Locks only grow, and a mesh with all vertices
//! locked is the input, so this ends in a manifold.

use crate::error::GeometryError;
use crate::mesh::Mesh;
use crate::mesh::half_edge::{HalfEdges, NO_TWIN, corner_fans, end, start};
use meshopt::VertexDataAdapter;

/// Rounds of locking; round `n` locks `n` rings around every fault.
const ROUNDS: usize = 12;

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
    /// Vertices are a subset of the input's, in its order, without unused ones.
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
    let unchanged = || Simplified { mesh: compacted(mesh, &mesh.faces), error: 0.0 };
    if mesh.faces.len() <= options.target_faces {
        return Ok(unchanged());
    }
    let n = mesh.positions.len();
    let must_stay_manifold = faults(&mesh.faces, n).is_empty();
    let source = Source::new(mesh)?;
    let mut locked = vec![false; n];
    for round in 1..=ROUNDS {
        let (faces, error) = source.simplify(options, &locked)?;
        let faults = if must_stay_manifold { faults(&faces, n) } else { Vec::new() };
        if !faces.is_empty() && faults.is_empty() {
            return Ok(Simplified { mesh: compacted(mesh, &faces), error });
        }
        faults.iter().for_each(|&v| locked[v as usize] = true);
        (0..round).for_each(|_| lock_ring(mesh, &mut locked));
        if faces.is_empty() {
            break;
        }
    }
    Ok(unchanged())
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
        let nothing = || GeometryError::degenerate("all vertices are one point", "check that the mesh is the one meant");
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
    fn simplify(&self, options: &SimplifyOptions, locked: &[bool]) -> Result<(Vec<[u32; 3]>, f64), GeometryError> {
        let refuse = |e: meshopt::Error| GeometryError::degenerate(format!("meshoptimizer: {e}"), "report this as a bug");
        let vertices = VertexDataAdapter::new(&self.bytes, 12, 0).map_err(refuse)?;
        let max_error = options.max_error.map_or(f32::MAX, |e| (e / self.scale) as f32);
        let mut error = 0.0;
        let indices = meshopt::simplify_with_locks(
            &self.indices,
            &vertices,
            locked,
            3 * options.target_faces,
            max_error,
            meshopt::SimplifyOptions::ErrorAbsolute | meshopt::SimplifyOptions::RegularizeLight,
            Some(&mut error),
        );
        let faces = indices.as_chunks::<3>().0.to_vec();
        Ok((faces, f64::from(error) * self.scale))
    }
}

/// Vertices at which a surface is not a closed manifold: ends of edges without a twin, vertices of two
/// fans, faces glued back to back.
fn faults(faces: &[[u32; 3]], vertices: usize) -> Vec<u32> {
    let half_edges = HalfEdges::new(faces, vertices);
    let lone = (0..half_edges.twins.len() as u32).filter(|&h| half_edges.twins[h as usize] == NO_TWIN);
    let mut faults: Vec<u32> = lone.flat_map(|h| [start(faces, h), end(faces, h)]).collect();
    let mut fans = corner_fans(&half_edges);
    let mut fan_of_vertex = vec![u32::MAX; vertices];
    for (corner, &v) in faces.as_flattened().iter().enumerate() {
        let fan = fans.find(corner as u32);
        let known = &mut fan_of_vertex[v as usize];
        match *known {
            u32::MAX => *known = fan,
            other if other != fan => faults.push(v),
            _ => {}
        }
    }
    for (face, corners) in faces.iter().enumerate() {
        let across = [0, 1, 2].map(|k| half_edges.across(face, k));
        if (0..3).any(|k| across[k].is_some() && across[k] == across[(k + 1) % 3]) {
            faults.extend(corners);
        }
    }
    faults.sort_unstable();
    faults.dedup();
    faults
}

/// Locks all vertices that share a face with a locked one.
fn lock_ring(mesh: &Mesh, locked: &mut [bool]) {
    let before = locked.to_vec();
    for face in mesh.faces.iter().filter(|f| f.iter().any(|&v| before[v as usize])) {
        face.iter().for_each(|&v| locked[v as usize] = true);
    }
}

/// The vertices that faces use, in their order.
fn compacted(mesh: &Mesh, faces: &[[u32; 3]]) -> Mesh {
    let mut used = vec![false; mesh.positions.len()];
    faces.iter().flatten().for_each(|&v| used[v as usize] = true);
    let mut number = vec![0; used.len()];
    let mut positions = Vec::new();
    for v in (0..used.len()).filter(|&v| used[v]) {
        number[v] = positions.len() as u32;
        positions.push(mesh.positions[v]);
    }
    Mesh { positions, faces: faces.iter().map(|f| f.map(|v| number[v as usize])).collect() }
}
