//! Discrete Fourier transforms of fields that continue themselves on all sides.

use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

/// Transforms of one size.
pub(in super::super) struct Fourier {
    size: [usize; 2],
    /// Along rows, then along columns.
    forward: [Arc<dyn Fft<f64>>; 2],
    inverse: [Arc<dyn Fft<f64>>; 2],
}

/// Powers of `e^(−iω)` at one frequency: what a shift of the field multiplies its transform by.
pub(in super::super) struct Wave {
    /// `e^(−iω_x n)` for n = 0, 1, …
    x: [Complex64; Self::REACH + 1],
    y: [Complex64; Self::REACH + 1],
}

impl Fourier {
    pub(in super::super) fn new(size: [usize; 2]) -> Self {
        let mut planner = FftPlanner::new();
        let forward = size.map(|n| planner.plan_fft_forward(n));
        let inverse = size.map(|n| planner.plan_fft_inverse(n));
        Self { size, forward, inverse }
    }

    /// `F(k) = Σ_r f(r) e^(−2πi k·r/N)`, laid out (y, x).
    pub(in super::super) fn forward(&self, field: &[f64]) -> Vec<Complex64> {
        self.along_both(field.iter().map(|&v| Complex64::new(v, 0.0)).collect(), &self.forward)
    }

    /// The real part of the field whose transform this is.
    pub(in super::super) fn inverse(&self, spectrum: Vec<Complex64>) -> Vec<f64> {
        let scale = 1.0 / (self.size[0] * self.size[1]) as f64;
        self.along_both(spectrum, &self.inverse).iter().map(|v| v.re * scale).collect()
    }

    fn along_both(&self, mut field: Vec<Complex64>, [rows, columns]: &[Arc<dyn Fft<f64>>; 2]) -> Vec<Complex64> {
        rows.process(&mut field);
        let mut turned = transposed(&field, self.size[0]);
        columns.process(&mut turned);
        transposed(&turned, self.size[1])
    }
}

impl Wave {
    /// The longest shift, in texels.
    pub(in super::super) const REACH: usize = 3;

    /// At an angular frequency, radians per texel.
    pub(in super::super) fn new([x, y]: [f64; 2]) -> Self {
        let powers = |w: f64| std::array::from_fn(|n| Complex64::from_polar(1.0, -w * n as f64));
        Self { x: powers(x), y: powers(y) }
    }

    /// `e^(−iω·s)`.
    pub(in super::super) fn shift(&self, [x, y]: [i32; 2]) -> Complex64 {
        let power = |powers: &[Complex64], n: i32| {
            let p = powers[n.unsigned_abs() as usize];
            if n < 0 { p.conj() } else { p }
        };
        power(&self.x, x) * power(&self.y, y)
    }
}

/// The angular frequency of a coefficient, −π to π radians per texel.
pub(in super::super) fn frequency(k: usize, n: usize) -> f64 {
    let signed = if 2 * k > n { k as f64 - n as f64 } else { k as f64 };
    std::f64::consts::TAU * signed / n as f64
}

fn transposed(field: &[Complex64], width: usize) -> Vec<Complex64> {
    let height = field.len() / width.max(1);
    (0..field.len()).map(|i| field[(i % height) * width + i / height]).collect()
}

impl std::fmt::Debug for Fourier {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Fourier").field("size", &self.size).finish_non_exhaustive()
    }
}
