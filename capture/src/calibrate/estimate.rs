//! From cleaned pictures to a rig that fits: the lens roughly, poses freely, then, if it turns, about one axis.

use super::bundle::{Fit, settle};
use super::clean::{Cleaned, upside_down};
use super::equations::Freedom;
use super::homography::{constraint_ratio, fit_robust, median};
use super::lens::LensPrior;
use super::pose::{Candidate, candidates, choose, plane_near, plane_of};
use super::rig::{Corner, Curled, Picture, Poses, Rig, Shape, Turning};
use super::turntable::{
    axis, best_angle, canonical, initial, joined, largest_turn, likeliest_move, starts, world_from_target,
};
use super::{CalibrateError, CalibrateOptions, LensKnowledge, LensParameter, MotionKind, Source, Target, layout, lens};
use crate::Intrinsics;
use nalgebra::{Isometry3, Point2, Point3};

/// What every lens has.
const USUAL: [LensParameter; 5] =
    [LensParameter::Focal, LensParameter::Cx, LensParameter::Cy, LensParameter::K1, LensParameter::K2];
/// What carries shape from pictures into the world.
const PINHOLE: [LensParameter; 3] = [LensParameter::Focal, LensParameter::Cx, LensParameter::Cy];
/// What some have besides.
const UNUSUAL: [LensParameter; 4] = [LensParameter::Aspect, LensParameter::K3, LensParameter::P1, LensParameter::P2];
/// An unusual number is kept if it is so many deviations from usual.
const SIGNIFICANT: f64 = 5.0;
/// Part of the squared misfit that unusual numbers must explain together.
const WORTHWHILE: f64 = 0.02;
/// Focal lengths tried first, in longer sides of the picture.
const FOCALS: [f64; 10] = [0.45, 0.6, 0.75, 0.92, 1.1, 1.35, 1.7, 2.2, 2.9, 4.0];
/// Pictures they are tried on.
const TRIED: usize = 16;
/// A turntable may leave so many times the misfit of free poses, or ...
const WORSE: f64 = 3.0;
/// ... so much more, in pixels: platters wobble.
const WORSE_PX: f64 = 0.5;
/// ... and must explain this part of the pictures that free poses do.
const EXPLAINED: f64 = 0.6;
/// Least turn that shows an axis, in radians.
const LEAST_TURN: f64 = 0.05;
/// Markers leave their plane, and boards bend, if the noise falls to this part by it.
const RELIEF: f64 = 0.8;
/// Moves of the camera looked for.
const MOST_MOVES: usize = 8;

const UNFIT: CalibrateError = CalibrateError::Failed { fault: "no pose fits them" };

/// A rig that fits.
pub(super) struct Estimate {
    pub(super) rig: Rig,
    pub(super) pictures: Vec<Picture>,
    pub(super) fit: Fit,
    pub(super) free: Vec<LensParameter>,
    pub(super) prior: LensPrior,
    pub(super) plane: Option<Isometry3<f64>>,
    pub(super) constraint_ratio: Option<f64>,
    /// RMS with a pose for each picture, in pixels.
    pub(super) free_rms_px: f64,
    /// Markers that no chain of pictures leads to.
    pub(super) unreached: Vec<usize>,
}

/// Fits everything.
pub(super) fn estimate(
    target: &Target,
    cleaned: &mut Cleaned,
    options: &CalibrateOptions,
) -> Result<Estimate, CalibrateError> {
    let prior = LensPrior::new(options.size, &options.lens);
    let (shape, unreached) = shape_of(target, cleaned)?;
    let points = shape.points();
    let plane = if matches!(shape, Shape::Squares { .. }) { Some(Isometry3::identity()) } else { plane_of(&points) };
    let opposite = if options.upside_down { Some(opposite(&points)?) } else { None };
    let pictures = std::mem::take(&mut cleaned.pictures);
    let flat = Flat { points: &points, plane: plane.as_ref(), opposite: opposite.as_deref() };
    let lens = first_lens(&flat, &pictures, options, &prior);
    let (mut pictures, poses) = free_poses(&flat, &lens, pictures);
    let usable = pictures.iter().filter(|p| p.is_used).count();
    let is_lens_known = matches!(options.lens, LensKnowledge::Known(_));
    let needed = if is_lens_known && options.motion == Some(MotionKind::FreeHand) { 1 } else { 2 };
    if usable < needed {
        return Err(CalibrateError::TooFew { usable, sightings: pictures.len(), needed });
    }
    let constraint_ratio = plane.as_ref().map(|plane| tilts(&flat, plane, &lens, &pictures));
    let free = if is_lens_known { Vec::new() } else { USUAL.to_vec() };
    let mut rig = Rig { lens, shape, poses: Poses::Free(poses) };
    let fit = settle(&mut rig, &mut pictures, Freedom { lens: &free, prior: &prior }).ok_or(UNFIT)?;
    let free_rms_px = fit.rms_px();
    let first = Estimate { rig, pictures, fit, free, prior, plane, constraint_ratio, free_rms_px, unreached };
    let mut best = match options.motion {
        Some(MotionKind::FreeHand) => first,
        wanted => first.turning(wanted == Some(MotionKind::Turntable))?,
    };
    best.refine_lens();
    best.find_relief();
    if let Poses::Turning(turning) = &best.rig.poses {
        let points = best.rig.shape.points();
        best.rig.poses = Poses::Turning(canonical(turning, &best.pictures, best.plane.as_ref(), &points));
    }
    Ok(best)
}

