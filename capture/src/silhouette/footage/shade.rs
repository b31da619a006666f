//! Light that differs smoothly from what the target's plate was made in.

use super::cluster::Cluster;
use super::light::Toned;
use crate::Image;

/// Blocks along the longer side of a frame, and ratios that are another light and not another thing: first where the
/// object may be anywhere, then where it is known and shadows may be followed to its feet.
const CAREFUL: (usize, std::ops::RangeInclusive<f32>) = (40, 0.7..=1.35);
const CLOSE: (usize, std::ops::RangeInclusive<f32>) = (80, 0.4..=1.35);

/// Darker places (encoded levels) say little of the light.
const LEAST_LEVEL: f32 = 45.0;

/// Factor on encoded levels, smooth over a frame.
#[derive(Clone, Debug)]
pub(super) struct Shade {
    block: usize,
    factors: Image<f32>,
}

impl Shade {
    /// From a frame and what was expected of it (support 0 where nothing is); places where `hidden` ≥ 128 do not
    /// speak. `longest` is the longer side of the whole frame in pixels.
    pub(super) fn of(picture: &Toned, expected: &Image<Cluster>, hidden: Option<&Image<u8>>, longest: usize) -> Self {
        let (width, height) = (expected.width(), expected.height());
        let (blocks, range) = if hidden.is_some() { CLOSE } else { CAREFUL };
        let block = longest.div_ceil(blocks).max(5);
        let (columns, rows) = (width.div_ceil(block), height.div_ceil(block));
        let mut factors: Image<Option<f32>> = Image::filled(columns, rows, None);
        let mut ratios = Vec::new();
        for row in 0..rows {
            for column in 0..columns {
                ratios.clear();
                for y in row * block..((row + 1) * block).min(height) {
                    for x in column * block..((column + 1) * block).min(width) {
                        if hidden.is_none_or(|h| h.at(x, y) < 128) {
                            ratios.extend(ratio(&picture.at(x, y), &expected.at(x, y), &range));
                        }
                    }
                }
                if ratios.len() * 8 >= block * block {
                    let middle = ratios.len() / 2;
                    factors.set(column, row, Some(*ratios.select_nth_unstable_by(middle, f32::total_cmp).1));
                }
            }
        }
        Self { block, factors: smoothed(&filled(factors)) }
    }

    /// At a place of the frame.
    pub(super) fn at(&self, x: f64, y: f64) -> f32 {
        let (x, y) = (x / self.block as f64 - 0.5, y / self.block as f64 - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = ((x - x0) as f32, (y - y0) as f32);
        let at = |dx: isize, dy: isize| self.factors.at_clamped(x0 as isize + dx, y0 as isize + dy);
        let top = at(0, 0) + (at(1, 0) - at(0, 0)) * fx;
        let bottom = at(0, 1) + (at(1, 1) - at(0, 1)) * fx;
        top + (bottom - top) * fy
    }
}

/// Of all channels alike, where the hue is the expected one.
fn ratio(seen: &[f32; 3], expected: &Cluster, range: &std::ops::RangeInclusive<f32>) -> Option<f32> {
    let e = expected.colour;
    if expected.support == 0 || e.iter().sum::<f32>() < 3.0 * LEAST_LEVEL {
        return None;
    }
    let ratio = seen.iter().sum::<f32>() / e.iter().sum::<f32>();
    let is_same_hue = (0..3).all(|c| (seen[c] - ratio * e[c]).abs() < 8.0 + 0.05 * e[c]);
    (is_same_hue && range.contains(&ratio)).then_some(ratio)
}

/// Blocks that know nothing take the mean of their neighbours, ring by ring; 1 where nothing is known at all.
fn filled(mut factors: Image<Option<f32>>) -> Image<f32> {
    let (width, height) = (factors.width() as isize, factors.height() as isize);
    for _ in 0..width + height {
        if factors.pixels().iter().all(Option::is_some) {
            break;
        }
        let before = factors.clone();
        for y in 0..height {
            for x in 0..width {
                let around = [(-1, 0), (1, 0), (0, -1), (0, 1)].map(|(dx, dy)| (x + dx, y + dy));
                let known = around.iter().filter(|(u, v)| *u >= 0 && *v >= 0 && *u < width && *v < height);
                let known: Vec<f32> = known.filter_map(|&(u, v)| before.at(u as usize, v as usize)).collect();
                if before.at(x as usize, y as usize).is_none() && !known.is_empty() {
                    let mean = known.iter().sum::<f32>() / known.len() as f32;
                    factors.set(x as usize, y as usize, Some(mean));
                }
            }
        }
    }
    factors.map(|f| f.unwrap_or(1.0))
}

/// Means over 3 × 3 blocks.
fn smoothed(factors: &Image<f32>) -> Image<f32> {
    let mut out = factors.clone();
    for y in 0..factors.height() {
        for x in 0..factors.width() {
            let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
            let sum: f32 = around.map(|(dx, dy)| factors.at_clamped(x as isize + dx, y as isize + dy)).sum();
            out.set(x, y, sum / 9.0);
        }
    }
    out
}
