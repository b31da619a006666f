//! Faults of a real camera, kept apart from the ideal pictures and applied after them.

use crate::error::SynthError;
use crate::film::{decode, encode};
use crate::sampler::{pixel_seed, splitmix};
use capture::Image;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Noise of a sensor: shot noise by a normal approximation, and read noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorNoise {
    /// Electrons that make a pixel white; fewer is noisier. A phone in good light has about 5000.
    pub full_well: f64,
    /// Standard deviation of the read-out, in electrons.
    pub read_electrons: f64,
}

impl SensorNoise {
    pub(crate) fn check(&self) -> Result<(), SynthError> {
        let refuse = |option, value: f64, allowed: &str| {
            Err(SynthError::Option { option, value: value.to_string(), allowed: allowed.to_owned() })
        };
        if !(self.full_well.is_finite() && self.full_well >= 1.0) {
            return refuse("full_well", self.full_well, "at least 1 electron");
        }
        if !(self.read_electrons.is_finite() && self.read_electrons >= 0.0) {
            return refuse("read_electrons", self.read_electrons, "zero or positive");
        }
        Ok(())
    }

    /// Adds noise to a picture; the same for the same seed and view.
    pub(crate) fn apply(&self, image: &mut Image<[u8; 3]>, seed: u64, view: usize) {
        let width = image.width().max(1);
        image.pixels_mut().par_iter_mut().enumerate().for_each(|(i, pixel)| {
            let mut state = u64::from(pixel_seed(seed ^ 0x5e45_0a11, view, i % width, i / width));
            for c in pixel {
                state = splitmix(state);
                let electrons = f64::from(decode(f32::from(*c))) * self.full_well;
                let sigma = (electrons + self.read_electrons * self.read_electrons).sqrt();
                let noisy = (electrons + sigma * normal(state)) / self.full_well;
                *c = encode(noisy as f32).round() as u8;
            }
        });
    }
}

/// A standard normal number (Box and Muller 1958).
fn normal(state: u64) -> f64 {
    let u = ((state >> 32) as f64 + 0.5) / 4_294_967_296.0;
    let v = (state & 0xffff_ffff) as f64 / 4_294_967_296.0;
    (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_the_stated_spread_in_linear_light() {
        let noise = SensorNoise { full_well: 2000.0, read_electrons: 10.0 };
        let mut image = Image::filled(200, 200, [128; 3]);
        noise.apply(&mut image, 4, 0);
        let values: Vec<f64> = image.pixels().iter().map(|p| f64::from(decode(f32::from(p[1])))).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let sigma = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt();
        let level = f64::from(decode(128.0));
        let expected = (level * 2000.0 + 100.0).sqrt() / 2000.0;
        assert!((mean - level).abs() < 4.0 * expected / 200.0 + 1e-4);
        assert!((sigma / expected - 1.0).abs() < 0.05, "{sigma} against {expected}");
    }
}
