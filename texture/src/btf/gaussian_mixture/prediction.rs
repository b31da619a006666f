//! The expected colour where place, light and eye are given: `Σ_m W_m μ_m`, W the components' shares of the inputs.
//!
//! Logarithms are shifted by their maximum, so far from all components the nearest answers and nothing is
//! ever 0/0. A whole picture leaves components out tile by tile; single samples go over all components, which takes
//! less time than to find out which matter.

use super::lanes::{LANES, Row, Vector, kernel};
use super::mixture::{Likely, Packed, Tile};
use super::variables::{Grid, INPUTS};
use rayon::prelude::*;

/// Components further below the best than this change an answer by less than the rounding of `f32`.
pub(super) const REACH: f32 = 18.0;

/// Vectors of logarithms kept at a time.
const BLOCK: usize = 64;

/// Places asked for at once: four of bilinear interpolation, sixteen of a wider footprint.
pub(super) const FEW: usize = 4;

/// Colours less the mean over a grid of texels, (y, x, channel), α and s of light and view given.
pub(super) fn picture(mixture: &Packed, x: &[f32], y: &[f32], angles: [f32; 4]) -> Vec<f32> {
    let mut out = vec![0.0; 3 * x.len() * y.len()];
    run_picture(mixture, &mut Tile::all(x, y), angles, x.len(), &mut out);
    out
}

kernel! {
    /// Fills `out`, `width` texels wide.
    fn run_picture(mixture: &Packed, tiles: &mut [Tile], angles: [f32; 4], width: usize, out: &mut [f32]) = picture_with
}

#[inline(always)]
fn picture_with<V: Vector>(mixture: &Packed, tiles: &mut [Tile], angles: [f32; 4], width: usize, out: &mut [f32]) {
    let (mut likely, mut energy) = (Likely::default(), Vec::new());
    mixture.energies::<V>(&mixture.input, 2, &angles, &mut energy);
    for tile in tiles {
        likely.find::<V>(mixture, &energy, tile, false, REACH);
        for row in 0..tile.rows {
            let colours = mixed::<V>(mixture, &likely, row);
            let at = 3 * ((tile.corner[1] + row) * width + tile.corner[0]);
            for (k, texel) in out[at..at + 3 * tile.columns].chunks_exact_mut(3).enumerate() {
                for c in 0..3 {
                    texel[c] = colours[c][k];
                }
            }
        }
    }
}

/// The colours of one row of a tile.
#[inline(always)]
fn mixed<V: Vector>(mixture: &Packed, likely: &Likely, row: usize) -> [Row; 3] {
    let mut sums = [V::splat(0.0); 3];
    for (&component, share) in likely.list.iter().zip(&likely.shares) {
        let share = V::load(&share[row]);
        for c in 0..3 {
            sums[c] = share.times_plus(V::splat(mixture.mean[INPUTS + c][component as usize]), sums[c]);
        }
    }
    let mut colours = [[0.0; LANES]; 3];
    for c in 0..3 {
        sums[c].store(&mut colours[c]);
        for k in 0..LANES {
            colours[c][k] /= likely.total[row][k];
        }
    }
    colours
}

kernel! {
    /// Colours less the mean of up to [`FEW`] places under one light and view: one of `out` for each of `places`, as long
    /// as both last.
    fn few(mixture: &Packed, angles: [f32; 4], places: &[[f32; 2]], out: &mut [[f32; 3]]) = few_with
}

#[inline(always)]
pub(super) fn few_with<V: Vector>(mixture: &Packed, angles: [f32; 4], places: &[[f32; 2]], out: &mut [[f32; 3]]) {
    let (mut energies, mut logs) = ([[0.0; LANES]; BLOCK], [[0.0; LANES]; BLOCK]);
    let mut answers = [Answer::<V>::none(); FEW];
    let vectors = mixture.input.len() / LANES;
    for first in (0..vectors).step_by(BLOCK) {
        let block = first..vectors.min(first + BLOCK);
        let (energies, logs) = (&mut energies[..block.len()], &mut logs[..block.len()]);
        angular::<V>(mixture, angles, first, energies);
        for (answer, &place) in answers.iter_mut().zip(places) {
            let top = at_place::<V>(mixture, energies, place, first, logs);
            answer.take(mixture, logs, top, first);
        }
    }
    for ((out, answer), _) in out.iter_mut().zip(&answers).zip(places) {
        *out = answer.colour();
    }
}

