//! `turnlight import`

use super::{read_capture, write_capture};
use crate::Answer;
use crate::arguments::ImportArgs;
use serde_json::json;
use turnlight::Error;
use turnlight::capture::detect_format;
use turnlight::stages::{Observer, Stages};

pub(crate) fn run(args: &ImportArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    let mut stages = Stages::new(observer);
    let (format, _) = detect_format(&args.path)?;
    let capture = read_capture(&args.path, args.ignore_masks)?;
    write_capture(&capture, &args.output, &mut stages)?;
    let views = capture.frames.len();
    let text = format!("{format}: {views} views; {}\nwrote {}", capture.mask_source, args.output.display());
    let json = json!({
        "format": format.to_string(),
        "views": views,
        "masks": capture.mask_source,
        "capture": args.output,
        "stages": stages.finished(),
    });
    Ok(Answer { text, json })
}
