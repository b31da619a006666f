//! How many components.
//!
//! A budget in bytes or quality says it at once. [`Budget::Auto`] finds out: likelihood criteria (BIC, message
//! length) count 10⁷ samples of a grid as independent, which they are not, and would allow any number. What a codec
//! is for is to answer where it was not fitted: every eighth pair of light and view is held out, short fits on
//! others grow by doubling, and growing ends where the error of the pairs held out no longer falls by 2 %.
//! The Bayesian information criterion of each step is noted beside it:
//!
//! ```text
//! BIC = −2 Σ log P(ξ) + (19 M − 1) log n      (Schwarz, "Estimating the Dimension of a Model", Annals of Statistics 6, 1978)
//! ```

use super::estimation::{Estimate, estimate};
use super::mixture::Packed;
use super::prediction::mean_square_error;
use super::storage::{component_bytes, other_bytes};
use super::variables::{Grid, VARIABLES};
use super::{Options, refit};
use crate::TextureError;
use crate::btf::{Budget, Precision};
use capture::btf::Btf;

/// Components of the source's comparison of codecs (Table 2).
const STANDARD: usize = 600;
/// What [`Budget::Quality`] runs between, by equal factors.
const QUALITY_RANGE: [f64; 2] = [16.0, 2048.0];
/// The normal equations of more would take gigabytes.
pub(super) const MOST: usize = 4096;
/// What [`Budget::Auto`] tries.
const LADDER: [usize; 8] = [1, 16, 32, 64, 128, 256, 512, 1024];
/// Share of the error that a step of the ladder has to save.
const WORTHWHILE: f64 = 0.02;
/// The error of rounding to 8 bits, as the mean picture is: below it nothing is left to gain.
const ENOUGH: f64 = 0.3 / 255.0;
/// Samples of a trial fit, and of its judgement.
const TRIAL_SAMPLES: usize = 1_500_000;
/// Rounds of a trial fit.
const TRIAL_ROUNDS: usize = 12;

/// The number of components a budget allows; none where the data are to say.
pub(super) fn allowed(btf: &Btf, budget: Budget, precision: Precision) -> Result<Option<usize>, TextureError> {
    let out_of_range = |fault: String, remedy: &str| TextureError::Degenerate { fault, remedy: remedy.into() };
    let count = match budget {
        Budget::Standard => STANDARD,
        Budget::Components(count) if (1..=MOST).contains(&count) => count,
        Budget::Components(count) => {
            let remedy = "a Gaussian mixture has 1 to 4096";
            return Err(out_of_range(format!("{count} components were asked for"), remedy));
        }
        Budget::Quality(quality) if (0.0..=100.0).contains(&quality) => {
            let [low, high] = QUALITY_RANGE;
            (low * (high / low).powf(quality / 100.0)).round() as usize
        }
        Budget::Quality(quality) => {
            return Err(out_of_range(format!("a quality of {quality} was asked for"), "give 0 to 100"));
        }
        Budget::Ratio(ratio) => within_ratio(btf, ratio, precision)?,
        Budget::Auto => return Ok(None),
    };
    Ok(Some(count))
}

fn within_ratio(btf: &Btf, ratio: f64, precision: Precision) -> Result<usize, TextureError> {
    let (raw, others) = (btf.raw_bytes() as f64, other_bytes(btf) as f64);
    let left = if ratio > 0.0 { raw / ratio - others } else { f64::NAN };
    let count = (left / component_bytes(precision) as f64).floor();
    if count >= 1.0 {
        return Ok(count.min(MOST as f64) as usize);
    }
    Err(TextureError::Degenerate {
        fault: format!("a ratio of {ratio} was asked for, and the mean picture alone takes {others} of {raw} bytes"),
        remedy: format!("ask for at most {:.0}", raw / (others + component_bytes(precision) as f64)),
    })
}

/// The number of components that data support, and a note of what was tried.
pub(super) fn supported(grid: &Grid<'_>, pairs: &[u32], options: &Options) -> (usize, String) {
    let held = |k: &usize| pairs.len() >= 16 && k % 8 == 3;
    let numbers: Vec<usize> = (0..pairs.len()).collect();
    let all =
        |held_out: bool| -> Vec<u32> { numbers.iter().filter(|k| held(k) == held_out).map(|&k| pairs[k]).collect() };
    let (training, mut judging) = (all(false), all(true));
    if judging.is_empty() {
        judging.clone_from(&training);
    }
    let share = |count: usize| TRIAL_SAMPLES as f64 / (count * grid.texels()) as f64;
    let training = evenly(&training, share(training.len()));
    let judging = evenly(&judging, share(judging.len()));
    let trial = Options { rounds: TRIAL_ROUNDS, warm_up: None, try_shapes: false, ..*options };
    let samples = training.len() * grid.texels();
    let mut best = (1, f64::INFINITY);
    let mut tried = Vec::new();
    for count in LADDER.into_iter().filter(|&count| count == 1 || 20 * count <= samples) {
        let found = estimate(grid, &training, count, &trial);
        let criterion = bic(&found, samples) / samples as f64;
        let refitted = refit::refitted(grid, found.components, &training);
        let error = mean_square_error(grid, &Packed::new(&refitted, grid.periods), &judging).sqrt();
        tried.push(format!("{count}: {:.3} ({criterion:.3})", 255.0 * error));
        if error > best.1 * (1.0 - WORTHWHILE) || best.1 < ENOUGH {
            break;
        }
        best = (count, error);
    }
    (best.0, format!("error of pairs held out (BIC of a sample) by number of components: {}", tried.join(", ")))
}

/// The Bayesian information criterion of components estimated from so many samples, the smaller the better.
fn bic(found: &Estimate, samples: usize) -> f64 {
    let likelihood = found.log_likelihood.last().copied().unwrap_or(f64::NEG_INFINITY);
    let numbers = found.components.len() * (2 * VARIABLES + 1) - 1;
    (numbers as f64).mul_add((samples as f64).ln(), -2.0 * likelihood * samples as f64)
}

/// About that share of the pairs, evenly; at least one.
pub(super) fn evenly(pairs: &[u32], share: f64) -> Vec<u32> {
    /// The golden ratio less 1: its multiples are spread evenly.
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    if share >= 1.0 {
        return pairs.to_vec();
    }
    let chosen: Vec<u32> =
        (0..pairs.len()).filter(|&k| (k as f64 * GOLDEN).fract() < share).map(|k| pairs[k]).collect();
    if chosen.is_empty() { pairs[..1].to_vec() } else { chosen }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_component_costs_nineteen_numbers() {
        let component =
            super::super::mixture::Component { weight: 0.5, mean: [0.0; VARIABLES], sigma: [1.0; VARIABLES] };
        let found = |count: usize| Estimate {
            components: vec![component; count],
            shape: Default::default(),
            log_likelihood: vec![-7.0, -1.5],
            reseeded: 0,
            evaluated: 1.0,
        };
        // −2 · 100 · (−1.5) + 18 ln 100, and 19 ln 100 more for each.
        assert!((bic(&found(1), 100) - (300.0 + 18.0 * 100_f64.ln())).abs() < 1e-9);
        assert!((bic(&found(3), 100) - bic(&found(1), 100) - 38.0 * 100_f64.ln()).abs() < 1e-9);
    }
}
