//! Faces as edge functions over the ideal pixel plane.
//!
//! With camera-space corners `a, b, c` and a ray `d = K⁻¹ (x, y, 1)`, `d · (b × c)` is the (unnormalised)
//! weight of corner `a` where the ray meets the face's plane, and is linear in (x, y). The three
//! weights sum to `det / depth`, `det = a · (b × c)`. All three positive, after turning back faces
//! over, means a hit in front of the camera wherever the corners themselves may lie.

use crate::face::corners;
use capture::{Camera, Intrinsics};
use geometry::TexturedMesh;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Air around a face's bounds, in pixels: more than rounding, less than matters.
const BOUNDS_MARGIN: f64 = 1e-6;

/// `x · l[0] + y · l[1] + l[2]` over ideal pixels.
pub(super) type Linear = [f64; 3];

/// A face ready to be tested against sub-samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgeFace {
    /// Weights of the three corners, positive inside.
    pub(super) edges: [Linear; 3],
    /// Weights' sum × this = 1 / depth.
    pub(super) inverse_det: f64,
    /// Largest 1 / depth on the face; infinite where it reaches behind the camera.
    pub(super) nearest: f64,
    /// Whether its outside is seen.
    pub(super) is_front: bool,
    /// Index in the mesh.
    pub(super) face: u32,
    /// Ideal pixels [x, y] that may be covered: lowest.
    pub(super) low: [f64; 2],
    /// Ideal pixels [x, y] that may be covered: highest.
    pub(super) high: [f64; 2],
}

/// Every face that may be seen, in the order of the mesh.
pub(super) fn faces(mesh: &TexturedMesh, camera: &Camera) -> Vec<EdgeFace> {
    (0..mesh.mesh.faces.len())
        .into_par_iter()
        .with_min_len(512)
        .filter_map(|face| {
            let positions = corners(mesh, face)?.positions.map(|p| camera.to_camera(&p));
            edge_face(&positions, &camera.intrinsics, u32::try_from(face).ok()?)
        })
        .collect()
}

/// `None` behind the camera, and seen exactly edge-on.
fn edge_face(corners: &[Vector3<f64>; 3], intrinsics: &Intrinsics, face: u32) -> Option<EdgeFace> {
    if corners.iter().all(|c| c.z <= 0.0) {
        return None;
    }
    let [a, b, c] = corners;
    let normals = [b.cross(c), c.cross(a), a.cross(b)];
    let det = a.dot(&normals[0]);
    let edges = normals.map(|n| over_pixels(if det < 0.0 { -n } else { n }, intrinsics));
    let inverse_det = 1.0 / det.abs();
    let degenerate = !inverse_det.is_finite() || edges.iter().any(|e| e[0] == 0.0 && e[1] == 0.0 && e[2] <= 0.0);
    let (low, high) = bounds(corners, intrinsics);
    let nearest = corners.iter().map(|c| if c.z > 0.0 { 1.0 / c.z } else { f64::INFINITY }).fold(0.0, f64::max);
    // Counter-clockwise from outside: the outward normal points at the eye.
    let is_front = det < 0.0;
    (!degenerate).then_some(EdgeFace { edges, inverse_det, nearest, is_front, face, low, high })
}

/// `n · K⁻¹ (x, y, 1)`. Odd in `n` to the last bit, which makes shared edges watertight.
fn over_pixels(n: Vector3<f64>, i: &Intrinsics) -> Linear {
    let x = n.x / i.fx;
    let y = (n.y - x * i.skew) / i.fy;
    [x, y, n.z - x * i.cx - y * i.cy]
}

/// The box of the projected corners; the whole plane where the face reaches behind the camera.
fn bounds(corners: &[Vector3<f64>; 3], intrinsics: &Intrinsics) -> ([f64; 2], [f64; 2]) {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for c in corners {
        if c.z <= 0.0 {
            return ([f64::NEG_INFINITY; 2], [f64::INFINITY; 2]);
        }
        let pixel = intrinsics.pixel_from_plane(nalgebra::Vector2::new(c.x / c.z, c.y / c.z));
        for k in 0..2 {
            low[k] = low[k].min(pixel[k] - BOUNDS_MARGIN);
            high[k] = high[k].max(pixel[k] + BOUNDS_MARGIN);
        }
    }
    (low, high)
}
