//! The expected colour where place, light and eye are given: `Σ_m W_m μ_m`, W the components' shares of the inputs.
//!
//! Logarithms are shifted by their maximum, so far from all components the nearest answers and nothing is
//! ever 0/0. A whole picture leaves components out tile by tile; single samples go over all components, which takes
//! less time than to find out which matter.

use super::lanes::{LANES, Row, Vector, kernel};
use super::mixture::{Likely, Packed, Tile};
use super::variables::{Grid, INPUTS};
use rayon::prelude::*;
use std::sync::OnceLock;

/// Components further below the best than this change an answer by less than the rounding of `f32`.
pub(super) const REACH: f32 = 18.0;

/// Vectors of components whose logarithms are kept at a time: 640 components.
const BLOCK: usize = 40;

/// Places asked for at once: those of bilinear interpolation; a wider footprint has up to sixteen.
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

/// Exponents of x and of y at a place, per component.
pub(super) type Place<'a> = [&'a [Row]; 2];

/// Exponents of an axis, `((place − mean) · scale)²`, per component.
pub(super) fn exponents(mixture: &Packed, axis: usize, place: f32) -> Vec<Row> {
    let [means, scales] = [&mixture.mean, &mixture.scale].map(|all| all[axis].as_chunks::<LANES>().0);
    let exponent = |mean: f32, scale: f32| (mixture.periods[axis].nearest_of(place - mean) * scale).powi(2);
    let row = |(mean, scale): (&Row, &Row)| std::array::from_fn(|k| exponent(mean[k], scale[k]));
    means.iter().zip(scales).map(row).collect()
}

/// Exponents of each column and row of a tile, found when they are first asked for: at most 4 bytes for each component
/// and each of them.
#[derive(Clone, Debug)]
pub(super) struct Exponents {
    along: [Vec<OnceLock<Vec<Row>>>; 2],
}

impl Exponents {
    /// Of a tile of `size` (columns, rows) texels.
    pub(super) fn of(size: [usize; 2]) -> Self {
        Self { along: size.map(|side| vec![OnceLock::new(); side]) }
    }

    /// Of the middle of the texel in a column and row.
    pub(super) fn at(&self, mixture: &Packed, texel: [usize; 2]) -> Place<'_> {
        [0, 1].map(|axis| {
            let found = &self.along[axis][texel[axis]];
            found.get_or_init(|| exponents(mixture, axis, texel[axis] as f32 + 0.5)).as_slice()
        })
    }
}

