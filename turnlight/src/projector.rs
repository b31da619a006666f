//! Who draws a scene's frames: graphics hardware where it is there and able, the CPU otherwise.

use crate::scene::Scene;
use crate::{Error, playback};
use capture::{Camera, Image};
use render::RenderOptions;
use render::backdrop::put_behind;
use render::blend::Pin;
use render::cpu::ScenePlayer;
#[cfg(feature = "gpu")]
use render::gpu;
use render::material::{Coats, Lighting};
#[cfg(feature = "gpu")]
use std::sync::{Arc, OnceLock};

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

/// Who draws, for any number of scenes: hardware is looked for when it is first needed, and once.
#[derive(Clone, Debug)]
pub struct Painter {
    #[cfg(feature = "gpu")]
    choice: Choice,
    #[cfg(feature = "gpu")]
    device: Arc<OnceLock<Result<gpu::Device, gpu::GpuError>>>,
}

/// Draws the frames of a scene; whoever draws it, the picture is the same within a level nearly everywhere.
#[derive(Debug)]
pub struct Projector<'a> {
    scene: &'a Scene,
    coats: &'a [Option<Coats<'a>>],
    options: RenderOptions,
    /// The CPU's; made once it draws, for it lays out all the models' layers.
    player: Option<ScenePlayer<'a>>,
    /// Objects some of whose weights are held fast, which the CPU alone can do.
    pinned: Vec<usize>,
    #[cfg(feature = "gpu")]
    hardware: Hardware<'a>,
    /// What the CPU is called.
    cpu: String,
    note: Option<String>,
}

/// Graphics hardware, and whether a scene is on it.
#[cfg(feature = "gpu")]
#[derive(Debug)]
enum Hardware<'a> {
    /// Not before the first frame.
    Expected(Painter),
    Ready {
        renderer: Box<gpu::Renderer<'a>>,
        name: String,
    },
    /// The CPU draws.
    None,
}

impl Painter {
    /// As chosen.
    ///
    /// # Errors
    /// [`Error::Arguments`] where graphics hardware is asked for in a build without.
    pub fn new(choice: Choice) -> Result<Self, Error> {
        if choice == Choice::Gpu && !cfg!(feature = "gpu") {
            return Err(Error::Arguments(
                "this turnlight was built without graphics hardware; let the CPU draw, or build it with --features gpu"
                    .to_owned(),
            ));
        }
        Ok(Self {
            #[cfg(feature = "gpu")]
            choice,
            #[cfg(feature = "gpu")]
            device: Arc::default(),
        })
    }

    #[cfg(feature = "gpu")]
    fn device(&self) -> Result<gpu::Device, gpu::GpuError> {
        let found = || {
            let device = gpu::Device::headless()?;
            if self.choice == Choice::Auto && device.is_software() {
                let fault = format!("{} is itself a program on the CPU", device.name());
                return Err(gpu::GpuError::NoAdapter { fault });
            }
            Ok(device)
        };
        self.device.get_or_init(found).clone()
    }
}

impl<'a> Projector<'a> {
    /// A projector of `scene`, with the materials that were laid over its models.
    #[cfg_attr(not(feature = "gpu"), expect(unused_variables, reason = "without hardware there is one who draws"))]
    pub fn new(scene: &'a Scene, coats: &'a [Option<Coats<'a>>], options: RenderOptions, painter: &Painter) -> Self {
        Self {
            scene,
            coats,
            options,
            player: None,
            pinned: Vec::new(),
            #[cfg(feature = "gpu")]
            hardware: match painter.choice {
                Choice::Cpu => Hardware::None,
                Choice::Auto | Choice::Gpu => Hardware::Expected(painter.clone()),
            },
            cpu: format!("cpu, {} threads", rayon::current_num_threads()),
            note: None,
        }
    }

    /// What drew the last frame, in a few words; before the first the CPU.
    pub fn device(&self) -> &str {
        #[cfg(feature = "gpu")]
        if let (Hardware::Ready { name, .. }, true) = (&self.hardware, self.pinned.is_empty()) {
            return name;
        }
        &self.cpu
    }

    /// What the user should know, once: why the CPU draws although it was not asked to.
    pub fn take_note(&mut self) -> Option<String> {
        self.note.take()
    }

    /// Holds weights of the layers of one object of the scene fast, until other `pins` take their place.
    pub fn pin(&mut self, object: usize, pins: &[Pin]) {
        self.pinned.retain(|&other| other != object);
        if !pins.is_empty() {
            self.pinned.push(object);
            self.player().pin(object, pins);
        } else if let Some(player) = &mut self.player {
            player.pin(object, pins);
        }
    }

    /// Draws one frame, with the scene's backdrop: RGBA, 8 bit encoded, not premultiplied, alpha the coverage of the pixel.
    pub fn frame(&mut self, camera: &Camera, lighting: &Lighting) -> Image<[u8; 4]> {
        let mut frame = self.objects(camera, lighting);
        if let Some(backdrop) = &self.scene.backdrop {
            put_behind(&mut frame, backdrop, camera);
        }
        frame
    }

    fn objects(&mut self, camera: &Camera, lighting: &Lighting) -> Image<[u8; 4]> {
        #[cfg(feature = "gpu")]
        if let Some(frame) = self.frame_of_hardware(camera, lighting) {
            return frame;
        }
        self.player().render(camera, lighting)
    }

    fn player(&mut self) -> &mut ScenePlayer<'a> {
        let Self { scene, coats, options, .. } = *self;
        self.player.get_or_insert_with(|| ScenePlayer::new(&playback::objects(scene, coats), options))
    }
}

#[cfg(feature = "gpu")]
impl Projector<'_> {
    /// `None` where the CPU is to draw; after a fault it draws the rest, too.
    fn frame_of_hardware(&mut self, camera: &Camera, lighting: &Lighting) -> Option<Image<[u8; 4]>> {
        if !self.pinned.is_empty() {
            return None;
        }
        let shot = gpu::Shot { camera, lighting: Some(lighting), options: self.options };
        match self.renderer().and_then(|renderer| renderer.map(|renderer| renderer.render(&shot)).transpose()) {
            Ok(frame) => frame,
            Err(fault) => {
                self.hardware = Hardware::None;
                self.note = Some(format!("the CPU draws: {fault}"));
                None
            }
        }
    }
}

#[cfg(feature = "gpu")]
impl<'a> Projector<'a> {
    /// The hardware's, which gets the scene when it first draws.
    fn renderer(&mut self) -> Result<Option<&mut gpu::Renderer<'a>>, gpu::GpuError> {
        if let Hardware::Expected(painter) = &self.hardware {
            let device = painter.device()?;
            let objects = playback::objects(self.scene, self.coats);
            let renderer = Box::new(gpu::Renderer::of_scene(&device, &objects, gpu::Blend::fastest(&device))?);
            self.hardware = Hardware::Ready { renderer, name: format!("gpu, {}", device.name()) };
        }
        Ok(match &mut self.hardware {
            Hardware::Ready { renderer, .. } => Some(renderer),
            Hardware::Expected(_) | Hardware::None => None,
        })
    }
}
