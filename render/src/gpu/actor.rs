//! One object on the adapter: its faces, its texture as its eye sees it, its materials.

use super::atlas::{self, Atlas};
use super::device::Device;
use super::layers::{self, LayerBlend};
use super::material::Dress;
use super::rays::{self, RayBlend};
use super::surface::Surface;
use super::tiles::Tile;
use super::{Blend, GpuError, Shot, StageTimes};
use crate::cpu::Object;
use crate::filter::FIXED_ONE;
use crate::material::Coats;
use crate::{Pose, blend, is_usable};
use capture::{Camera, Image};
use geometry::TexturedMesh;
use nalgebra::Point3;
use std::time::Instant;
use texture::{Appearance, Model};

/// An object that is drawn.
#[derive(Debug)]
pub(super) struct Actor<'a> {
    pose: Pose,
    surface: Surface,
    atlas: Atlas,
    bindings: wgpu::BindGroup,
    source: Source<'a>,
    dress: Option<Dress>,
    /// The eye the atlas is for, in the object's coordinates.
    seen: Option<Point3<f64>>,
    /// Of layers or rays, by the last frame.
    bytes: u64,
}

/// Where the atlas comes from.
#[derive(Debug)]
enum Source<'a> {
    /// [`Actor::set_atlas`]; or a model without texels, which is black.
    Given,
    Blended(Box<blend::Atlas<'a>>),
    Layers(Box<LayerBlend<'a>>),
    Rays(Box<RayBlend>),
}

impl<'a> Actor<'a> {
    /// A mesh whose atlases come from elsewhere; black before.
    pub(super) fn of_mesh(device: &Device, mesh: &TexturedMesh, atlas_size: [usize; 2]) -> Result<Self, GpuError> {
        Self::of_surface(device, Surface::new(device, mesh)?, atlas_size)
    }

    fn of_surface(device: &Device, surface: Surface, atlas_size: [usize; 2]) -> Result<Self, GpuError> {
        let atlas = Atlas::new(device, atlas_size)?;
        let bindings = surface.bind(device, &atlas);
        let (pose, source) = (Pose::default(), Source::Given);
        Ok(Self { pose, surface, atlas, bindings, source, dress: None, seen: None, bytes: 0 })
    }

    /// An object; what `kin`, one of the same model, holds of it is shared.
    pub(super) fn of_object(
        device: &Device,
        object: &Object<'a>,
        blend: Blend,
        kin: Option<&Self>,
    ) -> Result<Self, GpuError> {
        let size = atlas_size(object.model);
        let mut actor = match kin {
            Some(kin) => Self::of_surface(device, kin.surface.another(device)?, size)?,
            None => Self::of_mesh(device, &object.model.mesh, size)?,
        };
        actor.source = match kin {
            _ if size.contains(&0) => Source::Given,
            Some(kin) => kin.source.another(device)?,
            None => Source::new(device, object.model, blend, &actor.surface)?,
        };
        actor.pose = object.pose;
        object.coats.map_or(Ok(()), |coats| actor.lay(device, coats))?;
        Ok(actor)
    }

    /// Shows an atlas from now on.
    pub(super) fn set_atlas(&mut self, device: &Device, atlas: &Image<[f32; 3]>) -> Result<(), GpuError> {
        let size = [atlas.width(), atlas.height()];
        if size.contains(&0) || self.atlas.size() != size.map(|side| side as u32) {
            device.check_bytes(atlas::bytes(size))?;
            self.atlas = Atlas::new(device, size)?;
            self.bindings = self.surface.bind(device, &self.atlas);
        }
        self.atlas.upload(device, atlas, 1.0);
        (self.source, self.seen) = (Source::Given, None);
        Ok(())
    }

    /// Lays materials over the mesh, in place of others.
    pub(super) fn lay(&mut self, device: &Device, coats: &Coats<'_>) -> Result<(), GpuError> {
        self.dress = Some(Dress::new(device, &self.surface, coats)?);
        Ok(())
    }

    /// What `camera` shows in the object's coordinates; `None` of an object that stands nowhere.
    pub(super) fn camera(&self, camera: &Camera) -> Option<Camera> {
        Some(self.pose.camera(camera)).filter(|camera| self.pose.scale > 0.0 && is_usable(camera))
    }

    /// Depths in the world below this are not drawn.
    pub(super) fn nearest(&self) -> f64 {
        self.surface.nearest() * self.pose.scale
    }

    /// Bytes of layers or rays that the last frame read.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Takes nothing on the adapter for what it is.
    pub(super) fn forget(&mut self) {
        self.seen = None;
        if let Source::Layers(layers) = &mut self.source {
            layers.forget();
        }
    }

    /// Brings the light and the atlas to what the shot shows.
    pub(super) fn prepare(&mut self, device: &Device, shot: &Shot<'_>, times: &mut StageTimes) -> Result<(), GpuError> {
        self.bytes = 0;
        if let (Some(dress), Some(lighting)) = (&self.dress, shot.lighting) {
            dress.light(device, &self.pose.lighting(lighting), &self.surface.middle())?;
        }
        let eye = self.pose.to_object(&shot.camera.center());
        let is_stale = match (&self.source, &self.seen) {
            (_, None) => true,
            (Source::Given, _) => false,
            (_, Some(seen)) => *seen != eye,
        };
        if is_stale {
            self.blend(device, &eye, times);
        }
        Ok(())
    }

    /// Brings the atlas to what `eye` sees.
    fn blend(&mut self, device: &Device, eye: &Point3<f64>, times: &mut StageTimes) {
        let is_first = self.seen.replace(*eye).is_none();
        let start = Instant::now();
        let mut encoder = device.encoder();
        match &mut self.source {
            Source::Given => {}
            Source::Blended(blended) => {
                blended.blend(eye, &blend::Wanted::all(blended.size(), 0));
                times.weights += start.elapsed();
                self.bytes = blended.bytes();
                if self.bytes == 0 && !is_first {
                    return;
                }
                let start = Instant::now();
                self.atlas.upload(device, blended.texels(), 1.0 / FIXED_ONE);
                times.atlas += start.elapsed();
            }
            Source::Layers(layers) => {
                let is_fresh = !layers.weigh(device, eye);
                times.weights += start.elapsed();
                if is_fresh {
                    return;
                }
                self.bytes = layers.read();
                layers.blend(&mut encoder, &self.atlas);
            }
            Source::Rays(rays) => {
                self.bytes = rays.read();
                rays.look(device, eye);
                rays.blend(&mut encoder, &self.atlas);
            }
        }
        let start = Instant::now();
        self.atlas.reduce(&mut encoder);
        device.queue().submit([encoder.finish()]);
        times.atlas += start.elapsed();
    }

    /// Takes to the adapter how a tile looks at it; `nearest`, in the world, is common to a scene.
    pub(super) fn look(&self, device: &Device, shot: &Shot<'_>, nearest: f64, tile: &Tile) -> bool {
        let Some(camera) = self.camera(shot.camera) else { return false };
        self.surface.look(device, (&camera, nearest / self.pose.scale), &shot.options, tile, &self.atlas);
        true
    }

    /// Draws it as it was last looked at.
    pub(super) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, is_lit: bool) {
        let dress = self.dress.as_ref().filter(|_| is_lit);
        self.surface.draw(pass, &self.bindings, dress.map(|dress| &dress.bare));
        if let Some(dress) = dress {
            dress.draw(pass);
        }
    }
}

