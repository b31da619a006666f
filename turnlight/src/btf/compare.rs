//! All codecs over a range of sizes, on one material.
//!
//! Every codec is fitted to the same data at each ratio asked for; those whose size their authors fixed are
//! fitted once. Each material is judged as it is stored: written, read back, decoded. Numbers are stored
//! with the same care by all ([`texture::btf::Precision`]).

use super::delta::{Delta, deltas};
use super::evaluate::{Evaluation, judge};
use super::sheet;
use crate::Error;
use crate::output::OutputFolder;
use crate::stages::{Stages, peak_bytes};
use capture::btf::Btf;
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;
use texture::btf::multilevel_vq::Variant;
use texture::btf::{Budget, CodecKind, FitOptions, Material, Precision, fit, to_coded_range};

/// What is compared.
#[derive(Clone, Debug, PartialEq)]
pub struct CompareOptions {
    /// The codecs, in the order reported.
    pub codecs: Vec<CodecKind>,
    /// Ratios asked of each codec that can choose its size.
    pub ratios: Vec<f64>,
    /// How numbers are stored.
    pub precision: Precision,
    /// Of everything random.
    pub seed: u64,
}

/// One codec at one size.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CodecRun {
    /// The ratio asked for; none where the codec's size is its own.
    pub ratio_asked: Option<f64>,
    /// Why there are no figures.
    pub fault: Option<String>,
    /// What was found.
    #[serde(flatten)]
    pub evaluation: Option<Evaluation>,
    /// The codec's name.
    pub name: &'static str,
    /// Bytes over texels.
    pub bytes_per_texel: Option<f64>,
}

/// All runs on one material.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CodecComparison {
    /// What was measured.
    pub material: String,
    /// Texels across and down.
    pub size: [usize; 2],
    /// Views and lights.
    pub directions: [usize; 2],
    /// Bytes as measured.
    pub raw_bytes: u64,
    /// Full or compact.
    pub precision: &'static str,
    /// The runs, by codec, then ratio.
    pub runs: Vec<CodecRun>,
    /// Codecs at equal rate, each against each.
    pub deltas: Vec<Delta>,
}

/// Compares codecs on `btf`. With a report, pictures of each codec's first run are written there.
///
/// # Errors
/// Where a picture cannot be written; a codec that cannot be fitted is named in its run.
pub fn compare(
    btf: Btf,
    options: &CompareOptions,
    report: Option<&OutputFolder>,
    stages: &mut Stages<'_>,
) -> Result<CodecComparison, Error> {
    let raw_bytes = btf.raw_bytes();
    let coded = to_coded_range(btf);
    let mut runs = Vec::new();
    for &codec in &options.codecs {
        let asked: Vec<Option<f64>> =
            if codec.has_sizes() { options.ratios.iter().copied().map(Some).collect() } else { vec![None] };
        for ratio in asked {
            let (run, material) = run(&coded, codec, ratio, options, stages);
            if let (Some(report), Some(material)) = (report, &material) {
                let picture = sheet(material, &coded, options.seed);
                capture::write_rgb(&report.place(sheet_path(codec.name(), ratio))?, &picture)?;
            }
            runs.push(run);
        }
    }
    Ok(CodecComparison {
        material: coded.name.clone(),
        size: [coded.width, coded.height],
        directions: [coded.views.len(), coded.lights.len()],
        raw_bytes,
        precision: match options.precision {
            Precision::Full => "full",
            Precision::Compact => "compact",
        },
        deltas: deltas(&runs),
        runs,
    })
}

/// Where the picture of a run lies in a report.
pub(super) fn sheet_path(codec: &str, ratio: Option<f64>) -> PathBuf {
    let size = ratio.map_or_else(String::new, |ratio| format!("-{ratio}"));
    Path::new("pictures").join(format!("{codec}{size}.png"))
}

fn run(
    coded: &Btf,
    codec: CodecKind,
    ratio: Option<f64>,
    options: &CompareOptions,
    stages: &mut Stages<'_>,
) -> (CodecRun, Option<Material>) {
    let budget = ratio.map_or(Budget::Standard, Budget::Ratio);
    let stage = ratio.map_or_else(|| codec.to_string(), |ratio| format!("{codec} 1:{ratio}"));
    let started = Instant::now();
    let fitting =
        FitOptions { codec, budget, precision: options.precision, seed: options.seed, books: Variant::default() };
    let stored = stages.run(&stage, |_| {
        let (material, _) = fit(coded.clone(), &fitting).map_err(|fault| fault.to_string())?;
        let (seconds, peak) = (started.elapsed().as_secs_f64(), peak_bytes());
        let reread = Material::from_bytes(&material.to_bytes().0).map_err(|fault| fault.to_string())?;
        Ok::<_, String>((reread, seconds, peak))
    });
    let mut run =
        CodecRun { ratio_asked: ratio, fault: None, evaluation: None, name: codec.name(), bytes_per_texel: None };
    match stored {
        Err(fault) => {
            run.fault = Some(fault);
            (run, None)
        }
        Ok((material, seconds, peak)) => {
            let judged = stages.run(&format!("judge {stage}"), |_| judge(&material, coded, options.seed));
            run.bytes_per_texel = Some(judged.bytes as f64 / coded.texels() as f64);
            run.evaluation = Some(Evaluation { fit_s: Some(seconds), fit_peak_bytes: peak, ..judged });
            (run, Some(material))
        }
    }
}

/// The table in words.
pub fn text(comparison: &CodecComparison) -> String {
    let [width, height] = comparison.size;
    let [views, lights] = comparison.directions;
    let mut out = format!(
        "{}: {width} × {height} texels, {views} views × {lights} lights, {} bytes raw\n\n{:<17} {:>7} {:>9} {:>8} {:>7} {:>6} {:>6} {:>9} {:>7}\n",
        comparison.material,
        comparison.raw_bytes,
        "codec",
        "ratio",
        "bytes",
        "RMSE",
        "PSNR",
        "low",
        "SSIM",
        "M eval/s",
        "fit s"
    );
    for run in &comparison.runs {
        // Writing to a string cannot fail.
        let _ = match (&run.evaluation, &run.fault) {
            (Some(e), _) => writeln!(
                out,
                "{:<17} {:>7.1} {:>9} {:>8.3} {:>7.2} {:>6.2} {:>6.3} {:>9} {:>7.1}",
                run.name,
                e.ratio,
                e.bytes,
                e.score.rmse,
                e.score.psnr_db,
                e.score.psnr_low_db,
                e.score.ssim,
                e.speed.map_or_else(|| "–".into(), |s| format!("{:.2}", s.evals_per_s_core / 1e6)),
                e.fit_s.unwrap_or_default(),
            ),
            (None, fault) => {
                let asked = run.ratio_asked.map_or_else(String::new, |ratio| format!(" at 1:{ratio}"));
                writeln!(out, "{}{asked}: {}", run.name, fault.as_deref().unwrap_or("no figures"))
            }
        };
    }
    for d in &comparison.deltas {
        let [from, to] = d.bytes;
        let range = format!("{from} to {to} bytes");
        let _ = writeln!(out, "{} over {}, {range}: {:+.3} RMSE, {:+.2} dB", d.codec, d.against, d.rmse, d.psnr_db);
    }
    out
}
