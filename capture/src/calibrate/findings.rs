//! How good it is, in sentences: gates that a calibration must pass, and what to film when it does not.

use super::clean::list;
use super::estimate::Estimate;
use super::homography::median;
use super::rig::Shape;
use super::{Calibration, LensParameter, LensReport, LensTerm, Motion, Sighting, Source, Standing, lens};
use nalgebra::Point2;

/// RMS in pixels from which cameras are not to be trusted, and from which something is not as it should be.
const BAD_PX: f64 = 1.0;
const DOUBTFUL_PX: f64 = 0.6;
/// Part of the picture's width and height that corners must reach over.
const COVER: f64 = 0.6;
/// Deviations that matter: of the focal length in parts of it, of the principal point in parts of the longer side.
const FOCAL_DEVIATION: f64 = 0.005;
const CENTRE_DEVIATION: f64 = 0.005;
/// Below this singular value of Zhang's constraints all views show a flat target at one tilt, but for noise.
const ONE_TILT: f64 = 1e-3;
/// More than this times the misfit of free poses, and the platter wobbles or the camera shakes.
const WOBBLE: f64 = 1.5;

const ADVICE: &str = "film a second round from another height without touching the zoom and give both films, or wave the \
                      board before the camera at many tilts and give that film for the lens (--calibration)";

/// What is known of the lens, and what to do about what is not.
pub(super) fn lens_report(estimate: &Estimate) -> LensReport {
    let terms = lens::terms(&estimate.rig.lens, &estimate.free, &estimate.fit.information, &estimate.prior);
    let size = estimate.rig.lens.width.max(estimate.rig.lens.height) as f64;
    let is_loose = |t: &LensTerm| match t.parameter {
        LensParameter::Focal => t.deviation > FOCAL_DEVIATION * t.value,
        LensParameter::Cx | LensParameter::Cy => t.deviation > CENTRE_DEVIATION * size,
        _ => false,
    };
    let is_pinhole = |t: &&LensTerm| {
        matches!(t.parameter, LensParameter::Focal | LensParameter::Cx | LensParameter::Cy) && t.source != Source::Held
    };
    let is_loose = terms.iter().filter(is_pinhole).any(is_loose);
    let has_one_tilt = estimate.constraint_ratio.is_some_and(|ratio| ratio < ONE_TILT);
    let is_assumed = terms.iter().filter(is_pinhole).any(|t| t.source == Source::Assumption);
    let is_degenerate = is_assumed || (is_loose && has_one_tilt);
    LensReport {
        terms,
        constraint_ratio: estimate.constraint_ratio,
        is_degenerate,
        advice: if is_degenerate || is_loose { ADVICE.to_owned() } else { String::new() },
    }
}

/// What a user should know, the gravest first.
pub(super) fn findings(estimate: &Estimate, result: &Calibration) -> Vec<String> {
    let mut found = Vec::new();
    found.extend(misfit(result.rms_px));
    found.extend(lens_findings(result));
    found.extend(motion_findings(estimate, result));
    found.extend(picture_findings(result));
    if !estimate.unreached.is_empty() {
        let markers = list(&estimate.unreached);
        found.push(format!("Markers {markers} are never seen together with the others; they are left out."));
    }
    found
}

/// What is good to know, and nothing to mend.
pub(super) fn notes(estimate: &Estimate, result: &Calibration, sightings: &[Sighting]) -> Vec<String> {
    let is_carried = matches!(result.motion, Motion::FreeHand);
    let carried = is_carried.then(|| "The camera was carried: every picture has a pose of its own.".to_owned());
    let mut notes = Vec::from_iter(carried);
    notes.extend(left_out(result));
    notes.extend(cover(result, sightings));
    notes.extend(relief(estimate));
    notes
}

fn misfit(rms: f64) -> Option<String> {
    let causes = "check the size of the print, that it is flat, and that the zoom was not touched";
    if rms > BAD_PX {
        return Some(format!(
            "Corners are {rms:.2} px RMS from where the cameras put them, too far to trust; {causes}."
        ));
    }
    (rms > DOUBTFUL_PX).then(|| format!("Corners are {rms:.2} px RMS from where the cameras put them; {causes}."))
}

fn lens_findings(result: &Calibration) -> Vec<String> {
    let mut found = Vec::new();
    let LensReport { terms, advice, is_degenerate, .. } = &result.lens;
    if !advice.is_empty() {
        let unit = |t: &LensTerm| match t.parameter {
            LensParameter::Focal => Some(format!("focal length {:.1} ± {:.1} px", t.value, t.deviation)),
            LensParameter::Cx => Some(format!("centre column {:.1} ± {:.1} px", t.value, t.deviation)),
            LensParameter::Cy => Some(format!("centre row {:.1} ± {:.1} px", t.value, t.deviation)),
            _ => None,
        };
        let what: Vec<String> = terms.iter().filter_map(unit).collect();
        let why = if *is_degenerate {
            "The target was seen at one tilt or nearly, which hardly tells focal length and centre apart: they rest on what \
             is usual for cameras, and on how the lens bends lines"
        } else {
            "The pictures tell the lens only roughly"
        };
        found.push(format!("{why} ({}); {advice}.", what.join(", ")));
    }
    found
}

