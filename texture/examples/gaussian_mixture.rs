//! How fast and how well does a Gaussian mixture code a folder of pictures?
//!
//! `cargo run --release -p texture --example gaussian_mixture -- FOLDER [COMPONENTS...]`: per number of components the
//! CPU seconds of the fit and what they come to per density, the error over all samples (of 255), the ratio with
//! everything counted; answers a second, and an 800 × 800 picture of a sphere. 0 stands for what the data support.
//! Seconds are those of the process on its CPUs (Linux), whatever else the machine does.

use capture::btf::{Btf, read_folder};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::path::Path;
use std::time::Instant;
use texture::btf::gaussian_mixture::{self, GaussianMixture, Options};
use texture::btf::{Budget, Codec, Material, Precision, Sampler, to_coded_range};

/// Side of the picture of a sphere.
const SIDE: usize = 800;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("give a folder of pictures")?;
    let counts: Vec<usize> = arguments.map(|a| a.parse()).collect::<Result<_, _>>()?;
    let btf = to_coded_range(read_folder(Path::new(&folder), None)?);
    println!("{}: {} x {} texels, {} pairs", btf.name, btf.width, btf.height, btf.pairs());
    println!("RMSE of the mean picture alone {:.4}", 255.0 * error_of_means(&btf));
    for count in counts {
        let budget = if count == 0 { Budget::Auto } else { Budget::Components(count) };
        for precision in [Precision::Compact, Precision::Full] {
            report(&btf, &Options::new(&btf, budget, precision, 1)?)?;
            if std::env::var_os("BOTH").is_none() {
                break;
            }
        }
    }
    Ok(())
}

fn report(btf: &Btf, options: &Options) -> Result<(), Box<dyn std::error::Error>> {
    let (before, start) = (cpu_seconds(), Instant::now());
    let (codec, told) = gaussian_mixture::fit(btf, options)?;
    let (cpu, wall) = (cpu_seconds() - before, start.elapsed().as_secs_f64());
    let rmse = 255.0 * error(btf, &codec);
    let count = codec.components();
    let densities = (count * told.objective.len()) as f64 * btf.samples.len() as f64 / 3.0;
    println!(
        "M {count} {:?}: fit {cpu:.1} CPU-s ({wall:.1} s), {} rounds, {:.0} M components x samples / CPU-s at full data",
        options.precision,
        told.objective.len(),
        densities / cpu / 1e6
    );
    println!("  log-likelihood {:.3?}", told.objective);
    told.notes.iter().for_each(|note| println!("  {note}"));
    let raw_bytes = btf.raw_bytes();
    speed(&codec);
    let codec = Codec::GaussianMixture(codec);
    let material = Material {
        name: btf.name.clone(),
        encoding: btf.encoding,
        exposure: btf.exposure,
        includes_cosine: btf.includes_cosine,
        texel_pitch_mm: None,
        raw_bytes,
        codec,
    };
    let bytes = material.byte_count();
    println!(
        "  RMSE {rmse:.4}, PSNR {:.2} dB, {bytes} bytes, 1:{:.1}",
        20.0 * (255.0 / rmse).log10(),
        raw_bytes as f64 / bytes as f64
    );
    Ok(())
}

/// Root of the mean squared error of all samples.
fn error(btf: &Btf, codec: &GaussianMixture) -> f64 {
    let of_pair = |pair: usize| {
        let (view, light) = (pair / btf.lights.len(), pair % btf.lights.len());
        let answer = codec.picture(&btf.lights[light].cast(), &btf.views[view].cast());
        let measured = btf.picture(view, light);
        measured.iter().zip(&answer).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>()
    };
    let sums: Vec<f64> = (0..btf.pairs()).into_par_iter().map(of_pair).collect();
    (sums.iter().sum::<f64>() / btf.samples.len() as f64).sqrt()
}

/// The same with nothing but the mean of each picture.
fn error_of_means(btf: &Btf) -> f64 {
    let of_picture = |picture: &[f32]| {
        let channel = |c: usize| picture.iter().skip(c).step_by(3).map(|&s| f64::from(s));
        let n = btf.texels() as f64;
        (0..3).map(|c| channel(c).map(|s| s * s).sum::<f64>() - channel(c).sum::<f64>().powi(2) / n).sum::<f64>()
    };
    (btf.samples.chunks(3 * btf.texels()).map(of_picture).sum::<f64>() / btf.samples.len() as f64).sqrt()
}

fn speed(codec: &GaussianMixture) {
    let pixels: Vec<(usize, Vector3<f32>, Vector3<f32>)> =
        (0..SIDE * SIDE).filter_map(|i| sphere(codec, i % SIDE, i / SIDE)).collect();
    let (before, start) = (cpu_seconds(), Instant::now());
    let answers: Vec<[f32; 3]> =
        pixels.par_iter().map(|(texel, light, view)| codec.value(*texel, light, view)).collect();
    let (cpu, wall) = (cpu_seconds() - before, start.elapsed().as_secs_f64());
    println!(
        "  sphere {SIDE} x {SIDE}: {wall:.3} s, {cpu:.2} CPU-s, {:.2} M answers / CPU-s, mean {:.3}",
        pixels.len() as f64 / cpu / 1e6,
        answers.iter().map(|a| a[1]).sum::<f32>() / answers.len() as f32
    );
    let before = cpu_seconds();
    let mut texels = 0;
    for (_, light, view) in pixels.iter().step_by(503) {
        texels += codec.picture(light, view).len() / 3;
    }
    println!("  tiles: {:.2} M answers / CPU-s", texels as f64 / (cpu_seconds() - before) / 1e6);
}

/// Texel, light and eye of a pixel of a sphere under one light, in the sphere's own frames.
fn sphere(codec: &GaussianMixture, i: usize, j: usize) -> Option<(usize, Vector3<f32>, Vector3<f32>)> {
    let [x, y] = [i, j].map(|k| (k as f32 + 0.5) / SIDE as f32 * 2.0 - 1.0);
    let z = (1.0 - x * x - y * y).max(0.0).sqrt();
    let normal = Vector3::new(x, -y, z);
    let tangent = Vector3::new(z, 0.0, -x).normalize();
    let local = |d: Vector3<f32>| Vector3::new(d.dot(&tangent), d.dot(&normal.cross(&tangent)), d.dot(&normal));
    let (light, view) = (local(Vector3::new(0.3, 0.4, 0.866).normalize()), local(Vector3::z()));
    let frame = codec.frame();
    let texel = (j % frame.height) * frame.width + i % frame.width;
    (x * x + y * y < 1.0 && light.z > 0.0).then_some((texel, light, view))
}

/// Of this process, user and system.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after = stat.rsplit(") ").next().unwrap_or_default();
    let ticks = |k: usize| after.split(' ').nth(k).and_then(|t| t.parse::<f64>().ok()).unwrap_or(0.0);
    (ticks(11) + ticks(12)) / 100.0
}
