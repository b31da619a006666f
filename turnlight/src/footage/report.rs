//! What the report says of a capture made from footage.

use super::{CapturedFootage, Shot};
use crate::Error;
use crate::footage_report::{
    AxisReport, BoardReport, Coverage, Dropping, Finding, FootageMotion, FootageReport, FrameReport, LensReport,
    Measured, Overlay, Severity, Thumbnail,
};
use capture::calibrate::{Calibration, LensParameter, LensTerm, Source};
use capture::choose::{DropReason, PoseSource};
use capture::footage::Footage;
use capture::silhouette::Evidence;
use nalgebra::Point3;
use std::collections::BTreeMap;

/// Silhouettes that agree less with the hull of the others, in the mean, make a hull that is not to be trusted.
const FAIR_AGREEMENT: f64 = 0.9;
/// Share of the sharpest frames whose sharpness is called 1.
const SHARP: f64 = 0.75;

impl CapturedFootage {
    /// The report.
    pub fn report(&self, footage: &Footage) -> FootageReport {
        let calibration = self.shots.calibration.as_ref();
        let is_film = footage.has_film();
        FootageReport {
            footage: footage.path().display().to_string(),
            motion: match calibration {
                _ if !self.shots.standpoints.is_empty() => FootageMotion::Turntable,
                Some(_) => FootageMotion::FreeHand,
                None => FootageMotion::Unknown,
            },
            duration_s: is_film.then(|| self.duration()),
            size: self.shots.size,
            frames: self.frames(is_film),
            coverage: self.coverage(),
            lens: calibration.map(|c| self.lens(c)),
            board: calibration.map(|c| BoardReport {
                text: self.shots.told_by.clone(),
                corners: c.points.len(),
                rms_px: Some(c.rms_px),
            }),
            axis: self.axis(),
            silhouettes: match self.silhouettes.evidence {
                Evidence::Plates => "told from the plates of room and table, and from each other",
                Evidence::Backdrop => "keyed by the colour of the backdrop",
                Evidence::Alpha => "the alpha channel of the photographs",
                Evidence::Given => "masks given",
            }
            .to_owned(),
            light: self.light.check,
            aabb: self.capture.aabb.map(|aabb| [aabb.min.into(), aabb.max.into()]),
            unit: self.shots.unit,
            findings: self.findings(),
            film_again: self.film_again(),
        }
    }

    /// A small picture of every frame in the capture, with its outline, the axes and the object's box.
    ///
    /// # Errors
    /// Where a picture was removed meanwhile.
    pub fn thumbnails(&self) -> Result<Vec<Thumbnail>, Error> {
        use rayon::prelude::*;
        let cameras = self.capture.frames.iter().map(|frame| &frame.camera);
        let overlay = Overlay::of_box(self.capture.aabb).cut_to_box(cameras);
        let thumbnail = |(&at, frame): (&usize, &capture::Frame)| {
            Thumbnail::new(&self.picture(at)?, &self.silhouettes.mattes[at], &frame.camera, &overlay)
        };
        let made: Vec<_> = self.kept.par_iter().zip(&self.capture.frames).map(thumbnail).collect();
        made.into_iter().collect()
    }

    fn frames(&self, is_film: bool) -> Vec<FrameReport> {
        // Position among those chosen, and in the capture.
        let chosen: BTreeMap<usize, usize> = self.selected.kept.iter().enumerate().map(|(i, &at)| (at, i)).collect();
        let dropped: BTreeMap<usize, DropReason> =
            self.selected.dropped.iter().map(|d| (d.position, d.reason)).collect();
        let sharp = self.sharp();
        let frame = |(position, shot): (usize, &Shot)| {
            let chosen = chosen.get(&position).copied();
            let kept = chosen.and_then(|at| self.kept.binary_search(&at).ok());
            let dropped = match (chosen, kept, dropped.get(&position)) {
                (_, Some(_), _) => None,
                (Some(_), None, _) => Some(Dropping::Silhouette),
                (None, None, Some(&reason)) => Some(dropping(reason, shot)),
                (None, None, None) => None,
            };
            let towards = shot.camera.map(|camera| camera.center() - self.middle());
            let is_told = shot.corners > 0;
            FrameReport {
                position,
                name: shot.source.name.clone(),
                time_s: is_film.then_some(shot.source.time_s),
                kept,
                dropped,
                pose: shot.pose,
                angle_deg: shot.angle.map(f64::to_degrees),
                angle_deviation_deg: shot.angle_deviation.map(f64::to_degrees),
                direction: towards.and_then(|d| d.try_normalize(0.0)).map(Into::into),
                rms_px: is_told.then_some(shot.rms_px),
                corners: is_told.then_some(shot.corners),
                sharpness: (sharp > 0.0).then(|| shot.sharpness / sharp),
                blur_px: shot.blur_px,
                agreement: chosen.map(|at| self.silhouettes.agreement[at]),
                exposure_gain: chosen.map(|at| self.silhouettes.gains[at].iter().sum::<f64>() / 3.0),
            }
        };
        self.shots.shots.iter().enumerate().map(frame).collect()
    }

    /// Seconds of all films together.
    fn duration(&self) -> f64 {
        let mut ends: BTreeMap<usize, f64> = BTreeMap::new();
        for shot in &self.shots.shots {
            ends.insert(shot.source.take, shot.source.time_s);
        }
        ends.values().sum()
    }

    fn sharp(&self) -> f64 {
        let mut all: Vec<f64> = self.shots.shots.iter().map(|shot| shot.sharpness).collect();
        all.sort_by(f64::total_cmp);
        all.get((SHARP * all.len() as f64) as usize).copied().unwrap_or(0.0)
    }

