//! Models of one component, for colour: channels are turned to the axes of the colours' covariance (KLT), where
//! components do not correlate, and each is modelled by itself in each band.

use super::super::Precision;
use super::super::container::{Fault, Reader, Writer};
use super::autoregression::{Covariances, NEIGHBOURS, Scalar, ScalarModel, estimate};
use super::numbers::{Numbers, Width};
use super::{BandFilter, FieldModel};
use nalgebra::{Matrix3, Vector3};
use std::marker::PhantomData;

/// Which way each axis points, so that one noise means the same in all groups: light, warm, green.
const SENSES: [[f64; 3]; 3] = [[1.0, 1.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 2.0, -1.0]];

/// The texture of one group of pictures.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct Decorrelated<M> {
    /// Columns are the axes, by falling variance; 9 numbers, column by column.
    axes: Numbers,
    /// Bit s stands for neighbour s; one word per band and component.
    masks: Vec<u32>,
    /// One per band and component.
    sigmas: Numbers,
    coefficients: Numbers,
    model: PhantomData<M>,
}

impl<M: ScalarModel> FieldModel for Decorrelated<M> {
    fn estimate(bands: &[Covariances], precision: Precision) -> Self {
        let total = bands.iter().fold(Matrix3::zeros(), |sum, band| sum + band.at([0, 0]));
        let axes = Numbers::new(principal_axes(&total).as_slice(), precision, Width::Word);
        let used = Matrix3::from_iterator(axes.values());
        let models: Vec<Scalar> = bands
            .iter()
            .flat_map(|band| (0..3).map(|c| estimate::<M>(&band.along(&used.column(c).into_owned()))))
            .collect();
        let sigmas: Vec<f64> = models.iter().map(|m| m.sigma).collect();
        let coefficients: Vec<f64> = models.iter().flat_map(|m| m.coefficients.iter().copied()).collect();
        Self {
            axes,
            masks: models.iter().map(|m| mask(&m.neighbours)).collect(),
            sigmas: Numbers::new(&sigmas, precision, Width::Word),
            coefficients: Numbers::new(&coefficients, precision, Width::Word),
            model: PhantomData,
        }
    }

    fn filter(&self, band: usize) -> BandFilter {
        let axes = Matrix3::from_iterator(self.axes.values());
        let (sigmas, coefficients) = (self.sigmas.values(), self.coefficients.values());
        let starts: Vec<usize> = running_counts(&self.masks);
        let model = |c: usize| {
            let number = 3 * band + c;
            let (start, end) = (starts[number], starts[number + 1]);
            let coefficients = coefficients[start..end].to_vec();
            Scalar { neighbours: neighbours(self.masks[number]), coefficients, sigma: sigmas[number] }
        };
        let models: [Scalar; 3] = std::array::from_fn(model);
        Box::new(move |wave| {
            let gains = Vector3::from_fn(|c, _| M::filter(&models[c], wave).unwrap_or_default() * models[c].sigma);
            Matrix3::from_fn(|row, c| gains[c] * axes[(row, c)])
        })
    }

    fn write(&self, out: &mut Writer) {
        self.axes.write(out);
        self.masks.iter().for_each(|&mask| out.bits(mask, NEIGHBOURS.len() as u32));
        out.align();
        self.sigmas.write(out);
        self.coefficients.write(out);
    }

    fn read(from: &mut Reader<'_>, bands: usize, precision: Precision) -> Result<Self, Fault> {
        let axes = Numbers::read(from, 9, precision, Width::Word)?;
        let masks = (0..3 * bands).map(|_| from.bits(NEIGHBOURS.len() as u32)).collect::<Result<Vec<_>, _>>()?;
        from.align();
        let sigmas = Numbers::read(from, masks.len(), precision, Width::Word)?;
        let count = masks.iter().map(|m| m.count_ones() as usize).sum();
        let coefficients = Numbers::read(from, count, precision, Width::Word)?;
        Ok(Self { axes, masks, sigmas, coefficients, model: PhantomData })
    }
}

/// Eigenvectors by falling eigenvalue, in the senses above.
fn principal_axes(covariance: &Matrix3<f64>) -> Matrix3<f64> {
    let eigen = covariance.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]).then(a.cmp(&b)));
    Matrix3::from_fn(|row, c| {
        let axis = eigen.eigenvectors.column(order[c]);
        let sense = axis.dot(&Vector3::from(SENSES[c]));
        if sense < 0.0 { -axis[row] } else { axis[row] }
    })
}

/// A bit per neighbour.
pub(in super::super) fn mask(neighbours: &[usize]) -> u32 {
    neighbours.iter().fold(0, |mask, &s| mask | (1 << s))
}

/// The neighbours of a mask, in order.
pub(in super::super) fn neighbours(mask: u32) -> Vec<usize> {
    (0..NEIGHBOURS.len()).filter(|s| mask >> s & 1 == 1).collect()
}

/// How many neighbours come before each mask, and after the last.
pub(in super::super) fn running_counts(masks: &[u32]) -> Vec<usize> {
    let step = |sum: &mut usize, mask: &u32| {
        *sum += mask.count_ones() as usize;
        Some(*sum)
    };
    std::iter::once(0).chain(masks.iter().scan(0, step)).collect()
}
