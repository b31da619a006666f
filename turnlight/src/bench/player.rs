//! Who plays against the clock.

use crate::Error;
use capture::{Camera, Image};
use render::RenderOptions;
use render::cpu::{Object, ScenePlayer};
#[cfg(feature = "gpu")]
use render::gpu;
use render::material::Lighting;
use std::time::Duration;

/// One sub-sample a pixel, as a window that must keep up.
const OPTIONS: RenderOptions = RenderOptions { supersample: 1, background: None };

/// Draws frames and knows what the last one took.
pub(super) trait Player {
    fn draw(&mut self, camera: &Camera, frame: &mut Image<[u8; 4]>) -> Result<(), Error>;
    /// By name.
    fn stages(&self) -> Vec<(&'static str, Duration)>;
    /// Layers and rays that were read.
    fn bytes(&self) -> u64;
}

/// The CPU.
#[derive(Debug)]
pub(super) struct Cpu<'a> {
    player: ScenePlayer<'a>,
    lighting: Lighting,
}

impl<'a> Cpu<'a> {
    pub(super) fn new(objects: &[Object<'a>]) -> Self {
        Self { player: ScenePlayer::new(objects, OPTIONS), lighting: Lighting::default() }
    }
}

impl Player for Cpu<'_> {
    fn draw(&mut self, camera: &Camera, frame: &mut Image<[u8; 4]>) -> Result<(), Error> {
        self.player.render_into(camera, &self.lighting, frame);
        Ok(())
    }

    fn stages(&self) -> Vec<(&'static str, Duration)> {
        let t = self.player.times();
        vec![("setup", t.setup), ("visibility", t.visibility), ("blend", t.blend), ("shading", t.shading)]
    }

    fn bytes(&self) -> u64 {
        self.player.bytes()
    }
}

/// Graphics hardware, or what stands in for it.
#[cfg(feature = "gpu")]
#[derive(Debug)]
pub(super) struct Gpu<'a> {
    renderer: gpu::Renderer<'a>,
}

#[cfg(feature = "gpu")]
impl<'a> Gpu<'a> {
    pub(super) fn new(device: &gpu::Device, objects: &[Object<'a>]) -> Result<Self, Error> {
        let renderer = gpu::Renderer::of_scene(device, objects, gpu::Blend::fastest(device));
        Ok(Self { renderer: renderer.map_err(failed)? })
    }
}

#[cfg(feature = "gpu")]
impl Player for Gpu<'_> {
    fn draw(&mut self, camera: &Camera, frame: &mut Image<[u8; 4]>) -> Result<(), Error> {
        *frame = self.renderer.render(&gpu::Shot { camera, lighting: None, options: OPTIONS }).map_err(failed)?;
        Ok(())
    }

    fn stages(&self) -> Vec<(&'static str, Duration)> {
        let t = self.renderer.times();
        vec![("blend", t.weights + t.atlas), ("draw", t.drawing), ("read_back", t.reading)]
    }

    fn bytes(&self) -> u64 {
        self.renderer.bytes()
    }
}

#[cfg(feature = "gpu")]
pub(super) fn failed(fault: gpu::GpuError) -> Error {
    Error::Failed(fault.to_string())
}
