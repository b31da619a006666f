//! Sightings as given, made fit to estimate from: every corner once, finite, of the target.

use super::homography::median;
use super::rig::{Corner, Picture};
use super::{CalibrateError, CalibrateOptions, LensKnowledge, Sighting, Target};
use nalgebra::{Point2, Point3};
use std::collections::BTreeMap;

/// What is left, and what was said about the rest.
pub(super) struct Cleaned {
    pub(super) pictures: Vec<Picture>,
    /// The target's index for each of the rig's points.
    pub(super) indices: Vec<usize>,
    pub(super) notes: Vec<String>,
}

/// Refuses targets and options that cannot be.
pub(super) fn check(target: &Target, options: &CalibrateOptions) -> Result<(), CalibrateError> {
    let [width, height] = options.size;
    let fault = |option, value, remedy| Err(CalibrateError::Option { option, value, remedy });
    if width < 2 || height < 2 {
        return fault("size", format!("{width}x{height}"), "give the width and height of the pictures in pixels");
    }
    match options.lens {
        LensKnowledge::Guess(focal) if !(focal.is_finite() && focal > 0.0) => {
            return fault("the guessed focal length", focal.to_string(), "give a positive number of pixels");
        }
        LensKnowledge::Known(lens) if [lens.width, lens.height] != options.size => {
            let value = format!("of pictures of {}x{}", lens.width, lens.height);
            return fault(
                "the known lens",
                value,
                "calibrate it with pictures of the size used here, at the same zoom",
            );
        }
        LensKnowledge::Known(lens) => {
            let d = lens.distortion;
            let all = [lens.fx, lens.fy, lens.cx, lens.cy, lens.skew, d.k1, d.k2, d.k3, d.p1, d.p2];
            if !all.iter().all(|v| v.is_finite()) || lens.fx <= 0.0 || lens.fy <= 0.0 {
                return fault("the known lens", format!("{lens:?}"), "give finite numbers and positive focal lengths");
            }
        }
        _ => (),
    }
    check_target(target)
}

fn check_target(target: &Target) -> Result<(), CalibrateError> {
    let fault = |fault: &str| Err(CalibrateError::Target { fault: fault.to_owned() });
    match target {
        Target::Markers { side } if !(side.is_finite() && *side > 0.0) => fault("has markers without a size"),
        Target::Points(points) if points.len() < 4 => fault("has fewer than four points"),
        Target::Points(points) if !points.iter().flat_map(|p| p.iter()).all(|v| v.is_finite()) => {
            fault("has points that are not numbers")
        }
        Target::Points(points) if is_line(points) => fault("is a line"),
        _ => Ok(()),
    }
}

/// Whether all points lie in a line, to a thousandth of its length.
fn is_line(points: &[Point3<f64>]) -> bool {
    let far = |from: &Point3<f64>| {
        points.iter().max_by(|a, b| (*a - from).norm().total_cmp(&(*b - from).norm())).copied().unwrap_or(*from)
    };
    let start = far(&points[0]);
    let along = far(&start) - start;
    let length = along.norm();
    points.iter().all(|p| (p - start).cross(&along).norm() <= 1e-3 * length * length)
}

/// Keeps corners of the target that are finite and seen once; of markers, those whose four corners are.
pub(super) fn clean(target: &Target, sightings: &[Sighting]) -> Cleaned {
    let mut notes = Vec::new();
    let mut seen: Vec<BTreeMap<usize, Point2<f64>>> = Vec::new();
    for sighting in sightings {
        let (corners, twice) = once(target, sighting);
        if !twice.is_empty() {
            let what = if matches!(target, Target::Markers { .. }) { "markers" } else { "corners" };
            notes.push(format!(
                "Picture {} shows {what} {} twice; they are left out there.",
                sighting.frame,
                list(&twice)
            ));
        }
        seen.push(corners);
    }
    let indices: Vec<usize> = match target {
        Target::Points(points) => (0..points.len()).collect(),
        Target::Markers { .. } => {
            let mut markers: Vec<usize> = seen.iter().flat_map(|c| c.keys().map(|index| index / 4)).collect();
            markers.sort_unstable();
            markers.dedup();
            markers.iter().flat_map(|m| (0..4).map(move |k| 4 * m + k)).collect()
        }
    };
    let picture = |(sighting, corners): (&Sighting, &BTreeMap<usize, Point2<f64>>)| {
        let corner = |(index, pixel): (&usize, &Point2<f64>)| {
            Some(Corner { point: indices.binary_search(index).ok()?, pixel: *pixel, is_used: true })
        };
        let corners: Vec<Corner> = corners.iter().filter_map(corner).collect();
        Picture { is_used: !corners.is_empty(), corners, film: sighting.film, time_s: sighting.time_s }
    };
    let pictures = sightings.iter().zip(&seen).map(picture).collect();
    Cleaned { pictures, indices, notes }
}

/// The corners of a sighting by index, and those (or the markers) that came twice.
fn once(target: &Target, sighting: &Sighting) -> (BTreeMap<usize, Point2<f64>>, Vec<usize>) {
    let group = |index: usize| if matches!(target, Target::Markers { .. }) { index / 4 } else { index };
    let mut corners = BTreeMap::new();
    let mut twice = Vec::new();
    for &(index, pixel) in &sighting.corners {
        let is_of_target = match target {
            Target::Points(points) => index < points.len(),
            Target::Markers { .. } => true,
        };
        if !(is_of_target && pixel.x.is_finite() && pixel.y.is_finite()) {
            continue;
        }
        if corners.insert(index, pixel).is_some() {
            twice.push(group(index));
        }
    }
    twice.sort_unstable();
    twice.dedup();
    corners.retain(|index, _| twice.binary_search(&group(*index)).is_err());
    (corners, twice)
}

/// Numbers in a sentence.
pub(super) fn list(numbers: &[usize]) -> String {
    const MOST: usize = 12;
    let shown: Vec<String> = numbers.iter().take(MOST).map(ToString::to_string).collect();
    let more = numbers.len().saturating_sub(MOST);
    if more > 0 { format!("{} and {more} more", shown.join(", ")) } else { shown.join(", ") }
}

/// The numbering of flat points from the opposite end: where half a turn in the plane puts each. `None` where it puts
/// one where none is.
pub(super) fn upside_down(points: &[Point3<f64>]) -> Option<Vec<usize>> {
    let middle = Point3::from(points.iter().map(|p| p.coords).sum::<nalgebra::Vector3<f64>>() / points.len() as f64);
    let nearest = |from: &Point3<f64>, but: Option<usize>| {
        let others = points.iter().enumerate().filter(|(k, _)| Some(*k) != but);
        others.map(|(k, p)| (k, (p - from).norm())).min_by(|a, b| a.1.total_cmp(&b.1))
    };
    let gaps: Vec<f64> = points.iter().enumerate().filter_map(|(k, p)| Some(nearest(p, Some(k))?.1)).collect();
    let tolerance = 0.05 * median(&gaps);
    let opposite = |p: &Point3<f64>| nearest(&(middle - (p - middle)), None).filter(|n| n.1 <= tolerance).map(|n| n.0);
    points.iter().map(opposite).collect()
}
