//! A matrix as a mean and a few components, coded: what the three PCA codecs share.
//!
//! ```text
//! x_n ≈ b₀ + Σ_j w_nj b_j      x: length, n < count; b_j of RMS 1 an element
//! ```
//!
//! Once the components are coded, weights are found again by least squares against what the decoder will
//! have, so that the coding of mean and components costs only what no weight can mend.
//!
//! Noise allowed to the coding as a whole is [`NOISE_SHARE`] of what the components leave, pooled over all
//! models of a codec, at least [`NOISE_FLOOR`]; it is shared evenly between all rows. Relative to
//! [`Precision::Full`] the RMSE grows by at most 1 %, or to 0.15 of 255 where there is no other error.

use super::container::{Fault, Reader};
use super::principal::{Principal, transposed_times};
use super::rows::{Coding, Rows};
use super::{Budget, Precision};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Share of the residual variance that coding may add.
const NOISE_SHARE: f64 = 0.02;
/// RMS that coding may always add, of samples of nominal range 1.
const NOISE_FLOOR: f64 = 0.15 / 255.0;
/// Largest over smallest value of a row, in units of its RMS, before it is known.
const TYPICAL_RANGE: f64 = 8.0;
/// Variance of rounding to 8 bits: below it, no component is supported by the data.
const ROUNDING: f64 = 1.0 / (12.0 * 255.0 * 255.0);
/// Attempts to meet a number of bytes.
const ATTEMPTS: usize = 6;
/// Most components looked for where an error or the data decide.
const MOST: usize = 300;
/// Fewest bits a number takes on average when a number of bytes is met.
const FEWEST_BITS: usize = 5;

/// The coded matrix.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LinearModel {
    /// Mean, then components; `length` elements.
    pub(super) images: Rows,
    /// One row a component; `count` elements.
    pub(super) weights: Rows,
}

/// A matrix to be coded.
#[derive(Debug)]
pub(super) struct Source {
    mean: Vec<f32>,
    centred: DMatrix<f32>,
    principal: Principal,
}

/// How many components.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Target {
    /// So many in each model.
    Each(usize),
    /// As many as fit, where they lower the error most.
    Bytes(usize),
    /// As few as reach this RMSE.
    Error(f64),
    /// As many as a Bayesian information criterion supports: `n ln(MSE + rounding) + parameters · ln n`.
    Supported,
}

impl Target {
    /// What a budget means, where `bytes` are left for a ratio.
    pub(super) fn of(budget: Budget, standard: usize, bytes: impl Fn(f64) -> usize) -> Self {
        match budget {
            Budget::Standard => Self::Each(standard),
            Budget::Components(count) => Self::Each(count),
            Budget::Ratio(ratio) => Self::Bytes(bytes(ratio)),
            Budget::Quality(quality) => Self::Error(super::budget::error_of(quality)),
            Budget::Auto => Self::Supported,
        }
    }

    /// Components to look for in each of `models` matrices of `length + count` numbers a component.
    pub(super) fn most(self, numbers: usize) -> usize {
        match self {
            Self::Each(count) => count,
            Self::Bytes(bytes) => (8 * bytes / (FEWEST_BITS * numbers.max(1)) + 1).min(2 * MOST),
            Self::Error(_) | Self::Supported => MOST,
        }
    }
}

impl Source {
    /// Centres `data` (length × count) and finds at most `most` components.
    pub(super) fn new(mut data: DMatrix<f32>, most: usize, seed: u64) -> Self {
        let (length, count) = data.shape();
        let mut sums = vec![0.0f64; length];
        data.column_iter().for_each(|column| sums.iter_mut().zip(&column).for_each(|(s, &x)| *s += f64::from(x)));
        let mean: Vec<f32> = sums.iter().map(|s| (s / count.max(1) as f64) as f32).collect();
        data.as_mut_slice()
            .par_chunks_mut(length.max(1))
            .for_each(|x| x.iter_mut().zip(&mean).for_each(|(x, m)| *x -= m));
        let principal = Principal::of(&data, most, seed);
        Self { mean, centred: data, principal }
    }