    /// What directions are counted from: on the axis, if there is one.
    fn middle(&self) -> Point3<f64> {
        let middle = self.capture.aabb.map_or_else(Point3::origin, |aabb| aabb.center());
        if self.shots.has_axis() { Point3::new(0.0, 0.0, middle.z) } else { middle }
    }

    /// Of the ring with the most frames.
    fn coverage(&self) -> Coverage {
        let widest = self.selected.rings.iter().max_by_key(|ring| ring.kept.len());
        widest.map(|ring| Coverage::of(ring, [0.0, 0.0, 1.0])).unwrap_or_default()
    }

    fn lens(&self, calibration: &Calibration) -> LensReport {
        let term = |parameter: LensParameter| calibration.lens.terms.iter().find(|term| term.parameter == parameter);
        let measured = |parameter: LensParameter, value: f64| {
            let deviation = term(parameter).filter(|t| t.source != Source::Held).map(|t| t.deviation);
            Measured { value, deviation }
        };
        let lens = &calibration.intrinsics;
        let d = &lens.distortion;
        let coefficients = [
            ("k1", LensParameter::K1, d.k1),
            ("k2", LensParameter::K2, d.k2),
            ("k3", LensParameter::K3, d.k3),
            ("p1", LensParameter::P1, d.p1),
            ("p2", LensParameter::P2, d.p2),
        ];
        let used = coefficients.into_iter().filter(|(_, _, value)| *value != 0.0);
        let is_given = calibration.lens.terms.iter().all(|term| term.source == Source::Held);
        let assumed = |term: &&LensTerm| term.source == Source::Assumption;
        let focal = measured(LensParameter::Focal, lens.fx);
        LensReport {
            focal_px: [focal, Measured { value: lens.fy, ..focal }],
            principal_px: [measured(LensParameter::Cx, lens.cx), measured(LensParameter::Cy, lens.cy)],
            distortion: used.map(|(name, parameter, value)| (name.to_owned(), measured(parameter, value))).collect(),
            source: if is_given { "separate shots of a board" } else { "this footage" }.to_owned(),
            assumptions: calibration.lens.terms.iter().filter(assumed).map(assumption).collect(),
        }
    }

    fn axis(&self) -> Option<AxisReport> {
        if !self.shots.has_axis() {
            return None;
        }
        let measured = self.shots.shots.iter().filter(|shot| shot.pose == PoseSource::Measured);
        let squares: Vec<f64> = measured.filter_map(|shot| shot.angle_deviation).map(|d| d * d).collect();
        let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
        Some(AxisReport {
            // The world is laid along it.
            point: [0.0; 3],
            direction: [0.0, 0.0, 1.0],
            deviation_deg: self.shots.turntable().and_then(|t| t.axis_deviation).map(f64::to_degrees),
            angle_deviation_deg: (!squares.is_empty()).then(|| mean.sqrt().to_degrees()),
        })
    }

    fn findings(&self) -> Vec<Finding> {
        let warning = |text: &String| Finding { severity: Severity::Warning, text: text.clone() };
        let mut findings: Vec<Finding> = self.shots.findings.iter().map(warning).collect();
        findings.extend(self.silhouettes.findings.iter().map(warning));
        let agreement = &self.silhouettes.agreement;
        let mean = agreement.iter().sum::<f64>() / agreement.len().max(1) as f64;
        if mean < FAIR_AGREEMENT {
            let text = format!(
                "Silhouettes agree with one another to {:.0} % only: look at the outlines below, and hang a backdrop of \
                 another colour, or give masks (--masks)",
                100.0 * mean
            );
            findings.push(Finding { severity: Severity::Warning, text });
        }
        let (shown, frames) = (self.light.directions.iter().flatten().count(), self.light.directions.len());
        if self.light_ball && shown < frames {
            let text =
                format!("The ball shows the light in {shown} of {frames} frames only: check where its outline is.");
            findings.push(Finding { severity: Severity::Warning, text });
        }
        let note = |text: &String| Finding { severity: Severity::Note, text: text.clone() };
        findings.extend(self.shots.notes.iter().map(note));
        if self.shots.unit.is_none() && self.shots.calibration.is_some() {
            let text =
                "the capture has no scale: say how large the squares of the board are (--square 30mm)".to_owned();
            findings.push(Finding { severity: Severity::Note, text });
        }
        findings
    }

    fn film_again(&self) -> Vec<String> {
        let gaps = self.coverage().gaps;
        let mut again: Vec<String> = gaps.iter().map(|gap| format!("The side {gap} is not shown.")).collect();
        let advice = self.shots.calibration.as_ref().map(|c| c.lens.advice.as_str()).unwrap_or_default();
        if !advice.is_empty() {
            again.push(advice.to_owned());
        }
        again
    }
}

fn dropping(reason: DropReason, shot: &Shot) -> Dropping {
    match (&shot.fault, reason) {
        (Some(fault), DropReason::NoPose | DropReason::RejectedPose) => Dropping::Other(fault.clone()),
        _ => Dropping::Choice(reason),
    }
}

fn assumption(term: &LensTerm) -> String {
    let name = match term.parameter {
        LensParameter::Focal => "the focal length",
        LensParameter::Aspect => "that pixels are square",
        LensParameter::Cx => "the middle of the lens, sideways",
        LensParameter::Cy => "the middle of the lens, up and down",
        _ => "a term of the lens's distortion",
    };
    format!("{name} ({:.4} ± {:.4}) rests on an assumption: the footage does not show it", term.value, term.deviation)
}
