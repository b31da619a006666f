//! Principal components of each view: the pictures of one view are weighted sums of a few.
//!
//! ```text
//! I(x, c | i, v) ≈ B_v0(x, c) + Σ_{j ≤ k_v} W_vj(i) · B_vj(x, c)
//! ```
//!
//! with P texels x, 3 channels c, light i and view v: for each view `k_v + 1` images of 3P numbers and `n_i k_v`
//! weights. Between measured lights weights are interpolated, between views values.
//!
//! *Parameters*: k. Standard 16, as Sattler and others. With [`Budget::Components`] it is the same for all views;
//! a ratio or quality spends components where they lower the error most, whichever view that is. Auto by the criterion of `linear`.
//! *Bytes*: `n_v (3P (k+1) + n_i k)` numbers ([`printed_bytes`] has the figure of the literature).
//! *Cost*: fit exact, by the Gram matrix of lights (`n_v · 3P · n_i²` multiplications in f64); a value `18k`
//! multiplications, all of a texel contiguous.
//! *Limits*: nothing is shared by views: the ratio never exceeds `n_i / (k + 1)`, however large the tile. In return
//! parallax costs nothing.
//! *Degenerate data*: a view that is constant under all lights needs no component, and gets none.
//!
//! Source: Sattler, Sarlette, Klein, "Efficient and realistic visualization of cloth", EGSR 2003.
//! Values are not clamped above, and at 0 below.

pub use super::pca::Options;

use super::budget::{bytes_for, check_samples};
use super::container::{Fault, Reader, Stored, Writer};
use super::linear::{self, LinearModel, Source, Target, affine, blend_into};
use super::{Blend, FitReport, Frame, Sampler};
use crate::TextureError;
use capture::btf::Btf;
use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;

/// Components of [`Budget::Standard`].
const STANDARD: usize = 16;
/// Weights blended at a time, on the stack.
const BATCH: usize = 16;

/// The codec.
#[derive(Clone, Debug, PartialEq)]
pub struct PcaView {
    frame: Frame,
    /// One a view; elements (texel, channel), observations lights.
    models: Vec<LinearModel>,
}

/// Fits the codec. The objective is the RMSE without components, then with them.
///
/// # Errors
/// Where samples are not finite.
pub fn fit(btf: &Btf, options: &Options) -> Result<(PcaView, FitReport), TextureError> {
    check_samples(btf)?;
    let frame = Frame::of(btf);
    let (length, count) = (3 * btf.texels(), btf.lights.len());
    // Two bytes a view tell its number of components.
    let bytes = |ratio| bytes_for(ratio, btf).saturating_sub(2 * btf.views.len());
    let target = Target::of(options.budget, STANDARD, bytes);
    let most = if matches!(target, Target::Each(_)) { target.most(length + count) } else { count };
    let view = |samples: &[f32]| Source::new(DMatrix::from_column_slice(length, count, samples), most, options.seed);
    let sources: Vec<Source> = btf.samples.par_chunks_exact(length * count).map(view).collect();
    let mut notes = Vec::new();
    let models = linear::fit(&sources, target, options.precision, &mut notes);
    let objective = linear::objective(&sources, &models);
    Ok((PcaView { frame, models }, FitReport { objective, notes }))
}

/// Bytes of one view of k components and a mean as the literature counts them: images in 8 bits, each weight in
/// `weight_bytes`.
pub fn printed_bytes(texels: usize, lights: usize, components: usize, weight_bytes: usize) -> usize {
    3 * texels * (components + 1) + lights * components * weight_bytes
}

impl PcaView {
    /// Number of components of each view.
    pub fn components(&self) -> Vec<usize> {
        self.models.iter().map(LinearModel::components).collect()
    }

    fn add_value(&self, view: usize, texel: usize, light: &Blend, share: f32, value: &mut [f32; 3]) {
        let model = &self.models[view];
        let rows = model.images.count();
        let images = model.images.elements(3 * texel, 3);
        (0..3).for_each(|c| value[c] += share * images[c * rows]);
        for start in (0..rows - 1).step_by(BATCH) {
            let length = BATCH.min(rows - 1 - start);
            let mut weights = [0.0; BATCH];
            let used = light.entries.iter().filter(|(_, w)| *w > 0.0);
            let lights = used.map(|&(l, w)| (&model.weights.element(l as usize)[start..start + length], w * share));
            blend_into(lights, &mut weights[..length]);
            let image = |c: usize| &images[c * rows + 1 + start..][..length];
            (0..3).for_each(|c| value[c] += linear::dot(image(c), &weights[..length]));
        }
    }
}

impl Sampler for PcaView {
    fn frame(&self) -> &Frame {
        &self.frame
    }

    fn value(&self, texel: usize, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3] {
        let light = self.frame.lights.blend(light);
        let mut value = [0.0; 3];
        for (view, share) in self.frame.views.blend(view).entries.into_iter().filter(|(_, w)| *w > 0.0) {
            self.add_value(view as usize, texel, &light, share, &mut value);
        }
        value.map(|v| v.max(0.0))
    }

    fn picture(&self, light: &Vector3<f32>, view: &Vector3<f32>) -> Vec<f32> {
        let light = self.frame.lights.blend(light);
        let mut picture = vec![0.0f32; 3 * self.frame.texels()];
        for (view, share) in self.frame.views.blend(view).entries.into_iter().filter(|(_, w)| *w > 0.0) {
            let model = &self.models[view as usize];
            let mut weights = vec![0.0; model.components()];
            blend_into(light.entries.iter().map(|&(l, w)| (model.weights.element(l as usize), w)), &mut weights);
            let add = |(e, p): (usize, &mut f32)| *p += share * affine(model.images.element(e), &weights);
            picture.iter_mut().enumerate().for_each(add);
        }
        picture.iter_mut().for_each(|p| *p = p.max(0.0));
        picture
    }
}

impl Stored for PcaView {
    fn write(&self, out: &mut Writer) {
        out.part("counts");
        self.models.iter().for_each(|model| out.u16(model.components() as u16));
        out.part("components");
        self.models.iter().for_each(|model| model.images.write(out));
        out.part("weights");
        self.models.iter().for_each(|model| model.weights.write(out));
    }

    fn read(from: &mut Reader<'_>, frame: Frame) -> Result<Self, Fault> {
        let counts = from.u16s(frame.views.len())?;
        let models = LinearModel::read_all(from, counts.iter().map(|&k| (3 * frame.texels(), frame.lights.len(), k)))?;
        Ok(Self { frame, models })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_printed_ratio_is_that_of_six_components_in_bytes() {
        let ratio = |k: usize, bytes: usize| f64::from(625 * 81 * 3) / printed_bytes(625, 81, k, bytes) as f64;
        // 11.2 is printed of 625 texels, without the number of components.
        let is_it = |&(k, bytes): &(usize, usize)| format!("{:.1}", ratio(k, bytes)) == "11.2";
        let accounts = (1..=16).flat_map(|k| [1, 2, 4].map(|bytes| (k, bytes)));
        assert_eq!(accounts.filter(is_it).collect::<Vec<_>>(), [(6, 1)]);
        assert_eq!(format!("{:.1}", ratio(5, 4)), "11.8");
        assert!((f64::from(1u32 << 24) * 243.0 / printed_bytes(1 << 24, 81, 5, 1) as f64 - 13.5).abs() < 0.001);
    }
}
