//! What is asked of the fit: how large, how judged, in which order.

use super::color::ColorSpace;
use super::grid::Grid;
use super::grow::Growth;
use super::measure::{Acceptance, Measure};
use crate::TextureError;
use crate::btf::{Budget, Precision};
use capture::btf::Btf;

/// Thresholds of I2, I1, C are not below these, in levels, 1.6 of which are one of chroma (see `color`): the constants of the
/// paper, where they are all there is.
const COLOR_THRESHOLDS: [f64; 3] = [0.5, 0.2, 0.1];
/// Falling by 0.4 from book to book, as in the paper, fills P3 and M with what P4 does not need. Chroma takes few bytes; without
/// a finer threshold of its own it gives way first.
const SQUARED_SHARES: [f64; 8] = [1.0, 0.9, 0.8, 0.65, 0.5, 0.4, 0.3, 0.3];
/// Rounds of refinement: a third gains hardly anything.
const REFINEMENTS: usize = 2;
/// What is resampled for a threshold returns within a level; what is for a ratio is smoother, and takes fewer items.
const FAITHFUL_RIDGE: f64 = 0.005;
const SMOOTH_RIDGE: f64 = 0.05;
/// The threshold of P4 without a budget, levels.
const STANDARD: f64 = 4.0;
/// The same where data shall be kept as far as can be seen.
const AUTO: f64 = 2.0;
/// Of quality 0, and what divides it per 50 of quality.
const COARSEST: f64 = 40.0;

/// How it is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// How finely directions are sampled.
    pub grid: Grid,
    /// Ridge of the resampling, above 0: what several directions of one cell say differently is multiplied by `1/(2√μ)` at most.
    pub ridge: f64,
    /// How large it may be.
    pub aim: Aim,
    /// How items are compared to slices.
    pub measure: Measure,
    /// How colours stand in the books.
    pub color: ColorSpace,
    /// Which texels may grow the books; shares sum to 1.
    pub phases: [Phase; 3],
    /// Squared thresholds of P4, P3, M, P2, P1, I2, I1, C, as shares of the first; for SSIM all thresholds are one.
    pub squared_shares: [f64; 8],
    /// Rounds in which the books become the means of what they stand for.
    pub refinements: usize,
    /// How numbers are stored.
    pub precision: Precision,
    /// Whether smaller sizes are held too: a third more of P6.
    pub mip_maps: bool,
    /// Where the Halton sequence of the texels starts; nothing else is random.
    pub seed: u64,
}

/// What may be chosen of the books beside their size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Variant {
    /// How items are compared to slices.
    pub measure: Measure,
    /// How colours stand in the books.
    pub color: ColorSpace,
    /// Whether smaller sizes are held too: a third more of P6.
    pub mip_maps: bool,
}

/// How large it may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// The error under which a texel is taken for another: RMSE in 0..255 levels, that of chroma counted 1.6-fold, or
    /// `1 − SSIM` in hundredths.
    Threshold(f64),
    /// Raw over coded bytes, at least this and at most 3 % more where a threshold gives it.
    Ratio(f64),
    /// Items of P4 at most, and nine tenths of it where a threshold gives it, before refining leaves some without use.
    Entries(usize),
}

/// A run of texels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phase {
    /// Share of all texels.
    pub share: f64,
    /// By which squared thresholds are multiplied.
    pub slack: f64,
    /// What the books may gain.
    pub growth: Growth,
}

impl Phase {
    /// Havran, Filip, Myszkowski, section 5.1.1.
    pub const PAPER: [Self; 3] = [
        Self { share: 0.01, slack: 1.0, growth: Growth::All },
        Self { share: 0.04, slack: 2.5, growth: Growth::All },
        Self { share: 0.95, slack: 2.5, growth: Growth::Nothing },
    ];
    /// The same, but that all texels may combine what there is.
    pub const COMBINING: [Self; 3] = [
        Self { share: 0.01, slack: 1.0, growth: Growth::All },
        Self { share: 0.04, slack: 2.5, growth: Growth::All },
        Self { share: 0.95, slack: 2.5, growth: Growth::Combinations },
    ];
}

