//! Where the cameras of footage come from: a board in it, or elsewhere.

use super::look::look;
use super::pictures::Taken;
use super::{FootageOptions, Shots, Standpoint, by_colmap};
use crate::Error;
use crate::stages::Stages;
use capture::footage::{Footage, FrameSource};
use capture::turntable::{Axis, turned_camera};
use capture::{Camera, Capture};
use nalgebra::{Point3, Rotation3, Vector3};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Where the cameras come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum CameraSource {
    /// A board in the footage.
    #[default]
    Board,
    /// A calibrated folder of any known kind, whose frames have the names of the photographs, or the numbers of the film's
    /// frames, counted from 0; or a capture made of this film before.
    Calibrated(PathBuf),
    /// One camera that stands still, and a table that turns evenly.
    Turning(EvenTurn),
    /// An installed COLMAP, by name or path, on what moves before a camera that stands still, or on the masks given.
    Colmap(PathBuf),
}

/// A table that turns evenly before one camera.
#[derive(Clone, Debug, PartialEq)]
pub struct EvenTurn {
    /// A calibrated folder of any known kind, whose first camera is that of the first frame.
    pub camera: PathBuf,
    /// In the world of that camera.
    pub axis: Axis,
    /// Radians from photograph to photograph; of a film, a second.
    pub step: f64,
}

/// Finds the frames of the footage and their cameras; and the pictures of some, where they were needed for that and written
/// beside the place of the `output`.
///
/// # Errors
/// Where the footage cannot be read, shows no board, or its cameras cannot be told.
pub(super) fn find_cameras(
    footage: &Footage,
    options: &FootageOptions,
    output: &Path,
    stages: &mut Stages<'_>,
) -> Result<(Shots, Option<Taken>), Error> {
    let shots = match &options.cameras {
        CameraSource::Board => by_board(footage, options, stages)?,
        CameraSource::Calibrated(path) => calibrated(footage, path, stages)?,
        CameraSource::Turning(turn) => turning(footage, turn, stages)?,
        CameraSource::Colmap(program) => return by_colmap::find_cameras(footage, program, options, output, stages),
    };
    Ok((shots, None))
}

#[cfg(feature = "video")]
use super::by_board::find_cameras as by_board;

/// Boards are found by OpenCV.
#[cfg(not(feature = "video"))]
fn by_board(footage: &Footage, _: &FootageOptions, _: &mut Stages<'_>) -> Result<Shots, Error> {
    Err(needs_video(footage))
}

#[cfg(not(feature = "video"))]
pub(super) fn needs_video(footage: &Footage) -> Error {
    Error::Failed(format!(
        "{}: this turnlight was built without films and boards; give the cameras of photographs with --cameras, or \
         install libopencv-dev, clang and libclang-dev and build with --features video",
        footage.path().display()
    ))
}

/// Frames whose cameras were told elsewhere: of every photograph, of a film of any frames.
fn calibrated(footage: &Footage, path: &Path, stages: &mut Stages<'_>) -> Result<Shots, Error> {
    let capture = Capture::read(path)?;
    refuse_twins(&footage.photographs())?;
    let size = capture.frames.first().map(|frame| [frame.camera.intrinsics.width, frame.camera.intrinsics.height]);
    let mut shots = look(footage, size, stages)?;
    let (takes, numbered) = (shots.takes(), FilmCameras::of(&capture, path));
    for shot in &mut shots.shots {
        let camera = match shot.source.file {
            Some(_) => Some(camera_of(&shot.source, &capture, path)?),
            None => numbered.of_frame(&shot.source, takes),
        };
        shot.set_camera(camera);
    }
    if shots.shots.iter().all(|shot| shot.camera.is_none()) {
        let (film, cameras) = (footage.path().display(), path.display());
        let fault = format!("{film}: {cameras} has a camera for none of its {} frames", shots.shots.len());
        let remedy = "name the pictures there by the numbers of the frames, counted from 0 (0012.png), give a capture \
                      made of this film, or one camera and how the table turns (--step)";
        return Err(Error::Failed(format!("{fault}; {remedy}")));
    }
    Ok(Shots { told_by: format!("cameras of {}", path.display()), unit: capture.unit, ..shots })
}

/// Photographs of the same name cannot be told apart by it.
fn refuse_twins(sources: &[FrameSource]) -> Result<(), Error> {
    let mut names = std::collections::BTreeSet::new();
    match sources.iter().find(|source| !names.insert(source.name.to_lowercase())) {
        None => Ok(()),
        Some(twin) => {
            let fault = format!("{}: two photographs have this name, and cameras are found by it", twin.name);
            Err(Error::Arguments(format!("{fault}; give their folders one by one, or rename them")))
        }
    }
}

/// The camera of the frame of the same name.
fn camera_of(source: &FrameSource, capture: &Capture, path: &Path) -> Result<Camera, Error> {
    let stem = |path: &Path| path.file_stem().map(|s| s.to_string_lossy().to_lowercase());
    let wanted = source.file.as_deref().and_then(stem);
    let found = capture.frames.iter().find(|frame| stem(&frame.image_path) == wanted);
    found.map(|frame| frame.camera).ok_or_else(|| {
        let fault = format!("{}: {} has no camera of this name", source.name, path.display());
        Error::Failed(format!("{fault}; leave the photograph out, or add its camera"))
    })
}

