//! `turnlight bench`

use super::check_extension;
use crate::Answer;
use crate::arguments::{BenchCommand, BenchPlaybackArgs};
use serde_json::json;
use turnlight::Error;
use turnlight::bench::object::bumpy_ball;
use turnlight::bench::playback::{PlaybackOptions, playback};
use turnlight::output::write_file;
use turnlight::scene::read_model;
use turnlight::stages::{Observer, Stages};

/// Runs where no number of objects is given.
const OBJECTS: [usize; 2] = [1, 10];

pub(crate) fn run(command: &BenchCommand, observer: &dyn Observer) -> Result<Answer, Error> {
    match command {
        BenchCommand::Playback(args) => time_playback(args, observer),
    }
}

fn time_playback(args: &BenchPlaybackArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    if let Some(output) = &args.output {
        check_extension(output, &["json"])?;
    }
    let mut stages = Stages::new(observer);
    let models = stages.run("read", |_| match args.models.as_slice() {
        [] => Ok(vec![bumpy_ball(args.seed)]),
        paths => paths.iter().map(|path| read_model(path)).collect::<Result<Vec<_>, _>>(),
    })?;
    let objects = args.objects.map_or(OBJECTS.to_vec(), |count| vec![count]);
    let options = PlaybackOptions { objects, size: args.size, frames: args.frames };
    let report = stages.run("play", |_| playback(&models, &options))?;
    let (text, json) = (report.text(), json!(report));
    if let Some(output) = &args.output {
        write_file(output, format!("{json:#}\n").as_bytes())?;
    }
    Ok(Answer { text, json })
}
