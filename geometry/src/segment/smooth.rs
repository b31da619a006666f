//! Areas and smoothed normals of faces.

use super::FaceShapes;
use crate::mesh::Mesh;
use crate::mesh::half_edge::HalfEdges;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Face areas, and unit normals after `steps` of averaging over edge neighbours.
///
/// A neighbour counts by its area times `max(0, n·m)²`: hull noise of a few tens of degrees averages
/// out, a right angle stays sharp.
pub(super) fn face_shapes(mesh: &Mesh, half_edges: &HalfEdges, steps: usize) -> FaceShapes {
    let vectors: Vec<_> = (0..mesh.faces.len()).into_par_iter().map(|f| mesh.face_area_vector(f) / 2.0).collect();
    let areas: Vec<f64> = vectors.iter().map(|v| v.norm()).collect();
    let mut normals: Vec<_> = vectors.iter().map(|v| v.try_normalize(0.0).unwrap_or_default()).collect();
    for _ in 0..steps {
        normals = (0..normals.len()).into_par_iter().map(|f| average(half_edges, &areas, &normals, f)).collect();
    }
    FaceShapes { areas, normals }
}

fn average(half_edges: &HalfEdges, areas: &[f64], normals: &[Vector3<f64>], face: usize) -> Vector3<f64> {
    let own = normals[face];
    let sum = (0..3).filter_map(|k| half_edges.across(face, k)).fold(own * areas[face], |sum, other| {
        let agreement = own.dot(&normals[other]).max(0.0);
        sum + normals[other] * (areas[other] * agreement * agreement)
    });
    sum.try_normalize(0.0).unwrap_or(own)
}
