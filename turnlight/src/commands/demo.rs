//! `turnlight demo`

use super::compare::{evaluate_into, truth_beside};
use super::synth::film;
use crate::Answer;
use crate::arguments::DemoArgs;
use serde_json::json;
use std::path::Path;
use turnlight::capture::{Camera, Capture, LoadOptions};
use turnlight::data_synth::{Effort, Layout, Scene, SynthOptions};
use turnlight::evaluate::{self, CompareOptions};
use turnlight::output::{OutputFolder, write_file};
use turnlight::pipeline::ShapeOptions;
use turnlight::render::film::write_film;
use turnlight::render::path::{turntable_cameras, up_axis};
use turnlight::stages::{Observer, Stages};
use turnlight::texture::{FitOptions, Method, Model};
use turnlight::{Error, pipeline, playback};

/// What is filmed: glossy, so that a static texture cannot do.
const SCENE: Scene = Scene::Elephant;
/// One ring above the table, as a turntable gives.
const ELEVATION_DEG: f64 = 20.0;
/// Paths per pixel: about seven levels of noise, which no eye sees in the models.
const SAMPLES: u32 = 24;
/// Frames of the turntable film, and how fast they go by: a turn in four seconds.
const FRAMES: usize = 48;
const FPS: f64 = 12.0;
const FILM_SIZE: [usize; 2] = [400, 300];

pub(crate) fn run(args: &DemoArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    let folder = OutputFolder::create(&args.output)?;
    let mut stages = Stages::new(observer);
    let layout = Layout::Rings { elevations_deg: vec![ELEVATION_DEG] };
    let effort = Effort::Samples(SAMPLES);
    let options = SynthOptions { seed: args.seed, layout, effort, ..SynthOptions::default() };
    film(SCENE, &options, &mut stages)?.write(folder.path().join("capture"))?;
    let capture = Capture::read(&folder.path().join("capture"))?;
    let model = make_model(&capture, &folder, &mut stages)?;
    stages.run("turntable", |observer| turntable(&model, &capture, &folder.path().join("turntable.png"), observer))?;
    let comparison = compare(&capture, &folder, &mut stages)?;
    folder.finish()?;
    let place = |file: &str| args.output.join(file);
    let text = format!(
        "{}\nmodel:  {}\nfilm:   {}\nreport: {}",
        evaluate::text(&comparison),
        place("object.glb").display(),
        place("turntable.png").display(),
        place("report/report.html").display()
    );
    let json = json!({
        "model": place("object.glb"),
        "film": place("turntable.png"),
        "report": place("report/report.html"),
        "capture": place("capture"),
        "comparison": comparison,
        "stages": stages.finished(),
    });
    Ok(Answer { text, json })
}

/// The object out of all views.
fn make_model(capture: &Capture, folder: &OutputFolder, stages: &mut Stages<'_>) -> Result<Model, Error> {
    let views = stages.run("load", |_| capture.load_all_views(&LoadOptions::default()))?;
    let (shape, fit) = (ShapeOptions::default(), FitOptions::default());
    let (model, _) = pipeline::model(&views, capture.aabb, Method::DynTex, &shape, &fit, stages)?;
    write_file(&folder.place("object.glb")?, &model.to_glb()?)?;
    Ok(model)
}

fn turntable(model: &Model, capture: &Capture, path: &Path, observer: &dyn Observer) -> Result<(), Error> {
    let filmed: Vec<Camera> = capture.frames.iter().map(|frame| frame.camera).collect();
    let (Some(aabb), Some(up)) = (model.mesh.mesh.aabb(), up_axis(&filmed)) else { return Ok(()) };
    let [width, height] = FILM_SIZE;
    let cameras = turntable_cameras(&aabb, filmed.first(), FRAMES, width, height, up);
    let mut player = playback::player(model);
    let frames = cameras.iter().enumerate().map(|(i, camera)| {
        observer.advanced(i + 1, FRAMES);
        player.render(&model.atlas(&camera.center()), camera)
    });
    Ok(write_film(path, frames, FPS)?)
}

/// The four methods on the views left out.
fn compare(capture: &Capture, folder: &OutputFolder, stages: &mut Stages<'_>) -> Result<evaluate::Comparison, Error> {
    let count = capture.frames.len();
    let options = CompareOptions {
        train: (0..count).step_by(2).collect(),
        test: (1..count).step_by(2).collect(),
        methods: Method::ALL.to_vec(),
        load: LoadOptions::default(),
        shape: ShapeOptions::default(),
        fit: FitOptions::default(),
        truth: truth_beside(&folder.path().join("capture")),
    };
    let report = OutputFolder::create(&folder.path().join("report"))?;
    let comparison = evaluate_into(capture, SCENE.name(), &options, Some(&report), stages)?;
    report.finish()?;
    Ok(comparison)
}
