//! Faces as edge functions over the ideal pixel plane.
//!
//! With camera-space corners `a, b, c` and a ray `d = K⁻¹ (x, y, 1)`, `d · (b × c)` is the (unnormalised)
//! weight of corner `a` where the ray meets the face's plane, and is linear in (x, y). The three
//! weights sum to `det / depth`, `det = a · (b × c)`. All three positive, after turning back faces
//! over, means a hit in front of the camera wherever the corners themselves may lie.

use super::Part;
use crate::face::vertex;
use capture::{Camera, Intrinsics};
use nalgebra::{Matrix3, Point3, Vector3};
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
    /// Smallest 1 / depth on what of the face is in front of the camera.
    pub(super) farthest: f64,
    /// Whether its outside is seen.
    pub(super) is_front: bool,
    /// The part it belongs to.
    pub(super) part: u32,
    /// Index in the part's mesh.
    pub(super) face: u32,
    /// Ideal pixels [x, y] that may be covered: lowest.
    pub(super) low: [f64; 2],
    /// Ideal pixels [x, y] that may be covered: highest.
    pub(super) high: [f64; 2],
}

/// Every face that may be seen, in the order of the parts and of their meshes.
pub(super) fn faces(parts: &[Part<'_>], camera: &Camera) -> Vec<EdgeFace> {
    let mut out = Vec::new();
    for (index, part) in (0..).zip(parts) {
        let to_camera = ToCamera::new(part, camera);
        let mesh = &part.mesh.mesh;
        // A vertex has six faces.
        let place = |v: usize| vertex(part.mesh, v).map(|(position, _)| to_camera.apply(&position));
        let vertices: Vec<Option<Vector3<f64>>> =
            (0..mesh.positions.len()).into_par_iter().with_min_len(1024).map(place).collect();
        let faces = mesh.faces.par_iter().with_min_len(512).enumerate().filter_map(|(face, corners)| {
            let [a, b, c] = corners.map(|v| vertices.get(v as usize).copied().flatten());
            let edges = edge_face(&[a?, b?, c?], &camera.intrinsics)?;
            Some(EdgeFace { part: index, face: u32::try_from(face).ok()?, ..edges })
        });
        out.par_extend(faces);
    }
    out
}

/// From a part's coordinates to the camera's.
struct ToCamera {
    linear: Matrix3<f64>,
    translation: Vector3<f64>,
}

impl ToCamera {
    fn new(part: &Part<'_>, camera: &Camera) -> Self {
        let linear = camera.rotation * (part.pose.rotation * part.pose.scale);
        Self { linear, translation: camera.rotation * part.pose.translation + camera.translation }
    }

    fn apply(&self, point: &Point3<f64>) -> Vector3<f64> {
        self.linear * point.coords + self.translation
    }
}

/// Of no part yet; `None` behind the camera, and seen exactly edge-on.
fn edge_face(corners: &[Vector3<f64>; 3], intrinsics: &Intrinsics) -> Option<EdgeFace> {
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
    let inverse_depths = corners.map(|c| if c.z > 0.0 { 1.0 / c.z } else { f64::INFINITY });
    let (nearest, farthest) =
        (inverse_depths.into_iter().fold(0.0, f64::max), inverse_depths.into_iter().fold(f64::INFINITY, f64::min));
    // Counter-clockwise from outside: the outward normal points at the eye.
    let is_front = det < 0.0;
    (!degenerate).then_some(EdgeFace { edges, inverse_det, nearest, farthest, is_front, part: 0, face: 0, low, high })
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
