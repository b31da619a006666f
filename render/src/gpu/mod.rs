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
//! *Limits*: textures and buffers as large as the adapter takes them, 1 GiB of textures in all; a scene beyond is refused
//! ([`GpuError::TooLarge`]). A camera with a lens is refused, too: hardware draws straight edges, and a lens bends them. The
//! CPU plays what is refused. Which of two faces a sub-sample on their common edge, or within 1/256 of its spacing
//! of a silhouette, belongs to is the hardware's choice.

mod actor;
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

use crate::cpu::{Object, distinct};
use crate::material::{Coats, Lighting};
use crate::resolve::Accumulator;
use crate::{RenderOptions, frame_size, is_usable};
use actor::Actor;
use capture::{Camera, Image};
use geometry::TexturedMesh;
use readback::Readback;
use std::time::{Duration, Instant};
use texture::Model;
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

/// Plays the objects of a scene, or one mesh with atlases from elsewhere.
#[derive(Debug)]
pub struct Renderer<'a> {
    device: Device,
    actors: Vec<Actor<'a>>,
    canvas: Option<Canvas>,
    readback: Option<Readback>,
    times: StageTimes,
}

impl Blend {
    /// What is faster on a device.
    pub fn fastest(device: &Device) -> Self {
        if device.is_software() { Self::Cpu } else { Self::Adapter }
    }
}

impl<'a> Renderer<'a> {
    /// A renderer of `model`, its layers blended where that is faster.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] where the model does not fit the adapter, [`GpuError::Driver`] where the driver fails.
    pub fn new(device: &Device, model: &'a Model) -> Result<Self, GpuError> {
        Self::with_blend(device, model, Blend::fastest(device))
    }

