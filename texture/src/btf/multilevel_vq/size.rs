//! The threshold that gives a size.
//!
//! Sizes fall by about a power of the threshold: on logarithms, one that was tried tells where to look next, two that enclose what
//! is wanted tell better. They fall in steps: many thresholds give one size, so that it is thresholds that enclose, not sizes.
//! Refining leaves some items without use, so that what must be grown for a size is larger than that, by a power again.

use super::{Grown, Input, Options};
use crate::btf::FitReport;

/// Thresholds searched, in levels or in hundredths of `1 − SSIM`.
const THRESHOLDS: [f64; 2] = [0.02, 200.0];
/// Thresholds tried for one size.
const ROUNDS: usize = 12;
/// Thresholds nearer than this, in logarithms, are one.
const SAME: f64 = 1e-3;
/// A size falls by about this power of the threshold.
const USUAL_SLOPE: f64 = -3.5;
/// The refined size rises by about this power of what was grown.
const REFINED_SLOPE: f64 = 1.3;
/// What is too large is farther than what is too small by any ratio: added to its distance.
const OVER_BUDGET: f64 = 1e3;
/// Between two that enclose what is wanted, the next lies so far from either at least, as a share.
const INNER: f64 = 0.05;
/// Books of a ratio are refined so often at most.
const REFININGS: usize = 4;
/// What is grown at first, over the size wanted.
const FIRST_EXCESS: f64 = 1.08;
/// How near it must come, at first and later: as a share.
const NEARNESS: [f64; 2] = [0.06, 0.012];

/// How one thing follows from another, as far as was tried; all in logarithms.
struct Relation {
    /// The usual one; its sign tells where to look for more.
    slope: f64,
    /// What is tried first.
    first: f64,
    /// Nothing beyond is tried.
    ends: [f64; 2],
    /// In the order of trial.
    known: Vec<[f64; 2]>,
}

impl Relation {
    fn new(slope: f64, first: f64, ends: [f64; 2]) -> Self {
        Self { slope, first: first.clamp(ends[0], ends[1]), ends, known: Vec::new() }
    }

    /// Tries until something comes to lie in the range, nothing new is left or all rounds are over; what came nearest. `attempt`
    /// answers with what it tried for what was asked, and what came of it.
    fn approach(&mut self, range: [f64; 2], rounds: usize, mut attempt: impl FnMut(f64) -> [f64; 2]) -> [f64; 2] {
        let before = self.known.len();
        let nearest = self.known.iter().copied().min_by(|a, b| miss(a[1], range).total_cmp(&miss(b[1], range)));
        let mut best = nearest.unwrap_or_else(|| {
            let found = attempt(self.first);
            self.known.push(found);
            found
        });
        while miss(best[1], range) > 0.0 && self.known.len() < before + rounds {
            let Some(next) = self.next(0.5 * (range[0] + range[1]), before) else { break };
            let found = attempt(next);
            let again = self.known.contains(&found);
            self.known.push(found);
            if miss(found[1], range) < miss(best[1], range) {
                best = found;
            }
            if again {
                break;
            }
        }
        best
    }

    /// What to try for `wanted`: between two neighbours that enclose it, or beyond all. None where such neighbours are one, or an
    /// end was tried. Those known before this search do not count as its failures.
    fn next(&self, wanted: f64, before: usize) -> Option<f64> {
        let above = |point: &[f64; 2]| point[1] > wanted;
        let last = self.known.last().map(above);
        // Trials in a row on one side: from the third on, larger steps are due.
        let row = self.known[before..].iter().rev().take_while(|point| Some(above(point)) == last).count();
        let boldness = 2.0_f64.powi(row.saturating_sub(2) as i32);
        let mut sorted = self.known.clone();
        sorted.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let enclosing = sorted.windows(2).filter(|w| above(&w[0]) != above(&w[1]));
        if let Some(w) = enclosing.max_by(|a, b| (a[1][0] - a[0][0]).total_cmp(&(b[1][0] - b[0][0]))) {
            // The end that stays pulls less and less (Illinois algorithm).
            let gap =
                |point: &[f64; 2]| (point[1] - wanted).abs() / if Some(above(point)) == last { 1.0 } else { boldness };
            let (width, share) = (w[1][0] - w[0][0], gap(&w[0]) / (gap(&w[0]) + gap(&w[1])));
            return (width >= SAME).then(|| w[0][0] + width * share.clamp(INNER, 1.0 - INNER));
        }
        let outermost = if last? == (self.slope < 0.0) { sorted.last()? } else { sorted.first()? };
        let step = ((wanted - outermost[1]) / self.slope).abs().max(SAME) * boldness;
        let towards = if last? == (self.slope < 0.0) { step } else { -step };
        let next = (outermost[0] + towards).clamp(self.ends[0], self.ends[1]);
        ((next - outermost[0]).abs() >= SAME).then_some(next)
    }
}

