//! `turnlight synth`

use crate::Answer;
use crate::arguments::SynthArgs;
use serde_json::json;
use std::path::Path;
use turnlight::Error;
use turnlight::data_synth::{Layout, Scene, SynthCapture, SynthError, SynthOptions, synthesize_with};
use turnlight::stages::{Observer, Stages};

/// Views, where none are asked for.
const VIEWS: usize = 48;

pub(crate) fn run(args: &SynthArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    if let Some(video) = &args.footage.video {
        return super::synth_film::run(args, video, observer);
    }
    let scene: Scene = args.scene.parse().map_err(|fault| Error::Arguments(format!("{fault}")))?;
    let [width, height] = args.size;
    refuse_occupied(&args.output)?;
    let views = args.views.unwrap_or(VIEWS);
    let options =
        SynthOptions { views, width, height, seed: args.seed, layout: layout(views), ..SynthOptions::default() };
    let mut stages = Stages::new(observer);
    let filmed = film(scene, &options, &mut stages)?;
    stages.run("write", |_| filmed.write(&args.output))?;
    let text = format!("{}: {views} views of {width} × {height}\nwrote {}", scene.name(), args.output.display());
    let json = json!({
        "scene": scene.name(),
        "views": views,
        "width": width,
        "height": height,
        "seed": args.seed,
        "noise_rms": filmed.report.noise_rms,
        "capture": args.output,
        "stages": stages.finished(),
    });
    Ok(Answer { text, json })
}

/// The usual rings, or as many of them as there are views for.
fn layout(views: usize) -> Layout {
    match SynthOptions::default().layout {
        Layout::Rings { mut elevations_deg } => {
            elevations_deg.truncate(views);
            Layout::Rings { elevations_deg }
        }
        other => other,
    }
}

/// Before a minute is spent on the work.
pub(super) fn refuse_occupied(output: &Path) -> Result<(), Error> {
    let is_free = !output.exists() || std::fs::read_dir(output).is_ok_and(|mut entries| entries.next().is_none());
    if is_free { Ok(()) } else { Err(SynthError::Exists { path: output.to_path_buf() }.into()) }
}

/// Films a scene as a stage.
pub(super) fn film(scene: Scene, options: &SynthOptions, stages: &mut Stages<'_>) -> Result<SynthCapture, Error> {
    let film = |observer: &dyn Observer| synthesize_with(scene, options, |done, total| observer.advanced(done, total));
    Ok(stages.run("film", film)?)
}
