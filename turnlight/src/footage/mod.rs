//! From footage to a capture: frames, cameras, silhouettes, light, and a report of how well it went.
//!
//! 1. *Look* through all frames: the board, sharpness, motion ([`shots`]).
//! 2. *Calibrate*: lens, turntable and a camera for every frame; or take cameras that are given.
//! 3. *Choose* frames: sharp ones, evenly around.
//! 4. *Cut out* the object, and even exposure and white balance.
//! 5. *Check* every silhouette against the hull of the others; one that contradicts them is left out.
//!
//! Chosen frames lie on disk while this goes on: memory does not grow with the length of a film.

mod cameras;
mod pictures;
mod report;
mod select;
mod shots;

pub use cameras::CameraSource;
pub use shots::{Shot, Shots};

use crate::Error;
use crate::stages::Stages;
use capture::calibrate::MotionKind;
use capture::footage::Footage;
use capture::silhouette::{SilhouetteOptions, Silhouettes};
use capture::{Board, Camera, Capture, Frame, Image, MaskSource};
use pictures::Pictures;
use std::path::{Path, PathBuf};

/// How footage becomes a capture.
#[derive(Clone, Debug, Default)]
pub struct FootageOptions {
    /// The board on the turntable; `None` to find out by looking.
    pub board: Option<Board>,
    /// Side of a square (of boards of markers alone: of a marker) in metres, where the board is found by looking.
    pub length: Option<f64>,
    /// Shots of a board waved before the same camera at the same zoom, for the lens.
    pub calibration: Option<Footage>,
    /// What moved; `None` to find out.
    pub motion: Option<MotionKind>,
    /// Cameras from elsewhere, in place of a board.
    pub cameras: CameraSource,
    /// A folder of masks from elsewhere.
    pub masks: Option<PathBuf>,
    /// Pictures of the set without the object, one per camera position.
    pub clean_plates: Vec<PathBuf>,
    /// Frames to keep at most; `None` for as many as [`capture::choose::ChooseOptions`] says.
    pub most: Option<usize>,
}

/// A capture made from footage, before it is written.
#[derive(Debug)]
pub struct CapturedFootage {
    /// The frames that were kept; their pictures lie beside the place the capture will have, as long as this lives.
    pub capture: Capture,
    /// The mattes of the frames kept.
    pub mattes: Vec<Image<u8>>,
    /// All frames of the footage.
    pub shots: Shots,
    /// Per frame kept, its position in the footage.
    pub kept: Vec<usize>,
    /// Per frame kept, how well its silhouette agrees with the hull of the others: IoU.
    pub agreement: Vec<f64>,
    _pictures: Pictures,
}

/// Makes a capture of footage. Pictures are kept beside `output` meanwhile.
///
/// # Errors
/// Names what is wrong with the footage, and what to do.
pub fn capture_footage(
    footage: &Footage,
    options: &FootageOptions,
    output: &Path,
    stages: &mut Stages<'_>,
) -> Result<CapturedFootage, Error> {
    let shots = cameras::find_cameras(footage, options, stages)?;
    let chosen = select::select(&shots, options);
    let kept: Vec<usize> = chosen.kept();
    let sources: Vec<_> = kept.iter().map(|&at| shots.shots[at].source.clone()).collect();
    let beside = beside(output)?;
    let pictures = stages.run("take frames", |observer| Pictures::extract(footage, &sources, &beside, observer))?;
    let silhouettes = stages.run("silhouettes", |_| silhouettes::find(&pictures, &shots, &kept, options))?;
    stages.run("even out", |_| pictures.even_out(&silhouettes.gains))?;
    todo!()
}