#[cfg(test)]
impl Actor<'_> {
    /// Takes the weights away from the driver.
    pub(super) fn break_layers(&self) {
        if let Source::Layers(layers) = &self.source {
            layers.break_weights();
        }
    }
}

impl<'a> Source<'a> {
    fn new(device: &Device, model: &'a Model, blend: Blend, surface: &Surface) -> Result<Self, GpuError> {
        Ok(match (blend, &model.appearance) {
            (Blend::Cpu, _) => Self::Blended(Box::new(blend::Atlas::new(model))),
            (Blend::Adapter, Appearance::Layers(layers)) => Self::Layers(Box::new(LayerBlend::new(device, layers)?)),
            (Blend::Adapter, Appearance::Lumigraph(rays, texels)) => {
                Self::Rays(Box::new(RayBlend::new(device, rays, texels, surface.middle())?))
            }
        })
    }

    /// The same for another eye.
    fn another(&self, device: &Device) -> Result<Self, GpuError> {
        Ok(match self {
            Self::Given => Self::Given,
            Self::Blended(atlas) => Self::Blended(Box::new(atlas.another())),
            Self::Layers(layers) => Self::Layers(Box::new(layers.another(device)?)),
            Self::Rays(rays) => Self::Rays(Box::new(rays.another(device)?)),
        })
    }
}

fn atlas_size(model: &Model) -> [usize; 2] {
    match &model.appearance {
        Appearance::Layers(layers) => [layers.facet_of_texel.width(), layers.facet_of_texel.height()],
        Appearance::Lumigraph(_, surface) => surface.size,
    }
}

/// Bytes of textures that a model takes once, and once more for each object of it.
pub(super) fn bytes(model: &Model, blend: Blend) -> [u64; 2] {
    let own = atlas::bytes(atlas_size(model));
    match (blend, &model.appearance) {
        (Blend::Cpu, _) => [0, own],
        (Blend::Adapter, Appearance::Layers(layers)) => [layers::bytes(layers), own],
        (Blend::Adapter, Appearance::Lumigraph(rays, surface)) => {
            let [shared, fill] = rays::bytes(rays, surface);
            [shared, own + fill]
        }
    }
}
