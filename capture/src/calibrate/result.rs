//! What an estimate means: cameras in the world's axes, and those of pictures that it could not use.

use super::clean::Cleaned;
use super::deviation::{Deviations, deviations};
use super::estimate::Estimate;
use super::fill::Track;
use super::findings::{findings, lens_report, notes};
use super::homography::median;
use super::rig::{Picture, Poses, Rig, Turning, turned};
use super::turntable::unwrap;
use super::{Calibration, Filled, FramePose, Motion, Segment, Sighting, Standing, Turntable};
use crate::{Camera, Intrinsics};
use nalgebra::{Isometry3, Point3, Vector3};
use std::f64::consts::TAU;

/// Everything a user is told.
pub(super) fn result(estimate: &Estimate, cleaned: &Cleaned, sightings: &[Sighting]) -> Calibration {
    let Estimate { rig, pictures, .. } = estimate;
    let points: Vec<(usize, Point3<f64>)> =
        cleaned.indices.iter().enumerate().map(|(at, &index)| (index, rig.shape.point(at))).collect();
    let (motion, world_from_target) = match &rig.poses {
        Poses::Free(_) => (Motion::FreeHand, about_middle(&points)),
        Poses::Turning(turning) => {
            (Motion::Turntable(turntable(turning, pictures, deviations(estimate, turning))), turning.world_from_target)
        }
    };
    let target_from_world = world_from_target.inverse();
    let frame = |(k, sighting): (usize, &Sighting)| {
        let picture = &pictures[k];
        let camera = picture.is_used.then(|| camera(&rig.lens, &(rig.pose(k) * target_from_world)));
        let of = |is_used: bool| {
            let wanted = picture.corners.iter().filter(|c| picture.is_used && c.is_used == is_used);
            let mut indices: Vec<usize> = wanted.map(|c| cleaned.indices[c.point]).collect();
            indices.sort_unstable();
            indices
        };
        FramePose {
            frame: sighting.frame,
            time_s: sighting.time_s,
            camera,
            filled_deviation: None,
            rms_px: rms(rig, picture, k),
            used: of(true),
            dropped: of(false),
            standing: if picture.is_used { Standing::Used } else { Standing::Rejected(reason(rig, picture, k)) },
        }
    };
    let frames: Vec<FramePose> = sightings.iter().enumerate().map(frame).collect();
    let mut calibration = Calibration {
        intrinsics: rig.lens,
        lens: lens_report(estimate),
        motion,
        frames,
        rms_px: estimate.fit.rms_px(),
        points,
        world_from_target,
        findings: Vec::new(),
        notes: cleaned.notes.clone(),
    };
    calibration.fill(sightings);
    calibration.findings = findings(estimate, &calibration);
    calibration.notes.extend(notes(estimate, &calibration, sightings));
    calibration
}

/// The target's own axes about the middle of its points.
fn about_middle(points: &[(usize, Point3<f64>)]) -> Isometry3<f64> {
    let sum: Vector3<f64> = points.iter().map(|(_, p)| p.coords).sum();
    let to_middle = -sum / points.len().max(1) as f64;
    Isometry3::translation(to_middle.x, to_middle.y, to_middle.z)
}

fn camera(lens: &Intrinsics, pose: &Isometry3<f64>) -> Camera {
    Camera {
        intrinsics: *lens,
        rotation: pose.rotation.to_rotation_matrix().into_inner(),
        translation: pose.translation.vector,
    }
}

/// Of the corners used, in pixels.
fn rms(rig: &Rig, picture: &Picture, k: usize) -> f64 {
    let used: Vec<_> = picture.corners.iter().filter(|c| c.is_used && picture.is_used).copied().collect();
    let squares = rig.residuals(k, &used).into_iter().flatten().map(|r| r.norm_squared()).sum::<f64>();
    (squares / used.len().max(1) as f64).sqrt().abs()
}

/// Why a picture was not used.
fn reason(rig: &Rig, picture: &Picture, k: usize) -> String {
    if picture.corners.is_empty() {
        return "shows nothing of the target".to_owned();
    }
    let seen = picture.corners.len();
    if seen < 4 {
        return format!("shows {seen} of the target's corners, which tell no pose");
    }
    let distances = rig.residuals(k, &picture.corners).into_iter().map(|r| r.map_or(f64::MAX.sqrt(), |r| r.norm()));
    let middle = median(&distances.collect::<Vec<_>>());
    if middle < 1e4 {
        format!("its {seen} corners contradict the other pictures by {middle:.1} px")
    } else {
        format!("its {seen} corners fit no pose of the target seen from the front")
    }
}

