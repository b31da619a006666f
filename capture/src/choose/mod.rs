//! Which frames of a film become the capture.
//!
//! A film shows every direction many times; a capture wants each once, sharp, and all of them evenly. Frames without a
//! pose and blurred ones go first. Of the rest, a turntable's are shared among equal steps of the turn, and each step
//! keeps the best: a measured pose before one filled in, then the sharpest and nearest to the middle. A second turn so
//! only replaces frames by sharper ones. Free-hand films are thinned by farthest-point sampling (Gonzalez: *Clustering
//! to minimize the maximum intercluster distance*, Theoretical Computer Science 38, 1985) with distances weighed by
//! sharpness. Where no direction is known, frames are taken evenly in motion.

mod candidates;
mod circle;
mod sharpness;
#[cfg(test)]
mod tests;

pub use candidates::azimuth;
pub use sharpness::sharpness;

use candidates::Candidates;
use circle::Circle;
use nalgebra::Vector3;
use serde::Serialize;
use std::f64::consts::TAU;
use std::fmt;

/// Neighbours to each side with which the sharpness of a frame is compared, at least…
const LEAST_REACH: usize = 5;
/// …and as part of the film: 15° of one turn.
const FILM_PER_REACH: usize = 24;
/// Frames below this share of the sharpness of the whole film are blurred, whatever is around them.
const FAINT: f64 = 0.12;

/// What is known of one frame of a film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmFrame {
    /// Since the start of the film; of stills, their number.
    pub time_s: f64,
    /// As [`sharpness`] says; any measure will do that is the same for all frames and grows with sharpness.
    pub sharpness: f64,
    /// Blur in pixels measured otherwise, for instance at the corners of the board.
    pub blur_px: Option<f64>,
    /// From where the object is seen.
    pub viewpoint: Option<Viewpoint>,
    /// How that is known.
    pub pose: PoseSource,
    /// How far the picture moved since the frame before, in any unit.
    pub motion: f64,
}

/// From where a frame sees the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Viewpoint {
    /// Turn of the turntable in radians, not wrapped: a second turn goes on beyond 2π.
    Angle(f64),
    /// From the object towards the camera, in the world.
    Direction(Vector3<f64>),
}

/// How the pose of a frame is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PoseSource {
    /// From the board in the frame itself.
    Measured,
    /// From the motion of its neighbours.
    Filled,
    /// It has one that contradicts the others.
    Rejected,
    /// Not at all.
    Missing,
}

/// How frames are chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChooseOptions {
    /// Frames to keep at most; at least one is kept.
    pub most: usize,
    /// Least angle between neighbours, degrees: 5 makes 72 a turn.
    pub min_step_deg: f64,
    /// Larger gaps between neighbours are reported, degrees; of captures with wide steps, 2.5 times the middle step.
    pub gap_deg: f64,
    /// Frames below this share of the sharpness of those around them (their upper quartile) are blurred: sides of the
    /// object differ in detail, neighbours do not.
    pub min_sharpness: f64,
    /// Frames above this blur in pixels are blurred; of films that are blurred throughout, those above 1.5 times
    /// their lower quartile.
    pub max_blur_px: f64,
    /// Axis about which turns and gaps of free-hand films are counted.
    pub up: Vector3<f64>,
}

/// The frames kept, and what is to be said of the rest.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Choice {
    /// Positions kept, in the order of the film.
    pub kept: Vec<usize>,
    /// All others, in the order of the film.
    pub dropped: Vec<Dropped>,
    /// Turns about the axis from one end of the film to the other; `None` where no direction is known.
    pub turns: Option<f64>,
    /// Whether the frames kept go all around without a gap.
    pub is_closed: bool,
    /// Where they do not, in the order of the angle.
    pub gaps: Vec<Gap>,
    /// Middle angle between neighbours kept, degrees.
    pub step_deg: Option<f64>,
}

/// A frame that is not kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Dropped {
    /// Its position in the film.
    pub position: usize,
    /// Why.
    pub reason: DropReason,
}

/// Why a frame is not kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DropReason {
    /// Less sharp than the film can be.
    Blurred,
    /// A frame of another turn shows the same direction better.
    SameDirection,
    /// A neighbour shows nearly the same direction better.
    TooClose,
    /// Its camera is not known.
    NoPose,
    /// Its camera contradicts the others.
    RejectedPose,
}

/// Directions that no frame shows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gap {
    /// Last angle seen before the gap, degrees in [0, 360).
    pub from_deg: f64,
    /// First angle seen after it, degrees in (`from_deg`, `from_deg` + 360].
    pub to_deg: f64,
}