/// The target as the estimate sees it. Corners of markers that no chain of pictures leads to are taken out.
fn shape_of(target: &Target, cleaned: &mut Cleaned) -> Result<(Shape, Vec<usize>), CalibrateError> {
    let side = match target {
        Target::Points(points) => return Ok((Shape::Points(points.clone()), Vec::new())),
        Target::Markers { side } => *side,
    };
    let (found, first) = layout::learn(&cleaned.pictures, cleaned.indices.len() / 4, side);
    if found.iter().all(Option::is_none) {
        return Err(CalibrateError::TooFew { usable: 0, sightings: cleaned.pictures.len(), needed: 2 });
    }
    let reached: Vec<usize> = (0..found.len()).filter(|&m| found[m].is_some()).collect();
    let unreached = (0..found.len()).filter(|&m| found[m].is_none()).map(|m| cleaned.indices[4 * m] / 4).collect();
    for picture in &mut cleaned.pictures {
        picture.corners.retain_mut(|corner| {
            let place = reached.binary_search(&(corner.point / 4));
            corner.point = 4 * place.unwrap_or(0) + corner.point % 4;
            place.is_ok()
        });
        picture.is_used = !picture.corners.is_empty();
    }
    cleaned.indices = reached.iter().flat_map(|m| cleaned.indices[4 * m..4 * m + 4].to_vec()).collect();
    let fixed = reached.binary_search(&first).unwrap_or(0);
    Ok((Shape::Squares { side, places: found.into_iter().flatten().collect(), fixed, is_flat: true }, unreached))
}

fn opposite(points: &[Point3<f64>]) -> Result<Vec<usize>, CalibrateError> {
    upside_down(points).ok_or(CalibrateError::Option {
        option: "upside_down",
        value: "set".to_owned(),
        remedy: "leave it unset for a target that does not look the same upside down",
    })
}

/// The target while poses are first looked for.
struct Flat<'a> {
    points: &'a [Point3<f64>],
    plane: Option<&'a Isometry3<f64>>,
    opposite: Option<&'a [usize]>,
}

impl Flat<'_> {
    fn candidates(&self, lens: &Intrinsics, picture: &Picture, seed: usize) -> Vec<Candidate> {
        let mut found = candidates(lens, self.points, self.plane, &picture.corners, seed as u64);
        if let Some(opposite) = self.opposite {
            let turned: Vec<_> = picture.corners.iter().map(|c| Corner { point: opposite[c.point], ..*c }).collect();
            let more = candidates(lens, self.points, self.plane, &turned, seed as u64);
            found.extend(more.into_iter().map(|c| Candidate { is_turned: true, ..c }));
            found.sort_by(|a, b| a.rms_px.total_cmp(&b.rms_px));
        }
        found
    }
}

/// The lens as it is known, or the usual one with the focal length that fits best.
fn first_lens(flat: &Flat, pictures: &[Picture], options: &CalibrateOptions, prior: &LensPrior) -> Intrinsics {
    if let LensKnowledge::Known(lens) = options.lens {
        return lens;
    }
    let usual = prior.lens(options.size);
    let seen: Vec<usize> = (0..pictures.len()).filter(|&k| pictures[k].is_used).collect();
    let step = seen.len().div_ceil(TRIED).max(1);
    let side = options.size[0].max(options.size[1]) as f64;
    let tried = |focal: f64| {
        let lens = Intrinsics { fx: focal, fy: focal, ..usual };
        let squares = seen.iter().step_by(step).filter_map(|&k| {
            let best = flat.candidates(&lens, &pictures[k], k).into_iter().next()?;
            Some(best.rms_px.powi(2))
        });
        // The middle one, so that a few misread pictures do not choose.
        let squares: Vec<f64> = squares.collect();
        (lens, median(&squares) * squares.len() as f64 + prior.cost(&lens, &[LensParameter::Focal]))
    };
    let focals = FOCALS.iter().map(|f| f * side).chain([usual.fx]);
    focals.map(tried).min_by(|a, b| a.1.total_cmp(&b.1)).map_or(usual, |(lens, _)| lens)
}

