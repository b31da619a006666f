//! The carved hull against hulls that are known, at two resolutions of images and grid.

#![allow(clippy::unwrap_used, reason = "a test: failing is what unwrap is for")]

use capture::{Aabb, Camera, Image, Intrinsics, View};
use data_synth::hull_truth::{Ball, BallHull, ConvexHull, PolyhedronHull};
use geometry::{AccuracyOptions, HullOptions, Mesh, accuracy, visual_hull};
use nalgebra::{Matrix3, Point2, Point3, Vector3};
use std::f64::consts::TAU;

/// Pixels of an image's side, and cells of the grid's.
const COARSE: usize = 48;
const FINE: usize = 96;

/// Cameras around the origin on two rings, six radii of a unit ball away, that see 2.4 units of its height.
fn cameras(size: usize) -> Vec<Camera> {
    let at = |i: usize| {
        let elevation: f64 = if i.is_multiple_of(2) { 0.2 } else { 0.7 };
        let ((se, ce), (sa, ca)) = (elevation.sin_cos(), (TAU * (i as f64 + 0.3) / 9.0).sin_cos());
        let outward = Vector3::new(ce * ca, ce * sa, se);
        let right = Vector3::new(-sa, ca, 0.0);
        let rotation =
            Matrix3::from_rows(&[right.transpose(), (-outward).cross(&right).transpose(), -outward.transpose()]);
        let intrinsics = Intrinsics::pinhole(size as f64 * 6.0 / 3.2, [size, size]);
        Camera { intrinsics, rotation, translation: -(rotation * outward * 6.0) }
    };
    (0..9).map(at).collect()
}

fn eyes() -> Vec<Point3<f64>> {
    cameras(FINE).iter().map(Camera::center).collect()
}

/// The carved hull of what lines of sight `meet`, from mattes of 36 samples a pixel.
fn carved(size: usize, meet: impl Fn(&Camera, Point2<f64>) -> bool) -> Mesh {
    let view = |(index, camera): (usize, Camera)| {
        let covered = |x: usize, y: usize| {
            let at = |pixel: usize, i: usize| pixel as f64 + (i as f64 + 0.5) / 6.0;
            let hits = (0..36).filter(|i| meet(&camera, Point2::new(at(x, i % 6), at(y, i / 6))));
            hits.count() * 255 / 36
        };
        let pixels = (0..size * size).map(|i| covered(i % size, i / size) as u8).collect();
        let matte = Image::from_pixels(size, size, pixels).unwrap();
        let image = Image::filled(size, size, [0; 3]);
        View { index, name: index.to_string(), image, matte, is_complete: true, camera }
    };
    let views: Vec<View> = cameras(size).into_iter().enumerate().map(view).collect();
    let options = HullOptions { resolution: Some(size), aabb: Some(bounds()), ..HullOptions::default() };
    visual_hull(&views, &options).unwrap().mesh
}

fn bounds() -> Aabb {
    Aabb { min: Point3::new(-1.6, -1.6, -1.6), max: Point3::new(1.6, 1.6, 1.6) }
}

/// The error falls about as the size of pixels and cells does, and is a fraction of a cell of 3.2 / [`FINE`].
fn assert_converges(coarse: f64, fine: f64) {
    assert!(fine < 0.7 * coarse && fine < 0.3 * 3.2 / FINE as f64, "{coarse} then {fine}");
}

fn rms(errors: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = errors.len() as f64;
    (errors.map(|e| e * e).sum::<f64>() / count).sqrt()
}

#[test]
fn carved_balls_approach_their_cones() {
    let balls = [
        Ball { center: Point3::new(0.0, 0.5, 0.1), radius: 0.5 },
        Ball { center: Point3::new(0.2, -0.6, -0.2), radius: 0.4 },
    ];
    let truth = BallHull::new(&balls, &eyes()).unwrap();
    let sees = |camera: &Camera, pixel: Point2<f64>| {
        let ray = camera.ray(pixel).unwrap();
        balls.iter().any(|b| (b.center - ray.origin).cross(&ray.direction).norm() <= b.radius)
    };
    let error = |size| rms(carved(size, sees).positions.iter().map(|p| truth.distance(p)));
    assert_converges(error(COARSE), error(FINE));
    // And the exact mesh is complete: it adds what carving left out.
    let options = AccuracyOptions { samples: 20_000, ..AccuracyOptions::new(0.02) };
    let exact = truth.mesh(&bounds(), 0.05).unwrap();
    let found = accuracy(&carved(FINE, sees), &exact, &options).unwrap();
    assert!(found.completeness_pct > 99.5 && found.accuracy < 0.02, "{found:?}");
    for ball in balls {
        assert!(truth.distance(&ball.center) < 1e-12 - ball.radius, "the hull holds the object");
    }
}