impl Default for ChooseOptions {
    fn default() -> Self {
        Self { most: 72, min_step_deg: 5.0, gap_deg: 15.0, min_sharpness: 0.35, max_blur_px: 1.5, up: Vector3::z() }
    }
}

impl fmt::Display for DropReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Blurred => "blurred",
            Self::SameDirection => "same direction in another turn",
            Self::TooClose => "too close to a better frame",
            Self::NoPose => "camera not found",
            Self::RejectedPose => "camera contradicts the others",
        })
    }
}

impl fmt::Display for Gap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "between {:.0}° and {:.0}°", self.from_deg, self.to_deg % 360.0)
    }
}

/// Chooses frames. Numbers that are not finite count as unknown; of a film without frames nothing is kept. Where no
/// frame has a viewpoint, poses are taken to be found later: only rejected ones are left out.
pub fn choose_frames(frames: &[FilmFrame], options: &ChooseOptions) -> Choice {
    let faults = faults(frames, options);
    let usable = (0..frames.len()).filter(|&i| faults[i].is_none()).collect();
    let candidates = Candidates::new(frames, usable, options);
    let kept = candidates.keep(options);
    let angles = candidates.angles();
    let circle = angles.map(|angles| Circle::new(kept.iter().map(|&i| angles[i])));
    let mut dropped = candidates.losers(&kept);
    dropped
        .extend(faults.iter().enumerate().filter_map(|(at, fault)| Some(Dropped { position: at, reason: (*fault)? })));
    dropped.sort_by_key(|d| d.position);
    Choice {
        kept: kept.iter().map(|&i| candidates.position(i)).collect(),
        dropped,
        turns: angles.map(turns),
        is_closed: circle.as_ref().is_some_and(|c| c.is_closed(options)),
        gaps: circle.as_ref().map(|c| c.gaps(options)).unwrap_or_default(),
        step_deg: circle.as_ref().and_then(Circle::step).map(f64::to_degrees),
    }
}

/// What rules a frame out whatever the others are.
fn faults(frames: &[FilmFrame], options: &ChooseOptions) -> Vec<Option<DropReason>> {
    let needs_viewpoint = frames.iter().any(|f| viewpoint(f).is_some());
    let without_pose = |frame: &FilmFrame| match frame.pose {
        PoseSource::Rejected => Some(DropReason::RejectedPose),
        _ if needs_viewpoint && viewpoint(frame).is_none() => Some(DropReason::NoPose),
        PoseSource::Missing if needs_viewpoint => Some(DropReason::NoPose),
        _ => None,
    };
    let posed: Vec<Option<DropReason>> = frames.iter().map(without_pose).collect();
    let sound: Vec<usize> = (0..frames.len()).filter(|&i| posed[i].is_none()).collect();
    let sharp = |of: &[usize]| quantile(of.iter().map(|&i| frames[i].sharpness), 0.75).unwrap_or(0.0);
    let least_anywhere = FAINT * sharp(&sound);
    let usual_blur = quantile(sound.iter().filter_map(|&i| frames[i].blur_px), 0.25).unwrap_or(0.0);
    let most_blur = options.max_blur_px.max(1.5 * usual_blur);
    let reach = LEAST_REACH.max(sound.len() / FILM_PER_REACH);
    let mut faults = posed;
    for (at, &i) in sound.iter().enumerate() {
        let around = &sound[at.saturating_sub(reach)..(at + reach + 1).min(sound.len())];
        let least = least_anywhere.max(options.min_sharpness * sharp(around));
        if frames[i].sharpness < least || frames[i].blur_px.is_some_and(|blur| blur > most_blur) {
            faults[i] = Some(DropReason::Blurred);
        }
    }
    faults
}

/// The viewpoint, where its numbers mean one.
fn viewpoint(frame: &FilmFrame) -> Option<Viewpoint> {
    frame.viewpoint.filter(|viewpoint| match viewpoint {
        Viewpoint::Angle(angle) => angle.is_finite(),
        Viewpoint::Direction(direction) => direction.norm().is_finite() && direction.norm() > 0.0,
    })
}

/// The value below which a share of the finite values lies; `None` where there are none.
fn quantile(values: impl Iterator<Item = f64>, share: f64) -> Option<f64> {
    let mut values: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    Some(values[(share * last as f64).round() as usize])
}

fn turns(angles: &[f64]) -> f64 {
    let [low, high] = angles.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], &a| [l.min(a), h.max(a)]);
    if low < high { (high - low) / TAU } else { 0.0 }
}
