//! Faces as edge functions over the ideal pixel plane.
//!
//! With camera-space corners `a, b, c` and a ray `d = K⁻¹ (x, y, 1)`, `d · (b × c)` is the (unnormalised)
//! weight of corner `a` where the ray meets the face's plane, and is linear in (x, y). The three
//! weights sum to `det / depth`, `det = a · (b × c)`. All three positive, after turning back faces
//! over, means a hit in front of the camera wherever the corners themselves may lie.

use super::Part;
use super::samples::{Bins, Samples};
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
    /// Ideal pixels [x, y] that may be covered: lowest; infinite where a face through the camera's plane runs there.
    pub(super) low: [f64; 2],
    /// Ideal pixels [x, y] that may be covered: highest; infinite likewise.
    pub(super) high: [f64; 2],
}

/// Faces set up together: an index of a face is its batch's times this, and its own.
const BATCH: usize = 1 << 11;

/// All faces that may be seen, and the tiles they may be seen in; kept from frame to frame for their memory alone.
#[derive(Debug, Default)]
pub(super) struct Faces {
    batches: Vec<Batch>,
    /// Of each part.
    vertices: Vec<Vec<Option<Corner>>>,
}

/// A vertex as the camera has it: a vertex has six faces.
#[derive(Clone, Copy, Debug)]
struct Corner {
    /// In the camera's coordinates.
    position: Vector3<f64>,
    /// Its ideal pixel; of no meaning behind the camera.
    pixel: [f64; 2],
    /// 1 / depth; infinite behind the camera.
    inverse_depth: f64,
}

#[derive(Debug, Default)]
struct Batch {
    faces: Vec<EdgeFace>,
    bins: Bins,
}

