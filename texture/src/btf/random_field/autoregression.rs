//! What the models have in common: a texel is a weighted sum of its neighbours and noise,
//! `Y_r = Σ_s a_s Y_{r−s} + e_r`, with weights by least squares. On a tile that continues itself all sums are
//! autocovariances `R(d) = mean_r Y_r Y_{r−d}ᵀ`, which one Fourier transform gives for all lags at once.
//!
//! Neighbours are chosen one by one among the 18 of half the plane within √10 texels, as long as the
//! information criterion `n ln det Σ + (numbers) ln n` falls (Schwarz 1978), n the texels of one picture:
//! pictures of a group show one surface, so their texels count once.

use super::fourier::{Fourier, Wave, frequency};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rustfft::num_complex::Complex64;

/// Half the plane, nearest first: those that come before a texel in reading order lie at `r − s`.
pub(in super::super) const NEIGHBOURS: [[i32; 2]; 18] = [
    [1, 0],
    [0, 1],
    [1, 1],
    [-1, 1],
    [2, 0],
    [0, 2],
    [2, 1],
    [1, 2],
    [-1, 2],
    [-2, 1],
    [2, 2],
    [-2, 2],
    [3, 0],
    [0, 3],
    [3, 1],
    [1, 3],
    [-1, 3],
    [-3, 1],
];
/// Added to every variance, as a share of it, so that constant and periodic fields have an answer.
const RIDGE: f64 = 1e-6;
/// Frequencies a side at which a model must be valid.
const PROBES: usize = 64;
/// Variance of a field that counts as constant.
pub(in super::super) const CONSTANT: f64 = 1e-12;

/// Autocovariances of a field of vectors.
#[derive(Clone, Debug)]
pub(in super::super) struct Covariances {
    pub(in super::super) size: [usize; 2],
    lags: Vec<Matrix3<f64>>,
}

/// Autocovariances of one component.
#[derive(Clone, Debug)]
pub(in super::super) struct ScalarCovariances {
    size: [usize; 2],
    lags: Vec<f64>,
}

/// A model of one component; coefficients belong to [`NEIGHBOURS`].
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct Scalar {
    pub(in super::super) neighbours: Vec<usize>,
    pub(in super::super) coefficients: Vec<f64>,
    /// Standard deviation of the noise.
    pub(in super::super) sigma: f64,
}

/// What sets the models of one component apart.
pub(in super::super) trait ScalarModel: Clone + std::fmt::Debug + PartialEq + Send + Sync {
    /// What a neighbour, or a pair of them, stands for: `(E[X_s X_t], E[X_s Y])`.
    fn products(covariances: &ScalarCovariances, s: [i32; 2], t: [i32; 2]) -> (f64, f64);

    /// The transform of the field over that of the noise; `None` where the model has no field.
    fn filter(model: &Scalar, wave: &Wave) -> Option<Complex64>;
}

impl Covariances {
    /// Of fields of one size, three components each, averaged.
    pub(in super::super) fn of(fields: &[[Vec<f64>; 3]], size: [usize; 2]) -> Self {
        let (fourier, texels) = (Fourier::new(size), size[0] * size[1]);
        let mut power = vec![Matrix3::from_element(Complex64::new(0.0, 0.0)); texels];
        for field in fields {
            let spectra = [0, 1, 2].map(|c| fourier.forward(&field[c]));
            for (k, power) in power.iter_mut().enumerate().skip(1) {
                let v = Vector3::from_fn(|c, _| spectra[c][k]);
                *power += v * v.adjoint();
            }
        }
        let scale = 1.0 / (texels * fields.len().max(1)) as f64;
        let mut lags = vec![Matrix3::zeros(); texels];
        for (row, column) in (0..3).flat_map(|row| (0..3).map(move |column| (row, column))) {
            let entry = fourier.inverse(power.iter().map(|p| p[(row, column)]).collect());
            lags.iter_mut().zip(entry).for_each(|(lag, v)| lag[(row, column)] = v * scale);
        }
        Self { size, lags }
    }

    pub(in super::super) fn at(&self, lag: [i32; 2]) -> &Matrix3<f64> {
        &self.lags[place(lag, self.size)]
    }

    /// Of the component along a unit vector.
    pub(in super::super) fn along(&self, u: &Vector3<f64>) -> ScalarCovariances {
        ScalarCovariances { size: self.size, lags: self.lags.iter().map(|r| u.dot(&(r * u))).collect() }
    }
}

impl ScalarCovariances {
    pub(in super::super) fn at(&self, lag: [i32; 2]) -> f64 {
        self.lags[place(lag, self.size)]
    }
}

fn place([x, y]: [i32; 2], [width, height]: [usize; 2]) -> usize {
    y.rem_euclid(height as i32) as usize * width + x.rem_euclid(width as i32) as usize
}

