//! Frames that may be kept, where they stand, and the three ways of thinning them.

use super::circle::Circle;
use super::{ChooseOptions, DropReason, Dropped, FilmFrame, PoseSource, Viewpoint, quantile, viewpoint};
use nalgebra::{Unit, Vector3};
use std::f64::consts::{PI, TAU};

/// Weight of a frame at the border of its step, against one in the middle.
const BORDER_WEIGHT: f64 = 0.5;
/// Weight of a filled-in pose in farthest-point sampling.
const FILLED_WEIGHT: f64 = 0.5;

/// The usable frames of a film, in its order.
pub(super) struct Candidates {
    positions: Vec<usize>,
    /// Relative to the sharp frames of the film; 1 where nothing is known.
    sharpness: Vec<f64>,
    is_measured: Vec<bool>,
    places: Places,
    /// Turn about the axis in radians, not wrapped; `None` where no direction is known.
    angles: Option<Vec<f64>>,
}

/// What is to be spread evenly.
enum Places {
    /// The turn.
    Turn,
    /// Unit directions towards the camera.
    Sphere(Vec<Vector3<f64>>),
    /// The way the picture has gone since the start.
    Motion(Vec<f64>),
}

impl Candidates {
    /// The frames at `positions`, ascending.
    pub(super) fn new(frames: &[FilmFrame], positions: Vec<usize>, options: &ChooseOptions) -> Self {
        let chosen: Vec<&FilmFrame> = positions.iter().map(|&at| &frames[at]).collect();
        let sharp = quantile(chosen.iter().map(|f| f.sharpness), 0.75).filter(|s| *s > 0.0);
        let relative = |f: &&FilmFrame| match sharp {
            Some(sharp) if f.sharpness.is_finite() => f.sharpness.max(0.0) / sharp,
            Some(_) => 0.0,
            None => 1.0,
        };
        let (places, angles) = places(&chosen, options);
        Self {
            sharpness: chosen.iter().map(relative).collect(),
            is_measured: chosen.iter().map(|f| f.pose == PoseSource::Measured).collect(),
            positions,
            places,
            angles,
        }
    }

    /// Position in the film of a candidate.
    pub(super) fn position(&self, candidate: usize) -> usize {
        self.positions[candidate]
    }

    /// Turn about the axis of each candidate, in radians; `None` where no direction is known.
    pub(super) fn angles(&self) -> Option<&[f64]> {
        self.angles.as_deref()
    }

    /// The candidates kept, ascending.
    pub(super) fn keep(&self, options: &ChooseOptions) -> Vec<usize> {
        let most = options.most.max(1);
        match (&self.places, &self.angles) {
            (Places::Turn, Some(angles)) => self.keep_around(angles, most, options),
            (Places::Sphere(directions), _) => self.keep_farthest(directions, most, options),
            (Places::Motion(way), _) => self.keep_along(way, most),
            (Places::Turn, None) => Vec::new(),
        }
    }

    /// The others, each with why another was better.
    pub(super) fn losers(&self, kept: &[usize]) -> Vec<Dropped> {
        let reason = |i: usize| match self.winner(i, kept).zip(self.angles.as_ref()) {
            Some((winner, angles)) if (angles[i] - angles[winner]).abs() > PI => DropReason::SameDirection,
            _ => DropReason::TooClose,
        };
        let lost = (0..self.positions.len()).filter(|i| kept.binary_search(i).is_err());
        lost.map(|i| Dropped { position: self.positions[i], reason: reason(i) }).collect()
    }

    /// The kept frame that shows most nearly what this one does.
    fn winner(&self, i: usize, kept: &[usize]) -> Option<usize> {
        let distance = |k: usize| match (&self.places, &self.angles) {
            (Places::Sphere(directions), _) => directions[i].angle(&directions[k]),
            (_, Some(angles)) => angle_between(angles[i], angles[k]),
            _ => i.abs_diff(k) as f64,
        };
        kept.iter().copied().min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
    }

    fn keep_around(&self, angles: &[f64], most: usize, options: &ChooseOptions) -> Vec<usize> {
        let circle = Circle::new(angles.iter().copied());
        let (first, widest) = circle.widest();
        let is_closed = circle.is_closed(options);
        let arc = if is_closed { TAU } else { TAU - widest };
        let step = options.min_step_deg.to_radians().max(arc / most as f64).max(1e-9);
        // An open arc has a step more than it has spaces between steps.
        let spaces = (arc / step + 1e-9).floor() as usize;
        let bins = if is_closed { spaces } else { spaces + 1 }.clamp(1, most);
        let width = if is_closed { arc / bins as f64 } else { (arc / (bins.max(2) - 1) as f64).max(step) };
        // Half a step before the first frame, so that stills at even steps lie in the middle of theirs.
        let places: Vec<f64> = angles.iter().map(|a| ((a - first) / width + 0.5).rem_euclid(TAU / width)).collect();
        self.best_of_bins(&places, bins)
    }

    fn keep_along(&self, way: &[f64], most: usize) -> Vec<usize> {
        if way.len() <= most {
            return (0..way.len()).collect();
        }
        let end = way.last().copied().unwrap_or(0.0);
        let places: Vec<f64> = way.iter().map(|w| w / end * most as f64).collect();
        self.best_of_bins(&places, most)
    }

