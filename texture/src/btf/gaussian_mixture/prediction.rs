//! The expected colour where place, light and eye are given: `Σ_m W_m μ_m`, W the components' shares of the inputs.
//!
//! Components are products, so a share is one too: `W_m ∝ L_m · X_m · Y_m`, L of light and eye, with the weight, X of
//! the column and Y of the row. X and Y are kept for a tile; L, an exponential a component, is found once for texels
//! asked for together and once for a whole picture. What is left is two products and four sums a component and texel.
//!
//! L goes from 1 down to e⁻⁶⁰, X and Y to e⁻⁴⁰, and 0 stands below; both are raised by e³⁰, so that no product is a
//! denormal number. Where the sum is more than e⁻²² without that, what was left out is less than `M · e⁻¹⁸` of it.
//! Elsewhere, far from all components that light and eye make likely, logarithms are shifted by the largest: the
//! nearest answer and nothing is ever 0/0.

use super::lanes::{LANES, Row, Vector, kernel};
use super::mixture::Packed;
use super::variables::{Grid, INPUTS};
use rayon::prelude::*;
use std::sync::OnceLock;

/// Logarithm of what shares of a column, and of a row, are raised by.
const RAISED: f32 = 30.0;

/// Exponents from which on the share of a column, or of a row, is 0.
const FAR: f32 = 40.0;

/// Sum of raised shares below which too much may have been left out: `exp(2 RAISED − FAR + 18)`.
const ENOUGH: f32 = 3.185_593e16;

/// Vectors of components of which shares are kept on the stack: 640 components.
const ON_STACK: usize = 40;

/// Places asked for at once: those of bilinear interpolation; a wider footprint has up to sixteen.
pub(super) const FEW: usize = 4;

/// Shares of x and of y at a place.
pub(super) type Place<'a> = [&'a Along; 2];

/// Components' shares at a place along an axis.
#[derive(Clone, Debug)]
pub(super) struct Along {
    place: f32,
    /// `exp(RAISED − ((place − mean) · scale)²)`, or 0.
    shares: Vec<Row>,
}

impl Along {
    pub(super) fn at(mixture: &Packed, axis: usize, place: f32) -> Self {
        let [means, scales] = [&mixture.mean, &mixture.scale].map(|all| all[axis].as_chunks::<LANES>().0);
        let share = |mean: f32, scale: f32| {
            let exponent = (mixture.periods[axis].nearest_of(place - mean) * scale).powi(2);
            if exponent < FAR { (RAISED - exponent).exp() } else { 0.0 }
        };
        let row = |(mean, scale): (&Row, &Row)| std::array::from_fn(|k| share(mean[k], scale[k]));
        Self { place, shares: means.iter().zip(scales).map(row).collect() }
    }
}

/// Columns and rows, their shares found when they are first asked for: at most 4 bytes for each component and each of them.
#[derive(Clone, Debug)]
pub(super) struct Places {
    /// x and y, texels.
    centres: [Vec<f32>; 2],
    along: [Vec<OnceLock<Along>>; 2],
}

impl Places {
    /// Of columns and rows with these middles.
    pub(super) fn of(centres: [Vec<f32>; 2]) -> Self {
        let along = centres.each_ref().map(|axis| vec![OnceLock::new(); axis.len()]);
        Self { centres, along }
    }

    /// Of the middle of the texel in a column and row.
    pub(super) fn at(&self, mixture: &Packed, texel: [usize; 2]) -> Place<'_> {
        [0, 1].map(|axis| {
            let k = texel[axis];
            self.along[axis][k].get_or_init(|| Along::at(mixture, axis, self.centres[axis][k]))
        })
    }
}

