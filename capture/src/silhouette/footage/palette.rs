//! The colours of the object and of what is around it, as far as they are known.

/// Bins along a channel.
const BINS: usize = 16;

/// Share of colours never seen before.
const UNKNOWN: f32 = 0.3;

/// A density over encoded colours, per level cubed.
#[derive(Clone, Debug)]
pub(super) struct Palette {
    density: Vec<f32>,
}

impl Palette {
    /// Any colour is as likely as any other.
    pub(super) fn anything() -> Self {
        Self { density: vec![256.0_f32.powi(-3); BINS * BINS * BINS] }
    }

    /// Of colours seen; with few of them still nearly anything.
    pub(super) fn learned(colours: impl Iterator<Item = [f32; 3]>) -> Self {
        let mut counts = vec![0.0_f32; BINS * BINS * BINS];
        let mut total = 0.0_f32;
        for colour in colours {
            counts[bin(&colour)] += 1.0;
            total += 1.0;
        }
        let counts = [1, BINS, BINS * BINS].iter().fold(counts, |counts, &step| blurred(&counts, step));
        let uniform = 256.0_f32.powi(-3);
        let per_level = (BINS as f32 / 256.0).powi(3);
        // As if a thousand pixels of anything had been seen before.
        let known = (1.0 - UNKNOWN) * total / (total + 1000.0);
        let density = |count: &f32| (1.0 - known) * uniform + known * count / total.max(1.0) * per_level;
        Self { density: counts.iter().map(density).collect() }
    }

    /// Natural logarithm of the density at a colour.
    pub(super) fn log_density(&self, colour: &[f32; 3]) -> f32 {
        self.density[bin(colour)].ln()
    }

    /// Whether a colour is seen more often than were all colours alike.
    pub(super) fn has(&self, colour: &[f32; 3]) -> bool {
        self.density[bin(colour)] >= 256.0_f32.powi(-3)
    }
}

/// Of the object, and of what is around it.
#[derive(Clone, Debug)]
pub(super) struct Palettes {
    pub(super) object: Palette,
    pub(super) surroundings: Palette,
}

impl Palettes {
    /// As long as nothing is known.
    pub(super) fn anything() -> Self {
        Self { object: Palette::anything(), surroundings: Palette::anything() }
    }

    /// Natural logarithm of the odds that a colour is the object's.
    pub(super) fn log_odds(&self, colour: &[f32; 3]) -> f32 {
        self.object.log_density(colour) - self.surroundings.log_density(colour)
    }
}

fn bin(colour: &[f32; 3]) -> usize {
    let [r, g, b] = colour.map(|v| (v.clamp(0.0, 255.0) as usize) * BINS / 256);
    (b * BINS + g) * BINS + r
}

/// With (1, 2, 1) / 4 along the channel whose bins are `step` apart; the outermost bins keep what would fall off.
fn blurred(counts: &[f32], step: usize) -> Vec<f32> {
    let mut out = vec![0.0; counts.len()];
    for (at, &count) in counts.iter().enumerate() {
        let place = at / step % BINS;
        let below = if place > 0 { at - step } else { at };
        let above = if place + 1 < BINS { at + step } else { at };
        out[at] += 0.5 * count;
        out[below] += 0.25 * count;
        out[above] += 0.25 * count;
    }
    out
}
