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
    hardware: Option<Hardware<'a>>,
    /// What the CPU is called.
    cpu: String,
    note: Option<String>,
}

/// Graphics hardware, with a scene on it.
#[cfg(feature = "gpu")]
#[derive(Debug)]
struct Hardware<'a> {
    renderer: gpu::Renderer<'a>,
    options: RenderOptions,
    name: String,
}

impl<'a> Projector<'a> {
    /// A projector of `scene`, with the materials that were laid over its models.
    ///
    /// # Errors
    /// [`Error::Arguments`] where graphics hardware is asked for in a build without.
    pub fn new(
        scene: &'a Scene,
        coats: &'a [Option<Coats<'a>>],
        options: RenderOptions,
        choice: Choice,
    ) -> Result<Self, Error> {
        if choice == Choice::Gpu && !cfg!(feature = "gpu") {
            return Err(Error::Arguments(
                "this turnlight was built without graphics hardware; let the CPU draw, or build it with --features gpu"
                    .to_owned(),
            ));
        }
        let projector = Self {
            scene,
            coats,
            options,
            player: None,
            pinned: Vec::new(),
            #[cfg(feature = "gpu")]
            hardware: None,
            cpu: format!("cpu, {} threads", rayon::current_num_threads()),
            note: None,
        };
        #[cfg(feature = "gpu")]
        let projector = match choice {
            Choice::Cpu => projector,
            _ => projector.handed_over(Hardware::new(scene, coats, options, choice)),
        };
        Ok(projector)
    }

    /// What draws, in a few words.
    pub fn device(&self) -> &str {
        #[cfg(feature = "gpu")]
        if let Some(hardware) = self.hardware.as_ref().filter(|_| self.pinned.is_empty()) {
            return &hardware.name;
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
impl<'a> Projector<'a> {
    fn handed_over(self, found: Result<Hardware<'a>, gpu::GpuError>) -> Self {
        match found {
            Ok(hardware) => Self { hardware: Some(hardware), ..self },
            Err(fault) => Self { note: Some(format!("the CPU draws: {fault}")), ..self },
        }
    }

    /// `None` where the CPU is to draw; after a fault it draws the rest, too.
    fn frame_of_hardware(&mut self, camera: &Camera, lighting: &Lighting) -> Option<Image<[u8; 4]>> {
        let hardware = self.hardware.as_mut().filter(|_| self.pinned.is_empty());
        match hardware?.frame(camera, lighting) {
            Ok(frame) => Some(frame),
            Err(fault) => {
                self.hardware = None;
                self.note = Some(format!("the CPU draws: {fault}"));
                None
            }
        }
    }
}

#[cfg(feature = "gpu")]
impl<'a> Hardware<'a> {
    fn new(
        scene: &'a Scene,
        coats: &'a [Option<Coats<'a>>],
        options: RenderOptions,
        choice: Choice,
    ) -> Result<Self, gpu::GpuError> {
        let device = gpu::Device::headless()?;
        if choice == Choice::Auto && device.is_software() {
            let fault = format!("{} is itself a program on the CPU", device.name());
            return Err(gpu::GpuError::NoAdapter { fault });
        }
        let objects = playback::objects(scene, coats);
        let renderer = gpu::Renderer::of_scene(&device, &objects, gpu::Blend::fastest(&device))?;
        Ok(Self { renderer, options, name: format!("gpu, {}", device.name()) })
    }

    fn frame(&mut self, camera: &Camera, lighting: &Lighting) -> Result<Image<[u8; 4]>, gpu::GpuError> {
        self.renderer.render(&gpu::Shot { camera, lighting: Some(lighting), options: self.options })
    }
}
