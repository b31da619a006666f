//! Cameras against known answers, and what is written against what is read.

#![allow(clippy::unwrap_used, reason = "tests fail by panicking, helpers included")]

use capture::{Aabb, Camera, Capture, CaptureError, Distortion, Frame, Image, Intrinsics, LoadOptions, MaskSource};
use nalgebra::{Matrix3, Point2, Point3, Rotation3, Vector2, Vector3};
use std::path::{Path, PathBuf};

fn temple_lens() -> Intrinsics {
    let distortion = Distortion::default();
    // Moved by the half pixel of our origin.
    Intrinsics { fx: 1520.4, fy: 1525.9, skew: 0.0, cx: 302.82, cy: 247.37, distortion, width: 640, height: 480 }
}

fn camera(i: usize) -> Camera {
    let rotation = Rotation3::from_euler_angles(0.3, 0.17 * i as f64, -0.1).into_inner();
    let distortion = Distortion { k1: -0.25, k2: 0.08, k3: 0.001, p1: 0.001, p2: -0.0005 };
    let intrinsics = Intrinsics { skew: 0.7, distortion, width: 20, height: 10, ..temple_lens() };
    Camera { intrinsics, rotation, translation: Vector3::new(0.1, -0.2, 1.5 + i as f64 / 3.0) }
}

#[test]
fn temple_projects_as_computed_by_hand() {
    let camera = Camera { intrinsics: temple_lens(), rotation: Matrix3::identity(), translation: Vector3::zeros() };
    let pixel = camera.project(&Point3::new(0.01, -0.02, 0.5)).unwrap().pixel;
    // (332.728, 185.834) with integer centres.
    assert!((pixel - Point2::new(333.228, 186.334)).norm() < 1e-9);
    for z in [0.0, -0.5, f64::NAN] {
        assert!(camera.project(&Point3::new(0.01, -0.02, z)).is_none(), "{z}");
    }
}

#[test]
fn distortion_has_its_known_answer_and_inverse() {
    let lens = Distortion { k1: -0.25, k2: 0.08, p1: 0.001, p2: -0.0005, k3: 0.0 };
    let distorted = lens.distort(Vector2::new(0.3, -0.2)).unwrap();
    assert!((distorted - Vector2::new(0.290_380_6, -0.193_500_4)).norm() < 1e-7, "{distorted}");
    for i in 0..36 {
        let p = Vector2::new(0.1, 0.0) * (f64::from(i) / 6.0);
        let p = nalgebra::Rotation2::new(f64::from(i)) * p;
        assert!((lens.undistort(lens.distort(p).unwrap()).unwrap() - p).norm() < 1e-12, "{p}");
    }
    // With k1 = −0.25 alone the model folds at 1/√0.75 = 1.1547.
    let fold = Distortion { k1: -0.25, ..Distortion::default() };
    assert!(fold.distort(Vector2::new(1.154, 0.0)).is_some());
    assert!(fold.distort(Vector2::new(1.155, 0.0)).is_none());
    assert!(fold.undistort(Vector2::new(2.0, 0.0)).is_none());
}

#[test]
fn rays_pass_through_the_points_they_came_from() {
    let camera = camera(2);
    for point in [Point3::new(0.01, 0.02, 0.03), Point3::new(-0.1, 0.2, 0.0)] {
        let seen = camera.project(&point).unwrap();
        let ray = camera.ray(seen.pixel).unwrap();
        assert!((point - ray.origin).cross(&ray.direction).norm() < 1e-12);
        let half = camera.downscaled(2).project(&point).unwrap().pixel;
        assert!((half - seen.pixel / 2.0).norm() < 1e-9);
    }
}

/// Three frames of 20×10 with a bright square; two share a file name.
fn example(dir: &Path) -> Capture {
    let frames = ["x/a.png", "y/a.png", "y/b.png"].iter().enumerate().map(|(i, name)| {
        let image_path = dir.join(name);
        std::fs::create_dir_all(image_path.parent().unwrap()).unwrap();
        let mut image = Image::filled(20, 10, [0, 0, 0]);
        let mut mask = Image::filled(20, 10, 0);
        for x in 5..9 + i {
            image.set(x, 4, [200, 100, 50]);
            mask.set(x, 4, 255);
        }
        capture::write_rgb(&image_path, &image).unwrap();
        let mask_path = image_path.with_extension("m.png");
        capture::write_matte(&mask_path, &mask).unwrap();
        let light_direction = Some(Vector3::new(0.6, 0.0, 0.8));
        Frame { image_path, mask_path: Some(mask_path), camera: camera(i), light_direction, exposure: Some(1.5) }
    });
    let aabb = Some(Aabb { min: Point3::new(-1.0, -2.0, -3.0), max: Point3::new(0.1, 0.2, 0.3) });
    Capture { frames: frames.collect(), aabb, unit: Some(0.01), mask_source: MaskSource::MaskPath }
}

