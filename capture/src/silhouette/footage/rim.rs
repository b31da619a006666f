//! Coverage at the edge of a silhouette, from the colours on both sides of it.
//!
//! A pixel there is `α F + (1 − α) B`, of encoded levels: a lens mixes light, but a film its hues only after encoding,
//! over 2 × 2 pixels, and before a coloured backdrop it is the hue that differs. `F` is the mean of the object near by,
//! `B` what is known to be behind, in the light it has near by; α is the projection of the pixel onto the line between
//! them. Of an object that is not of one colour it says little: with the variance `v` that the colours of the object and
//! noise give it, and `a` what the silhouette alone says, give or take σ, α is `(α / v + a / σ²) / (1 / v + 1 / σ²)`. In
//! the end the edge is evened along itself. All of it is done twice: a silhouette that takes mixed pixels for the object
//! takes their mean for the object's colour, too.

use super::light::Toned;
use crate::Image;
use crate::matte::{blur, signed_distance};

/// Pixels beside the edge whose coverage is asked for.
const BAND: f32 = 1.7;

/// Neighbours up to this far say what object and background look like.
const REACH: isize = 5;

/// Error of the coverage that a silhouette without steps between pixels says.
const MASK_ERROR: f32 = 0.5;

/// Error of what is thought to be behind, encoded: of white, and as a share of the brighter side.
const BACKGROUND_ERROR: (f32, f32) = (0.004, 0.05);

/// Pixels along the edge (standard deviation) that share their errors.
const EVENED: f32 = 1.0;

/// The matte to a silhouette (≥ 128) of `picture`, given what is behind it (encoded levels) where that is known.
pub(super) fn refined(picture: &Toned, background: &Image<Option<[f32; 3]>>, mask: &Image<u8>) -> Image<u8> {
    refined_once(picture, background, &refined_once(picture, background, mask))
}

fn refined_once(picture: &Toned, background: &Image<Option<[f32; 3]>>, mask: &Image<u8>) -> Image<u8> {
    let (width, height) = (mask.width(), mask.height());
    let distance = signed_distance(mask);
    let soft = blur(&mask.map(f32::from), 0.7);
    let colour = |x: usize, y: usize| picture.at(x, y).map(|v| v / 255.0);
    let behind = |x: usize, y: usize| background.at(x, y).map(|b| b.map(|v| v / 255.0));
    let mut matte = mask.map(|v| if v >= 128 { 1.0 } else { 0.0 });
    for y in 0..height {
        for x in 0..width {
            if distance.at(x, y).abs() > BAND {
                continue;
            }
            let expected = soft.at(x, y) / 255.0;
            let sides = sides(x, y, &distance, &colour, &behind);
            matte.set(x, y, sides.map_or(expected, |sides| sides.coverage(&colour(x, y), expected)));
        }
    }
    evened(&matte)
}

/// The same edge without what differs from pixel to pixel along it. A Gaussian of σ leaves a straight edge in place,
/// with a slope of `1 / (σ √2π)`: made one pixel wide again.
fn evened(matte: &Image<f32>) -> Image<u8> {
    let slope = EVENED * std::f32::consts::TAU.sqrt();
    let steep = |v: f32| ((v - 0.5) * slope + 0.5).clamp(0.0, 1.0);
    blur(matte, f64::from(EVENED)).map(|v| (255.0 * steep(v)).round() as u8)
}

/// Encoded colours on both sides of the edge, white = 1.
struct Sides {
    object: [f32; 3],
    /// Of the object's colour, per channel.
    variance: [f32; 3],
    background: [f32; 3],
}

impl Sides {
    /// Share of a pixel that is object, given what the silhouette alone says.
    fn coverage(&self, seen: &[f32; 3], expected: f32) -> f32 {
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let minus = |a: &[f32; 3], b: &[f32; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let across = minus(&self.object, &self.background);
        let contrast = dot(across, across).max(1e-9);
        let brighter = dot(self.object, self.object).max(dot(self.background, self.background)).sqrt();
        let of_object = dot(self.variance, across.map(|a| a * a)) / contrast;
        let of_background = (BACKGROUND_ERROR.0 + BACKGROUND_ERROR.1 * brighter).powi(2);
        let variance = (expected * expected * of_object + of_background) / contrast;
        let by_colour = (dot(minus(seen, &self.background), across) / contrast).clamp(-0.5, 1.5);
        let prior = MASK_ERROR * MASK_ERROR;
        // Both divided by the product of the variances.
        ((by_colour * prior + expected * variance) / (prior + variance)).clamp(0.0, 1.0)
    }
}

/// What object and background look like at a pixel of the edge.
fn sides(
    x: usize,
    y: usize,
    distance: &Image<f32>,
    colour: &impl Fn(usize, usize) -> [f32; 3],
    behind: &impl Fn(usize, usize) -> Option<[f32; 3]>,
) -> Option<Sides> {
    let (mut object, mut squares, mut object_weight) = ([0.0_f32; 3], [0.0_f32; 3], 0.0_f32);
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
            let colour = colour(u, v);
            if d > 0.0 {
                (0..3).for_each(|c| object[c] += weight * colour[c]);
                (0..3).for_each(|c| squares[c] += weight * colour[c] * colour[c]);
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
    let object = object.map(|v| v / object_weight);
    let variance = [0, 1, 2].map(|c| (squares[c] / object_weight - object[c] * object[c]).max(0.0));
    Some(Sides { object, variance, background })
}
