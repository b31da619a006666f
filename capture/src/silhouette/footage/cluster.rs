//! The colour most samples agree on: what a place looks like when nothing stands before it.

/// Samples near each other.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cluster {
    /// Mean, encoded levels.
    pub(super) colour: [f32; 3],
    /// Standard deviation of a channel about it.
    pub(super) spread: f32,
    /// How many they are.
    pub(super) support: u8,
}

impl Cluster {
    /// A place that the object covers in nearly all frames.
    pub(super) const COVERED: Self = Self { colour: [0.0; 3], spread: f32::INFINITY, support: 0 };

    /// Whether the object covers the place in nearly all frames.
    pub(super) fn is_covered(&self) -> bool {
        self.spread == f32::INFINITY
    }
}

/// Whether two colours may be the same place in other light: noise and a few percent of shade.
pub(super) fn is_near(a: &[f32; 3], b: &[f32; 3]) -> bool {
    let brightest = a[0].max(a[1]).max(a[2]);
    let tolerance = 10.0 + 0.07 * brightest;
    (0..3).all(|c| (a[c] - b[c]).abs() <= tolerance)
}

/// The largest set of samples near one of them; `None` without samples. An occluder of changing colour may have
/// the majority.
pub(super) fn densest(samples: &[[f32; 3]]) -> Option<Cluster> {
    let mut best = (0, 0);
    for (i, a) in samples.iter().enumerate() {
        let count = samples.iter().filter(|b| is_near(a, b)).count();
        if count > best.0 {
            best = (count, i);
        }
        // No other set can be larger by much.
        if 3 * count >= 2 * samples.len() {
            break;
        }
    }
    around(samples, samples.get(best.1)?)
}

/// The samples near `center`; `None` where there are none.
pub(super) fn around(samples: &[[f32; 3]], center: &[f32; 3]) -> Option<Cluster> {
    let members = || samples.iter().filter(|s| is_near(center, s));
    let count = members().count();
    if count == 0 {
        return None;
    }
    let share = 1.0 / count as f32;
    let mut colour = [0.0_f32; 3];
    members().for_each(|m| (0..3).for_each(|c| colour[c] += m[c] * share));
    let squares: f32 = members().map(|m| (0..3).map(|c| (m[c] - colour[c]).powi(2)).sum::<f32>()).sum();
    Some(Cluster { colour, spread: (squares * share / 3.0).sqrt(), support: count.min(255) as u8 })
}
