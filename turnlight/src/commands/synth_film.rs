//! `turnlight synth --video`: a film as someone with a phone takes it, and its truth.

use super::synth::{refuse_occupied, sensor};
use crate::Answer;
use crate::arguments::SynthArgs;
use serde_json::json;
use std::path::Path;
use turnlight::Error;
use turnlight::capture::{Distortion, Image, read_rgb};
use turnlight::data_synth::footage::{Footage, FootageOptions, TruthFolder, set_up};
use turnlight::data_synth::{Scene, SynthError};
use turnlight::film;
use turnlight::stages::{Observer, Stages};

pub(crate) fn run(args: &SynthArgs, video: &Path, observer: &dyn Observer) -> Result<Answer, Error> {
    film::check(video)?;
    refuse_occupied(&args.output)?;
    refuse_odd(video, args.size)?;
    let scene: Scene = args.scene.parse().map_err(wrong)?;
    let options = options(args)?;
    let mut stages = Stages::new(observer);
    let footage = stages.run("set up", |_| set_up(scene, &options)).map_err(wrong)?;
    stages.run("film", |observer| shoot(&footage, &args.output, observer))?;
    stages.run("write film", |_| encode(&footage, &args.output, video))?;
    let [width, height] = args.size;
    let text = format!(
        "{}: {} frames of {width} × {height} before {} cloth, {:.2} turns, {}\nwrote {}\nwrote {}",
        scene.name(),
        options.frames,
        options.backdrop,
        options.turns,
        footage.board(),
        args.output.display(),
        video.display()
    );
    let json = json!({
        "scene": scene.name(),
        "frames": options.frames,
        "width": width,
        "height": height,
        "seed": options.seed,
        "turns": options.turns,
        "board": footage.board().to_string(),
        "backdrop": options.backdrop.name(),
        "capture": args.output,
        "video": video,
        "stages": stages.finished(),
    });
    Ok(Answer { text, json })
}

fn options(args: &SynthArgs) -> Result<FootageOptions, Error> {
    let [width, height] = args.size;
    let (usual, filming, faults) = (FootageOptions::default(), &args.filming, &args.faults);
    let elevation_deg = match filming.elevations.as_deref() {
        None => usual.elevation_deg,
        Some(&[elevation]) => elevation,
        Some(_) => return Err(Error::Arguments("--elevations: a film has one, of its camera".to_owned())),
    };
    Ok(FootageOptions {
        frames: args.views.unwrap_or(usual.frames),
        width,
        height,
        fps: args.footage.fps,
        seed: args.seed,
        samples: filming.samples.unwrap_or(usual.samples),
        turns: filming.turns.unwrap_or(usual.turns),
        elevation_deg,
        backdrop: args.footage.backdrop.parse().map_err(wrong)?,
        distortion: faults.distortion.map_or(usual.distortion, |k1| Distortion { k1, ..Distortion::default() }),
        sensor_noise: faults.sensor_noise.map(sensor).or(usual.sensor_noise),
        exposure_drift_stops: faults.exposure_drift.unwrap_or(usual.exposure_drift_stops),
        motion_blur_deg: faults.motion_blur,
        ..usual
    })
}

fn wrong(fault: SynthError) -> Error {
    Error::Arguments(fault.to_string())
}

/// Codecs store colour for blocks of 2 × 2; before minutes are spent on frames that none takes.
fn refuse_odd(video: &Path, [width, height]: [usize; 2]) -> Result<(), Error> {
    if film::needs_even_sides(video) && (width % 2 == 1 || height % 2 == 1) {
        let fault = format!("--size {width}x{height}: frames of a film need even sides");
        return Err(Error::Arguments(format!("{fault}; choose {}x{}", width & !1, height & !1)));
    }
    Ok(())
}

/// The folder with the truth, each frame in memory only while it is taken.
fn shoot(footage: &Footage, output: &Path, observer: &dyn Observer) -> Result<(), Error> {
    let mut folder = TruthFolder::create(footage, output)?;
    for frame in 0..footage.frames() {
        folder.add(&footage.frame(frame))?;
        observer.advanced(frame + 1, footage.frames());
    }
    Ok(folder.finish()?)
}

/// The frames as they were written, as a film.
fn encode(footage: &Footage, output: &Path, video: &Path) -> Result<(), Error> {
    let mut fault = None;
    let read = |frame: usize| {
        let picture = read_rgb(&output.join(format!("images/{frame:04}.png")));
        picture.unwrap_or_else(|error| {
            fault.get_or_insert(error);
            let options = footage.options();
            Image::filled(options.width, options.height, [0; 3])
        })
    };
    let frames = (0..footage.frames()).map(read).map(|picture| picture.map(|[r, g, b]| [r, g, b, 255]));
    film::write_film(video, frames, footage.options().fps)?;
    fault.map_or(Ok(()), |error| Err(error.into()))
}
