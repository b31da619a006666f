//! Materials on a mesh: what a surface point sends to the eye under the scene's light.
//!
//! [`Coats::new`] lays [`Coat`]s over charts, once per mesh; [`Lighting`] may change with every frame. Both
//! renderers ask the one function [`Lit::colour`], with a face, texture coordinates and a footprint: position,
//! normal and tangent follow from these.
//!
//! ```text
//! colour = 255 · sRGB(2^stops · Σ_lights E · c · Σ_texels w · decode(sample(texel, l, v)) / exposure)
//! ```
//!
//! - `E` irradiance perpendicular to the light; `c` is the cosine where the samples do not include it, 1 where they do.
//!   White matt paint facing a light of `E = π` is white at 0 stops.
//! - `l`, `v` are the directions to light and eye in the [`frame`](mod@frame) of the point. A light below the surface gives nothing;
//!   an eye below it, which only the interpolated normal of a coarse mesh can do, looks along it.
//! - Directions lower than the lowest measured are raised to it, `z`, for no codec knows what lies beyond. If the cosine
//!   is in the samples it goes on falling: they are scaled by `l_z / z`, so that nothing breaks off where the
//!   light sets.
//! - `texels, w`: [`texture::tile`]; one repetition measures [`Coat::tile_size`] world units, whatever the chart's density.
//!   Beyond three texels a footprint looks up averages over ever larger cells in their place (`averages.rs`).
//! - Both sides of a face carry the material, its outside turned to the eye.
//!
//! State: surfaces neither shadow nor light each other; photographed charts stay as photographed, for their light
//! cannot be taken out; distances within the tile are those of the flat atlas, so strongly curved charts stretch it.

mod averages;
pub mod environment;
pub mod frame;
mod light;
#[cfg(feature = "gpu")]
pub(crate) mod numbers;
mod tile;

pub use light::{Light, Lighting};
pub use tile::{SynthesizedTile, Tile};

use crate::face::{Corners, corners};
use averages::Averages;
use capture::Image;
use capture::btf::Encoding;
use frame::{Frames, TangentFrame};
use geometry::TexturedMesh;
use nalgebra::{Point2, Point3, Vector3};
use std::collections::BTreeMap;
use texture::btf::{DirectionSet, Material, Sampler};
use texture::tile::{is_mirrored, texel_sizes, texels_under};

/// Texels asked for at once.
const TOGETHER: usize = 4;

/// A material and where it lies.
#[derive(Clone, Copy)]
pub struct Coat<'a> {
    /// Charts it covers, as `TexturedMesh::face_charts` numbers them.
    pub charts: &'a [u32],
    /// World units across one repetition of the tile; its texels are square.
    pub tile_size: f64,
    /// What answers for the tile's texels.
    pub sampler: &'a dyn Sampler,
    /// How samples stand for radiance.
    pub encoding: Encoding,
    /// What radiance was multiplied by before it was encoded.
    pub exposure: f32,
    /// Whether the cosine of the light is in the samples.
    pub includes_cosine: bool,
}

/// Materials laid over a mesh.
#[derive(Debug)]
pub struct Coats<'a> {
    mesh: &'a TexturedMesh,
    coats: Vec<Prepared<'a>>,
    /// Per face; `None` where the mesh shows its photographed texture.
    faces: Vec<Option<CoatedFace>>,
    frames: Frames,
}

/// Materials under light.
#[derive(Clone, Copy, Debug)]
pub struct Lit<'a> {
    /// Which materials lie where.
    pub coats: &'a Coats<'a>,
    /// What shines on them.
    pub lighting: &'a Lighting,
}

/// What of a tile lies under a spot.
struct Taps {
    /// 0: texels; else cells of this level of the averages.
    level: usize,
    /// Texel or cell (row · columns + column), and weight; weights are > 0 and sum to 1.
    entries: Vec<(usize, f32)>,
}

/// Where a sub-sample meets the mesh.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot {
    pub(crate) face: usize,
    /// Texture coordinates.
    pub(crate) uv: Point2<f64>,
    /// Side of the footprint, in units of the geometric mean of the atlas' sides.
    pub(crate) side: f64,
}

#[derive(Clone, Copy, Debug)]
struct CoatedFace {
    coat: usize,
    /// Texels of the tile per texel of the mesh's atlas.
    scale: f64,
    is_mirrored: bool,
}

struct Prepared<'a> {
    coat: Coat<'a>,
    averages: Averages<'a>,
    /// z of the lowest light measured, above 0.
    lowest_light: f64,
    /// z of the lowest view measured.
    lowest_view: f64,
}