/// A pose for each picture, by its corners and its neighbours; pictures that have none are not used.
fn free_poses(flat: &Flat, lens: &Intrinsics, mut pictures: Vec<Picture>) -> (Vec<Picture>, Vec<Isometry3<f64>>) {
    let all: Vec<Vec<Candidate>> =
        pictures.iter().enumerate().map(|(k, picture)| flat.candidates(lens, picture, k)).collect();
    let mut poses = Vec::new();
    for ((picture, list), chosen) in pictures.iter_mut().zip(&all).zip(choose(&all)) {
        let Some(candidate) = chosen.map(|n| &list[n]) else {
            picture.is_used = false;
            poses.push(Isometry3::identity());
            continue;
        };
        if let Some(opposite) = flat.opposite.filter(|_| candidate.is_turned) {
            picture.corners.iter_mut().for_each(|c| c.point = opposite[c.point]);
        }
        poses.push(candidate.pose);
    }
    (pictures, poses)
}

/// [`constraint_ratio`] of the pictures, their lens taken out as far as it is known.
fn tilts(flat: &Flat, plane: &Isometry3<f64>, lens: &Intrinsics, pictures: &[Picture]) -> f64 {
    let map = |(k, picture): (usize, &Picture)| {
        let pair = |c: &Corner| {
            let from = plane.inverse_transform_point(&flat.points[c.point]).xy();
            Some((from, lens.undistort_pixel(c.pixel)?))
        };
        let pairs: Vec<(Point2<f64>, Point2<f64>)> = picture.corners.iter().filter_map(pair).collect();
        Some(fit_robust(&pairs, k as u64)?.0)
    };
    let maps: Vec<_> = pictures.iter().enumerate().filter(|(_, p)| p.is_used).filter_map(map).collect();
    constraint_ratio(&maps, [lens.width, lens.height])
}

impl Estimate {
    fn settle(&mut self) -> Result<(), CalibrateError> {
        let freedom = Freedom { lens: &self.free, prior: &self.prior };
        self.fit = settle(&mut self.rig, &mut self.pictures, freedom).ok_or(UNFIT)?;
        Ok(())
    }

    fn used(&self) -> usize {
        self.pictures.iter().filter(|p| p.is_used).count()
    }

    /// The same pictures about one axis, or as they are if nothing says so.
    fn turning(self, is_wanted: bool) -> Result<Self, CalibrateError> {
        let Poses::Free(poses) = &self.rig.poses else { return Ok(self) };
        let turn = largest_turn(poses, &self.pictures);
        if turn < LEAST_TURN {
            if !is_wanted && self.has_moved(poses) {
                return Ok(self);
            }
            return Err(CalibrateError::AxisUnobservable { turn_deg: turn.to_degrees() });
        }
        let points = self.rig.shape.points();
        let Some(axis) = axis(poses, &self.pictures) else {
            return Err(CalibrateError::AxisUnobservable { turn_deg: turn.to_degrees() });
        };
        let world = world_from_target(&axis, self.plane.as_ref(), &points);
        let reach = points.iter().map(|p| (p - axis.point).norm()).fold(0.0, f64::max);
        let about_axis = |starts: &[usize]| {
            let turning = initial(&axis, world, poses, &self.pictures, reach, starts);
            let mut next = self.copy();
            next.rig.poses = Poses::Turning(turning);
            next.settle().map(|()| next)
        };
        let starts = starts(&axis, poses, &self.pictures, self.rig.lens.fx, reach);
        let mut tried = about_axis(&starts)?;
        tried.rescue();
        tried.find_moves(starts, about_axis);
        tried.join_moves();
        let is_good = tried.fit.rms_px() <= (WORSE * self.fit.rms_px()).max(self.fit.rms_px() + WORSE_PX)
            && tried.used() as f64 >= EXPLAINED * self.used() as f64;
        if !is_good && is_wanted {
            let (rms_px, free_px) = (tried.fit.rms_px(), self.fit.rms_px());
            return Err(CalibrateError::NotATurntable { rms_px, free_px });
        }
        Ok(if is_good { tried } else { self })
    }

    /// Whether a camera that never turned went anywhere: by a fiftieth of its distance.
    fn has_moved(&self, poses: &[Isometry3<f64>]) -> bool {
        let used = || poses.iter().zip(&self.pictures).filter(|(_, p)| p.is_used).map(|(pose, _)| pose);
        let Some(first) = used().next() else { return false };
        let distance = first.translation.vector.norm();
        used().any(|pose| (pose.translation.vector - first.translation.vector).norm() > 0.02 * distance)
    }

