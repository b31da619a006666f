//! Playback on graphics hardware, through wgpu: the picture [`crate::reference`] defines, within 1/255.
//!
//! | pass | file | when |
//! |---|---|---|
//! | layers or rays into the atlas | `layers`, `rays` | the eye moved |
//! | mip-maps | `atlas` | the atlas changed |
//! | faces into sub-samples | `surface`, `material` | every frame |
//! | sub-samples into pixels | `tiles` | every frame |
//!
//! An appearance answers for the eye on the CPU ([`texture::FacetWeights::at`]), as for every renderer; the
//! adapter does the rest. Where the adapter is itself a program on the CPU, our own blend is the faster one: its
//! atlas is uploaded and the first pass left out ([`Blend`]). Either way the picture is the same, within a level nearly everywhere.
//!
//! *Limits*: textures and buffers as large as the adapter takes them, 1 GiB in all; a model beyond is refused
//! ([`GpuError::TooLarge`]). A camera with a lens is refused, too: hardware draws straight edges, and a lens bends them. The
//! CPU plays what is refused. Which of two faces a sub-sample on their common edge, or within 1/256 of its spacing
//! of a silhouette, belongs to is the hardware's choice.

mod atlas;
mod device;
mod error;
mod layers;
mod material;
mod rays;
mod readback;
mod surface;
mod tiles;

pub use device::Device;
pub use error::GpuError;
/// The version whose devices and views are taken.
pub use wgpu;

use crate::material::{Coats, Lighting};
use crate::resolve::Accumulator;
use crate::{RenderOptions, frame_size, is_usable};
use atlas::Atlas;
use capture::{Camera, Image};
use geometry::TexturedMesh;
use layers::LayerBlend;
use material::Dress;
use nalgebra::Point3;
use rays::RayBlend;
use readback::Readback;
use std::time::{Duration, Instant};
use surface::Surface;
use texture::{Appearance, Method, Model};
use tiles::{Canvas, Tile, tiles};

/// Who blends the layers of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blend {
    /// The adapter.
    Adapter,
    /// The CPU; the blended atlas is uploaded.
    Cpu,
}

/// How long the stages of the last frame took, as the clock on the wall says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StageTimes {
    /// Weights for the eye; the blend, where the CPU does it.
    pub weights: Duration,
    /// The atlas on the adapter: upload or blend, and mip-maps.
    pub atlas: Duration,
    /// Faces into sub-samples into pixels.
    pub drawing: Duration,
    /// The picture back from the adapter.
    pub reading: Duration,
}

/// Where a window, or whoever else, wants its pixels.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// As large as the camera's frame.
    pub view: &'a wgpu::TextureView,
    /// A colour format that can be drawn to. One that encodes sRGB by itself shows the same picture.
    pub format: wgpu::TextureFormat,
}

/// What is drawn of the scene.
#[derive(Clone, Copy, Debug)]
pub struct Shot<'a> {
    /// From where.
    pub camera: &'a Camera,
    /// What shines on the materials that were laid; none shows the atlas everywhere.
    pub lighting: Option<&'a Lighting>,
    /// How.
    pub options: RenderOptions,
}

/// Plays one model, or one mesh with atlases from elsewhere.
#[derive(Debug)]
pub struct Renderer<'a> {
    device: Device,
    surface: Surface,
    atlas: Atlas,
    bindings: wgpu::BindGroup,
    source: Source<'a>,
    dress: Option<Dress>,
    /// The eye the atlas is for.
    seen: Option<Point3<f64>>,
    canvas: Option<Canvas>,
    readback: Option<Readback>,
    times: StageTimes,
}

