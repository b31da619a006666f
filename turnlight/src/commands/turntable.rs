//! `turnlight turntable`

use super::write_capture;
use crate::Answer;
use crate::arguments::TurntableArgs;
use nalgebra::{Point3, Unit, Vector3};
use serde_json::json;
use turnlight::Error;
use turnlight::capture::Capture;
use turnlight::capture::turntable::{Axis, TableAngles, read_table_angles, turntable_capture};
use turnlight::stages::{Observer, Stages};

pub(crate) fn run(args: &TurntableArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    let mut stages = Stages::new(observer);
    let calibrated = Capture::read(&args.camera)?;
    let frames = calibrated.frames.len();
    let camera = calibrated.frames.get(args.view).ok_or_else(|| {
        let fault = format!("view {} is asked for, the capture has {frames} (numbered from 0)", args.view);
        Error::Arguments(format!("{}: {fault}; choose another with --view", args.camera.display()))
    })?;
    let angles = match (args.step, &args.angles) {
        (Some(step), _) => TableAngles::Step(step.to_radians()),
        (None, Some(file)) => read_table_angles(file)?,
        (None, None) => return Err(Error::Arguments("no angles are given; use --step or --angles".to_owned())),
    };
    let direction = Unit::new_normalize(Vector3::from(args.axis));
    let axis = Axis { point: Point3::from(args.point), direction };
    let mut capture = turntable_capture(&args.photographs, &camera.camera, &axis, &angles)?;
    capture.aabb = calibrated.aabb;
    capture.unit = calibrated.unit;
    write_capture(&capture, &args.output, &mut stages)?;
    let views = capture.frames.len();
    let text = format!("{views} views around the axis; {}\nwrote {}", capture.mask_source, args.output.display());
    let json = json!({
        "views": views,
        "masks": capture.mask_source,
        "capture": args.output,
        "stages": stages.finished(),
    });
    Ok(Answer { text, json })
}