impl Options {
    /// What a budget means for this codec: a ratio, items of P4, or a threshold, 4 levels by default, 2 for
    /// [`Budget::Auto`], `40 · 10^(−q/50)` for a quality. A ratio buys less error
    /// with two thirds of the azimuths and a smoother resampling.
    ///
    /// # Errors
    /// Where the budget is out of range.
    pub fn new(btf: &Btf, budget: Budget, precision: Precision, seed: u64) -> Result<Self, TextureError> {
        let aim = match budget {
            Budget::Standard => Aim::Threshold(STANDARD),
            Budget::Ratio(ratio) => Aim::Ratio(ratio),
            Budget::Quality(quality) if (0.0..=100.0).contains(&quality) => {
                Aim::Threshold(COARSEST * 10.0_f64.powf(-quality / 50.0))
            }
            Budget::Quality(quality) => return Err(out_of_range("the quality", quality, "give 0 to 100")),
            Budget::Components(count) => Aim::Entries(count),
            Budget::Auto => Aim::Threshold(AUTO),
        };
        let measured = Grid::of(&btf.views, &btf.lights);
        let (grid, ridge) = match budget {
            Budget::Ratio(_) => (Grid { phi: (measured.phi * 2).div_ceil(3), ..measured }, SMOOTH_RIDGE),
            _ => (measured, FAITHFUL_RIDGE),
        };
        let options = Self {
            grid,
            ridge,
            aim,
            measure: Measure::default(),
            color: ColorSpace::default(),
            phases: Phase::COMBINING,
            squared_shares: SQUARED_SHARES,
            refinements: REFINEMENTS,
            precision,
            mip_maps: false,
            seed,
        };
        options.check()?;
        Ok(options)
    }

    /// Refuses what no fit can do.
    pub(super) fn check(&self) -> Result<(), TextureError> {
        let grid = self.grid;
        if !(1..=90).contains(&grid.rim_deg) {
            return Err(out_of_range("the last polar angle", f64::from(grid.rim_deg), "give 1 to 90 degrees"));
        }
        if let Some(&count) = [grid.alpha, grid.beta, grid.theta, grid.phi].iter().find(|n| !(1..=255).contains(*n)) {
            return Err(out_of_range("a side of the grid", count as f64, "give 1 to 255"));
        }
        if !(self.ridge > 0.0 && self.ridge.is_finite()) {
            return Err(out_of_range("the ridge", self.ridge, "give a number above 0"));
        }
        match self.aim {
            Aim::Threshold(t) if !(t >= 0.0 && t.is_finite()) => {
                Err(out_of_range("the threshold", t, "give 0 or more levels"))
            }
            Aim::Ratio(r) if !(r > 0.0 && r.is_finite()) => {
                Err(out_of_range("the ratio", r, "give raw over coded bytes, above 0"))
            }
            Aim::Entries(0) => Err(out_of_range("the number of items", 0.0, "give 1 or more")),
            _ => Ok(()),
        }
    }

    /// Thresholds of all books out of that of P4.
    pub(super) fn acceptance(&self, threshold: f64) -> Acceptance {
        match self.measure {
            Measure::Rmse => Acceptance {
                measure: self.measure,
                luma: std::array::from_fn(|k| threshold * self.squared_shares[k].sqrt()),
                chroma: std::array::from_fn(|k| {
                    let own = threshold * self.squared_shares[k + 5].sqrt();
                    if threshold > 0.0 { own.max(COLOR_THRESHOLDS[k]) } else { 0.0 }
                }),
            },
            Measure::Ssim => {
                let [_, row, color] = COLOR_THRESHOLDS;
                Acceptance {
                    measure: self.measure,
                    luma: [threshold / 100.0; 5],
                    chroma: [threshold / 100.0, row, color],
                }
            }
        }
    }
}

/// Texels in the order of a Halton sequence of bases 2 and 3, so that any start of it covers the tile evenly; what the sequence
/// has not met after a while follows row by row.
pub(super) fn progressive_order(width: usize, height: usize, seed: u64) -> Vec<usize> {
    let count = width * height;
    let mut met = vec![false; count];
    let first = seed % (1 << 32);
    let drawn = (first + 1..=first + 4 * count as u64).map(|i| {
        let at = |base: u64, side: usize| ((radical_inverse(i, base) * side as f64) as usize).min(side - 1);
        at(3, height) * width + at(2, width)
    });
    drawn.chain(0..count).filter(|&texel| !std::mem::replace(&mut met[texel], true)).collect()
}

/// The digits of `i` mirrored at the point.
pub(super) fn radical_inverse(mut i: u64, base: u64) -> f64 {
    let (mut value, mut place) = (0.0, 1.0);
    while i > 0 {
        place /= base as f64;
        value += place * (i % base) as f64;
        i /= base;
    }
    value
}

fn out_of_range(what: &str, value: f64, remedy: &str) -> TextureError {
    TextureError::Degenerate { fault: format!("{what} is {value}"), remedy: remedy.into() }
}