/// Where the atlas comes from.
#[derive(Debug)]
enum Source<'a> {
    /// [`Renderer::set_atlas`].
    Given,
    Blended(&'a Model),
    Layers(LayerBlend<'a>),
    Rays(Box<RayBlend>),
}

impl<'a> Renderer<'a> {
    /// A renderer of `model`, its layers blended where that is faster.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] where the model does not fit the adapter, [`GpuError::Driver`] where the driver fails.
    pub fn new(device: &Device, model: &'a Model) -> Result<Self, GpuError> {
        let blend = if device.is_software() { Blend::Cpu } else { Blend::Adapter };
        Self::with_blend(device, model, blend)
    }

    /// The same with layers blended by whom one likes.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn with_blend(device: &Device, model: &'a Model, blend: Blend) -> Result<Self, GpuError> {
        let size = match &model.appearance {
            Appearance::Layers(layers) => [layers.facet_of_texel.width(), layers.facet_of_texel.height()],
            Appearance::Lumigraph(_, surface) => surface.size,
        };
        let mut renderer = Self::sized(device, &model.mesh, size)?;
        renderer.source = device.guarded(|| {
            Ok(match (blend, &model.appearance) {
                (Blend::Cpu, _) => Source::Blended(model),
                (Blend::Adapter, Appearance::Layers(layers)) => Source::Layers(LayerBlend::new(device, layers)?),
                (Blend::Adapter, Appearance::Lumigraph(rays, texels)) => {
                    Source::Rays(Box::new(RayBlend::new(device, rays, texels, renderer.surface.middle())?))
                }
            })
        })?;
        Ok(renderer)
    }

    /// A renderer of `mesh` with atlases that [`Renderer::set_atlas`] hands it; black before.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn of_mesh(device: &Device, mesh: &TexturedMesh) -> Result<Self, GpuError> {
        Self::sized(device, mesh, mesh.atlas_size)
    }

    fn sized(device: &Device, mesh: &TexturedMesh, atlas_size: [usize; 2]) -> Result<Self, GpuError> {
        device.guarded(|| {
            let (surface, atlas) = (Surface::new(device, mesh)?, Atlas::new(device, atlas_size)?);
            let bindings = surface.bind(device, &atlas);
            Ok(Self {
                device: device.clone(),
                surface,
                atlas,
                bindings,
                source: Source::Given,
                dress: None,
                seen: None,
                canvas: None,
                readback: None,
                times: StageTimes::default(),
            })
        })
    }

    /// How long the stages of the last frame took.
    pub fn times(&self) -> StageTimes {
        self.times
    }

    /// Shows `atlas` (encoded 0..=255, unclamped) from now on, instead of the model's own.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn set_atlas(&mut self, atlas: &Image<[f32; 3]>) -> Result<(), GpuError> {
        let device = self.device.clone();
        device.guarded(|| {
            if self.atlas.size() != [atlas.width().max(1), atlas.height().max(1)].map(|side| side as u32) {
                self.atlas = Atlas::new(&device, [atlas.width(), atlas.height()])?;
                self.bindings = self.surface.bind(&device, &self.atlas);
            }
            self.atlas.upload(&device, atlas);
            (self.source, self.seen) = (Source::Given, None);
            Ok(())
        })
    }

    /// Lays materials over the mesh, in place of others: what `lighting` shines on from now on. Without lighting the
    /// atlas shows everywhere.
    ///
    /// # Errors
    /// [`GpuError::Unsupported`] for a codec without a shader; as [`Renderer::new`].
    pub fn lay(&mut self, coats: &Coats<'_>) -> Result<(), GpuError> {
        self.dress = Some(self.device.guarded(|| Dress::new(&self.device, &self.surface, coats))?);
        Ok(())
    }

    /// Draws one frame: RGBA, 8 bit encoded, not premultiplied, alpha the share of covered sub-samples; the contract of
    /// [`crate::reference::render`], and with `lighting` of [`crate::reference::render_lit`], but for lenses.
    ///
    /// # Errors
    /// [`GpuError::Unsupported`] for a camera with a lens, [`GpuError::Driver`] where the driver fails.
    pub fn render(&mut self, shot: &Shot<'_>) -> Result<Image<[u8; 4]>, GpuError> {
        self.times = StageTimes::default();
        let (width, height) = frame_size(shot.camera);
        let mut frame = Image::filled(width, height, Accumulator::default().finish(1, shot.options.background));
        if width == 0 || height == 0 || !is_usable(shot.camera) {
            return Ok(frame);
        }
        refuse_lens(shot.camera)?;
        let device = self.device.clone();
        device.guarded(|| {
            let start = Instant::now();
            self.prepare(shot)?;
            device.wait()?;
            self.times.atlas = start.elapsed() - self.times.weights;
            for tile in tiles([width, height], &shot.options) {
                self.read_tile(&tile, shot, &mut frame)?;
            }
            Ok(())
        })?;
        Ok(frame)
    }

    /// Draws one frame to somebody else's target, and does not wait for it.
    ///
    /// # Errors
    /// As [`Renderer::render`]; [`GpuError::Unsupported`] for a camera that sees nothing, too: the target is left as it is.
    pub fn draw(&mut self, shot: &Shot<'_>, target: &Target<'_>) -> Result<(), GpuError> {
        self.times = StageTimes::default();
        refuse_lens(shot.camera)?;
        let (width, height) = frame_size(shot.camera);
        if width == 0 || height == 0 || !is_usable(shot.camera) {
            return Err(GpuError::Unsupported { what: "a camera that sees nothing".to_owned() });
        }
        let device = self.device.clone();
        device.guarded(|| {
            self.prepare(shot)?;
            let start = Instant::now();
            for tile in tiles([width, height], &shot.options) {
                let mut encoder = self.encoder();
                self.draw_tile(&mut encoder, &tile, shot, target, tile.origin)?;
                device.queue().submit([encoder.finish()]);
            }
            self.times.drawing = start.elapsed();
            Ok(())
        })
    }

    /// Brings the light and the atlas to what the camera sees.
    fn prepare(&mut self, shot: &Shot<'_>) -> Result<(), GpuError> {
        if let (Some(dress), Some(lighting)) = (&self.dress, shot.lighting) {
            dress.light(&self.device, lighting, &self.surface.middle())?;
        }
        let eye = shot.camera.center();
        if self.is_stale(&eye) {
            self.blend(&eye);
        }
        Ok(())
    }

    /// Brings the atlas to what `eye` sees.
    fn blend(&mut self, eye: &Point3<f64>) {
        self.seen = Some(*eye);
        let start = Instant::now();
        let mut encoder = self.encoder();
        match &mut self.source {
            Source::Given => {}
            Source::Blended(model) => {
                let atlas = model.atlas(eye);
                self.times.weights = start.elapsed();
                self.atlas.upload(&self.device, &atlas);
            }
            Source::Layers(layers) => {
                if !layers.weigh(&self.device, eye) {
                    return;
                }
                self.times.weights = start.elapsed();
                layers.blend(&mut encoder, &self.atlas);
            }
            Source::Rays(rays) => {
                rays.look(&self.device, eye);
                rays.blend(&mut encoder, &self.atlas);
            }
        }
        self.atlas.reduce(&mut encoder);
        self.device.queue().submit([encoder.finish()]);
        self.times.atlas = start.elapsed() - self.times.weights;
    }

    fn is_stale(&self, eye: &Point3<f64>) -> bool {
        match (&self.source, &self.seen) {
            (_, None) => true,
            (Source::Given, _) => false,
            (Source::Blended(model), _) if model.method == Method::Static => false,
            (_, Some(seen)) => seen != eye,
        }
    }

    /// Draws a tile to our own target, and reads it.
    fn read_tile(&mut self, tile: &Tile, shot: &Shot<'_>, frame: &mut Image<[u8; 4]>) -> Result<(), GpuError> {
        let start = Instant::now();
        let size = tile.size.map(|side| side as u32);
        let readback = match self.readback.take() {
            Some(kept) if kept.fits(size) => kept,
            _ => Readback::new(&self.device, size),
        };
        let mut encoder = self.encoder();
        let target = Target { view: readback.target(), format: readback::FORMAT };
        self.draw_tile(&mut encoder, tile, shot, &target, [0, 0])?;
        readback.copy(&mut encoder);
        self.device.queue().submit([encoder.finish()]);
        self.device.wait()?;
        let drawn = Instant::now();
        readback.read(&self.device, tile, frame)?;
        self.readback = Some(readback);
        self.times.drawing += drawn - start;
        self.times.reading += drawn.elapsed();
        Ok(())
    }

    /// Draws a tile to the pixels of a target from `origin` on.
    fn draw_tile(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        tile: &Tile,
        shot: &Shot<'_>,
        target: &Target<'_>,
        origin: [usize; 2],
    ) -> Result<(), GpuError> {
        let mut canvas = match self.canvas.take() {
            Some(kept) if kept.fits(target.format) => kept,
            _ => Canvas::new(&self.device, target.format)?,
        };
        self.surface.look(&self.device, shot.camera, &shot.options, tile, &self.atlas);
        let dress = self.dress.as_ref().filter(|_| shot.lighting.is_some());
        let mut pass = canvas.fill(&self.device, encoder, tile, &shot.options);
        self.surface.draw(&mut pass, &self.bindings, dress.map(|dress| &dress.bare));
        if let Some(dress) = dress {
            dress.draw(&mut pass);
        }
        drop(pass);
        canvas.resolve(&self.device, encoder, tile, &shot.options, (target.view, origin));
        self.canvas = Some(canvas);
        Ok(())
    }

    fn encoder(&self) -> wgpu::CommandEncoder {
        self.device.wgpu().create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }
}