    fn samples(&self) -> f64 {
        (self.centred.len()).max(1) as f64
    }

    /// RMS of the weights of a component whose elements have RMS 1.
    fn spread(&self, component: usize) -> f64 {
        (self.principal.energy[component] / self.samples()).sqrt()
    }

    /// Numbers that one more component takes.
    fn numbers(&self) -> usize {
        self.centred.nrows() + self.centred.ncols()
    }

    fn expected_bytes(&self, count: usize, noise: Option<f64>) -> usize {
        let row = |length: usize, range: f64, coding: Coding| 9 + (length * coding.bits(range) as usize).div_ceil(8);
        let coding = codings(count, noise);
        let component = |j: usize| {
            let spread = self.spread(j);
            row(self.centred.nrows(), TYPICAL_RANGE, coding(spread))
                + row(self.centred.ncols(), TYPICAL_RANGE * spread, coding(1.0))
        };
        row(self.centred.nrows(), 1.0, coding(1.0)) + (0..count).map(component).sum::<usize>()
    }

    fn model(&self, count: usize, noise: Option<f64>) -> LinearModel {
        let view = &self.centred;
        let coding = codings(count, noise);
        let basis = self.principal.basis(view, count) * (self.centred.nrows() as f32).sqrt();
        let image = |e: usize| std::iter::once(self.mean[e]).chain(basis.row(e).iter().copied().collect::<Vec<_>>());
        let values = (0..self.mean.len()).flat_map(image).collect();
        let image_codings: Vec<Coding> =
            std::iter::once(coding(1.0)).chain((0..count).map(|j| coding(self.spread(j)))).collect();
        let images = Rows::new(self.mean.len(), values, &image_codings);
        let weights = self.fitted_weights(&images, view);
        let weights = Rows::new(view.ncols(), weights.as_slice().to_vec(), &vec![coding(1.0); count]);
        LinearModel { images, weights }
    }

    /// Least squares of the data on the coded components, count × components.
    fn fitted_weights(&self, images: &Rows, view: &DMatrix<f32>) -> DMatrix<f32> {
        let count = images.count() - 1;
        let basis = DMatrix::from_fn(view.nrows(), count, |e, j| images.element(e)[j + 1]);
        let off = DVector::from_fn(view.nrows(), |e, _| f64::from(self.mean[e] - images.element(e)[0]));
        let exact = basis.map(f64::from);
        let transposed = exact.transpose();
        let mut gram = &transposed * &exact;
        let ridge = 1e-9 * gram.trace().max(f64::MIN_POSITIVE) / count.max(1) as f64;
        (0..count).for_each(|j| gram[(j, j)] += ridge);
        let shift = transposed * off;
        let mut right = transposed_times(&basis, view).map(f64::from);
        right.column_iter_mut().for_each(|mut column| column += &shift);
        let Some(factor) = gram.cholesky() else { return DMatrix::zeros(count, view.ncols()) };
        factor.solve(&right).cast()
    }
}

/// How a row is coded in a model of `count` components, of which an error of 1 makes one of `gain` in the
/// samples; floats without `noise`.
fn codings(count: usize, noise: Option<f64>) -> impl Fn(f64) -> Coding {
    let each = noise.map(|noise| noise / ((2 * count + 1) as f64).sqrt());
    move |gain: f64| each.map_or(Coding::Float, |noise| Coding::Noise(noise / gain.max(1e-12)))
}

