//! The joint least squares estimate: robust by reweighting, then without what contradicts the rest.

use super::equations::{Freedom, Head, Loss, OUT_OF_SIGHT, cost_of, equations_of, factor, stepped};
use super::homography::median;
use super::rig::{Picture, Rig};
use nalgebra::{DMatrix, Vector2};

/// Steps of one solution; it settles in five to twenty.
const STEPS: usize = 60;
/// Relative fall of the cost below which it has settled.
const SETTLED: f64 = 1e-9;
/// Scale of the Cauchy weights in deviations of the corners: 95 % as good as squares where nothing is wrong.
const CAUCHY: f64 = 2.385;
/// Least deviation of a corner in pixels: nothing is seen better, and squares of nothing weigh nothing.
const LEAST_NOISE: f64 = 0.005;
/// Robust deviations beyond which a corner contradicts the others: one in three thousand by chance.
const LIMIT: f64 = 4.0;
/// Rounds of dropping what contradicts the rest.
const ROUNDS: usize = 6;
/// A picture contradicts the others if its RMS is so many times that of most, or ...
const PICTURE_LIMIT: f64 = 3.0;
/// ... if this part of its corners does.
const DROPPED_LIMIT: f64 = 0.5;

/// How well a rig fits.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    /// Sum of squared distances of the corners used, in square pixels.
    pub(super) cost: f64,
    /// Corners used.
    pub(super) corners: usize,
    /// Deviation of a coordinate of a corner, in pixels.
    pub(super) noise: f64,
    /// What the corners alone tell of the free numbers of the lens: inverse covariance.
    pub(super) information: DMatrix<f64>,
}

impl Fit {
    pub(super) fn rms_px(&self) -> f64 {
        (self.cost / self.corners.max(1) as f64).sqrt()
    }
}

/// Fits the rig to the pictures: robustly, then without the corners and pictures that contradict the rest, which are
/// marked. `None` where too little is left.
pub(super) fn settle(rig: &mut Rig, pictures: &mut [Picture], freedom: Freedom) -> Option<Fit> {
    for _ in 0..2 {
        let noise = noise(rig, pictures);
        solve(rig, pictures, freedom, Loss::Cauchy { scale: CAUCHY * noise }, noise);
    }
    for _ in 0..ROUNDS {
        let noise = noise(rig, pictures);
        let has_changed = mark(rig, pictures, noise);
        solve(rig, pictures, freedom, Loss::Square, noise);
        if !has_changed {
            break;
        }
    }
    measure(rig, pictures, freedom)
}

/// The robust deviation of a coordinate in pixels, from the median.
fn noise(rig: &Rig, pictures: &[Picture]) -> f64 {
    let mut sizes = Vec::new();
    for (k, picture) in pictures.iter().enumerate().filter(|(_, p)| p.is_used) {
        for residual in rig.residuals(k, &picture.corners) {
            let r = residual.unwrap_or(Vector2::repeat(OUT_OF_SIGHT));
            sizes.extend([r.x.abs(), r.y.abs()]);
        }
    }
    (1.4826 * median(&sizes)).max(LEAST_NOISE)
}

/// Marks corners and pictures that agree; whether any mark changed.
fn mark(rig: &Rig, pictures: &mut [Picture], noise: f64) -> bool {
    let mut has_changed = false;
    let mut rms = Vec::new();
    for (k, picture) in pictures.iter_mut().enumerate() {
        let residuals = rig.residuals(k, &picture.corners);
        let mut sum = (0.0, 0.0);
        for (corner, residual) in picture.corners.iter_mut().zip(residuals) {
            let square = residual.map_or(f64::INFINITY, |r| r.norm_squared());
            let agrees = square <= (LIMIT * noise).powi(2);
            has_changed |= agrees != corner.is_used;
            corner.is_used = agrees;
            if agrees {
                sum = (sum.0 + square, sum.1 + 1.0);
            }
        }
        rms.push((sum.0 / f64::max(sum.1, 1.0)).sqrt());
    }
    let used: Vec<f64> = pictures.iter().zip(&rms).filter(|(p, _)| p.is_used).map(|(_, r)| *r).collect();
    let limit = (PICTURE_LIMIT * median(&used)).max(2.0 * noise);
    for (picture, rms) in pictures.iter_mut().zip(rms) {
        let agreeing = picture.corners.iter().filter(|c| c.is_used).count();
        let enough = agreeing as f64 > DROPPED_LIMIT * picture.corners.len() as f64;
        let is_used = enough && rms <= limit;
        has_changed |= is_used != picture.is_used;
        picture.is_used = is_used;
    }
    has_changed
}

/// Levenberg–Marquardt. `noise` makes pixels of what is assumed.
fn solve(rig: &mut Rig, pictures: &[Picture], freedom: Freedom, loss: Loss, noise: f64) {
    let head = Head::new(rig, freedom.lens);
    let mut damping = 1e-4;
    let mut equations = equations_of(rig, pictures, freedom, &head, loss, noise);
    for _ in 0..STEPS {
        let Some(tried) = equations.step(damping).map(|by| stepped(rig, &head, &by)) else {
            damping *= 10.0;
            if damping > 1e12 {
                return;
            }
            continue;
        };
        let cost = cost_of(&tried, pictures, freedom, &head, loss, noise);
        if cost < equations.cost {
            let is_settled = equations.cost - cost < SETTLED * equations.cost;
            *rig = tried;
            if is_settled {
                return;
            }
            damping = (0.1 * damping).max(1e-12);
            equations = equations_of(rig, pictures, freedom, &head, loss, noise);
        } else {
            damping *= 10.0;
            if damping > 1e12 {
                return;
            }
        }
    }
}

/// Fit and information of the corners used.
fn measure(rig: &Rig, pictures: &[Picture], freedom: Freedom) -> Option<Fit> {
    let head = Head::new(rig, freedom.lens);
    let equations = equations_of(rig, pictures, freedom, &head, Loss::Square, 0.0);
    let used = pictures.iter().filter(|p| p.is_used);
    let corners = used.clone().map(|p| p.corners.iter().filter(|c| c.is_used).count()).sum::<usize>();
    let unknown = head.size + head.block * used.count();
    let cost = equations.cost;
    if corners == 0 || !cost.is_finite() {
        return None;
    }
    let noise = (cost / (2.0 * corners as f64 - unknown as f64).max(1.0)).sqrt().max(LEAST_NOISE);
    let reduced = equations.reduced(0.0)?.0;
    let information = marginal(&reduced, freedom.lens.len()) / (noise * noise);
    Some(Fit { cost, corners, noise, information })
}

/// Of an information matrix, what it tells of the first `n` numbers when the others are unknown.
fn marginal(all: &DMatrix<f64>, n: usize) -> DMatrix<f64> {
    let m = all.nrows() - n;
    let first = all.view((0, 0), (n, n)).into_owned();
    if n == 0 || m == 0 {
        return first;
    }
    let coupling = all.view((n, 0), (m, n)).into_owned();
    let Some(rest) = factor(all.view((n, n), (m, m)).into_owned()) else { return DMatrix::zeros(n, n) };
    let difference = &first - coupling.transpose() * rest.solve(&coupling);
    0.5 * (&difference + difference.transpose())
}
