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

/// Sub-samples, and the way from them to pixels of one format.
#[derive(Debug)]
pub(super) struct Canvas {
    format: wgpu::TextureFormat,
    options: wgpu::Buffer,
    resolve: wgpu::RenderPipeline,
    samples: Option<Samples>,
}

/// Room for sub-samples.
#[derive(Debug)]
struct Samples {
    /// Across and down.
    size: [u32; 2],
    color: wgpu::TextureView,
    depth: wgpu::TextureView,
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

impl Canvas {
    pub(super) fn new(device: &Device, format: wgpu::TextureFormat) -> Result<Self, GpuError> {
        let resolve = device.covering(include_str!("resolve.wgsl"), "resolve", format);
        let options = device.buffer(&[0; size_of::<Options>()], wgpu::BufferUsages::UNIFORM)?;
        Ok(Self { format, options, resolve, samples: None })
    }

    /// Whether it makes pixels of a format.
    pub(super) fn fits(&self, format: wgpu::TextureFormat) -> bool {
        self.format == format
    }

    /// A pass over the sub-samples of a tile, for which there is room afterwards.
    pub(super) fn fill<'e>(
        &mut self,
        device: &Device,
        encoder: &'e mut wgpu::CommandEncoder,
        tile: &Tile,
        options: &RenderOptions,
    ) -> wgpu::RenderPass<'e> {
        let size = tile.size.map(|side| (side * options.per_side()) as u32);
        let samples = match self.samples.take() {
            Some(kept) if (0..2).all(|k| kept.size[k] >= size[k]) => kept,
            _ => Samples::new(device, size, &self.resolve, &self.options),
        };
        let mut pass = self.samples.insert(samples).pass(encoder);
        pass.set_viewport(0.0, 0.0, size[0] as f32, size[1] as f32, 0.0, 1.0);
        pass
    }

    /// Averages the sub-samples of a tile into the pixels of a target from `origin` on. The rest of the target stays as it
    /// is, or is cleared where that is its corner.
    pub(super) fn resolve(
        &self,
        device: &Device,
        encoder: &mut wgpu::CommandEncoder,
        tile: &Tile,
        options: &RenderOptions,
        (target, origin): (&wgpu::TextureView, [usize; 2]),
    ) {
        let Some(samples) = &self.samples else { return };
        let origin = origin.map(|o| o as u32);
        let [r, g, b] = options.background.unwrap_or_default().map(f32::from);
        let background = [r, g, b, if options.background.is_some() { 1.0 } else { 0.0 }];
        let (per_side, is_srgb) = (options.per_side() as u32, u32::from(self.format.is_srgb()));
        let numbers = Options { background, origin, per_side, is_srgb };
        device.queue().write_buffer(&self.options, 0, bytemuck::bytes_of(&numbers));
        let load = if origin == [0, 0] { wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT) } else { wgpu::LoadOp::Load };
        let size = tile.size.map(|side| side as u32);
        cover(encoder, &self.resolve, &samples.bindings, (target, load), (origin, size));
    }
}

impl Samples {
    fn new(device: &Device, size: [u32; 2], resolve: &wgpu::RenderPipeline, options: &wgpu::Buffer) -> Self {
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let view = |format, usage| {
            let texture = device.texture(size, [1, 1], format, usage);
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        let color = view(FORMAT, usage | wgpu::TextureUsages::TEXTURE_BINDING);
        let texture = wgpu::BindingResource::TextureView(&color);
        let bindings = device.bind(resolve, 0, &[texture, options.as_entire_binding()]);
        Self { size, depth: view(DEPTH, usage), color, bindings }
    }

    /// A pass that begins with nothing.
    fn pass<'e>(&self, encoder: &'e mut wgpu::CommandEncoder) -> wgpu::RenderPass<'e> {
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