/// What follows from components and size makes no codec another one.
impl PartialEq for Places {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// Colours less the mean of all places, (y, x, channel), α and s of light and view given.
pub(super) fn picture(mixture: &Packed, places: &Places, angles: [f32; 4]) -> Vec<f32> {
    let [width, height] = places.centres.each_ref().map(Vec::len);
    let mut out = vec![[0.0; 3]; width * height];
    run_picture(mixture, angles, places, &mut out);
    out.into_flattened()
}

kernel! {
    /// Fills `out`.
    fn run_picture(mixture: &Packed, angles: [f32; 4], places: &Places, out: &mut [[f32; 3]]) = picture_with
}

kernel! {
    /// Colours less the mean of a place under one light and view.
    fn one(mixture: &Packed, angles: [f32; 4], places: &[Place<'_>; 1]) -> [[f32; 3]; 1] = together, 1
}

kernel! {
    /// The same of some places, as they answer alone.
    fn few(mixture: &Packed, angles: [f32; 4], places: &[Place<'_>; FEW]) -> [[f32; 3]; FEW] = together, FEW
}

#[inline(always)]
fn picture_with<V: Vector>(mixture: &Packed, angles: [f32; 4], places: &Places, out: &mut [[f32; 3]]) {
    let width = places.centres[0].len();
    let mut lit = vec![[0.0; LANES]; mixture.input.len() / LANES];
    shares_of_angles::<V>(mixture, angles, &mut lit);
    for (row, line) in out.chunks_mut(width.max(1)).enumerate() {
        for first in (0..width).step_by(FEW) {
            let mut together = [places.at(mixture, [first, row]); FEW];
            for k in 1..FEW.min(width - first) {
                together[k] = places.at(mixture, [first + k, row]);
            }
            let found = colours::<V, FEW>(mixture, &lit, angles, &together);
            for (texel, colour) in line[first..].iter_mut().zip(found) {
                *texel = colour;
            }
        }
    }
}

#[inline(always)]
pub(super) fn together<V: Vector, const N: usize>(
    mixture: &Packed,
    angles: [f32; 4],
    places: &[Place<'_>; N],
) -> [[f32; 3]; N] {
    let vectors = mixture.input.len() / LANES;
    let (mut near, mut far) = ([[0.0; LANES]; ON_STACK], Vec::new());
    let lit = if vectors <= ON_STACK {
        &mut near[..vectors]
    } else {
        far.resize(vectors, [0.0; LANES]);
        &mut far
    };
    shares_of_angles::<V>(mixture, angles, lit);
    colours::<V, N>(mixture, lit, angles, places)
}

/// Components' densities of the angles, with their weights, over the largest.
#[inline(always)]
fn shares_of_angles<V: Vector>(mixture: &Packed, angles: [f32; 4], out: &mut [Row]) {
    let bias = of_vectors(&mixture.input, out.len());
    let mean = [2, 3, 4, 5].map(|v| of_vectors(&mixture.mean[v], out.len()));
    let scale = [2, 3, 4, 5].map(|v| of_vectors(&mixture.scale[v], out.len()));
    let mut top = V::splat(f32::NEG_INFINITY);
    for (g, out) in out.iter_mut().enumerate() {
        let mut energy = V::load(&bias[g]);
        for v in 0..4 {
            let off = V::splat(angles[v]).minus(V::load(&mean[v][g]));
            energy = energy.less_square(off.times(V::load(&scale[v][g])));
        }
        energy.store(out);
        top = top.larger(energy);
    }
    let top = V::splat(top.largest());
    for out in out {
        V::load(out).minus(top).exp().store(out);
    }
}

/// `count` vectors.
fn of_vectors(all: &[f32], count: usize) -> &[Row] {
    &all.as_chunks().0[..count]
}

/// Colours less the mean, components' shares of the angles given.
#[inline(always)]
fn colours<V: Vector, const N: usize>(
    mixture: &Packed,
    lit: &[Row],
    angles: [f32; 4],
    places: &[Place<'_>; N],
) -> [[f32; 3]; N] {
    let shares: [[&[Row]; 2]; N] = std::array::from_fn(|p| places[p].map(|along| &along.shares[..lit.len()]));
    let means = [0, 1, 2].map(|c| of_vectors(&mixture.mean[INPUTS + c], lit.len()));
    // Of shares times red, green, blue, and of shares. Loops, for closures would not be compiled into the kernel.
    let mut sums = [[V::splat(0.0); 4]; N];
    for g in 0..lit.len() {
        let lit = V::load(&lit[g]);
        for p in 0..N {
            let [across, down] = shares[p];
            let share = lit.times(V::load(&across[g])).times(V::load(&down[g]));
            sums[p][3] = sums[p][3].plus(share);
            for c in 0..3 {
                sums[p][c] = share.times_plus(V::load(&means[c][g]), sums[p][c]);
            }
        }
    }
    let mut colours = [[0.0; 3]; N];
    for p in 0..N {
        let total = sums[p][3].sum();
        if total < ENOUGH {
            colours[p] = by_logarithms(mixture, angles, &places[p]);
            continue;
        }
        for c in 0..3 {
            colours[p][c] = sums[p][c].sum() / total;
        }
    }
    colours
}

/// The same as far from all components as may be.
#[cold]
fn by_logarithms(mixture: &Packed, angles: [f32; 4], place: &Place<'_>) -> [f32; 3] {
    let log = |m: usize| {
        let place = [0, 1].map(|axis| mixture.periods[axis].nearest_of(place[axis].place - mixture.mean[axis][m]));
        let angles = [0, 1, 2, 3].map(|k| angles[k] - mixture.mean[2 + k][m]);
        let offs = place.into_iter().chain(angles).enumerate();
        mixture.input[m] - offs.map(|(v, off)| (off * mixture.scale[v][m]).powi(2)).sum::<f32>()
    };
    let logs: Vec<f32> = (0..mixture.count).map(log).collect();
    let best = logs.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let mut sums = [0.0; 4];
    for (m, log) in logs.iter().enumerate() {
        let share = (log - best).exp();
        sums[3] += share;
        (0..3).for_each(|c| sums[c] += share * mixture.mean[INPUTS + c][m]);
    }
    [0, 1, 2].map(|c| sums[c] / sums[3])
}

/// Mean squared difference between the pictures of `pairs` and what is expected of them, encoded units.
pub(super) fn mean_square_error(grid: &Grid<'_>, mixture: &Packed, pairs: &[u32]) -> f64 {
    let places = Places::of([grid.x.clone(), grid.y.clone()]);
    let of_pair = |&pair: &u32| {
        let pair = pair as usize;
        let expected = picture(mixture, &places, grid.angles(pair));
        let mean = grid.mean_colour(pair);
        let differences = grid.picture(pair).iter().zip(&expected).enumerate();
        differences.map(|(i, (measured, e))| f64::from(measured - (mean[i % 3] + e)).powi(2)).sum::<f64>()
    };
    let sums: Vec<f64> = pairs.par_iter().map(of_pair).collect();
    sums.iter().sum::<f64>() / (3 * grid.texels() * pairs.len().max(1)) as f64
}
