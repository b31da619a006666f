//! Components, and how likely they are at the texels of a tile.
//!
//! Over a picture, light and view are fixed: `ln w − Σ ln σ − ½ Σ z²` of the four angles is one number per
//! component, its *energy*. Within a tile of texels the rest is bounded above by the nearest point of the tile
//! and of the box of its colours. What can nowhere in the tile come within `reach` of the best component is left
//! out, which changes no sum by more than `M · exp(−reach)` of itself.

use super::lanes::{LANES, Row, Vector};
use super::variables::{INPUTS, Period, VARIABLES};
use crate::btf::MixtureComponent;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// Rows of a tile; its columns are the lanes.
pub(super) const ROWS: usize = 8;

/// One number per texel of a tile.
pub(super) type Block = [Row; ROWS];

/// What padding is as likely as.
const NEVER: f32 = -1e30;

/// How far below the largest bound components are looked at first: they tell what the others must come near.
const FIRST_BANDS: [f32; 2] = [2.0, 8.0];

/// One product of Gaussians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Component {
    /// Of all components together 1.
    pub(super) weight: f64,
    pub(super) mean: [f64; VARIABLES],
    pub(super) sigma: [f64; VARIABLES],
}

/// Components side by side, padded to whole vectors by what is never likely.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Packed {
    /// Components without padding.
    pub(super) count: usize,
    /// Of x and y.
    pub(super) periods: [Period; 2],
    /// Per variable.
    pub(super) mean: [Vec<f32>; VARIABLES],
    /// √½ / σ: the square of a scaled difference is the exponent.
    pub(super) scale: [Vec<f32>; VARIABLES],
    /// `ln w − Σ ln (σ √2π)` over all variables.
    pub(super) joint: Vec<f32>,
    /// The same over the inputs.
    pub(super) input: Vec<f32>,
}

/// Texels of a tile, and their colours where they are evidence. Beyond the border the last texel is repeated.
#[derive(Clone, Debug)]
pub(super) struct Tile {
    /// First texel, x and y.
    pub(super) corner: [usize; 2],
    /// Rows and columns within the picture.
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) x: Row,
    pub(super) y: [f32; ROWS],
    /// Per channel, less the mean.
    pub(super) colour: [Block; 3],
    /// Of each channel.
    pub(super) low: [f32; 3],
    pub(super) high: [f32; 3],
}

/// The likely components of a tile.
#[derive(Clone, Debug, Default)]
pub(super) struct Likely {
    /// Upper bounds, per component.
    bound: Vec<f32>,
    /// Which.
    pub(super) list: Vec<u32>,
    /// Their densities, per texel, over the largest of the texel.
    pub(super) shares: Vec<Block>,
    /// Logarithm of the largest.
    pub(super) best: Block,
    /// Sum of the shares.
    pub(super) total: Block,
}

impl Packed {
    /// In `f32`, ready to be evaluated.
    pub(super) fn new(components: &[Component], periods: [Period; 2]) -> Self {
        let padding = components.len().next_multiple_of(LANES) - components.len();
        let padded = |value: &dyn Fn(&Component) -> f64, pad: f32| -> Vec<f32> {
            components.iter().map(|c| value(c) as f32).chain(std::iter::repeat_n(pad, padding)).collect()
        };
        let logarithm = |c: &Component, variables: usize| {
            c.weight.ln() - c.sigma[..variables].iter().map(|s| s.ln() + 0.5 * TAU.ln()).sum::<f64>()
        };
        Self {
            count: components.len(),
            periods,
            mean: std::array::from_fn(|v| padded(&|c| c.mean[v], 0.0)),
            scale: std::array::from_fn(|v| padded(&|c| FRAC_1_SQRT_2 / c.sigma[v], 0.0)),
            joint: padded(&|c| logarithm(c, VARIABLES), NEVER),
            input: padded(&|c| logarithm(c, INPUTS), NEVER),
        }
    }

    /// A component for its inputs.
    pub(super) fn component(&self, m: usize) -> MixtureComponent {
        MixtureComponent {
            mean: std::array::from_fn(|v| self.mean[v][m]),
            scale: std::array::from_fn(|v| self.scale[v][m]),
            color: std::array::from_fn(|c| self.mean[INPUTS + c][m]),
            bias: self.input[m],
        }
    }