/// Neighbours that are told apart on a tile of this size.
pub(in super::super) fn candidates(size: [usize; 2]) -> Vec<usize> {
    let apart = |s: [i32; 2]| (0..2).all(|axis| 2 * (s[axis].unsigned_abs() as usize) < size[axis]);
    (0..NEIGHBOURS.len()).filter(|&s| apart(NEIGHBOURS[s])).collect()
}

/// The neighbours worth their `numbers` each; `log_residual` is `ln det Σ` with some of them.
pub(in super::super) fn choose(size: [usize; 2], numbers: usize, log_residual: impl Fn(&[usize]) -> f64) -> Vec<usize> {
    let texels = (size[0] * size[1]) as f64;
    let price = numbers as f64 * texels.ln();
    let mut left = candidates(size);
    let mut chosen = Vec::new();
    let mut best = texels * log_residual(&chosen);
    // As many numbers as texels would explain anything.
    while numbers * (chosen.len() + 1) < size[0] * size[1] {
        let with = |&s: &usize| [chosen.as_slice(), &[s]].concat();
        let tried = left.iter().map(|s| (texels * log_residual(&with(s)) + price * (chosen.len() + 1) as f64, *s));
        let Some((criterion, s)) = tried.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))) else { break };
        if criterion >= best {
            break;
        }
        best = criterion;
        chosen.push(s);
        left.retain(|&other| other != s);
    }
    chosen.sort_unstable();
    chosen
}

/// Least squares with these neighbours; the noise is what they leave.
pub(in super::super) fn estimate_with<M: ScalarModel>(covariances: &ScalarCovariances, neighbours: &[usize]) -> Scalar {
    let variance = covariances.at([0, 0]).max(0.0);
    let n = neighbours.len();
    let product = |i: usize, j: usize| M::products(covariances, NEIGHBOURS[neighbours[i]], NEIGHBOURS[neighbours[j]]);
    let gram = DMatrix::from_fn(n, n, |i, j| product(i, j).0 + if i == j { RIDGE * variance } else { 0.0 });
    let moment = DVector::from_fn(n, |i, _| product(i, i).1);
    let solved = gram.cholesky().map(|c| c.solve(&moment)).filter(|_| variance > CONSTANT);
    let coefficients = solved.unwrap_or_else(|| DVector::zeros(n));
    let residual = (variance - coefficients.dot(&moment)).max(RIDGE * variance);
    Scalar {
        neighbours: neighbours.to_vec(),
        coefficients: coefficients.iter().copied().collect(),
        sigma: residual.sqrt(),
    }
}

/// Neighbours, coefficients and noise: shrunk until the model is valid at any size, the noise such that a tile of
/// the covariances' size has their variance.
pub(in super::super) fn estimate<M: ScalarModel>(covariances: &ScalarCovariances) -> Scalar {
    let variance = covariances.at([0, 0]).max(0.0);
    if variance <= CONSTANT {
        return Scalar { neighbours: Vec::new(), coefficients: Vec::new(), sigma: 0.0 };
    }
    let left = |chosen: &[usize]| 2.0 * estimate_with::<M>(covariances, chosen).sigma.ln();
    let mut model = estimate_with::<M>(covariances, &choose(covariances.size, 1, left));
    let fitted = model.coefficients.clone();
    let shrunk = |share: f64| Scalar { coefficients: fitted.iter().map(|a| a * share).collect(), ..model.clone() };
    let share = largest_valid_share(|share| {
        let tried = shrunk(share);
        probes().all(|w| M::filter(&tried, &w).is_some())
    });
    model = shrunk(share);
    let gain = mean_gain(covariances.size, |wave| M::filter(&model, wave).map_or(0.0, |f| f.norm_sqr()));
    model.sigma = if gain > 0.0 { (variance / gain).sqrt() } else { 0.0 };
    model
}

/// The largest share of the coefficients that is valid, by bisection; 0 always is.
pub(in super::super) fn largest_valid_share(valid: impl Fn(f64) -> bool) -> f64 {
    if valid(1.0) {
        return 1.0;
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..12 {
        let middle = 0.5 * (low + high);
        if valid(middle) { low = middle } else { high = middle }
    }
    low
}

/// Frequencies at which a model must be valid; the lower half of the plane mirrors the upper.
pub(in super::super) fn probes() -> impl Iterator<Item = Wave> {
    let wave = |i: usize| Wave::new([i % PROBES, i / PROBES].map(|k| frequency(k, PROBES)));
    (0..PROBES * (PROBES / 2 + 1)).map(wave)
}

/// Variance of a field of this size without its mean, per unit of noise.
pub(in super::super) fn mean_gain(size: [usize; 2], gain: impl Fn(&Wave) -> f64) -> f64 {
    let texels = size[0] * size[1];
    let wave = |k: usize| Wave::new([frequency(k % size[0], size[0]), frequency(k / size[0], size[1])]);
    (1..texels).map(|k| gain(&wave(k))).sum::<f64>() / texels as f64
}
