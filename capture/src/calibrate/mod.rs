//! Cameras from the corners of a calibration target: lens, poses, and the axis and angles of a turntable.
//!
//! Everything is a maximum a posteriori estimate: what the corners do not tell comes from weak assumptions about
//! lenses, and the result says which numbers those are. A board that lies flat on a platter is always seen at the same
//! tilt, so that every picture tells the same two things about the lens (Zhang 2000); then focal length and principal
//! point are known no better than assumed, however many pictures there are.
//!
//! ```no_run
//! use capture::calibrate::{CalibrateOptions, Sighting, Target, calibrate};
//!
//! # let (board, sightings): (capture::Board, Vec<Sighting>) = unimplemented!();
//! let result = calibrate(&Target::Points(board.corners()), &sightings, &CalibrateOptions::new([1280, 720]))?;
//! println!("{:.1} px, {:.2} px RMS", result.intrinsics.fx, result.rms_px);
//! result.findings.iter().for_each(|finding| println!("{finding}"));
//! # Ok::<(), capture::calibrate::CalibrateError>(())
//! ```

mod bundle;
mod clean;
mod deviation;
mod equations;
mod error;
mod estimate;
mod fill;
mod findings;
mod homography;
mod layout;
mod lens;
mod pose;
mod projection;
mod result;
mod rig;
mod turntable;

pub use error::CalibrateError;

use crate::{Camera, Intrinsics};
use nalgebra::{Isometry3, Point2, Point3, Vector3};

/// What is looked at.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// Points whose places are known, such as [`Board::corners`](crate::Board::corners): in one plane or not, in metres.
    Points(Vec<Point3<f64>>),
    /// Square markers of one size lying anywhere in a plane, learnt from the pictures: corner `4 id + k` is the top
    /// left, top right, bottom right, bottom left one of marker `id`.
    Markers {
        /// Side of a marker with its dark border, in metres.
        side: f64,
    },
}

/// What one picture shows of the target.
#[derive(Clone, Debug, PartialEq)]
pub struct Sighting {
    /// Its number, ascending; any others may lie between.
    pub frame: usize,
    /// Since the start of the film.
    pub time_s: f64,
    /// Indices of the target's points and where they are, in pixels.
    pub corners: Vec<(usize, Point2<f64>)>,
    /// Which film or folder it is from; the camera is taken to have moved between two of them. 0 if there is one.
    pub film: usize,
}

/// What moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionKind {
    /// The target turns about one axis before a camera that stands still.
    Turntable,
    /// The camera is carried.
    FreeHand,
}

/// What is known of the lens beforehand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LensKnowledge {
    /// That it is a camera's: a focal length of half to three image widths, the principal point near the middle.
    Unknown,
    /// The focal length in pixels, to a tenth.
    Guess(f64),
    /// Everything; held as it is.
    Known(Intrinsics),
}

/// How cameras are told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrateOptions {
    /// Of the pictures, width and height in pixels.
    pub size: [usize; 2],
    /// What is known of the lens.
    pub lens: LensKnowledge,
    /// What moves; `None` to find out.
    pub motion: Option<MotionKind>,
    /// Whether a picture may number the target's points from either of two opposite ends, as of a chessboard that
    /// looks the same upside down.
    pub upside_down: bool,
}

impl CalibrateOptions {
    /// For pictures of this size, nothing known.
    pub fn new(size: [usize; 2]) -> Self {
        Self { size, lens: LensKnowledge::Unknown, motion: None, upside_down: false }
    }
}

/// Cameras, and how far to trust them.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Of all pictures.
    pub intrinsics: Intrinsics,
    /// How far to trust the lens.
    pub lens: LensReport,
    /// What moved.
    pub motion: Motion,
    /// One for each sighting, in their order.
    pub frames: Vec<FramePose>,
    /// Of all corners used, in pixels: root of the mean squared distance.
    pub rms_px: f64,
    /// The target's points by index, in target coordinates: as they were given, or as learnt.
    pub points: Vec<(usize, Point3<f64>)>,
    /// From target to world coordinates. The world's z is the turntable's axis, out of the printed side; its origin is
    /// where the axis meets the target's plane; its x is the target's, made orthogonal. Without an axis: the target's
    /// axes about its middle.
    pub world_from_target: Isometry3<f64>,
    /// What will show in the model, in sentences, the gravest first.
    pub findings: Vec<String>,
    /// What is good to know, and nothing to mend.
    pub notes: Vec<String>,
}

/// One number of the lens.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum LensParameter {
    /// `fx`, in pixels.
    Focal,
    /// `fy / fx`.
    Aspect,
    /// Principal point, column, in pixels.
    Cx,
    /// Principal point, row, in pixels.
    Cy,
    /// Radial, second order.
    K1,
    /// Radial, fourth order.
    K2,
    /// Radial, sixth order.
    K3,
    /// Tangential, vertical.
    P1,
    /// Tangential, horizontal.
    P2,
}