/// What follows from components and size makes no codec another one.
impl PartialEq for Exponents {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

kernel! {
    /// Colours less the mean of a place under one light and view.
    fn one(mixture: &Packed, angles: [f32; 4], places: &[Place<'_>; 1]) -> [[f32; 3]; 1] = together, 1
}

kernel! {
    /// The same of some places: a vector of components is loaded once for all, and left out where it matters to none.
    fn few(mixture: &Packed, angles: [f32; 4], places: &[Place<'_>; FEW]) -> [[f32; 3]; FEW] = together, FEW
}

#[inline(always)]
pub(super) fn together<V: Vector, const N: usize>(
    mixture: &Packed,
    angles: [f32; 4],
    places: &[Place<'_>; N],
) -> [[f32; 3]; N] {
    let mut logs = [[[0.0; LANES]; N]; BLOCK];
    let mut sums = Sums::<V, N>::none();
    let vectors = mixture.input.len() / LANES;
    for first in (0..vectors).step_by(BLOCK) {
        let logs = &mut logs[..BLOCK.min(vectors - first)];
        let tops = log_densities::<V, N>(mixture, angles, places, first, logs);
        sums.take(mixture, logs, tops, first);
    }
    sums.colours()
}

/// Log densities of all inputs, of the vectors of components from `first` on; the largest of each place.
#[inline(always)]
fn log_densities<V: Vector, const N: usize>(
    mixture: &Packed,
    angles: [f32; 4],
    places: &[Place<'_>; N],
    first: usize,
    out: &mut [[Row; N]],
) -> [f32; N] {
    let count = out.len();
    let bias = of_block(&mixture.input, first, count);
    let mean = [2, 3, 4, 5].map(|v| of_block(&mixture.mean[v], first, count));
    let scale = [2, 3, 4, 5].map(|v| of_block(&mixture.scale[v], first, count));
    let mut tops = [V::splat(f32::NEG_INFINITY); N];
    for (g, out) in out.iter_mut().enumerate() {
        let mut energy = V::load(&bias[g]);
        for (v, angle) in angles.into_iter().enumerate() {
            let off = V::splat(angle).minus(V::load(&mean[v][g]));
            energy = energy.less_square(off.times(V::load(&scale[v][g])));
        }
        for p in 0..N {
            let [across, down] = places[p].map(|squares| &squares[first + g]);
            let log = energy.minus(V::load(across)).minus(V::load(down));
            log.store(&mut out[p]);
            tops[p] = tops[p].larger(log);
        }
    }
    let mut largest = [0.0; N];
    for p in 0..N {
        largest[p] = tops[p].largest();
    }
    largest
}

/// `count` vectors from `first` on.
fn of_block(all: &[f32], first: usize, count: usize) -> &[Row] {
    &all.as_chunks().0[first..][..count]
}

/// Sums over components as far as they were looked at, per place.
///
/// Loops, not closures, for those would not be compiled into the kernel.
struct Sums<V, const N: usize> {
    /// The largest logarithm so far: all sums are over its exponential.
    best: [f32; N],
    /// Of shares times red, green, blue, and of shares.
    of: [[V; 4]; N],
}

impl<V: Vector, const N: usize> Sums<V, N> {
    #[inline(always)]
    fn none() -> Self {
        Self { best: [f32::NEG_INFINITY; N], of: [[V::splat(0.0); 4]; N] }
    }

    /// Takes the vectors of components from `first` on in, of logarithms up to `tops`.
    #[inline(always)]
    fn take(&mut self, mixture: &Packed, logs: &[[Row; N]], tops: [f32; N], first: usize) {
        self.raise(tops);
        let colours = [0, 1, 2].map(|c| of_block(&mixture.mean[INPUTS + c], first, logs.len()));
        let reach = V::splat(-REACH);
        // In registers, not behind a reference.
        let mut sums = self.of;
        for (g, logs) in logs.iter().enumerate() {
            let (mut below, mut nearest) = ([reach; N], V::splat(f32::NEG_INFINITY));
            for p in 0..N {
                below[p] = V::load(&logs[p]).minus(V::splat(self.best[p]));
                nearest = nearest.larger(below[p]);
            }
            if nearest.at_least(reach) == 0 {
                continue;
            }
            for p in 0..N {
                // Nothing where it does not matter to this place: answers do not depend on what is asked for with it.
                let share = below[p].exp().where_at_least(below[p], reach);
                sums[p][3] = sums[p][3].plus(share);
                for c in 0..3 {
                    sums[p][c] = share.times_plus(V::load(&colours[c][g]), sums[p][c]);
                }
            }
        }
        self.of = sums;
    }

    /// Sums over the exponentials of larger logarithms.
    #[inline(always)]
    fn raise(&mut self, tops: [f32; N]) {
        for ((best, sums), top) in self.best.iter_mut().zip(&mut self.of).zip(tops) {
            if top > *best {
                let factor = V::splat(if *best == f32::NEG_INFINITY { 0.0 } else { (*best - top).exp() });
                for sum in sums {
                    *sum = sum.times(factor);
                }
                *best = top;
            }
        }
    }

    #[inline(always)]
    fn colours(&self) -> [[f32; 3]; N] {
        let mut colours = [[0.0; 3]; N];
        for (colour, sums) in colours.iter_mut().zip(&self.of) {
            let total = sums[3].sum();
            for c in 0..3 {
                colour[c] = sums[c].sum() / total;
            }
        }
        colours
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
