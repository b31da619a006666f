//! How long does a frame take on this adapter, stage by stage? An object of 4 800 triangles that fills about
//! half of 800 × 600 pixels, its appearance of 20 layers or rays of 512² texels, an eye that moves; medians. The CPU
//! player's frame beside it, with the same blend.

#![allow(clippy::unwrap_used, reason = "a helper that fails ends the bench")]

#[path = "../tests/support/models.rs"]
mod models;
#[path = "../tests/support/mod.rs"]
mod support;

use capture::Camera;
use nalgebra::Point3;
use render::gpu::{Blend, Device, Renderer, Shot, StageTimes};
use render::{RenderOptions, cpu};
use std::time::{Duration, Instant};
use texture::Model;

const FRAMES: usize = 61;

fn median(mut times: Vec<Duration>) -> f64 {
    times.sort();
    times[times.len() / 2].as_secs_f64() * 1e3
}

fn camera(frame: usize) -> Camera {
    let angle = 0.1 * frame as f64;
    support::look_at(Point3::new(3.0 * angle.cos(), 3.0 * angle.sin(), 1.0), Point3::origin(), 780.0, 800, 600)
}

fn gpu(name: &str, device: &Device, model: &Model, blend: Blend, supersample: usize) {
    let mut renderer = Renderer::with_blend(device, model, blend).expect("the model fits");
    let options = RenderOptions { supersample, background: None };
    let mut runs: Vec<(StageTimes, Duration)> = Vec::new();
    for frame in 0..FRAMES {
        let camera = camera(frame);
        let start = Instant::now();
        renderer.render(&Shot { camera: &camera, lighting: None, options }).expect("the driver draws");
        runs.push((renderer.times(), start.elapsed()));
    }
    let of = |f: fn(&(StageTimes, Duration)) -> Duration| median(runs.iter().map(f).collect());
    let all = of(|r| r.1);
    println!(
        "{name:10} {supersample}×{supersample} {:8} | {:7.2} | {:5.2} | {:7.2} | {:7.2} | {all:6.2} = {:.0} frames/s",
        format!("{blend:?}"),
        of(|r| r.0.weights),
        of(|r| r.0.atlas),
        of(|r| r.0.drawing),
        of(|r| r.0.reading),
        1e3 / all,
    );
}

fn cpu(name: &str, model: &Model, supersample: usize) {
    let options = RenderOptions { supersample, background: None };
    let mut player = cpu::Player::new(&model.mesh, options);
    let mut blends = Vec::new();
    let mut covered = 0.0;
    let mut all = Vec::new();
    for frame in 0..FRAMES {
        let camera = camera(frame);
        let start = Instant::now();
        let atlas = model.atlas(&camera.center());
        blends.push(start.elapsed());
        let picture = player.render(&atlas, &camera);
        all.push(start.elapsed());
        covered = picture.pixels().iter().filter(|p| p[3] > 0).count() as f64 / picture.pixels().len() as f64;
    }
    let (blend, all) = (median(blends), median(all));
    let rest = all - blend;
    println!(
        "{name:10} {supersample}×{supersample} no GPU   | {blend:7.2} |       | {rest:7.2} |         | {all:6.2} = {:.0} \
         frames/s, {:.0} % covered",
        1e3 / all,
        100.0 * covered,
    );
}

fn main() {
    let device = match Device::headless() {
        Ok(device) => device,
        Err(fault) => return println!("skipped: {fault}"),
    };
    let ball = || models::bumpy_ball(20, [512, 512]);
    let models = [
        ("static", models::still(ball())),
        ("dyntex 20", models::dyntex(ball(), 20, 60, |_| 20)),
        ("lumigraph", models::lumigraph(ball(), 20)),
    ];
    println!("{}; ms, medians of {FRAMES} frames", device.name());
    println!("                        | weights | atlas | drawing | reading | all");
    for (name, model) in &models {
        for supersample in [1, 2] {
            cpu(name, model, supersample);
            gpu(name, &device, model, Blend::Adapter, supersample);
            gpu(name, &device, model, Blend::Cpu, supersample);
        }
    }
}
