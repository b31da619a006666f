//! Rounds of expectation and maximisation.

use super::expectation::expect;
use super::maximization::{maximise, reseed, spread, start};
use super::mixture::{Component, Packed};
use super::size::evenly;
use super::storage::LEAST_LOG_WEIGHT;
use super::variables::{FLOORS, Grid};
use super::{Options, WarmUp};

/// Change of the log-likelihood, relative to it, below which rounds end.
const CONVERGED: f64 = 1e-5;
/// Samples a component that the pictures of the warm-up hold at least.
const WARM_SAMPLES: f64 = 400.0;

/// A mixture, and how it came about.
#[derive(Clone, Debug)]
pub(super) struct Estimate {
    pub(super) components: Vec<Component>,
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
    let few = warm_up_pairs(grid, pairs, count, options.warm_up);
    let spread = spread(grid, pairs);
    let mut components = start(grid, pairs, count, &FLOORS, options.seed);
    let (mut log_likelihood, mut reseeded, mut done, mut all) = (Vec::new(), 0, 0.0, 0.0);
    for round in 0..options.rounds {
        let warming = few.as_ref().filter(|_| options.warm_up.is_some_and(|warm| round < warm.rounds));
        let found = expect(grid, &Packed::new(&components), warming.map_or(pairs, |few| few), options.reach);
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
        reseeded += reseed(&mut components, found.samples, &spread, &FLOORS);
    }
    components.retain(|c| c.weight.ln() > LEAST_LOG_WEIGHT);
    Estimate { components, log_likelihood, reseeded, evaluated: done / all }
}

/// The pictures of the first rounds, where they are fewer than all.
fn warm_up_pairs(grid: &Grid<'_>, pairs: &[u32], count: usize, warm_up: Option<WarmUp>) -> Option<Vec<u32>> {
    let least = WARM_SAMPLES * count as f64 / (pairs.len() * grid.texels()) as f64;
    let share = warm_up?.share.max(least);
    (share < 0.5).then(|| evenly(pairs, share))
}
