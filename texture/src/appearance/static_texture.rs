//! Static texture: one colour per texel, the best single answer for all views.
//!
//! `T(texel) = Σ_j a_j w_j t_j / Σ_j a_j w_j`, with w the trust of an observation and a the image area of
//! the texel in view j. Weighting by area makes the mean the minimiser of the reprojection error summed
//! over *pixels* of all views, for photographs sampled at their own resolution.
//! Source: Jagersand, Birkbeck, Cobzas, section 6 ("static texture"). Cost: one pass over all samples.

use crate::bake::Bake;
use crate::coding;
use crate::directions::DirectionComplex;
use crate::directions::Layout;
use crate::layers::{FacetWeights, Layer, Layers};
use crate::model::FitOptions;
use crate::observe::Observation;
use capture::Image;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// Fits the texture; also says which texels were seen.
pub(crate) fn fit(bake: &Bake<'_>, options: &FitOptions) -> Option<(Layers, usize)> {
    let means: Vec<(Vec<[f32; 3]>, Vec<bool>)> =
        (0..bake.facets.texels.len()).into_par_iter().map(|f| facet_mean(bake, f)).collect();
    let (values, known): (Vec<_>, Vec<_>) = means.into_iter().unzip();
    let unseen = known.iter().flatten().filter(|&&k| !k).count();
    let layer = base_layer(&bake.paint(&values, &known), options)?;
    let facets = bake.facets.centers.iter().map(|&center| constant(center)).collect();
    Some((Layers { layers: vec![layer], facet_of_texel: bake.facet_of_texel(), facets }, unseen))
}

/// A facet that shows its first layer from everywhere.
fn constant(center: Point3<f64>) -> FacetWeights {
    FacetWeights { center, complex: DirectionComplex::build(&[], Layout::General), rank: 1, table: Vec::new() }
}

/// Codes an image of intensities as a layer without scaling.
pub(crate) fn base_layer(image: &Image<[f32; 3]>, options: &FitOptions) -> Option<Layer> {
    let texels = image.map(|p| p.map(|v| v.round().clamp(0.0, 255.0) as u8));
    let coded = coding::encode_jpeg(&texels, options.quantiser)?;
    let texels = coding::decode(&coded, [texels.width(), texels.height()]).ok()?;
    Some(Layer { texels, scale: 1.0, offset: 0.0, coded })
}

fn facet_mean(bake: &Bake<'_>, facet: usize) -> (Vec<[f32; 3]>, Vec<bool>) {
    let samples = bake.samples(facet);
    let texels = bake.facets.texels[facet].iter().enumerate();
    let means = texels.map(|(i, &t)| {
        let (point, normal) = (&bake.surface.positions[t as usize], &bake.surface.normals[t as usize]);
        weighted_mean(samples.row(i), |j| image_area(&bake.observers[j].center(), point, normal))
    });
    means.map(|m| (m.unwrap_or_default(), m.is_some())).unzip()
}

/// Image area of a texel up to a constant: `cos θ / distance²`.
fn image_area(center: &Point3<f64>, point: &Point3<f64>, normal: &Vector3<f64>) -> f64 {
    let d = center - point;
    normal.dot(&d).max(0.0) / d.norm().powi(3)
}

fn weighted_mean(row: &[Observation], area: impl Fn(usize) -> f64) -> Option<[f32; 3]> {
    let mut sum = [0.0f64; 3];
    let mut total = 0.0f64;
    for (j, o) in row.iter().enumerate().filter(|(_, o)| o.weight > 0.0) {
        let w = f64::from(o.weight) * area(j);
        total += w;
        sum.iter_mut().zip(o.color).for_each(|(s, c)| *s += w * f64::from(c));
    }
    (total > 0.0).then(|| sum.map(|s| (s / total) as f32))
}
