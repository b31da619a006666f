//! Sub-samples of a part of the frame at a time, so that a frame of any size and supersampling fits; and what becomes
//! of them: pixels, in a target of one's own or somebody else's.

use super::GpuError;
use super::atlas::FORMAT;
use super::device::{Device, cover};
use super::surface::DEPTH;
use crate::RenderOptions;
use bytemuck::{Pod, Zeroable};

/// Sub-samples along a tile's side at most: 48 MiB of them.
const MOST_SAMPLES: usize = 2048;

/// A part of a frame, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Tile {
    pub(super) origin: [usize; 2],
    pub(super) size: [usize; 2],
}

/// `Resolve` in `resolve.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Options {
    background: [f32; 4],
    origin: [u32; 2],
    per_side: u32,
    is_srgb: u32,
}

/// Sub-samples of a tile, and the way to pixels of one format.
#[derive(Debug)]
pub(super) struct Samples {
    /// Sub-samples across and down.
    size: [u32; 2],
    color: wgpu::TextureView,
    depth: wgpu::TextureView,
    format: wgpu::TextureFormat,
    options: wgpu::Buffer,
    resolve: wgpu::RenderPipeline,
    bindings: wgpu::BindGroup,
}

/// The tiles of a frame, row by row.
pub(super) fn tiles([width, height]: [usize; 2], options: &RenderOptions) -> Vec<Tile> {
    let side = (MOST_SAMPLES / options.per_side()).max(1);
    let starts = |length: usize| (0..length).step_by(side);
    starts(height)
        .flat_map(|y| starts(width).map(move |x| [x, y]))
        .map(|origin| Tile { origin, size: [side.min(width - origin[0]), side.min(height - origin[1])] })
        .collect()
}

impl Samples {
    /// Room for the sub-samples of `tile`.
    pub(super) fn new(
        device: &Device,
        tile: &Tile,
        options: &RenderOptions,
        format: wgpu::TextureFormat,
    ) -> Result<Self, GpuError> {
        let size = tile.size.map(|side| (side * options.per_side()) as u32);
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let view = |format, usage| {
            let texture = device.texture(size, [1, 1], format, usage);
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        let color = view(FORMAT, usage | wgpu::TextureUsages::TEXTURE_BINDING);
        let resolve = device.covering(include_str!("resolve.wgsl"), "resolve", format);
        let options = device.buffer(&[0; size_of::<Options>()], wgpu::BufferUsages::UNIFORM)?;
        let texture = wgpu::BindingResource::TextureView(&color);
        let bindings = device.bind(&resolve, 0, &[texture, options.as_entire_binding()]);
        Ok(Self { size, depth: view(DEPTH, usage), color, format, options, resolve, bindings })
    }

    /// Whether these are the sub-samples of such a tile.
    pub(super) fn fit(&self, tile: &Tile, options: &RenderOptions, format: wgpu::TextureFormat) -> bool {
        self.size == tile.size.map(|side| (side * options.per_side()) as u32) && self.format == format
    }

    /// A pass that fills the sub-samples.
    pub(super) fn fill<'e>(&self, encoder: &'e mut wgpu::CommandEncoder) -> wgpu::RenderPass<'e> {
        let store = wgpu::StoreOp::Store;
        let color = wgpu::RenderPassColorAttachment {
            view: &self.color,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store },
        };
        let depth = wgpu::RenderPassDepthStencilAttachment {
            view: &self.depth,
            depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Discard }),
            stencil_ops: None,
        };
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(color)],
            depth_stencil_attachment: Some(depth),
            ..Default::default()
        })
    }

    /// Averages them into the pixels of a target from `origin` on. The rest of the target stays as it is, or is cleared
    /// where the tile is the first.
    pub(super) fn resolve(
        &self,
        device: &Device,
        encoder: &mut wgpu::CommandEncoder,
        target: &wgpu::TextureView,
        origin: [usize; 2],
        options: &RenderOptions,
    ) {
        let origin = origin.map(|o| o as u32);
        let [r, g, b] = options.background.unwrap_or_default().map(f32::from);
        let per_side = options.per_side() as u32;
        let background = [r, g, b, if options.background.is_some() { 1.0 } else { 0.0 }];
        let is_srgb = u32::from(self.format.is_srgb());
        let numbers = Options { background, origin, per_side, is_srgb };
        device.queue().write_buffer(&self.options, 0, bytemuck::bytes_of(&numbers));
        let size = self.size.map(|side| side / per_side);
        let load = if origin == [0, 0] { wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT) } else { wgpu::LoadOp::Load };
        cover(encoder, &self.resolve, &self.bindings, (target, load), (origin, size));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_a_frame_once() {
        for (size, supersample) in [([800, 600], 2), ([5000, 1], 3), ([1, 1], 16), ([3840, 2160], 1), ([0, 7], 2)] {
            let options = RenderOptions { supersample, background: None };
            let tiles = tiles(size, &options);
            let area: usize = tiles.iter().map(|tile| tile.size[0] * tile.size[1]).sum();
            assert_eq!(area, size[0] * size[1]);
            let fits = |t: &Tile| t.size.iter().all(|side| (1..=MOST_SAMPLES).contains(&(side * supersample)));
            assert!(tiles.iter().all(fits), "{tiles:?}");
        }
    }
}