    /// Looks for places where the camera was moved, as long as that helps. Each time all is begun anew from the free
    /// poses, since one camera where there were two bends the lens.
    fn find_moves(&mut self, mut starts: Vec<usize>, about_axis: impl Fn(&[usize]) -> Result<Self, CalibrateError>) {
        for _ in 0..MOST_MOVES {
            let Some(at) = likeliest_move(&self.rig, &self.pictures, self.fit.noise) else { return };
            starts.push(at);
            let Ok(mut next) = about_axis(&starts) else { return };
            next.rescue();
            let is_better = next.used() > self.used() || next.fit.rms_px() < 0.95 * self.fit.rms_px();
            if !is_better {
                return;
            }
            *self = next;
        }
    }

    /// Takes back moves of the camera that do not show.
    fn join_moves(&mut self) {
        for _ in 0..MOST_MOVES {
            let Poses::Turning(turning) = &self.rig.poses else { return };
            let Some(joined) = joined(&self.rig, turning, &self.pictures, self.fit.noise) else { return };
            let mut next = self.copy();
            next.rig.poses = Poses::Turning(joined);
            if next.settle().is_err() || next.used() < self.used() {
                return;
            }
            *self = next;
        }
    }

    /// Gives pictures that were left out another chance at the angle that fits best.
    fn rescue(&mut self) {
        let Poses::Turning(turning) = &self.rig.poses else { return };
        let mut next: Turning = turning.clone();
        let mut has_changed = false;
        for (k, picture) in self.pictures.iter().enumerate().filter(|(_, p)| !p.is_used) {
            let found = best_angle(&self.rig, turning, picture, turning.segment_of[k]);
            let Some((angle, _)) = found.filter(|(_, distance)| *distance < 3.0 * self.fit.noise) else { continue };
            next.angles[k] = angle;
            has_changed = true;
        }
        if !has_changed {
            return;
        }
        let before = (self.rig.clone(), self.pictures.clone(), self.fit.clone());
        self.rig.poses = Poses::Turning(next);
        if self.settle().is_err() || self.used() < before.1.iter().filter(|p| p.is_used).count() {
            (self.rig, self.pictures, self.fit) = before;
        }
    }

    /// Adds the unusual numbers of a lens that the corners ask for.
    fn refine_lens(&mut self) {
        if self.free.is_empty() || !self.tells(&PINHOLE) {
            return;
        }
        let before = (self.rig.clone(), self.pictures.clone(), self.fit.clone(), self.free.clone());
        self.free.extend(UNUSUAL);
        let is_kept = self.settle().is_ok() && {
            let terms = lens::terms(&self.rig.lens, &self.free, &self.fit.information, &self.prior);
            let usual = |p: LensParameter| if p == LensParameter::Aspect { 1.0 } else { 0.0 };
            let is_significant = |p: &LensParameter| {
                let term = &terms[*p as usize];
                (term.value - usual(*p)).abs() > SIGNIFICANT * term.deviation && term.source == Source::Footage
            };
            let kept: Vec<LensParameter> = UNUSUAL.into_iter().filter(is_significant).collect();
            (self.rig, self.pictures) = (before.0.clone(), before.1.clone());
            self.free = USUAL.into_iter().chain(kept.iter().copied()).collect();
            let is_worthwhile = |fit: &Fit, old: &Fit| {
                fit.cost / fit.corners as f64 <= (1.0 - WORTHWHILE) * old.cost / old.corners as f64
            };
            !kept.is_empty() && self.settle().is_ok() && is_worthwhile(&self.fit, &before.2) && self.tells(&PINHOLE)
        };
        if !is_kept {
            (self.rig, self.pictures, self.fit, self.free) = before;
        }
    }

    /// Lets learnt markers rise and tilt out of their plane, and a flat board bend, if that explains much of the misfit:
    /// paper curls.
    fn find_relief(&mut self) {
        let mut next = self.copy();
        match (&mut next.rig.shape, &self.plane) {
            (Shape::Squares { is_flat, .. }, _) => *is_flat = false,
            (shape, Some(plane)) => *shape = Shape::Curled(Curled::new(&shape.points(), *plane)),
            (_, None) => return,
        }
        let is_better = next.settle().is_ok()
            && next.used() >= self.used()
            && next.fit.noise < RELIEF * self.fit.noise
            && next.fit.corners as f64 > 0.95 * self.fit.corners as f64;
        if is_better {
            next.plane = plane_near(&next.rig.shape.points());
            *self = next;
        }
    }

    fn copy(&self) -> Self {
        Self {
            rig: self.rig.clone(),
            pictures: self.pictures.clone(),
            fit: self.fit.clone(),
            free: self.free.clone(),
            prior: self.prior.clone(),
            unreached: self.unreached.clone(),
            ..*self
        }
    }

    /// Whether the corners tell these numbers without assumptions.
    fn tells(&self, parameters: &[LensParameter]) -> bool {
        let terms = lens::terms(&self.rig.lens, &self.free, &self.fit.information, &self.prior);
        parameters.iter().all(|p| terms[*p as usize].source == Source::Footage)
    }
}
