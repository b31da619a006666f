//! `turnlight render`

use super::{choice, read_capture};
use crate::Answer;
use crate::arguments::RenderArgs;
use serde_json::json;
use std::time::Instant;
use turnlight::capture::{Aabb, Camera, Capture, Image};
use turnlight::output::OutputFolder;
use turnlight::projector::{Painter, Projector};
use turnlight::render::RenderOptions;
use turnlight::render::film::write_png;
use turnlight::render::path::{TURN_FRAMES, smooth_cameras, turntable_cameras, up_axis};
use turnlight::scene::Scene;
use turnlight::stages::{Observer, Stages, median};
use turnlight::{Error, film, playback};

/// Size of the frames where nothing gives it.
const SIZE: [usize; 2] = [640, 480];

/// A camera, and the number its picture goes by.
type Numbered = (usize, Camera);

pub(crate) fn run(args: &RenderArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    if let Some(video) = &args.video {
        film::check(video)?;
    }
    let mut stages = Stages::new(observer);
    let scene = stages.run("read", |_| Scene::read(&args.model))?;
    if scene.backdrop.is_some() && args.background.is_some() {
        return Err(Error::Arguments("--background: the scene has a backdrop; leave one of them out".to_owned()));
    }
    let cameras = cameras(args, &scene)?;
    let folder = args.output.as_deref().map(OutputFolder::create).transpose()?;
    let mut times_ms = Vec::with_capacity(cameras.len());
    let device =
        stages.run("render", |observer| draw(&scene, &cameras, args, folder.as_ref(), &mut times_ms, observer))?;
    if let Some(folder) = folder {
        folder.finish()?;
    }
    Ok(answer(args, &cameras, (&times_ms, &device), &stages))
}

fn answer(args: &RenderArgs, cameras: &[Numbered], (times_ms, device): (&[f64], &str), stages: &Stages<'_>) -> Answer {
    let size = cameras.first().map_or([0, 0], |(_, c)| [c.intrinsics.width, c.intrinsics.height]);
    let frame_ms = median(times_ms.to_vec());
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

fn cameras(args: &RenderArgs, scene: &Scene) -> Result<Vec<Numbered>, Error> {
    if let Some(path) = &args.path {
        return flight(args, &read_capture(path, false)?);
    }
    let capture = args.cameras.as_deref().map(|path| read_capture(path, false)).transpose()?;
    if let (Some(capture), None) = (&capture, args.turntable) {
        if args.size.is_some() {
            return Err(Error::Arguments("--size: the cameras give the size; use --downscale".to_owned()));
        }
        let positions = args.views.positions(capture.frames.len())?;
        return Ok(positions.iter().map(|&i| (i, capture.frames[i].camera.downscaled(args.downscale))).collect());
    }
    if args.turntable.is_none() && args.video.is_none() {
        return Err(Error::Arguments(
            "nothing says from where to draw; give --cameras, --turntable or --path".to_owned(),
        ));
    }
    let n = args.turntable.unwrap_or(TURN_FRAMES);
    Ok(orbit(args, scene, capture.as_ref(), n).into_iter().enumerate().collect())
}

/// Through the poses of a capture, in their order.
fn flight(args: &RenderArgs, keys: &Capture) -> Result<Vec<Numbered>, Error> {
    let mut keys: Vec<Camera> = keys.frames.iter().map(|frame| frame.camera.downscaled(args.downscale)).collect();
    if let Some([width, height]) = args.size {
        keys.iter_mut().for_each(|key| resize(key, [width / args.downscale, height / args.downscale]));
    }
    let cameras = smooth_cameras(&keys, args.frames);
    if cameras.is_empty() {
        return Err(Error::Arguments("--path: no camera there sees anything; give a capture with poses".to_owned()));
    }
    Ok(cameras.into_iter().enumerate().collect())
}

/// The same view up and down in a frame of another size.
fn resize(camera: &mut Camera, [width, height]: [usize; 2]) {
    let i = &mut camera.intrinsics;
    let (width, height) = (width.max(1), height.max(1));
    let scale = height as f64 / i.height.max(1) as f64;
    i.fx *= scale;
    i.fy *= scale;
    i.skew *= scale;
    i.cx = 0.5 * width as f64 + (i.cx - 0.5 * i.width as f64) * scale;
    i.cy *= scale;
    (i.width, i.height) = (width, height);
}

fn orbit(args: &RenderArgs, scene: &Scene, capture: Option<&Capture>, n: usize) -> Vec<Camera> {
    let unit = Aabb { min: [-0.5; 3].into(), max: [0.5; 3].into() };
    let aabb = scene.aabb().unwrap_or(unit);
    let filmed: Vec<Camera> = capture.iter().flat_map(|c| &c.frames).map(|frame| frame.camera).collect();
    let up = up_axis(&filmed).unwrap_or_else(|| args.up.into());
    let like = filmed.first();
    let filmed_size = like.map(|camera| [camera.intrinsics.width, camera.intrinsics.height]);
    let size = args.size.or(filmed_size).unwrap_or(SIZE).map(|side| (side / args.downscale).max(1));
    turntable_cameras(&aabb, like, n, size[0], size[1], up)
}

/// Draws every frame once, to the folder and to the film; says what drew them.
fn draw(
    scene: &Scene,
    cameras: &[Numbered],
    args: &RenderArgs,
    folder: Option<&OutputFolder>,
    times_ms: &mut Vec<f64>,
    observer: &dyn Observer,
) -> Result<String, Error> {
    let tiles: Vec<_> = scene.models.iter().map(playback::tiles).collect();
    let coats: Vec<_> = scene.models.iter().zip(&tiles).map(|(model, tiles)| playback::coats(model, tiles)).collect();
    let options = RenderOptions { supersample: args.supersample, background: args.background };
    let mut projector = Projector::new(scene, &coats, options, &Painter::new(choice(args.renderer))?);
    let lamps = args.light.lamps(scene.aabb().map_or([0.0; 3], |aabb| aabb.center().into()))?;
    let mut frame = |i: usize, camera: &Camera| {
        let start = Instant::now();
        let frame = projector.frame(camera, &lamps.seen_by(camera));
        times_ms.push(start.elapsed().as_secs_f64() * 1e3);
        projector.take_note().iter().for_each(|note| observer.noted(note));
        observer.advanced(i + 1, cameras.len());
        frame
    };
    let mut fault = None;
    let keep = |number: usize, frame: &Image<[u8; 4]>| {
        let write = |folder: &OutputFolder| Ok(write_png(&folder.place(format!("{number:04}.png"))?, frame)?);
        folder.map_or(Ok(()), write)
    };
    let frames = cameras.iter().enumerate().map(|(i, (number, camera))| {
        // Nothing is drawn after a fault; a film ends with a frame that is not of its size.
        if fault.is_some() {
            return Image::filled(0, 0, [0; 4]);
        }
        let frame = frame(i, camera);
        fault = keep(*number, &frame).err();
        frame
    });
    let filmed = match &args.video {
        Some(video) => film::write_film(video, frames, args.fps),
        None => {
            frames.for_each(drop);
            Ok(())
        }
    };
    fault.map_or(filmed, Err)?;
    Ok(projector.device().to_owned())
}