#[test]
fn a_written_capture_comes_back() {
    let dir = tempfile::tempdir().unwrap();
    let capture = example(dir.path());
    let out = dir.path().join("deep/owl");
    // The second write replaces the first, with the report beside it.
    capture.write(&out).unwrap();
    std::fs::write(out.join("report.html"), "<!doctype html>").unwrap();
    capture.write(&out).unwrap();
    assert!(!out.join("report.html").exists());
    let back = Capture::read(&out).unwrap();
    assert_eq!((back.aabb, back.unit, back.mask_source), (capture.aabb, capture.unit, MaskSource::MaskPath));
    for (a, b) in capture.frames.iter().zip(&back.frames) {
        assert!((a.camera.projection_matrix() - b.camera.projection_matrix()).amax() < 1e-9);
        assert_eq!(a.camera.intrinsics, b.camera.intrinsics);
        assert_eq!((a.exposure, a.light_direction), (b.exposure, b.light_direction));
    }
    let options = LoadOptions::default();
    let (before, after) = (capture.load_all_views(&options).unwrap(), back.load_all_views(&options).unwrap());
    for (a, b) in before.iter().zip(&after) {
        assert_eq!((&a.image, &a.matte), (&b.image, &b.matte));
    }
    let left: Vec<PathBuf> = std::fs::read_dir(out.parent().unwrap()).unwrap().map(|e| e.unwrap().path()).collect();
    assert_eq!(left, [out], "nothing is left beside");
}

#[test]
fn folders_of_others_are_not_replaced() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("diary.txt"), "dear").unwrap();
    let error = example(dir.path()).write(&out).unwrap_err().to_string();
    assert!(error.contains("holds other files"), "{error}");
}

#[test]
fn faulty_files_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let capture = example(dir.path());
    let load = |capture: &Capture| capture.load_all_views(&LoadOptions::default()).unwrap_err().to_string();
    let with = |change: &dyn Fn(&mut Frame)| {
        let mut capture = capture.clone();
        change(&mut capture.frames[1]);
        load(&capture)
    };
    assert!(with(&|f| f.image_path = dir.path().join("gone.png")).contains("gone.png"));
    assert!(with(&|f| f.camera.intrinsics.width = 21).contains("a.png: is 20x10, its camera is for 21x10"));
    let small = dir.path().join("small.png");
    capture::write_matte(&small, &Image::filled(3, 3, 255)).unwrap();
    assert!(with(&|f| f.mask_path = Some(small.clone())).contains("small.png: is 3x3"));
    let empty = dir.path().join("empty.png");
    capture::write_matte(&empty, &Image::filled(20, 10, 0)).unwrap();
    assert!(with(&|f| f.mask_path = Some(empty.clone())).contains("empty.png: its silhouette is empty"));
    let cut = dir.path().join("cut.png");
    let whole = std::fs::read(&capture.frames[0].image_path).unwrap();
    std::fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
    assert!(with(&|f| f.image_path = cut.clone()).contains("cut.png: is truncated or damaged"));
    let beyond = capture.load_views(&[3], &LoadOptions::default());
    assert!(matches!(beyond, Err(CaptureError::Position { position: 3, frames: 3 })));
    assert!(capture.load_views(&[0], &LoadOptions { downscale: 0 }).is_err());
}

#[test]
fn masks_of_any_depth_mean_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.png");
    for (values, expected) in [([0, 1, 1], [0, 255, 255]), ([0, 100, 255], [0, 100, 255]), ([0, 3, 90], [0, 255, 255])]
    {
        capture::write_matte(&path, &Image::from_pixels(3, 1, values.to_vec()).unwrap()).unwrap();
        assert_eq!(capture::read_matte(&path).unwrap().pixels(), expected);
    }
}
