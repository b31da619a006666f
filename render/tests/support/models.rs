//! Models in closed form: no fit, no noise.

#![allow(dead_code, reason = "every test binary uses some of it")]
#![allow(clippy::unwrap_used, reason = "a helper that fails fails its test")]

use capture::Image;
use geometry::{Mesh, TexturedMesh};
use nalgebra::{Point2, Point3, Vector3};
use std::f64::consts::TAU;
use texture::appearance::Lumigraph;
use texture::directions::{DirectionComplex, Layout};
use texture::{Appearance, FacetWeights, Layer, Layers, Method, Model, SurfaceTexels};

/// Free texels around each chart.
const GAP: f64 = 3.0;

/// A ball with bumps, one chart for each side of the cube it is blown up from, `quads` along a side; radius 1 or so.
pub(crate) fn bumpy_ball(quads: usize, atlas_size: [usize; 2]) -> TexturedMesh {
    let (mut mesh, mut uvs, mut face_charts) = (Mesh::default(), Vec::new(), Vec::new());
    let cell = [atlas_size[0] as f64 / 3.0, atlas_size[1] as f64 / 2.0];
    for chart in 0..6usize {
        let axis = |k: usize| Vector3::from_fn(|i, _| if i == k % 3 { 1.0 } else { 0.0 });
        let (n, a, b) = (axis(chart), axis(chart + 1), axis(chart + 2));
        let (normal, across, down) = if chart < 3 { (n, a, b) } else { (-n, b, a) };
        let first = mesh.positions.len() as u32;
        for (j, i) in (0..=quads).flat_map(|j| (0..=quads).map(move |i| (j, i))) {
            let [s, t] = [i, j].map(|k| k as f64 / quads as f64);
            let p = (normal + across * (2.0 * s - 1.0) + down * (2.0 * t - 1.0)).normalize();
            let bump = 1.0 + 0.08 * (5.0 * p.x).sin() * (4.0 * p.y).cos() + 0.05 * (7.0 * p.z).sin();
            mesh.positions.push((p * bump).into());
            let texel = |k: usize, s: f64, side: usize| k as f64 * cell[side] + GAP + s * (cell[side] - 2.0 * GAP);
            let [u, v] = [texel(chart % 3, s, 0), texel(chart / 3, t, 1)];
            uvs.push(Point2::new(u / atlas_size[0] as f64, v / atlas_size[1] as f64));
        }
        for (j, i) in (0..quads as u32).flat_map(|j| (0..quads as u32).map(move |i| (j, i))) {
            let row = quads as u32 + 1;
            let at = |dj: u32, di: u32| first + (j + dj) * row + i + di;
            mesh.faces.extend([[at(0, 0), at(0, 1), at(1, 1)], [at(0, 0), at(1, 1), at(1, 0)]]);
            face_charts.extend([chart as u32; 2]);
        }
    }
    TexturedMesh { mesh, uvs, face_charts, atlas_size }
}

/// Directions all around, evenly.
fn sites(count: usize) -> Vec<Vector3<f64>> {
    let golden = TAU / (1.0 + 5f64.sqrt()) * 2.0;
    let site = |k: usize| {
        let z = 1.0 - (2.0 * k as f64 + 1.0) / count as f64;
        let (sin, cos) = (golden * k as f64).sin_cos();
        Vector3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
    };
    (0..count).map(site).collect()
}

/// Facets of about 32² texels, and weights that wave over `views` directions; of facet f the rank is `rank(f)`.
fn layers(mesh: &TexturedMesh, layers: Vec<Layer>, views: usize, rank: impl Fn(usize) -> usize) -> Layers {
    let [width, height] = mesh.atlas_size;
    let across = width.div_ceil(32);
    let facet = |i: usize| (i / width / 32 * across + i % width / 32) as u16;
    let map = Image::from_pixels(width, height, (0..width * height).map(facet).collect()).unwrap();
    let sites = sites(views);
    let facets = (0..across * height.div_ceil(32)).map(|f| {
        let rank = rank(f).min(layers.len());
        let weight = |view: usize, k: usize| match k {
            0 => 1.0,
            _ => ((k as f64 * sites[view].x + sites[view].y + 0.1 * f as f64) * 1.3).sin() as f32,
        };
        let table = (0..views).flat_map(|view| (0..rank).map(move |k| weight(view, k))).collect();
        let center = Point3::from(sites[f % views] * 0.9);
        FacetWeights { center, complex: DirectionComplex::build(&sites, Layout::General), rank, table }
    });
    let facets = facets.collect();
    Layers { layers, facet_of_texel: map, facets }
}

