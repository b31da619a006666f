//! A body in which light is scattered, seen from outside: where light that enters comes out again.
//!
//! Light leaves around the point it enters by the diffusion profile of Christensen and Burley
//! ("Approximate Reflectance Profiles for Efficient Subsurface Scattering", 2015, eq. 3 and 6, diffuse
//! transmission), by colour channel, `r` the straight distance, `ℓ` the mean free path:
//!
//! ```text
//! R(r) = A s (exp(−s r/ℓ) + exp(−s r/(3 ℓ))) / (8 π ℓ r)      s = 1.9 − A + 3.5 (A − 0.8)²
//! ```
//!
//! It reflects `A` in all, on a plane and (chords of a sphere sweep `π r²` too) on a ball. Points are found
//! by probing along three axes, which are combined by the balance heuristic (King, Kulla, Conty, Fajardo, "BSSRDF
//! Importance Sampling", SIGGRAPH Talks 2013).

use crate::material::Vec3;
use std::f32::consts::PI;

/// Share of the profile, by area, beyond which it is cut off.
const TAIL: f32 = 1e-3;

/// What light is scattered in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Medium {
    /// Between two scatterings, in metres.
    pub(crate) mean_free_path: f32,
}

/// The profile of a medium under one paint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Profile {
    /// `ℓ/s` by channel.
    scale: Vec3,
    /// Farthest distance considered.
    reach: f32,
}

impl Medium {
    /// The profile where the surface reflects `paint` in all.
    pub(crate) fn profile(&self, paint: Vec3) -> Profile {
        let scale = paint.map(|a| self.mean_free_path / (1.9 - a + 3.5 * (a - 0.8) * (a - 0.8)));
        // The slower of the two exponentials holds three quarters.
        Profile { scale, reach: 3.0 * scale.max() * (0.75 / TAIL).ln() }
    }
}

impl Profile {
    /// How far from the point light may come out.
    pub(crate) fn reach(&self) -> f32 {
        self.reach
    }

    /// `R/A` by channel, per area, at a distance.
    pub(crate) fn density(&self, r: f32) -> Vec3 {
        // The pole at zero is integrable; nobody is nearer than rounding.
        let r = r.max(1e-3 * self.scale.min());
        self.scale.map(|d| ((-r / d).exp() + (-r / (3.0 * d)).exp()) / (8.0 * PI * d * r))
    }

    /// A distance drawn by the mean density of the channels; none beyond the reach.
    pub(crate) fn sample(&self, u: [f32; 2]) -> Option<f32> {
        let channel = u[0] * 3.0;
        let index = (channel as usize).min(2);
        // A quarter of the area lies in the fast exponential.
        let slow = if channel - index as f32 >= 0.25 { 3.0 } else { 1.0 };
        let r = -(1.0 - u[1]).ln() * self.scale[index] * slow;
        (r < self.reach).then_some(r)
    }

    /// Density per area of [`Profile::sample`] spread around a circle.
    pub(crate) fn pdf(&self, r: f32) -> f32 {
        self.density(r).sum() / 3.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{mix, unit};

    #[test]
    fn all_that_enters_a_plane_comes_out() {
        // ∫ R/A 2πr dr = 1, and samples follow it: their share within each radius.
        let profile = Medium { mean_free_path: 1.0 }.profile(Vec3::new(0.1, 0.5, 0.9));
        let steps = 400_000;
        let step = profile.reach() / steps as f32;
        let ring = |i: usize| {
            let r = (i as f32 + 0.5) * step;
            (profile.density(r) * (2.0 * PI * r * step)).cast::<f64>()
        };
        let total: nalgebra::Vector3<f64> = (0..steps).map(ring).sum();
        assert!(total.iter().all(|t| (t - 1.0).abs() < 2e-3), "{total}");
        let n = 200_000;
        let drawn: Vec<f32> = (0..n).filter_map(|i| profile.sample([unit(mix(2 * i)), unit(mix(2 * i + 1))])).collect();
        for radius in [0.3_f32, 1.0, 3.0] {
            let within = drawn.iter().filter(|&&r| r < radius).count() as f64 / f64::from(n);
            let expected: f64 = (0..(radius / step) as usize).map(|i| ring(i).mean()).sum();
            assert!((within - expected).abs() < 0.005, "{radius}: {within} against {expected}");
        }
    }
}
