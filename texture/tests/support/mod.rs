//! Boxes and balls with an atlas, and photographs of them by ray casting: nothing of ours is in the truth.

#![allow(dead_code, reason = "every test binary uses some of it")]
#![allow(clippy::unwrap_used, reason = "a helper that fails fails its test")]

use capture::{Camera, Image, Intrinsics, View};
use geometry::{Mesh, TexturedMesh};
use nalgebra::{Matrix3, Point2, Point3, Vector3};
use std::f64::consts::TAU;
use texture::{Bake, FitOptions, FitReport, Method, Model};

/// Texels along a side of the six charts.
const CHART: usize = 28;
/// Free texels around each.
const GAP: usize = 2;
/// Quads along a side of each chart.
const QUADS: usize = 6;

/// The cube [-1, 1]³, one chart a side.
pub(crate) fn cube() -> TexturedMesh {
    shape(|p| p)
}

/// The ball of radius 1, one chart for each side of the cube it is blown up from.
pub(crate) fn ball() -> TexturedMesh {
    shape(|p| p.normalize())
}

fn shape(place: impl Fn(Vector3<f64>) -> Vector3<f64>) -> TexturedMesh {
    let cell = CHART + 2 * GAP;
    let size = [3 * cell, 2 * cell];
    let (mut mesh, mut uvs, mut face_charts) = (Mesh::default(), Vec::new(), Vec::new());
    for chart in 0..6usize {
        let (normal, across, down) = side(chart);
        let first = mesh.positions.len() as u32;
        for (j, i) in (0..=QUADS).flat_map(|j| (0..=QUADS).map(move |i| (j, i))) {
            let (s, t) = (i as f64 / QUADS as f64, j as f64 / QUADS as f64);
            let p = normal + across * (2.0 * s - 1.0) + down * (2.0 * t - 1.0);
            mesh.positions.push(place(p).into());
            let texel = |k: usize, s: f64| (k * cell + GAP) as f64 + s * CHART as f64;
            uvs.push(Point2::new(texel(chart % 3, s) / size[0] as f64, texel(chart / 3, t) / size[1] as f64));
        }
        for (j, i) in (0..QUADS as u32).flat_map(|j| (0..QUADS as u32).map(move |i| (j, i))) {
            let row = QUADS as u32 + 1;
            let at = |dj: u32, di: u32| first + (j + dj) * row + i + di;
            mesh.faces.extend([[at(0, 0), at(0, 1), at(1, 1)], [at(0, 0), at(1, 1), at(1, 0)]]);
            face_charts.extend([chart as u32; 2]);
        }
    }
    TexturedMesh { mesh, uvs, face_charts, atlas_size: size }
}

/// Outward normal of a side, and two directions along it such that across × down points outward.
fn side(chart: usize) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
    let axis = |k: usize| Vector3::from_fn(|i, _| if i == k % 3 { 1.0 } else { 0.0 });
    let (n, a, b) = (axis(chart), axis(chart + 1), axis(chart + 2));
    if chart < 3 { (n, a, b) } else { (-n, b, a) }
}

/// Where a ray meets a solid first, and the normal there.
pub(crate) type Solid = fn(&Point3<f64>, &Vector3<f64>) -> Option<(Point3<f64>, Vector3<f64>)>;

