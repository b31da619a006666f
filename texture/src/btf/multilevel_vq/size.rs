//! The threshold that gives a size.
//!
//! Sizes fall by about a power of the threshold: on logarithms, one that was tried tells where to look next, two that enclose what
//! is wanted tell better. Refining leaves some items without use, so that what must be grown for a size is larger than that, by a
//! power again.

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
/// A logarithm beyond that of any two sizes' ratio.
const OVER_BUDGET: f64 = 1e3;
/// Books of a ratio are refined so often at most.
const REFININGS: usize = 4;
/// What is grown at first, over the size wanted.
const FIRST_EXCESS: f64 = 1.08;
/// How near it must come, at first and later: as a share.
const NEARNESS: [f64; 2] = [0.06, 0.012];

/// How one thing follows from another, as far as was tried; all in logarithms.
struct Relation {
    slope: f64,
    known: Vec<[f64; 2]>,
}

impl Relation {
    /// What should give `wanted`: between the two that enclose it, or by the usual slope from the nearest.
    fn guess(&self, wanted: f64) -> Option<f64> {
        let nearest = |above: bool| {
            let side = self.known.iter().filter(|[_, y]| (*y > wanted) == above);
            side.min_by(|a, b| (a[1] - wanted).abs().total_cmp(&(b[1] - wanted).abs()))
        };
        match (nearest(true), nearest(false)) {
            (Some([from, above]), Some([to, below])) => {
                Some(from + (to - from) * ((above - wanted) / (above - below)).clamp(0.05, 0.95))
            }
            (Some([x, y]), None) | (None, Some([x, y])) => Some(x + (wanted - y) / self.slope),
            (None, None) => None,
        }
    }
}

/// Looks for thresholds; what was tried for one size serves the next.
pub(super) struct Search<'a> {
    inputs: &'a [Input<'a>],
    options: &'a Options,
    size: &'a dyn Fn(&Grown) -> f64,
    first: f64,
    tried: Relation,
}

impl<'a> Search<'a> {
    /// From a threshold on.
    pub(super) fn new(
        inputs: &'a [Input<'a>],
        options: &'a Options,
        size: &'a dyn Fn(&Grown) -> f64,
        first: f64,
    ) -> Self {
        Self { inputs, options, size, first, tried: Relation { slope: USUAL_SLOPE, known: Vec::new() } }
    }

    /// What was grown to a size of this range and that size, or what came nearest: too small rather than too large. None where
    /// all that could be tried has been.
    pub(super) fn within(&mut self, [low, high]: [f64; 2], report: &mut FitReport) -> Option<(Grown, f64)> {
        // Too small is allowed, too large only where nothing is small enough.
        let distance =
            |found: f64| if found > high { OVER_BUDGET + (found / high).ln() } else { (low / found).ln().max(0.0) };
        let mut best: Option<(Grown, f64)> = None;
        for _ in 0..ROUNDS {
            let guess = self.tried.guess(0.5 * (low.ln() + high.ln())).map_or(self.first, f64::exp);
            let threshold = guess.clamp(THRESHOLDS[0], THRESHOLDS[1]);
            if self.tried.known.iter().any(|[t, _]| (t - threshold.ln()).abs() < SAME) {
                break;
            }
            let grown = Grown::new(self.inputs, self.options, threshold);
            let found = (self.size)(&grown);
            self.tried.known.push([threshold.ln(), found.ln()]);
            report.objective.push(found);
            if best.as_ref().is_none_or(|(_, size)| distance(found) < distance(*size)) {
                best = Some((grown, found));
            }
            if distance(found) == 0.0 {
                break;
            }
        }
        best
    }

    /// Refined books of a size of at most `most`, and of `least` where a threshold gives it.
    pub(super) fn refined(&mut self, [least, most]: [f64; 2], report: &mut FitReport) -> Option<Grown> {
        let wanted = 0.5 * (least.ln() + most.ln());
        let distance = |found: f64| if found > most { OVER_BUDGET * found } else { most - found };
        let mut saved = Relation { slope: REFINED_SLOPE, known: Vec::new() };
        let mut best: Option<(Grown, f64)> = None;
        for attempt in 0..REFININGS {
            let aimed = saved.guess(wanted).map_or(FIRST_EXCESS * most, f64::exp);
            let near = NEARNESS[attempt.min(1)];
            let Some((grown, before)) = self.within([aimed * (1.0 - near), aimed * (1.0 + near)], report) else {
                break;
            };
            let grown = grown.refined(self.inputs, self.options);
            let after = (self.size)(&grown);
            saved.known.push([before.ln(), after.ln()]);
            if best.as_ref().is_none_or(|(_, size)| distance(after) < distance(*size)) {
                best = Some((grown, after));
            }
            if (least..=most).contains(&after) {
                break;
            }
        }
        let (best, size) = best?;
        if !(least..=most).contains(&size) {
            report.notes.push(format!("{size:.0} came nearest to {least:.0}..{most:.0}"));
        }
        Some(best)
    }
}
