//! Which silhouettes agree, and what to say of them.

use super::cloth::Cloth;
use super::consensus::{Consensus, Dissent};
use super::palette::Palettes;
use super::rounds::{Belief, Found, Part};
use super::{Evidence, Silhouettes, StageSetup, stage};
use crate::votes::rough_box;
use crate::{Camera, CaptureError, Image};
use rayon::prelude::*;

/// A frame that agrees this much less than the median one contradicts the others.
const LEAST_GAP: f64 = 0.08;

/// A share of the object explained as background from which on nothing separates.
const LARGEST_UNSEPARATED: f64 = 0.4;

/// A share of the object's colours that are the cloth's from which on it cannot be told from it.
const LARGEST_CAMOUFLAGE: f64 = 0.25;

/// Of the cloth's (encoded) light, what the object may have where it is of the same colour.
const SHADES: std::ops::RangeInclusive<f32> = 0.35..=1.3;

/// Cells kept around the hull where it is looked for again: thumbnails lose thin tips, a trunk or a tusk.
const MARGIN_CELLS: f64 = 8.0;

/// Cells around the hull in the box that is told.
const BOX_CELLS: f64 = 3.0;

/// Judges silhouettes from elsewhere.
///
/// # Errors
/// [`CaptureError::Stage`] where `setup` contradicts itself or the mattes.
pub fn check_silhouettes(mattes: &[Image<u8>], setup: &StageSetup) -> Result<Silhouettes, CaptureError> {
    setup.check()?;
    let size = |c: &Camera| (c.intrinsics.width, c.intrinsics.height);
    let fits = |(matte, camera): (&Image<u8>, &Camera)| (matte.width(), matte.height()) == size(camera);
    if mattes.len() != setup.cameras.len() || !mattes.iter().zip(&setup.cameras).all(fits) {
        let fault = "the silhouettes are not one per frame, of its size".to_owned();
        return Err(CaptureError::Stage {
            fault,
            remedy: "give a mask for every frame, of the frame's size".to_owned(),
        });
    }
    let pairs: Vec<_> = setup.cameras.iter().zip(mattes).collect();
    let part = |&(camera, matte): &(&Camera, &Image<u8>)| Part::given(camera, matte);
    let parts: Vec<Part> = pairs.iter().map(part).collect();
    let gains = vec![[1.0; 3]; mattes.len()];
    let Some(search) = setup.aabb.or_else(|| rough_box(&pairs)).or_else(|| stage::search_box(setup)) else {
        return Ok(summed_up(unjudged(parts), gains, setup, Evidence::Given));
    };
    let belief = Belief::none(search);
    let coarse = agreed(parts, &belief, Palettes::anything(), 64, Dissent { share: 0.15, least: 1 });
    let belief = coarse.belief.unwrap_or(belief);
    let found = agreed(coarse.parts, &belief, Palettes::anything(), 128, Dissent { share: 0.04, least: 1 });
    Ok(summed_up(found, gains, setup, Evidence::Given))
}

/// Where no two frames look at the same thing.
fn unjudged(parts: Vec<Part>) -> Found {
    let agreement = vec![0.0; parts.len()];
    Found { belief: None, parts, agreement, contradicting: Vec::new() }
}

/// Empty silhouettes.
pub(super) fn nothing_found(gains: Vec<[f64; 3]>, setup: &StageSetup) -> Silhouettes {
    let empty = |c: &Camera| Part::given(c, &Image::filled(c.intrinsics.width, c.intrinsics.height, 0));
    let parts = setup.cameras.iter().map(empty).collect();
    summed_up(unjudged(parts), gains, setup, Evidence::Plates)
}

/// The hull of the silhouettes, without those that contradict the others.
pub(super) fn agreed(
    parts: Vec<Part>,
    belief: &Belief,
    palettes: Palettes,
    resolution: usize,
    dissent: Dissent,
) -> Found {
    // Cells smaller than a pixel know no more.
    let pixels = parts.iter().map(|p| p.cutout.width.max(p.cutout.height)).max().unwrap_or(0);
    let resolution = resolution.min(pixels).max(16);
    let hull_of = |without: &[usize]| {
        let voters = parts.iter().enumerate().filter(|(i, _)| !without.contains(i));
        let views: Vec<(&Camera, &Image<u8>)> = voters.map(|(_, p)| (&p.camera, &p.matte)).collect();
        Consensus::of(&belief.bounds, resolution, &views, dissent)
    };
    let judged = |hull: &Consensus| {
        let agreement: Vec<f64> = parts.par_iter().map(|p| iou(&p.matte, &hull.silhouette(&p.camera))).collect();
        let contradicting = outliers(&agreement);
        (agreement, contradicting)
    };
    let Some(first) = hull_of(&[]) else { return unjudged(parts) };
    let (mut agreement, mut contradicting) = judged(&first);
    let mut hull = first;
    // Once without them the hull may show others, or that one was blamed for another.
    for _ in 0..2 {
        if contradicting.is_empty() {
            break;
        }
        let Some(better) = hull_of(&contradicting) else { break };
        hull = better;
        (agreement, contradicting) = judged(&hull);
    }
    let Some(bounds) = hull.tight_box(MARGIN_CELLS) else { return unjudged(parts) };
    let belief = Belief { bounds: belief.within(&bounds), limits: belief.limits, hull: Some(hull), palettes };
    Found { belief: Some(belief), parts, agreement, contradicting }
}

