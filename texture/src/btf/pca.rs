//! Principal components of the whole data: every picture is a weighted sum of a few.
//!
//! ```text
//! I(x, c | i, v) ≈ B₀(x, c) + Σ_{j ≤ k} W_j(i, v) · B_j(x, c)
//! ```
//!
//! with P texels x, 3 channels c, light i and view v: images B of 3P numbers, one weight a pair. Between measured directions weights
//! are interpolated, which is the same as interpolating pictures.
//!
//! *Parameters*: k. Standard 150, as Koudelka and others. Auto by the criterion of `linear`.
//! *Bytes*: `3P (k+1) + n_i n_v k` numbers, of fewest bits each ([`printed_bytes`] has the figure of the literature).
//! *Cost*: fit by random projection, about `18 · 3P · n_i n_v · k` floating point operations; a value `9k + 3k`
//! multiplications, a picture `9k + 3Pk`.
//! *Limits*: parallax and moving shadows are no sums of few pictures; k grows with them. Weights cost as much
//! as images where texels are few.
//! *Degenerate data*: what is constant needs no component, and gets none.
//!
//! Source: Koudelka, Magda, Belhumeur, Kriegman, "Acquisition, compression, and synthesis of bidirectional
//! texture functions", Texture 2003. Values may overshoot 0 and 1 a little; they are not clamped above, and at 0 below.

use super::budget::{bytes_for, check_samples};
use super::container::{Fault, Reader, Stored, Writer};
use super::linear::{self, LinearModel, Source, Target, affine, blend_into};
use super::{Budget, FitReport, Frame, Precision, Sampler};
use crate::TextureError;
use capture::btf::Btf;
use nalgebra::{DMatrix, Vector3};

/// Components of [`Budget::Standard`].
const STANDARD: usize = 150;
/// Weights blended at a time, on the stack.
const BATCH: usize = 32;

/// How it is fitted, here and view by view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// How many components.
    pub budget: Budget,
    /// How they are stored.
    pub precision: Precision,
    /// Of the random projection; components of a view need none up to 256 lights.
    pub seed: u64,
}

/// The codec.
#[derive(Clone, Debug, PartialEq)]
pub struct Pca {
    frame: Frame,
    /// Elements (texel, channel), observations (view, light).
    model: LinearModel,
}

impl Options {
    /// What a budget means for this codec.
    ///
    /// # Errors
    /// Where a ratio or quality is out of range.
    pub fn new(_btf: &Btf, budget: Budget, precision: Precision, seed: u64) -> Result<Self, TextureError> {
        Ok(Self { budget: budget.checked()?, precision, seed })
    }
}

/// Fits the codec. The objective is the RMSE without components, then with them.
///
/// # Errors
/// Where samples are not finite.
pub fn fit(btf: &Btf, options: &Options) -> Result<(Pca, FitReport), TextureError> {
    check_samples(btf)?;
    let frame = Frame::of(btf);
    let (length, count) = (3 * btf.texels(), btf.pairs());
    // Two bytes tell the number of components.
    let target = Target::of(options.budget, STANDARD, |ratio| bytes_for(ratio, btf).saturating_sub(2));
    let data = DMatrix::from_column_slice(length, count, &btf.samples);
    let source = [Source::new(data, target.most(length + count), options.seed)];
    let mut notes = Vec::new();
    let mut models = linear::fit(&source, target, options.precision, &mut notes);
    let objective = linear::objective(&source, &models);
    Ok((Pca { frame, model: models.swap_remove(0) }, FitReport { objective, notes }))
}

/// Bytes of k components in 8 bits with a mean image, as the literature counts them: `3P (k + 1) + n_i n_v k`.
pub fn printed_bytes(texels: usize, pairs: usize, components: usize) -> usize {
    3 * texels * (components + 1) + pairs * components
}

impl Pca {
    /// Number of components.
    pub fn components(&self) -> usize {
        self.model.components()
    }
}

impl Sampler for Pca {
    fn frame(&self) -> &Frame {
        &self.frame
    }

    fn value(&self, texel: usize, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3] {
        let pairs = self.frame.blend(light, view);
        let images: [&[f32]; 3] = std::array::from_fn(|c| self.model.images.element(3 * texel + c));
        let mut value = images.map(|image| image[0]);
        let components = self.components();
        for start in (0..components).step_by(BATCH) {
            let length = BATCH.min(components - start);
            let mut weights = [0.0; BATCH];
            let used = pairs.iter().filter(|(_, w)| *w > 0.0);
            let rows = used.map(|&(pair, w)| (&self.model.weights.element(pair)[start..start + length], w));
            blend_into(rows, &mut weights[..length]);
            (0..3).for_each(|c| value[c] += linear::dot(&images[c][1 + start..1 + start + length], &weights[..length]));
        }
        value.map(|v| v.max(0.0))
    }

    fn picture(&self, light: &Vector3<f32>, view: &Vector3<f32>) -> Vec<f32> {
        let mut weights = vec![0.0; self.components()];
        let pairs = self.frame.blend(light, view);
        blend_into(pairs.iter().map(|&(pair, w)| (self.model.weights.element(pair), w)), &mut weights);
        (0..3 * self.frame.texels()).map(|e| affine(self.model.images.element(e), &weights).max(0.0)).collect()
    }
}

impl Stored for Pca {
    fn write(&self, out: &mut Writer) {
        out.part("components");
        out.u16(self.components() as u16);
        self.model.images.write(out);
        out.part("weights");
        self.model.weights.write(out);
    }

    fn read(from: &mut Reader<'_>, frame: Frame) -> Result<Self, Fault> {
        let size = (3 * frame.texels(), frame.pairs(), from.u16()?);
        let mut models = LinearModel::read_all(from, std::iter::once(size))?;
        Ok(Self { frame, model: models.swap_remove(0) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_printed_ratio_is_reproduced() {
        let raw = 625 * 6561 * 3;
        assert_eq!(format!("{:.1}", raw as f64 / printed_bytes(625, 6561, 61) as f64), "23.8");
    }
}
