//! Accuracy and completeness against answers known beforehand.

#![allow(clippy::unwrap_used, reason = "a test: failing is what unwrap is for")]

use geometry::{Accuracy, AccuracyOptions, Mesh, accuracy};
use nalgebra::Point3;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

const TOLERANCE: f64 = 1.25;

fn judge(mesh: &Mesh, truth: &Mesh) -> Accuracy {
    let options = AccuracyOptions { samples: 20_000, ..AccuracyOptions::new(TOLERANCE) };
    accuracy(mesh, truth, &options).unwrap()
}

fn assert_near(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value} is not {expected} within {tolerance}");
}

/// An octahedron divided `levels` times, every vertex on the sphere: sagitta about `radius / 4^levels`.
fn sphere(radius: f64, levels: usize) -> Mesh {
    let axes = [[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
    let mut positions: Vec<Point3<f64>> = axes.map(Point3::from).to_vec();
    let mut faces = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..levels {
        let mut middles = BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                positions
                    .push(((positions[a as usize].coords + positions[b as usize].coords) / 2.0).normalize().into());
                positions.len() as u32 - 1
            })
        };
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                let (d, e, f) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
            })
            .collect();
    }
    positions.iter_mut().for_each(|p| *p *= radius);
    Mesh { positions, faces }
}