/// Codes all `sources` alike; the numbers of components are chosen over all of them. A number of bytes too
/// small for the means is missed, and told in a note.
pub(super) fn fit(
    sources: &[Source],
    target: Target,
    precision: Precision,
    notes: &mut Vec<String>,
) -> Vec<LinearModel> {
    let ladder = Ladder::of(sources);
    let noise = |counts: &[usize]| (precision == Precision::Compact).then(|| ladder.noise(sources, counts));
    let expected = |counts: &[usize]| {
        let noise = noise(counts);
        sources.iter().zip(counts).map(|(s, &k)| s.expected_bytes(k, noise)).sum::<usize>()
    };
    let models = |counts: &[usize]| -> Vec<LinearModel> {
        let noise = noise(counts);
        sources.par_iter().zip(counts).map(|(source, &count)| source.model(count, noise)).collect()
    };
    let Target::Bytes(most) = target else {
        let counts = ladder.counts(ladder.steps_for(sources, target), target);
        return models(&counts);
    };
    let size = |models: &[LinearModel]| models.iter().map(LinearModel::bytes).sum::<usize>();
    let mut scale = 1.0;
    let mut best: Option<Vec<LinearModel>> = None;
    for _ in 0..ATTEMPTS {
        let fits = |steps| expected(&ladder.counts(steps, target)) as f64 * scale <= most as f64;
        let steps = partition_point(ladder.order.len() + 1, fits).saturating_sub(1);
        let counts = ladder.counts(steps, target);
        let found = models(&counts);
        let bytes = size(&found);
        // A hair more, or the same components are found again.
        scale = bytes as f64 / expected(&counts) as f64 * if bytes > most { 1.01 } else { 1.0 };
        let is_best = bytes <= most && best.as_ref().is_none_or(|best| size(best) < bytes);
        best = if is_best { Some(found) } else { best };
        let is_close = bytes <= most && (bytes as f64 > 0.97 * most as f64 || steps == ladder.order.len());
        if is_close || steps == 0 {
            break;
        }
    }
    best.unwrap_or_else(|| {
        let least = models(&vec![0; sources.len()]);
        notes.push(format!("{most} bytes were asked for, {} are taken by means alone", size(&least)));
        least
    })
}

