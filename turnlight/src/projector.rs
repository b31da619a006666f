//! Who draws a model's frames: graphics hardware where it is there and able, the CPU otherwise.

use crate::{Error, playback};
use capture::{Camera, Image};
use render::cpu::Player;
#[cfg(feature = "gpu")]
use render::gpu;
use render::material::{Coats, Lighting, Lit};
use texture::Model;

/// Who is to draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// Graphics hardware; the CPU where there is none, or none but a program that stands in for it.
    #[default]
    Auto,
    /// The CPU.
    Cpu,
    /// Whatever adapter there is; the CPU where there is none.
    Gpu,
}

/// Draws the frames of one model as every report does ([`playback`]); the picture is the same whoever draws it.
#[derive(Debug)]
pub struct Projector<'a> {
    model: &'a Model,
    coats: Option<&'a Coats<'a>>,
    player: Player<'a>,
    #[cfg(feature = "gpu")]
    renderer: Option<gpu::Renderer<'a>>,
    device: String,
    note: Option<String>,
}

impl<'a> Projector<'a> {
    /// A projector of `model`, with materials that were laid over it.
    ///
    /// # Errors
    /// [`Error::Arguments`] where graphics hardware is asked for in a build without.
    pub fn new(model: &'a Model, coats: Option<&'a Coats<'a>>, choice: Choice) -> Result<Self, Error> {
        if choice == Choice::Gpu && !cfg!(feature = "gpu") {
            return Err(Error::Arguments(
                "this turnlight was built without graphics hardware; let the CPU draw, or build it with --features gpu"
                    .to_owned(),
            ));
        }
        let projector = Self {
            model,
            coats,
            player: playback::player(model),
            #[cfg(feature = "gpu")]
            renderer: None,
            device: format!("cpu, {} threads", rayon::current_num_threads()),
            note: None,
        };
        Ok(projector.with_adapter(choice))
    }

    /// What draws, in a few words.
    pub fn device(&self) -> &str {
        &self.device
    }

    /// What the user should know, once: why the CPU draws although it was not asked to.
    pub fn take_note(&mut self) -> Option<String> {
        self.note.take()
    }

    /// Draws one frame: RGBA, 8 bit encoded, not premultiplied, alpha the coverage of the pixel.
    pub fn frame(&mut self, camera: &Camera, lighting: &Lighting) -> Image<[u8; 4]> {
        self.frame_of_adapter(camera, lighting).unwrap_or_else(|| {
            let atlas = self.model.atlas(&camera.center());
            match self.coats {
                None => self.player.render(&atlas, camera),
                Some(coats) => self.player.render_lit(&atlas, &Lit { coats, lighting }, camera),
            }
        })
    }

    #[cfg(feature = "gpu")]
    fn with_adapter(mut self, choice: Choice) -> Self {
        if choice == Choice::Cpu {
            return self;
        }
        match self.renderer_for(choice) {
            Ok((renderer, name)) => {
                self.renderer = Some(renderer);
                self.device = format!("gpu, {name}");
            }
            Err(fault) => self.note = Some(format!("the CPU draws: {fault}")),
        }
        self
    }

    #[cfg(feature = "gpu")]
    fn renderer_for(&self, choice: Choice) -> Result<(gpu::Renderer<'a>, String), gpu::GpuError> {
        let device = gpu::Device::headless()?;
        if choice == Choice::Auto && device.is_software() {
            let fault = format!("{} is itself a program on the CPU", device.name());
            return Err(gpu::GpuError::NoAdapter { fault });
        }
        let mut renderer = gpu::Renderer::new(&device, self.model)?;
        self.coats.map_or(Ok(()), |coats| renderer.lay(coats))?;
        Ok((renderer, device.name().to_owned()))
    }

    /// `None` where the CPU is to draw; after a fault it draws the rest, too.
    #[cfg(feature = "gpu")]
    fn frame_of_adapter(&mut self, camera: &Camera, lighting: &Lighting) -> Option<Image<[u8; 4]>> {
        let lighting = self.coats.map(|_| lighting);
        let shot = gpu::Shot { camera, lighting, options: playback::OPTIONS };
        match self.renderer.as_mut()?.render(&shot) {
            Ok(frame) => Some(frame),
            Err(fault) => {
                self.renderer = None;
                self.device = format!("cpu, {} threads", rayon::current_num_threads());
                self.note = Some(format!("the CPU draws: {fault}"));
                None
            }
        }
    }

    #[cfg(not(feature = "gpu"))]
    fn with_adapter(self, _: Choice) -> Self {
        self
    }

    #[cfg(not(feature = "gpu"))]
    fn frame_of_adapter(&mut self, _: &Camera, _: &Lighting) -> Option<Image<[u8; 4]>> {
        None
    }
}
