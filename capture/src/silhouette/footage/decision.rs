//! From odds to a silhouette: near the hull of all views the odds decide, far from it the hull does.

use super::Odds;
use crate::Image;
use crate::matte::{components, signed_distance};

/// Log odds gained well inside the hull.
const TRUST: f32 = 9.0;

/// Log odds gained per pixel inside the hull.
const SLOPE: f32 = 0.5;

/// A hole of which more than this share is object for the other views is a patch of the background's colour.
const LARGEST_SOLID: f64 = 0.7;

/// Object (255) or not, for voting where no hull is known yet: in between where the odds are even.
pub(super) fn guessed(odds: &Odds) -> Image<u8> {
    odds.log_odds.map(|l| (255.0 / (1.0 + (-0.7 * l).exp())) as u8)
}

/// The silhouette (255 or 0). `hull` is that of all views, object from 128 on; each pixel outside it costs `distrust`
/// of the log odds. With `fills_holes` the hull is good enough to say which holes are patches of the background's colour.
pub(super) fn decided(odds: &Odds, hull: &Image<u8>, distrust: f32, fills_holes: bool) -> Image<u8> {
    let distance = signed_distance(hull);
    let object = odds.log_odds.pixels().iter().zip(distance.pixels()).map(|(&l, &d)| {
        let prior = if d > 0.0 { (SLOPE * d).min(TRUST) } else { distrust * d };
        l + prior > 0.0
    });
    let mask = Image::from_pixels(hull.width(), hull.height(), object.collect()).unwrap_or_default();
    without_specks(&mask, hull, if fills_holes { LARGEST_SOLID } else { 1.0 })
}

/// Drops parts below a hundredth of the largest, fills holes below a two-thousandth of the object and those that the
/// other views do not look through.
fn without_specks(mask: &Image<bool>, hull: &Image<u8>, largest_solid: f64) -> Image<u8> {
    let (sizes, labels) = components(mask);
    let largest = sizes.iter().max().copied().unwrap_or(0);
    let kept = labels.map(|l| l > 0 && sizes[l as usize - 1] * 100 >= largest);
    let object = kept.pixels().iter().filter(|k| **k).count();
    let (holes, labels) = components(&kept.map(|k| !k));
    let mut solid = vec![0_usize; holes.len()];
    for (&label, &inside) in labels.pixels().iter().zip(hull.pixels()) {
        if label > 0 && inside >= 128 {
            solid[label as usize - 1] += 1;
        }
    }
    let is_open = |hole: usize| holes[hole] > object / 2000 && solid[hole] as f64 <= largest_solid * holes[hole] as f64;
    labels.map(|l| if l > 0 && is_open(l as usize - 1) { 0 } else { 255 })
}
