//! The layers of a model as small pictures, and the weights a facet gives them.

use capture::{Image, reduced};
use nalgebra::Point3;
use texture::{Appearance, FacetWeights, Layers, Model};

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

/// The layers as they are stored, no side longer than `side`, which must be above 0.
pub fn thumbnails(layers: &Layers, side: usize) -> Vec<Image<[u8; 3]>> {
    let small = |texels: &Image<[u8; 3]>| reduced(texels, texels.width().max(texels.height()).div_ceil(side.max(1)));
    layers.layers.iter().map(|layer| small(&layer.texels)).collect()
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
