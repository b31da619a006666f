//! `turnlight capture`: from footage to a capture.

use super::check_extension;
use crate::Answer;
use crate::arguments::{CaptureFootageArgs, MotionArg};
use nalgebra::{Unit, Vector3};
use serde_json::json;
use std::path::{Path, PathBuf};
use turnlight::capture::calibrate::MotionKind;
use turnlight::capture::footage::Footage;
use turnlight::capture::turntable::Axis;
use turnlight::capture::{Capture, LoadOptions};
use turnlight::footage::{CameraSource, EvenTurn, FootageOptions, capture_footage};
use turnlight::pipeline::ShapeOptions;
use turnlight::stages::{Observer, Stages};
use turnlight::texture::{FitOptions, Method};
use turnlight::{Error, output, pipeline};

pub(crate) fn run(args: &CaptureFootageArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    if let Some(model) = &args.model {
        check_extension(model, &["glb"])?;
    }
    Capture::check_place(&args.output)?;
    let footage = Footage::open(&args.footage)?;
    let mut stages = Stages::new(observer);
    let captured = capture_footage(&footage, &options(args)?, &args.output, &mut stages)?;
    let report = captured.report(&footage);
    let views = captured.kept.len();
    stages.run("write", |_| captured.write(&report, &args.output))?;
    drop(captured);
    let model = args.model.as_ref().map(|model| make_model(&args.output, model, &mut stages)).transpose()?;
    let mut text = format!(
        "{}\n{views} views\nwrote {}\nlook at {}",
        report.text(),
        args.output.display(),
        args.output.join("report.html").display()
    );
    let mut json = report.json();
    json["capture"] = json!(args.output);
    json["views"] = json!(views);
    if let Some(model) = &model {
        text = format!("{text}\nwrote {}", model.display());
        json["model"] = json!(model);
    }
    json["stages"] = json!(stages.finished());
    Ok(Answer { text, json })
}

/// The model of a capture just written, with everything as usual.
fn make_model(capture: &Path, output: &Path, stages: &mut Stages<'_>) -> Result<PathBuf, Error> {
    let capture = Capture::read(capture)?;
    let views = stages.run("load", |_| capture.load_all_views(&LoadOptions::default()))?;
    let (shape, fit) = (ShapeOptions::default(), FitOptions::default());
    let (model, _) = pipeline::model(&views, capture.aabb, Method::DynTex, &shape, &fit, stages)?;
    stages.run("write model", |_| output::write_file(output, &model.to_glb()?))?;
    Ok(output.to_owned())
}

fn options(args: &CaptureFootageArgs) -> Result<FootageOptions, Error> {
    let calibration = args.calibration.as_ref().map(|path| Footage::open(std::slice::from_ref(path)));
    Ok(FootageOptions {
        board: args.board,
        length: args.square,
        calibration: calibration.transpose()?,
        motion: args.motion.map(|motion| match motion {
            MotionArg::Turntable => MotionKind::Turntable,
            MotionArg::FreeHand => MotionKind::FreeHand,
        }),
        cameras: cameras(args),
        masks: args.masks.clone(),
        clean_plates: args.clean_plate.clone(),
        light_ball: args.light_ball,
        most: args.frames,
    })
}

fn cameras(args: &CaptureFootageArgs) -> CameraSource {
    match (&args.cameras, args.step, &args.colmap) {
        (Some(path), Some(step), _) => {
            let direction = Unit::new_normalize(args.axis.map_or(Vector3::z(), Vector3::from));
            let axis = Axis { point: args.point.unwrap_or_default().into(), direction };
            CameraSource::Turning(EvenTurn { camera: path.clone(), axis, step: step.to_radians() })
        }
        (Some(path), None, _) => CameraSource::Calibrated(path.clone()),
        (None, _, Some(program)) => CameraSource::Colmap(program.clone()),
        (None, _, None) => CameraSource::Board,
    }
}
