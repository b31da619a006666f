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
    stages.run("write", |_| captured.write(&args.output))?;
    let text = format!("{} frames kept\nwrote {}", captured.kept.len(), args.output.display());
    let json = json!({ "capture": args.output, "kept": captured.kept.len(), "stages": stages.finished() });
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
        most: args.frames,
    })
}
