//! Angles on a circle: how far apart they are, and where they leave a gap.

use super::{ChooseOptions, Gap};
use std::f64::consts::TAU;

/// A gap is also wider than this many middle steps, so that captures with wide steps are not all gaps.
const STEPS_OF_A_GAP: f64 = 2.5;

/// Angles in [0, 2π), ascending.
#[derive(Clone, Debug)]
pub(super) struct Circle(Vec<f64>);

impl Circle {
    /// Angles in radians, in any order and turn.
    pub(super) fn new(angles: impl Iterator<Item = f64>) -> Self {
        let mut angles: Vec<f64> = angles.map(wrapped).collect();
        angles.sort_by(f64::total_cmp);
        Self(angles)
    }

    /// From each angle to the next one around; a lone angle is followed by itself, one turn on.
    fn steps(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let n = self.0.len();
        (0..n).map(move |i| {
            let next = if i + 1 < n { self.0[i + 1] } else { self.0[0] + TAU };
            (self.0[i], next - self.0[i])
        })
    }

    /// The middle of the steps in radians, the lower of two; `None` of fewer than two angles.
    pub(super) fn step(&self) -> Option<f64> {
        let mut steps: Vec<f64> = self.steps().map(|(_, step)| step).collect();
        steps.sort_by(f64::total_cmp);
        (steps.len() > 1).then(|| steps[(steps.len() - 1) / 2])
    }

    /// The widest step and the angle after it, in radians; the whole circle where there are no angles.
    pub(super) fn widest(&self) -> (f64, f64) {
        let widest = self.steps().max_by(|a, b| a.1.total_cmp(&b.1));
        widest.map_or((0.0, TAU), |(from, step)| (wrapped(from + step), step))
    }

    /// Steps wider than the options allow.
    pub(super) fn gaps(&self, options: &ChooseOptions) -> Vec<Gap> {
        let limit = self.limit(options);
        if self.0.is_empty() {
            return vec![Gap { from_deg: 0.0, to_deg: 360.0 }];
        }
        let wide = self.steps().filter(|(_, step)| *step > limit);
        wide.map(|(from, step)| Gap { from_deg: from.to_degrees(), to_deg: (from + step).to_degrees() }).collect()
    }

    /// Whether there is no gap.
    pub(super) fn is_closed(&self, options: &ChooseOptions) -> bool {
        self.0.len() > 2 && self.widest().1 <= self.limit(options)
    }

    fn limit(&self, options: &ChooseOptions) -> f64 {
        let limit = options.gap_deg.to_radians();
        // Two views make no ring, however evenly they lie.
        if self.0.len() > 2 { self.step().map_or(limit, |step| limit.max(STEPS_OF_A_GAP * step)) } else { limit }
    }
}

/// The same angle in [0, 2π).
fn wrapped(angle: f64) -> f64 {
    let angle = angle.rem_euclid(TAU);
    // A tiny negative angle rounds up to the whole turn.
    if angle < TAU { angle } else { 0.0 }
}
