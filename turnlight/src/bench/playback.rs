//! Frames per second of playback, stage by stage, against the bytes a frame must read.
//!
//! The eye goes once around the objects, which together cover half of the first frame; a single object stands in the
//! middle, several on a ring. The CPU plays, then graphics hardware where this build and this machine have it. A frame is timed from a camera to a picture in memory. Reading is timed on a buffer larger
//! than any cache: `bytes_per_frame / memory_bytes_per_s` is what a frame costs at least where layers do not stay in a cache.

use super::player::{Cpu, Player};
#[cfg(feature = "gpu")]
use super::player::{Gpu, failed};
use crate::Error;
use crate::scene::aabb_of;
use crate::stages::median;
use capture::{Aabb, Camera, Image};
use nalgebra::Vector3;
use rayon::prelude::*;
use render::Pose;
use render::cpu::Object;
#[cfg(feature = "gpu")]
use render::gpu;
use render::path::turntable_cameras;
use serde::Serialize;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::Instant;
use texture::{Appearance, Model};

/// Share of the first frame that is covered.
const COVERED: f64 = 0.5;
/// Frames drawn before the clock runs: caches and memory are as they will be.
const WARM_UP: usize = 8;
/// Words that are read to time reading: 256 MiB.
const WORDS: usize = 1 << 25;
/// How often they are read; the fastest counts.
const READINGS: usize = 5;

/// What is timed.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaybackOptions {
    /// Runs, each with so many objects; models are taken in turn.
    pub objects: Vec<usize>,
    /// Width and height of the frames.
    pub size: [usize; 2],
    /// Frames in a turn, at least 1.
    pub frames: usize,
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct PlaybackReport {
    /// One per renderer and number of objects.
    pub runs: Vec<PlaybackRun>,
    /// Read by all threads together.
    pub memory_bytes_per_s: f64,
    /// Threads of the pool.
    pub threads: usize,
    /// Why graphics hardware did not play, in one line.
    pub note: Option<String>,
}

/// One turn.
#[derive(Clone, Debug, Serialize)]
pub struct PlaybackRun {
    /// `cpu` or `gpu`.
    pub renderer: &'static str,
    /// What drew, by name.
    pub device: String,
    /// Of a frame.
    pub width: usize,
    /// Of a frame.
    pub height: usize,
    /// How many were drawn.
    pub objects: usize,
    /// Most layers or rays of a model.
    pub layers: usize,
    /// Of the median frame.
    pub fps_median: f64,
    /// Medians of the stages and of whole frames, in milliseconds.
    pub ms: BTreeMap<&'static str, f64>,
    /// Layers and rays that were read, in the mean.
    pub bytes_per_frame: f64,
    /// Of the frame, in the mean, in percent.
    pub covered_pct: f64,
}

/// Times the playback of `models`, of which there is at least one.
///
/// # Errors
/// None where only graphics hardware failed: the report's note says so.
pub fn playback(models: &[Model], options: &PlaybackOptions) -> Result<PlaybackReport, Error> {
    let threads = rayon::current_num_threads();
    let mut runs = Vec::new();
    for &count in &options.objects {
        let objects = ring(models, count);
        let device = ("cpu", format!("{threads} threads"));
        runs.push(run(&mut Cpu::new(&objects), device, &objects, options)?);
    }
    let note = on_gpu(models, options, &mut runs).err().map(|fault| format!("no graphics hardware: {fault}"));
    Ok(PlaybackReport { runs, memory_bytes_per_s: memory_bytes_per_s(), threads, note })
}

#[cfg(feature = "gpu")]
fn on_gpu(models: &[Model], options: &PlaybackOptions, runs: &mut Vec<PlaybackRun>) -> Result<(), Error> {
    let device = gpu::Device::headless().map_err(failed)?;
    for &count in &options.objects {
        let objects = ring(models, count);
        runs.push(run(&mut Gpu::new(&device, &objects)?, ("gpu", device.name().to_owned()), &objects, options)?);
    }
    Ok(())
}

#[cfg(not(feature = "gpu"))]
fn on_gpu(_: &[Model], _: &PlaybackOptions, _: &mut Vec<PlaybackRun>) -> Result<(), Error> {
    Err(Error::Failed("this turnlight was built without; build it with --features gpu".to_owned()))
}

