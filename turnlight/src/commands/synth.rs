//! `turnlight synth`

use crate::Answer;
use crate::arguments::{FaultArgs, FilmingArgs, LayoutArg, LightArg, SynthArgs};
use serde_json::json;
use std::path::Path;
use turnlight::Error;
use turnlight::data_synth::{
    Effort, Faults, Layout, LightFrame, Scene, SensorNoise, SynthCapture, SynthError, SynthOptions, synthesize_with,
};
use turnlight::stages::{Observer, Stages};

/// Views, where none are asked for.
const VIEWS: usize = 48;
/// Paths per pixel, where none are asked for.
const SAMPLES: u32 = 32;
/// Turns of a spiral, where none are asked for.
const TURNS: f64 = 5.0;

pub(crate) fn run(args: &SynthArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    if let Some(video) = &args.footage.video {
        return super::synth_film::run(args, video, observer);
    }
    let scene: Scene = args.scene.parse().map_err(|fault| Error::Arguments(format!("{fault}")))?;
    let [width, height] = args.size;
    refuse_occupied(&args.output)?;
    let views = args.views.unwrap_or(VIEWS);
    let filming = &args.filming;
    let options = SynthOptions {
        views,
        width,
        height,
        seed: args.seed,
        effort: filming.noise.map_or(Effort::Samples(filming.samples.unwrap_or(SAMPLES)), Effort::Noise),
        light: match filming.light {
            LightArg::Room => LightFrame::Room,
            LightArg::Object => LightFrame::Object,
        },
        layout: layout(filming, views)?,
        faults: faults(&args.faults),
        maps: filming.maps,
        ..SynthOptions::default()
    };
    let mut stages = Stages::new(observer);
    let filmed = film(scene, &options, &mut stages)?;
    stages.run("write", |_| filmed.write(&args.output))?;
    let mut text = format!("{}: {views} views of {width} × {height}", scene.name());
    if let Some(noise) = filmed.report.noise_rms {
        text.push_str(&format!(", noise {noise:.1}/255"));
    }
    text.push_str(&format!("\nwrote {}", args.output.display()));
    let json = json!({
        "scene": scene.name(),
        "views": views,
        "width": width,
        "height": height,
        "seed": args.seed,
        "noise_rms_levels": filmed.report.noise_rms,
        "rays": filmed.report.rays,
        "capture": args.output,
        "stages": stages.finished(),
    });
    Ok(Answer { text, json })
}

/// Where the cameras stand; without elevations given, the usual ones, or as many as there are views for.
fn layout(filming: &FilmingArgs, views: usize) -> Result<Layout, Error> {
    let given = filming.elevations.as_deref();
    if filming.turns.is_some() && !matches!(filming.layout, LayoutArg::Spiral) {
        return Err(Error::Arguments("--turns: only a spiral has turns; add --layout spiral".to_owned()));
    }
    let turns = filming.turns.unwrap_or(TURNS);
    match (filming.layout, given) {
        (LayoutArg::Rings, Some(rings)) => Ok(Layout::Rings { elevations_deg: rings.to_vec() }),
        (LayoutArg::Rings, None) => {
            let usual = [12.0, 35.0];
            Ok(Layout::Rings { elevations_deg: usual[..views.clamp(1, usual.len())].to_vec() })
        }
        (LayoutArg::Spiral, None) => Ok(Layout::Spiral { from_deg: 0.0, to_deg: 60.0, turns }),
        (LayoutArg::Spiral, Some(&[from_deg, to_deg])) => Ok(Layout::Spiral { from_deg, to_deg, turns }),
        (LayoutArg::Spiral, Some(_)) => {
            Err(Error::Arguments("--elevations: a spiral has two, of its first and its last view".to_owned()))
        }
        (LayoutArg::Hemisphere, None) => Ok(Layout::Hemisphere { above_deg: 5.0 }),
        (LayoutArg::Hemisphere, Some(&[above_deg])) => Ok(Layout::Hemisphere { above_deg }),
        (LayoutArg::Hemisphere, Some(_)) => {
            Err(Error::Arguments("--elevations: random cameras have one, the lowest".to_owned()))
        }
    }
}

/// A sensor that is white at this many electrons.
pub(super) fn sensor(full_well: f64) -> SensorNoise {
    SensorNoise { full_well, read_electrons: 10.0 }
}

fn faults(args: &FaultArgs) -> Faults {
    Faults {
        sensor_noise: args.sensor_noise.map(sensor),
        exposure_drift_stops: args.exposure_drift.unwrap_or(0.0),
        camera_jitter_deg: args.jitter,
        calibration_error_px: args.calibration_error,
        matte_grow_px: args.mask_grow,
        matte_holes: args.mask_holes,
        motion_blur_deg: args.motion_blur,
        distortion_k1: args.distortion.unwrap_or(0.0),
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