impl<'a> Coat<'a> {
    /// A coat of a stored material, answered for by a tile of it.
    pub fn of(material: &Material, tile: &'a Tile<'a>, charts: &'a [u32], tile_size: f64) -> Self {
        Self {
            charts,
            tile_size,
            sampler: tile.sampler(),
            encoding: material.encoding,
            exposure: material.exposure,
            includes_cosine: material.includes_cosine,
        }
    }

    /// Linear radiance of one flat tile in the plane z = 0 with its middle at the origin, x along columns and y up
    /// the rows, seen from the direction `view` throughout; lamps shine as they do at the middle.
    pub fn picture(&self, lights: &[Light], view: &Vector3<f64>) -> Image<[f32; 3]> {
        let prepared = Prepared::new(self);
        let frame = TangentFrame { tangent: Vector3::x(), bitangent: Vector3::y(), normal: Vector3::z() };
        let view = raised(&frame.above(view), prepared.lowest_view).cast();
        let mut out = Image::filled(self.sampler.frame().width, self.sampler.frame().height, [0.0; 3]);
        for (toward, irradiance) in lights.iter().filter_map(|light| light.at(&Point3::origin())) {
            let toward = frame.local(&toward);
            let Some(share) = prepared.share(&toward) else { continue };
            let samples = self.sampler.picture(&raised(&toward, prepared.lowest_light).cast(), &view);
            for (sum, sample) in out.pixels_mut().iter_mut().zip(samples.as_chunks::<3>().0) {
                (0..3).for_each(|c| sum[c] += irradiance[c] * share * self.encoding.decode(sample[c]) / self.exposure);
            }
        }
        out
    }
}

impl<'a> Coats<'a> {
    /// Lays `coats` over `mesh`; of two on one chart the last shows. A chart without area and a tile without size show
    /// one place of the tile, a coat whose exposure is not positive is black.
    pub fn new(mesh: &'a TexturedMesh, coats: &[Coat<'a>]) -> Self {
        let sizes = texel_sizes(mesh);
        let entries = coats.iter().enumerate().flat_map(|(k, coat)| coat.charts.iter().map(move |&chart| (chart, k)));
        let coat_of: BTreeMap<u32, usize> = entries.collect();
        let coated = |face: usize| {
            let index = *coat_of.get(mesh.face_charts.get(face)?)?;
            let width = coats[index].sampler.frame().width;
            let scale = sizes[face] * width as f64 / coats[index].tile_size;
            Some(CoatedFace { coat: index, scale, is_mirrored: is_mirrored(mesh, face) })
        };
        let faces = (0..mesh.mesh.faces.len()).map(coated).collect();
        Self { mesh, coats: coats.iter().map(Prepared::new).collect(), faces, frames: Frames::new(mesh) }
    }

    /// Whether a face carries a material.
    pub(crate) fn cover(&self, face: usize) -> bool {
        self.faces.get(face).is_some_and(Option::is_some)
    }
}

impl Lit<'_> {
    /// What the eye sees of a spot with a material: encoded, 0..=255, clamped. Black where the mesh is broken.
    pub(crate) fn colour(&self, spot: &Spot, eye: &Point3<f64>) -> [f32; 3] {
        self.radiance(spot, eye).map_or([0.0; 3], |radiance| radiance.map(|r| self.lighting.displayed(r)))
    }

    fn radiance(&self, spot: &Spot, eye: &Point3<f64>) -> Option<[f32; 3]> {
        let face = self.coats.faces.get(spot.face).copied().flatten()?;
        let corners = corners(self.coats.mesh, spot.face)?;
        let weights = barycentric(&corners, &spot.uv);
        let position = mean(&corners.positions.map(|p| p.coords), &weights);
        let to_eye = eye.coords - position;
        let is_back = outward(&corners).dot(&to_eye) < 0.0;
        let frame = self.coats.frames.at(self.coats.mesh, spot.face, &weights)?;
        let frame = if is_back { frame.turned_over() } else { frame };
        let prepared = &self.coats.coats[face.coat];
        let taps = prepared.taps(&face, is_back, spot, self.coats.mesh.atlas_size);
        let view = raised(&frame.above(&to_eye), prepared.lowest_view).cast();
        let mut sum = [0.0; 3];
        for light in &self.lighting.lights {
            let Some((toward, irradiance)) = light.at(&position.into()) else { continue };
            let toward = frame.local(&toward);
            if let Some(share) = prepared.share(&toward) {
                let toward = raised(&toward, prepared.lowest_light).cast();
                let radiance = prepared.radiance(&taps, &toward, &view);
                (0..3).for_each(|c| sum[c] += irradiance[c] * share * radiance[c]);
            }
        }
        Some(sum)
    }
}

