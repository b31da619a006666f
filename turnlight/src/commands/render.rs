//! `turnlight render`

use super::{read_capture, read_file};
use crate::Answer;
use crate::arguments::{RenderArgs, RendererArg};
use serde_json::json;
use std::time::Instant;
use turnlight::capture::{Aabb, Camera, Capture, Image};
use turnlight::output::OutputFolder;
use turnlight::projector::{Choice, Projector};
use turnlight::render::film::write_png;
use turnlight::render::path::{turntable_cameras, up_axis};
use turnlight::stages::{Observer, Stages};
use turnlight::texture::Model;
use turnlight::{Error, film, playback};

/// Frames of a film for which no number is given.
const TURNTABLE_FRAMES: usize = 72;
/// Size of the frames where nothing gives it.
const SIZE: [usize; 2] = [640, 480];

/// A camera, and the number its picture goes by.
type Numbered = (usize, Camera);

pub(crate) fn run(args: &RenderArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    if let Some(video) = &args.video {
        film::check(video)?;
    }
    let mut stages = Stages::new(observer);
    let model = stages
        .run("read", |_| -> Result<Model, Error> { Ok(Model::from_glb(&read_file(&args.model)?, &args.model)?) })?;
    let cameras = cameras(args, &model)?;
    let folder = args.output.as_deref().map(OutputFolder::create).transpose()?;
    let mut times_ms = Vec::with_capacity(cameras.len());
    let device =
        stages.run("render", |observer| draw(&model, &cameras, args, folder.as_ref(), &mut times_ms, observer))?;
    if let Some(folder) = folder {
        folder.finish()?;
    }
    Ok(answer(args, &cameras, (&times_ms, &device), &stages))
}

fn answer(args: &RenderArgs, cameras: &[Numbered], (times_ms, device): (&[f64], &str), stages: &Stages<'_>) -> Answer {
    let size = cameras.first().map_or([0, 0], |(_, c)| [c.intrinsics.width, c.intrinsics.height]);
    let mut sorted = times_ms.to_vec();
    sorted.sort_by(f64::total_cmp);
    let frame_ms = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let places: Vec<String> =
        [&args.output, &args.video].into_iter().flatten().map(|p| format!("\nwrote {}", p.display())).collect();
    let n = cameras.len();
    let text = format!("{n} frames of {} × {}, {frame_ms:.1} ms each{}", size[0], size[1], places.concat());
    let json = json!({
        "frames": n,
        "width": size[0],
        "height": size[1],
        "frame_ms": frame_ms,
        "frame_device": device,
        "output": args.output,
        "video": args.video,
        "stages": stages.finished(),
    });
    Answer { text, json }
}

fn cameras(args: &RenderArgs, model: &Model) -> Result<Vec<Numbered>, Error> {
    let capture = args.cameras.as_deref().map(|path| read_capture(path, false)).transpose()?;
    if let (Some(capture), None) = (&capture, args.turntable) {
        if args.size.is_some() {
            return Err(Error::Arguments("--size: the cameras give the size; use --downscale".to_owned()));
        }
        let positions = args.views.positions(capture.frames.len())?;
        return Ok(positions.iter().map(|&i| (i, capture.frames[i].camera.downscaled(args.downscale))).collect());
    }
    if args.turntable.is_none() && args.video.is_none() {
        return Err(Error::Arguments("nothing says from where to draw; give --cameras or --turntable".to_owned()));
    }
    let n = args.turntable.unwrap_or(TURNTABLE_FRAMES);
    Ok(orbit(args, model, capture.as_ref(), n).into_iter().enumerate().collect())
}

fn orbit(args: &RenderArgs, model: &Model, capture: Option<&Capture>, n: usize) -> Vec<Camera> {
    let unit = Aabb { min: [-0.5; 3].into(), max: [0.5; 3].into() };
    let aabb = model.mesh.mesh.aabb().unwrap_or(unit);
    let filmed: Vec<Camera> = capture.iter().flat_map(|c| &c.frames).map(|frame| frame.camera).collect();
    let up = up_axis(&filmed).unwrap_or_else(|| args.up.into());
    let like = filmed.first();
    let filmed_size = like.map(|camera| [camera.intrinsics.width, camera.intrinsics.height]);
    let size = args.size.or(filmed_size).unwrap_or(SIZE).map(|side| (side / args.downscale).max(1));
    turntable_cameras(&aabb, like, n, size[0], size[1], up)
}

/// Draws every frame once, to the folder and to the film; says what drew them.
fn draw(
    model: &Model,
    cameras: &[Numbered],
    args: &RenderArgs,
    folder: Option<&OutputFolder>,
    times_ms: &mut Vec<f64>,
    observer: &dyn Observer,
) -> Result<String, Error> {
    let tiles = playback::tiles(model);
    let coats = playback::coats(model, &tiles);
    let choice = match args.renderer {
        RendererArg::Auto => Choice::Auto,
        RendererArg::Cpu => Choice::Cpu,
        RendererArg::Gpu => Choice::Gpu,
    };
    let mut projector = Projector::new(model, coats.as_ref(), choice)?;
    let lamps = args.light.lamps(model.mesh.mesh.aabb().map_or([0.0; 3], |aabb| aabb.center().into()))?;
    let mut frame = |i: usize, camera: &Camera| {
        let start = Instant::now();
        let frame = projector.frame(camera, &lamps.seen_by(camera));
        times_ms.push(start.elapsed().as_secs_f64() * 1e3);
        projector.take_note().iter().for_each(|note| observer.noted(note));
        observer.advanced(i + 1, cameras.len());
        frame
    };
    let mut fault = None;
    let mut keep = |number: usize, frame: &Image<[u8; 4]>| {
        if let (Some(folder), None) = (folder, &fault) {
            let write = || Ok(write_png(&folder.place(format!("{number:04}.png"))?, frame)?);
            fault = write().err();
        }
    };
    let frames = cameras.iter().enumerate().map(|(i, (number, camera))| {
        let frame = frame(i, camera);
        keep(*number, &frame);
        frame
    });
    match &args.video {
        Some(video) => film::write_film(video, frames, args.fps)?,
        None => frames.for_each(drop),
    }
    fault.map_or(Ok(projector.device().to_owned()), Err)
}
