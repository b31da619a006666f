//! Depth maps: which point of a mesh each pixel of a camera sees.
//!
//! Triangles are projected by their vertices and sampled at pixel centres; the reciprocal of the depth
//! is affine on the image of a plane, so depths are perspective-correct. A lens with distortion bends
//! edges; here only vertices are bent, which for a triangle of `s` pixels errs by about `s²/8` times the
//! curvature of the image of its edges: far below a pixel for hulls, whose triangles have about one.
//! What lies in front of the near plane is cut off.

use crate::Mesh;
use capture::{Camera, Image, View};
use nalgebra::{Point2, Vector2, Vector3};
use rayon::prelude::*;

/// Depth along the optical axis in world units at each pixel centre, infinite where no surface is.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMap {
    /// As large as the camera's frame.
    pub depth: Image<f32>,
    /// The nearest face, [`NO_FACE`] where none is; only if asked for.
    pub faces: Option<Image<u32>>,
}

/// Marks pixels without a surface in [`DepthMap::faces`].
pub const NO_FACE: u32 = u32::MAX;

/// Depth of the near plane, relative to the farthest vertex in front of the camera.
const NEAR: f64 = 1e-6;

impl DepthMap {
    /// The depths of `mesh` seen by `camera`, in one thread. Faces with indices out of range, or with a
    /// vertex that is not finite or beyond the fold of the lens model, are left out.
    pub fn render(mesh: &Mesh, camera: &Camera) -> Self {
        let mut raster = Raster::new(camera, false);
        raster.draw(mesh, camera);
        raster.finish()
    }

    /// The same with the nearest face of each pixel.
    pub fn render_with_faces(mesh: &Mesh, camera: &Camera) -> Self {
        let mut raster = Raster::new(camera, true);
        raster.draw(mesh, camera);
        raster.finish()
    }

    /// Whether a surface covers the centre of pixel (`x`, `y`).
    pub fn covers(&self, x: usize, y: usize) -> bool {
        self.depth.at(x, y).is_finite()
    }
}

/// Intersection over union of the silhouette of `mesh` and the matte (object where ≥ 128), at pixel
/// centres; 1 where both are empty.
pub fn silhouette_iou(mesh: &Mesh, view: &View) -> f64 {
    let rendered = DepthMap::render(mesh, &view.camera);
    let (mut both, mut either) = (0usize, 0usize);
    for (depth, &matte) in rendered.depth.pixels().iter().zip(view.matte.pixels()) {
        let (covered, object) = (depth.is_finite(), matte >= 128);
        both += usize::from(covered && object);
        either += usize::from(covered || object);
    }
    if either == 0 { 1.0 } else { both as f64 / either as f64 }
}

/// Mean of [`silhouette_iou`] over views, in parallel; 0 without views.
pub fn mean_silhouette_iou(mesh: &Mesh, views: &[View]) -> f64 {
    // Collected before summing: the order of additions must not depend on threads.
    let values: Vec<f64> = views.par_iter().map(|view| silhouette_iou(mesh, view)).collect();
    if values.is_empty() { 0.0 } else { values.iter().sum::<f64>() / values.len() as f64 }
}

/// A projected vertex: pixel and reciprocal depth.
#[derive(Clone, Copy, Debug)]
struct Corner {
    pixel: Point2<f64>,
    inverse_depth: f64,
}

struct Raster {
    width: usize,
    height: usize,
    /// Reciprocal depths, 0 where nothing is: the nearest is the largest.
    nearest: Vec<f32>,
    faces: Vec<u32>,
}

impl Raster {
    fn new(camera: &Camera, with_faces: bool) -> Self {
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        let faces = if with_faces { vec![NO_FACE; width * height] } else { Vec::new() };
        Self { width, height, nearest: vec![0.0; width * height], faces }
    }

    fn finish(self) -> DepthMap {
        let depth = self.nearest.iter().map(|&w| if w > 0.0 { 1.0 / w } else { f32::INFINITY }).collect();
        let image = |pixels| Image::from_pixels(self.width, self.height, pixels).unwrap_or_default();
        let faces = (!self.faces.is_empty())
            .then(|| Image::from_pixels(self.width, self.height, self.faces).unwrap_or_default());
        DepthMap { depth: image(depth), faces }
    }

    fn draw(&mut self, mesh: &Mesh, camera: &Camera) {
        let points: Vec<Vector3<f64>> = mesh.positions.iter().map(|p| camera.to_camera(p)).collect();
        let near = NEAR * points.iter().map(|p| p.z).fold(0.0, f64::max);
        let corners: Vec<Option<Corner>> = points.iter().map(|p| project(camera, p, near)).collect();
        for (id, face) in mesh.faces.iter().enumerate() {
            let at = face.map(|v| corners.get(v as usize).copied().flatten());
            if let [Some(a), Some(b), Some(c)] = at {
                self.fill([a, b, c], id as u32);
            } else if face.iter().all(|&v| (v as usize) < points.len()) {
                self.draw_clipped(face.map(|v| points[v as usize]), near, camera, id as u32);
            }
        }
    }

