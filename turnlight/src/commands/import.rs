//! `turnlight import`

use super::read_capture;
use crate::Answer;
use crate::arguments::ImportArgs;
use serde_json::json;
use turnlight::Error;
use turnlight::capture::{LoadOptions, MaskSource, detect_format};
use turnlight::stages::{Observer, Stages};

pub(crate) fn run(args: &ImportArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    let mut stages = Stages::new(observer);
    let (format, _) = detect_format(&args.path)?;
    let capture = read_capture(&args.path, args.ignore_masks)?;
    if capture.mask_source == MaskSource::Automatic {
        // Found once and kept, so that they can be looked at and mended.
        let views = stages.run("find silhouettes", |_| capture.load_all_views(&LoadOptions::default()))?;
        let mattes: Vec<_> = views.into_iter().map(|view| view.matte).collect();
        stages.run("write", |_| capture.write_with_mattes(&mattes, &args.output))?;
    } else {
        stages.run("write", |_| capture.write(&args.output))?;
    }
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