fn turntable(turning: &Turning, pictures: &[Picture], deviations: Option<Deviations>) -> Turntable {
    let mut angles = vec![None; pictures.len()];
    let mut segments = Vec::new();
    let mut speeds = Vec::new();
    let mut end: Option<(f64, f64, f64)> = None;
    for (s, pose) in turning.segments.iter().enumerate() {
        let members = || (0..pictures.len()).filter(|&k| turning.segment_of[k] == s);
        let (Some(first), Some(last)) = (members().next(), members().next_back()) else { continue };
        end = end.filter(|_| segments.last().is_some_and(|s: &Segment| s.film == pictures[first].film));
        let used = members().filter(|&k| pictures[k].is_used);
        let mut known: Vec<(usize, f64, f64)> = used.map(|k| (k, pictures[k].time_s, turning.angles[k])).collect();
        known.sort_by(|a, b| a.1.total_cmp(&b.1));
        unwrap(&mut known);
        // A moved camera does not stop the platter.
        if let (Some(&(time, angle, rate)), Some(&next)) = (end.as_ref(), known.first()) {
            let turns = ((angle + rate * (next.1 - time) - next.2) / TAU).round();
            known.iter_mut().for_each(|k| k.2 += TAU * turns);
        }
        known.iter().for_each(|&(k, _, angle)| angles[k] = Some(angle));
        let speed = Track::new(known.iter().map(|&(_, t, a)| (t, a)).collect()).speed();
        end = known.last().map(|&(_, time, angle)| (time, angle, speed.unwrap_or(0.0)));
        speeds.push(speed);
        segments.push(Segment { first, last, film: pictures[first].film, pose: *pose });
    }
    let target_from_world = turning.world_from_target.inverse();
    Turntable {
        axis_point: target_from_world * Point3::origin(),
        axis_direction: target_from_world.rotation * Vector3::z(),
        axis_deviation: deviations.as_ref().map(|d| d.axis),
        angle_deviations: deviations.map_or_else(|| vec![None; angles.len()], |d| d.angles),
        angles,
        segments,
        speeds,
    }
}

impl Turntable {
    /// Times and angles of the sightings of a segment that were used, by time.
    fn track(&self, segment: &Segment, frames: &[FramePose]) -> Track {
        let known = |k: usize| {
            let frame = frames.get(k).filter(|f| f.standing == Standing::Used)?;
            Some((frame.time_s, self.angles[k]?))
        };
        let mut knots: Vec<(f64, f64)> = (segment.first..=segment.last).filter_map(known).collect();
        knots.sort_by(|a, b| a.0.total_cmp(&b.0));
        Track::new(knots)
    }
}

impl Calibration {
    /// The camera of a film at a time without sighting, from the motion of the platter between the sightings around.
    /// `None` without a turntable, where the camera was moved between those sightings, and where the angle would be
    /// uncertain by more than a degree.
    pub fn camera_at(&self, film: usize, time_s: f64) -> Option<Filled> {
        let Motion::Turntable(turntable) = &self.motion else { return None };
        let of_film = || turntable.segments.iter().enumerate().filter(|(_, s)| s.film == film);
        let time = |k: usize| self.frames.get(k).map(|f| f.time_s);
        let holds = |(_, s): &(usize, &Segment)| {
            time(s.first).is_some_and(|t| t <= time_s) && time(s.last).is_some_and(|t| time_s <= t)
        };
        // Before the first and after the last sighting the camera is taken to have stood where it was.
        let before_all = of_film().next().filter(|(_, s)| time(s.first).is_some_and(|t| time_s < t));
        let after_all = of_film().next_back().filter(|(_, s)| time(s.last).is_some_and(|t| time_s > t));
        let (at, segment) = of_film().find(holds).or(before_all).or(after_all)?;
        let (angle, deviation) = turntable.track(segment, &self.frames).at(time_s)?;
        let camera = camera(&self.intrinsics, &turned(&segment.pose, angle));
        Some(Filled { camera, segment: at, angle, deviation })
    }

    /// Cameras of the sightings that were not used, where the motion tells them.
    fn fill(&mut self, sightings: &[Sighting]) {
        for (k, sighting) in sightings.iter().enumerate() {
            if self.frames[k].standing == Standing::Used {
                continue;
            }
            let Some(filled) = self.camera_at(sighting.film, sighting.time_s) else { continue };
            self.frames[k].camera = Some(filled.camera);
            self.frames[k].filled_deviation = Some(filled.deviation);
            if let Motion::Turntable(turntable) = &mut self.motion {
                turntable.angles[k] = Some(filled.angle);
                turntable.angle_deviations[k] = Some(filled.deviation);
            }
        }
    }
}
