//! Colours of components by least squares: `min Σ ‖c − Σ_m W_m μ_m‖²` over all samples, W kept.
//!
//! EM maximises the density of inputs and colours together, not the error of what is expected; the same number of bytes can only
//! answer better afterwards. The normal matrix `Σ W Wᵀ` is summed in `f64`, M × M, from dense products over
//! the likely components of each tile; conjugate gradients start at the means that EM found, with a ridge upon
//! the change, so that the squared error of the data can only fall.

use super::expectation::add_all;
use super::lanes::{LANES, Row, Vector, kernel};
use super::mixture::{Component, Likely, Packed, ROWS, Tile};
use super::variables::{Grid, INPUTS, VARIABLES};
use rayon::prelude::*;

/// Components further below the best are left out of a tile: products grow with the square of their number, and
/// these change shares by less than `M · exp(−12)`.
const REACH: f32 = 12.0;
/// Parts the pictures are dealt into; each holds a matrix.
const PARTS: usize = 4;
/// Of the mean of the diagonal, put upon it.
const RIDGES: [f64; 5] = [1e-5, 1e-4, 1e-3, 1e-2, 0.1];
/// Colours less the mean that leave 0 to 1 by far are differences of components that are hardly told apart: they gain
/// nothing and do not bear rounding.
pub(super) const LARGEST_COLOUR: f64 = 2.0;
/// Rounds of conjugate gradients at most.
const ROUNDS: usize = 500;
/// Rows of the product computed together.
const STRIP: usize = 4;

/// The normal equations of all three channels.
#[derive(Clone, Debug)]
pub(super) struct Normal {
    count: usize,
    /// `Σ W_a W_b`, lower triangle, row by row of `count`.
    matrix: Vec<f64>,
    /// `Σ W_m c`, per channel.
    right: [Vec<f64>; 3],
}

impl Normal {
    fn none(count: usize) -> Self {
        Self { count, matrix: vec![0.0; count * count], right: std::array::from_fn(|_| vec![0.0; count]) }
    }

    fn add(&mut self, other: &Self) {
        add_all(&mut self.matrix, &other.matrix);
        self.right.iter_mut().zip(&other.right).for_each(|(a, b)| add_all(a, b));
    }

    /// The sums over the pictures of `pairs`.
    pub(super) fn of(grid: &Grid<'_>, mixture: &Packed, pairs: &[u32]) -> Self {
        let part = |pairs: &[u32]| {
            let mut normal = Self::none(mixture.count);
            run(grid, mixture, pairs, &mut normal);
            normal
        };
        let parts: Vec<Self> = pairs.par_chunks(pairs.len().div_ceil(PARTS).max(1)).map(part).collect();
        let mut sum = Self::none(mixture.count);
        parts.iter().for_each(|part| sum.add(part));
        sum
    }

    /// The colours of one channel, from a first guess, with the first ridge that keeps them within bounds.
    pub(super) fn solve(&self, channel: usize, guess: &[f64]) -> Vec<f64> {
        let n = self.count;
        let diagonal = (0..n).map(|m| self.matrix[m * n + m]).sum::<f64>() / n as f64;
        let bounded = |colours: &Vec<f64>| colours.iter().all(|c| c.abs() <= LARGEST_COLOUR);
        let found = RIDGES.iter().map(|ridge| self.solve_with(ridge * diagonal, channel, guess)).find(bounded);
        found.unwrap_or_else(|| guess.to_vec())
    }

    fn solve_with(&self, ridge: f64, channel: usize, guess: &[f64]) -> Vec<f64> {
        let n = self.count;
        let (mut change, mut residual) = (vec![0.0; n], self.right[channel].clone());
        residual.iter_mut().zip(self.times(guess, 0.0)).for_each(|(r, p)| *r -= p);
        let (mut direction, mut square) = (residual.clone(), dot(&residual, &residual));
        let enough = 1e-20 * square;
        for _ in 0..ROUNDS {
            let product = self.times(&direction, ridge);
            let curvature = dot(&direction, &product);
            if square <= enough || curvature <= 0.0 {
                break;
            }
            let step = square / curvature;
            change.iter_mut().zip(&direction).for_each(|(c, d)| *c += step * d);
            residual.iter_mut().zip(&product).for_each(|(r, p)| *r -= step * p);
            let before = std::mem::replace(&mut square, dot(&residual, &residual));
            direction.iter_mut().zip(&residual).for_each(|(d, r)| *d = r + square / before * *d);
        }
        guess.iter().zip(&change).map(|(g, c)| g + c).collect()
    }