/// [`cube`] by slabs.
pub(crate) fn cast_cube(origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<(Point3<f64>, Vector3<f64>)> {
    let (mut enter, mut leave, mut axis) = (f64::NEG_INFINITY, f64::INFINITY, 0);
    for k in 0..3 {
        let a = (-1.0 - origin[k]) / direction[k];
        let b = (1.0 - origin[k]) / direction[k];
        if a.min(b) > enter {
            (enter, axis) = (a.min(b), k);
        }
        leave = leave.min(a.max(b));
    }
    let normal = Vector3::from_fn(|i, _| if i == axis { -direction[axis].signum() } else { 0.0 });
    (enter < leave && enter > 0.0).then(|| (origin + direction * enter, normal))
}

/// A camera at `eye` that looks at the origin, z up.
pub(crate) fn camera(eye: Point3<f64>) -> Camera {
    let forward = -eye.coords.normalize();
    let right = forward.cross(&Vector3::z()).try_normalize(1e-9).unwrap_or_else(Vector3::x);
    let down = forward.cross(&right);
    let rotation = Matrix3::from_rows(&[right.transpose(), down.transpose(), forward.transpose()]);
    let intrinsics = Intrinsics::pinhole(1.3 * SIZE as f64, [SIZE, SIZE]);
    Camera { intrinsics, rotation, translation: -(rotation * eye.coords) }
}

const SIZE: usize = 96;

/// Eyes at distance 5: `n` around z, `elevation_deg` above.
pub(crate) fn ring(n: usize, elevation_deg: f64) -> Vec<Point3<f64>> {
    let e = elevation_deg.to_radians();
    let eye = |k: usize| {
        let a = TAU * (k as f64 + 0.3) / n as f64;
        Point3::new(5.0 * e.cos() * a.cos(), 5.0 * e.cos() * a.sin(), 5.0 * e.sin())
    };
    (0..n).map(eye).collect()
}

/// Three rings: everything is seen.
pub(crate) fn all_around() -> Vec<Point3<f64>> {
    [(8, -55.0), (12, 5.0), (8, 60.0)].into_iter().flat_map(|(n, e)| ring(n, e)).collect()
}

/// Photographs `solid`, whose colour is that of a point, its normal and the direction to the eye.
pub(crate) fn film(
    eyes: &[Point3<f64>],
    solid: Solid,
    color: impl Fn(&Point3<f64>, &Vector3<f64>, &Vector3<f64>) -> [u8; 3],
) -> Vec<View> {
    eyes.iter().enumerate().map(|(index, &eye)| photograph(index, eye, solid, &color)).collect()
}

fn photograph(
    index: usize,
    eye: Point3<f64>,
    solid: Solid,
    color: &impl Fn(&Point3<f64>, &Vector3<f64>, &Vector3<f64>) -> [u8; 3],
) -> View {
    let camera = camera(eye);
    let mut image = Image::filled(SIZE, SIZE, [0; 3]);
    let mut matte = Image::filled(SIZE, SIZE, 0);
    for (y, x) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (y, x))) {
        let ray = camera.ray(Point2::new(x as f64 + 0.5, y as f64 + 0.5)).unwrap();
        if let Some((point, normal)) = solid(&ray.origin, &ray.direction) {
            image.set(x, y, color(&point, &normal, &(eye - point).normalize()));
            matte.set(x, y, 255);
        }
    }
    View { index, name: format!("{index}"), image, matte, is_complete: true, camera }
}

/// A smooth texture that is the same from everywhere.
pub(crate) fn paint(p: &Point3<f64>) -> [f64; 3] {
    [p.x + 0.5 * p.y, p.y - p.z, p.z + 0.7 * p.x].map(|v| 128.0 + 70.0 * (1.7 * v).sin())
}

/// [`paint`] as 8-bit levels.
pub(crate) fn matt(p: &Point3<f64>, _: &Vector3<f64>, _: &Vector3<f64>) -> [u8; 3] {
    paint(p).map(|v| v.round() as u8)
}

/// [`paint`] with a broad highlight that moves with the eye.
pub(crate) fn glossy(p: &Point3<f64>, normal: &Vector3<f64>, to_eye: &Vector3<f64>) -> [u8; 3] {
    let light = Vector3::new(0.4, 0.5, 0.9).normalize();
    let shine = 60.0 * normal.dot(&(light + to_eye).normalize()).max(0.0).powi(8);
    paint(p).map(|v| (0.7 * v + shine).round() as u8)
}

/// Options that hold everything: small facets, every layer, the finest coding.
pub(crate) fn exact() -> FitOptions {
    FitOptions { layers: 64, tolerance: 0.0, quantiser: 1e-6, ..usual() }
}

/// Facets small enough for the small atlas; silhouettes eroded by what a colour is interpolated from, so that
/// the black backdrop stays out of it.
pub(crate) fn usual() -> FitOptions {
    FitOptions { facet_texels: 200, mask_erode_px: 1.5, ..FitOptions::default() }
}

pub(crate) fn fit(views: &[View], mesh: &TexturedMesh, method: Method, options: &FitOptions) -> (Model, FitReport) {
    texture::fit(&Bake::new(views, mesh, options).unwrap(), method, options).unwrap()
}

/// Texels that carry surface, with the point behind each.
pub(crate) fn texels(mesh: &TexturedMesh) -> Vec<(usize, Point3<f64>, Vector3<f64>)> {
    let surface = texture::SurfaceTexels::bake(mesh);
    (0..surface.len()).map(|t| (surface.index[t] as usize, surface.positions[t], surface.normals[t])).collect()
}
