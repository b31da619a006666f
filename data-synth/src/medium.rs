//! A body that scatters light inside: grey extinction, coloured scattering, no preferred direction.
//!
//! The paint of a translucent part says what a thick, flat piece of it reflects. Of a half-space of
//! isotropic scatterers of albedo `a` under even light from everywhere that is (van de Hulst 1980; Hapke,
//! "Theory of Reflectance and Emittance Spectroscopy", 1993, chapter 10), within 0.002:
//!
//! ```text
//! γ = √(1 − a)      r = (1 − γ)/(1 + γ) · (1 − γ / (3 (1 + γ)))
//! ```

use crate::material::Vec3;
use std::f32::consts::TAU;

/// What light walks through.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Medium {
    /// Between two scatterers, in metres.
    pub(crate) mean_free_path: f32,
}

impl Medium {
    /// How far light goes to the next scatterer; `u` in [0, 1).
    pub(crate) fn flight(&self, u: f32) -> f32 {
        -self.mean_free_path * (1.0 - u).ln()
    }
}

/// Albedo of the scatterers in a body that reflects `r` when thick: the formula above, solved for `γ`.
pub(crate) fn scattering_albedo(r: Vec3) -> Vec3 {
    r.map(|r| {
        let r = r.clamp(0.0, 1.0);
        let (a, b, c) = (3.0 * r + 2.0, 6.0 * r + 1.0, 3.0 * r - 3.0);
        let gamma = ((b * b - 4.0 * a * c).sqrt() - b) / (2.0 * a);
        1.0 - gamma * gamma
    })
}

/// A direction of the sphere, all alike.
pub(crate) fn isotropic(u: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * u[0];
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (s, c) = (TAU * u[1]).sin_cos();
    Vec3::new(r * c, r * s, z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::cosine_hemisphere;
    use crate::sampler::{mix, unit};

    #[test]
    fn a_thick_body_reflects_its_paint() {
        // A walk in the half-space z < 0, from below the surface until it comes out.
        for paint in [0.2_f32, 0.6, 0.9] {
            let albedo = scattering_albedo(Vec3::repeat(paint)).x;
            let medium = Medium { mean_free_path: 1.0 };
            let (n, mut sum, mut sum2) = (60_000_u32, 0.0_f64, 0.0_f64);
            for i in 0..n {
                let mut counter = mix(i);
                let mut next = || {
                    counter = mix(counter.wrapping_add(0x9e37_79b9));
                    unit(counter)
                };
                let mut direction = -cosine_hemisphere([next(), next()]);
                let (mut z, mut weight) = (0.0_f32, 1.0_f32);
                while weight > 1e-4 {
                    z += direction.z * medium.flight(next());
                    if z > 0.0 {
                        sum += f64::from(weight);
                        sum2 += f64::from(weight * weight);
                        break;
                    }
                    weight *= albedo;
                    direction = isotropic([next(), next()]);
                }
            }
            let mean = sum / f64::from(n);
            let error = ((sum2 / f64::from(n) - mean * mean) / f64::from(n)).sqrt();
            assert!((mean - f64::from(paint)).abs() < 3.0 * error + 2e-3, "{mean} ± {error} against {paint}");
        }
    }

    #[test]
    fn black_absorbs_and_white_scatters_all() {
        assert!(scattering_albedo(Vec3::zeros()).norm() < 1e-6);
        assert!((scattering_albedo(Vec3::repeat(1.0)) - Vec3::repeat(1.0)).norm() < 1e-6);
    }
}
