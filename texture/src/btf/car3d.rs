//! Causal autoregression of colour vectors over a range map (Haindl and Filip; compared with as "3D CAR" in Filip,
//! Grim, Haindl). What it shares with [`gmrf`](super::gmrf) and [`car2d`](super::car2d), file and cost included, is
//! the page of [`random_field`](super::random_field).
//!
//! As [`car2d`](super::car2d), with a texel's colour Y_r ∈ R³ and 3 × 3 coefficients: `Y_r = Σ_s A_s Y_{r−s} + e_r`,
//! e of covariance Σ (3 × 3). Colours are not decorrelated first: what one channel says of the other, at a distance
//! too, is in A. 9η + 6 numbers for η neighbours.
//!
//! - *Estimate*: `γ = V_yx V_xx⁻¹` (3 × 3η), `Σ = V_yy − γ V_yxᵀ`, with a ridge; neighbours by the information
//!   criterion with `ln det Σ`.
//! - *Synthesis*: `Ŷ(k) = (I − Σ A_s e^(−iω·s))⁻¹ L Ŵ(k)`, `Σ = L Lᵀ`: the fixed point of the recursion on a torus.
//! - An inverse of norm above 100 would ring over the whole tile: all A are then shrunk by one factor.
//! - *Limits*: as [`car2d`](super::car2d), and a bigger file.

use super::container::{Fault, Reader, Stored, Writer};
use super::random_field::autoregression::{
    CONSTANT, Covariances, NEIGHBOURS, choose, largest_valid_share, mean_gain, probes,
};
use super::random_field::decorrelated::{mask, neighbours, running_counts};
use super::random_field::fourier::Wave;
use super::random_field::numbers::{Numbers, Width};
use super::random_field::{self, BandFilter, FieldModel, RandomField};
use super::{FitReport, Frame, Precision, Synthesizer};
use crate::TextureError;
use capture::btf::Btf;
use nalgebra::{DMatrix, Matrix3, Vector3};
use rustfft::num_complex::Complex64;

pub use super::random_field::Options;

/// Largest norm of the inverse that is used.
const LARGEST_GAIN: f64 = 1e2;
/// Added to every variance, as a share of the mean of the three channels': grey pictures have two that vanish.
const RIDGE: f64 = 1e-5;

/// The codec.
#[derive(Clone, Debug, PartialEq)]
pub struct Car3d(RandomField<Coloured>);

/// The texture of one group of pictures.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Coloured {
    /// Bit s stands for neighbour s; one word per band.
    masks: Vec<u32>,
    /// Lower triangles of L, six per band, row by row.
    factors: Numbers,
    /// Nine per neighbour, column by column.
    coefficients: Numbers,
}

/// The model of one band.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct VectorModel {
    pub(super) neighbours: Vec<usize>,
    pub(super) coefficients: Vec<Matrix3<f64>>,
    /// Lower triangular; noise is L times white noise.
    pub(super) factor: Matrix3<f64>,
}

/// Fits the codec.
///
/// # Errors
/// Where the data cannot carry it.
pub fn fit(btf: &Btf, options: &Options) -> Result<(Car3d, FitReport), TextureError> {
    let (field, report) = random_field::fit(btf, options)?;
    Ok((Car3d(field), report))
}

impl VectorModel {
    /// Neighbours, coefficients and noise, valid at any size, with the variance of the covariances.
    pub(super) fn estimate(covariances: &Covariances) -> Self {
        let variance = covariances.at([0, 0]).trace().max(0.0);
        if variance <= CONSTANT {
            return Self { neighbours: Vec::new(), coefficients: Vec::new(), factor: Matrix3::zeros() };
        }
        let left = |chosen: &[usize]| {
            let factor = Self::estimate_with(covariances, chosen).factor;
            2.0 * factor.diagonal().iter().map(|d| d.max(f64::MIN_POSITIVE).ln()).sum::<f64>()
        };
        let fitted = Self::estimate_with(covariances, &choose(covariances.size, 9, left));
        let share = largest_valid_share(|share| {
            let tried = fitted.shrunk(share);
            probes().all(|wave| tried.filter(&wave).is_some())
        });
        let mut model = fitted.shrunk(share);
        let gain = mean_gain(covariances.size, |wave| model.filter(wave).map_or(0.0, |f| f.norm_squared()));
        model.factor *= if gain > 0.0 { (variance / gain).sqrt() } else { 0.0 };
        model
    }

