//! Multi-level vector quantisation: what a ratio costs in error, and how quickly it answers.
//!
//! `cargo bench -p texture --bench multilevel_vq -- FOLDER [RATIO | tTHRESHOLD...]`; seconds are the processor's, of all
//! threads. Environment: `CROP=16`, `GRID=11,11,6,16,75`, `REFINE=2`, `PAPER`, `SSIM`, `SHARES=1,.9,.8,.65,.5,.4,.3,.3`.

use capture::btf::{Btf, read_folder};
use nalgebra::Vector3;
use std::path::Path;
use texture::btf::multilevel_vq::{Aim, Grid, Measure, MultilevelVq, Options, Phase, fit};
use texture::btf::{Budget, Codec, Material, Precision, Sampler, Score, score, to_coded_range};

/// Answers timed.
const COUNT: usize = 2_000_000;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let Some(folder) = arguments.first() else {
        return println!("give a folder of pictures, and ratios");
    };
    let crop = std::env::var("CROP").ok().and_then(|side| side.parse().ok());
    let btf = to_coded_range(read_folder(Path::new(folder), crop).expect("a BTF"));
    println!(
        "{:>8} {:>9} {:>7} {:>7} {:>9} {:>10} {:>10}",
        "ratio", "bytes", "RMSE", "PSNR", "fit CPU s", "evals/s", "samples/s"
    );
    for budget in &arguments[1..] {
        let asked = match budget.strip_prefix('t') {
            Some(_) => Budget::Standard,
            None => Budget::Ratio(budget.parse().expect("a ratio")),
        };
        let mut options = Options::new(&btf, asked, Precision::Compact, 0).expect("options");
        if std::env::var_os("PAPER").is_some() {
            options.phases = Phase::PAPER;
        }
        if std::env::var_os("SSIM").is_some() {
            options.measure = Measure::Ssim;
        }
        if let Ok(shares) = std::env::var("SHARES") {
            let all: Vec<f64> = shares.split(',').map(|s| s.parse().expect("a share")).collect();
            options.squared_shares = all.try_into().expect("eight shares");
        }
        if let Ok(sizes) = std::env::var("GRID") {
            let sizes: Vec<usize> = sizes.split(',').map(|s| s.parse().expect("a size")).collect();
            let [alpha, beta, theta, phi, rim] = sizes.try_into().expect("five sizes");
            options.grid = Grid { alpha, beta, theta, phi, rim_deg: rim as u8, ..options.grid };
        }
        if let Ok(rounds) = std::env::var("REFINE") {
            options.refinements = rounds.parse().expect("rounds");
        }
        if let Some(threshold) = budget.strip_prefix('t') {
            options.aim = Aim::Threshold(threshold.parse().expect("a threshold"));
        }
        report(&btf, &options);
    }
}

fn report(btf: &Btf, options: &Options) {
    let before = cpu_seconds();
    let (codec, report) = fit(btf, options).expect("a fit");
    let seconds = cpu_seconds() - before;
    let Score { rmse, psnr_db: psnr, .. } = score(btf, &codec);
    let speeds = [evaluations(&codec), samples(&codec)];
    let material = Material {
        name: btf.name.clone(),
        encoding: btf.encoding,
        exposure: btf.exposure,
        includes_cosine: btf.includes_cosine,
        texel_pitch_mm: None,
        raw_bytes: btf.raw_bytes(),
        codec: Codec::MultilevelVq(codec),
    };
    let (bytes, parts) = material.to_bytes();
    let ratio = btf.raw_bytes() as f64 / bytes.len() as f64;
    println!(
        "{ratio:8.1} {:9} {rmse:7.3} {psnr:7.2} {seconds:9.1} {:10.2e} {:10.2e}",
        bytes.len(),
        speeds[0],
        speeds[1]
    );
    let parts: Vec<String> = parts.iter().map(|p| format!("{} {}", p.name, p.bytes)).collect();
    println!("  {}; {:?} bytes: {}", report.notes.join("; "), report.objective, parts.join(", "));
}

/// Of one core, at random texels, lights and views.
fn evaluations(codec: &MultilevelVq) -> f64 {
    let directions = directions();
    rate(codec, |i, texel| codec.value(texel, &directions[i % 1021], &directions[i % 1019])[1])
}

fn samples(codec: &MultilevelVq) -> f64 {
    let directions = directions();
    rate(codec, |i, texel| {
        let u = [0.618_034, 0.754_877_7, 0.569_840_3].map(|step: f32| (step * (i % 65_536) as f32).fract());
        codec.sample(texel, &directions[i % 1019], u).1
    })
}

/// Answers per second of CPU, at random texels.
fn rate(codec: &MultilevelVq, answer: impl Fn(usize, usize) -> f32) -> f64 {
    let texels = codec.frame().texels();
    let start = cpu_seconds();
    let sum: f32 = (0..COUNT).map(|i| answer(i, i.wrapping_mul(2_654_435_761) % texels)).sum();
    std::hint::black_box(sum);
    COUNT as f64 / (cpu_seconds() - start)
}

/// A spiral over the hemisphere, shuffled.
fn directions() -> Vec<Vector3<f32>> {
    let direction = |i: usize| {
        let k = (i * 389) % 1024;
        let (z, phi) = (1.0 - 0.97 * k as f32 / 1024.0, 2.399_963 * k as f32);
        let r = (1.0 - z * z).sqrt();
        Vector3::new(r * phi.cos(), r * phi.sin(), z)
    };
    (0..1024).map(direction).collect()
}

/// User and system time of this process.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<f64> =
        stat.rsplit(')').next().unwrap_or("").split_whitespace().filter_map(|f| f.parse().ok()).collect();
    fields.get(10..12).map_or(0.0, |f| (f[0] + f[1]) / 100.0)
}
