//! Where the cameras of footage come from: a board in it, or elsewhere.

use super::{FootageOptions, Shot, Shots, silhouettes};
use crate::Error;
use crate::colmap::{self, ColmapOptions, Photograph};
use crate::stages::Stages;
use capture::choose::{self, PoseSource};
use capture::footage::{Footage, FrameSource, read_upright};
use capture::{Camera, Capture};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Where the cameras come from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum CameraSource {
    /// A board in the footage.
    #[default]
    Board,
    /// A calibrated folder of any known kind, whose frames have the names of the photographs.
    Calibrated(PathBuf),
    /// An installed COLMAP, by name or path, on the photographs and the masks given with them.
    Colmap(PathBuf),
}

/// Finds the frames of the footage and their cameras.
///
/// # Errors
/// Where the footage cannot be read, shows no board, or its cameras cannot be told.
pub(super) fn find_cameras(
    footage: &Footage,
    options: &FootageOptions,
    stages: &mut Stages<'_>,
) -> Result<Shots, Error> {
    match &options.cameras {
        CameraSource::Board => by_board(footage, options, stages),
        CameraSource::Calibrated(path) => calibrated(footage, path, stages),
        CameraSource::Colmap(program) => by_colmap(footage, program, options, stages),
    }
}

#[cfg(feature = "video")]
use super::by_board::find_cameras as by_board;

/// Boards are found by OpenCV.
#[cfg(not(feature = "video"))]
fn by_board(footage: &Footage, _: &FootageOptions, _: &mut Stages<'_>) -> Result<Shots, Error> {
    Err(Error::Failed(format!(
        "{}: this turnlight was built without films and boards; give the cameras of photographs with --cameras, or \
         install libopencv-dev, clang and libclang-dev and build with --features video",
        footage.path().display()
    )))
}

/// Photographs whose cameras were told elsewhere.
fn calibrated(footage: &Footage, path: &Path, stages: &mut Stages<'_>) -> Result<Shots, Error> {
    let capture = Capture::read(path)?;
    let sources = photographs(footage)?;
    refuse_twins(&sources)?;
    let cameras = sources.iter().map(|source| camera_of(source, &capture, path)).collect::<Result<Vec<_>, _>>()?;
    let cameras = cameras.into_iter().map(Some).collect();
    let shots = photographed(sources, cameras, format!("cameras of {}", path.display()), stages)?;
    Ok(Shots { unit: capture.unit, ..shots })
}

/// Photographs whose cameras COLMAP finds. What stands still while the object turns has to be masked.
fn by_colmap(
    footage: &Footage,
    program: &Path,
    options: &FootageOptions,
    stages: &mut Stages<'_>,
) -> Result<Shots, Error> {
    let sources = photographs(footage)?;
    if options.masks.is_none() {
        let note = "no masks: COLMAP sees the room, which is right only if the camera was carried (otherwise --masks)";
        stages.observer().noted(note);
    }
    let photograph = |source: &FrameSource| {
        let takes = footage.takes.len();
        let mask = options.masks.as_ref().map(|folder| silhouettes::mask_of(folder, source, takes)).transpose()?;
        Ok(Photograph { image: source.file.clone().unwrap_or_default(), mask })
    };
    let pictures = sources.iter().map(photograph).collect::<Result<Vec<_>, Error>>()?;
    let colmap = ColmapOptions { program: program.to_owned(), ..ColmapOptions::default() };
    let found = colmap::find_cameras(&pictures, &colmap, stages)?;
    let mut shots = photographed(sources, found.cameras, "COLMAP".to_owned(), stages)?;
    if found.models > 1 {
        let fault = format!("the photographs fell apart into {} groups, of which the largest is used", found.models);
        shots.findings.push(format!("{fault}: take more between them"));
    }
    Ok(shots)
}

fn photographed(
    sources: Vec<FrameSource>,
    cameras: Vec<Option<Camera>>,
    told_by: String,
    stages: &mut Stages<'_>,
) -> Result<Shots, Error> {
    let size = cameras.iter().flatten().next().map_or([0, 0], |c| [c.intrinsics.width, c.intrinsics.height]);
    let look = |source: &FrameSource| {
        let Some(file) = &source.file else { return Ok(0.0) };
        let image = read_upright(file)?;
        silhouettes::check_size(file, [image.width(), image.height()], size)?;
        Ok(choose::sharpness(&image))
    };
    let sharpness: Vec<Result<f64, Error>> = stages.run("look", |_| sources.par_iter().map(look).collect());
    let mut shots = Vec::new();
    for ((source, camera), sharpness) in sources.into_iter().zip(cameras).zip(sharpness) {
        shots.push(Shot {
            source,
            sharpness: sharpness?,
            blur_px: None,
            motion: 0.0,
            camera,
            pose: if camera.is_some() { PoseSource::Measured } else { PoseSource::Missing },
            angle: None,
            angle_deviation: None,
            standpoint: None,
            corners: 0,
            rms_px: 0.0,
            fault: None,
        });
    }
    let has_plane = false;
    let (findings, notes) = (Vec::new(), Vec::new());
    Ok(Shots { shots, size, calibration: None, print: None, told_by, unit: None, has_plane, findings, notes })
}

/// The frames of footage that is photographs alone.
fn photographs(footage: &Footage) -> Result<Vec<FrameSource>, Error> {
    if footage.has_film() {
        let fault = "cameras from elsewhere are given by the names of photographs, and this is a film";
        return Err(Error::Arguments(format!("{}: {fault}; give its frames as a folder", footage.path().display())));
    }
    Ok(footage.photographs())
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
