//! How the platter turns: never quite steadily.

use crate::faults::normal;
use crate::sampler::splitmix;
use std::f64::consts::{SQRT_2, TAU};

/// Slowest the platter turns, as a share of its mean speed: it never stops or turns back.
const SLOWEST: f64 = 0.05;

/// The angle of every frame in radians, from zero to `turns` full turns. The speed from frame to frame varies by
/// `unsteadiness` (standard deviation over mean): an axle out of true once a turn, a belt a few times, and chance.
pub(super) fn angles(frames: usize, turns: f64, unsteadiness: f64, seed: u64) -> Vec<f64> {
    let phase = |k: u64| TAU * (splitmix(seed ^ splitmix(0xd21e + k)) >> 11) as f64 / (1_u64 << 53) as f64;
    let [axle, belt] = [phase(0), phase(1)];
    let steps = frames.saturating_sub(1);
    let speed = |k: usize| {
        let at = TAU * turns * (k as f64 + 0.5) / steps as f64;
        let [chance, _] = normal(splitmix(splitmix(seed).wrapping_add(k as u64)));
        // Variances 0.375, 0.375 and 0.25.
        let wobble = 0.612 * SQRT_2 * ((at + axle).sin() + (5.3 * at + belt).sin()) + 0.5 * chance;
        (1.0 + unsteadiness * wobble).max(SLOWEST)
    };
    let mut reached = vec![0.0; frames];
    for k in 0..steps {
        reached[k + 1] = reached[k] + speed(k);
    }
    let all = reached.last().copied().unwrap_or(0.0).max(f64::MIN_POSITIVE);
    reached.iter().map(|angle| angle / all * turns * TAU).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_platter_turns_one_way_as_far_and_as_unsteadily_as_asked() {
        for (unsteadiness, slack) in [(0.0, 1e-9), (0.05, 0.006), (0.2, 0.025)] {
            let angles = angles(2001, 3.0, unsteadiness, 7);
            let steps: Vec<f64> = angles.windows(2).map(|pair| pair[1] - pair[0]).collect();
            assert!(steps.iter().all(|&step| step > 0.0));
            assert!(angles[0] == 0.0 && (angles[2000] - 3.0 * TAU).abs() < 1e-9);
            let mean = 3.0 * TAU / 2000.0;
            let spread = (steps.iter().map(|s| (s / mean - 1.0).powi(2)).sum::<f64>() / 2000.0).sqrt();
            assert!((spread - unsteadiness).abs() < slack, "{spread} for {unsteadiness}");
        }
        assert_eq!(angles(1, 1.0, 0.1, 0), [0.0]);
    }
}