    /// A face with a vertex at or behind the near plane, or one that does not project.
    fn draw_clipped(&mut self, points: [Vector3<f64>; 3], near: f64, camera: &Camera, id: u32) {
        let in_front = points.iter().filter(|p| p.z > near).count();
        if in_front == 0 || in_front == 3 {
            return;
        }
        let polygon = clip(points, near);
        let corners: Vec<Option<Corner>> = polygon.iter().map(|p| project(camera, p, 0.0)).collect();
        for i in 2..corners.len() {
            if let [Some(a), Some(b), Some(c)] = [corners[0], corners[i - 1], corners[i]] {
                self.fill([a, b, c], id);
            }
        }
    }

    /// Samples one triangle at the pixel centres it covers, borders included, row by row.
    fn fill(&mut self, corners: [Corner; 3], id: u32) {
        let [a, b, c] = corners.map(|corner| corner.pixel.coords);
        let area = cross(b - a, c - a);
        let (low, high) = (a.inf(&b).inf(&c), a.sup(&b).sup(&c));
        // Pixel i has its centre at i + ½. Casts saturate; NaN gives an empty range below.
        let first = |v: f64| (v - 0.5 - EDGE_SLACK).ceil().max(0.0) as usize;
        let end = |v: f64, n: usize| ((v - 0.5 + EDGE_SLACK).floor() + 1.0).clamp(0.0, n as f64) as usize;
        let (x0, x1) = (first(low.x), end(high.x, self.width));
        let (y0, y1) = (first(low.y), end(high.y, self.height));
        if x0 >= x1 || y0 >= y1 || area == 0.0 || !area.is_finite() {
            return;
        }
        let sign = area.signum();
        let edges = [Edge::new(b, c, sign), Edge::new(c, a, sign), Edge::new(a, b, sign)];
        let plane = InverseDepth::new(&corners, [a, b, c], area);
        for y in y0..y1 {
            let center_y = y as f64 + 0.5;
            let (from, to) = edges.iter().fold((x0 as f64, x1 as f64), |span, edge| edge.narrow(span, center_y));
            for x in from as usize..(to.max(0.0) as usize).min(x1) {
                self.sample(x, y, plane.at(x as f64 + 0.5, center_y), id);
            }
        }
    }

    #[inline]
    fn sample(&mut self, x: usize, y: usize, inverse_depth: f64, id: u32) {
        let index = y * self.width + x;
        let value = inverse_depth as f32;
        if value > self.nearest[index] {
            self.nearest[index] = value;
            if let Some(face) = self.faces.get_mut(index) {
                *face = id;
            }
        }
    }
}

/// Slack of coverage in pixels, so that rounding opens no crack between neighbours.
const EDGE_SLACK: f64 = 1e-9;

/// The half-plane `dx · x + dy · y + offset ≥ 0` on the inner side of an edge, in pixels.
struct Edge {
    dx: f64,
    dy: f64,
    offset: f64,
}

impl Edge {
    fn new(p: Vector2<f64>, q: Vector2<f64>, sign: f64) -> Self {
        let (dx, dy) = (sign * (p.y - q.y), sign * (q.x - p.x));
        let slack = EDGE_SLACK * (dx.abs() + dy.abs());
        Self { dx, dy, offset: slack - dx * p.x - dy * p.y }
    }

    /// The columns of `span` (from inclusive, to exclusive) whose centres are inside in row `y`.
    #[inline]
    fn narrow(&self, (from, to): (f64, f64), y: f64) -> (f64, f64) {
        let rest = self.dy * y + self.offset;
        if self.dx > 0.0 {
            (from.max((-rest / self.dx - 0.5).ceil()), to)
        } else if self.dx < 0.0 {
            (from, to.min((-rest / self.dx - 0.5).floor() + 1.0))
        } else if rest >= 0.0 {
            (from, to)
        } else {
            (from, from)
        }
    }
}

/// Reciprocal depth as an affine function of the pixel, clamped to the range of the corners because
/// slivers extrapolate.
struct InverseDepth {
    origin: Vector2<f64>,
    base: f64,
    slope: Vector2<f64>,
    low: f64,
    high: f64,
}

impl InverseDepth {
    fn new(corners: &[Corner; 3], [a, b, c]: [Vector2<f64>; 3], area: f64) -> Self {
        let [wa, wb, wc] = corners.map(|corner| corner.inverse_depth);
        let (u, v, du, dv) = (b - a, c - a, wb - wa, wc - wa);
        let slope = Vector2::new(du * v.y - dv * u.y, dv * u.x - du * v.x) / area;
        Self { origin: a, base: wa, slope, low: wa.min(wb).min(wc), high: wa.max(wb).max(wc) }
    }

    #[inline]
    fn at(&self, x: f64, y: f64) -> f64 {
        let w = self.base + self.slope.x * (x - self.origin.x) + self.slope.y * (y - self.origin.y);
        w.max(self.low).min(self.high)
    }
}

fn cross(a: Vector2<f64>, b: Vector2<f64>) -> f64 {
    a.x * b.y - a.y * b.x
}