    /// The same with layers blended by whom one likes.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn with_blend(device: &Device, model: &'a Model, blend: Blend) -> Result<Self, GpuError> {
        Self::of_scene(device, &[Object::new(model)], blend)
    }

    /// A renderer of several objects, nearest in front. Those of one model share what it holds; each has a texture of its
    /// own.
    ///
    /// # Errors
    /// As [`Renderer::new`], [`GpuError::TooLarge`] where the objects together do not fit; [`GpuError::Unsupported`] for
    /// coats with a codec without a shader.
    pub fn of_scene(device: &Device, objects: &[Object<'a>], blend: Blend) -> Result<Self, GpuError> {
        let (models, which) = distinct(objects);
        let bytes: Vec<[u64; 2]> = models.iter().map(|model| actor::bytes(model, blend)).collect();
        let own = which.iter().map(|&model| bytes[model][1]);
        device.check_bytes(bytes.iter().map(|[shared, _]| *shared).chain(own).sum())?;
        let mut renderer = Self::empty(device);
        device.guarded(|| {
            for (k, object) in objects.iter().enumerate() {
                let kin = which[..k].iter().position(|model| *model == which[k]);
                let actor = Actor::of_object(device, object, blend, kin.map(|kin| &renderer.actors[kin]))?;
                renderer.actors.push(actor);
            }
            Ok(())
        })?;
        Ok(renderer)
    }

    /// A renderer of `mesh` with atlases that [`Renderer::set_atlas`] hands it; black before.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn of_mesh(device: &Device, mesh: &TexturedMesh) -> Result<Self, GpuError> {
        device.check_bytes(atlas::bytes(mesh.atlas_size))?;
        let actor = device.guarded(|| Actor::of_mesh(device, mesh, mesh.atlas_size))?;
        Ok(Self { actors: vec![actor], ..Self::empty(device) })
    }

    fn empty(device: &Device) -> Self {
        let times = StageTimes::default();
        Self { device: device.clone(), actors: Vec::new(), canvas: None, readback: None, times }
    }

    /// How long the stages of the last frame took.
    pub fn times(&self) -> StageTimes {
        self.times
    }

    /// Bytes of layers and rays that the last frame read: none where weights were what they had been.
    pub fn bytes(&self) -> u64 {
        self.actors.iter().map(Actor::bytes).sum()
    }

    /// Shows `atlas` (encoded 0..=255, unclamped) on the first object from now on, instead of the model's own; black
    /// where it has no texels.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn set_atlas(&mut self, atlas: &Image<[f32; 3]>) -> Result<(), GpuError> {
        let (device, first) = (&self.device, self.actors.first_mut());
        device.guarded(|| first.map_or(Ok(()), |actor| actor.set_atlas(device, atlas)))
    }

    /// Lays materials over the mesh of the first object, in place of others: what `lighting` shines on from now on.
    /// Without lighting the atlas shows everywhere.
    ///
    /// # Errors
    /// [`GpuError::Unsupported`] for a codec without a shader; as [`Renderer::new`].
    pub fn lay(&mut self, coats: &Coats<'_>) -> Result<(), GpuError> {
        let (device, first) = (&self.device, self.actors.first_mut());
        device.guarded(|| first.map_or(Ok(()), |actor| actor.lay(device, coats)))
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
        self.attempt(|renderer| {
            let start = Instant::now();
            renderer.prepare(shot)?;
            renderer.device.wait()?;
            renderer.times.atlas = start.elapsed().saturating_sub(renderer.times.weights);
            for tile in tiles([width, height], &shot.options) {
                renderer.read_tile(&tile, shot, &mut frame)?;
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
        self.attempt(|renderer| {
            renderer.prepare(shot)?;
            let start = Instant::now();
            for tile in tiles([width, height], &shot.options) {
                let mut encoder = renderer.device.encoder();
                renderer.draw_tile(&mut encoder, &tile, shot, target, tile.origin)?;
                renderer.device.queue().submit([encoder.finish()]);
            }
            renderer.times.drawing = start.elapsed();
            Ok(())
        })
    }

    /// Draws; after a fault, which may have come at any time before it was heard of, nothing on the adapter is taken for
    /// what it should be.
    fn attempt(&mut self, work: impl FnOnce(&mut Self) -> Result<(), GpuError>) -> Result<(), GpuError> {
        let device = self.device.clone();
        let done = device.guarded(|| work(self));
        if done.is_err() {
            self.actors.iter_mut().for_each(Actor::forget);
        }
        done
    }

    /// Brings the lights and the atlases to what the camera sees.
    fn prepare(&mut self, shot: &Shot<'_>) -> Result<(), GpuError> {
        let Self { device, actors, times, .. } = self;
        actors.iter_mut().try_for_each(|actor| actor.prepare(device, shot, times))
    }

    /// Draws a tile to our own target, and reads it.
    fn read_tile(&mut self, tile: &Tile, shot: &Shot<'_>, frame: &mut Image<[u8; 4]>) -> Result<(), GpuError> {
        let start = Instant::now();
        let size = tile.size.map(|side| side as u32);
        let readback = match self.readback.take() {
            Some(kept) if kept.fits(size) => kept,
            _ => Readback::new(&self.device, size),
        };
        let mut encoder = self.device.encoder();
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
        let nearest = self.actors.iter().map(Actor::nearest).filter(|n| *n > 0.0).fold(f64::INFINITY, f64::min);
        let looked_at = self.actors.iter().filter(|actor| actor.look(&self.device, shot, nearest, tile));
        let looked_at: Vec<&Actor<'_>> = looked_at.collect();
        let mut pass = canvas.fill(&self.device, encoder, tile, &shot.options);
        looked_at.iter().for_each(|actor| actor.draw(&mut pass, shot.lighting.is_some()));
        drop(pass);
        canvas.resolve(&self.device, encoder, tile, &shot.options, (target.view, origin));
        self.canvas = Some(canvas);
        Ok(())
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
#[path = "../../tests/support/models.rs"]
mod models;

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
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

    /// What the driver refused is tried again, not taken for done.
    #[test]
    fn a_blend_that_failed_is_not_taken_for_fresh() {
        let device = match Device::headless() {
            Ok(device) => device,
            Err(fault) => return println!("skipped: {fault}"),
        };
        let model = models::dyntex(models::bumpy_ball(5, [40, 30]), 4, 20, |_| 4);
        let camera = crate::path::turntable_cameras(&model.mesh.mesh.aabb().unwrap(), None, 1, 40, 30, Vector3::z())[0];
        let shot = Shot { camera: &camera, lighting: None, options: RenderOptions::default() };
        let mut renderer = Renderer::with_blend(&device, &model, Blend::Adapter).unwrap();
        renderer.actors[0].break_layers();
        for attempt in 0..2 {
            let fault = renderer.render(&shot).unwrap_err();
            assert!(matches!(fault, GpuError::Driver { .. }), "attempt {attempt}: {fault}");
        }
    }

    #[test]
    fn a_bad_program_is_found() {
        assert!(fault("fn f() -> u32 { return 1.5; }").is_some());
        assert!(fault(&surface::SOURCE.replace("dot(u, u)", "dot(u, direction)")).is_some());
    }
}