/// `ln w − Σ ln σ − ½ Σ z²` over the angles, of the vectors of components from `first` on.
#[inline(always)]
fn angular<V: Vector>(mixture: &Packed, angles: [f32; 4], first: usize, out: &mut [Row]) {
    let count = out.len();
    out.copy_from_slice(&mixture.input.as_chunks::<LANES>().0[first..][..count]);
    for (v, angle) in angles.into_iter().enumerate() {
        let (means, scales) = of_block(mixture, 2 + v, first, count);
        for ((out, mean), scale) in out.iter_mut().zip(means).zip(scales) {
            V::load(out).less_square(V::splat(angle).minus(V::load(mean)).times(V::load(scale))).store(out);
        }
    }
}

/// Log densities of all inputs where `energies` has what the angles say; the largest.
#[inline(always)]
fn at_place<V: Vector>(mixture: &Packed, energies: &[Row], place: [f32; 2], first: usize, out: &mut [Row]) -> f32 {
    let [x, y] = place.map(V::splat);
    let [(mean_x, scale_x), (mean_y, scale_y)] = [0, 1].map(|v| of_block(mixture, v, first, energies.len()));
    let mut top = V::splat(f32::NEG_INFINITY);
    for (g, (out, energy)) in out.iter_mut().zip(energies).enumerate() {
        let across = x.minus(V::load(&mean_x[g])).times(V::load(&scale_x[g]));
        let down = y.minus(V::load(&mean_y[g])).times(V::load(&scale_y[g]));
        let log = V::load(energy).less_square(across).less_square(down);
        log.store(out);
        top = top.larger(log);
    }
    top.largest()
}

/// Means and scales of a variable, of `count` vectors of components from `first` on.
fn of_block(mixture: &Packed, variable: usize, first: usize, count: usize) -> (&[Row], &[Row]) {
    let [means, scales] = [&mixture.mean, &mixture.scale].map(|all| all[variable].as_chunks::<LANES>().0);
    (&means[first..][..count], &scales[first..][..count])
}

/// Sums over components as far as they were looked at.
#[derive(Clone, Copy)]
struct Answer<V> {
    /// The largest logarithm so far: all sums are over its exponential.
    best: f32,
    /// Of shares times red, green, blue, and of shares.
    sums: [V; 4],
}

impl<V: Vector> Answer<V> {
    #[inline(always)]
    fn none() -> Self {
        Self { best: f32::NEG_INFINITY, sums: [V::splat(0.0); 4] }
    }

    /// Takes the vectors of components from `first` on in, of logarithms up to `top`.
    #[inline(always)]
    fn take(&mut self, mixture: &Packed, logs: &[Row], top: f32, first: usize) {
        self.raise(top);
        let colours = [0, 1, 2].map(|c| &mixture.mean[INPUTS + c].as_chunks::<LANES>().0[first..][..logs.len()]);
        // In registers, not behind a reference.
        let mut sums = self.sums;
        for (g, log) in logs.iter().enumerate() {
            let log = V::load(log).minus(V::splat(self.best));
            if log.at_least(V::splat(-REACH)) == 0 {
                continue;
            }
            let share = log.exp();
            sums[3] = sums[3].plus(share);
            for c in 0..3 {
                sums[c] = share.times_plus(V::load(&colours[c][g]), sums[c]);
            }
        }
        self.sums = sums;
    }

    /// Sums over the exponential of a larger logarithm.
    #[inline(always)]
    fn raise(&mut self, top: f32) {
        if top > self.best {
            let factor = V::splat(if self.best == f32::NEG_INFINITY { 0.0 } else { (self.best - top).exp() });
            self.sums = self.sums.map(|sum| sum.times(factor));
            self.best = top;
        }
    }

    #[inline(always)]
    fn colour(&self) -> [f32; 3] {
        let total = self.sums[3].sum();
        [0, 1, 2].map(|c| self.sums[c].sum() / total)
    }
}

/// Mean squared difference between the pictures of `pairs` and what is expected of them, encoded units.
pub(super) fn mean_square_error(grid: &Grid<'_>, mixture: &Packed, pairs: &[u32]) -> f64 {
    let of_pair = |&pair: &u32| {
        let pair = pair as usize;
        let expected = picture(mixture, &grid.x, &grid.y, grid.angles(pair));
        let mean = grid.mean_colour(pair);
        let differences = grid.picture(pair).iter().zip(&expected).enumerate();
        differences.map(|(i, (measured, e))| f64::from(measured - (mean[i % 3] + e)).powi(2)).sum::<f64>()
    };
    let sums: Vec<f64> = pairs.par_iter().map(of_pair).collect();
    sums.iter().sum::<f64>() / (3 * grid.texels() * pairs.len().max(1)) as f64
}
