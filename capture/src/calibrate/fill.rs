//! Where a platter stood between the pictures that show it: its speed is steady but for a wobble once a turn.

use super::homography::median;
use nalgebra::{Matrix4, Vector4};
use std::f64::consts::PI;

/// Longest gap filled where too little is known of the motion to judge it, in radians.
const SHORT: f64 = 15.0 * PI / 180.0;
/// Most uncertain angle that is still told, in radians.
pub(super) const MOST_DEVIATION: f64 = PI / 180.0;
/// Fewest angles that tell a speed and its errors.
const ENOUGH: usize = 12;
/// Turn over which a wobble once a turn shows itself, in radians.
const WOBBLE_RANGE: f64 = 1.5 * PI;
/// Rounds of reweighting, and of finding an angle from a time.
const ROUNDS: usize = 8;

/// Angles by time, and what is usual between them.
#[derive(Clone, Debug)]
pub(super) struct Track {
    knots: Vec<(f64, f64)>,
    /// `θ = c₀ + c₁ t + c₂ cos θ + c₃ sin θ`, times since the first knot.
    motion: Option<Vector4<f64>>,
    /// How far, usually, an angle lies from its neighbours' line, and the time between those.
    usual: Option<(f64, f64)>,
    /// How far, usually, an angle lies from the motion.
    spread: f64,
}

impl Track {
    /// From times and unwrapped angles, by time; of equal times the first counts.
    pub(super) fn new(mut knots: Vec<(f64, f64)>) -> Self {
        knots.dedup_by(|next, before| next.0.partial_cmp(&before.0) != Some(std::cmp::Ordering::Greater));
        let motion = (knots.len() >= ENOUGH).then(|| steady(&knots)).flatten();
        let mut track = Self { knots, motion, usual: None, spread: 0.0 };
        if track.knots.len() >= ENOUGH {
            let rests: Vec<(f64, f64)> = track.knots.iter().map(|&(t, a)| (t, a - track.expected(t))).collect();
            let misses: Vec<f64> = rests.windows(3).map(|w| (w[1].1 - line(w[0], w[2], w[1].0)).abs()).collect();
            let gaps: Vec<f64> = rests.windows(3).map(|w| w[2].0 - w[0].0).collect();
            let deviation = (1.4826 * median(&misses)).max(1e-4);
            track.usual = Some((deviation, median(&gaps)));
            let sizes: Vec<f64> = rests.iter().map(|r| r.1.abs()).collect();
            track.spread = 1.4826 * median(&sizes);
        }
        track
    }

    /// Mean speed in radians per second; `None` of too few angles.
    pub(super) fn speed(&self) -> Option<f64> {
        let ((first, from), (last, to)) = (self.knots.first()?, self.knots.last()?);
        (last > first).then(|| (to - from) / (last - first))
    }

    /// Angle and its standard deviation; `None` where it is uncertain by more than [`MOST_DEVIATION`].
    pub(super) fn at(&self, time: f64) -> Option<(f64, f64)> {
        let after = self.knots.partition_point(|knot| knot.0 <= time);
        let known = after.checked_sub(1).and_then(|n| self.knots.get(n)).filter(|knot| knot.0 == time);
        if let Some(&(_, angle)) = known {
            return Some((angle, self.usual.map_or(0.0, |(deviation, _)| deviation)));
        }
        let rest = |knot: &(f64, f64)| (knot.0, knot.1 - self.expected(knot.0));
        let (offset, gap) = match (after.checked_sub(1).and_then(|n| self.knots.get(n)), self.knots.get(after)) {
            (Some(before), Some(next)) => (line(rest(before), rest(next), time), next.0 - before.0),
            // Beyond the ends nothing holds the angle from the other side.
            (Some(end), None) | (None, Some(end)) => {
                self.motion?;
                (rest(end).1, 2.0 * (time - end.0).abs())
            }
            (None, None) => return None,
        };
        let turn = gap * self.speed()?.abs();
        let deviation = match self.usual {
            // Errors of a speed that drifts by chance grow with the 1.5th power of time, up to what the motion leaves.
            Some((deviation, usual)) => {
                let grown = deviation * (gap / usual).max(1.0).powf(1.5);
                if self.motion.is_some() { grown.min(deviation.hypot(2.0 * self.spread)) } else { grown }
            }
            None if turn < SHORT => 0.05 * turn,
            None => return None,
        };
        (deviation <= MOST_DEVIATION).then(|| (self.expected(time) + offset, deviation))
    }

    /// What the motion says; 0 without one.
    fn expected(&self, time: f64) -> f64 {
        let (Some(c), Some((start, _))) = (self.motion, self.knots.first()) else { return 0.0 };
        let steady = c[0] + c[1] * (time - start);
        let mut angle = steady;
        for _ in 0..ROUNDS {
            angle = steady + c[2] * angle.cos() + c[3] * angle.sin();
        }
        angle
    }
}

/// On the line through two points.
fn line(a: (f64, f64), b: (f64, f64), at: f64) -> f64 {
    a.1 + (b.1 - a.1) * (at - a.0) / (b.0 - a.0)
}

/// The steady motion with its wobble, by reweighted least squares; without the wobble where too little of a turn is
/// seen. `None` where the speed is not steady at all.
fn steady(knots: &[(f64, f64)]) -> Option<Vector4<f64>> {
    let (start, range) = (knots[0].0, (knots[knots.len() - 1].1 - knots[0].1).abs());
    let has_wobble = if range > WOBBLE_RANGE { 1.0 } else { 0.0 };
    let row =
        |&(t, angle): &(f64, f64)| Vector4::new(1.0, t - start, has_wobble * angle.cos(), has_wobble * angle.sin());
    let mut weights = vec![1.0; knots.len()];
    let mut solution = Vector4::zeros();
    for _ in 0..ROUNDS {
        let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
        for (knot, w) in knots.iter().zip(&weights) {
            normal += *w * row(knot) * row(knot).transpose();
            right += *w * row(knot) * knot.1;
        }
        // A term that is not asked for stays 0.
        (2..4).for_each(|i| normal[(i, i)] += 1e-9 + (1.0 - has_wobble));
        solution = normal.cholesky()?.solve(&right);
        let misses: Vec<f64> = knots.iter().map(|knot| (knot.1 - row(knot).dot(&solution)).abs()).collect();
        let scale = (3.0 * 1.4826 * median(&misses)).max(1e-4);
        weights = misses.iter().map(|m| 1.0 / (1.0 + (m / scale).powi(2))).collect();
    }
    let is_steady = solution.iter().all(|v| v.is_finite()) && solution[2].hypot(solution[3]) < 0.5;
    is_steady.then_some(solution)
}