/// A mean and layers about 128 that get weaker, each a pattern of its own.
pub(crate) fn dyntex(mesh: TexturedMesh, count: usize, views: usize, rank: impl Fn(usize) -> usize) -> Model {
    let layer = |k: usize| {
        let scale = if k == 0 { 1.0 } else { 0.4 / k as f32 };
        let offset = if k == 0 { 0.0 } else { -128.0 * scale };
        Layer { texels: pattern(mesh.atlas_size, k as f64), scale, offset, coded: Vec::new() }
    };
    let layers = layers(&mesh, (0..count).map(layer).collect(), views, rank);
    Model { mesh, method: Method::DynTex, appearance: Appearance::Layers(layers), materials: Vec::new() }
}

/// As many photographs as layers, three of them shown at a time.
pub(crate) fn vdtm(mesh: TexturedMesh, count: usize) -> Model {
    let layer = |k: usize| {
        let texels = pattern(mesh.atlas_size, k as f64);
        Layer { texels, scale: 1.0, offset: 0.0, coded: Vec::new() }
    };
    let mut layers = layers(&mesh, (0..count).map(layer).collect(), count, |_| count);
    for facet in &mut layers.facets {
        facet.table = (0..count * count).map(|i| if i / count == i % count { 1.0 } else { 0.0 }).collect();
    }
    Model { mesh, method: Method::Vdtm, appearance: Appearance::Layers(layers), materials: Vec::new() }
}

/// One layer.
pub(crate) fn still(mesh: TexturedMesh) -> Model {
    Model { method: Method::Static, ..dyntex(mesh, 1, 1, |_| 1) }
}

/// Rays of every texel from cameras all around, some of them missing.
pub(crate) fn lumigraph(mesh: TexturedMesh, rays: usize) -> Model {
    let surface = SurfaceTexels::bake(&mesh);
    let centers: Vec<Point3<f64>> = sites(40).iter().map(|d| Point3::from(d * 4.0)).collect();
    let ray = |i: usize| {
        let (t, k) = (i / rays, i % rays);
        if t % 97 == 0 || (t + k) % 11 == 0 { u16::MAX } else { ((t * 7 + k * 3) % 40) as u16 }
    };
    let shade = |i: usize| {
        let (t, view) = (i / rays, usize::from(ray(i)) % 40);
        let wave = |c: f64| 128.0 + 80.0 * (surface.index[t] as f64 * 0.01 + c).sin() + 40.0 * (view as f64 + c).cos();
        [0.0, 1.0, 2.0].map(|c| wave(c) as u8)
    };
    let all = surface.len() * rays;
    let (colors, views) = ((0..all).map(shade).collect(), (0..all).map(ray).collect());
    let appearance = Appearance::Lumigraph(Lumigraph { centers, rays, colors, views, coded: Vec::new() }, surface);
    Model { mesh, method: Method::Lumigraph, appearance, materials: Vec::new() }
}

/// Waves and checks.
fn pattern([width, height]: [usize; 2], k: f64) -> Image<[u8; 3]> {
    let value = |i: usize, c: f64| {
        let (x, y) = ((i % width) as f64, (i / width) as f64);
        let check = if ((i % width) / 8 + (i / width) / 8).is_multiple_of(2) { 20.0 } else { -20.0 };
        128.0 + 70.0 * (x * 0.05 * (1.0 + 0.1 * k) + c).sin() * (y * 0.04 + k).cos() + check
    };
    let pixels = (0..width * height).map(|i| [0.0, 1.0, 2.0].map(|c| value(i, c) as u8)).collect();
    Image::from_pixels(width, height, pixels).unwrap()
}
