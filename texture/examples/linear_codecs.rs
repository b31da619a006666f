//! What a codec makes of BTF folders: bytes, ratio, error, seconds, evaluations a second.
//!
//! ```text
//! cargo run --release -p texture --example linear_codecs -- FOLDER CODEC BUDGET [full]
//! ```
//!
//! BUDGET: `standard`, `auto`, `r50` (a ratio), `q60` (a quality), `k8` (components). Seconds are CPU seconds of the
//! process, of all threads. Evaluations are made by one thread.

use capture::btf::{Btf, read_folder};
use nalgebra::Vector3;
use std::time::Instant;
use texture::btf::multilevel_vq::Variant;
use texture::btf::{Answer, Budget, CodecKind, FitOptions, Material, Precision, Sampler, fit, to_coded_range};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, codec, budget, rest @ ..] = arguments.as_slice() else { return Err("FOLDER CODEC BUDGET".into()) };
    let mut btf = read_folder(folder.as_ref(), None)?;
    btf.check()?;
    let precision = if rest.is_empty() { Precision::Compact } else { Precision::Full };
    let options = FitOptions {
        codec: codec.parse::<CodecKind>()?,
        budget: parse(budget)?,
        precision,
        seed: 1,
        books: Variant::default(),
    };
    let truth = to_coded_range(btf.clone());
    let start = cpu_seconds();
    let (material, report) = fit(btf, &options)?;
    let seconds = cpu_seconds() - start;
    let bytes = material.to_bytes().0;
    let material = Material::from_bytes(&bytes).map_err(|fault| fault.to_string())?;
    let Answer::Sampler(sampler) = material.codec.answer() else { return Err("it has no samples".into()) };
    let rmse = rmse(&truth, sampler);
    println!(
        "{folder} {codec} {budget}: {} B, 1:{:.2}, RMSE {rmse:.3}, PSNR {:.2} dB, fit {seconds:.1} CPU-s, {:.2} M evals/s cold, {:.2} M/s coherent, {:.1} M texels/s pictures; {:?} {:?}",
        bytes.len(),
        material.raw_bytes as f64 / bytes.len() as f64,
        20.0 * (255.0 / rmse).log10(),
        cold(sampler) / 1e6,
        coherent(sampler) / 1e6,
        pictures(sampler) / 1e6,
        report.objective,
        report.notes
    );
    Ok(())
}

fn parse(text: &str) -> Result<Budget, Box<dyn std::error::Error>> {
    Ok(match text {
        "standard" => Budget::Standard,
        "auto" => Budget::Auto,
        _ if text.starts_with('r') => Budget::Ratio(text[1..].parse()?),
        _ if text.starts_with('q') => Budget::Quality(text[1..].parse()?),
        _ => Budget::Components(text.trim_start_matches('k').parse()?),
    })
}

/// Of user and system, in seconds.
fn cpu_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let ticks = text.rsplit(')').next().unwrap_or("").split_whitespace().skip(11).take(2);
    ticks.filter_map(|t| t.parse::<f64>().ok()).sum::<f64>() / 100.0
}

fn rmse(truth: &Btf, sampler: &dyn Sampler) -> f64 {
    let mut square = 0.0f64;
    for (v, view) in truth.views.iter().enumerate() {
        for (l, light) in truth.lights.iter().enumerate() {
            let shown = sampler.picture(&light.cast(), &view.cast());
            let pairs = shown.iter().zip(truth.picture(v, l));
            square += pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
        }
    }
    255.0 * (square / truth.samples.len() as f64).sqrt()
}

fn directions(count: usize) -> Vec<Vector3<f32>> {
    let golden = std::f32::consts::PI * (3.0 - 5.0f32.sqrt());
    let upward = move |k: usize| {
        let z = (k as f32 + 0.5) / count as f32;
        let (r, phi) = ((1.0 - z * z).sqrt(), golden * k as f32);
        Vector3::new(r * phi.cos(), r * phi.sin(), z)
    };
    (0..count).map(upward).collect()
}

fn rate(count: usize, mut evaluate: impl FnMut(usize) -> f32) -> f64 {
    let (clock, start) = (Instant::now(), cpu_seconds());
    let sum: f32 = (0..count).map(&mut evaluate).sum();
    std::hint::black_box(sum);
    // CPU time where it is long enough to be told in ticks of 10 ms.
    let cpu = cpu_seconds() - start;
    count as f64 / if cpu > 0.2 { cpu } else { clock.elapsed().as_secs_f64() }
}

/// Random texel, light and view each time.
fn cold(sampler: &dyn Sampler) -> f64 {
    let directions = directions(4099);
    let texels = sampler.frame().texels();
    rate(1_000_000, |i| {
        let hash = (i as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 20;
        let pick = |shift: u32| &directions[(hash >> shift) as usize % directions.len()];
        sampler.value((hash >> 7) as usize % texels, pick(0), pick(15))[1]
    })
}

/// Texels in order under directions that turn slowly.
fn coherent(sampler: &dyn Sampler) -> f64 {
    let texels = sampler.frame().texels();
    rate(1_000_000, |i| {
        let angle = i as f32 * 1e-5;
        let light = Vector3::new(0.5 * angle.cos(), 0.5 * angle.sin(), 0.866);
        sampler.value(i % texels, &light, &Vector3::new(0.3 * angle.sin(), 0.0, 0.95))[1]
    })
}

fn pictures(sampler: &dyn Sampler) -> f64 {
    let (directions, texels) = (directions(97), sampler.frame().texels());
    let count = 400_000 / texels + 1;
    let pictures = rate(count, |i| sampler.picture(&directions[i % 97], &directions[(i * 7) % 97])[0]);
    pictures * texels as f64
}
