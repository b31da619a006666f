//! A material in place of photographed texture: on which charts, how large, and how it looks from above.

use crate::TextureError;
use crate::btf::container::Fault;
use crate::btf::{Answer, Material};
use crate::tile::{is_mirrored, texel_sizes, texels_under};
use capture::Image;
use capture::btf::Encoding;
use geometry::TexturedMesh;
use geometry::atlas::rasterize;
use nalgebra::Vector3;
use std::collections::BTreeSet;
use std::f32::consts::PI;

/// A material laid over charts of a mesh.
#[derive(Clone, Debug)]
pub struct MaterialLayer {
    /// The charts, ascending, each once; numbered as in `TexturedMesh::face_charts`.
    pub charts: Vec<u32>,
    /// World units across one repetition of the tile; its texels are square.
    pub tile_size: f64,
    /// As decoded from `coded`.
    pub material: Material,
    /// A `.btfz` file.
    pub coded: Vec<u8>,
}

impl MaterialLayer {
    /// A layer of a `.btfz` file's content; `charts` in any order.
    ///
    /// # Errors
    /// Where the content is broken, the tile has no size, or no chart is named.
    pub fn new(mut charts: Vec<u32>, tile_size: f64, coded: Vec<u8>) -> Result<Self, Fault> {
        charts.sort_unstable();
        charts.dedup();
        if charts.is_empty() {
            return Err(Fault("it lies on no chart".to_owned()));
        }
        if !(tile_size > 0.0 && tile_size.is_finite()) {
            return Err(Fault(format!("its tile measures {tile_size} world units")));
        }
        let material = Material::from_bytes(&coded)?;
        Ok(Self { charts, tile_size, material, coded })
    }
}

/// Charts as a model's file numbers them: the parts of a mesh that share no vertex, in the order of their first
/// faces. One per face.
pub fn charts_of_file(faces: &[[u32; 3]], vertices: usize) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..vertices as u32).collect();
    fn find(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    for &[a, b, c] in faces {
        for other in [b, c] {
            let (x, y) = (find(&mut parent, a), find(&mut parent, other));
            parent[x.max(y) as usize] = x.min(y);
        }
    }
    let mut number = vec![u32::MAX; vertices];
    let mut next = 0;
    let mut chart = |f: &[u32; 3]| {
        let root = find(&mut parent, f[0]) as usize;
        if number[root] == u32::MAX {
            number[root] = next;
            next += 1;
        }
        number[root]
    };
    faces.iter().map(&mut chart).collect()
}

/// Refuses layers that name a chart which is not there, or one that another names too.
pub(crate) fn check(layers: &[MaterialLayer], face_charts: &[u32]) -> Result<(), String> {
    let charts: BTreeSet<u32> = face_charts.iter().copied().collect();
    let mut free = charts.clone();
    for chart in layers.iter().flat_map(|layer| &layer.charts) {
        if !free.remove(chart) {
            return Err(match charts.contains(chart) {
                true => format!("two materials lie on chart {chart}"),
                false => format!("a material lies on chart {chart}; the model has {} charts", charts.len()),
            });
        }
    }
    Ok(())
}

/// Paints what plain viewers show: charts with a material as they look from above, lit from there such that a
/// white matt surface would be white. `atlas` is in levels of 0..=255.
pub(crate) fn paint(atlas: &mut Image<[f32; 3]>, mesh: &TexturedMesh, layers: &[MaterialLayer]) {
    if layers.is_empty() {
        return;
    }
    let (sizes, texels) = (texel_sizes(mesh), rasterize(mesh).texels);
    for layer in layers {
        let look = seen_from_above(&layer.material);
        let per_texel = look.width() as f64 / layer.tile_size;
        let is_covered = |face: usize| layer.charts.binary_search(&mesh.face_charts[face]).is_ok();
        for texel in texels.iter().filter(|t| is_covered(t.face as usize)) {
            let scale = sizes[texel.face as usize] * per_texel;
            let down = if is_mirrored(mesh, texel.face as usize) { -scale } else { scale };
            let (column, row) = (scale * (f64::from(texel.x) + 0.5), down * (f64::from(texel.y) + 0.5));
            let mut mean = [0.0f32; 3];
            texels_under(column, row, scale, [look.width(), look.height()], |t, weight| {
                mean.iter_mut().zip(look.pixels()[t]).for_each(|(m, v)| *m += weight * v);
            });
            let colour = mean.map(|radiance| 255.0 * Encoding::Srgb.encode(PI * radiance));
            atlas.set(texel.x as usize, texel.y as usize, colour);
        }
    }
}

/// Radiance of the tile seen and lit by unit irradiance from straight above.
fn seen_from_above(material: &Material) -> Image<[f32; 3]> {
    let (frame, up) = (material.codec.frame(), Vector3::z());
    let samples = match material.codec.answer() {
        Answer::Sampler(sampler) => sampler.picture(&up, &up),
        Answer::Synthesizer(synthesizer) => synthesizer.picture([frame.width, frame.height], 0, &up, &up),
    };
    let radiance = |sample: f32| material.encoding.decode(sample) / material.exposure;
    let pixels: Vec<[f32; 3]> = samples.as_chunks::<3>().0.iter().map(|s| s.map(radiance)).collect();
    Image::from_pixels(frame.width, frame.height, pixels).unwrap_or_else(|| Image::filled(1, 1, [0.0; 3]))
}

/// Says that layers do not fit a mesh.
pub(crate) fn refused(fault: String) -> TextureError {
    TextureError::Degenerate { fault, remedy: "give each chart of the model at most one material".to_owned() }
}
