//! How long does a hull take? Ours at three resolutions on an easy and on a real capture.
//!
//! `cargo bench -p geometry --bench hull`; needs `shared/data`, and says so where it is absent.
//!
//! `cargo bench -p geometry --bench hull -- --write RESOLUTION MASKS OUT.ply` makes one hull of the
//! analytic torus from `masks` or `masks_aa`, prints its times as JSON and writes it: for `hull_vs_open3d.py`.

#[path = "../tests/hull_support/mod.rs"]
mod hull_support;

use capture::{Aabb, View};
use geometry::{HullOptions, Mesh, visual_hull};
use hull_support::{all_views, shared, torus};
use nalgebra::Point3;
use std::fmt::Write;
use std::sync::LazyLock;
use std::time::Instant;

static TORUS: LazyLock<Vec<View>> =
    LazyLock::new(|| shared("analytic_torus").map_or_else(Vec::new, |folder| torus(&folder, "masks")));
static TEMPLE: LazyLock<Vec<View>> =
    LazyLock::new(|| shared("templeRing").map_or_else(Vec::new, |folder| all_views(&folder)));

fn main() {
    let args: Vec<String> = std::env::args().collect();
    match args.iter().position(|arg| arg == "--write") {
        Some(at) => write_torus(&args[at + 1..]),
        None => divan::main(),
    }
}

#[divan::bench(args = [128, 256, 512], sample_count = 3)]
fn analytic_torus(bencher: divan::Bencher, resolution: usize) {
    bench_hull(bencher, &TORUS, resolution);
}

#[divan::bench(args = [128, 256, 512], sample_count = 3)]
fn temple_ring(bencher: divan::Bencher, resolution: usize) {
    bench_hull(bencher, &TEMPLE, resolution);
}

fn bench_hull(bencher: divan::Bencher, views: &[View], resolution: usize) {
    let options = HullOptions { resolution: Some(resolution), ..HullOptions::default() };
    if !views.is_empty() {
        bencher.bench(|| visual_hull(views, &options).map(|hull| hull.mesh.faces.len()).unwrap_or(0));
    }
}

/// The cube in which the comparison is made.
fn torus_box() -> Aabb {
    Aabb { min: Point3::new(-0.8, -0.8, -0.8), max: Point3::new(0.8, 0.8, 0.8) }
}

fn write_torus(args: &[String]) {
    // Cargo adds an argument of its own.
    let [resolution, masks, out, ..] = args else {
        eprintln!("usage: --write RESOLUTION masks|masks_aa OUT.ply");
        return;
    };
    let Some(folder) = shared("analytic_torus") else { return };
    let views = torus(&folder, masks);
    let options =
        HullOptions { resolution: resolution.parse().ok(), aabb: Some(torus_box()), ..HullOptions::default() };
    let start = Instant::now();
    match visual_hull(&views, &options) {
        Ok(hull) => {
            let seconds = start.elapsed().as_secs_f64();
            let r = hull.report;
            println!(
                "{{\"seconds\": {seconds:.4}, \"contour_s\": {:.4}, \"carve_s\": {:.4}, \"extract_s\": {:.4}, \"faces\": {}, \"conflicts\": {}, \"lost_pairs\": {}}}",
                r.contour_s,
                r.carve_s,
                r.extract_s,
                hull.mesh.faces.len(),
                r.conflicts,
                r.lost_pairs
            );
            std::fs::write(out, ply(&hull.mesh)).unwrap_or_else(|error| eprintln!("{out}: {error}"));
        }
        Err(error) => eprintln!("{error}"),
    }
}

fn ply(mesh: &Mesh) -> String {
    let (v, f) = (mesh.positions.len(), mesh.faces.len());
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {v}\nproperty double x\nproperty double y\nproperty double z\nelement face {f}\nproperty list uchar int vertex_indices\nend_header\n"
    );
    for p in &mesh.positions {
        let _ = writeln!(text, "{} {} {}", p.x, p.y, p.z);
    }
    for [a, b, c] in &mesh.faces {
        let _ = writeln!(text, "3 {a} {b} {c}");
    }
    text
}
