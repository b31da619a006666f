//! Mean and deviation of every picture, and the shape of its histogram.
//!
//! Means and deviations of three channels over all pairs are a matrix of views × 6 · lights. Its leading singular
//! pairs (Eckart and Young 1936) are what is stored: a mean BRDF of full size would be larger than the whole model.

use super::super::container::{Fault, Reader, Writer};
use super::super::frame::Blend;
use super::super::{Frame, Precision};
use super::numbers::{Numbers, Width};
use capture::btf::Btf;
use nalgebra::DMatrix;

/// Means, then deviations, of three channels.
pub(super) const MOMENTS: usize = 6;
/// Levels of a histogram's shape per channel: the means of as many equal parts of the sorted values.
pub(super) const TONES: usize = 16;
/// Below this deviation a channel is constant.
const CONSTANT: f64 = 1e-7;

/// Factors of the matrix, one of either kind per rank: the views', and (light, moment).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Moments {
    views: Vec<Numbers>,
    lights: Vec<Numbers>,
}

impl Moments {
    /// The leading `rank` singular pairs; fewer where there are fewer.
    pub(super) fn of(btf: &Btf, rank: usize, precision: Precision) -> Self {
        let (views, columns) = (btf.views.len(), MOMENTS * btf.lights.len());
        let pictures = btf.samples.chunks_exact(3 * btf.texels());
        let moments: Vec<f64> = pictures.flat_map(moments_of).collect();
        let matrix = DMatrix::from_row_slice(views, columns, &moments);
        let eigen = (&matrix * matrix.transpose()).symmetric_eigen();
        let mut order: Vec<usize> = (0..views).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]).then(a.cmp(&b)));
        let mut factors = Self { views: Vec::new(), lights: Vec::new() };
        for &k in order.iter().take(rank) {
            let view = Numbers::new(eigen.eigenvectors.column(k).as_slice(), precision, Width::Byte);
            // What is projected on is what will be read.
            let used = DMatrix::from_row_slice(1, views, &view.values());
            let norm = used.norm_squared();
            let light = if norm > 0.0 { (used * &matrix) / norm } else { DMatrix::zeros(1, columns) };
            factors.lights.push(Numbers::new(light.as_slice(), precision, Width::Byte));
            factors.views.push(view);
        }
        factors
    }

    pub(super) fn rank(&self) -> usize {
        self.views.len()
    }

    /// Between measured directions.
    pub(super) fn at(&self, view: &Blend, light: &Blend) -> [f64; MOMENTS] {
        let mut moments = [0.0; MOMENTS];
        for (views, lights) in self.views.iter().zip(&self.lights) {
            let (views, lights) = (views.values(), lights.values());
            let scale: f64 = view.entries.iter().map(|&(v, w)| f64::from(w) * views[v as usize]).sum();
            for &(l, w) in &light.entries {
                let column = &lights[MOMENTS * l as usize..][..MOMENTS];
                moments.iter_mut().zip(column).for_each(|(m, c)| *m += scale * f64::from(w) * c);
            }
        }
        moments
    }

    pub(super) fn write(&self, out: &mut Writer) {
        self.views.iter().zip(&self.lights).for_each(|(view, light)| {
            view.write(out);
            light.write(out);
        });
    }

    pub(super) fn read(from: &mut Reader<'_>, rank: usize, frame: &Frame, precision: Precision) -> Result<Self, Fault> {
        let mut factors = Self { views: Vec::new(), lights: Vec::new() };
        for _ in 0..rank {
            factors.views.push(Numbers::read(from, frame.views.len(), precision, Width::Byte)?);
            factors.lights.push(Numbers::read(from, MOMENTS * frame.lights.len(), precision, Width::Byte)?);
        }
        Ok(factors)
    }
}

/// Of one picture, (y, x, channel).
pub(super) fn moments_of(picture: &[f32]) -> [f64; MOMENTS] {
    let mut moments = [0.0; MOMENTS];
    for c in 0..3 {
        let (mean, deviation) = mean_and_deviation(picture.iter().skip(c).step_by(3).map(|&v| f64::from(v)));
        moments[c] = mean;
        moments[3 + c] = deviation;
    }
    moments
}

/// Takes mean and deviation away; a constant channel becomes 0.
pub(super) fn standardise(values: &mut [f64]) {
    let (mean, deviation) = mean_and_deviation(values.iter().copied());
    let scale = if deviation > CONSTANT { 1.0 / deviation } else { 0.0 };
    values.iter_mut().for_each(|v| *v = (*v - mean) * scale);
}

fn mean_and_deviation(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let count = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / count;
    let variance = values.map(|v| (v - mean) * (v - mean)).sum::<f64>() / count;
    (mean, variance.sqrt())
}

/// The shape of standardised values; those of a constant are 0.
pub(super) fn tones(values: &[f64]) -> [f64; TONES] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    std::array::from_fn(|i| {
        let start = (i * n / TONES).min(n.saturating_sub(1));
        let end = ((i + 1) * n / TONES).clamp(start + 1, n.max(start + 1));
        sorted.get(start..end).map_or(0.0, |part| part.iter().sum::<f64>() / part.len() as f64)
    })
}

/// Gives values the shape of `tones`, keeping their order.
pub(super) fn shape(values: &mut [f64], tones: &[f64; TONES]) {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]).then(a.cmp(&b)));
    let scale = TONES as f64 / values.len().max(1) as f64;
    for (rank, &place) in order.iter().enumerate() {
        let at = (rank as f64 + 0.5) * scale - 0.5;
        let low = at.floor().clamp(0.0, (TONES - 2) as f64);
        let share = at - low;
        values[place] = tones[low as usize] * (1.0 - share) + tones[low as usize + 1] * share;
    }
    standardise(values);
}
