//! Static texture, VDTM and DynTex: layers in a texture array, blended into the atlas.
//!
//! Weights belong to texels (through their facets) and the filter comes after the blend, so the blend is a pass of
//! its own over the atlas: a texel is blended once, however many sub-samples look it up. Bytes: 4 a texel and layer.

use super::GpuError;
use super::atlas::{Atlas, FORMAT};
use super::device::{Device, cover};
use bytemuck::cast_slice;
use nalgebra::Point3;
use rayon::prelude::*;
use texture::{Layer, Layers};

/// The layers on the adapter.
#[derive(Debug)]
pub(super) struct LayerBlend<'a> {
    layers: &'a Layers,
    /// Layers, and facets of texels.
    textures: [wgpu::TextureView; 2],
    /// Texels of each facet.
    areas: Vec<u64>,
    /// Per facet: what `weights` in `layers.wgsl` says.
    entries: Vec<[f32; 2]>,
    weights: wgpu::Buffer,
    pipeline: wgpu::RenderPipeline,
    bindings: wgpu::BindGroup,
}

impl<'a> LayerBlend<'a> {
    pub(super) fn new(device: &Device, layers: &'a Layers) -> Result<Self, GpuError> {
        let facets = &layers.facet_of_texel;
        let size = [facets.width() as u32, facets.height() as u32];
        let count = layers.layers.len().max(1);
        device.check("layers", count as u64, u64::from(device.limits().max_texture_array_layers))?;
        let usage = wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::TEXTURE_BINDING;
        let array = device.texture(size, [count as u32, 1], wgpu::TextureFormat::Rgba8Unorm, usage);
        for (k, layer) in (0..).zip(&layers.layers) {
            let texels: Vec<[u8; 4]> = layer.texels.pixels().iter().map(|&[r, g, b]| [r, g, b, 255]).collect();
            device.write(&array, k, size, texels.as_flattened());
        }
        let map = device.texture(size, [1, 1], wgpu::TextureFormat::R16Uint, usage);
        device.write(&map, 0, size, cast_slice(facets.pixels()));
        let pipeline = device.covering(include_str!("layers.wgsl"), "blend", FORMAT);
        let dimension = Some(wgpu::TextureViewDimension::D2Array);
        let array = array.create_view(&wgpu::TextureViewDescriptor { dimension, ..Default::default() });
        let map = map.create_view(&wgpu::TextureViewDescriptor::default());
        let mut areas = vec![0; layers.facets.len()];
        for facet in facets.pixels() {
            areas.get_mut(usize::from(*facet)).into_iter().for_each(|area| *area += 1);
        }
        Self::bound(device, layers, ([array, map], areas), pipeline)
    }

    /// The same layers for another eye.
    pub(super) fn another(&self, device: &Device) -> Result<Self, GpuError> {
        Self::bound(device, self.layers, (self.textures.clone(), self.areas.clone()), self.pipeline.clone())
    }

    fn bound(
        device: &Device,
        layers: &'a Layers,
        (textures, areas): ([wgpu::TextureView; 2], Vec<u64>),
        pipeline: wgpu::RenderPipeline,
    ) -> Result<Self, GpuError> {
        let row = layers.layers.len() as u32 + 1;
        let weights = device.buffer(&vec![0; 8 * row as usize * layers.facets.len()], wgpu::BufferUsages::STORAGE)?;
        let row = device.buffer(cast_slice(&[row, 0, 0, 0]), wgpu::BufferUsages::UNIFORM)?;
        let [array, map] = textures.each_ref().map(wgpu::BindingResource::TextureView);
        let bindings = device.bind(&pipeline, 0, &[array, map, weights.as_entire_binding(), row.as_entire_binding()]);
        Ok(Self { layers, textures, areas, entries: Vec::new(), weights, pipeline, bindings })
    }

    /// Takes the weights for an eye to the adapter; false where they are what they were.
    pub(super) fn weigh(&mut self, device: &Device, eye: &Point3<f64>) -> bool {
        let row = self.layers.layers.len() + 1;
        let mut entries = vec![[0.0f32; 2]; row * self.layers.facets.len()];
        let rows = entries.par_chunks_mut(row).zip(&self.layers.facets);
        rows.for_each(|(row, facet)| write(row, &self.layers.layers, &facet.at(eye)));
        if entries == self.entries {
            return false;
        }
        self.entries = entries;
        device.queue().write_buffer(&self.weights, 0, cast_slice(self.entries.as_flattened()));
        true
    }

    /// Takes nothing on the adapter for what it is.
    pub(super) fn forget(&mut self) {
        self.entries.clear();
    }

    /// Bytes that a blend with the present weights reads.
    pub(super) fn read(&self) -> u64 {
        let rows = self.entries.chunks(self.layers.layers.len() + 1).zip(&self.areas);
        rows.map(|(row, area)| 4 * row[0][1] as u64 * area).sum()
    }

    /// Blends them into level 0 of the atlas.
    pub(super) fn blend(&self, encoder: &mut wgpu::CommandEncoder, atlas: &Atlas) {
        let target = (atlas.finest(), wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT));
        cover(encoder, &self.pipeline, &self.bindings, target, ([0, 0], atlas.size()));
    }
}

#[cfg(test)]
impl LayerBlend<'_> {
    pub(super) fn break_weights(&self) {
        self.weights.destroy();
    }
}

/// Bytes that layers take: four a texel and layer, two a texel for its facet.
pub(super) fn bytes(layers: &Layers) -> u64 {
    layers.facet_of_texel.pixels().len() as u64 * (4 * layers.layers.len().max(1) as u64 + 2)
}

/// What is not zero: a texel's value is bias + Σ gain · texel.
fn write(row: &mut [[f32; 2]], layers: &[Layer], weights: &[f32]) {
    let (mut bias, mut terms) = (0.0, 0);
    for (k, (layer, &weight)) in layers.iter().zip(weights).enumerate().filter(|(_, (_, weight))| **weight != 0.0) {
        terms += 1;
        bias += weight * layer.offset;
        // The texture holds shares of 255.
        row[terms] = [255.0 * weight * layer.scale, k as f32];
    }
    row[0] = [bias, terms as f32];
}
