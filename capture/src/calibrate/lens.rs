//! What is assumed of lenses, and how one is stepped.

use super::{LensKnowledge, LensParameter, LensTerm, Source};
use crate::Intrinsics;
use nalgebra::{DMatrix, DVector};

/// Deviation of the logarithm of a focal length around [`FOCAL`]: two of them reach from a half to three widths.
const FOCAL_DEVIATION: f64 = 0.45;
/// The middle of the usual focal lengths, in longer sides of the picture.
const FOCAL: f64 = 1.1;
/// Deviation of a focal length that was guessed, in parts of it.
const GUESS_DEVIATION: f64 = 0.1;
/// Deviation of the principal point from the middle, in longer sides of the picture.
const CENTRE_DEVIATION: f64 = 0.03;

/// Gaussian assumptions on the numbers of a lens; focal length and aspect by their logarithms.
#[derive(Clone, Debug)]
pub(super) struct LensPrior {
    mean: [f64; 9],
    deviation: [f64; 9],
}

impl LensParameter {
    /// In order.
    pub(super) const ALL: [Self; 9] =
        [Self::Focal, Self::Aspect, Self::Cx, Self::Cy, Self::K1, Self::K2, Self::K3, Self::P1, Self::P2];

    /// As the bundle counts it: focal length and aspect by their logarithms.
    fn coordinate(self, lens: &Intrinsics) -> f64 {
        match self {
            Self::Focal => lens.fx.ln(),
            Self::Aspect => (lens.fy / lens.fx).ln(),
            _ => self.value(lens),
        }
    }

    pub(super) fn value(self, lens: &Intrinsics) -> f64 {
        let d = &lens.distortion;
        match self {
            Self::Focal => lens.fx,
            Self::Aspect => lens.fy / lens.fx,
            Self::Cx => lens.cx,
            Self::Cy => lens.cy,
            Self::K1 => d.k1,
            Self::K2 => d.k2,
            Self::K3 => d.k3,
            Self::P1 => d.p1,
            Self::P2 => d.p2,
        }
    }
}

impl LensPrior {
    /// Of a camera that makes pictures of this size: square pixels, no lens beyond what phones have.
    pub(super) fn new([width, height]: [usize; 2], knowledge: &LensKnowledge) -> Self {
        let (w, h) = (width as f64, height as f64);
        let side = w.max(h);
        let (focal, spread) = match knowledge {
            LensKnowledge::Guess(focal) => (*focal, GUESS_DEVIATION),
            _ => (FOCAL * side, FOCAL_DEVIATION),
        };
        let centre = CENTRE_DEVIATION * side;
        Self {
            mean: [focal.ln(), 0.0, 0.5 * w, 0.5 * h, 0.0, 0.0, 0.0, 0.0, 0.0],
            deviation: [spread, 0.003, centre, centre, 0.2, 0.2, 0.2, 0.002, 0.002],
        }
    }

    /// The lens thought likeliest before anything is seen.
    pub(super) fn lens(&self, size: [usize; 2]) -> Intrinsics {
        Intrinsics::pinhole(self.mean[0].exp(), size)
    }

    /// How far a parameter lies from what is assumed, and that divided by the variance: half the gradient of
    /// [`LensPrior::cost`].
    pub(super) fn pull(&self, lens: &Intrinsics, parameter: LensParameter) -> f64 {
        let k = parameter as usize;
        (self.mean[k] - parameter.coordinate(lens)) * self.precision(parameter)
    }

    /// One over the variance.
    pub(super) fn precision(&self, parameter: LensParameter) -> f64 {
        self.deviation[parameter as usize].powi(-2)
    }

    /// Sum of squares in deviations.
    pub(super) fn cost(&self, lens: &Intrinsics, free: &[LensParameter]) -> f64 {
        let term =
            |p: &LensParameter| ((self.mean[*p as usize] - p.coordinate(lens)) / self.deviation[*p as usize]).powi(2);
        free.iter().map(term).sum()
    }
}

/// The lens after a step in some of its parameters, focal length and aspect by their logarithms.
pub(super) fn step(lens: &Intrinsics, free: &[LensParameter], by: &[f64]) -> Intrinsics {
    let mut next = *lens;
    for (parameter, &by) in free.iter().zip(by) {
        match parameter {
            LensParameter::Focal => {
                next.fx *= by.exp();
                next.fy *= by.exp();
            }
            LensParameter::Aspect => next.fy *= by.exp(),
            LensParameter::Cx => next.cx += by,
            LensParameter::Cy => next.cy += by,
            LensParameter::K1 => next.distortion.k1 += by,
            LensParameter::K2 => next.distortion.k2 += by,
            LensParameter::K3 => next.distortion.k3 += by,
            LensParameter::P1 => next.distortion.p1 += by,
            LensParameter::P2 => next.distortion.p2 += by,
        }
    }
    next
}

/// What is known of each number of a lens, from the information (inverse covariance, free × free) of the corners alone.
pub(super) fn terms(
    lens: &Intrinsics,
    free: &[LensParameter],
    information: &DMatrix<f64>,
    prior: &LensPrior,
) -> Vec<LensTerm> {
    let precisions = DVector::from_iterator(free.len(), free.iter().map(|&p| prior.precision(p)));
    let alone = deviations(information);
    let together = deviations(&(information + DMatrix::from_diagonal(&precisions)));
    let term = |&parameter: &LensParameter| {
        let value = parameter.value(lens);
        let Some(k) = free.iter().position(|&p| p == parameter) else {
            return LensTerm { parameter, value, deviation: 0.0, footage_deviation: 0.0, source: Source::Held };
        };
        // Logarithms to the parameter's own unit.
        let unit = if matches!(parameter, LensParameter::Focal | LensParameter::Aspect) { value } else { 1.0 };
        // More than half of what is known came from the assumption.
        let source = if alone[k] > 1.5 * together[k] { Source::Assumption } else { Source::Footage };
        let (deviation, footage_deviation) = (unit * together[k], unit * alone[k]);
        LensTerm { parameter, value, deviation, footage_deviation, source }
    };
    LensParameter::ALL.iter().map(term).collect()
}

/// Standard deviations for an information matrix; infinite where it is singular.
fn deviations(information: &DMatrix<f64>) -> Vec<f64> {
    let n = information.nrows();
    let scale: Vec<f64> = (0..n).map(|i| information[(i, i)].max(f64::MIN_POSITIVE).sqrt()).collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| information[(i, j)] / (scale[i] * scale[j]));
    let Some(inverse) = scaled.cholesky().map(|factor| factor.inverse()) else { return vec![f64::INFINITY; n] };
    (0..n).map(|i| inverse[(i, i)].max(0.0).sqrt() / scale[i]).collect()
}