/// A box with its corners at (±0.9, ±0.5, ±0.6), turned about the vertical.
fn turned_box() -> Vec<Point3<f64>> {
    let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), 0.5);
    let sign = |i: usize, axis: usize| if i >> axis & 1 == 0 { -1.0 } else { 1.0 };
    (0..8).map(|i| turn * Point3::new(0.9 * sign(i, 0), 0.5 * sign(i, 1), 0.6 * sign(i, 2))).collect()
}

#[test]
fn a_carved_box_approaches_its_polytope() {
    let corners = turned_box();
    let truth = ConvexHull::new(&corners, &eyes(), &bounds()).unwrap();
    assert!(corners.iter().all(|v| truth.distance(v) < 1e-12), "the hull holds the object");
    // What one camera alone sees is a polytope too.
    let cones: Vec<ConvexHull> = eyes()
        .iter()
        .map(|eye| ConvexHull::new(&corners, &[*eye], &Aabb { min: bounds().min * 9.0, max: bounds().max * 9.0 }))
        .collect::<Result<_, _>>()
        .unwrap();
    let sees = |camera: &Camera, pixel: Point2<f64>| {
        let ray = camera.ray(pixel).unwrap();
        let cone = cones.iter().zip(eyes()).find(|(_, eye)| (eye - ray.origin).norm() < 1e-9).unwrap().0;
        cone.contains(&(ray.origin + ray.direction * 6.0))
    };
    let options = AccuracyOptions { samples: 20_000, ..AccuracyOptions::new(0.02) };
    let judged = |size| accuracy(&carved(size, sees), truth.mesh(), &options).unwrap();
    let (coarse, fine) = (judged(COARSE), judged(FINE));
    assert_converges(coarse.from_mesh.rms, fine.from_mesh.rms);
    assert_converges(coarse.accuracy, fine.accuracy);
    assert!(fine.completeness_pct > 99.0 && fine.completeness_pct >= coarse.completeness_pct, "{fine:?}");
}

/// The plan [−1, 1]² without the quarter x, y > 0, scaled by 0.8; z from −0.4 to 0.4.
fn house() -> Mesh {
    let plan = [[0.0, 0.0], [0.0, 0.8], [-0.8, 0.8], [-0.8, -0.8], [0.8, -0.8], [0.8, 0.0]];
    let level = |z: f64| plan.map(|[x, y]| Point3::new(x, y, z));
    let caps = (1..5).flat_map(|i| [[0, i + 1, i], [6, 6 + i, 7 + i]]);
    let walls = (0..6).flat_map(|i| [[i, (i + 1) % 6, (i + 1) % 6 + 6], [i, (i + 1) % 6 + 6, i + 6]]);
    Mesh { positions: [level(-0.4), level(0.4)].concat(), faces: caps.chain(walls).collect() }
}

#[test]
fn a_carved_house_approaches_its_lines_of_sight() {
    let truth = PolyhedronHull::new(&house(), &eyes()).unwrap();
    let alone: Vec<PolyhedronHull> = eyes().iter().map(|eye| PolyhedronHull::new(&house(), &[*eye]).unwrap()).collect();
    let sees = |camera: &Camera, pixel: Point2<f64>| {
        let ray = camera.ray(pixel).unwrap();
        let seen = alone.iter().zip(eyes()).find(|(_, eye)| (eye - ray.origin).norm() < 1e-9).unwrap().0;
        seen.contains(&(ray.origin + ray.direction))
    };
    // How far along its normal each vertex is from where membership changes.
    let error = |size: usize| {
        let mesh = carved(size, sees);
        let reach = 4.0 * 3.2 / size as f64;
        let off = |(p, n): (&Point3<f64>, &Vector3<f64>)| {
            let (mut low, mut high) = (-reach, reach);
            for _ in 0..20 {
                let middle = (low + high) / 2.0;
                if truth.contains(&(p + n * middle)) { low = middle } else { high = middle }
            }
            low
        };
        let offsets: Vec<f64> = mesh.positions.iter().zip(&mesh.vertex_normals()).map(off).collect();
        rms(offsets.into_iter())
    };
    let (coarse, fine) = (error(COARSE), error(FINE));
    assert!(fine < 0.7 * coarse && fine < 0.5 * 3.2 / FINE as f64, "{coarse} then {fine}");
}
