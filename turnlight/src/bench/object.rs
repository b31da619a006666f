//! An object to play where none is given: closed forms, nothing fitted, the same for the same seed.

use capture::Image;
use geometry::{Mesh, TexturedMesh};
use nalgebra::{Point2, Point3, Vector3};
use std::f64::consts::TAU;
use texture::directions::{DirectionComplex, Layout};
use texture::{Appearance, FacetWeights, Layer, Layers, Method, Model};

/// Texels along a side of the atlas.
const ATLAS: usize = 512;
/// Layers, the mean among them.
const LAYERS: usize = 20;
/// Quads along a side of the six charts: 4800 triangles.
const QUADS: usize = 20;
/// Free texels around each chart.
const GAP: f64 = 3.0;
/// Texels along a side of a facet.
const FACET: usize = 32;
/// Directions a facet has weights for.
const VIEWS: usize = 100;

/// A bumpy ball of radius 1 or so: DynTex, 20 layers of 512 × 512 texels, every facet with all of them.
pub fn bumpy_ball(seed: u64) -> Model {
    let mesh = mesh();
    let phase = seed as f64 * 0.618;
    let layer = |k: usize| {
        let scale = if k == 0 { 1.0 } else { 0.4 / k as f32 };
        let offset = if k == 0 { 0.0 } else { -128.0 * scale };
        Layer { texels: pattern(k as f64 + phase), scale, offset, coded: Vec::new() }
    };
    let across = ATLAS / FACET;
    let facet = |i: usize| (i / ATLAS / FACET * across + i % ATLAS / FACET) as u16;
    let mut facet_of_texel = Image::filled(ATLAS, ATLAS, 0);
    facet_of_texel.pixels_mut().iter_mut().enumerate().for_each(|(i, texel)| *texel = facet(i));
    let sites = directions(VIEWS);
    let facets = (0..across * across).map(|f| facet_weights(f, &sites)).collect();
    let layers = Layers { layers: (0..LAYERS).map(layer).collect(), facet_of_texel, facets };
    Model { mesh, method: Method::DynTex, appearance: Appearance::Layers(layers), materials: Vec::new() }
}

/// Six charts, one for each side of the cube that the ball is blown up from.
fn mesh() -> TexturedMesh {
    let (mut mesh, mut uvs, mut face_charts) = (Mesh::default(), Vec::new(), Vec::new());
    for chart in 0..6usize {
        let axis = |k: usize| Vector3::from_fn(|i, _| if i == k % 3 { 1.0 } else { 0.0 });
        let (n, a, b) = (axis(chart), axis(chart + 1), axis(chart + 2));
        let (normal, across, down) = if chart < 3 { (n, a, b) } else { (-n, b, a) };
        let first = mesh.positions.len() as u32;
        for (j, i) in (0..=QUADS).flat_map(|j| (0..=QUADS).map(move |i| (j, i))) {
            let [s, t] = [i, j].map(|k| k as f64 / QUADS as f64);
            let p = (normal + across * (2.0 * s - 1.0) + down * (2.0 * t - 1.0)).normalize();
            let bump = 1.0 + 0.08 * (5.0 * p.x).sin() * (4.0 * p.y).cos() + 0.05 * (7.0 * p.z).sin();
            mesh.positions.push((p * bump).into());
            let coordinate = |k: usize, s: f64, cells: f64| {
                let cell = ATLAS as f64 / cells;
                (k as f64 * cell + GAP + s * (cell - 2.0 * GAP)) / ATLAS as f64
            };
            uvs.push(Point2::new(coordinate(chart % 3, s, 3.0), coordinate(chart / 3, t, 2.0)));
        }
        for (j, i) in (0..QUADS as u32).flat_map(|j| (0..QUADS as u32).map(move |i| (j, i))) {
            let at = |dj: u32, di: u32| first + (j + dj) * (QUADS as u32 + 1) + i + di;
            mesh.faces.extend([[at(0, 0), at(0, 1), at(1, 1)], [at(0, 0), at(1, 1), at(1, 0)]]);
            face_charts.extend([chart as u32; 2]);
        }
    }
    TexturedMesh { mesh, uvs, face_charts, atlas_size: [ATLAS, ATLAS] }
}

/// Weights that wave over directions: the mean stays, layer k swings k times as fast.
fn facet_weights(facet: usize, sites: &[Vector3<f64>]) -> FacetWeights {
    let weight = |site: &Vector3<f64>, k: usize| match k {
        0 => 1.0,
        _ => ((k as f64 * site.x + site.y + 0.1 * facet as f64) * 1.3).sin() as f32,
    };
    FacetWeights {
        center: Point3::from(sites[facet % sites.len()] * 0.9),
        complex: DirectionComplex::build(sites, Layout::General),
        rank: LAYERS,
        table: sites.iter().flat_map(|site| (0..LAYERS).map(move |k| weight(site, k))).collect(),
    }
}

/// All around, evenly: a spiral in steps of the golden angle.
fn directions(count: usize) -> Vec<Vector3<f64>> {
    let golden = TAU * 2.0 / (1.0 + 5f64.sqrt());
    let direction = |k: usize| {
        let z = 1.0 - (2.0 * k as f64 + 1.0) / count as f64;
        let (sin, cos) = (golden * k as f64).sin_cos();
        Vector3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
    };
    (0..count).map(direction).collect()
}

/// Waves and checks.
fn pattern(k: f64) -> Image<[u8; 3]> {
    let mut image = Image::filled(ATLAS, ATLAS, [0; 3]);
    for (i, texel) in image.pixels_mut().iter_mut().enumerate() {
        let (x, y) = (i % ATLAS, i / ATLAS);
        let check = if (x / 8 + y / 8).is_multiple_of(2) { 20.0 } else { -20.0 };
        let wave = |c: f64| (x as f64 * 0.05 * (1.0 + 0.1 * k) + c).sin() * (y as f64 * 0.04 + k).cos();
        *texel = [0.0, 1.0, 2.0].map(|c| (128.0 + 70.0 * wave(c) + check) as u8);
    }
    image
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_seed_makes_the_same_object_and_another_another() {
        let [a, b, c] = [1, 1, 2].map(|seed| match bumpy_ball(seed).appearance {
            Appearance::Layers(layers) => layers.layers[3].texels.clone(),
            Appearance::Lumigraph(..) => Image::filled(0, 0, [0; 3]),
        });
        assert!(a == b && a != c && a.width() == ATLAS);
    }
}