/// Cameras of frames of films.
enum FilmCameras {
    /// By what the report of a capture of ours calls the frames: its pictures are numbered as they follow in it.
    Reported(BTreeMap<String, Camera>),
    /// By folder and number in the names of the pictures.
    Numbered(BTreeMap<(String, usize), Camera>),
}

/// As much of `report.json` as says which frame became which picture.
#[derive(Deserialize)]
struct Report {
    frames: Vec<ReportedFrame>,
}

#[derive(Deserialize)]
struct ReportedFrame {
    name: String,
    kept: Option<usize>,
}

impl FilmCameras {
    fn of(capture: &Capture, path: &Path) -> Self {
        let folder = if path.is_file() { path.parent().unwrap_or(path) } else { path };
        let text = std::fs::read_to_string(folder.join("report.json")).ok();
        let name = |part: Option<&std::ffi::OsStr>| part.map(|s| s.to_string_lossy().into_owned());
        let number = |frame: &capture::Frame| name(frame.image_path.file_stem())?.parse::<usize>().ok();
        // What is called so and is none of ours says nothing.
        if let Some(report) = text.and_then(|text| serde_json::from_str::<Report>(&text).ok()) {
            // By the numbers of its pictures: some may have been taken out.
            let camera = |frame: ReportedFrame| {
                let kept = frame.kept?;
                let found = capture.frames.iter().find(|picture| number(picture) == Some(kept))?;
                Some((frame.name, found.camera))
            };
            return Self::Reported(report.frames.into_iter().filter_map(camera).collect());
        }
        let camera = |frame: &capture::Frame| {
            let folder = name(frame.image_path.parent()?.file_name()).unwrap_or_default();
            Some(((folder, number(frame)?), frame.camera))
        };
        Self::Numbered(capture.frames.iter().filter_map(camera).collect())
    }

    /// Of several takes each has a folder of its name.
    fn of_frame(&self, source: &FrameSource, takes: usize) -> Option<Camera> {
        match self {
            Self::Reported(cameras) => cameras.get(&source.name).copied(),
            Self::Numbered(cameras) if takes > 1 => cameras.get(&(source.take_name.clone(), source.index)).copied(),
            Self::Numbered(cameras) => {
                let is_it = |(place, _): &(&(String, usize), &Camera)| place.1 == source.index;
                cameras.iter().find(is_it).map(|(_, camera)| *camera)
            }
        }
    }
}

/// Frames of one camera that stands still, before a table that turns evenly. The world is laid along the axis: z points
/// along it, the origin is the point given.
fn turning(footage: &Footage, turn: &EvenTurn, stages: &mut Stages<'_>) -> Result<Shots, Error> {
    let capture = Capture::read(&turn.camera)?;
    let Some(first) = capture.frames.first().map(|frame| along_axis(&frame.camera, &turn.axis)) else {
        return Err(Error::Failed(format!("{}: holds no camera; calibrate one", turn.camera.display())));
    };
    if footage.takes.len() > 1 {
        let fault = "--step: one camera that stands still sees one film or folder, and several are given";
        return Err(Error::Arguments(format!("{fault}; make a capture of each")));
    }
    let mut shots = look(footage, Some([first.intrinsics.width, first.intrinsics.height]), stages)?;
    let start = shots.shots.first().map_or(0.0, |shot| shot.source.time_s);
    let axis = Axis { point: Point3::origin(), direction: Vector3::z_axis() };
    for shot in &mut shots.shots {
        let angle = turn.step * (shot.source.time_s - start);
        shot.set_camera(Some(turned_camera(&first, &axis, angle)));
        (shot.angle, shot.standpoint) = (Some(angle), Some(0));
    }
    // Without the last digits of radians.
    let degrees = (turn.step.to_degrees() * 1e6).round() / 1e6;
    let centre = first.center();
    let every = if footage.has_film() { "a second" } else { "from photograph to photograph" };
    let assumed = format!("the table is taken to turn evenly, by {degrees}° {every}, and the camera to stand still");
    let told_by = format!("the first camera of {}, an axis and a step", turn.camera.display());
    let standpoints = vec![Standpoint { take: 0, azimuth: Some(centre.y.atan2(centre.x)) }];
    Ok(Shots { standpoints, told_by, unit: capture.unit, notes: vec![assumed], ..shots })
}

/// The camera in a world whose z is the axis and whose origin is the axis's point.
fn along_axis(camera: &Camera, axis: &Axis) -> Camera {
    // Of opposite directions any half turn leads from one to the other.
    let half_turn = || Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let turn = Rotation3::rotation_between(&Vector3::z_axis(), &axis.direction).unwrap_or_else(half_turn);
    Camera {
        rotation: camera.rotation * turn.matrix(),
        translation: camera.rotation * axis.point.coords + camera.translation,
        ..*camera
    }
}