impl Faces {
    /// Sets up the faces of `parts`.
    pub(super) fn set_up(&mut self, parts: &[Part<'_>], camera: &Camera, samples: &Samples) {
        self.vertices.resize_with(parts.len(), Vec::new);
        for (part, vertices) in parts.iter().zip(&mut self.vertices) {
            let to_camera = ToCamera::new(part, camera);
            let place = |v: usize| {
                vertex(part.mesh, v).map(|(position, _)| Corner::new(to_camera.apply(&position), &camera.intrinsics))
            };
            let count = part.mesh.mesh.positions.len();
            (0..count).into_par_iter().with_min_len(1024).map(place).collect_into_vec(vertices);
        }
        let firsts = |part: &Part<'_>| (0..part.mesh.mesh.faces.len()).step_by(BATCH);
        let places: Vec<(usize, usize)> =
            parts.iter().enumerate().flat_map(|(k, part)| firsts(part).map(move |first| (k, first))).collect();
        self.batches.resize_with(places.len(), Batch::default);
        let (bounds, vertices) = (samples.tile_bounds(), &self.vertices);
        self.batches.par_iter_mut().zip(&places).for_each(|(batch, &(part, first))| {
            batch.faces.clear();
            let faces = parts[part].mesh.mesh.faces[first..].iter().take(BATCH).zip(first..);
            batch.faces.extend(faces.filter_map(|(corners, face)| {
                let [a, b, c] = corners.map(|v| vertices[part].get(v as usize).copied().flatten());
                let edges = edge_face(&[a?, b?, c?], &camera.intrinsics, samples)?;
                Some(EdgeFace { part: part as u32, face: u32::try_from(face).ok()?, ..edges })
            }));
            samples.bin(&batch.faces, &bounds, &mut batch.bins);
        });
    }

    /// A face by its index.
    #[inline]
    pub(super) fn at(&self, index: u32) -> &EdgeFace {
        &self.batches[index as usize / BATCH].faces[index as usize % BATCH]
    }

    /// Indices of the faces that a tile may see, in the order of the parts and of their meshes.
    pub(super) fn gather(&self, tile: usize, candidates: &mut Vec<u32>) {
        candidates.clear();
        for (batch, first) in self.batches.iter().zip((0..).step_by(BATCH)) {
            candidates.extend(batch.bins.of(tile).iter().map(|&face| first + face));
        }
    }
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

impl Corner {
    fn new(position: Vector3<f64>, intrinsics: &Intrinsics) -> Self {
        let plane = nalgebra::Vector2::new(position.x / position.z, position.y / position.z);
        let inverse_depth = if position.z > 0.0 { 1.0 / position.z } else { f64::INFINITY };
        Self { position, pixel: intrinsics.pixel_from_plane(plane).into(), inverse_depth }
    }

    fn is_in_front(&self) -> bool {
        self.position.z > 0.0
    }
}

/// Of no part yet; `None` behind the camera, seen exactly edge-on, and between the sub-samples.
fn edge_face(corners: &[Corner; 3], intrinsics: &Intrinsics, samples: &Samples) -> Option<EdgeFace> {
    if !corners.iter().any(Corner::is_in_front) {
        return None;
    }
    let (low, high) = bounds(corners, intrinsics);
    if samples.are_beside(low, high) {
        return None;
    }
    let [a, b, c] = corners.each_ref().map(|corner| &corner.position);
    let normals = [b.cross(c), c.cross(a), a.cross(b)];
    let det = a.dot(&normals[0]);
    let edges = normals.map(|n| over_pixels(if det < 0.0 { -n } else { n }, intrinsics));
    let inverse_det = 1.0 / det.abs();
    let degenerate = !inverse_det.is_finite() || edges.iter().any(|e| e[0] == 0.0 && e[1] == 0.0 && e[2] <= 0.0);
    let [p, q, r] = corners.each_ref().map(|corner| corner.inverse_depth);
    let (nearest, farthest) = (p.max(q).max(r), p.min(q).min(r));
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

/// The box of what is in front of the camera, projected. Where a face crosses the camera's plane its picture runs to
/// infinity, on that side alone: `u / z` takes its extremes over a convex part in front at the corners of that part.
fn bounds(corners: &[Corner; 3], intrinsics: &Intrinsics) -> ([f64; 2], [f64; 2]) {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for corner in corners.iter().filter(|corner| corner.is_in_front()) {
        for k in 0..2 {
            low[k] = low[k].min(corner.pixel[k] - BOUNDS_MARGIN);
            high[k] = high[k].max(corner.pixel[k] + BOUNDS_MARGIN);
        }
        let c = &corner.position;
        for behind in corners.iter().filter(|corner| !corner.is_in_front()).map(|corner| &corner.position) {
            let crossing = c.lerp(behind, c.z / (c.z - behind.z));
            let toward = [intrinsics.fx * crossing.x + intrinsics.skew * crossing.y, intrinsics.fy * crossing.y];
            // So near to the eye itself rounding decides the side: both, then.
            let doubt =
                1e-9 * (c.amax() + behind.amax()) * (intrinsics.fx.abs() + intrinsics.skew.abs() + intrinsics.fy.abs());
            for k in 0..2 {
                low[k] = if toward[k] > doubt { low[k] } else { f64::NEG_INFINITY };
                high[k] = if toward[k] < -doubt { high[k] } else { f64::INFINITY };
            }
        }
    }
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use capture::Distortion;
    use nalgebra::Vector2;

    fn intrinsics() -> Intrinsics {
        let distortion = Distortion::default();
        Intrinsics { fx: 300.0, fy: -280.0, skew: 20.0, cx: 160.0, cy: 120.0, distortion, width: 320, height: 240 }
    }

    #[test]
    fn bounds_hold_all_that_is_in_front_and_end_where_a_face_cannot_be() {
        let mut crossings = 0;
        for k in 0..400 {
            let wave = |i: usize| ((k * 9 + i) as f64 * 12.9898).sin() * 2.0;
            let corners = [0, 3, 6].map(|i| Vector3::new(wave(i), wave(i + 1), wave(i + 2) + 0.5));
            if corners.iter().all(|c| c.z <= 0.0) {
                continue;
            }
            let (low, high) = bounds(&corners.map(|c| Corner::new(c, &intrinsics())), &intrinsics());
            crossings +=
                usize::from(corners.iter().any(|c| c.z <= 0.0) && (0..2).any(|i| low[i].max(-high[i]).is_finite()));
            for (s, t) in (0..=40).flat_map(|i| (0..=40 - i).map(move |j| (i as f64 / 40.0, j as f64 / 40.0))) {
                let p = corners[0] * (1.0 - s - t) + corners[1] * s + corners[2] * t;
                if p.z <= 0.0 {
                    continue;
                }
                let pixel = intrinsics().pixel_from_plane(Vector2::new(p.x / p.z, p.y / p.z));
                let slack = 1e-9 * pixel.coords.amax();
                let is_held = (0..2).all(|i| low[i] <= pixel[i] + slack && pixel[i] <= high[i] + slack);
                assert!(is_held, "{pixel} of {corners:?} is outside {low:?} to {high:?}");
            }
        }
        assert!(crossings > 100, "{crossings} faces through the camera's plane are bounded");
    }

    #[test]
    fn a_face_beside_the_eye_is_beside_the_frame() {
        let corner = |c: [f64; 3]| Corner::new(c.into(), &intrinsics());
        let corners = [[2.0, 0.0, 1.0], [2.0, 0.3, -1.0], [2.5, -0.3, -1.0]].map(corner);
        let (low, _) = bounds(&corners, &intrinsics());
        assert!(low[0] > 320.0, "{low:?}");
        // One around the eye may be anywhere.
        let around = [[2.0, 0.0, 1.0], [-2.0, 1.0, -0.1], [-2.0, -1.0, -0.1]].map(corner);
        assert_eq!(bounds(&around, &intrinsics()).0[0], f64::NEG_INFINITY);
    }
}
