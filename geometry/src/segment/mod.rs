//! From a mesh to charts: connected discs that are nearly flat.
//!
//! `smooth` takes the noise out of the normals, `grow` merges faces into charts, `straighten` shortens
//! their borders, `split` cuts a chart in two where a later stage could not flatten it.

mod grow;
mod smooth;
mod split;
mod straighten;

pub(crate) use split::split_in_two;

use crate::mesh::Mesh;
use crate::mesh::half_edge::HalfEdges;

/// How faces are gathered into charts.
#[derive(Clone, Copy, Debug)]
pub struct SegmentOptions {
    /// Largest `1 - |Σ A n| / Σ A` of a chart: 0 is flat, a spherical cap of half-angle θ has
    /// `(1 - cos θ) / 2`. Smaller means more and flatter charts.
    pub max_bend: f64,
    /// Steps of crease-preserving averaging of face normals before charts grow; for noisy hulls.
    pub smoothing_steps: usize,
}

impl Default for SegmentOptions {
    /// `max_bend` lies just below the value of two perpendicular squares, `1 - 1/√2 ≈ 0.29`, so that a
    /// cube keeps its six sides. A sphere then falls into about six caps of 60°.
    fn default() -> Self {
        Self { max_bend: 0.25, smoothing_steps: 4 }
    }
}

/// The chart of each face, numbered from 0 in order of their first face. Charts are connected across
/// edges; most, not all, are discs.
pub(crate) fn segment(mesh: &Mesh, half_edges: &HalfEdges, options: &SegmentOptions) -> Vec<Vec<u32>> {
    let faces = smooth::face_shapes(mesh, half_edges, options.smoothing_steps);
    let mut chart_of_face = grow::grow(mesh, half_edges, &faces, options.max_bend);
    straighten::straighten(half_edges, &faces, &mut chart_of_face);
    connected_parts(half_edges, &chart_of_face)
}

/// Area and unit normal of every face.
pub(crate) struct FaceShapes {
    areas: Vec<f64>,
    normals: Vec<nalgebra::Vector3<f64>>,
}

/// Faces of each edge-connected part with one label, ascending; parts in order of their first face.
pub(crate) fn connected_parts(half_edges: &HalfEdges, labels: &[u32]) -> Vec<Vec<u32>> {
    let mut seen = vec![false; labels.len()];
    let mut parts = Vec::new();
    for first in 0..labels.len() {
        if std::mem::replace(&mut seen[first], true) {
            continue;
        }
        let mut part = vec![first as u32];
        let mut next = 0;
        while let Some(&face) = part.get(next) {
            next += 1;
            for other in (0..3).filter_map(|k| half_edges.across(face as usize, k)) {
                if labels[other] == labels[first] && !std::mem::replace(&mut seen[other], true) {
                    part.push(other as u32);
                }
            }
        }
        part.sort_unstable();
        parts.push(part);
    }
    parts
}
