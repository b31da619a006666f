//! Rounds of expectation and maximisation.

use super::expectation::{Extent, expect};
use super::maximization::{SHAPES, Shape, maximise, reseed, spread, start};
use super::mixture::{Component, Packed};
use super::prediction::mean_square_error;
use super::refit;
use super::size::evenly;
use super::storage::LEAST_LOG_WEIGHT;
use super::variables::{FLOORS, Grid};
use super::{Options, WarmUp};

/// Change of the log-likelihood, relative to it, below which rounds end.
const CONVERGED: f64 = 1e-5;
/// Samples a component that a round of the warm-up goes over at least.
const WARM_SAMPLES: f64 = 400.0;

/// Samples of a round of the trial of a shape.
const TRIAL_SAMPLES: f64 = 300_000.0;
/// Rounds of it.
const TRIAL_ROUNDS: usize = 8;

/// A mixture, and how it came about.
#[derive(Clone, Debug)]
pub(super) struct Estimate {
    pub(super) components: Vec<Component>,
    /// That of the start.
    pub(super) shape: Shape,
    /// Mean log-likelihood of a sample, before each round.
    pub(super) log_likelihood: Vec<f64>,
    /// Components that were found empty and put elsewhere.
    pub(super) reseeded: usize,
    /// Share of evaluations that were not left out.
    pub(super) evaluated: f64,
}

/// Fits `count` components to the pictures of `pairs`.
pub(super) fn estimate(grid: &Grid<'_>, pairs: &[u32], count: usize, options: &Options) -> Estimate {
    let count = count.min(pairs.len() * grid.texels());
    let shape = if options.try_shapes { best_shape(grid, pairs, count, options) } else { &SHAPES[0] };
    from_shape(grid, pairs, count, shape, options)
}

/// The shape after which a short fit answers best: fitted to tiles of all pictures, its colours to some pictures, and
/// judged by others.
fn best_shape(grid: &Grid<'_>, pairs: &[u32], count: usize, options: &Options) -> &'static Shape {
    let share = (TRIAL_SAMPLES.max(WARM_SAMPLES * count as f64) / (pairs.len() * grid.texels()) as f64).min(0.5);
    let warm_up = Some(WarmUp { share, rounds: TRIAL_ROUNDS });
    let options = Options { rounds: TRIAL_ROUNDS, warm_up, ..*options };
    let some = evenly(pairs, 2.0 * share);
    let (training, judging) = some.split_at(some.len() / 2);
    if training.is_empty() {
        return &SHAPES[0];
    }
    let error = |shape: &Shape| {
        let components = from_shape(grid, pairs, count, shape, &options).components;
        let refitted = refit::refitted(grid, components, training);
        mean_square_error(grid, &Packed::new(&refitted, grid.periods), judging)
    };
    let judged = SHAPES.iter().map(|shape| (shape, error(shape)));
    judged.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(&SHAPES[0], |best| best.0)
}

fn from_shape(grid: &Grid<'_>, pairs: &[u32], count: usize, shape: &Shape, options: &Options) -> Estimate {
    let share = warm_up_share(grid, pairs, count, options.warm_up);
    let spread = spread(grid, pairs);
    let mut components = start(grid, pairs, count, shape, &FLOORS, options.seed);
    let (mut log_likelihood, mut reseeded, mut done, mut all) = (Vec::new(), 0, 0.0, 0.0);
    for round in 0..options.rounds {
        let warming = share.filter(|_| options.warm_up.is_some_and(|warm| round < warm.rounds));
        let extent = Extent { pairs, share: warming.unwrap_or(1.0) };
        let found = expect(grid, &Packed::new(&components, grid.periods), extent, options.reach);
        let likelihood = found.log_likelihood / found.samples;
        let before = log_likelihood.last().copied();
        log_likelihood.push(likelihood);
        done += found.evaluations;
        all += found.samples * count as f64;
        components = maximise(grid, &components, &found, &FLOORS);
        let still = |before: f64| (likelihood - before).abs() < CONVERGED * likelihood.abs();
        if warming.is_none() && before.is_some_and(still) || round + 1 == options.rounds {
            break;
        }
        reseeded += reseed(grid, &mut components, found.samples, &spread, &FLOORS);
    }
    components.retain(|c| c.weight.ln() > LEAST_LOG_WEIGHT);
    Estimate { components, shape: *shape, log_likelihood, reseeded, evaluated: done / all }
}

/// The share of samples of the first rounds, where it is less than all.
fn warm_up_share(grid: &Grid<'_>, pairs: &[u32], count: usize, warm_up: Option<WarmUp>) -> Option<f64> {
    let least = WARM_SAMPLES * count as f64 / (pairs.len() * grid.texels()) as f64;
    Some(warm_up?.share.max(least)).filter(|share| *share < 0.5)
}
