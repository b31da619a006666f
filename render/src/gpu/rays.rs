//! The lumigraph: rays per texel in texture arrays, blended into the atlas, and texels without rays filled.
//!
//! Bytes: 6 a texel and ray, 16 a texel for its surface point, 21 for the levels of the fill.

use super::GpuError;
use super::atlas::{Atlas, FORMAT, at_level};
use super::device::{Device, cover};
use bytemuck::cast_slice;
use nalgebra::Point3;
use texture::SurfaceTexels;
use texture::appearance::{Lumigraph, NO_RAY};

/// The rays on the adapter.
#[derive(Debug)]
pub(super) struct RayBlend {
    shelf: Shelf,
    eye: wgpu::Buffer,
    bindings: wgpu::BindGroup,
    levels: Vec<Level>,
}

/// What does not depend on the eye: objects of one model share it.
#[derive(Clone, Debug)]
struct Shelf {
    middle: Point3<f64>,
    size: [u32; 2],
    /// Colours, views, surface points.
    textures: [wgpu::TextureView; 3],
    centers: wgpu::Buffer,
    blend: wgpu::RenderPipeline,
    push: wgpu::RenderPipeline,
    pull: wgpu::RenderPipeline,
    /// Of a blend.
    read: u64,
}

/// A level of the fill.
#[derive(Debug)]
struct Level {
    size: [u32; 2],
    /// As blended or pushed.
    known: wgpu::TextureView,
    /// The same after the pull; of the finest, the atlas takes this place.
    filled: wgpu::TextureView,
    /// What pushes this level out of the finer one.
    push: Option<wgpu::BindGroup>,
    /// What pulls this level from the coarser one.
    pull: Option<wgpu::BindGroup>,
}

impl RayBlend {
    pub(super) fn new(
        device: &Device,
        rays: &Lumigraph,
        surface: &SurfaceTexels,
        middle: Point3<f64>,
    ) -> Result<Self, GpuError> {
        let size = surface.size.map(|side| side as u32);
        device.check("rays a texel", rays.rays as u64, u64::from(device.limits().max_texture_array_layers))?;
        let relative = |p: &Point3<f64>| -> [f32; 4] { (p - middle).push(1.0).cast().into() };
        let centers: Vec<[f32; 4]> = rays.centers.iter().map(relative).collect();
        let centers = device.buffer(cast_slice(&centers), wgpu::BufferUsages::STORAGE)?;
        let [colors, views] = arrays(device, rays, surface);
        let source = include_str!("push_pull.wgsl");
        Self::bound(
            device,
            Shelf {
                middle,
                size,
                textures: [colors, views, points(device, surface, relative)],
                centers,
                blend: device.covering(include_str!("rays.wgsl"), "blend", FORMAT),
                push: device.covering(source, "push", FORMAT),
                pull: device.covering(source, "pull", FORMAT),
                read: 6 * (rays.rays * surface.len()) as u64,
            },
        )
    }

    /// The same rays for another eye.
    pub(super) fn another(&self, device: &Device) -> Result<Self, GpuError> {
        Self::bound(device, self.shelf.clone())
    }

    fn bound(device: &Device, shelf: Shelf) -> Result<Self, GpuError> {
        let eye = device.buffer(&[0; 16], wgpu::BufferUsages::UNIFORM)?;
        let [colors, views, points] = shelf.textures.each_ref().map(wgpu::BindingResource::TextureView);
        let bindings = [colors, views, points, shelf.centers.as_entire_binding(), eye.as_entire_binding()];
        let bindings = device.bind(&shelf.blend, 0, &bindings);
        let levels = levels(device, shelf.size, &shelf.push, &shelf.pull);
        Ok(Self { shelf, eye, bindings, levels })
    }

    /// Bytes of rays that a blend reads.
    pub(super) fn read(&self) -> u64 {
        self.shelf.read
    }

    /// Takes the eye to the adapter.
    pub(super) fn look(&self, device: &Device, eye: &Point3<f64>) {
        let eye: [f32; 4] = (eye - self.shelf.middle).push(1.0).cast().into();
        device.queue().write_buffer(&self.eye, 0, cast_slice(&eye));
    }

