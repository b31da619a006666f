//! Causal autoregression, component by component, over a range map (Haindl and Filip; compared with as "2D CAR" in
//! Filip, Grim, Haindl). What it shares with [`gmrf`](super::gmrf) and [`car3d`](super::car3d), file and cost
//! included, is the page of [`random_field`](super::random_field).
//!
//! Per group of pictures, band and decorrelated colour component, a texel given those before it in reading order:
//! `Y_r = Σ_s a_s Y_{r−s} + e_r`, s = (x, y) with y > 0, or y = 0 and x > 0; e white, of variance σ².
//!
//! - *Estimate*: the Bayesian one under a weak normal–Wishart prior, which is least squares with a ridge,
//!   `γ = V_xx⁻¹ V_xy`, `σ² = λ/β`, `λ = V_yy − V_xyᵀ V_xx⁻¹ V_xy`. Neighbours are added while the information
//!   criterion falls, the leading terms of the posterior probability of a neighbourhood.
//! - *Synthesis*: the recursion on a torus is linear, so its fixed point, which passes over and over the tile
//!   approach, has a closed form: `Ŷ(k) = σ Ŵ(k) / (1 − Σ a_s e^(−iω·s))`. No start to be forgotten, no seam, and a
//!   recursion that would grow without bound raster by raster stays finite.
//! - A denominator below 10⁻² would ring over the whole tile: all a are then shrunk by one factor.
//! - *Limits*: no edges and no regular pattern beyond what the range map carries.

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

/// Least `|1 − Σ a_s e^(−iω·s)|` of a field that is used.
const LEAST_DENOMINATOR: f64 = 1e-2;

/// The codec.
#[derive(Clone, Debug, PartialEq)]
pub struct Car2d(RandomField<Decorrelated<Causal>>);

/// Conditional on what comes before.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Causal;

/// Fits the codec.
///
/// # Errors
/// Where the data cannot carry it.
pub fn fit(btf: &Btf, options: &Options) -> Result<(Car2d, FitReport), TextureError> {
    let (field, report) = random_field::fit(btf, options)?;
    Ok((Car2d(field), report))
}

impl ScalarModel for Causal {
    fn products(covariances: &ScalarCovariances, s: [i32; 2], t: [i32; 2]) -> (f64, f64) {
        (covariances.at([t[0] - s[0], t[1] - s[1]]), covariances.at(s))
    }

    fn filter(model: &Scalar, wave: &Wave) -> Option<Complex64> {
        let terms = model.neighbours.iter().zip(&model.coefficients);
        let denominator =
            Complex64::new(1.0, 0.0) - terms.map(|(&s, &a)| wave.shift(NEIGHBOURS[s]) * a).sum::<Complex64>();
        (denominator.norm() >= LEAST_DENOMINATOR).then(|| denominator.inv())
    }
}

impl Synthesizer for Car2d {
    fn frame(&self) -> &Frame {
        self.0.frame()
    }

    fn picture(&self, size: [usize; 2], seed: u64, light: &Vector3<f32>, view: &Vector3<f32>) -> Vec<f32> {
        self.0.picture(size, seed, light, view)
    }
}

impl Stored for Car2d {
    fn write(&self, out: &mut Writer) {
        self.0.write(out);
    }

    fn read(from: &mut Reader<'_>, frame: Frame) -> Result<Self, Fault> {
        RandomField::read(from, frame).map(Self)
    }
}