    /// Least squares with these neighbours; the noise is what they leave.
    pub(super) fn estimate_with(covariances: &Covariances, neighbours: &[usize]) -> Self {
        let n = neighbours.len();
        let offset = |i: usize| NEIGHBOURS[neighbours[i]];
        let zero = covariances.at([0, 0]);
        let ridge = RIDGE * zero.trace() / 3.0;
        let mut gram = DMatrix::from_diagonal_element(3 * n, 3 * n, ridge);
        let mut moment = DMatrix::zeros(3 * n, 3);
        for i in 0..n {
            for j in 0..n {
                let (s, t) = (offset(i), offset(j));
                let mut block = gram.fixed_view_mut::<3, 3>(3 * i, 3 * j);
                block += covariances.at([t[0] - s[0], t[1] - s[1]]);
            }
            moment.fixed_view_mut::<3, 3>(3 * i, 0).copy_from(&covariances.at(offset(i)).transpose());
        }
        let solved = gram.cholesky().map(|c| c.solve(&moment)).unwrap_or_else(|| DMatrix::zeros(3 * n, 3));
        let explained = moment.tr_mul(&solved);
        let residual = Matrix3::from_fn(|r, c| zero[(r, c)] - 0.5 * (explained[(r, c)] + explained[(c, r)]));
        let coefficients = (0..n).map(|i| solved.fixed_view::<3, 3>(3 * i, 0).transpose()).collect();
        Self { neighbours: neighbours.to_vec(), coefficients, factor: triangular_root(&residual, ridge) }
    }

    fn shrunk(&self, share: f64) -> Self {
        Self { coefficients: self.coefficients.iter().map(|a| a * share).collect(), ..self.clone() }
    }

    /// The transform of the field over that of white noise; `None` where the model has no field.
    pub(super) fn filter(&self, wave: &Wave) -> Option<Matrix3<Complex64>> {
        let mut denominator = Matrix3::<Complex64>::identity();
        for (&s, a) in self.neighbours.iter().zip(&self.coefficients) {
            let shift = wave.shift(NEIGHBOURS[s]);
            denominator -= a.map(|a| shift * a);
        }
        let inverse = denominator.try_inverse().filter(|m| m.norm() <= LARGEST_GAIN)?;
        Some(inverse * self.factor.map(|v| Complex64::new(v, 0.0)))
    }
}

/// L of a covariance that rounding may have left indefinite.
fn triangular_root(covariance: &Matrix3<f64>, ridge: f64) -> Matrix3<f64> {
    let raised = (0..6).map(|power| covariance + Matrix3::identity() * (ridge * 10_f64.powi(power)));
    let root = raised.filter_map(|c| c.cholesky()).next();
    root.map_or_else(Matrix3::zeros, |root| root.l())
}

impl FieldModel for Coloured {
    fn estimate(bands: &[Covariances], precision: Precision) -> Self {
        let models: Vec<VectorModel> = bands.iter().map(VectorModel::estimate).collect();
        let lower = |m: &VectorModel| {
            (0..3).flat_map(|r| (0..=r).map(move |c| (r, c))).map(|at| m.factor[at]).collect::<Vec<_>>()
        };
        let factors: Vec<f64> = models.iter().flat_map(lower).collect();
        let coefficients: Vec<f64> =
            models.iter().flat_map(|m| m.coefficients.iter().flat_map(|a| a.iter().copied())).collect();
        Self {
            masks: models.iter().map(|m| mask(&m.neighbours)).collect(),
            factors: Numbers::new(&factors, precision, Width::Word),
            coefficients: Numbers::new(&coefficients, precision, Width::Word),
        }
    }

    fn filter(&self, band: usize) -> BandFilter {
        let starts = running_counts(&self.masks);
        let (factors, coefficients) = (self.factors.values(), self.coefficients.values());
        let matrices = coefficients[9 * starts[band]..9 * starts[band + 1]].chunks_exact(9);
        let lower = &factors[6 * band..6 * band + 6];
        let model = VectorModel {
            neighbours: neighbours(self.masks[band]),
            coefficients: matrices.map(Matrix3::from_column_slice).collect(),
            factor: Matrix3::from_fn(|r, c| if c <= r { lower[r * (r + 1) / 2 + c] } else { 0.0 }),
        };
        Box::new(move |wave| model.filter(wave).unwrap_or_else(Matrix3::zeros))
    }

    fn write(&self, out: &mut Writer) {
        self.masks.iter().for_each(|&mask| out.bits(mask, NEIGHBOURS.len() as u32));
        out.align();
        self.factors.write(out);
        self.coefficients.write(out);
    }

    fn read(from: &mut Reader<'_>, bands: usize, precision: Precision) -> Result<Self, Fault> {
        let masks = (0..bands).map(|_| from.bits(NEIGHBOURS.len() as u32)).collect::<Result<Vec<_>, _>>()?;
        from.align();
        let factors = Numbers::read(from, 6 * bands, precision, Width::Word)?;
        let count = 9 * masks.iter().map(|m| m.count_ones() as usize).sum::<usize>();
        Ok(Self { masks, factors, coefficients: Numbers::read(from, count, precision, Width::Word)? })
    }
}

impl Synthesizer for Car3d {
    fn frame(&self) -> &Frame {
        self.0.frame()
    }

    fn picture(&self, size: [usize; 2], seed: u64, light: &Vector3<f32>, view: &Vector3<f32>) -> Vec<f32> {
        self.0.picture(size, seed, light, view)
    }
}

impl Stored for Car3d {
    fn write(&self, out: &mut Writer) {
        self.0.write(out);
    }

    fn read(from: &mut Reader<'_>, frame: Frame) -> Result<Self, Fault> {
        RandomField::read(from, frame).map(Self)
    }
}
