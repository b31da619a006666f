//! Colours that stand for something else.

use crate::scene::Scene;
use capture::Image;
use geometry::TexturedMesh;
use texture::directions::{DirectionComplex, Layout};
use texture::{Appearance, FacetWeights, Layer, Layers, Method, Model, spread_labels};

/// Dark to bright, of even lightness steps: viridis (van der Walt and Smith 2015) at eighths.
const RAMP: [[f64; 3]; 9] = [
    [68.0, 1.0, 84.0],
    [71.0, 44.0, 122.0],
    [59.0, 81.0, 139.0],
    [44.0, 113.0, 142.0],
    [33.0, 144.0, 141.0],
    [39.0, 173.0, 129.0],
    [92.0, 200.0, 99.0],
    [170.0, 220.0, 50.0],
    [253.0, 231.0, 37.0],
];

/// Black over red to pale: inferno (the same authors) at eighths.
const HEAT: [[f64; 3]; 9] = [
    [0.0, 0.0, 4.0],
    [31.0, 12.0, 72.0],
    [85.0, 15.0, 109.0],
    [136.0, 34.0, 106.0],
    [186.0, 54.0, 85.0],
    [227.0, 89.0, 51.0],
    [249.0, 140.0, 10.0],
    [249.0, 201.0, 50.0],
    [252.0, 255.0, 164.0],
];

/// The colour of the `index`th facet: neighbours in number are far apart in hue.
pub fn of_facet(index: usize) -> [u8; 3] {
    /// Turns by this share of the circle come nowhere near each other.
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let hue = 6.0 * (index as f64 * GOLDEN).fract();
    let value = [235.0, 190.0, 150.0][index % 3];
    let channel = |shift: f64| {
        let k = (shift + hue) % 6.0;
        value * (1.0 - 0.62 * k.min(4.0 - k).clamp(0.0, 1.0))
    };
    [channel(5.0), channel(3.0), channel(1.0)].map(|c| c.round() as u8)
}

/// The colour of a place from 0, one layer, to 1, the most; what is no number is as 0.
pub fn of_rank(share: f64) -> [u8; 3] {
    along(&RAMP, share)
}

/// The colour of a share from 0 to 1 of the largest difference that is told apart.
pub fn of_difference(share: f64) -> [u8; 3] {
    along(&HEAT, share)
}

fn along(colours: &[[f64; 3]; 9], share: f64) -> [u8; 3] {
    let at = 8.0 * if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 };
    let low = (at as usize).min(7);
    let t = at - low as f64;
    std::array::from_fn(|c| (colours[low][c] * (1.0 - t) + colours[low + 1][c] * t).round() as u8)
}

/// The facet of every texel of the atlas; of a lumigraph, which has none, the chart.
pub fn facets(model: &Model) -> Image<u16> {
    match &model.appearance {
        Appearance::Layers(layers) => layers.facet_of_texel.clone(),
        Appearance::Lumigraph(_, surface) => {
            let chart = |&face: &u32| model.mesh.face_charts.get(face as usize).map_or(0, |&chart| chart as u16);
            let charts: Vec<u16> = surface.faces.iter().map(chart).collect();
            spread_labels(surface.size, &surface.index, &charts)
        }
    }
}

/// How many layers every texel of the atlas is blended of; of a lumigraph, how many rays it has.
pub fn ranks(model: &Model) -> Image<u16> {
    match &model.appearance {
        Appearance::Layers(layers) => {
            layers.facet_of_texel.map(|facet| layers.facets.get(usize::from(facet)).map_or(0, |f| f.rank as u16))
        }
        Appearance::Lumigraph(rays, surface) => {
            let count = |views: &[u16]| views.iter().filter(|&&view| view != texture::appearance::NO_RAY).count();
            let counts: Vec<u16> = rays.views.chunks(rays.rays.max(1)).map(|views| count(views) as u16).collect();
            spread_labels(surface.size, &surface.index, &counts)
        }
    }
}

/// Most layers that any texel of the models is blended of.
pub fn most_layers(scene: &Scene) -> usize {
    let ranks = scene.models.iter().filter_map(|model| ranks(model).pixels().iter().max().copied());
    ranks.max().map_or(0, usize::from)
}

/// The same objects, without a backdrop, with every texel in the colour that stands for its label.
pub fn painted(scene: &Scene, label: fn(&Model) -> Image<u16>, colour: impl Fn(u16) -> [u8; 3]) -> Scene {
    let paint = |model: &Model| textured(&model.mesh, label(model).map(&colour));
    Scene { models: scene.models.iter().map(paint).collect(), objects: scene.objects.clone(), backdrop: None }
}

/// A model with one texture for all views.
fn textured(mesh: &TexturedMesh, texels: Image<[u8; 3]>) -> Model {
    let facet_of_texel = texels.map(|_| 0);
    let complex = DirectionComplex::build(&[], Layout::General);
    let facet = FacetWeights { center: nalgebra::Point3::origin(), complex, rank: 1, table: Vec::new() };
    let layer = Layer { texels, scale: 1.0, offset: 0.0, coded: Vec::new() };
    let layers = Layers { layers: vec![layer], facet_of_texel, facets: vec![facet] };
    let appearance = Appearance::Layers(layers);
    Model { mesh: mesh.clone(), method: Method::Static, appearance, materials: Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ramps_grow_lighter_and_take_anything() {
        let lightness = |[r, g, b]: [u8; 3]| 0.3 * f64::from(r) + 0.59 * f64::from(g) + 0.11 * f64::from(b);
        for ramp in [of_rank, of_difference] {
            let shades: Vec<f64> = (0..=32).map(|k| lightness(ramp(f64::from(k) / 32.0))).collect();
            assert!(shades.windows(2).all(|pair| pair[1] > pair[0]), "{shades:?}");
            assert_eq!((ramp(f64::NAN), ramp(-3.0), ramp(9.0)), (ramp(0.0), ramp(0.0), ramp(1.0)));
        }
    }

    #[test]
    fn neighbouring_facets_are_told_apart() {
        for k in 0..2000 {
            let (a, b) = (of_facet(k), of_facet(k + 1));
            let apart: i32 = (0..3).map(|c| (i32::from(a[c]) - i32::from(b[c])).abs()).sum();
            assert!(apart > 60, "{k}: {a:?} {b:?}");
        }
    }
}
