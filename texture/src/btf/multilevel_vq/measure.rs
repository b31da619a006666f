//! When an item stands for a slice.
//!
//! *RMSE*: root of the mean squared error over RGB, in 0..255 levels, what chroma adds counted 1.6-fold (see `color`), below the
//! threshold of the level. The root matters: squared errors violate the triangle inequality. The thresholds of the squared error
//! fall by a constant from book to book, so that the low books are the finer ones.
//!
//! *SSIM*: one threshold for all levels on the dissimilarity `1 − SSIM` that 98 % of the windows stay below (that is, the 2nd
//! percentile of SSIM). Windows of 5 × 5 cells run over each slice image (α, β), over luminance, or chroma, or all three; for a single
//! row they are 5 cells long. SSIM as of Wang, Bovik, Sheikh and Simoncelli, 2004, over plain windows. Among the
//! [`SHORTLIST`] nearest by RMSE the best by SSIM is taken.

use super::grid::Grid;
use super::resample::Texel;

/// Items by RMSE of which the best by SSIM is taken.
const SHORTLIST: usize = 12;
/// Side of a window, cells.
const WINDOW: usize = 5;
/// Windows that may be worse than the measure says.
const OUTLIERS: f64 = 0.02;
/// `(0.01)²`, `(0.03)²`: of Wang and others, for a range of 1.
const STABILISERS: [f32; 2] = [1e-4, 9e-4];
/// Errors below this are rounding, levels.
const ROUNDING: f64 = 2e-4;

/// How an item is compared to a slice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Measure {
    /// Root of the mean squared error over RGB, that of chroma counted 1.6-fold.
    #[default]
    Rmse,
    /// Structural similarity within slices.
    Ssim,
}

/// A book, as far as acceptance knows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Level {
    Texel,
    View,
    Pair,
    Slice,
    Row,
    ColorSlice,
    ColorRow,
    Color,
}

/// Slices to compare; luminance or chroma may be left out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch<'a> {
    pub(super) luma: &'a [f32],
    pub(super) chroma: &'a [f32],
    /// How much each slice counts, repeating.
    pub(super) weights: &'a [f32],
}

/// The measure, and a threshold for each level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Acceptance {
    pub(super) measure: Measure,
    /// RMSE in levels, chroma 1.6-fold, or `1 − SSIM`: of P4, P3, M, P2, P1.
    pub(super) luma: [f64; 5],
    /// Of I2, I1, C, in levels; SSIM replaces the first.
    pub(super) chroma: [f64; 3],
}

impl Acceptance {
    /// Whether an error is small enough at a level.
    pub(super) fn takes(&self, level: Level, error: f64) -> bool {
        let threshold = match level {
            Level::Texel => self.luma[0],
            Level::View => self.luma[1],
            Level::Pair => self.luma[2],
            Level::Slice => self.luma[3],
            Level::Row => self.luma[4],
            Level::ColorSlice => self.chroma[0],
            Level::ColorRow => self.chroma[1],
            Level::Color => self.chroma[2],
        };
        error <= threshold + ROUNDING
    }

    /// The error of a squared distance over so many cells.
    pub(super) fn rmse(&self, squared: f64, cells: usize) -> f64 {
        255.0 * (squared / (3 * cells) as f64).sqrt()
    }

    /// How far `decoded` is from `original`.
    pub(super) fn error(&self, grid: Grid, original: Patch<'_>, decoded: Patch<'_>) -> f64 {
        match self.measure {
            Measure::Rmse => {
                let cells = original.luma.len().max(original.chroma.len() / 2);
                let slice = cells.min(grid.cells());
                let luma = squared(original.luma, decoded.luma, slice, original.weights);
                self.rmse(luma + squared(original.chroma, decoded.chroma, 2 * slice, original.weights), cells)
            }
            Measure::Ssim => dissimilarity(grid, original, decoded),
        }
    }

    /// The items worth testing: those of least cost, in the order of the book.
    pub(super) fn shortlist(&self, costs: impl Iterator<Item = f32>) -> Vec<usize> {
        if self.measure == Measure::Rmse {
            return least(costs).into_iter().collect();
        }
        let mut all: Vec<(f32, usize)> = costs.enumerate().map(|(item, cost)| (cost, item)).collect();
        let count = SHORTLIST.min(all.len());
        if count < all.len() {
            all.select_nth_unstable_by(count, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        }
        let mut items: Vec<usize> = all[..count].iter().map(|(_, item)| *item).collect();
        items.sort_unstable();
        items
    }
}

impl Patch<'_> {
    pub(super) fn luma_only(self) -> Self {
        Self { chroma: &[], ..self }
    }

