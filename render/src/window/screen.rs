//! The adapter behind a window: takes egui's triangles and textures, shows them.

use super::WindowError;
use crate::gpu::Device;
use egui_wgpu::{Renderer, RendererOptions, ScreenDescriptor, preferred_framebuffer_format};
use egui_winit::egui::{ClippedPrimitive, TexturesDelta};
use pollster::block_on;
use std::sync::Arc;
use wgpu::CurrentSurfaceTexture as Current;
use winit::event_loop::ActiveEventLoop;
use winit::window::Window;

pub(super) struct Screen {
    instance: wgpu::Instance,
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    device: Device,
    renderer: Renderer,
    /// Longest side of a surface or texture, in pixels.
    longest: u32,
}

impl Screen {
    pub(super) fn new(window: &Arc<Window>, events: &ActiveEventLoop) -> Result<Self, WindowError> {
        let none = |fault: String| WindowError::NoAdapter { fault };
        let display = Box::new(events.owned_display_handle());
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_with_display_handle_from_env(display));
        let surface = instance.create_surface(Arc::clone(window)).map_err(|e| none(e.to_string()))?;
        let options = wgpu::RequestAdapterOptions {
            compatible_surface: Some(&surface),
            ..wgpu::RequestAdapterOptions::default()
        };
        let adapter = block_on(instance.request_adapter(&options)).map_err(|e| none(e.to_string()))?;
        let limits = adapter.limits();
        let longest = limits.max_texture_dimension_2d;
        let descriptor = wgpu::DeviceDescriptor { required_limits: limits, ..wgpu::DeviceDescriptor::default() };
        let (device, queue) = block_on(adapter.request_device(&descriptor)).map_err(|e| none(e.to_string()))?;
        let device = Device::from_wgpu(device, queue);
        let unsupported = || none(format!("{} knows no format of this screen", device.name()));
        let mut config = surface.get_default_config(&adapter, 1, 1).ok_or_else(unsupported)?;
        let formats = surface.get_capabilities(&adapter).formats;
        config.format = preferred_framebuffer_format(&formats).map_err(|e| none(e.to_string()))?;
        config.present_mode = wgpu::PresentMode::AutoVsync;
        // A dithered picture would not be the picture.
        let options = RendererOptions { dithering: false, ..RendererOptions::default() };
        let renderer = Renderer::new(device.wgpu(), config.format, options);
        let window = Arc::clone(window);
        let size = window.inner_size();
        let mut screen = Self { instance, window, surface, config, device, renderer, longest };
        screen.resize([size.width, size.height])?;
        Ok(screen)
    }

    pub(super) fn adapter(&self) -> &str {
        self.device.name()
    }

    pub(super) fn longest_side(&self) -> usize {
        self.longest as usize
    }

    /// Of a window without area the last size stays.
    pub(super) fn resize(&mut self, size: [u32; 2]) -> Result<(), WindowError> {
        let [width, height] = size.map(|side| side.min(self.longest));
        if width == 0 || height == 0 {
            return Ok(());
        }
        (self.config.width, self.config.height) = (width, height);
        self.guarded(|screen| screen.surface.configure(screen.device.wgpu(), &screen.config))
    }

    /// Shows a frame; `false` where the system has no room for it just now. Changes of textures are taken either way.
    pub(super) fn paint(
        &mut self,
        primitives: &[ClippedPrimitive],
        textures: TexturesDelta,
        pixels_per_point: f32,
    ) -> Result<bool, WindowError> {
        let size_in_pixels = [self.config.width, self.config.height];
        let descriptor = ScreenDescriptor { size_in_pixels, pixels_per_point };
        let shown = self.guarded(|screen| screen.draw(primitives, textures, &descriptor))?;
        if shown == Shown::Lost {
            let surface = self.instance.create_surface(Arc::clone(&self.window));
            self.surface = surface.map_err(|e| WindowError::NoAdapter { fault: e.to_string() })?;
        }
        if matches!(shown, Shown::Outdated | Shown::Lost) {
            self.guarded(|screen| screen.surface.configure(screen.device.wgpu(), &screen.config))?;
        }
        Ok(shown == Shown::Whole)
    }

    fn draw(&mut self, primitives: &[ClippedPrimitive], mut textures: TexturesDelta, to: &ScreenDescriptor) -> Shown {
        let (device, queue) = (self.device.wgpu(), self.device.queue());
        #[allow(clippy::iter_over_hash_type, reason = "each texture takes its own changes")]
        for (id, changes) in textures.set.drain() {
            changes.iter().for_each(|change| self.renderer.update_texture(device, queue, id, change));
        }
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut commands = self.renderer.update_buffers(device, queue, &mut encoder, primitives, to);
        let (frame, shown) = match self.surface.get_current_texture() {
            Current::Success(frame) => (Some(frame), Shown::Whole),
            Current::Suboptimal(frame) => (Some(frame), Shown::Whole),
            Current::Outdated => (None, Shown::Outdated),
            Current::Lost => (None, Shown::Lost),
            Current::Timeout | Current::Occluded | Current::Validation => (None, Shown::Hidden),
        };
        if let Some(frame) = &frame {
            self.fill(&frame.texture, &mut encoder, primitives, to);
        }
        commands.push(encoder.finish());
        queue.submit(commands);
        if let Some(frame) = frame {
            queue.present(frame);
        }
        #[allow(clippy::iter_over_hash_type, reason = "each texture goes for itself")]
        for id in textures.free.drain() {
            self.renderer.free_texture(&id);
        }
        shown
    }

    fn fill(
        &self,
        target: &wgpu::Texture,
        encoder: &mut wgpu::CommandEncoder,
        primitives: &[ClippedPrimitive],
        to: &ScreenDescriptor,
    ) {
        let view = target.create_view(&wgpu::TextureViewDescriptor::default());
        let ops = wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Store };
        let attachment = wgpu::RenderPassColorAttachment { view: &view, depth_slice: None, resolve_target: None, ops };
        let color_attachments = &[Some(attachment)];
        let descriptor = wgpu::RenderPassDescriptor { color_attachments, ..wgpu::RenderPassDescriptor::default() };
        let mut pass = encoder.begin_render_pass(&descriptor).forget_lifetime();
        self.renderer.render(&mut pass, primitives, to);
    }

    /// What the driver finds fault with becomes an error instead of a panic.
    fn guarded<T>(&mut self, work: impl FnOnce(&mut Self) -> T) -> Result<T, WindowError> {
        let device = self.device.clone();
        let fault = |e: crate::gpu::GpuError| {
            let adapter = device.name().to_owned();
            WindowError::Driver { adapter, fault: e.to_string() }
        };
        device.guarded(|| Ok(work(self))).map_err(fault)
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Shown {
    Whole,
    /// Of another size than the window now.
    Outdated,
    /// The surface alone is gone: it takes another one.
    Lost,
    Hidden,
}