    /// Blends the rays and fills what has none, into level 0 of the atlas.
    pub(super) fn blend(&self, encoder: &mut wgpu::CommandEncoder, atlas: &Atlas) {
        let clear = wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT);
        let whole = |level: &Level| ([0, 0], level.size);
        // A single texel is its own level.
        let Some(finest) = self.levels.first() else { return };
        let first = if finest.pull.is_none() { atlas.finest() } else { &finest.known };
        cover(encoder, &self.shelf.blend, &self.bindings, (first, clear), whole(finest));
        for level in &self.levels {
            if let Some(bindings) = &level.push {
                cover(encoder, &self.shelf.push, bindings, (&level.known, clear), whole(level));
            }
        }
        for (l, level) in self.levels.iter().enumerate().rev() {
            let target = if l == 0 { atlas.finest() } else { &level.filled };
            if let Some(bindings) = &level.pull {
                cover(encoder, &self.shelf.pull, bindings, (target, clear), whole(level));
            }
        }
    }
}

/// Bytes that rays take, shared by objects of one model, and that the fill takes for each.
pub(super) fn bytes(rays: &Lumigraph, surface: &SurfaceTexels) -> [u64; 2] {
    let texels = surface.size[0] as u64 * surface.size[1] as u64;
    [texels * (6 * rays.rays.max(1) as u64 + 16), texels * 21]
}

/// Colours and views of the slots.
fn arrays(device: &Device, rays: &Lumigraph, surface: &SurfaceTexels) -> [wgpu::TextureView; 2] {
    let size = surface.size.map(|side| side as u32);
    let texels = surface.size[0] * surface.size[1];
    let usage = wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::TEXTURE_BINDING;
    let array = |format| device.texture(size, [rays.rays.max(1) as u32, 1], format, usage);
    let textures = [array(wgpu::TextureFormat::Rgba8Unorm), array(wgpu::TextureFormat::R16Uint)];
    for slot in 0..rays.rays {
        let (mut colors, mut views) = (vec![[0u8; 4]; texels], vec![NO_RAY; texels]);
        for (t, &at) in surface.index.iter().enumerate() {
            let [r, g, b] = rays.colors[t * rays.rays + slot];
            colors[at as usize] = [r, g, b, 255];
            views[at as usize] = rays.views[t * rays.rays + slot];
        }
        device.write(&textures[0], slot as u32, size, colors.as_flattened());
        device.write(&textures[1], slot as u32, size, cast_slice(&views));
    }
    let dimension = Some(wgpu::TextureViewDimension::D2Array);
    textures.map(|t| t.create_view(&wgpu::TextureViewDescriptor { dimension, ..Default::default() }))
}

/// Surface points of the texels.
fn points(device: &Device, surface: &SurfaceTexels, relative: impl Fn(&Point3<f64>) -> [f32; 4]) -> wgpu::TextureView {
    let mut points = vec![[0.0f32; 4]; surface.size[0] * surface.size[1]];
    for (&at, position) in surface.index.iter().zip(&surface.positions) {
        points[at as usize] = relative(position);
    }
    let usage = wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::TEXTURE_BINDING;
    let size = surface.size.map(|side| side as u32);
    let texture = device.texture(size, [1, 1], wgpu::TextureFormat::Rgba32Float, usage);
    device.write(&texture, 0, size, cast_slice(points.as_flattened()));
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// The levels down to one texel, each with what makes it.
fn levels(device: &Device, size: [u32; 2], push: &wgpu::RenderPipeline, pull: &wgpu::RenderPipeline) -> Vec<Level> {
    let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING;
    let view = |size| {
        let texture = device.texture(size, [1, 1], FORMAT, usage);
        texture.create_view(&wgpu::TextureViewDescriptor::default())
    };
    let count = size[0].max(size[1]).next_power_of_two().trailing_zeros() + 1;
    let sizes: Vec<[u32; 2]> = (0..count).map(|l| at_level(size, l)).collect();
    let views: Vec<[wgpu::TextureView; 2]> = sizes.iter().map(|&size| [view(size), view(size)]).collect();
    let texture = wgpu::BindingResource::TextureView;
    let pushed = |l: usize| device.bind(push, 0, &[texture(&views[l - 1][0])]);
    let pulled = |l: usize| {
        // The coarsest is known, or nothing is.
        let is_last = l + 2 == views.len();
        let coarser = &views[l + 1][usize::from(!is_last)];
        device.bind(pull, 0, &[texture(&views[l][0]), texture(coarser)])
    };
    let level = |l: usize| Level {
        size: sizes[l],
        known: views[l][0].clone(),
        filled: views[l][1].clone(),
        push: (l > 0).then(|| pushed(l)),
        pull: (l + 1 < views.len()).then(|| pulled(l)),
    };
    (0..views.len()).map(level).collect()
}
