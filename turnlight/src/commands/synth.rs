//! `turnlight synth`

use crate::Answer;
use crate::arguments::{FaultArgs, FilmingArgs, LayoutArg, LightArg, SynthArgs};
use serde_json::json;
use std::path::Path;
use turnlight::Error;
use turnlight::data_synth::{
    Effort, Faults, Layout, LightFrame, Scene, SensorNoise, SynthCapture, SynthError, SynthOptions, synthesize_with,
};
use turnlight::film;
use turnlight::stages::{Observer, Stages};

/// Frames per second of the film.
const FPS: f64 = 12.0;
/// Full turns of a spiral, where nobody says.
const SPIRAL_TURNS: f64 = 5.0;

pub(crate) fn run(args: &SynthArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    let scene: Scene = args.scene.parse().map_err(|fault| Error::Arguments(format!("{fault}")))?;
    let [width, height] = args.size;
    refuse_occupied(&args.output)?;
    args.video.as_deref().map(film::check).transpose()?;
    let filming = &args.filming;
    let options = SynthOptions {
        views: args.views,
        width,
        height,
        seed: args.seed,
        effort: filming.noise.map_or(Effort::Samples(filming.samples), Effort::Noise),
        light: match filming.light {
            LightArg::Room => LightFrame::Room,
            LightArg::Object => LightFrame::Object,
        },
        layout: layout(filming, args.views)?,
        faults: faults(&args.faults),
        maps: filming.maps,
        ..SynthOptions::default()
    };
    let mut stages = Stages::new(observer);
    let filmed = film(scene, &options, &mut stages)?;
    stages.run("write", |_| filmed.write(&args.output))?;
    if let Some(video) = &args.video {
        let frames: Vec<_> = filmed.views.iter().map(|v| v.image.map(|[r, g, b]| [r, g, b, 255])).collect();
        stages.run("write film", |_| film::write_film(video, frames, FPS))?;
    }
    let mut text = format!("{}: {} views of {width} × {height}", scene.name(), args.views);
    if let Some(noise) = filmed.report.noise_rms {
        text.push_str(&format!(", noise {noise:.1}/255"));
    }
    text.push_str(&format!("\nwrote {}", args.output.display()));
    if let Some(video) = &args.video {
        text.push_str(&format!("\nwrote {}", video.display()));
    }
    let json = json!({
        "scene": scene.name(),
        "views": args.views,
        "width": width,
        "height": height,
        "seed": args.seed,
        "noise_rms_levels": filmed.report.noise_rms,
        "rays": filmed.report.rays,
        "capture": args.output,
        "video": args.video,
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
    let turns = filming.turns.unwrap_or(SPIRAL_TURNS);
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

fn faults(args: &FaultArgs) -> Faults {
    Faults {
        sensor_noise: args.sensor_noise.map(|full_well| SensorNoise { full_well, read_electrons: 10.0 }),
        exposure_drift_stops: args.exposure_drift,
        camera_jitter_deg: args.jitter,
        calibration_error_px: args.calibration_error,
        matte_grow_px: args.mask_grow,
        matte_holes: args.mask_holes,
        motion_blur_deg: args.motion_blur,
        distortion_k1: args.distortion,
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
