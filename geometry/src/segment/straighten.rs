//! Shorter chart borders.

use super::FaceShapes;
use crate::mesh::half_edge::HalfEdges;
use nalgebra::Vector3;

/// Passes over all faces; each shortens borders, and few faces are left after three.
const PASSES: usize = 4;

/// A face does not join a chart whose mean normal is further than 75° from its own.
const MIN_NORMAL_DOT: f64 = 0.26;

/// Gives a face with two neighbours in one other chart to that chart. By the triangle inequality the
/// border gets shorter, and since such a face is a leaf of its own chart and closes a corner of the
/// other, both keep their topology.
pub(super) fn straighten(half_edges: &HalfEdges, shapes: &FaceShapes, chart_of_face: &mut [u32]) {
    let mean_normals = mean_normals(shapes, chart_of_face);
    for _ in 0..PASSES {
        let mut moved = false;
        for face in 0..chart_of_face.len() {
            let Some(chart) = majority(half_edges, chart_of_face, face) else { continue };
            if shapes.normals[face].dot(&mean_normals[chart as usize]) >= MIN_NORMAL_DOT {
                chart_of_face[face] = chart;
                moved = true;
            }
        }
        if !moved {
            break;
        }
    }
}

/// The other chart that holds exactly two neighbours of `face`, the third being in its own.
fn majority(half_edges: &HalfEdges, charts: &[u32], face: usize) -> Option<u32> {
    let around = [0, 1, 2].map(|k| half_edges.across(face, k).map(|f| charts[f]));
    let own = around.iter().filter(|&&c| c == Some(charts[face])).count();
    let pair = (0..3).find(|&k| around[k].is_some() && around[k] == around[(k + 1) % 3])?;
    around[pair].filter(|&chart| own == 1 && chart != charts[face])
}

fn mean_normals(shapes: &FaceShapes, charts: &[u32]) -> Vec<Vector3<f64>> {
    let mut sums = vec![Vector3::zeros(); charts.len()];
    for (face, &chart) in charts.iter().enumerate() {
        sums[chart as usize] += shapes.normals[face] * shapes.areas[face];
    }
    sums.into_iter().map(|s| s.try_normalize(0.0).unwrap_or_default()).collect()
}
