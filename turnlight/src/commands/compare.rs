//! `turnlight compare`

use super::CaptureArgs;
use crate::Answer;
use crate::arguments::CompareArgs;
use serde_json::json;
use std::path::{Path, PathBuf};
use turnlight::Error;
use turnlight::capture::Capture;
use turnlight::evaluate::{self, CompareOptions, Comparison};
use turnlight::output::OutputFolder;
use turnlight::stages::{Observer, Stages};

pub(crate) fn run(args: &CompareArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    let capture = args.capture.read()?;
    observer.noted(&capture.mask_source.to_string());
    let count = capture.frames.len();
    let options = CompareOptions {
        train: args.train.positions(count)?,
        test: args.test.positions(count)?,
        methods: args.method.iter().map(|&method| method.into()).collect(),
        load: args.capture.load_options(),
        shape: args.mesh.options(),
        fit: args.fit.options(),
        truth: truth_beside(&args.capture.capture),
    };
    let name = capture_name(&args.capture);
    let report = args.output.as_deref().map(OutputFolder::create).transpose()?;
    let comparison = evaluate_into(&capture, &name, &options, report.as_ref(), &mut Stages::new(observer))?;
    if let Some(report) = report {
        report.finish()?;
    }
    answer(&comparison, args.output.as_deref())
}

/// The true surface, where a capture comes with one: `truth.ply` in its folder.
pub(super) fn truth_beside(capture: &Path) -> Option<PathBuf> {
    let folder = if capture.is_dir() { capture } else { capture.parent()? };
    Some(folder.join("truth.ply")).filter(|path| path.is_file())
}

/// Compares, and writes the report's pages where there is a report.
pub(super) fn evaluate_into(
    capture: &Capture,
    name: &str,
    options: &CompareOptions,
    report: Option<&OutputFolder>,
    stages: &mut Stages<'_>,
) -> Result<Comparison, Error> {
    let comparison = evaluate::compare(capture, name, options, report, stages)?;
    if let Some(report) = report {
        report.write("report.json", format!("{:#}\n", json!(comparison)).as_bytes())?;
        report.write("report.csv", evaluate::csv(&comparison).as_bytes())?;
        report.write("report.html", evaluate::html(&comparison, report)?.as_bytes())?;
    }
    Ok(comparison)
}

fn answer(comparison: &Comparison, report: Option<&Path>) -> Result<Answer, Error> {
    let mut text = evaluate::text(comparison);
    if let Some(report) = report {
        text.push_str(&format!("\nreport: {}\n", report.join("report.html").display()));
    }
    Ok(Answer { text, json: json!(comparison) })
}

/// The last part of the path that says something.
fn capture_name(args: &CaptureArgs) -> String {
    let path = args.capture.canonicalize().unwrap_or_else(|_| args.capture.clone());
    path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}
