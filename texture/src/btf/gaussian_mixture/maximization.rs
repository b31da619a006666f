//! The maximisation step, where components start, and what becomes of empty ones.

use super::expectation::Statistics;
use super::mixture::Component;
use super::variables::{Grid, INPUTS, VARIABLES};

/// A component with less than this share of the mean weight is empty.
const EMPTY_SHARE: f64 = 1e-3;
/// A component with fewer samples is empty, too, where there are many samples a component.
const FEWEST_SAMPLES: f64 = 50.0;

/// Components from statistics about the old ones. What got no sample stays as it was, with no weight.
pub(super) fn maximise(
    grid: &Grid<'_>,
    old: &[Component],
    found: &Statistics,
    floors: &[f64; VARIABLES],
) -> Vec<Component> {
    let (lights, views) = (grid.lights.len(), grid.views.len());
    let one = |(m, old): (usize, &Component)| {
        let sums = &found.sums[m];
        let shares = sums[0];
        let mut new = Component { weight: shares / found.samples, ..*old };
        if shares <= 0.0 {
            return new;
        }
        for (variable, k) in [(0, 1), (1, 3)].into_iter().chain((0..3).map(|c| (INPUTS + c, 5 + c))) {
            let second = if variable < INPUTS { k + 1 } else { k + 3 };
            let shift = sums[k] / shares;
            new.mean[variable] += shift;
            new.sigma[variable] = (sums[second] / shares - shift * shift).max(0.0).sqrt();
        }
        let light = &found.lights[m * lights..][..lights];
        let view = &found.views[m * views..][..views];
        for k in 0..2 {
            (new.mean[2 + k], new.sigma[2 + k]) = moments(light, grid.lights.iter().map(|d| d[k]));
            (new.mean[4 + k], new.sigma[4 + k]) = moments(view, grid.views.iter().map(|d| d[k]));
        }
        grid.periods.iter().zip(&mut new.mean).for_each(|(period, mean)| *mean = period.within(*mean));
        new.sigma.iter_mut().zip(floors).for_each(|(sigma, floor)| *sigma = sigma.max(*floor));
        new
    };
    old.iter().enumerate().map(one).collect()
}

/// Weighted mean and deviation, in two passes.
fn moments(weights: &[f64], values: impl Iterator<Item = f32> + Clone) -> (f64, f64) {
    let total: f64 = weights.iter().sum();
    let weighted = || weights.iter().zip(values.clone());
    let mean = weighted().map(|(w, v)| w * f64::from(v)).sum::<f64>() / total;
    let square = weighted().map(|(w, v)| w * (f64::from(v) - mean).powi(2)).sum::<f64>() / total;
    (mean, square.sqrt())
}

/// Which inputs share the narrowing of components at the start: exponents of 1/M, which sum to 1.
pub(super) type Shape = [f64; INPUTS];

/// Even; narrow in place alone; in place and light; in place and eye; columns and rows under an eye. EM
/// stays near the shape it starts with, and which one serves depends on what varies fastest.
pub(super) const SHAPES: [Shape; 6] = [
    [1.0 / 6.0; INPUTS],
    [0.5, 0.5, 0.0, 0.0, 0.0, 0.0],
    [0.25, 0.25, 0.25, 0.25, 0.0, 0.0],
    [0.25, 0.25, 0.0, 0.0, 0.25, 0.25],
    [0.5, 0.0, 0.0, 0.0, 0.25, 0.25],
    [0.0, 0.5, 0.0, 0.0, 0.25, 0.25],
];

/// Components on samples spread evenly over texels, lights and views, as wide as their share of the inputs' volume.
pub(super) fn start(
    grid: &Grid<'_>,
    pairs: &[u32],
    count: usize,
    shape: &Shape,
    floors: &[f64; VARIABLES],
    seed: u64,
) -> Vec<Component> {
    let spread = spread(grid, pairs);
    let narrowing = |v: usize| if v < INPUTS { (count as f64).powf(-shape[v]) } else { 1.0 };
    let sigma = std::array::from_fn(|v| (narrowing(v) * spread[v]).max(floors[v]));
    let (width, height) = (grid.x.len(), grid.y.len());
    let component = |k: usize| {
        let [at_x, at_y, at_pair] = even_point(k, seed);
        let (x, y) = ((at_x * width as f64) as usize, (at_y * height as f64) as usize);
        let pair = pairs[((at_pair * pairs.len() as f64) as usize).min(pairs.len() - 1)];
        let texel = y.min(height - 1) * width + x.min(width - 1);
        Component { weight: 1.0 / count as f64, mean: grid.sample(pair as usize, texel), sigma }
    };
    (0..count).map(component).collect()
}

