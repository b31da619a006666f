//! The expectation step over pictures: how much of each sample belongs to each component, summed up.
//!
//! Sums are kept per component: of shares, and of shares times differences from the component's old mean and
//! their squares, for x, y and colours; of shares per light and per view for the angles, which take few values.
//! Means subtracted afterwards, `E[x²] − μ²`, would leave nothing of a small variance in `f32`.

use super::lanes::{LANES, Row, Vector, kernel};
use super::mixture::{Likely, Packed, ROWS, Tile};
use super::variables::{Grid, INPUTS};
use rayon::prelude::*;

/// Sums per component: of shares; then first and second moments of x, y and the three colours.
pub(super) const SUMS: usize = 11;

/// Parts the pictures are dealt into, whatever the number of threads: sums are then added in one order.
const PARTS: usize = 32;

/// What an expectation step finds.
#[derive(Clone, Debug)]
pub(super) struct Statistics {
    /// Natural, summed over samples.
    pub(super) log_likelihood: f64,
    /// How many.
    pub(super) samples: f64,
    /// Component evaluations that were not left out.
    pub(super) evaluations: f64,
    /// Per component: see [`SUMS`].
    pub(super) sums: Vec<[f64; SUMS]>,
    /// Shares, (component, light).
    pub(super) lights: Vec<f64>,
    /// Shares, (component, view).
    pub(super) views: Vec<f64>,
}

impl Statistics {
    fn none(grid: &Grid<'_>, count: usize) -> Self {
        Self {
            log_likelihood: 0.0,
            samples: 0.0,
            evaluations: 0.0,
            sums: vec![[0.0; SUMS]; count],
            lights: vec![0.0; count * grid.lights.len()],
            views: vec![0.0; count * grid.views.len()],
        }
    }

    fn add(&mut self, other: &Self) {
        self.log_likelihood += other.log_likelihood;
        self.samples += other.samples;
        self.evaluations += other.evaluations;
        add_all(self.sums.as_flattened_mut(), other.sums.as_flattened());
        add_all(&mut self.lights, &other.lights);
        add_all(&mut self.views, &other.views);
    }
}

pub(super) fn add_all(to: &mut [f64], from: &[f64]) {
    to.iter_mut().zip(from).for_each(|(a, b)| *a += b);
}

/// Which samples an expectation step goes over.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent<'a> {
    /// Of these pictures
    pub(super) pairs: &'a [u32],
    /// this share of the tiles, spread evenly: few of each picture rather than few pictures, for components
    /// would settle between the directions of those.
    pub(super) share: f64,
}

impl Extent<'_> {
    fn has(&self, number: usize) -> bool {
        /// The golden ratio less 1: its multiples are spread evenly.
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        self.share >= 1.0 || (number as f64 * GOLDEN).fract() < self.share
    }
}

/// One expectation step.
pub(super) fn expect(grid: &Grid<'_>, mixture: &Packed, extent: Extent<'_>, reach: f32) -> Statistics {
    let pairs = extent.pairs;
    let part = |pairs: &[u32]| {
        let mut statistics = Statistics::none(grid, mixture.count);
        run(grid, mixture, Extent { pairs, ..extent }, reach, &mut statistics);
        statistics
    };
    let parts: Vec<Statistics> = pairs.par_chunks(pairs.len().div_ceil(PARTS).max(1)).map(part).collect();
    let mut sum = Statistics::none(grid, mixture.count);
    parts.iter().for_each(|part| sum.add(part));
    sum
}

kernel! {
    /// Adds samples to the statistics.
    fn run(grid: &Grid<'_>, mixture: &Packed, extent: Extent<'_>, reach: f32, to: &mut Statistics) = expect_with
}

