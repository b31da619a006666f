//! Scenes with exact silhouettes, and readers of the shared captures, for the hull tests.
#![allow(dead_code, unreachable_pub, clippy::unwrap_used, reason = "test support; each test binary uses its own part")]

use capture::{Camera, Capture, Image, Intrinsics, LoadOptions, View};
use nalgebra::{Matrix3, Point2, Point3, Vector3};
use std::path::{Path, PathBuf};

/// A camera at `eye` that looks at the origin, `up` upwards in the image.
pub fn looking_at_origin(eye: Point3<f64>, up: Vector3<f64>, focal: f64, size: usize) -> Camera {
    let z = -eye.coords.normalize();
    let x = z.cross(&up).normalize();
    let y = z.cross(&x);
    let rotation = Matrix3::from_rows(&[x.transpose(), y.transpose(), z.transpose()]);
    Camera { intrinsics: Intrinsics::pinhole(focal, [size, size]), rotation, translation: -(rotation * eye.coords) }
}

/// A view whose matte is the coverage of `inside(pixel)`, by `samples²` samples a pixel.
pub fn view(index: usize, camera: Camera, samples: usize, inside: impl Fn(Point2<f64>) -> bool) -> View {
    let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
    let mut matte = Image::filled(width, height, 0u8);
    for y in 0..height {
        for x in 0..width {
            let at = |o: usize, i: usize| o as f64 + (i as f64 + 0.5) / samples as f64;
            let hits = (0..samples * samples).filter(|i| inside(Point2::new(at(x, i % samples), at(y, i / samples))));
            matte.set(x, y, (hits.count() as f64 * 255.0 / (samples * samples) as f64).round() as u8);
        }
    }
    from_matte(index, camera, matte)
}

/// A view with this matte and a black image, complete where the matte does not touch the border.
pub fn from_matte(index: usize, camera: Camera, matte: Image<u8>) -> View {
    let (w, h) = (matte.width(), matte.height());
    let object = |x: usize, y: usize| matte.at(x, y) >= 128;
    let touches = (0..w).any(|x| object(x, 0) || object(x, h - 1)) || (0..h).any(|y| object(0, y) || object(w - 1, y));
    let image = Image::filled(w, h, [0; 3]);
    View { index, name: format!("view{index:03}"), image, matte, is_complete: !touches, camera }
}

/// Whether the viewing ray of `pixel` passes within `radius` of `center`.
pub fn sees_sphere(camera: &Camera, pixel: Point2<f64>, center: Point3<f64>, radius: f64) -> bool {
    camera.ray(pixel).is_some_and(|ray| (center - ray.origin).cross(&ray.direction).norm() <= radius)
}

/// Views of a sphere from a ring of `n` cameras at `elevation` radians, distance `distance`.
pub fn sphere_ring(n: usize, elevation: f64, distance: f64, focal: f64, size: usize, radius: f64) -> Vec<View> {
    (0..n)
        .map(|i| {
            let azimuth = 2.0 * std::f64::consts::PI * i as f64 / n as f64;
            let (s, c) = (elevation.sin(), elevation.cos());
            let eye = Point3::new(c * azimuth.cos(), c * azimuth.sin(), s) * distance;
            let camera = looking_at_origin(eye, Vector3::z(), focal, size);
            view(i, camera, 4, |p| sees_sphere(&camera, p, Point3::origin(), radius))
        })
        .collect()
}

/// `shared/data/NAME`, or `None` with a message where it is absent.
pub fn shared(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data").join(name);
    if !path.is_dir() {
        println!("skipped: {} is absent", path.display());
        return None;
    }
    Some(path)
}

/// Every view of a calibrated folder.
pub fn all_views(folder: &Path) -> Vec<View> {
    Capture::read(folder).unwrap().load_all_views(&LoadOptions::default()).unwrap()
}

/// The analytic torus, with masks from `masks` or `masks_aa`.
pub fn torus(folder: &Path, masks: &str) -> Vec<View> {
    let (elevation, distance, n) = (25f64.to_radians(), 3.0, 36);
    let (s, c) = (elevation.sin(), elevation.cos());
    (0..n)
        .map(|i| {
            let azimuth = 2.0 * std::f64::consts::PI * i as f64 / n as f64;
            let eye = Point3::new(c * azimuth.cos(), c * azimuth.sin(), s) * distance;
            let matte = read_matte(&folder.join(masks).join(format!("{i:03}.png")));
            let mut camera = looking_at_origin(eye, Vector3::z(), 700.0, 640);
            (camera.intrinsics.height, camera.intrinsics.cy) = (480, 240.0);
            from_matte(i, camera, matte)
        })
        .collect()
}

/// An 8-bit grey image.
pub fn read_matte(path: &Path) -> Image<u8> {
    let grey = image::open(path).unwrap().to_luma8();
    Image::from_pixels(grey.width() as usize, grey.height() as usize, grey.into_raw()).unwrap()
}