fn motion_findings(estimate: &Estimate, result: &Calibration) -> Vec<String> {
    let Motion::Turntable(turntable) = &result.motion else {
        return Vec::new();
    };
    let mut found = Vec::new();
    let (rms, free) = (result.rms_px, estimate.free_rms_px);
    if rms > WOBBLE * free && rms > free + 0.1 {
        found.push(format!(
            "About one axis {rms:.2} px are left, with a pose for each picture {free:.2} px: the platter wobbles or the \
             camera shakes."
        ));
    }
    for pair in turntable.segments.windows(2).filter(|pair| pair[0].film == pair[1].film) {
        let (last, first) = (&result.frames[pair[0].last], &result.frames[pair[1].first]);
        found.push(format!(
            "The camera was moved between picture {} and picture {} ({:.2} s); both parts are kept.",
            last.frame, first.frame, first.time_s
        ));
    }
    found
}

fn picture_findings(result: &Calibration) -> Vec<String> {
    let mut found = Vec::new();
    let is_rejected = |standing: &Standing| matches!(standing, Standing::Rejected(_));
    let rejected = result.frames.iter().filter(|f| is_rejected(&f.standing)).count();
    if 2 * rejected > result.frames.len() {
        found.insert(0, format!("{rejected} of {} pictures could not be used.", result.frames.len()));
    }
    let rms: Vec<f64> = result.frames.iter().filter(|f| !is_rejected(&f.standing)).map(|f| f.rms_px).collect();
    let most = 2.0 * median(&rms);
    let worse: Vec<usize> =
        result.frames.iter().filter(|f| f.rms_px > most && f.rms_px > 0.3).map(|f| f.frame).collect();
    if !worse.is_empty() {
        found.push(format!("Pictures {} fit more than twice as badly as most.", list(&worse)));
    }
    found
}

/// Pictures and corners that took no part.
fn left_out(result: &Calibration) -> Vec<String> {
    let mut found = Vec::new();
    for frame in &result.frames {
        if let Standing::Rejected(why) = &frame.standing {
            let then = match frame.filled_deviation {
                Some(d) => format!("its camera is from the motion, to {:.2}°", d.to_degrees()),
                None => "it has no camera".to_owned(),
            };
            found.push(format!("Picture {} {why}; {then}.", frame.frame));
        }
    }
    let doubtful = result.frames.iter().filter(|f| 4 * f.dropped.len() > f.used.len() && !f.used.is_empty());
    let doubtful: Vec<usize> = doubtful.map(|f| f.frame).collect();
    if !doubtful.is_empty() {
        found.push(format!(
            "In pictures {} a fifth of the corners or more contradict the others and are left out: something stands before \
             them, or they are misread.",
            list(&doubtful)
        ));
    }
    found
}

/// How far a board is bent, or learnt markers rise out of the plane nearest to them, in parts of their side: lengths may have no unit.
fn relief(estimate: &Estimate) -> Option<String> {
    if let Shape::Curled(curled) = &estimate.rig.shape {
        let percent = 100.0 * curled.rise() / (2.0 * curled.reach);
        return Some(format!(
            "The board is bent, up to {percent:.1} % of its diagonal out of its plane, as paper that curls; taken into \
             account, but better glued to something flat."
        ));
    }
    let (Shape::Squares { is_flat: false, side, .. }, Some(plane)) = (&estimate.rig.shape, &estimate.plane) else {
        return None;
    };
    let heights = estimate.rig.shape.points().into_iter().map(|p| plane.inverse_transform_point(&p).z.abs());
    let percent = 100.0 * heights.fold(0.0, f64::max) / side;
    Some(format!(
        "The markers are up to {percent:.0} % of their side out of their plane, as paper that curls; taken into account."
    ))
}

/// Whether corners reach over the picture, as distortion is only known where they are.
fn cover(result: &Calibration, sightings: &[Sighting]) -> Option<String> {
    let used = sightings.iter().zip(&result.frames).filter(|(_, frame)| frame.standing == Standing::Used);
    let pixels: Vec<Point2<f64>> = used.flat_map(|(s, _)| s.corners.iter().map(|(_, pixel)| *pixel)).collect();
    let reach = |axis: usize| {
        let values = || pixels.iter().map(|p| p[axis]).filter(|v| v.is_finite());
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    let size = [result.intrinsics.width as f64, result.intrinsics.height as f64];
    let part = (0..2).map(|axis| reach(axis) / size[axis]).fold(1.0, f64::min);
    let is_known = result.lens.terms.iter().all(|t| t.source == Source::Held);
    (part < COVER && !is_known).then(|| {
        let percent = 100.0 * part;
        format!("The target reaches over {percent:.0} % of the picture; beyond it the lens is extrapolated.")
    })
}
