//! How long does it take to judge a mesh of 50 000 faces, and what does the tree save?
//!
//! `cargo bench -p geometry --bench accuracy`. `tree` judges both ways, on 10⁵ points and all 25 000
//! vertices each, building of the trees included; `every_triangle` finds the distances of 100 points by trying
//! all faces, on one thread: times 2500 for the same work.

#[path = "../tests/atlas_shapes/mod.rs"]
mod shapes;

use divan::Bencher;
use geometry::{AccuracyOptions, Mesh, accuracy};
use nalgebra::{Point3, Vector3};

fn main() {
    divan::main();
}

/// The mesh, and the same moved a little.
fn pair() -> [Mesh; 2] {
    let truth = shapes::hull_like(50_000);
    let moved = truth.positions.iter().map(|p| p + Vector3::new(0.01, 0.0, 0.0)).collect();
    [Mesh { positions: moved, faces: truth.faces.clone() }, truth]
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn tree(bencher: Bencher) {
    let [mesh, truth] = pair();
    let options = AccuracyOptions { samples: 100_000, ..AccuracyOptions::new(0.01) };
    bencher.bench(|| accuracy(&mesh, &truth, &options).map(|found| found.accuracy));
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn every_triangle(bencher: Bencher) {
    let [mesh, truth] = pair();
    let points: Vec<Point3<f64>> = mesh.positions.iter().step_by(mesh.positions.len() / 100).copied().collect();
    let nearest =
        |p: &Point3<f64>| (0..truth.faces.len()).map(|f| distance(p, truth.corners(f))).fold(f64::INFINITY, f64::min);
    bencher.bench(|| points[..100].iter().map(nearest).sum::<f64>());
}

/// From a point to a triangle.
fn distance(p: &Point3<f64>, corners: [Point3<f64>; 3]) -> f64 {
    let [a, b, c] = corners;
    let normal = (b - a).cross(&(c - a));
    let is_left = |k: usize| {
        let (q, r) = (corners[k], corners[(k + 1) % 3]);
        normal.dot(&(r - q).cross(&(p - q))) > 0.0
    };
    if (0..3).all(is_left) {
        return ((p - a).dot(&normal) / normal.norm()).abs();
    }
    let to_edge = |k: usize| {
        let (q, r) = (corners[k], corners[(k + 1) % 3]);
        let along = r - q;
        let t = ((p - q).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
        (q + along * t - p).norm()
    };
    (0..3).map(to_edge).fold(f64::INFINITY, f64::min)
}