/// A square of 2 × 2 at height `z`, in 2 n² triangles that face up.
fn square(n: u32, z: f64) -> Mesh {
    let at = |i: u32| f64::from(i) * 2.0 / f64::from(n) - 1.0;
    let positions = (0..=n).flat_map(|j| (0..=n).map(move |i| Point3::new(at(i), at(j), z))).collect();
    let corner = |i: u32, j: u32| j * (n + 1) + i;
    let cell = |i: u32, j: u32| {
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    Mesh { positions, faces: (0..n).flat_map(|j| (0..n).flat_map(move |i| cell(i, j))).collect() }
}

#[test]
fn concentric_spheres_differ_by_their_radii() {
    let (large, small) = (sphere(10.5, 5), sphere(10.0, 5));
    let found = judge(&large, &small);
    // 10.5 / 4⁵ of sagitta.
    assert_near(found.accuracy, 0.5, 0.01);
    assert_eq!(found.completeness_pct, 100.0);
    assert_near(found.hausdorff, 0.5, 0.02);
    assert_near(found.from_mesh.mean, 0.5, 0.01);
    assert_near(found.from_mesh.rms, 0.5, 0.01);
    assert_near(found.from_mesh.signed_mean.unwrap(), 0.5, 0.01);
    assert_near(found.from_truth.signed_mean.unwrap(), -0.5, 0.01);
    let options = AccuracyOptions { samples: 1000, ..AccuracyOptions::new(0.4) };
    assert_eq!(accuracy(&large, &small, &options).unwrap().completeness_pct, 0.0);
}

#[test]
fn a_plane_moved_is_off_by_as_much() {
    let found = judge(&square(3, 0.25), &square(4, 0.0));
    for value in [found.accuracy, found.hausdorff, found.from_mesh.mean, found.from_mesh.rms] {
        assert_near(value, 0.25, 1e-12);
    }
    assert_near(found.from_mesh.signed_mean.unwrap(), 0.25, 1e-12);
    assert_near(found.from_truth.signed_mean.unwrap(), -0.25, 1e-12);
}

#[test]
fn a_mesh_is_no_distance_from_itself() {
    let mesh = sphere(1.0, 3);
    let found = judge(&mesh, &mesh);
    assert!(found.hausdorff < 1e-14 && found.accuracy < 1e-14 && found.from_mesh.rms < 1e-14, "{found:?}");
    assert_eq!(found.completeness_pct, 100.0);
}

/// The half with z > 0.
fn upper_half(mut mesh: Mesh) -> Mesh {
    let is_upper = |face: &[u32; 3]| face.iter().all(|&v| mesh.positions[v as usize].z >= 0.0);
    mesh.faces = mesh.faces.iter().copied().filter(is_upper).collect();
    mesh
}

#[test]
fn half_a_sphere_is_accurate_but_half_complete() {
    let whole = sphere(100.0, 5);
    let half = upper_half(whole.clone());
    let found = judge(&half, &whole);
    assert!(found.accuracy < 1e-12, "{found:?}");
    // Within reach of the rim lies a band of height sin(1.25 / 100) of the lower half.
    assert_near(found.completeness_pct, 50.0 + 50.0 * 0.0125, 0.2);
    // From the south pole to the rim, a polygon of 128 corners: its sides are 0.03 inside the circle.
    assert_near(found.hausdorff, 100.0 * 2.0_f64.sqrt(), 0.03);
}

#[test]
fn what_the_truth_does_not_hold_is_not_judged_unless_asked_for() {
    let whole = sphere(100.0, 5);
    let half = upper_half(whole.clone());
    let found = judge(&whole, &half);
    assert!(found.hausdorff < 1e-12, "{found:?}");
    assert_near(found.from_mesh.left_out_pct, 50.0, 0.1);
    assert_eq!(found.completeness_pct, 100.0);
    let all = AccuracyOptions { holes_are_unknown: false, samples: 20_000, ..AccuracyOptions::new(TOLERANCE) };
    let strict = accuracy(&whole, &half, &all).unwrap();
    // 90 % of the whole is 80 % of the lower half: what lies above z = −0.8 R, for the area of a zone goes
    // with its height. That parallel is at latitude asin 0.8, and from the rim by the chord.
    assert_near(strict.accuracy, 200.0 * (0.8_f64.asin() / 2.0).sin(), 0.5);
    assert_eq!(strict.from_mesh.left_out_pct, 0.0);
}

#[test]
fn swapped_arguments_swap_the_directions() {
    let (a, b) = (sphere(1.0, 2), square(5, 0.1));
    let options = AccuracyOptions { holes_are_unknown: false, samples: 5000, ..AccuracyOptions::new(0.3) };
    let (forth, back) = (accuracy(&a, &b, &options).unwrap(), accuracy(&b, &a, &options).unwrap());
    assert_eq!((forth.from_mesh, forth.from_truth), (back.from_truth, back.from_mesh));
    assert_eq!(forth.hausdorff, back.hausdorff);
    assert_ne!(forth.accuracy, back.accuracy);
}

#[test]
fn a_coarse_mesh_is_judged_on_its_surface() {
    let coarse = sphere(1.0, 2);
    assert!(coarse.positions.len() < 100);
    let found = judge(&coarse, &sphere(1.0, 6));
    // Its vertices lie on the sphere, its faces inside by up to the sagitta of its circumcircles.
    assert!(found.accuracy > 0.03 && found.accuracy < 0.1, "{found:?}");
    assert!(found.from_mesh.signed_mean.unwrap() < -0.02, "{found:?}");
}

#[test]
fn faces_without_area_and_unused_vertices_do_not_count() {
    let truth = sphere(1.0, 3);
    let mut mesh = sphere(1.1, 3);
    let clean = judge(&mesh, &truth);
    mesh.positions.push(Point3::new(50.0, 0.0, 0.0));
    mesh.faces.extend([[0, 0, 1], [2, 2, 2]]);
    assert_eq!(judge(&mesh, &truth), clean);
}

#[test]
fn any_number_of_threads_gives_the_same_figures() {
    let (mesh, truth) = (sphere(1.1, 4), square(6, 0.0));
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| judge(&mesh, &truth))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn what_cannot_be_judged_is_refused_by_name() {
    let good = sphere(1.0, 1);
    let options = AccuracyOptions::new(TOLERANCE);
    let message = |mesh: &Mesh, truth: &Mesh, options| accuracy(mesh, truth, &options).unwrap_err().to_string();
    assert!(message(&Mesh::default(), &good, options).starts_with("the mesh has no face"));
    assert!(message(&good, &Mesh::default(), options).starts_with("the true mesh has no face"));
    let mut broken = good.clone();
    broken.positions[2].y = f64::NAN;
    assert!(message(&good, &broken, options).contains("vertex 2 is not finite"));
    assert!(message(&good, &sphere(1e90, 1), options).contains("true mesh are too far apart"));
    for (name, bad) in [
        ("accuracy_pct", AccuracyOptions { accuracy_pct: 0.0, ..options }),
        ("accuracy_pct", AccuracyOptions { accuracy_pct: f64::NAN, ..options }),
        ("tolerance", AccuracyOptions::new(-1.0)),
        ("samples", AccuracyOptions { samples: 0, ..options }),
    ] {
        assert!(message(&good, &good, bad).starts_with(name), "{name}");
    }
    // One triangle, and a mesh in its plane that does not reach it: all nearest points are on its border.
    let far = Mesh {
        positions: (0..3).map(|i| (f64::from(i) * TAU / 3.0).sin_cos()).map(|(s, c)| Point3::new(s, c, 0.0)).collect(),
        faces: vec![[0, 1, 2]],
    };
    let beside = square(2, 0.0).positions.iter().map(|p| p + nalgebra::Vector3::new(9.0, 0.0, 0.0)).collect();
    let beside = Mesh { positions: beside, ..square(2, 0.0) };
    assert!(message(&beside, &far, options).contains("border"));
}
