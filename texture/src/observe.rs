//! What each photograph says about each texel: visibility, weight, colour.
//!
//! A texel with surface point X and normal n is observed in view j with weight
//! `w = visibility · α(m) · smoothstep(0.1, 0.25, cos θ)`, where m is the pixel X lands on, α the
//! eroded matte and θ the angle between n and the direction to the camera. Below cos θ = 0.1 (84°) a
//! texel's data is stretched over so few pixels that it counts as missing. A texel whose own triangle
//! faces away is hidden, whatever its smooth normal says: beside a crease that normal leans towards
//! cameras on the other side, and the slack of the depth test would take their colours. Colour is a Catmull–Rom
//! fetch, clamped to the pixels around so that it cannot overshoot at contours.
//!
//! Cost per texel and view: one projection, one depth look-up, 16 pixels.

use crate::surface::SurfaceTexels;
use capture::{Camera, Image, View};
use geometry::Mesh;
use geometry::depth::DepthMap;
use nalgebra::{Matrix3x4, Point2, Point3, Vector3};
use rayon::prelude::*;

/// Cosines between which a grazing texel fades from missing to fully trusted. What is seen at a
/// grazing angle is shown at one: against 0.17–0.35, the error at held-out views falls for every
/// method on temple ring (DynTex 3.77 to 3.69 %), full temple (3.06 to 3.04) and dinosaur (5.46 to 5.43).
const GRAZING: [f64; 2] = [0.1, 0.25];

/// Depth slack as a share of the object's diagonal: rounding of depths and of the simplified mesh.
const DEPTH_SLACK: f64 = 0.002;

/// Depth slack in pixel footprints times the tangent of the viewing angle: the depth map is compared
/// at the nearest of the 3×3 pixels around, up to 1.5 pixels away on a sloped surface.
const SLOPE_SLACK_PX: f64 = 1.5;

/// Tangents above this are as good as a surface seen edge-on.
const STEEPEST: f64 = 6.0;

/// One photograph ready to be asked about texels.
#[derive(Debug)]
pub(crate) struct Observer<'a> {
    view: &'a View,
    projection: Matrix3x4<f64>,
    center: Point3<f64>,
    /// Least depth of the mesh over 3×3 pixels, so that surface right beside an occluder is not
    /// trusted: the occluder's edge is only as exact as the proxy.
    nearest_depth: Image<f32>,
    /// Matte after erosion; its 128 level bounds what may be used.
    usable: Image<u8>,
    slack: f64,
    /// Whether each face of the mesh turns its outside to the camera.
    faces_camera: Vec<bool>,
}

/// A texel as one photograph shows it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Observation {
    /// Trust in [0, 1]; 0 = not seen.
    pub(crate) weight: f32,
    /// Encoded intensities 0..=255.
    pub(crate) color: [f32; 3],
}

impl<'a> Observer<'a> {
    /// Prepares `view` for a proxy; `mask_erode_px` is taken off its silhouette first.
    pub(crate) fn new(view: &'a View, mesh: &Mesh, mask_erode_px: f64) -> Self {
        let depth = DepthMap::render(mesh, &view.camera);
        let center = view.camera.center();
        let faces_camera = |face| mesh.face_area_vector(face).dot(&(center - mesh.corners(face)[0])) > 0.0;
        Self {
            view,
            projection: view.camera.projection_matrix(),
            center,
            nearest_depth: minimum_3x3(&depth.depth),
            usable: capture::erode(&view.matte, mask_erode_px),
            slack: DEPTH_SLACK * mesh.aabb().map_or(0.0, |b| b.diagonal()),
            faces_camera: (0..mesh.faces.len()).map(faces_camera).collect(),
        }
    }

    /// All views of a capture, prepared in parallel.
    pub(crate) fn prepare(views: &'a [View], mesh: &Mesh, mask_erode_px: f64) -> Vec<Self> {
        views.par_iter().map(|view| Self::new(view, mesh, mask_erode_px)).collect()
    }

    /// Where the photograph was taken from.
    pub(crate) fn center(&self) -> Point3<f64> {
        self.center
    }

    /// What the photograph says about a point of a face.
    fn observe(&self, face: u32, point: &Point3<f64>, normal: &Vector3<f64>) -> Observation {
        let to_camera = self.center - point;
        let distance = to_camera.norm();
        let cosine = normal.dot(&to_camera) / distance;
        let facing = smoothstep(GRAZING, cosine);
        if facing <= 0.0 || !self.faces_camera[face as usize] {
            return Observation::default();
        }
        let Some((pixel, depth)) = self.project(point) else { return Observation::default() };
        let camera = &self.view.camera;
        if !camera.in_frame(pixel) || !self.is_unoccluded(pixel, depth, cosine) {
            return Observation::default();
        }
        let covered = f64::from(self.usable.at(pixel.x as usize, pixel.y as usize)) / 255.0;
        if covered < 0.5 {
            return Observation::default();
        }
        Observation { weight: (facing * covered) as f32, color: fetch(&self.view.image, pixel) }
    }

    fn project(&self, point: &Point3<f64>) -> Option<(Point2<f64>, f64)> {
        let camera: &Camera = &self.view.camera;
        if !camera.intrinsics.distortion.is_none() {
            return camera.project(point).map(|p| (p.pixel, p.depth));
        }
        let m = self.projection * point.to_homogeneous();
        (m.z > 0.0).then(|| (Point2::new(m.x / m.z, m.y / m.z), m.z))
    }

