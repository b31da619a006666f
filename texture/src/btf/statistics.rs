//! How alike two textures are that need not agree texel by texel: what [`Synthesizer`](super::Synthesizer)s are judged
//! by.
//!
//! All figures are of encoded samples on the scale of 0 to 255, unrounded; both textures continue themselves on all
//! sides. Luminance is the mean of the channels. Equal textures, and textures shifted against one another, have a
//! distance of 0 in every figure.
//!
//! | figure | definition |
//! |---|---|
//! | `mean_difference` | RMS over the channels of the difference of means |
//! | `deviation_ratio` | standard deviation of the luminance, second over first |
//! | `earth_mover` | mean over the channels of `∫ \|Q₁(u) − Q₂(u)\| du`, Q the quantile functions |
//! | `autocorrelation` | RMS difference of the luminance's autocorrelations, lags up to 8 texels and less than half the tile |
//! | `band_db` | power of the luminance per octave, finest first, second over first, dB |
//! | `spectrum_db` | RMS over octaves and four sectors of 45° of the power's ratio, dB |
//!
//! Powers below that of rounding to whole levels (1/12) count as that: no texture is quieter.

use super::random_field::fourier::{Fourier, frequency};
use std::f64::consts::PI;

/// Longest lag of the autocorrelation.
const LONGEST_LAG: usize = 8;
const OCTAVES: usize = 4;
const SECTORS: usize = 4;
/// Points at which quantile functions are compared.
const QUANTILES: usize = 512;
/// Variance of rounding to whole levels.
const ROUNDING: f64 = 1.0 / 12.0;

/// See the module's table.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct TextureStatistics {
    /// Levels of 255.
    pub mean_difference: f64,
    /// 1 where the contrast is the same.
    pub deviation_ratio: f64,
    /// Levels of 255.
    pub earth_mover: f64,
    /// 0 to 2.
    pub autocorrelation: f64,
    /// 0 where an octave holds the same power; finest first, the last holds all that is coarser.
    pub band_db: [f64; OCTAVES],
    /// dB.
    pub spectrum_db: f64,
}

impl TextureStatistics {
    /// The mean of each figure; of none, that of equal textures.
    pub fn mean(all: &[Self]) -> Self {
        let count = all.len().max(1) as f64;
        let mean = |of: fn(&Self) -> f64| all.iter().map(of).sum::<f64>() / count;
        Self {
            mean_difference: mean(|s| s.mean_difference),
            deviation_ratio: if all.is_empty() { 1.0 } else { mean(|s| s.deviation_ratio) },
            earth_mover: mean(|s| s.earth_mover),
            autocorrelation: mean(|s| s.autocorrelation),
            band_db: std::array::from_fn(|octave| all.iter().map(|s| s.band_db[octave]).sum::<f64>() / count),
            spectrum_db: mean(|s| s.spectrum_db),
        }
    }
}

/// Compares pictures of `[width, height]` texels, (y, x, channel), nominally 0 to 1. An empty one compares as black.
pub fn compare(
    original: &[f32],
    original_size: [usize; 2],
    synthesized: &[f32],
    synthesized_size: [usize; 2],
) -> TextureStatistics {
    let first = Texture::new(original, original_size);
    let second = Texture::new(synthesized, synthesized_size);
    let square = |c: usize| (first.mean(c) - second.mean(c)).powi(2);
    let moved = |c: usize| {
        let pairs = first.quantiles[c].iter().zip(&second.quantiles[c]);
        pairs.map(|(a, b)| (a - b).abs()).sum::<f64>() / QUANTILES as f64
    };
    let ratio = |a: f64, b: f64| 10.0 * ((b + ROUNDING) / (a + ROUNDING)).log10();
    let band = |octave: usize| {
        let sum = |t: &Texture| t.power[octave].iter().sum::<f64>();
        ratio(sum(&first), sum(&second))
    };
    let cells = (0..OCTAVES * SECTORS).map(|i| (i / SECTORS, i % SECTORS));
    let squares = cells.map(|(o, s)| ratio(first.power[o][s], second.power[o][s]).powi(2));
    TextureStatistics {
        mean_difference: ((0..3).map(square).sum::<f64>() / 3.0).sqrt(),
        deviation_ratio: ((second.variance() + ROUNDING) / (first.variance() + ROUNDING)).sqrt(),
        earth_mover: (0..3).map(moved).sum::<f64>() / 3.0,
        autocorrelation: autocorrelation_distance(&first, &second),
        band_db: std::array::from_fn(band),
        spectrum_db: (squares.sum::<f64>() / (OCTAVES * SECTORS) as f64).sqrt(),
    }
}

/// What a texture is compared by.
struct Texture {
    size: [usize; 2],
    /// Per channel, the quantile function at evenly spaced points.
    quantiles: [Vec<f64>; 3],
    /// Autocovariance of the luminance, all lags.
    covariance: Vec<f64>,
    /// Power of the luminance per (octave, sector).
    power: [[f64; SECTORS]; OCTAVES],
}

