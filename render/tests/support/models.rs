//! Models of every method, made up.

use capture::Image;
use geometry::TexturedMesh;
use nalgebra::{Point3, Vector3};
use texture::appearance::Lumigraph;
use texture::directions::{DirectionComplex, Layout};
use texture::{Appearance, FacetWeights, Layer, Layers, Method, Model, SurfaceTexels};

/// Bands of facets with some directions each, and layers of both signs: what VDTM and DynTex are made of.
pub(crate) fn layered(method: Method, mesh: &TexturedMesh, count: usize, size: [usize; 2]) -> Model {
    let [width, height] = size;
    let mut mesh = mesh.clone();
    mesh.atlas_size = [width, height];
    let layer = |k: usize| {
        let value = |x: usize, y: usize, c: usize| {
            let (x, y, k) = (x as f32, y as f32, k as f32);
            (128.0 + 120.0 * ((0.1 + 0.04 * k) * x + c as f32).sin() * ((0.13 + 0.03 * k) * y).cos()) as u8
        };
        let pixels = (0..width * height).map(|i| [0, 1, 2].map(|c| value(i % width, i / width, c))).collect();
        let texels = Image::from_pixels(width, height, pixels).unwrap();
        let (scale, offset) = if k == 0 { (1.0, 0.0) } else { (0.6, -76.8) };
        Layer { texels, scale, offset, coded: Vec::new() }
    };
    let bands = 12;
    let band = |i: usize| ((i / width) * bands / height) as u16;
    let facet_of_texel = Image::from_pixels(width, height, (0..width * height).map(band).collect()).unwrap();
    let sites: Vec<Vector3<f64>> = (0..14)
        .map(|k| f64::from(k) * 2.4)
        .map(|a| Vector3::new(a.cos(), a.sin(), 1.4 * (0.37 * a).sin()).normalize())
        .collect();
    let facet = |f: usize| {
        let sites = if method == Method::Static { &[] } else { &sites[..] };
        let rank = (1 + f % count).max(if method == Method::Vdtm { count } else { 1 });
        let weight = |s: usize, k: usize| if k == 0 { 1.0 } else { ((s * 5 + k * 3 + f) as f32).sin() };
        let table = (0..sites.len()).flat_map(|s| (0..rank).map(move |k| weight(s, k))).collect();
        let center = Point3::new(0.1 * (f as f64).cos(), 0.1 * (f as f64).sin(), 0.02 * f as f64);
        FacetWeights { center, complex: DirectionComplex::build(sites, Layout::General), rank, table }
    };
    let layers =
        Layers { layers: (0..count).map(layer).collect(), facet_of_texel, facets: (0..bands).map(facet).collect() };
    Model { mesh, method, appearance: Appearance::Layers(layers), materials: Vec::new() }
}

/// Rays of three to seven of nine views, other ones for each texel; some texels have none.
pub(crate) fn lumigraph(mesh: &TexturedMesh, size: [usize; 2]) -> Model {
    let mut mesh = mesh.clone();
    mesh.atlas_size = size;
    let surface = SurfaceTexels::bake(&mesh);
    let rays = 7;
    let (mut colors, mut views) = (vec![[0u8; 3]; rays * surface.len()], vec![u16::MAX; rays * surface.len()]);
    for t in 0..surface.len() {
        let used = if t % 97 == 0 { 0 } else { 3 + t % 5 };
        for k in 0..used {
            let view = (t / 7 + k * 4) % 9;
            views[t * rays + k] = view as u16;
            let wave = |c: usize| 127.0 + 100.0 * (0.01 * t as f64 + view as f64 + c as f64).sin();
            colors[t * rays + k] = [0, 1, 2].map(|c| wave(c) as u8);
        }
    }
    let center = |v: u32| Point3::new(3.0 * f64::from(v).cos(), 3.0 * f64::from(v).sin(), f64::from(v % 3));
    let centers = (0..9).map(center).collect();
    let lumigraph = Lumigraph { centers, rays, colors, views, coded: Vec::new() };
    let appearance = Appearance::Lumigraph(lumigraph, surface);
    Model { mesh, method: Method::Lumigraph, appearance, materials: Vec::new() }
}