    /// Of all candidates whose place has the same whole number, the best; the last bin takes what lies beyond.
    fn best_of_bins(&self, places: &[f64], bins: usize) -> Vec<usize> {
        let mut best: Vec<Option<usize>> = vec![None; bins];
        let score = |i: usize, bin: usize| {
            let off_middle = (2.0 * (places[i] - bin as f64) - 1.0).abs().min(1.0);
            self.sharpness[i] * (1.0 - (1.0 - BORDER_WEIGHT) * off_middle * off_middle)
        };
        for i in 0..places.len() {
            let bin = (places[i].max(0.0) as usize).min(bins - 1);
            let is_better = |&b: &usize| {
                let order = self.is_measured[i].cmp(&self.is_measured[b]);
                order.then(score(i, bin).total_cmp(&score(b, bin))).is_gt()
            };
            if best[bin].as_ref().is_none_or(is_better) {
                best[bin] = Some(i);
            }
        }
        let mut kept: Vec<usize> = best.into_iter().flatten().collect();
        kept.sort_unstable();
        kept
    }

    /// From the sharpest frame on, always the one farthest from all kept.
    fn keep_farthest(&self, directions: &[Vector3<f64>], most: usize, options: &ChooseOptions) -> Vec<usize> {
        let weight = |i: usize| {
            let pose = if self.is_measured[i] { 1.0 } else { FILLED_WEIGHT };
            pose * self.sharpness[i].clamp(0.0, 1.0).sqrt()
        };
        let least = options.min_step_deg.to_radians();
        let mut distance = vec![PI; directions.len()];
        let mut kept = Vec::new();
        while kept.len() < most {
            let open = (0..directions.len()).filter(|&i| distance[i] >= least && !kept.contains(&i));
            // The first of equals: `max_by` would take the last.
            let Some(next) =
                open.rev().max_by(|&a, &b| (weight(a) * distance[a]).total_cmp(&(weight(b) * distance[b])))
            else {
                break;
            };
            kept.push(next);
            (0..directions.len()).for_each(|i| distance[i] = distance[i].min(directions[i].angle(&directions[next])));
        }
        kept.sort_unstable();
        kept
    }
}

/// Turns and directions do not mix: what the first frame that knows says goes, and the others have been left out.
fn places(frames: &[&FilmFrame], options: &ChooseOptions) -> (Places, Option<Vec<f64>>) {
    let turn = |f: &&FilmFrame| match viewpoint(f) {
        Some(Viewpoint::Angle(angle)) => Some(angle),
        _ => None,
    };
    let direction = |f: &&FilmFrame| match viewpoint(f) {
        Some(Viewpoint::Direction(direction)) => Some(direction.normalize()),
        _ => None,
    };
    if let Some(angles) = all(frames, turn) {
        return (Places::Turn, Some(angles));
    }
    if let Some(directions) = all(frames, direction) {
        let angles = azimuths(&directions, options.up);
        return (Places::Sphere(directions), Some(angles));
    }
    (Places::Motion(way(frames)), None)
}

fn all<T>(frames: &[&FilmFrame], place: impl Fn(&&FilmFrame) -> Option<T>) -> Option<Vec<T>> {
    if frames.is_empty() { None } else { frames.iter().map(place).collect() }
}

/// Azimuth of each direction about `up` in radians, each within half a turn of the one before.
fn azimuths(directions: &[Vector3<f64>], up: Vector3<f64>) -> Vec<f64> {
    let mut last = 0.0;
    let unwrapped = |direction: &Vector3<f64>| {
        last += (azimuth(direction, &up) - last + PI).rem_euclid(TAU) - PI;
        last
    };
    directions.iter().map(unwrapped).collect()
}

/// Azimuth of a direction about `up` in (−π, π], right-handed, from +x (from +y where `up` is ±x); an `up` without
/// length counts as +z.
pub fn azimuth(direction: &Vector3<f64>, up: &Vector3<f64>) -> f64 {
    let up = Unit::try_new(*up, 1e-12).unwrap_or(Vector3::z_axis());
    let aside = if up.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let x = (aside - up.into_inner() * up.dot(&aside)).normalize();
    direction.dot(&up.cross(&x)).atan2(direction.dot(&x))
}

/// The way from the first frame to each; the number of frames where nothing moves.
fn way(frames: &[&FilmFrame]) -> Vec<f64> {
    let mut sum = 0.0;
    let way: Vec<f64> = frames
        .iter()
        .map(|f| {
            sum += if f.motion.is_finite() { f.motion.max(0.0) } else { 0.0 };
            sum
        })
        .collect();
    let first = way.first().copied().unwrap_or(0.0);
    if sum > first { way.iter().map(|w| w - first).collect() } else { (0..frames.len()).map(|i| i as f64).collect() }
}

/// The smaller angle between two directions of a turn.
fn angle_between(a: f64, b: f64) -> f64 {
    ((a - b + PI).rem_euclid(TAU) - PI).abs()
}