/// Point `k` of an even sequence in the unit cube, shifted by the seed: multiples of the powers of the
/// root of `g⁴ = g + 1` (Roberts 2018).
fn even_point(k: usize, seed: u64) -> [f64; 3] {
    const ROOT: f64 = 1.220_744_084_605_759_5;
    std::array::from_fn(|axis| {
        let shift = scrambled(seed ^ (axis as u64 + 1)) as f64 / 2f64.powi(64);
        (shift + (k + 1) as f64 * ROOT.powi(-(axis as i32 + 1))).fract()
    })
}

/// A number without resemblance to its seed (SplitMix64).
fn scrambled(seed: u64) -> u64 {
    let z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Deviation of each variable over the samples of `pairs`.
pub(super) fn spread(grid: &Grid<'_>, pairs: &[u32]) -> [f64; VARIABLES] {
    let mut colours = [[0.0f64; 2]; 3];
    for &pair in pairs {
        let mean = grid.mean_colour(pair as usize);
        for texel in grid.picture(pair as usize).chunks_exact(3) {
            for c in 0..3 {
                let value = f64::from(texel[c] - mean[c]);
                colours[c][0] += value;
                colours[c][1] += value * value;
            }
        }
    }
    let samples = (pairs.len() * grid.texels()) as f64;
    let even = |values: &[f32]| moments(&vec![1.0; values.len()], values.iter().copied()).1;
    let angle = |k: usize| {
        let values: Vec<f32> = pairs.iter().map(|&p| grid.angles(p as usize)[k]).collect();
        even(&values)
    };
    let colour = |c: usize| (colours[c][1] / samples - (colours[c][0] / samples).powi(2)).max(0.0).sqrt();
    [even(&grid.x), even(&grid.y), angle(0), angle(1), angle(2), angle(3), colour(0), colour(1), colour(2)]
}

/// Puts each empty component on half of the component whose colours vary most in all: the two part along its widest
/// input. Tells how many were empty.
pub(super) fn reseed(
    grid: &Grid<'_>,
    components: &mut [Component],
    samples: f64,
    spread: &[f64; VARIABLES],
    floors: &[f64; VARIABLES],
) -> usize {
    let count = components.len() as f64;
    let limit = (EMPTY_SHARE / count).max(FEWEST_SAMPLES.min(0.05 * samples / count) / samples);
    let empty: Vec<usize> = (0..components.len()).filter(|&m| components[m].weight < limit).collect();
    for &target in &empty {
        let variation = |c: &Component| c.weight * c.sigma[INPUTS..].iter().map(|s| s * s).sum::<f64>();
        let widest =
            (0..components.len()).max_by(|&a, &b| variation(&components[a]).total_cmp(&variation(&components[b])));
        let Some(source) = widest.filter(|&source| source != target) else { continue };
        let mut half = components[source];
        half.weight *= 0.5;
        let width = |v: usize| half.sigma[v] / spread[v].max(floors[v]);
        let axis = (0..INPUTS).max_by(|&a, &b| width(a).total_cmp(&width(b))).unwrap_or(0);
        let step = 0.5 * half.sigma[axis];
        half.sigma[axis] = (half.sigma[axis] * 0.75f64.sqrt()).max(floors[axis]);
        let mut other = half;
        half.mean[axis] -= step;
        other.mean[axis] += step;
        for (half, period) in [&mut half, &mut other].into_iter().flat_map(|c| c.mean.iter_mut().zip(&grid.periods)) {
            *half = period.within(*half);
        }
        (components[source], components[target]) = (half, other);
    }
    let total: f64 = components.iter().map(|c| c.weight).sum();
    components.iter_mut().for_each(|c| c.weight /= total);
    empty.len()
}
