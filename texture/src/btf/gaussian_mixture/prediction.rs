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
    /// Colour less the mean for one place, light and view.
    fn one(mixture: &Packed, at: [f32; INPUTS]) -> [f32; 3] = one_with
}

#[inline(always)]
pub(super) fn one_with<V: Vector>(mixture: &Packed, at: [f32; INPUTS]) -> [f32; 3] {
    let mut logs = [[0.0; LANES]; BLOCK];
    let mut sums = [V::splat(0.0); 4];
    let mut best = f32::NEG_INFINITY;
    let vectors = mixture.input.len() / LANES;
    for first in (0..vectors).step_by(BLOCK) {
        let count = BLOCK.min(vectors - first);
        let top = logarithms::<V>(mixture, at, first, &mut logs[..count]);
        if top > best {
            let factor = V::splat(if best == f32::NEG_INFINITY { 0.0 } else { (best - top).exp() });
            for sum in &mut sums {
                *sum = sum.times(factor);
            }
            best = top;
        }
        for (g, logs) in logs[..count].iter().enumerate() {
            let log = V::load(logs).minus(V::splat(best));
            if log.at_least(V::splat(-REACH)) == 0 {
                continue;
            }
            let share = log.exp();
            sums[3] = sums[3].plus(share);
            for c in 0..3 {
                let means = mixture.mean[INPUTS + c].as_chunks::<LANES>().0;
                sums[c] = share.times_plus(V::load(&means[first + g]), sums[c]);
            }
        }
    }
    let total = sums[3].sum();
    [sums[0].sum() / total, sums[1].sum() / total, sums[2].sum() / total]
}

/// Log densities of the inputs, of the vectors of components from `first` on; the largest.
#[inline(always)]
fn logarithms<V: Vector>(mixture: &Packed, at: [f32; INPUTS], first: usize, out: &mut [Row]) -> f32 {
    let mut top = V::splat(f32::NEG_INFINITY);
    for (g, out) in out.iter_mut().enumerate() {
        let mut log = V::load(&mixture.input.as_chunks::<LANES>().0[first + g]);
        for v in 0..INPUTS {
            let mean = V::load(&mixture.mean[v].as_chunks::<LANES>().0[first + g]);
            let scale = V::load(&mixture.scale[v].as_chunks::<LANES>().0[first + g]);
            log = log.less_square(V::splat(at[v]).minus(mean).times(scale));
        }
        log.store(out);
        top = top.larger(log);
    }
    top.largest()
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
