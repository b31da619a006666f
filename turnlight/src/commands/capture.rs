//! `turnlight capture`: from footage to a capture.

use crate::Answer;
use crate::arguments::{CaptureFootageArgs, MotionArg};
use serde_json::json;
use turnlight::Error;
use turnlight::capture::calibrate::MotionKind;
use turnlight::capture::footage::Footage;
use turnlight::footage::{CameraSource, FootageOptions, capture_footage};
use turnlight::stages::{Observer, Stages};

pub(crate) fn run(args: &CaptureFootageArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    let footage = Footage::open(&args.footage)?;
    let mut stages = Stages::new(observer);
    let captured = capture_footage(&footage, &options(args)?, &args.output, &mut stages)?;
    let report = captured.report(&footage);
    stages.run("write", |_| captured.write(&report, &args.output))?;
    let text = format!(
        "{}\n{} views\nwrote {}\nlook at {}",
        report.text(),
        captured.kept.len(),
        args.output.display(),
        args.output.join("report.html").display()
    );
    let mut json = json!(report);
    json["capture"] = json!(args.output);
    json["views"] = json!(captured.kept.len());
    json["stages"] = json!(stages.finished());
    Ok(Answer { text, json })
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
        cameras: args.cameras.clone().map_or(CameraSource::Board, CameraSource::Calibrated),
        masks: args.masks.clone(),
        clean_plates: args.clean_plate.clone(),
        light_ball: args.light_ball,
        most: args.frames,
    })
}
