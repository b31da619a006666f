//! Coverage at the edge of a silhouette, from the colours on both sides of it.
//!
//! A pixel there is `α F + (1 − α) B` in linear light. `F` is the mean of the object near by, `B` what is known to be
//! behind, in the light it has near by; α is the projection of the pixel onto the line between them.

use super::light::{Toned, linear};
use crate::Image;
use crate::matte::{blur, signed_distance};

/// Pixels beside the edge whose coverage is asked for.
const BAND: f32 = 1.7;

/// Neighbours up to this far say what object and background look like.
const REACH: isize = 5;

/// Colours closer than this (linear light, and as a share of the brighter) do not tell coverage.
const LEAST_CONTRAST: (f32, f32) = (0.006, 0.12);

/// The matte to a silhouette (≥ 128) of `picture`, given what is behind it (encoded levels) where that is known.
pub(super) fn refined(picture: &Toned, background: &Image<Option<[f32; 3]>>, mask: &Image<u8>) -> Image<u8> {
    let (width, height) = (mask.width(), mask.height());
    let distance = signed_distance(mask);
    let soft = blur(&mask.map(f32::from), 0.7);
    let light = |x: usize, y: usize| picture.at(x, y).map(linear);
    let behind = |x: usize, y: usize| background.at(x, y).map(|b| b.map(linear));
    let mut matte = mask.map(|v| if v >= 128 { 255 } else { 0 });
    for y in 0..height {
        for x in 0..width {
            if distance.at(x, y).abs() > BAND {
                continue;
            }
            let sides = sides(x, y, &distance, &light, &behind);
            let coverage = sides.and_then(|(f, b)| coverage(&light(x, y), &f, &b));
            let value = coverage.map_or(soft.at(x, y), |a| 255.0 * a);
            matte.set(x, y, value.round().clamp(0.0, 255.0) as u8);
        }
    }
    matte
}

/// What object and background look like at a pixel of the edge.
fn sides(
    x: usize,
    y: usize,
    distance: &Image<f32>,
    light: &impl Fn(usize, usize) -> [f32; 3],
    behind: &impl Fn(usize, usize) -> Option<[f32; 3]>,
) -> Option<([f32; 3], [f32; 3])> {
    let (mut object, mut object_weight) = ([0.0_f32; 3], 0.0_f32);
    let mut outside_weight = 0.0_f32;
    let (mut beside, mut beside_weight) = ([0.0_f32; 3], 0.0_f32);
    let (mut seen, mut expected) = (0.0_f32, 0.0_f32);
    let range = |v: usize, size: usize| {
        let v = v as isize;
        (v - REACH).max(0) as usize..((v + REACH + 1).min(size as isize)) as usize
    };
    for v in range(y, distance.height()) {
        for u in range(x, distance.width()) {
            let d = distance.at(u, v);
            // Nearer ones are mixed themselves.
            if d.abs() < 1.2 {
                continue;
            }
            let squared = ((u as f32 - x as f32).powi(2) + (v as f32 - y as f32).powi(2)) / (REACH * REACH) as f32;
            let weight = (-2.0 * squared).exp();
            let colour = light(u, v);
            if d > 0.0 {
                (0..3).for_each(|c| object[c] += weight * colour[c]);
                object_weight += weight;
            } else {
                outside_weight += weight;
                // Of a pattern the nearest pixels alone say what goes on under the edge.
                let near = (-12.0 * squared).exp();
                (0..3).for_each(|c| beside[c] += near * colour[c]);
                beside_weight += near;
                if let Some(b) = behind(u, v) {
                    seen += weight * colour.iter().sum::<f32>();
                    expected += weight * b.iter().sum::<f32>();
                }
            }
        }
    }
    if object_weight < 0.05 || outside_weight < 0.05 {
        return None;
    }
    let background = match behind(x, y) {
        Some(b) => {
            // Shadow and shade, as near by.
            let ratio = if expected > 1e-3 { (seen / expected).clamp(0.3, 1.3) } else { 1.0 };
            b.map(|v| v * ratio)
        }
        None => beside.map(|v| v / beside_weight.max(1e-12)),
    };
    Some((object.map(|v| v / object_weight), background))
}

/// `(I − B)·(F − B) / |F − B|²`; `None` where the two sides look alike.
fn coverage(seen: &[f32; 3], object: &[f32; 3], background: &[f32; 3]) -> Option<f32> {
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let minus = |a: &[f32; 3], b: &[f32; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let across = minus(object, background);
    let contrast = dot(across, across);
    let brighter = dot(*object, *object).max(dot(*background, *background)).sqrt();
    let least = LEAST_CONTRAST.0 + LEAST_CONTRAST.1 * brighter;
    (contrast > least * least).then(|| (dot(minus(seen, background), across) / contrast).clamp(0.0, 1.0))
}