impl Texture {
    fn new(picture: &[f32], size: [usize; 2]) -> Self {
        let black = [0.0; 3];
        let (picture, size) = if picture.len() < 3 { (black.as_slice(), [1, 1]) } else { (picture, size) };
        let channel =
            |c: usize| -> Vec<f64> { picture.iter().skip(c).step_by(3).map(|&v| 255.0 * f64::from(v)).collect() };
        let luminance: Vec<f64> =
            picture.chunks_exact(3).map(|p| 255.0 / 3.0 * p.iter().map(|&v| f64::from(v)).sum::<f64>()).collect();
        let fourier = Fourier::new(size);
        let mut spectrum = fourier.forward(&luminance);
        spectrum[0] = Default::default();
        let scale = 1.0 / luminance.len() as f64;
        spectrum.iter_mut().for_each(|v| *v = (v.norm_sqr() * scale).into());
        let mut power = [[0.0; SECTORS]; OCTAVES];
        for (k, v) in spectrum.iter().enumerate().skip(1) {
            let (x, y) = (frequency(k % size[0], size[0]), frequency(k / size[0], size[1]));
            let octave = (-(x.hypot(y) / PI).log2()).floor().clamp(0.0, (OCTAVES - 1) as f64) as usize;
            // Sectors are centred on the axes and the diagonals.
            let sector = (y.atan2(x).rem_euclid(PI) / PI * SECTORS as f64).round() as usize % SECTORS;
            power[octave][sector] += v.re * scale;
        }
        Self { size, quantiles: [0, 1, 2].map(|c| quantiles(channel(c))), covariance: fourier.inverse(spectrum), power }
    }

    fn mean(&self, channel: usize) -> f64 {
        self.quantiles[channel].iter().sum::<f64>() / QUANTILES as f64
    }

    fn variance(&self) -> f64 {
        self.covariance[0].max(0.0)
    }

    /// Of a texture that is constant but for rounding, 0 at every lag.
    fn correlation(&self, x: isize, y: isize) -> f64 {
        let [width, height] = self.size;
        let place = y.rem_euclid(height as isize) as usize * width + x.rem_euclid(width as isize) as usize;
        self.covariance[place] / (self.variance() + ROUNDING)
    }
}

/// The mean of each of [`QUANTILES`] equal parts of the sorted values: their mean is that of the values.
fn quantiles(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    let mut sums = vec![0.0];
    values.iter().for_each(|v| sums.push(sums[sums.len() - 1] + v));
    // The integral of the quantile function up to a share of the values.
    let integral = |i: usize| {
        let at = i as f64 / QUANTILES as f64 * values.len() as f64;
        let whole = (at.floor() as usize).min(values.len() - 1);
        sums[whole] + (at - whole as f64) * values[whole]
    };
    let part = QUANTILES as f64 / values.len() as f64;
    (0..QUANTILES).map(|i| (integral(i + 1) - integral(i)) * part).collect()
}

fn autocorrelation_distance(first: &Texture, second: &Texture) -> f64 {
    let reach = |axis: usize| (first.size[axis].min(second.size[axis]).saturating_sub(1) / 2).min(LONGEST_LAG) as isize;
    let (right, down) = (reach(0), reach(1));
    let lags = (0..=down).flat_map(|y| (-right..=right).map(move |x| (x, y)));
    let lags: Vec<(isize, isize)> = lags.filter(|&lag| lag != (0, 0)).collect();
    let square = |&(x, y): &(isize, isize)| (first.correlation(x, y) - second.correlation(x, y)).powi(2);
    (lags.iter().map(square).sum::<f64>() / lags.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stripes(size: usize, shift: usize) -> Vec<f32> {
        let level = |i: usize| if (i % size + shift) % 8 < 4 { 0.25 } else { 0.75 };
        (0..size * size).flat_map(|i| [level(i); 3]).collect()
    }

    #[test]
    fn a_shifted_texture_is_the_same_at_any_size() {
        let same = compare(&stripes(32, 0), [32, 32], &stripes(64, 3), [64, 64]);
        assert!(same.mean_difference < 1e-4 && same.earth_mover < 1e-4, "{same:?}");
        assert!(same.autocorrelation < 1e-4 && same.spectrum_db < 1e-3, "{same:?}");
        assert!((same.deviation_ratio - 1.0).abs() < 1e-6, "{same:?}");
    }

    #[test]
    fn the_earth_mover_moves_a_level() {
        let lighter: Vec<f32> = stripes(16, 0).iter().map(|v| v + 10.0 / 255.0).collect();
        let moved = compare(&stripes(16, 0), [16, 16], &lighter, [16, 16]);
        assert!((moved.earth_mover - 10.0).abs() < 1e-3 && (moved.mean_difference - 10.0).abs() < 1e-3, "{moved:?}");
    }

    #[test]
    fn turned_stripes_differ_in_spectrum_and_correlation_alone() {
        let upright = stripes(32, 0);
        let turned: Vec<f32> =
            (0..32 * 32).flat_map(|i| [0, 1, 2].map(|c| upright[3 * (i % 32 * 32 + i / 32) + c])).collect();
        let figures = compare(&upright, [32, 32], &turned, [32, 32]);
        assert!(figures.earth_mover < 1e-4 && figures.band_db.iter().all(|db| db.abs() < 1e-3), "{figures:?}");
        assert!(figures.spectrum_db > 10.0 && figures.autocorrelation > 0.3, "{figures:?}");
    }

    #[test]
    fn constant_and_empty_textures_have_an_answer() {
        let figures = compare(&[], [0, 0], &[0.0; 3], [1, 1]);
        assert_eq!(figures.earth_mover, 0.0);
        assert_eq!(figures.deviation_ratio, 1.0);
        assert_eq!(figures.spectrum_db, 0.0);
    }
}