    pub(super) fn chroma_only(self) -> Self {
        Self { luma: &[], ..self }
    }
}

impl Texel {
    pub(super) fn as_patch<'a>(&'a self, weights: &'a [f32]) -> Patch<'a> {
        Patch { luma: &self.luma, chroma: &self.chroma, weights }
    }
}

/// The item of least cost, the first of equals.
fn least(costs: impl Iterator<Item = f32>) -> Option<usize> {
    let (mut found, mut lowest) = (None, f32::INFINITY);
    for (item, cost) in costs.enumerate() {
        if cost < lowest {
            (found, lowest) = (Some(item), cost);
        }
    }
    found
}

/// The squared distance of slices of one length, weighted in turn.
fn squared(a: &[f32], b: &[f32], slice: usize, weights: &[f32]) -> f64 {
    let of_slice = |(x, y): (&[f32], &[f32])| x.iter().zip(y).map(|(u, v)| (u - v) * (u - v)).sum::<f32>();
    let slices = a.chunks(slice).zip(b.chunks(slice)).map(of_slice);
    slices.zip(weights.iter().cycle()).map(|(squares, weight)| f64::from(squares * weight)).sum()
}

/// What 98 % of the windows do not exceed, of `1 − SSIM`.
fn dissimilarity(grid: Grid, original: Patch<'_>, decoded: Patch<'_>) -> f64 {
    let cells = original.luma.len().max(original.chroma.len() / 2);
    let shape = if cells == grid.beta { [1, grid.beta] } else { [grid.alpha, grid.beta] };
    let mut windows: Vec<f32> = Vec::new();
    let images = |plane: &[f32], step: usize, offset: usize| -> Vec<f32> {
        plane.iter().skip(offset).step_by(step).copied().collect()
    };
    for (a, b, step) in [(original.luma, decoded.luma, 1), (original.chroma, decoded.chroma, 2)] {
        for offset in 0..if a.is_empty() { 0 } else { step } {
            let (a, b) = (images(a, step, offset), images(b, step, offset));
            let pairs = a.chunks_exact(shape[0] * shape[1]).zip(b.chunks_exact(shape[0] * shape[1]));
            pairs.for_each(|(a, b)| push_windows(a, b, shape, &mut windows));
        }
    }
    let allowed = (OUTLIERS * windows.len() as f64) as usize;
    let rank = windows.len().saturating_sub(1 + allowed);
    if windows.is_empty() { 0.0 } else { f64::from(*windows.select_nth_unstable_by(rank, f32::total_cmp).1) }
}

/// `1 − SSIM` of each window of one slice image.
fn push_windows(a: &[f32], b: &[f32], [rows, columns]: [usize; 2], out: &mut Vec<f32>) {
    let (high, wide) = (WINDOW.min(rows), WINDOW.min(columns));
    for top in 0..=rows - high {
        for left in 0..=columns - wide {
            let at = (top..top + high).flat_map(|r| (left..left + wide).map(move |c| r * columns + c));
            out.push(1.0 - similarity(at.map(|k| [a[k], b[k]])));
        }
    }
}

/// SSIM of two windows, equation 13 of Wang and others.
fn similarity(values: impl Iterator<Item = [f32; 2]> + Clone) -> f32 {
    let (mut n, mut sum) = (0.0, [0.0_f32; 2]);
    for [x, y] in values.clone() {
        n += 1.0;
        sum = [sum[0] + x, sum[1] + y];
    }
    let mean = sum.map(|s| s / n);
    let mut moments = [0.0_f32; 3];
    for [x, y] in values {
        let (dx, dy) = (x - mean[0], y - mean[1]);
        moments = [moments[0] + dx * dx, moments[1] + dy * dy, moments[2] + dx * dy];
    }
    let [xx, yy, xy] = moments.map(|m| m / n);
    let [c1, c2] = STABILISERS;
    let level = (2.0 * mean[0] * mean[1] + c1) / (mean[0] * mean[0] + mean[1] * mean[1] + c1);
    level * (2.0 * xy + c2) / (xx + yy + c2)
}
