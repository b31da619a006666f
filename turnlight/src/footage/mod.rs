//! From footage to a capture: frames, cameras, silhouettes, light, and a report of how well it went.
//!
//! 1. *Look* through all frames: the board, sharpness, motion ([`shots`]).
//! 2. *Calibrate*: lens, turntable and a camera for every frame; or take cameras that are given.
//! 3. *Choose* frames: sharp ones, evenly around.
//! 4. *Cut out* the object, and even exposure and white balance.
//! 5. *Check* every silhouette against the hull of the others; one that contradicts them is left out.
//!
//! Chosen frames lie on disk while this goes on: memory does not grow with the length of a film.

#[cfg(feature = "video")]
mod by_board;
mod by_colmap;
mod cameras;
mod light;
mod look;
mod pictures;
mod report;
mod select;
mod shots;
mod silhouettes;

pub use cameras::{CameraSource, EvenTurn};
pub use light::FootageLight;
pub use select::Selected;
pub use shots::{Shot, Shots, Standpoint};

use crate::Error;
use crate::footage_report::{self, FootageReport};
use crate::stages::Stages;
use capture::calibrate::MotionKind;
use capture::footage::Footage;
use capture::silhouette::Silhouettes;
use capture::{Board, Capture, Frame, Image, MaskSource};
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
    /// Column, row and radius in pixels, to a tenth of the radius, of the outline of a shiny ball that stands in the room:
    /// its highlight shows where the light is.
    pub light_ball: Option<[f64; 3]>,
    /// Frames to keep at most; `None` for as many as [`capture::choose::ChooseOptions`] says.
    pub most: Option<usize>,
}

/// A capture made from footage, before it is written.
#[derive(Debug)]
pub struct CapturedFootage {
    /// The frames that were kept. Their pictures lie beside the place the capture will have, as long as this lives.
    pub capture: Capture,
    /// All frames of the footage.
    pub shots: Shots,
    /// Which of them were chosen, and why the others were not.
    pub selected: Selected,
    /// Silhouettes of the frames chosen; those that contradict the others are not in the capture.
    pub silhouettes: Silhouettes,
    /// Positions among the frames chosen of those in the capture.
    pub kept: Vec<usize>,
    /// What the light is fixed to, and where it is.
    pub light: FootageLight,
    light_ball: bool,
    pictures: Pictures,
}

/// Makes a capture of footage; `output` is where it will be written, and pictures are kept beside it meanwhile.
///
/// # Errors
/// Names what is wrong with the footage, and what to do.
pub fn capture_footage(
    footage: &Footage,
    options: &FootageOptions,
    output: &Path,
    stages: &mut Stages<'_>,
) -> Result<CapturedFootage, Error> {
    let (shots, taken) = cameras::find_cameras(footage, options, output, stages)?;
    light::check_ball(&shots, options)?;
    let selected = select::select(&shots, options);
    refuse_unusable(footage, &shots, &selected, stages)?;
    let sources: Vec<_> = selected.kept.iter().map(|&at| shots.shots[at].source.clone()).collect();
    let beside = crate::output::parent(output);
    let pictures = match taken.and_then(|taken| taken.only(&selected.kept)) {
        Some(pictures) => pictures,
        None => stages.run("take frames", |observer| Pictures::extract(footage, &sources, beside, observer))?,
    };
    let silhouettes = stages.run("silhouettes", |_| silhouettes::find(&pictures, &shots, &selected.kept, options))?;
    refuse_useless(footage, &shots, &selected, &silhouettes, stages)?;
    stages.run("even out", |_| pictures.even_out(&silhouettes.gains))?;
    let light = stages.run("light", |_| light::find(&pictures, &shots, &selected.kept, &silhouettes, options))?;
    let kept: Vec<usize> = (0..sources.len()).filter(|at| !silhouettes.contradicting.contains(at)).collect();
    let frame = |&at: &usize| {
        let camera = shots.shots[selected.kept[at]].camera?;
        let image_path = pictures.file(at).to_owned();
        let light_direction = light.directions[at];
        Some(Frame { image_path, mask_path: None, camera, light_direction, exposure: None })
    };
    let light_ball = options.light_ball.is_some();
    let frames: Vec<Frame> = kept.iter().filter_map(frame).collect();
    let capture = Capture { frames, aabb: silhouettes.aabb, unit: shots.unit, mask_source: MaskSource::Automatic };
    Ok(CapturedFootage { capture, shots, selected, silhouettes, kept, light, light_ball, pictures })
}

/// Of footage without a usable frame there is nothing to cut out.
fn refuse_unusable(footage: &Footage, shots: &Shots, selected: &Selected, stages: &Stages<'_>) -> Result<(), Error> {
    if !selected.kept.is_empty() {
        return Ok(());
    }
    shots.found().iter().for_each(|line| stages.observer().noted(line));
    let fault = format!("{}: no frame can be used", footage.path().display());
    let remedy = "film sharper and slower, with the board in view all the time";
    Err(Error::Failed(format!("{fault} ({}); {remedy}", selected.why_none())))
}

/// Without an object, or with a single view of it, there is nothing to write; what calibration found is told all the same.
fn refuse_useless(
    footage: &Footage,
    shots: &Shots,
    selected: &Selected,
    silhouettes: &Silhouettes,
    stages: &Stages<'_>,
) -> Result<(), Error> {
    let views = selected.kept.len() - silhouettes.contradicting.len();
    let fault = match (silhouettes.aabb, views) {
        (None, _) => silhouettes.findings.join("; "),
        (Some(_), 0..2) => {
            let left_out = silhouettes.contradicting.len();
            format!(
                "{views} view can be used ({left_out} silhouettes contradict the others; {}), and a capture needs more \
                 sides; film all around an object, sharp, with the board in view (footage of the board alone tells the lens \
                 of other footage: --calibration)",
                selected.why_none()
            )
        }
        _ => return Ok(()),
    };
    shots.found().iter().for_each(|line| stages.observer().noted(line));
    Err(Error::Failed(format!("{}: {fault}", footage.path().display())))
}

impl CapturedFootage {
    /// The mattes of the frames in the capture.
    pub fn mattes(&self) -> Vec<Image<u8>> {
        self.kept.iter().map(|&at| self.silhouettes.mattes[at].clone()).collect()
    }

    /// Reads the picture of a frame chosen.
    ///
    /// # Errors
    /// Where it was removed meanwhile.
    pub fn picture(&self, at: usize) -> Result<Image<[u8; 3]>, Error> {
        Ok(self.pictures.read(at)?)
    }

    /// Writes the capture with its report to `output`, whole or not at all.
    ///
    /// # Errors
    /// As [`Capture::write`].
    pub fn write(&self, report: &FootageReport, output: &Path) -> Result<(), Error> {
        let html = footage_report::html(report, &self.thumbnails()?);
        let json = format!("{:#}\n", report.json());
        Ok(self.capture.write_with_report(&self.mattes(), &html, &json, output)?)
    }
}

#[cfg(test)]
mod tests;
