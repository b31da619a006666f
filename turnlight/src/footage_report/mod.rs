//! What became of footage: which frames make the capture, how well their cameras and silhouettes are known, what is
//! missing, and what to film again. Written as `report.json` and as one page, `report.html`, that needs no other file.
//!
//! The caller fills a [`FootageReport`] and makes a [`Thumbnail`] of each frame kept, one frame at a time, so that no
//! film need be held in memory.

mod dome;
mod page;
mod plot;
#[cfg(test)]
mod tests;
mod thumbnail;
mod verdict;

pub use page::html;
pub use thumbnail::{Overlay, Thumbnail};
pub use verdict::Grade;

use capture::choose::{Choice, DropReason, Gap, PoseSource};
use capture::light::LightCheck;
use serde::Serialize;

/// All that is to be said of a piece of footage.
#[derive(Clone, Debug, Serialize)]
pub struct FootageReport {
    /// What was read, as the user named it.
    pub footage: String,
    /// How the camera and the object moved.
    pub motion: FootageMotion,
    /// Length of the film in seconds; `None` of stills.
    pub duration_s: Option<f64>,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Every frame looked at, in the order of the footage.
    pub frames: Vec<FrameReport>,
    /// The directions covered.
    pub coverage: Coverage,
    /// The lens; `None` where none was found.
    pub lens: Option<LensReport>,
    /// The board; `None` where the cameras come from elsewhere.
    pub board: Option<BoardReport>,
    /// The axis of the turntable; `None` of free-hand footage.
    pub axis: Option<AxisReport>,
    /// Where silhouettes come from, as in "green backdrop, keyed" or "masks given".
    pub silhouettes: String,
    /// What the light is fixed to, where it was looked at.
    pub light: Option<LightCheck>,
    /// Corners of the object's box, in world units.
    pub aabb: Option<[[f64; 3]; 2]>,
    /// Metres per world unit, where known.
    pub unit: Option<f64>,
    /// What else was noticed, the gravest first.
    pub findings: Vec<Finding>,
    /// What to film again, each a sentence; empty when all is well.
    pub film_again: Vec<String>,
}

/// How camera and object moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FootageMotion {
    /// The camera stood, the object turned.
    Turntable,
    /// The object stood, the camera was carried around it.
    FreeHand,
    /// Not found out.
    Unknown,
}

/// One frame. What is not known is `None`.
#[derive(Clone, Debug, Serialize)]
pub struct FrameReport {
    /// Position in the footage.
    pub position: usize,
    /// The file of a photograph, or film and number.
    pub name: String,
    /// Since the start of the film.
    pub time_s: Option<f64>,
    /// Position in the capture; `None` where it was left out.
    pub kept: Option<usize>,
    /// Why it was left out.
    pub dropped: Option<Dropping>,
    /// How its camera is known.
    pub pose: PoseSource,
    /// Turn of the platter since the first frame.
    pub angle_deg: Option<f64>,
    /// Standard deviation of that turn, where it was estimated.
    pub angle_deviation_deg: Option<f64>,
    /// Unit direction from the object towards the camera, in the world.
    pub direction: Option<[f64; 3]>,
    /// Reprojection error of the board, RMS.
    pub rms_px: Option<f64>,
    /// Corners of the board found.
    pub corners: Option<usize>,
    /// Sharpness relative to the sharp frames of the footage.
    pub sharpness: Option<f64>,
    /// Standard deviation of the blur at the edges of the board.
    pub blur_px: Option<f64>,
    /// IoU of its silhouette with what those of the other frames leave of the object.
    pub agreement: Option<f64>,
    /// Factor that evens its exposure.
    pub exposure_gain: Option<f64>,
}

/// Why a frame was left out.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Dropping {
    /// When frames were chosen.
    Choice(DropReason),
    /// Its silhouette contradicts the others.
    Silhouette,
    /// Otherwise, in words.
    Other(String),
}

/// The directions covered.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Coverage {
    /// Turns about the axis in the footage.
    pub turns: Option<f64>,
    /// Whether the frames kept go all around.
    pub is_closed: bool,
    /// Middle angle between neighbours kept.
    pub step_deg: Option<f64>,
    /// Where nothing was seen.
    pub gaps: Vec<Gap>,
    /// Unit vector upwards in the world, towards the zenith of the dome plot.
    pub up: [f64; 3],
}

/// A number with its standard deviation, where that is known.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Measured {
    /// The value.
    pub value: f64,
    /// Standard deviation; `None` where the value was not estimated.
    pub deviation: Option<f64>,
}

/// The lens and how well it is known.
#[derive(Clone, Debug, Serialize)]
pub struct LensReport {
    /// Focal length along x and y, pixels.
    pub focal_px: [Measured; 2],
    /// Principal point from the corner of the first pixel, pixels.
    pub principal_px: [Measured; 2],
    /// Coefficients of distortion by name, as in `("k1", …)`.
    pub distortion: Vec<(String, Measured)>,
    /// Where it comes from: "this footage", "separate shots of the board", a file.
    pub source: String,
    /// What was taken for granted because the footage does not show it, each a sentence.
    pub assumptions: Vec<String>,
}

/// The board.
#[derive(Clone, Debug, Serialize)]
pub struct BoardReport {
    /// Its text form, as in `charuco:7x7:61mm:45.75mm:4x4_50`.
    pub text: String,
    /// Corners it has.
    pub corners: usize,
    /// Reprojection error over all frames posed, RMS, pixels.
    pub rms_px: Option<f64>,
}

/// The axis of the turntable, in the world of the capture.
#[derive(Clone, Debug, Serialize)]
pub struct AxisReport {
    /// A point on it, world units.
    pub point: [f64; 3],
    /// Its unit direction; the object turns right-handed about it.
    pub direction: [f64; 3],
    /// Root of the mean squared angle between the direction told and the true one in the board, degrees.
    pub deviation_deg: Option<f64>,
    /// Standard deviation of the turn of a frame that shows the board, root of their mean square, degrees.
    pub angle_deviation_deg: Option<f64>,
}

/// Something noticed.
#[derive(Clone, Debug, Serialize)]
pub struct Finding {
    /// How grave it is.
    pub severity: Severity,
    /// What, and what to do, in a sentence.
    pub text: String,
}

/// How grave a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// The capture cannot be used as it is.
    Fault,
    /// It will show in the model.
    Warning,
    /// Good to know.
    Note,
}

impl Coverage {
    /// As frames were chosen, with `up` towards the zenith.
    pub fn of(choice: &Choice, up: [f64; 3]) -> Self {
        let (turns, is_closed, step_deg) = (choice.turns, choice.is_closed, choice.step_deg);
        Self { turns, is_closed, step_deg, gaps: choice.gaps.clone(), up }
    }
}

impl FootageReport {
    /// Whether the frames are stills.
    pub fn is_stills(&self) -> bool {
        self.duration_s.is_none()
    }

    /// Frames that make the capture.
    pub fn kept(&self) -> impl Iterator<Item = &FrameReport> {
        self.frames.iter().filter(|frame| frame.kept.is_some())
    }
}