/// The number of leading positions below `end` that satisfy a condition which, once false, stays so.
fn partition_point(end: usize, holds: impl Fn(usize) -> bool) -> usize {
    let (mut low, mut high) = (0, end);
    while low < high {
        let middle = low + (high - low) / 2;
        if holds(middle) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    low
}

/// All components of all sources, those that lower the error most for their numbers first.
struct Ladder {
    order: Vec<(usize, f64)>,
    sources: usize,
    /// Components found in each.
    found: Vec<usize>,
}

impl Ladder {
    fn of(sources: &[Source]) -> Self {
        let of_source =
            |(s, source): (usize, &Source)| source.principal.energy.iter().map(move |&e| (s, e)).collect::<Vec<_>>();
        let mut order: Vec<(usize, f64)> = sources.iter().enumerate().flat_map(of_source).collect();
        let worth = |&(s, energy): &(usize, f64)| energy / sources[s].numbers() as f64;
        order.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
        Self { order, sources: sources.len(), found: sources.iter().map(|s| s.principal.len()).collect() }
    }

    fn counts(&self, steps: usize, target: Target) -> Vec<usize> {
        if let Target::Each(count) = target {
            return self.found.iter().map(|&found| found.min(count)).collect();
        }
        let mut counts = vec![0; self.sources];
        self.order[..steps.min(self.order.len())].iter().for_each(|&(source, _)| counts[source] += 1);
        counts
    }

    /// Mean squared error after each number of steps.
    fn errors(&self, sources: &[Source]) -> Vec<f64> {
        let total: f64 = sources.iter().map(|s| s.principal.total).sum();
        let samples: f64 = sources.iter().map(Source::samples).sum();
        let mut left = total;
        let after = self.order.iter().map(|&(_, energy)| {
            left -= energy;
            left.max(0.0) / samples
        });
        std::iter::once(total / samples).chain(after).collect()
    }

    fn steps_for(&self, sources: &[Source], target: Target) -> usize {
        let errors = self.errors(sources);
        match target {
            Target::Error(rmse) => errors.iter().position(|&e| e <= rmse * rmse).unwrap_or(self.order.len()),
            Target::Supported => {
                let samples: f64 = sources.iter().map(Source::samples).sum();
                let mut parameters = 0.0;
                let mut best = (f64::INFINITY, 0);
                for (steps, error) in errors.iter().enumerate() {
                    let score = samples * (error + ROUNDING).ln() + parameters * samples.ln();
                    best = if score < best.0 { (score, steps) } else { best };
                    parameters += self.order.get(steps).map_or(0.0, |&(s, _)| sources[s].numbers() as f64);
                }
                best.1
            }
            Target::Each(_) | Target::Bytes(_) => self.order.len(),
        }
    }

    /// RMS that coding may add.
    fn noise(&self, sources: &[Source], counts: &[usize]) -> f64 {
        let left = |(source, &count): (&Source, &usize)| {
            source.principal.total - source.principal.energy[..count].iter().sum::<f64>()
        };
        let samples: f64 = sources.iter().map(Source::samples).sum();
        let residual = sources.iter().zip(counts).map(left).sum::<f64>().max(0.0) / samples;
        (NOISE_SHARE * residual).sqrt().max(NOISE_FLOOR)
    }
}

impl LinearModel {
    /// Number of components.
    pub(super) fn components(&self) -> usize {
        self.weights.count()
    }

    /// Bytes on disk.
    pub(super) fn bytes(&self) -> usize {
        self.images.bytes() + self.weights.bytes()
    }

    /// Reads the images, then the weights, of models of so many (elements, observations, components).
    ///
    /// # Errors
    /// As [`Rows::read`].
    pub(super) fn read_all(
        from: &mut Reader<'_>,
        sizes: impl Iterator<Item = (usize, usize, u16)> + Clone,
    ) -> Result<Vec<Self>, Fault> {
        let images = sizes.clone().map(|(length, _, k)| Rows::read(from, length, usize::from(k) + 1));
        let images = images.collect::<Result<Vec<_>, _>>()?;
        let read = |(images, (_, count, k))| Ok(Self { images, weights: Rows::read(from, count, usize::from(k))? });
        images.into_iter().zip(sizes).map(read).collect()
    }
}

/// RMSE × 255 of the means alone, then of the models, before their coding.
pub(super) fn objective(sources: &[Source], models: &[LinearModel]) -> Vec<f64> {
    let samples: f64 = sources.iter().map(Source::samples).sum();
    let total: f64 = sources.iter().map(|s| s.principal.total).sum();
    let kept =
        |(source, model): (&Source, &LinearModel)| source.principal.energy[..model.components()].iter().sum::<f64>();
    let left = total - sources.iter().zip(models).map(kept).sum::<f64>();
    [total, left].map(|energy| 255.0 * (energy.max(0.0) / samples).sqrt()).to_vec()
}

/// `b₀ + Σ w_j b_j`, one element.
pub(super) fn affine(images: &[f32], weights: &[f32]) -> f32 {
    images.first().copied().unwrap_or(0.0) + dot(images.get(1..).unwrap_or(&[]), weights)
}

/// Scalar product, in eight sums, so that it is done in lanes.
pub(super) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f32 = a8.remainder().iter().zip(b8.remainder()).map(|(x, y)| x * y).sum();
    let mut lanes = [0.0f32; 8];
    for (x, y) in a8.zip(b8) {
        (0..8).for_each(|i| lanes[i] += x[i] * y[i]);
    }
    lanes.iter().sum::<f32>() + rest
}

/// `Σ_i w_i rows_i`, into `out`.
pub(super) fn blend_into<'a>(rows: impl Iterator<Item = (&'a [f32], f32)>, out: &mut [f32]) {
    out.fill(0.0);
    for (row, weight) in rows {
        out.iter_mut().zip(row).for_each(|(o, r)| *o += weight * r);
    }
}