    /// `bias − Σ z²/2` over the variables from `first` on, for all components.
    #[inline(always)]
    pub(super) fn energies<V: Vector>(&self, bias: &[f32], first: usize, at: &[f32], out: &mut Vec<f32>) {
        out.clear();
        out.extend_from_slice(bias);
        let out = out.as_chunks_mut::<LANES>().0;
        for (v, &value) in at.iter().enumerate() {
            let means = self.mean[first + v].as_chunks::<LANES>().0;
            let scales = self.scale[first + v].as_chunks::<LANES>().0;
            let value = V::splat(value);
            for g in 0..out.len() {
                let d = value.minus(V::load(&means[g])).times(V::load(&scales[g]));
                V::load(&out[g]).less_square(d).store(&mut out[g]);
            }
        }
    }
}

impl Tile {
    /// The tiles of a grid of texels.
    pub(super) fn all(x: &[f32], y: &[f32]) -> Vec<Self> {
        let corners = (0..y.len()).step_by(ROWS).flat_map(|j| (0..x.len()).step_by(LANES).map(move |i| [i, j]));
        corners.map(|corner| Self::at(corner, x, y)).collect()
    }

    fn at(corner: [usize; 2], x: &[f32], y: &[f32]) -> Self {
        let [i, j] = corner;
        Self {
            corner,
            rows: ROWS.min(y.len() - j),
            columns: LANES.min(x.len() - i),
            x: std::array::from_fn(|k| x[(i + k).min(x.len() - 1)]),
            y: std::array::from_fn(|k| y[(j + k).min(y.len() - 1)]),
            colour: [[[0.0; LANES]; ROWS]; 3],
            low: [0.0; 3],
            high: [0.0; 3],
        }
    }

    /// Takes the colours of a picture (y, x, channel), `width` texels wide, less the mean.
    pub(super) fn take_colours(&mut self, picture: &[f32], width: usize, mean: [f32; 3]) {
        (self.low, self.high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for row in 0..self.rows {
            let line = &picture[3 * ((self.corner[1] + row) * width + self.corner[0])..][..3 * self.columns];
            for k in 0..LANES {
                let at = 3 * k.min(self.columns - 1);
                for channel in 0..3 {
                    let value = line[at + channel] - mean[channel];
                    self.colour[channel][row][k] = value;
                    self.low[channel] = self.low[channel].min(value);
                    self.high[channel] = self.high[channel].max(value);
                }
            }
        }
    }

    /// The interval of each variable that differs within the tile, with the variable's number.
    fn intervals(&self, evidence: bool) -> impl Iterator<Item = (usize, f32, f32)> {
        let last = self.y[self.rows - 1];
        let place = [(0, self.x[0], self.x[LANES - 1]), (1, self.y[0], last)];
        let colour = [0, 1, 2].map(|channel| (INPUTS + channel, self.low[channel], self.high[channel]));
        place.into_iter().chain(colour).take(if evidence { 5 } else { 2 })
    }
}

impl Likely {
    /// Finds them. `energy` is of the angles; with `evidence` the tile's colours count, too.
    #[inline(always)]
    pub(super) fn find<V: Vector>(
        &mut self,
        mixture: &Packed,
        energy: &[f32],
        tile: &Tile,
        evidence: bool,
        reach: f32,
    ) {
        let top = self.bound_all::<V>(mixture, energy, tile, evidence);
        self.list.clear();
        self.best = [[f32::NEG_INFINITY; LANES]; ROWS];
        let mut above = f32::INFINITY;
        for band in FIRST_BANDS {
            let limit = (top - band).max(self.lowest_best::<V>(tile.rows) - reach);
            self.look_at::<V>(mixture, energy, tile, evidence, [limit, above]);
            above = limit.min(above);
        }
        let limit = self.lowest_best::<V>(tile.rows) - reach;
        self.look_at::<V>(mixture, energy, tile, evidence, [limit, above]);
        self.share_out::<V>(tile.rows);
    }

