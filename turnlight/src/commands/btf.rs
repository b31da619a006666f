//! `turnlight btf`

use super::synth::refuse_occupied;
use crate::Answer;
use crate::arguments::{BtfCommand, BtfCompareArgs, BtfDataArgs, BtfEvalArgs, BtfFitArgs, BtfSynthArgs};
use serde_json::json;
use std::path::{Path, PathBuf};
use turnlight::Error;
use turnlight::btf::{
    CompareOptions, Evaluation, FitRecord, as_coded, compare as compare_codecs, evaluate, html, sheet, text,
};
use turnlight::capture::{btf as measured, write_rgb};
use turnlight::data_synth::btf::{BtfMaterial, BtfOptions, DIRECTIONS, write_btf};
use turnlight::output::{OutputFolder, write_file};
use turnlight::stages::{Observer, Stages};
use turnlight::texture::TextureError;
use turnlight::texture::btf::multilevel_vq::Variant;
use turnlight::texture::btf::{CodecKind, FitOptions, Material, fit_shared};

pub(crate) fn run(command: &BtfCommand, observer: &dyn Observer) -> Result<Answer, Error> {
    match command {
        BtfCommand::Synth(args) => synth(args, observer),
        BtfCommand::Fit(args) => fit(args, observer),
        BtfCommand::Eval(args) => eval(args, observer),
        BtfCommand::Compare(args) => compare(args, observer),
        BtfCommand::Render(args) => super::btf_render::run(args, observer),
    }
}

fn synth(args: &BtfSynthArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    let material: BtfMaterial = args.material.parse().map_err(|fault| Error::Arguments(format!("{fault}")))?;
    refuse_occupied(&args.output)?;
    let options = BtfOptions { size: args.size, seed: args.seed, samples: args.samples, ..BtfOptions::default() };
    let mut stages = Stages::new(observer);
    let measure = |observer: &dyn Observer| {
        write_btf(material, &options, args.hdr, &args.output, |done, total| observer.advanced(done, total))
    };
    let written = stages.run("measure", measure)?;
    let size = args.size;
    let text = format!(
        "{material}: {DIRECTIONS} views × {DIRECTIONS} lights of {size} × {size} texels, {:.3} mm apart\nwrote {}",
        written.texel_pitch_mm,
        args.output.display()
    );
    let json = json!({
        "material": material.name(),
        "size": size,
        "views": DIRECTIONS,
        "lights": DIRECTIONS,
        "seed": args.seed,
        "samples": args.samples,
        "hdr": args.hdr,
        "exposure": written.exposure,
        "texel_pitch_mm": written.texel_pitch_mm,
        "bytes": written.bytes,
        "btf": args.output,
        "stages": stages.finished(),
    });
    Ok(Answer { text, json })
}

fn read(args: &BtfDataArgs, stages: &mut Stages<'_>) -> Result<measured::Btf, Error> {
    let btf = stages.run("read", |_| measured::read(&args.data, args.crop))?;
    let filled = btf.measured.iter().filter(|measured| !**measured).count();
    if filled > 0 {
        stages
            .observer()
            .noted(&format!("{filled} of {} pairs are missing, filled from the nearest light", btf.pairs()));
    }
    Ok(btf)
}

fn fit(args: &BtfFitArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    let mut stages = Stages::new(observer);
    if args.data.len() > 1 && args.codec != CodecKind::MultilevelVq {
        let fault = format!("{} materials cannot share what {} keeps", args.data.len(), args.codec);
        return Err(Error::Arguments(format!("{fault}; give one, or --codec multilevel-vq")));
    }
    let books = args.books.variant();
    if books != Variant::default() && args.codec != CodecKind::MultilevelVq {
        let fault = "--measure, --color and --mip-maps are of the books of multilevel-vq";
        return Err(Error::Arguments(format!("{fault}; {} has none", args.codec)));
    }
    let part = |data: &PathBuf| BtfDataArgs { data: data.clone(), crop: args.crop };
    let btfs = args.data.iter().map(|data| read(&part(data), &mut stages)).collect::<Result<Vec<_>, _>>()?;
    let options = FitOptions {
        codec: args.codec,
        budget: args.budget.budget(),
        precision: args.precision.into(),
        seed: args.seed,
        books,
    };
    let (material, report) = stages.run("fit", |_| fit_shared(btfs, &options))?;
    let raw_bytes = material.raw_bytes;
    let (bytes, parts) = material.to_bytes();
    write_file(&args.output, &bytes)?;
    let took = stages.finished().last().map(|fit| FitRecord::new(&bytes, fit.seconds, fit.peak_bytes));
    took.map_or(Ok(()), |record| record.write(&args.output))?;
    report.notes.iter().for_each(|note| observer.noted(note));
    let ratio = raw_bytes as f64 / bytes.len() as f64;
    let path = args.output.display();
    let text = format!(
        "{}, {}: {} bytes, 1:{ratio:.1}\nwrote {path}",
        material.members().join(" and "),
        args.codec,
        bytes.len()
    );
    let json = json!({
        "codec": args.codec.name(),
        "members": material.members(),
        "bytes": bytes.len(),
        "parts": parts,
        "raw_bytes": raw_bytes,
        "ratio": ratio,
        "objective": report.objective,
        "notes": report.notes,
        "fit_s": took.map(|record| record.fit_s),
        "fit_peak_bytes": took.and_then(|record| record.fit_peak_bytes),
        "material": args.output,
        "stages": stages.finished(),
    });
    Ok(Answer { text, json })
}

