//! The colour of the backdrop where it hangs behind everything: a quadratic in the place in the frame, for uneven
//! light and folds of the cloth.

use super::cluster;
use crate::Image;
use nalgebra::{DMatrix, DVector};

/// Terms 1, x, y, x², xy, y².
const TERMS: usize = 6;

/// A smooth backdrop.
#[derive(Clone, Debug)]
pub(super) struct Cloth {
    coefficients: [[f64; TERMS]; 3],
    /// Standard deviation about it, encoded levels.
    pub(super) spread: f32,
}

impl Cloth {
    /// From a picture of the room of which some pixels are known. `None` where no single smooth backdrop fills most
    /// of its border and a quarter of it.
    pub(super) fn of(room: &Image<Option<[f32; 3]>>) -> Option<Self> {
        let samples = samples(room);
        let border: Vec<[f32; 3]> = samples.iter().filter(|s| s.is_border).map(|s| s.colour).step_by(3).collect();
        let start = cluster::densest(&border)?;
        let mut cloth = Self { coefficients: start.colour.map(constant), spread: 12.0 };
        for _ in 0..8 {
            let inliers: Vec<&Sample> = samples.iter().filter(|s| cloth.fits(s)).collect();
            cloth = Self::fitted(&inliers)?;
        }
        let inliers = samples.iter().filter(|s| cloth.fits(s)).count();
        let of_border = samples.iter().filter(|s| s.is_border && cloth.fits(s)).count();
        let is_most = 2 * of_border > samples.iter().filter(|s| s.is_border).count() && 4 * inliers > samples.len();
        (is_most && cloth.spread < 14.0).then_some(cloth)
    }

    /// At a place in shares of the frame, 0 to 1.
    pub(super) fn at(&self, x: f64, y: f64) -> [f32; 3] {
        let terms = terms(x, y);
        self.coefficients.map(|k| k.iter().zip(terms).map(|(k, t)| k * t).sum::<f64>().clamp(0.0, 255.0) as f32)
    }

    /// Whether a colour may be the cloth's.
    pub(super) fn is_like(&self, at: &[f32; 3], colour: &[f32; 3]) -> bool {
        let tolerance = 8.0 + 3.0 * self.spread;
        (0..3).all(|c| (at[c] - colour[c]).abs() < tolerance)
    }

    fn fits(&self, sample: &Sample) -> bool {
        self.is_like(&self.at(sample.x, sample.y), &sample.colour)
    }

    fn fitted(samples: &[&Sample]) -> Option<Self> {
        let rows = samples.len();
        if rows < 4 * TERMS {
            return None;
        }
        let left = DMatrix::from_fn(rows, TERMS, |r, t| terms(samples[r].x, samples[r].y)[t]);
        let right = DMatrix::from_fn(rows, 3, |r, c| f64::from(samples[r].colour[c]));
        let mut normal = left.tr_mul(&left);
        // A backdrop seen along one line only has no slope across it.
        (0..TERMS).for_each(|t| normal[(t, t)] += 1e-6 * rows as f64);
        let solution = normal.cholesky()?.solve(&left.tr_mul(&right));
        let residual: DMatrix<f64> = &left * &solution - right;
        let spread = (residual.norm_squared() / (3 * rows) as f64).sqrt() as f32;
        let column = |c: usize| {
            let column: DVector<f64> = solution.column(c).into_owned();
            [0, 1, 2, 3, 4, 5].map(|t| column[t])
        };
        Some(Self { coefficients: [column(0), column(1), column(2)], spread })
    }
}

struct Sample {
    x: f64,
    y: f64,
    colour: [f32; 3],
    is_border: bool,
}

fn samples(room: &Image<Option<[f32; 3]>>) -> Vec<Sample> {
    let (width, height) = (room.width(), room.height());
    let ring = (width.min(height) / 25).max(1);
    let place = |at: usize| (at % width, at / width);
    let pixels = room.pixels().iter().enumerate().filter_map(|(at, p)| p.map(|colour| (place(at), colour)));
    let sample = |((x, y), colour): ((usize, usize), [f32; 3])| Sample {
        x: (x as f64 + 0.5) / width as f64,
        y: (y as f64 + 0.5) / height as f64,
        colour,
        is_border: x < ring || y < ring || x + ring >= width || y + ring >= height,
    };
    pixels.map(sample).collect()
}

fn terms(x: f64, y: f64) -> [f64; TERMS] {
    let (x, y) = (2.0 * x - 1.0, 2.0 * y - 1.0);
    [1.0, x, y, x * x, x * y, y * y]
}

fn constant(value: f32) -> [f64; TERMS] {
    let mut k = [0.0; TERMS];
    k[0] = f64::from(value);
    k
}