    fn is_unoccluded(&self, pixel: Point2<f64>, depth: f64, cosine: f64) -> bool {
        let tangent = ((1.0 - cosine * cosine).max(0.0).sqrt() / cosine).min(STEEPEST);
        let footprint = depth / self.view.camera.intrinsics.fx.abs();
        let front = f64::from(self.nearest_depth.at(pixel.x as usize, pixel.y as usize));
        depth <= front + self.slack + SLOPE_SLACK_PX * footprint * tangent
    }
}

/// Observations of some texels in all views: one row of `views` entries per texel.
#[derive(Debug)]
pub(crate) struct Samples {
    /// How many views a row holds.
    pub(crate) views: usize,
    /// Row-major, texel by texel.
    pub(crate) rows: Vec<Observation>,
}

impl Samples {
    /// Asks every observer about every one of `texels`.
    pub(crate) fn gather(observers: &[Observer<'_>], surface: &SurfaceTexels, texels: &[u32]) -> Self {
        let views = observers.len();
        let mut rows = vec![Observation::default(); texels.len() * views];
        for (row, &t) in rows.chunks_exact_mut(views.max(1)).zip(texels) {
            let (face, point) = (surface.faces[t as usize], &surface.positions[t as usize]);
            let normal = &surface.normals[t as usize];
            row.iter_mut().zip(observers).for_each(|(cell, o)| *cell = o.observe(face, point, normal));
        }
        Self { views, rows }
    }

    /// The observations of the texel in row `i`.
    pub(crate) fn row(&self, i: usize) -> &[Observation] {
        &self.rows[i * self.views..(i + 1) * self.views]
    }
}

/// 0 below the first edge, 1 above the second, smooth between.
fn smoothstep([low, high]: [f64; 2], x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn minimum_3x3(depth: &Image<f32>) -> Image<f32> {
    let (w, h) = (depth.width(), depth.height());
    let mut out = Image::filled(w, h, f32::INFINITY);
    for y in 0..h {
        for x in 0..w {
            let mut least = f32::INFINITY;
            for v in y.saturating_sub(1)..(y + 2).min(h) {
                for u in x.saturating_sub(1)..(x + 2).min(w) {
                    least = least.min(depth.at(u, v));
                }
            }
            out.set(x, y, least);
        }
    }
    out
}

/// Catmull–Rom interpolation at `pixel`, clamped to the range of the 2×2 pixels around it.
pub(crate) fn fetch(image: &Image<[u8; 3]>, pixel: Point2<f64>) -> [f32; 3] {
    let (x, y) = (pixel.x - 0.5, pixel.y - 0.5);
    let (x0, y0) = (x.floor(), y.floor());
    let (wx, wy) = (catmull_rom((x - x0) as f32), catmull_rom((y - y0) as f32));
    let (x0, y0) = (x0 as isize, y0 as isize);
    let mut sum = [0.0f32; 3];
    let (mut low, mut high) = ([255.0f32; 3], [0.0f32; 3]);
    for (j, wy) in wy.iter().enumerate() {
        for (i, wx) in wx.iter().enumerate() {
            let sample = image.at_clamped(x0 + i as isize - 1, y0 + j as isize - 1).map(f32::from);
            let central = (1..3).contains(&i) && (1..3).contains(&j);
            for c in 0..3 {
                sum[c] += wx * wy * sample[c];
                if central {
                    low[c] = low[c].min(sample[c]);
                    high[c] = high[c].max(sample[c]);
                }
            }
        }
    }
    std::array::from_fn(|c| sum[c].clamp(low[c], high[c]))
}

/// Weights of the pixels at −1, 0, 1, 2 for a fraction `t` between 0 and 1.
fn catmull_rom(t: f32) -> [f32; 4] {
    [
        0.5 * t * (-1.0 + t * (2.0 - t)),
        1.0 + 0.5 * t * t * (3.0 * t - 5.0),
        0.5 * t * (1.0 + t * (4.0 - 3.0 * t)),
        0.5 * t * t * (t - 1.0),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fetching_a_ramp_gives_the_ramp_and_a_pixel_centre_the_pixel() {
        let pixels = (0..64).map(|i| [(i % 8 * 20) as u8, (i / 8 * 30) as u8, 7]).collect();
        let image = Image::from_pixels(8, 8, pixels).unwrap();
        assert_eq!(fetch(&image, Point2::new(3.5, 2.5)), [60.0, 60.0, 7.0]);
        let between = fetch(&image, Point2::new(4.1, 3.75));
        assert!((between[0] - 72.0).abs() < 1e-3 && (between[1] - 97.5).abs() < 1e-3, "{between:?}");
    }

    #[test]
    fn fetching_across_an_edge_does_not_overshoot() {
        let pixels = (0..64).map(|i| if i % 8 < 4 { [0; 3] } else { [255; 3] }).collect();
        let image = Image::from_pixels(8, 8, pixels).unwrap();
        for k in 0..80 {
            let v = fetch(&image, Point2::new(k as f64 * 0.1, 4.0))[0];
            assert!((0.0..=255.0).contains(&v), "{v} at {k}");
        }
    }
}