/// Frames whose agreement lies well below what is usual.
fn outliers(agreement: &[f64]) -> Vec<usize> {
    let mut sorted = agreement.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(&median) = sorted.get(sorted.len() / 2) else { return Vec::new() };
    let mut gaps: Vec<f64> = sorted.iter().map(|a| (a - median).abs()).collect();
    gaps.sort_by(f64::total_cmp);
    let usual_gap = gaps.get(gaps.len() / 2).copied().unwrap_or(0.0);
    let least = median - LEAST_GAP.max(6.0 * usual_gap);
    (0..agreement.len()).filter(|&i| agreement[i] < least).collect()
}

/// Intersection over union of the objects (≥ 128); 0 where there is neither.
pub(super) fn iou(a: &Image<u8>, b: &Image<u8>) -> f64 {
    let both = a.pixels().iter().zip(b.pixels()).map(|(&a, &b)| (a >= 128, b >= 128));
    let (and, or) = both.fold((0, 0), |(and, or), (a, b)| (and + usize::from(a && b), or + usize::from(a || b)));
    and as f64 / or.max(1) as f64
}

/// The answer at full size, and what to say of it.
pub(super) fn summed_up(found: Found, gains: Vec<[f64; 3]>, setup: &StageSetup, evidence: Evidence) -> Silhouettes {
    let findings = findings(&found, setup);
    let is_empty = |part: &Part| !part.matte.pixels().iter().any(|&v| v >= 128);
    let is_left_out = |i: &usize| found.contradicting.contains(i) || is_empty(&found.parts[*i]);
    let contradicting = (0..found.parts.len()).filter(is_left_out).collect();
    let back = |(part, camera): (&Part, &Camera)| part.cutout.back(&part.matte, camera, 0);
    Silhouettes {
        mattes: found.parts.iter().zip(&setup.cameras).map(back).collect(),
        agreement: found.agreement,
        contradicting,
        gains,
        aabb: found.belief.and_then(|b| Some(b.within(&b.hull.as_ref()?.tight_box(BOX_CELLS)?))),
        evidence,
        findings,
    }
}

/// Says so where much of what is seen of the object looks like the cloth: parts of it that only ever stand before the
/// cloth are then missing in all frames alike, and no hull can tell.
pub(super) fn camouflage<'a>(found: &Found, cloths: impl Iterator<Item = &'a Cloth>) -> Option<String> {
    let seen: Vec<[f32; 3]> = found.parts.iter().flat_map(|part| part.colours[0].iter().copied()).collect();
    let like = |cloth: &Cloth| {
        let middle = cloth.at(0.5, 0.5);
        let is_like = |colour: &&[f32; 3]| {
            // In light or in shade.
            let dot = |a: &[f32; 3]| (0..3).map(|c| a[c] * middle[c]).sum::<f32>();
            let shade = dot(colour) / dot(&middle).max(1.0);
            SHADES.contains(&shade) && cloth.is_like(&middle, &colour.map(|v| v / shade))
        };
        seen.iter().filter(is_like).count() as f64 / seen.len().max(1) as f64
    };
    let share = cloths.map(like).fold(0.0, f64::max);
    (share > LARGEST_CAMOUFLAGE).then(|| {
        format!(
            "{:.0} % of what is seen of the object has the colour of the backdrop: parts of it may be missing; hang a \
             cloth of another colour, or give masks",
            100.0 * share
        )
    })
}

fn findings(found: &Found, setup: &StageSetup) -> Vec<String> {
    let mut findings = Vec::new();
    let listed = |frames: &[usize]| {
        let numbers: Vec<usize> = frames.iter().map(|&i| setup.numbers.get(i).copied().unwrap_or(i)).collect();
        listed(&numbers)
    };
    let frames = |which: &dyn Fn(usize, &Part) -> bool| -> Vec<usize> {
        found.parts.iter().enumerate().filter(|(i, p)| which(*i, p)).map(|(i, _)| i).collect()
    };
    if found.belief.is_none() {
        findings.push(
            "no object was found that all frames agree on: hang a plain cloth of another colour behind it, or give masks"
                .to_owned(),
        );
        return findings;
    }
    let empty = frames(&|_, p| !p.matte.pixels().iter().any(|&v| v >= 128));
    let is_judged = |i: usize| !empty.contains(&i) && !found.contradicting.contains(&i);
    let unseparated = frames(&|i, p| p.unseparated > LARGEST_UNSEPARATED && is_judged(i));
    if !unseparated.is_empty() {
        findings.push(format!(
            "the backdrop has the colour of the object in frames {}: its edge there is guessed from the others; \
             hang a cloth of another colour, or give masks",
            listed(&unseparated)
        ));
    }
    if !empty.is_empty() {
        findings.push(format!("nothing of the object was found in frames {}: they are left out", listed(&empty)));
    }
    let contradicting: Vec<usize> = found.contradicting.iter().copied().filter(|i| !empty.contains(i)).collect();
    if !contradicting.is_empty() {
        findings.push(format!(
            "the silhouettes of frames {} contradict the others: a wrong camera, a hand in the picture, or the object \
             was moved; they are left out",
            listed(&contradicting)
        ));
    }
    findings
}

/// A dozen numbers at most.
fn listed(frames: &[usize]) -> String {
    let first: Vec<String> = frames.iter().take(12).map(usize::to_string).collect();
    let rest = frames.len().saturating_sub(12);
    if rest == 0 { first.join(", ") } else { format!("{} and {rest} more", first.join(", ")) }
}