    /// Matrix plus ridge times a vector.
    fn times(&self, vector: &[f64], ridge: f64) -> Vec<f64> {
        let n = self.count;
        let mut product: Vec<f64> = vector.iter().map(|v| ridge * v).collect();
        for a in 0..n {
            let row = &self.matrix[a * n..][..a];
            product[a] += dot(row, vector) + self.matrix[a * n + a] * vector[a];
            let value = vector[a];
            product.iter_mut().zip(row).for_each(|(p, r)| *p += r * value);
        }
        product
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

kernel! {
    /// Adds the pictures of `pairs`.
    fn run(grid: &Grid<'_>, mixture: &Packed, pairs: &[u32], to: &mut Normal) = gather
}

/// Shares of the likely components of a tile, sample by sample.
#[derive(Default)]
struct BySample {
    /// Vectors of components a sample, padding included.
    groups: usize,
    /// (sample, component).
    shares: Vec<Row>,
    /// Products of this tile, (component, component).
    products: Vec<Row>,
}

#[inline(always)]
fn gather<V: Vector>(grid: &Grid<'_>, mixture: &Packed, pairs: &[u32], to: &mut Normal) {
    let mut tiles = Tile::all(&grid.x, &grid.y);
    let (mut likely, mut by_sample, mut energy) = (Likely::default(), BySample::default(), Vec::new());
    for &pair in pairs {
        let pair = pair as usize;
        mixture.energies::<V>(&mixture.input, 2, &grid.angles(pair), &mut energy);
        for tile in &mut tiles {
            tile.take_colours(grid.picture(pair), grid.x.len(), grid.mean_colour(pair));
            likely.find::<V>(mixture, &energy, tile, false, REACH);
            add_right::<V>(&mut likely, tile, to);
            by_sample.take(&likely, tile);
            by_sample.multiply::<V>();
            by_sample.add_to(&likely.list, to);
        }
    }
}

/// Normalises the shares, 0 beyond the border, and adds their products with the colours.
#[inline(always)]
fn add_right<V: Vector>(likely: &mut Likely, tile: &Tile, to: &mut Normal) {
    for row in 0..tile.rows {
        for k in 0..LANES {
            let total = likely.total[row][k];
            likely.total[row][k] = if k < tile.columns { 1.0 / total } else { 0.0 };
        }
    }
    for (&component, share) in likely.list.iter().zip(&mut likely.shares) {
        let mut sums = [V::splat(0.0); 3];
        for row in 0..tile.rows {
            let w = V::load(&share[row]).times(V::load(&likely.total[row]));
            w.store(&mut share[row]);
            for c in 0..3 {
                sums[c] = w.times_plus(V::load(&tile.colour[c][row]), sums[c]);
            }
        }
        for c in 0..3 {
            to.right[c][component as usize] += f64::from(sums[c].sum());
        }
    }
}

impl BySample {
    fn take(&mut self, likely: &Likely, tile: &Tile) {
        self.groups = likely.list.len().div_ceil(LANES);
        self.shares.clear();
        self.shares.resize(tile.rows * LANES * self.groups, [0.0; LANES]);
        let flat = self.shares.as_flattened_mut();
        let stride = self.groups * LANES;
        debug_assert!(tile.rows <= ROWS);
        for (m, share) in likely.shares[..likely.list.len()].iter().enumerate() {
            for (sample, &w) in share[..tile.rows].as_flattened().iter().enumerate() {
                flat[sample * stride + m] = w;
            }
        }
    }

    /// Products of a strip of components with all up to it.
    #[inline(always)]
    fn multiply<V: Vector>(&mut self) {
        let groups = self.groups;
        self.products.clear();
        self.products.resize(groups * LANES * groups, [0.0; LANES]);
        for first in (0..groups * LANES).step_by(STRIP) {
            for g in 0..=first / LANES {
                let mut sums = [V::splat(0.0); STRIP];
                for sample in self.shares.chunks_exact(groups) {
                    let others = V::load(&sample[g]);
                    let own = &sample[first / LANES];
                    for k in 0..STRIP {
                        sums[k] = others.times_plus(V::splat(own[first % LANES + k]), sums[k]);
                    }
                }
                for k in 0..STRIP {
                    sums[k].store(&mut self.products[(first + k) * groups + g]);
                }
            }
        }
    }

    fn add_to(&self, list: &[u32], to: &mut Normal) {
        let products = self.products.as_flattened();
        for (a, &m) in list.iter().enumerate() {
            for (b, &n) in list[..=a].iter().enumerate() {
                let (row, column) = (m.max(n) as usize, m.min(n) as usize);
                to.matrix[row * to.count + column] += f64::from(products[a * self.groups * LANES + b]);
            }
        }
    }
}

/// The components with colours refitted to the pictures of `pairs`.
pub(super) fn refitted(grid: &Grid<'_>, mut components: Vec<Component>, pairs: &[u32]) -> Vec<Component> {
    let normal = Normal::of(grid, &Packed::new(&components, grid.periods), pairs);
    for variable in INPUTS..VARIABLES {
        let guess: Vec<f64> = components.iter().map(|c| c.mean[variable]).collect();
        let solved = normal.solve(variable - INPUTS, &guess);
        components.iter_mut().zip(solved).for_each(|(c, colour)| c.mean[variable] = colour);
    }
    components
}
