//! The colours of the object near by: its foot is as dark as the wall above it, whatever it is elsewhere.
//!
//! A Gaussian per channel, of the pixels that are object as far as is known, weighed by distance; localised colour
//! models as of Bai et al., Video SnapCut, ACM TOG 28(3), 2009.

use super::light::Toned;
use super::palette::Palette;
use crate::Image;
use crate::matte::blur;

/// Blocks along the longer side of a frame.
const BLOCKS: usize = 160;

/// Reach, in blocks (standard deviation).
const REACH: f64 = 1.5;

/// Deviation that colours have at least, encoded levels.
const LEAST_DEVIATION: f32 = 10.0;

/// What the colours near by weigh against those of all the object.
const SHARE: f32 = 0.7;

/// Of the pixels near by the share that must be object for these to weigh in full.
const ENOUGH: f32 = 0.1;

/// Per block: share of object, mean and variance of its channels.
#[derive(Debug)]
pub(super) struct Nearby {
    block: usize,
    share: Image<f32>,
    mean: [Image<f32>; 3],
    variance: [Image<f32>; 3],
}

impl Nearby {
    /// Of the pixels of `picture` that are object (≥ 128); `longest` is the longer side of the whole frame in pixels.
    pub(super) fn of(picture: &Toned, object: &Image<u8>, longest: usize) -> Self {
        let block = longest.div_ceil(BLOCKS).max(2);
        let (columns, rows) = (object.width().div_ceil(block), object.height().div_ceil(block));
        // Number, sums and sums of squares.
        let mut sums: [Image<f32>; 7] = [0; 7].map(|_| Image::filled(columns, rows, 0.0));
        let share = 1.0 / (block * block) as f32;
        for y in 0..object.height() {
            for x in 0..object.width() {
                if object.at(x, y) < 128 {
                    continue;
                }
                let at = y / block * columns + x / block;
                let colour = picture.at(x, y);
                sums[0].pixels_mut()[at] += share;
                for c in 0..3 {
                    sums[1 + c].pixels_mut()[at] += share * colour[c];
                    sums[4 + c].pixels_mut()[at] += share * colour[c] * colour[c];
                }
            }
        }
        let [share, r, g, b, rr, gg, bb] = sums.map(|sum| blur(&sum, REACH));
        let divided = |sum: Image<f32>| {
            let pixels = sum.pixels().iter().zip(share.pixels()).map(|(v, n)| v / n.max(1e-6)).collect();
            Image::from_pixels(columns, rows, pixels).unwrap_or(sum)
        };
        let mean = [r, g, b].map(divided);
        let squares = [rr, gg, bb].map(divided);
        let variance = [0, 1, 2].map(|c| {
            let pairs = squares[c].pixels().iter().zip(mean[c].pixels());
            let pixels = pairs.map(|(s, m)| (s - m * m).max(0.0) + LEAST_DEVIATION.powi(2)).collect();
            Image::from_pixels(columns, rows, pixels).unwrap_or_default()
        });
        Self { block, share, mean, variance }
    }

    /// Natural logarithm of the density of a colour at a pixel, with what all the object shows.
    pub(super) fn log_density(&self, colour: &[f32; 3], x: usize, y: usize, all: &Palette) -> f32 {
        let (column, row) = (x / self.block, y / self.block);
        let weight = SHARE * (self.share.at(column, row) / ENOUGH).min(1.0);
        let channel = |c: usize| {
            let (mean, variance) = (self.mean[c].at(column, row), self.variance[c].at(column, row));
            // ln √(2π)
            -0.5 * ((colour[c] - mean).powi(2) / variance + variance.ln()) - 0.919
        };
        let near: f32 = (0..3).map(channel).sum();
        ((1.0 - weight) * all.log_density(colour).exp() + weight * near.exp()).ln()
    }
}