/// Hardware cannot bend edges as a lens does.
fn refuse_lens(camera: &Camera) -> Result<(), GpuError> {
    if camera.intrinsics.distortion.is_none() {
        return Ok(());
    }
    Err(GpuError::Unsupported { what: "what a camera with a distorting lens sees".to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use wgpu::naga;

    /// Every program that is handed to a driver, under the names of the files it is made of.
    fn programs() -> Vec<(Vec<&'static str>, String)> {
        let covering = |name, source: &str| (vec!["cover", name], [include_str!("cover.wgsl"), source].concat());
        let codec = |name, source| (vec!["surface", "material", name], material::program(source));
        vec![
            (vec!["surface"], surface::SOURCE.to_owned()),
            codec("gaussian_mixture", material::CODECS[0]),
            codec("multilevel_vq", material::CODECS[1]),
            covering("halve", include_str!("halve.wgsl")),
            covering("layers", include_str!("layers.wgsl")),
            covering("rays", include_str!("rays.wgsl")),
            covering("push_pull", include_str!("push_pull.wgsl")),
            covering("resolve", include_str!("resolve.wgsl")),
        ]
    }

    fn fault(source: &str) -> Option<String> {
        let module = match naga::front::wgsl::parse_str(source) {
            Ok(module) => module,
            Err(fault) => return Some(fault.emit_to_string(source)),
        };
        // What every adapter has, and no more.
        let mut validator = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), Default::default());
        validator.validate(&module).err().map(|fault| fault.emit_to_string(source))
    }

    #[test]
    fn every_program_is_valid() {
        let programs = programs();
        for (files, source) in &programs {
            assert_eq!(fault(source), None, "{files:?}");
        }
        let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/src/gpu"));
        for entry in std::fs::read_dir(folder).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            let Some(stem) = name.strip_suffix(".wgsl") else { continue };
            assert!(programs.iter().any(|(files, _)| files.contains(&stem)), "{name} is in no program");
        }
    }

    #[test]
    fn a_bad_program_is_found() {
        assert!(fault("fn f() -> u32 { return 1.5; }").is_some());
        assert!(fault(&surface::SOURCE.replace("dot(u, u)", "dot(u, direction)")).is_some());
    }
}
