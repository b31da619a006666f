//! Judges a capture made from a synthetic film by the truth written beside the film.
//!
//! ```text
//! turnlight synth house -o truth --video house.mp4
//! turnlight capture house.mp4 --square 60mm -o found
//! cargo run --release -p turnlight --example judge_film -- found truth
//! ```

use capture::{Camera, Capture, Image, read_matte, signed_distance};
use nalgebra::Matrix3;
use serde_json::Value;
use std::error::Error;
use std::path::Path;

/// A frame of the capture and the same frame of the truth.
struct Pair {
    position: usize,
    found: Camera,
    truth: Camera,
    /// Angles of the platter, degrees.
    angles: Option<[f64; 2]>,
    /// Pixels of the object: in both, too many, too few.
    counts: [f64; 3],
    /// Of the pixels too many or too few, those that the true edge runs through or beside.
    at_edge: f64,
}

impl Pair {
    fn iou(&self) -> f64 {
        let [both, extra, missing] = self.counts;
        both / (both + extra + missing).max(1.0)
    }

    /// Pixels too many or too few within a pixel of the true edge, and further off, as shares of the true object.
    fn errors(&self) -> [f64; 2] {
        let [both, extra, missing] = self.counts;
        [self.at_edge, extra + missing - self.at_edge].map(|count| count / (both + missing).max(1.0))
    }

    /// World of the capture to world of the truth.
    fn turn(&self) -> Matrix3<f64> {
        self.truth.rotation.transpose() * self.found.rotation
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, found, truth] = &arguments[..] else { return Err("usage: judge_film CAPTURE TRUTH".into()) };
    let pairs = pairs(Path::new(found), Path::new(truth))?;
    let Some(first) = pairs.first() else { return Err(format!("{found}: keeps no frame of {truth}").into()) };
    for pair in &pairs {
        let [both, extra, missing] = pair.counts;
        let share = |count: f64| count / (both + missing).max(1.0);
        println!("{:5} IoU {:.4} extra {:.4} missing {:.4}", pair.position, pair.iou(), share(extra), share(missing));
    }
    let (focal, expected) = (first.found.intrinsics.fx, first.truth.intrinsics.fx);
    println!("f {focal:.2} px, true {expected:.2} px: off by {:.3} %", 100.0 * (focal / expected - 1.0));
    let turn: Matrix3<f64> = pairs.iter().map(Pair::turn).sum();
    let svd = turn.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return Err("rotations that are none".into()) };
    println!("axis off by {:.4}°", (u * v_t)[(2, 2)].clamp(-1.0, 1.0).acos().to_degrees());
    println!("angles off by {:.4}° at most", largest_angle_error(&pairs));
    let ious: Vec<f64> = pairs.iter().map(Pair::iou).collect();
    let least = ious.iter().copied().fold(1.0, f64::min);
    let mean = |side: usize| 100.0 * pairs.iter().map(|p| p.errors()[side]).sum::<f64>() / pairs.len() as f64;
    println!("wrong within a pixel of the true edge {:.2} %, further off {:.2} %", mean(0), mean(1));
    println!("{} frames, IoU {:.4}, least {least:.4}", ious.len(), ious.iter().sum::<f64>() / ious.len() as f64);
    Ok(())
}

fn pairs(found: &Path, truth: &Path) -> Result<Vec<Pair>, Box<dyn Error>> {
    let read = |path: &Path| -> Result<Value, Box<dyn Error>> {
        let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(serde_json::from_str(&text)?)
    };
    let (report, known) = (read(&found.join("report.json"))?, read(&truth.join("truth.json"))?);
    let (found, truth) = (Capture::read(found)?, Capture::read(truth)?);
    let frames = report["frames"].as_array().ok_or("report.json: has no frames")?;
    let kept = frames.iter().filter_map(|f| Some((f["kept"].as_u64()? as usize, f)));
    kept.map(|(at, frame)| {
        let position = frame["position"].as_u64().ok_or("report.json: a frame has no position")? as usize;
        let (ours, true_one) = (found.frames.get(at), truth.frames.get(position));
        let (ours, true_one) = ours.zip(true_one).ok_or("the truth is of another film")?;
        let masks = ours.mask_path.as_ref().zip(true_one.mask_path.as_ref()).ok_or("a frame has no mask")?;
        let mattes = [read_matte(masks.0)?, read_matte(masks.1)?];
        let angles = frame["angle_deg"].as_f64().zip(known["frames"][position]["angle_deg"].as_f64());
        Ok(Pair {
            position,
            found: ours.camera,
            truth: true_one.camera,
            angles: angles.map(|(a, b)| [a, b]),
            counts: counts(&mattes[0], &mattes[1]),
            at_edge: wrong_at_edge(&mattes[0], &mattes[1]),
        })
    })
    .collect()
}

fn counts(found: &Image<u8>, truth: &Image<u8>) -> [f64; 3] {
    let both = found.pixels().iter().zip(truth.pixels()).map(|(&f, &t)| (f >= 128, t >= 128));
    both.fold([0.0; 3], |[both, extra, missing], (f, t)| {
        let one = |is: bool| f64::from(u8::from(is));
        [both + one(f && t), extra + one(f && !t), missing + one(!f && t)]
    })
}

/// Pixels whose centres lie within a pixel of the true edge, which runs half way between centres: the two rows along it.
fn wrong_at_edge(found: &Image<u8>, truth: &Image<u8>) -> f64 {
    let distance = signed_distance(truth);
    let pixels = found.pixels().iter().zip(truth.pixels()).zip(distance.pixels());
    pixels.filter(|((f, t), d)| (**f >= 128) != (**t >= 128) && d.abs() <= 1.0).count() as f64
}

/// Where the platter stood in the first frame is nobody's to know: the median difference is left out.
fn largest_angle_error(pairs: &[Pair]) -> f64 {
    let mut off: Vec<f64> = pairs.iter().filter_map(|p| p.angles.map(|[a, b]| a - b)).collect();
    off.sort_by(f64::total_cmp);
    let Some(&median) = off.get(off.len() / 2) else { return f64::NAN };
    off.iter().map(|o| (o - median).abs()).fold(0.0, f64::max)
}