fn run(
    player: &mut dyn Player,
    (renderer, device): (&'static str, String),
    objects: &[Object<'_>],
    options: &PlaybackOptions,
) -> Result<PlaybackRun, Error> {
    let mut frame = Image::filled(0, 0, [0; 4]);
    let mut cameras = turn(objects, options);
    if let Some(first) = cameras.first() {
        player.draw(first, &mut frame)?;
        let zoom = (COVERED / covered(&frame).max(1e-3)).sqrt();
        cameras.iter_mut().for_each(|camera| {
            camera.intrinsics.fx *= zoom;
            camera.intrinsics.fy *= zoom;
        });
    }
    let mut times: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
    let (mut bytes, mut share) = (0.0, 0.0);
    cameras.iter().take(WARM_UP).try_for_each(|camera| player.draw(camera, &mut frame))?;
    for camera in &cameras {
        let start = Instant::now();
        player.draw(camera, &mut frame)?;
        let whole = ("frame", start.elapsed());
        for (stage, time) in player.stages().into_iter().chain([whole]) {
            times.entry(stage).or_default().push(time.as_secs_f64() * 1e3);
        }
        bytes += player.bytes() as f64;
        share += covered(&frame);
    }
    let frames = cameras.len().max(1) as f64;
    let ms: BTreeMap<&'static str, f64> = times.into_iter().map(|(stage, times)| (stage, median(times))).collect();
    let [width, height] = options.size;
    Ok(PlaybackRun {
        renderer,
        device,
        width,
        height,
        objects: objects.len(),
        layers: objects.iter().map(|object| layers(object.model)).max().unwrap_or(0),
        fps_median: ms.get("frame").map_or(0.0, |frame| 1e3 / frame),
        ms,
        bytes_per_frame: bytes / frames,
        covered_pct: 100.0 * share / frames,
    })
}

fn layers(model: &Model) -> usize {
    match &model.appearance {
        Appearance::Layers(layers) => layers.layers.len(),
        Appearance::Lumigraph(rays, _) => rays.rays,
    }
}

fn covered(frame: &Image<[u8; 4]>) -> f64 {
    frame.pixels().iter().filter(|pixel| pixel[3] > 0).count() as f64 / frame.pixels().len().max(1) as f64
}

/// `count` objects on a ring on which neighbours just do not touch; one stands where it is.
fn ring(models: &[Model], count: usize) -> Vec<Object<'_>> {
    let widest =
        models.iter().filter_map(|model| model.mesh.mesh.aabb()).map(|aabb| aabb.diagonal()).fold(0.0, f64::max);
    // The diagonal of a box is the widest any object in it gets; a ball is 1/√3 of it.
    let radius = if count > 1 { 0.35 * widest / (TAU / 2.0 / count as f64).sin() } else { 0.0 };
    let place = |(k, model)| {
        let (sin, cos) = (TAU * k as f64 / count as f64).sin_cos();
        let translation = Vector3::new(cos, sin, 0.0) * radius;
        Object { pose: Pose { translation, ..Pose::default() }, ..Object::new(model) }
    };
    models.iter().cycle().take(count).enumerate().map(place).collect()
}

/// Cameras once around.
fn turn(objects: &[Object<'_>], options: &PlaybackOptions) -> Vec<Camera> {
    let unit = Aabb { min: [-0.5; 3].into(), max: [0.5; 3].into() };
    let aabb = aabb_of(objects.iter().map(|object| (object.model, &object.pose))).unwrap_or(unit);
    turntable_cameras(&aabb, None, options.frames, options.size[0], options.size[1], Vector3::z())
}

/// How fast all threads together read what no cache holds.
fn memory_bytes_per_s() -> f64 {
    let words: Vec<u64> = (0..WORDS as u64).into_par_iter().collect();
    let once = |_| {
        let start = Instant::now();
        let sum =
            words.par_chunks(1 << 16).map(|part| part.iter().fold(0, |a: u64, b| a ^ b)).reduce(|| 0, |a, b| a ^ b);
        black_box(sum);
        start.elapsed().as_secs_f64()
    };
    let fastest = (0..READINGS).map(once).fold(f64::INFINITY, f64::min);
    (size_of::<u64>() * WORDS) as f64 / fastest
}

impl PlaybackReport {
    /// A table.
    pub fn text(&self) -> String {
        let head = "renderer  objects layers  frames/s |    ms  setup visibility  blend shading   draw read back | \
                    MB/frame  covered";
        let row = |run: &PlaybackRun| {
            // Stages that a renderer does not have are left blank.
            let ms = |stage: &str| run.ms.get(stage).map_or(String::new(), |ms| format!("{ms:.2}"));
            format!(
                "{:9} {:7} {:6} {:9.0} | {:5.1} {:>6} {:>10} {:>6} {:>7} {:>6} {:>9} | {:8.1} {:6.0} %",
                run.renderer,
                run.objects,
                run.layers,
                run.fps_median,
                run.ms.get("frame").copied().unwrap_or(0.0),
                ms("setup"),
                ms("visibility"),
                ms("blend"),
                ms("shading"),
                ms("draw"),
                ms("read_back"),
                run.bytes_per_frame / 1e6,
                run.covered_pct,
            )
        };
        let size = self.runs.first().map_or([0, 0], |run| [run.width, run.height]);
        let rows: Vec<String> = self.runs.iter().map(row).collect();
        let gpu = self.runs.iter().find(|run| run.renderer == "gpu").map(|run| format!("\ngpu: {}", run.device));
        let foot = format!(
            "frames of {} × {}, {} threads; memory is read at {:.1} GB/s{}",
            size[0],
            size[1],
            self.threads,
            self.memory_bytes_per_s / 1e9,
            gpu.unwrap_or_default(),
        );
        let note = self.note.iter().map(|note| format!("\n{note}"));
        format!("{head}\n{}\n{foot}{}", rows.join("\n"), note.collect::<String>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::object::bumpy_ball;

    #[test]
    fn half_of_the_frame_is_covered_and_every_run_reads_something() {
        let options = PlaybackOptions { objects: vec![1, 3], size: [160, 120], frames: 5 };
        let report = playback(&[bumpy_ball(1)], &options).unwrap();
        let played: Vec<(&str, usize)> = report.runs.iter().map(|run| (run.renderer, run.objects)).collect();
        let expected = [("cpu", 1), ("cpu", 3), ("gpu", 1), ("gpu", 3)];
        assert_eq!(played, expected[..if report.note.is_none() { 4 } else { 2 }]);
        for run in &report.runs {
            assert!((30.0..70.0).contains(&run.covered_pct), "{} %", run.covered_pct);
            assert!(run.bytes_per_frame > 1e5 && run.fps_median > 0.0 && run.layers == 20);
        }
        // A head, a foot, and who the hardware is or why there is none.
        assert_eq!(report.text().lines().count(), report.runs.len() + 3);
        assert!(cfg!(feature = "gpu") || report.note.is_some_and(|note| note.contains("--features gpu")));
    }
}