/// How far a logarithm is from a range: too small is allowed, too large only where nothing is small enough.
fn miss(found: f64, [low, high]: [f64; 2]) -> f64 {
    if found > high { OVER_BUDGET + found - high } else { (low - found).max(0.0) }
}

/// Tells the user that a range, of logarithms, was missed.
pub(super) fn note_miss(found: f64, range: [f64; 2], report: &mut FitReport) {
    if miss(found, range) > 0.0 {
        let [found, low, high] = [found, range[0], range[1]].map(f64::exp);
        report.notes.push(format!("{found:.0} came nearest to {low:.0}..{high:.0}"));
    }
}

/// Looks for thresholds; what was tried for one size serves the next. Ranges and sizes are logarithms.
pub(super) struct Search<'a> {
    inputs: &'a [Input<'a>],
    options: &'a Options,
    size: &'a dyn Fn(&Grown) -> f64,
    tried: Relation,
}

impl<'a> Search<'a> {
    /// From a threshold on; sizes below 1 count as 1.
    pub(super) fn new(
        inputs: &'a [Input<'a>],
        options: &'a Options,
        size: &'a dyn Fn(&Grown) -> f64,
        first: f64,
    ) -> Self {
        Self { inputs, options, size, tried: Relation::new(USUAL_SLOPE, first.ln(), THRESHOLDS.map(f64::ln)) }
    }

    /// What was grown to a size of this range and that size, or what came nearest: too small rather than too large.
    pub(super) fn within(&mut self, range: [f64; 2], report: &mut FitReport) -> (Grown, f64) {
        let mut kept: Option<(Grown, f64)> = None;
        let [threshold, size] = self.tried.approach(range, ROUNDS, |threshold| {
            let grown = Grown::new(self.inputs, self.options, threshold.exp());
            let size = (self.size)(&grown).max(1.0).ln();
            report.objective.push(size.exp());
            if kept.as_ref().is_none_or(|(_, best)| miss(size, range) < miss(*best, range)) {
                kept = Some((grown, size));
            }
            [threshold, size]
        });
        match kept {
            Some(kept) if miss(kept.1, range) <= miss(size, range) => kept,
            // It was grown for another size, and is not held.
            _ => (Grown::new(self.inputs, self.options, threshold.exp()), size),
        }
    }

    /// Refined books of a size of the range, or what comes nearest: too small rather than too large.
    pub(super) fn refined(&mut self, range: [f64; 2], report: &mut FitReport) -> Grown {
        let mut saved = Relation::new(REFINED_SLOPE, range[1] + FIRST_EXCESS.ln(), [0.0, f64::INFINITY]);
        let mut kept: Option<(Grown, f64)> = None;
        saved.approach(range, REFININGS, |aimed| {
            let near = NEARNESS[usize::from(kept.is_some())];
            let (grown, before) = self.within([aimed - near, aimed + near], report);
            let (grown, after) = self.refine(grown);
            if kept.as_ref().is_none_or(|(_, best)| miss(after, range) < miss(*best, range)) {
                kept = Some((grown, after));
            }
            [before, after]
        });
        let (grown, size) = match kept {
            Some(kept) if kept.1 <= range[1] => kept,
            // Refining enlarges nothing: what is small enough before is so after.
            _ => {
                let (grown, _) = self.within(range, report);
                let small = self.refine(grown);
                kept.filter(|kept| miss(kept.1, range) <= miss(small.1, range)).unwrap_or(small)
            }
        };
        note_miss(size, range, report);
        grown
    }

    fn refine(&self, grown: Grown) -> (Grown, f64) {
        let grown = grown.refined(self.inputs, self.options);
        let size = (self.size)(&grown).max(1.0).ln();
        (grown, size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is found for a size from `low` to `high`, and after how many trials.
    fn found(size: impl Fn(f64) -> f64, low: f64, high: f64) -> (f64, usize) {
        let mut tried = Relation::new(USUAL_SLOPE, 16.0_f64.ln(), THRESHOLDS.map(f64::ln));
        let [_, best] = tried.approach([low.ln(), high.ln()], ROUNDS, |t| [t, size(t.exp()).ln()]);
        assert!(tried.known.iter().all(|[t, _]| (THRESHOLDS[0] * 0.999..THRESHOLDS[1] * 1.001).contains(&t.exp())));
        (best.exp(), tried.known.len())
    }

    #[test]
    fn power_laws_are_met_in_a_few_trials() {
        for power in [-0.7, -2.0, -3.5, -6.0] {
            for wanted in [3e3, 1e5, 4e6] {
                let (size, trials) = found(|t| 1e5 * (t / 9.0).powf(power), wanted, 1.03 * wanted);
                let reached = |t: f64| 1e5 * (t / 9.0).powf(power);
                if (reached(THRESHOLDS[1])..reached(THRESHOLDS[0])).contains(&wanted) {
                    assert!((wanted..=1.03 * wanted).contains(&size), "{power} {wanted}: {size}");
                    assert!(trials <= 7, "{power} {wanted}: {trials}");
                }
            }
        }
    }

    #[test]
    fn plateaus_are_left() {
        let (size, trials) = found(|t| (20.0 / (t * t)).floor().max(1.0), 28.8, 32.0);
        assert!((28.8..=32.0).contains(&size), "{size} after {trials}");
        // Nearly right, and long.
        let (size, trials) = found(|t| if t > 0.5 { 31.0 } else { 33.0 }, 31.5, 33.5);
        assert!(size.round() == 33.0, "{size} after {trials}");
        let (size, trials) = found(|t| if t < 100.0 { 34.0 } else { 32.0 }, 31.5, 33.5);
        assert!(size.round() == 32.0, "{size} after {trials}");
    }

    #[test]
    fn narrow_steps_are_found_between_wide_ones() {
        let stairs = |t: f64| match t {
            t if t > 3.0 => 10.0,
            t if t > 2.4 => 100.0,
            _ => 1e6,
        };
        let (size, trials) = found(stairs, 90.0, 110.0);
        assert!(size.round() == 100.0, "{size} after {trials}");
    }

    #[test]
    fn what_cannot_be_reached_is_approached_from_below() {
        let (size, _) = found(|t| if t > 3.0 { 10.0 } else { 1000.0 }, 90.0, 110.0);
        assert!(size.round() == 10.0, "too small rather than too large: {size}");
        let (size, trials) = found(|_| 7.0, 90.0, 110.0);
        assert!(size.round() == 7.0 && trials < ROUNDS, "the end is reached: {trials}");
        let (size, trials) = found(|t| 1e9 / t, 1.0, 2.0);
        assert!((size / (1e9 / THRESHOLDS[1]) - 1.0).abs() < 1e-9 && trials < ROUNDS, "{size} {trials}");
    }

    #[test]
    fn what_was_tried_for_one_size_serves_the_next() {
        let mut tried = Relation::new(USUAL_SLOPE, 16.0_f64.ln(), THRESHOLDS.map(f64::ln));
        let law = |t: f64| [t, 12.0 - 2.0 * t];
        let first = tried.approach([6.0, 6.03], ROUNDS, law);
        let again = tried.approach([5.99, 6.04], ROUNDS, |_| unreachable!("it is known"));
        assert_eq!(first, again);
        let trials = tried.known.len();
        assert!((6.1..=6.13).contains(&tried.approach([6.1, 6.13], ROUNDS, law)[1]));
        assert!(tried.known.len() == trials + 1, "{}", tried.known.len());
    }
}
