//! How many milliseconds does a frame take, stage by stage? First one mesh of 20 000 triangles with an atlas of 1024² texels
//! in `f32`, beside the naive renderer; then models of 512² texels, blended for every frame.

#[path = "../tests/support/models.rs"]
mod models;
#[path = "../tests/support/mod.rs"]
mod support;

use capture::{Camera, Image};
use geometry::TexturedMesh;
use nalgebra::{Point3, Vector3};
use render::cpu::{Object, ScenePlayer, StageTimes};
use render::material::Lighting;
use render::{Pose, RenderOptions, cpu, reference};
use std::f64::consts::TAU;
use std::time::{Duration, Instant};
use texture::Model;

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

/// Stages and the whole of each frame.
type Runs = Vec<(StageTimes, Duration)>;

fn median(runs: &Runs, of: impl Fn(&(StageTimes, Duration)) -> Duration) -> f64 {
    let mut times: Vec<Duration> = runs.iter().map(of).collect();
    times.sort();
    times[times.len() / 2].as_secs_f64() * 1e3
}

fn print(what: &str, runs: &Runs, more: &str) {
    let stage = |of: fn(&StageTimes) -> Duration| median(runs, move |run| of(&run.0));
    println!(
        "{what:34} | {:5.2} | {:10.2} | {:5.2} | {:7.2} | {:5.2} | {more}",
        stage(|t| t.setup),
        stage(|t| t.visibility),
        stage(|t| t.blend),
        stage(|t| t.shading),
        median(runs, |run| run.1),
    );
}

fn meshes() {
    println!("{:34} | setup | visibility | mips  | shading | all   |", "ms, medians of 31 frames");
    for (shape, width, height, n) in FRAMES {
        let s = scene(shape, width, height, n);
        let mut player = cpu::Player::new(&s.mesh, s.options);
        let mut runs = Vec::new();
        for _ in 0..31 {
            let start = Instant::now();
            player.render(&s.atlas, &s.camera);
            runs.push((player.times(), start.elapsed()));
        }
        let start = Instant::now();
        let frame = reference::render(&s.mesh, &s.atlas, &s.camera, &s.options);
        let reference = start.elapsed().as_secs_f64() * 1e3;
        let covered = frame.pixels().iter().filter(|p| p[3] > 0).count() as f64 / frame.pixels().len() as f64;
        let more = format!("{:.0} % covered, reference {reference:.0}", 100.0 * covered);
        print(&format!("{shape} {width}×{height} {n}×{n}"), &runs, &more);
    }
}

/// A turn around so many of a model.
fn turn(what: &str, model: &Model, objects: usize) {
    let place = |k: usize| {
        let (sin, cos) = (TAU * k as f64 / objects as f64).sin_cos();
        let reach = if objects > 1 { 1.6 } else { 0.0 };
        Pose {
            translation: Vector3::new(reach * cos, reach * sin, 0.0),
            scale: if objects > 1 { 0.5 } else { 1.0 },
            ..Pose::default()
        }
    };
    let objects: Vec<Object<'_>> = (0..objects).map(|k| Object { pose: place(k), ..Object::new(model) }).collect();
    let mut player = ScenePlayer::new(&objects, RenderOptions { supersample: 1, background: None });
    let (mut runs, mut frame, mut bytes) = (Vec::new(), Image::filled(0, 0, [0; 4]), 0);
    for k in 0..300 {
        let (sin, cos) = (TAU * k as f64 / 300.0).sin_cos();
        let camera = support::look_at(Point3::new(3.0 * cos, 3.0 * sin, 1.0), Point3::origin(), 780.0, 800, 600);
        let start = Instant::now();
        player.render_into(&camera, &Lighting::default(), &mut frame);
        runs.push((player.times(), start.elapsed()));
        bytes += player.bytes();
    }
    let covered = frame.pixels().iter().filter(|p| p[3] > 0).count() as f64 / frame.pixels().len() as f64;
    let best = runs.iter().map(|r| r.1).min().unwrap_or_default().as_secs_f64() * 1e3;
    let more = format!("{:.0} % covered, {:.1} MB read, best {best:.2}", 100.0 * covered, bytes as f64 / 300.0 / 1e6);
    print(what, &runs, &more);
}

fn models() {
    println!("\n{:34} | setup | visibility | blend | shading | all   |", "ms, medians of 300 frames, 800×600");
    let ball = || models::bumpy_ball(29, [512, 512]);
    let basis = models::dyntex(ball(), 20, 100, |_| 20);
    turn("dyntex, 20 layers", &basis, 1);
    turn("ten of them", &basis, 10);
    turn("vdtm, 20 layers", &models::vdtm(ball(), 20), 1);
    turn("static", &models::still(ball()), 1);
    turn("lumigraph, 20 rays", &models::lumigraph(ball(), 20), 1);
}

/// `cargo bench -- models` leaves the meshes out.
fn main() {
    if !std::env::args().any(|argument| argument == "models") {
        meshes();
    }
    models();
}