    /// Bounds all components over the tile; the largest bound.
    #[inline(always)]
    fn bound_all<V: Vector>(&mut self, mixture: &Packed, energy: &[f32], tile: &Tile, evidence: bool) -> f32 {
        self.bound.clear();
        self.bound.extend_from_slice(energy);
        let bounds = self.bound.as_chunks_mut::<LANES>().0;
        for (variable, low, high) in tile.intervals(evidence) {
            let period = mixture.periods.get(variable).copied().unwrap_or_default();
            let means = mixture.mean[variable].as_chunks::<LANES>().0;
            let scales = mixture.scale[variable].as_chunks::<LANES>().0;
            let (middle, half, nothing) = (V::splat(0.5 * (low + high)), V::splat(0.5 * (high - low)), V::splat(0.0));
            for g in 0..bounds.len() {
                let off = period.nearest(V::load(&means[g]).minus(middle));
                let outside = off.larger(nothing.minus(off)).minus(half).larger(nothing);
                V::load(&bounds[g]).less_square(outside.times(V::load(&scales[g]))).store(&mut bounds[g]);
            }
        }
        let mut top = V::splat(f32::NEG_INFINITY);
        for bound in bounds {
            top = top.larger(V::load(bound));
        }
        top.largest()
    }

    /// The least of the texels' best so far.
    #[inline(always)]
    fn lowest_best<V: Vector>(&self, rows: usize) -> f32 {
        let mut least = V::splat(f32::NEG_INFINITY);
        for row in &self.best[..rows] {
            least = least.larger(V::splat(0.0).minus(V::load(row)));
        }
        -least.largest()
    }

    /// Log densities of the components whose bound is in `[from, below)`.
    #[inline(always)]
    fn look_at<V: Vector>(
        &mut self,
        mixture: &Packed,
        energy: &[f32],
        tile: &Tile,
        evidence: bool,
        [from, below]: [f32; 2],
    ) {
        let from = from.max(0.5 * NEVER);
        for g in 0..self.bound.len() / LANES {
            let bounds = V::load(&self.bound.as_chunks::<LANES>().0[g]);
            let mut chosen = bounds.at_least(V::splat(from)) & !bounds.at_least(V::splat(below));
            while chosen != 0 {
                let component = g * LANES + chosen.trailing_zeros() as usize;
                chosen &= chosen - 1;
                self.look_at_one::<V>(mixture, component, energy[component], tile, evidence);
            }
        }
    }

    #[inline(always)]
    fn look_at_one<V: Vector>(&mut self, mixture: &Packed, component: usize, energy: f32, tile: &Tile, evidence: bool) {
        if self.shares.len() == self.list.len() {
            self.shares.push([[0.0; LANES]; ROWS]);
        }
        let out = &mut self.shares[self.list.len()];
        self.list.push(component as u32);
        let (mean, scale) = (|v: usize| mixture.mean[v][component], |v: usize| mixture.scale[v][component]);
        let [columns, rows] = mixture.periods;
        let across = columns.nearest(V::load(&tile.x).minus(V::splat(mean(0)))).times(V::splat(scale(0)));
        let base = V::splat(energy).less_square(across);
        for row in 0..tile.rows {
            base.less_square(V::splat(rows.nearest_of(tile.y[row] - mean(1)) * scale(1))).store(&mut out[row]);
        }
        if evidence {
            let means = [6, 7, 8].map(|v| V::splat(mean(v)));
            let scales = [6, 7, 8].map(|v| V::splat(scale(v)));
            for row in 0..tile.rows {
                let mut log = V::load(&out[row]);
                for c in 0..3 {
                    log = log.less_square(V::load(&tile.colour[c][row]).minus(means[c]).times(scales[c]));
                }
                log.store(&mut out[row]);
            }
        }
        for row in 0..tile.rows {
            V::load(&self.best[row]).larger(V::load(&out[row])).store(&mut self.best[row]);
        }
    }

    /// Logarithms become shares of the best.
    #[inline(always)]
    fn share_out<V: Vector>(&mut self, rows: usize) {
        self.total = [[0.0; LANES]; ROWS];
        for share in &mut self.shares[..self.list.len()] {
            for row in 0..rows {
                let e = V::load(&share[row]).minus(V::load(&self.best[row])).exp();
                e.store(&mut share[row]);
                V::load(&self.total[row]).plus(e).store(&mut self.total[row]);
            }
        }
    }
}