impl<'a> Prepared<'a> {
    fn new(coat: &Coat<'a>) -> Self {
        let frame = coat.sampler.frame();
        let lowest = |set: &DirectionSet| set.vectors().iter().map(|d| d.z).fold(1.0, f64::min).max(1e-3);
        let (lowest_light, lowest_view) = (lowest(&frame.lights), lowest(&frame.views));
        Self { coat: *coat, averages: Averages::new(coat.sampler, coat.encoding), lowest_light, lowest_view }
    }

    /// What lies under a spot.
    fn taps(&self, face: &CoatedFace, is_back: bool, spot: &Spot, atlas: [usize; 2]) -> Taps {
        let [width, height] = atlas.map(|side| side as f64);
        let down = if face.is_mirrored == is_back { face.scale } else { -face.scale };
        let (column, row) = (face.scale * width * spot.uv.x, down * height * spot.uv.y);
        let side = face.scale * (width * height).sqrt() * spot.side;
        let level = self.averages.level(side);
        let (texels, cells) = (self.averages.size(0), self.averages.size(level));
        let [across, down] = [0, 1].map(|axis| cells[axis] as f64 / texels[axis] as f64);
        let mut entries = Vec::with_capacity(4);
        texels_under(column * across, row * down, side / (1u64 << level) as f64, cells, |texel, weight| {
            if weight > 0.0 {
                entries.push((texel, weight));
            }
        });
        Taps { level, entries }
    }

    /// What radiance is multiplied by under a light; `None` below the surface.
    fn share(&self, toward: &Vector3<f64>) -> Option<f32> {
        let share = if self.coat.includes_cosine { (toward.z / self.lowest_light).min(1.0) } else { toward.z };
        (share > 0.0 && self.coat.exposure > 0.0).then_some(share as f32)
    }

    /// The mean of what lies under a spot, in linear light.
    fn radiance(&self, taps: &Taps, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3] {
        let mut sum = [0.0; 3];
        let mut add = |sample: &[f32; 3], weight: f32| {
            (0..3).for_each(|c| sum[c] += weight * self.coat.encoding.decode(sample[c]));
        };
        if taps.level > 0 {
            let samples = self.averages.values(taps.level, taps.entries.iter().map(|entry| entry.0), light, view);
            samples.zip(&taps.entries).for_each(|(sample, &(_, weight))| add(&sample, weight));
        } else {
            let (mut texels, mut samples) = ([0; TOGETHER], [[0.0; 3]; TOGETHER]);
            for entries in taps.entries.chunks(TOGETHER) {
                texels.iter_mut().zip(entries).for_each(|(to, entry)| *to = entry.0);
                self.coat.sampler.values(&texels[..entries.len()], light, view, &mut samples);
                samples.iter().zip(entries).for_each(|(sample, &(_, weight))| add(sample, weight));
            }
        }
        sum.map(|s| s / self.coat.exposure)
    }
}

/// A unit vector brought up to a height, its azimuth kept.
fn raised(v: &Vector3<f64>, lowest: f64) -> Vector3<f64> {
    if v.z >= lowest {
        return *v;
    }
    let across = Vector3::new(v.x, v.y, 0.0).try_normalize(0.0).unwrap_or_default();
    Vector3::new(0.0, 0.0, lowest) + across * (1.0 - lowest * lowest).max(0.0).sqrt()
}

/// Weights of a face's corners at texture coordinates; the middle of a face without area in the atlas.
fn barycentric(corners: &Corners, uv: &Point2<f64>) -> [f64; 3] {
    let [a, b, c] = corners.uvs;
    let area = (b - a).perp(&(c - a));
    let (second, third) = ((uv - a).perp(&(c - a)) / area, (b - a).perp(&(uv - a)) / area);
    let weights = [1.0 - second - third, second, third];
    if weights.iter().all(|w| w.is_finite()) { weights } else { [1.0 / 3.0; 3] }
}

fn mean(corners: &[Vector3<f64>; 3], weights: &[f64; 3]) -> Vector3<f64> {
    corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2]
}

fn outward(corners: &Corners) -> Vector3<f64> {
    let [a, b, c] = corners.positions;
    (b - a).cross(&(c - a))
}

impl std::fmt::Debug for Prepared<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Prepared").field("charts", &self.coat.charts).field("tile_size", &self.coat.tile_size).finish()
    }
}

impl std::fmt::Debug for Coat<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Coat").field("charts", &self.charts).field("tile_size", &self.tile_size).finish()
    }
}

#[cfg(test)]
mod tests;