fn eval(args: &BtfEvalArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    let mut stages = Stages::new(observer);
    let bytes = read_bytes(&args.material)?;
    let material = member(material_in(&args.material, &bytes)?, args.member)?;
    let btf = read(&args.data, &mut stages)?;
    if let Some(path) = &args.sheet {
        write_rgb(path, &sheet(&material, &as_coded(&material, btf.clone()), args.seed))?;
    }
    let judged = stages.run("evaluate", |_| evaluate(&material, btf, args.seed))?;
    let record = FitRecord::read(&args.material, &bytes);
    let found = Evaluation {
        fit_s: record.map(|record| record.fit_s),
        fit_peak_bytes: record.and_then(|record| record.fit_peak_bytes),
        ..judged
    };
    let s = &found.score;
    let mut text = format!(
        "{}: {} bytes, 1:{:.1}; RMSE {:.3}, PSNR {:.2} dB, SSIM {:.4}",
        found.codec, found.bytes, found.ratio, s.rmse, s.psnr_db, s.ssim
    );
    for level in found.levels.iter().flatten() {
        let [width, height] = level.size;
        text.push_str(&format!("; {width} × {height}: RMSE {:.3}", level.rmse));
    }
    if let Some(speed) = found.speed {
        let [one, all] = [speed.evals_per_s_core, speed.evals_per_s_all].map(|rate| rate / 1e6);
        text.push_str(&format!("; {one:.2} M answers/s on one core, {all:.2} on all"));
    }
    Ok(Answer { text, json: json!(found) })
}

/// One of the materials in a file.
pub(super) fn read_material(path: &Path, number: usize) -> Result<Material, Error> {
    member(material_in(path, &read_bytes(path)?)?, number)
}

fn member(material: Material, number: usize) -> Result<Material, Error> {
    let known = material.members().join(", ");
    let missing = || Error::Arguments(format!("--member: there is no material {number}, from 0 on there are {known}"));
    material.member(number).ok_or_else(missing)
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, Error> {
    std::fs::read(path).map_err(|fault| Error::Failed(format!("{}: {fault}", path.display())))
}

/// The material in the bytes of the file at `path`.
fn material_in(path: &Path, bytes: &[u8]) -> Result<Material, Error> {
    let remedy = "fit it again with `turnlight btf fit`".to_owned();
    let material = Material::from_bytes(bytes).map_err(|fault| TextureError::Invalid {
        path: path.to_owned(),
        fault: fault.to_string(),
        remedy,
    })?;
    Ok(material)
}

fn compare(args: &BtfCompareArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    let mut stages = Stages::new(observer);
    let btf = read(&args.data, &mut stages)?;
    let report = args.output.as_deref().map(OutputFolder::create).transpose()?;
    let codecs = if args.codecs.is_empty() { CodecKind::ALL.to_vec() } else { args.codecs.clone() };
    let options =
        CompareOptions { codecs, ratios: args.ratios.clone(), precision: args.precision.into(), seed: args.seed };
    let comparison = compare_codecs(btf, &options, report.as_ref(), &mut stages)?;
    let mut words = text(&comparison);
    if let Some(report) = report {
        report.write("report.json", format!("{:#}\n", json!(comparison)).as_bytes())?;
        report.write("report.html", html(&comparison, &report)?.as_bytes())?;
        report.finish()?;
        let path = args.output.as_deref().unwrap_or(Path::new(".")).join("report.html");
        words.push_str(&format!("\nreport: {}\n", path.display()));
    }
    Ok(Answer { text: words, json: json!(comparison) })
}