#[inline(always)]
pub(super) fn expect_with<V: Vector>(
    grid: &Grid<'_>,
    mixture: &Packed,
    extent: Extent<'_>,
    reach: f32,
    to: &mut Statistics,
) {
    let mut tiles = Tile::all(&grid.x, &grid.y);
    let mut likely = Likely::default();
    let (mut energy, mut sums) = (Vec::new(), vec![[[0.0; LANES]; SUMS]; mixture.count]);
    for &pair in extent.pairs {
        let pair = pair as usize;
        mixture.energies::<V>(&mixture.joint, 2, &grid.angles(pair), &mut energy);
        let (picture, mean) = (grid.picture(pair), grid.mean_colour(pair));
        let first = pair * tiles.len();
        for (_, tile) in tiles.iter_mut().enumerate().filter(|(k, _)| extent.has(first + k)) {
            to.samples += (tile.rows * tile.columns) as f64;
            tile.take_colours(picture, grid.x.len(), mean);
            likely.find::<V>(mixture, &energy, tile, true, reach);
            to.evaluations += (likely.list.len() * tile.rows * tile.columns) as f64;
            to.log_likelihood += normalise::<V>(&mut likely, tile);
            for (&component, share) in likely.list.iter().zip(&likely.shares) {
                let component = component as usize;
                add_shares::<V>(mixture, component, &likely.total, share, tile, &mut sums[component]);
            }
        }
        settle::<V>(grid, pair, &mut sums, to);
    }
}

/// Turns totals into their inverses, 0 for texels beyond the border; the sum of the log densities.
#[inline(always)]
fn normalise<V: Vector>(likely: &mut Likely, tile: &Tile) -> f64 {
    let mut products = [1.0f64; LANES];
    let mut sum = 0.0;
    for row in 0..tile.rows {
        for k in 0..LANES {
            let total = likely.total[row][k];
            let within = k < tile.columns;
            products[k] *= if within { f64::from(total) } else { 1.0 };
            sum += if within { f64::from(likely.best[row][k]) } else { 0.0 };
            likely.total[row][k] = if within { 1.0 / total } else { 0.0 };
        }
    }
    // At most 4096 components in 8 rows: 10²⁹.
    sum + products.iter().map(|p| p.ln()).sum::<f64>()
}

#[inline(always)]
fn add_shares<V: Vector>(
    mixture: &Packed,
    component: usize,
    inverse: &[Row; ROWS],
    share: &[Row; ROWS],
    tile: &Tile,
    sums: &mut [Row; SUMS],
) {
    let mean = |v: usize| mixture.mean[v][component];
    let colour = [V::splat(mean(INPUTS)), V::splat(mean(INPUTS + 1)), V::splat(mean(INPUTS + 2))];
    let [columns, rows] = mixture.periods;
    let mut column = V::splat(0.0);
    let (mut y1, mut y2) = (V::load(&sums[3]), V::load(&sums[4]));
    let mut c1 = [V::load(&sums[5]), V::load(&sums[6]), V::load(&sums[7])];
    let mut c2 = [V::load(&sums[8]), V::load(&sums[9]), V::load(&sums[10])];
    for row in 0..tile.rows {
        let q = V::load(&share[row]).times(V::load(&inverse[row]));
        column = column.plus(q);
        let down = V::splat(rows.nearest_of(tile.y[row] - mean(1)));
        let first = q.times(down);
        y1 = y1.plus(first);
        y2 = first.times_plus(down, y2);
        for c in 0..3 {
            let d = V::load(&tile.colour[c][row]).minus(colour[c]);
            let first = q.times(d);
            c1[c] = c1[c].plus(first);
            c2[c] = first.times_plus(d, c2[c]);
        }
    }
    let across = columns.nearest(V::load(&tile.x).minus(V::splat(mean(0))));
    let first = column.times(across);
    column.plus(V::load(&sums[0])).store(&mut sums[0]);
    first.plus(V::load(&sums[1])).store(&mut sums[1]);
    first.times_plus(across, V::load(&sums[2])).store(&mut sums[2]);
    y1.store(&mut sums[3]);
    y2.store(&mut sums[4]);
    for c in 0..3 {
        c1[c].store(&mut sums[5 + c]);
        c2[c].store(&mut sums[8 + c]);
    }
}

/// Adds a picture's sums to the statistics, and clears them.
#[inline(always)]
fn settle<V: Vector>(grid: &Grid<'_>, pair: usize, sums: &mut [[Row; SUMS]], to: &mut Statistics) {
    let [view, light] = grid.view_and_light(pair);
    for (component, sums) in sums.iter_mut().enumerate() {
        let shares = f64::from(V::load(&sums[0]).sum());
        if shares == 0.0 {
            continue;
        }
        to.sums[component][0] += shares;
        to.lights[component * grid.lights.len() + light] += shares;
        to.views[component * grid.views.len() + view] += shares;
        for k in 1..SUMS {
            to.sums[component][k] += f64::from(V::load(&sums[k]).sum());
        }
        *sums = [[0.0; LANES]; SUMS];
    }
}
