//! The texture of the object for one eye, with its mip-maps: 16-bit floats, levels of 0..=255, unclamped.
//!
//! Sides are padded to powers of two so that each level of the hardware is at least as large as that of
//! [`crate::filter`], which rounds up; what lies beyond is neither written nor read. 16 bits are off by 1/16
//! of a level at most.

use super::GpuError;
use super::device::{Device, cover};
use crate::filter::top_level;
use capture::Image;
use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;

pub(super) const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;

/// The texture and how its levels are made.
#[derive(Debug)]
pub(super) struct Atlas {
    size: [u32; 2],
    texture: wgpu::Texture,
    levels: Vec<wgpu::TextureView>,
    halve: wgpu::RenderPipeline,
    /// Of each level but the last: what reads it.
    finer: Vec<wgpu::BindGroup>,
    /// Kept for its memory alone.
    texels: Vec<f16>,
}

impl Atlas {
    pub(super) fn new(device: &Device, [width, height]: [usize; 2]) -> Result<Self, GpuError> {
        let limit = u64::from(device.limits().max_texture_dimension_2d);
        let padded = [width, height].map(|side| side.max(1).next_power_of_two() as u64);
        device.check("texels along a side of the atlas", padded[0].max(padded[1]), limit)?;
        let (size, padded) = ([width.max(1) as u32, height.max(1) as u32], padded.map(|side| side as u32));
        let count = top_level(width, height) as u32 + 1;
        let usage = wgpu::TextureUsages::COPY_DST
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::RENDER_ATTACHMENT;
        let texture = device.texture(padded, [1, count], FORMAT, usage);
        let level = |base_mip_level: u32| {
            let mip_level_count = Some(1);
            texture.create_view(&wgpu::TextureViewDescriptor { base_mip_level, mip_level_count, ..Default::default() })
        };
        let levels: Vec<wgpu::TextureView> = (0..count).map(level).collect();
        let halve = device.covering(include_str!("halve.wgsl"), "halve", FORMAT);
        let reader = |(level, view): (u32, &wgpu::TextureView)| {
            let [x, y] = at_level(size, level);
            let used = device.buffer(bytemuck::cast_slice(&[x, y, 0, 0]), wgpu::BufferUsages::UNIFORM)?;
            let texture = wgpu::BindingResource::TextureView(view);
            Ok(device.bind(&halve, 0, &[texture, used.as_entire_binding()]))
        };
        let finer = (0..count - 1).zip(&levels).map(reader).collect::<Result<_, GpuError>>()?;
        Ok(Self { size, texture, levels, halve, finer, texels: Vec::new() })
    }

    /// Texels across and down.
    pub(super) fn size(&self) -> [u32; 2] {
        self.size
    }

    pub(super) fn top_level(&self) -> u32 {
        self.levels.len() as u32 - 1
    }

    /// Level 0, to draw to.
    pub(super) fn finest(&self) -> &wgpu::TextureView {
        &self.levels[0]
    }

    /// All levels, to read from.
    pub(super) fn all(&self) -> wgpu::TextureView {
        self.texture.create_view(&wgpu::TextureViewDescriptor::default())
    }

    /// Fills level 0 with an atlas of this size, of texels that are `scale` of a level each; one without texels stays black.
    pub(super) fn upload<T: Copy + Into<f32> + Sync>(&mut self, device: &Device, atlas: &Image<[T; 3]>, scale: f32) {
        if atlas.pixels().is_empty() {
            return;
        }
        self.texels.resize(4 * atlas.pixels().len(), f16::ONE);
        let rows = self.texels.par_chunks_mut(4 * atlas.width()).zip(atlas.pixels().par_chunks(atlas.width()));
        rows.for_each_init(Vec::new, |padded: &mut Vec<f32>, (out, row)| {
            padded.clear();
            padded.extend(row.iter().flat_map(|texel| {
                let [r, g, b] = texel.map(|v| scale * v.into());
                [r, g, b, 1.0]
            }));
            out.convert_from_f32_slice(padded);
        });
        device.write(&self.texture, 0, self.size, bytemuck::cast_slice(self.texels.as_slice().reinterpret_cast()));
    }

    /// Makes the mip-maps out of level 0.
    pub(super) fn reduce(&self, encoder: &mut wgpu::CommandEncoder) {
        for (level, bindings) in (1..).zip(&self.finer) {
            let target = (&self.levels[level as usize], wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT));
            cover(encoder, &self.halve, bindings, target, ([0, 0], at_level(self.size, level)));
        }
    }
}

/// Bytes of an atlas of this size.
pub(super) fn bytes(size: [usize; 2]) -> u64 {
    let [width, height] = size.map(|side| side.max(1).next_power_of_two() as u64);
    8 * width * height * 4 / 3
}

/// Texels of a level, rounded up.
pub(super) fn at_level(size: [u32; 2], level: u32) -> [u32; 2] {
    size.map(|side| side.div_ceil(1 << level).max(1))
}