/// Where a number of the lens comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The corners tell it.
    Footage,
    /// The corners tell less of it than was assumed beforehand.
    Assumption,
    /// It was held: given, or a term the corners do not need.
    Held,
}

/// One number of the lens and how far to trust it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensTerm {
    /// Which.
    pub parameter: LensParameter,
    /// In the parameter's unit.
    pub value: f64,
    /// Standard deviation in the same unit, with what was assumed; 0 if held.
    pub deviation: f64,
    /// What the corners alone leave open, in the same unit; infinite where they tell nothing.
    pub footage_deviation: f64,
    /// Where it comes from.
    pub source: Source,
}

/// How far to trust the lens.
#[derive(Clone, Debug, PartialEq)]
pub struct LensReport {
    /// Every parameter, in order.
    pub terms: Vec<LensTerm>,
    /// Fifth over first singular value of the constraints that flat views put on the lens (Zhang 2000); `None` for
    /// targets that are not flat. Below 1e-3 or so all views show the target at one tilt.
    pub constraint_ratio: Option<f64>,
    /// Whether focal length or principal point rest on assumptions, or on traces of distortion alone, because the target
    /// was always seen at one tilt.
    pub is_degenerate: bool,
    /// What to do about it; empty where nothing needs doing.
    pub advice: String,
}

/// What moved.
#[derive(Clone, Debug, PartialEq)]
pub enum Motion {
    /// The target, about one axis.
    Turntable(Turntable),
    /// The camera.
    FreeHand,
}

/// A camera that stood still for some time.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// Position of the first sighting that it took.
    pub first: usize,
    /// Position of the last sighting that it took.
    pub last: usize,
    /// Which film it is of.
    pub film: usize,
    /// World to camera at angle 0.
    pub pose: Isometry3<f64>,
}

/// A platter: at angle θ a camera sees the world's point `X` where it saw `Rz(θ) X` at angle 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Turntable {
    /// A point of the axis in target coordinates: the world's origin.
    pub axis_point: Point3<f64>,
    /// Unit direction of the axis in target coordinates: the world's z.
    pub axis_direction: Vector3<f64>,
    /// Turn at each sighting in radians, unwrapped over several turns; 0 at the first used. `None` where it is
    /// not known.
    pub angles: Vec<Option<f64>>,
    /// How far the direction of the axis in the target is off, in radians: the root of the mean squared angle, as far as
    /// errors of corners are independent, and with what was assumed of the lens. `None` where the corners do not tell it.
    pub axis_deviation: Option<f64>,
    /// Standard deviation of the turn at each sighting in radians, against the mean turn of its segment (where a turn is
    /// counted from is free), or from the motion where that tells it; `None` where the turn is not known.
    pub angle_deviations: Vec<Option<f64>>,
    /// When the camera stood where.
    pub segments: Vec<Segment>,
    /// Mean speed in radians per second over each segment; `None` for stills or too few.
    pub speeds: Vec<Option<f64>>,
}

/// What became of a sighting.
#[derive(Clone, Debug, PartialEq)]
pub enum Standing {
    /// It took part in the estimate.
    Used,
    /// Its own corners tell nothing or contradict the others; the camera, if there is one, is from the motion.
    Rejected(String),
}

/// The camera of one sighting.
#[derive(Clone, Debug, PartialEq)]
pub struct FramePose {
    /// The sighting's number.
    pub frame: usize,
    /// The sighting's time.
    pub time_s: f64,
    /// World to pixels; `None` where neither the corners nor the motion tell it.
    pub camera: Option<Camera>,
    /// Standard deviation of the angle in radians, where the camera is from the motion.
    pub filled_deviation: Option<f64>,
    /// Of the corners used, in pixels; 0 without any.
    pub rms_px: f64,
    /// Indices of the target's points that were used.
    pub used: Vec<usize>,
    /// Indices of those that contradict the others.
    pub dropped: Vec<usize>,
    /// Whether it took part.
    pub standing: Standing,
}

/// A camera for a time at which the target was not seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filled {
    /// World to pixels.
    pub camera: Camera,
    /// Position of the segment in [`Turntable::segments`] during which the camera stood there.
    pub segment: usize,
    /// In radians, as [`Turntable::angles`].
    pub angle: f64,
    /// Standard deviation of the angle in radians.
    pub deviation: f64,
}

/// Tells the cameras of the sightings.
///
/// # Errors
/// [`CalibrateError`] where the target or the options are none, too few pictures can be used, or nothing turns.
pub fn calibrate(
    target: &Target,
    sightings: &[Sighting],
    options: &CalibrateOptions,
) -> Result<Calibration, CalibrateError> {
    clean::check(target, options)?;
    let mut cleaned = clean::clean(target, sightings);
    let estimate = estimate::estimate(target, &mut cleaned, options)?;
    Ok(result::result(&estimate, &cleaned, sightings))
}

#[cfg(test)]
mod tests;
