//! The layers of a model as small pictures, and the weights a facet gives them.

use capture::{Image, reduced};
use nalgebra::Point3;
use texture::{Appearance, FacetWeights, Layer, Layers, Method, Model};

/// One layer, as a slider shows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficient {
    /// What the eye asks for.
    pub asked: f64,
    /// The smallest and the largest that any photograph asks for, with a margin; never empty.
    pub range: [f64; 2],
}

/// The model's layers; `None` of a lumigraph.
pub fn layers(model: &Model) -> Option<&Layers> {
    match &model.appearance {
        Appearance::Layers(layers) => Some(layers),
        Appearance::Lumigraph(..) => None,
    }
}

/// The layers, reduced until no side is longer than `side`, as far as the shorter one allows. Those of DynTex after the
/// first are stretched about their mean, so that what they change can be seen.
pub fn thumbnails(model: &Model, layers: &Layers, side: usize) -> Vec<Image<[u8; 3]>> {
    let thumbnail = |(k, layer): (usize, &Layer)| {
        let small = small(&layer.texels, side);
        if k > 0 && model.method == Method::DynTex { stretched(&small) } else { small }
    };
    layers.layers.iter().enumerate().map(thumbnail).collect()
}

/// Of a thin picture something stays: its shorter side is a pixel at least.
fn small(texels: &Image<[u8; 3]>, side: usize) -> Image<[u8; 3]> {
    let (width, height) = (texels.width(), texels.height());
    reduced(texels, width.max(height).div_ceil(side.max(1)).min(width.min(height)))
}

/// Three standard deviations fill the range.
fn stretched(image: &Image<[u8; 3]>) -> Image<[u8; 3]> {
    let values = image.pixels().as_flattened();
    let count = values.len().max(1) as f64;
    let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / count;
    let variance = values.iter().map(|&v| (f64::from(v) - mean).powi(2)).sum::<f64>() / count;
    let gain = (127.0 / (3.0 * variance.sqrt()).max(1.0)).max(1.0);
    // Casts saturate.
    image.map(|pixel| pixel.map(|v| (127.5 + gain * (f64::from(v) - mean)).round() as u8))
}

/// The weights of a facet's layers as seen from `eye`, in the model's coordinates.
pub fn coefficients(facet: &FacetWeights, eye: &Point3<f64>) -> Vec<Coefficient> {
    let rows = || facet.table.chunks_exact(facet.rank.max(1));
    let of_layer = |(layer, &asked): (usize, &f32)| {
        let values = rows().map(|row| f64::from(row[layer])).chain([f64::from(asked), 0.0]);
        let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)]);
        let margin = 0.1 * (high - low).max(1e-3);
        Coefficient { asked: asked.into(), range: [low - margin, high + margin] }
    };
    facet.at(eye).iter().enumerate().map(of_layer).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thin_picture_keeps_its_shorter_side() {
        for (size, reduced) in [([600, 400], [200, 133]), ([600, 2], [300, 1]), ([1, 900], [1, 900]), ([0, 0], [0, 0])]
        {
            let small = small(&Image::filled(size[0], size[1], [7; 3]), 256);
            assert_eq!([small.width(), small.height()], reduced);
            assert!(small.pixels().iter().all(|pixel| *pixel == [7; 3]));
        }
    }
}
