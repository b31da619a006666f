//! Gaussian Markov random fields over a range map (Haindl and Filip; compared with as "GMRF" in Filip, Grim,
//! Haindl). What it shares with [`car2d`](super::car2d) and [`car3d`](super::car3d), file and cost included, is the
//! page of [`random_field`](super::random_field).
//!
//! Per group of pictures, band and decorrelated colour component, a texel given all others:
//! `Y_r = Σ_s a_s (Y_{r−s} + Y_{r+s}) + e_r`, s in half the neighbourhood, `E[e_r e_{r−s}] = σ² (δ₀ − a_s)`.
//!
//! - *Estimate*: least squares (pseudo-likelihood, Besag 1975), `γ = (Σ X Xᵀ)⁻¹ Σ X Y`, `X_s = Y_{r−s} + Y_{r+s}`;
//!   neighbours by an information criterion. Least squares may leave the valid set, `μ(ω) = 1 − 2 Σ a_s cos ω·s > 0`:
//!   all a are then shrunk by one factor until `μ ≥ 10⁻³`.
//! - *Synthesis*: on a torus, `Ŷ(k) = σ Ŵ(k) / √μ(k)` with W white noise: exact at any size.
//! - *Limits*: the correlation is symmetric under both reflections s → −s only; no phase, so no edges and no
//!   regular pattern beyond what the range map carries.

use super::container::{Fault, Reader, Stored, Writer};
use super::random_field::autoregression::{NEIGHBOURS, Scalar, ScalarCovariances, ScalarModel};
use super::random_field::decorrelated::Decorrelated;
use super::random_field::fourier::Wave;
use super::random_field::{self, RandomField};
use super::{FitReport, Frame, Synthesizer};
use crate::TextureError;
use capture::btf::Btf;
use nalgebra::Vector3;
use rustfft::num_complex::Complex64;

pub use super::random_field::Options;

/// Least `μ` of a field that is used: `1/√μ` amplifies the noise.
const LEAST_MU: f64 = 1e-3;

/// The codec.
#[derive(Clone, Debug, PartialEq)]
pub struct Gmrf(RandomField<Decorrelated<Markov>>);

/// Conditional on all neighbours.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Markov;

/// Fits the codec.
///
/// # Errors
/// Where the data cannot carry it.
pub fn fit(btf: &Btf, options: &Options) -> Result<(Gmrf, FitReport), TextureError> {
    let (field, report) = random_field::fit(btf, options)?;
    Ok((Gmrf(field), report))
}

impl ScalarModel for Markov {
    fn products(covariances: &ScalarCovariances, s: [i32; 2], t: [i32; 2]) -> (f64, f64) {
        let (apart, together) = ([s[0] - t[0], s[1] - t[1]], [s[0] + t[0], s[1] + t[1]]);
        (2.0 * (covariances.at(apart) + covariances.at(together)), 2.0 * covariances.at(s))
    }

    fn filter(model: &Scalar, wave: &Wave) -> Option<Complex64> {
        let terms = model.neighbours.iter().zip(&model.coefficients);
        let mu = 1.0 - 2.0 * terms.map(|(&s, a)| a * wave.shift(NEIGHBOURS[s]).re).sum::<f64>();
        (mu >= LEAST_MU).then(|| Complex64::new(1.0 / mu.sqrt(), 0.0))
    }
}

impl Synthesizer for Gmrf {
    fn frame(&self) -> &Frame {
        self.0.frame()
    }

    fn picture(&self, size: [usize; 2], seed: u64, light: &Vector3<f32>, view: &Vector3<f32>) -> Vec<f32> {
        self.0.picture(size, seed, light, view)
    }
}

impl Stored for Gmrf {
    fn write(&self, out: &mut Writer) {
        self.0.write(out);
    }

    fn read(from: &mut Reader<'_>, frame: Frame) -> Result<Self, Fault> {
        RandomField::read(from, frame).map(Self)
    }
}
