//! How many milliseconds does a frame take, stage by stage, and how far is that from the naive
//! renderer? A frame is 20 000 triangles with an atlas of 1024² texels; the blend of layers that made
//! the atlas is not counted. The table comes first, from medians; then divan's own.

#[path = "../tests/support/mod.rs"]
mod support;

use capture::{Camera, Image};
use divan::Bencher;
use geometry::TexturedMesh;
use nalgebra::Point3;
use render::{RenderOptions, cpu, reference};
use std::time::{Duration, Instant};

struct Scene {
    mesh: TexturedMesh,
    atlas: Image<[f32; 3]>,
    camera: Camera,
    options: RenderOptions,
}

/// A sphere that fills the frame's height to 80 %, or a knot that fills it less.
fn scene(shape: &str, width: usize, height: usize, supersample: usize) -> Scene {
    let mesh = match shape {
        "sphere" => support::sphere(142, 70),
        "torus" => support::torus(200, 50),
        _ => support::knot(500, 20),
    };
    let camera = support::look_at(Point3::new(3.0, 1.0, 1.0), Point3::origin(), height as f64 * 1.3, width, height);
    Scene { mesh, atlas: support::atlas(1024, 1024), camera, options: RenderOptions { supersample, background: None } }
}

const FRAMES: [(&str, usize, usize, usize); 6] = [
    ("sphere", 640, 480, 2),
    ("torus", 640, 480, 2),
    ("knot", 640, 480, 2),
    ("sphere", 800, 600, 1),
    ("torus", 800, 600, 1),
    ("knot", 800, 600, 1),
];

fn median(mut times: Vec<Duration>) -> f64 {
    times.sort();
    times[times.len() / 2].as_secs_f64() * 1e3
}

fn table() {
    println!("ms, medians of 31 frames   | setup | visibility | blend| shading | all  | reference | covered");
    for (shape, width, height, n) in FRAMES {
        let s = scene(shape, width, height, n);
        let mut player = cpu::Player::new(&s.mesh, s.options);
        let mut runs = Vec::new();
        for _ in 0..31 {
            let start = Instant::now();
            player.render(&s.atlas, &s.camera);
            runs.push((player.times(), start.elapsed()));
        }
        let of = |f: fn(&(cpu::StageTimes, Duration)) -> Duration| median(runs.iter().map(f).collect());
        let start = Instant::now();
        let frame = reference::render(&s.mesh, &s.atlas, &s.camera, &s.options);
        let reference = start.elapsed().as_secs_f64() * 1e3;
        let covered = frame.pixels().iter().filter(|p| p[3] > 0).count() as f64 / frame.pixels().len() as f64;
        println!(
            "{shape:6} {width}×{height} {n}×{n}, {:5} △ | {:5.2} | {:10.2} | {:4.2} | {:7.2} | {:4.1} | {:9.0} | {:.0} %",
            s.mesh.mesh.faces.len(),
            of(|r| r.0.setup),
            of(|r| r.0.visibility),
            of(|r| r.0.blend),
            of(|r| r.0.shading),
            of(|r| r.1),
            reference,
            100.0 * covered,
        );
    }
}

#[divan::bench(args = FRAMES)]
fn frame(bencher: Bencher, (shape, width, height, n): (&str, usize, usize, usize)) {
    let s = scene(shape, width, height, n);
    let mut player = cpu::Player::new(&s.mesh, s.options);
    bencher.bench_local(|| player.render(&s.atlas, &s.camera));
}

fn main() {
    table();
    divan::main();
}