fn project(camera: &Camera, p: &Vector3<f64>, near: f64) -> Option<Corner> {
    // Also refuses NaN.
    if !(p.z > near && p.x.is_finite() && p.y.is_finite() && p.z.is_finite()) {
        return None;
    }
    let plane = Vector2::new(p.x / p.z, p.y / p.z);
    let distortion = &camera.intrinsics.distortion;
    let plane = if distortion.is_none() { plane } else { distortion.distort(plane)? };
    Some(Corner { pixel: camera.intrinsics.pixel_from_plane(plane), inverse_depth: 1.0 / p.z })
}

/// The part of a triangle beyond the near plane, as a convex polygon.
fn clip(points: [Vector3<f64>; 3], near: f64) -> Vec<Vector3<f64>> {
    let mut polygon = Vec::with_capacity(4);
    for i in 0..3 {
        let (p, q) = (points[i], points[(i + 1) % 3]);
        if p.z > near {
            polygon.push(p);
        }
        if (p.z > near) != (q.z > near) {
            polygon.push(p + (q - p) * ((near - p.z) / (q.z - p.z)));
        }
    }
    polygon
}

#[cfg(test)]
mod tests {
    use super::*;
    use capture::Intrinsics;
    use nalgebra::{Matrix3, Point3};

    fn camera(width: usize, height: usize, focal: f64) -> Camera {
        let intrinsics = Intrinsics::pinhole(focal, [width, height]);
        Camera { intrinsics, rotation: Matrix3::identity(), translation: Vector3::zeros() }
    }

    /// A quad in the plane `z = 2 + x`, |x|, |y| ≤ 1.
    fn tilted_quad() -> Mesh {
        let corner = |x: f64, y: f64| Point3::new(x, y, 2.0 + x);
        let positions = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        Mesh { positions, faces: vec![[0, 1, 2], [0, 2, 3]] }
    }

    #[test]
    fn depth_of_a_plane_is_perspective_correct_and_without_cracks() {
        let camera = camera(64, 48, 60.0);
        let map = DepthMap::render_with_faces(&tilted_quad(), &camera);
        for y in 0..48 {
            for x in 0..64 {
                // The ray (X, Y, 1) t meets z = 2 + x at t = 2 / (1 − X), and the quad where |X t|, |Y t| ≤ 1.
                let (rx, ry) = ((x as f64 + 0.5 - 32.0) / 60.0, (y as f64 + 0.5 - 24.0) / 60.0);
                let t = 2.0 / (1.0 - rx);
                let hit = (rx * t).abs() <= 1.0 && (ry * t).abs() <= 1.0;
                assert_eq!(map.covers(x, y), hit, "{x} {y}");
                assert!(!hit || (f64::from(map.depth.at(x, y)) - t).abs() < 1e-5);
                assert_eq!(map.faces.as_ref().unwrap().at(x, y) != NO_FACE, hit);
            }
        }
    }

    #[test]
    fn the_near_plane_cuts_a_floor_under_the_camera() {
        let positions =
            vec![Point3::new(-50.0, 1.0, -50.0), Point3::new(50.0, 1.0, -50.0), Point3::new(0.0, 1.0, 100.0)];
        let mesh = Mesh { positions, faces: vec![[0, 1, 2]] };
        let map = DepthMap::render(&mesh, &camera(20, 20, 10.0));
        for y in 0..20 {
            let expected = 10.0 / (y as f64 + 0.5 - 10.0);
            assert_eq!(map.covers(10, y), expected > 0.0, "{y}");
            assert!(expected < 0.0 || (f64::from(map.depth.at(10, y)) / expected - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn broken_meshes_draw_nothing_and_do_not_panic() {
        let camera = camera(16, 16, 10.0);
        let mut mesh = tilted_quad();
        mesh.positions[2].x = f64::NAN;
        mesh.positions[3] = Point3::new(f64::INFINITY, 0.0, 2.0);
        mesh.faces.push([0, 1, 77]);
        mesh.faces.push([0, 0, 1]);
        let map = DepthMap::render(&mesh, &camera);
        assert!(map.depth.pixels().iter().all(|d| d.is_infinite()));
        assert!(!DepthMap::render(&Mesh::default(), &camera).covers(3, 3));
    }

    #[test]
    fn shared_edges_through_pixel_centres_leave_no_gap() {
        // A fan around a pixel centre with corners on pixel centres.
        let camera = camera(32, 32, 1.0);
        let at = |x: f64, y: f64| Point3::new(x + 0.5 - 16.0, y + 0.5 - 16.0, 1.0);
        let positions = vec![at(15.0, 15.0), at(5.0, 5.0), at(25.0, 5.0), at(25.0, 25.0), at(5.0, 25.0)];
        let mesh = Mesh { positions, faces: vec![[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]] };
        let map = DepthMap::render(&mesh, &camera);
        (5..=25).for_each(|y| (5..=25).for_each(|x| assert!(map.covers(x, y), "{x} {y}")));
    }
}
