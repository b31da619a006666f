//! The system's events, handed to egui and on to a [`Show`].

use super::WindowError;
use super::screen::Screen;
use egui_winit::egui::{Context, Ui, ViewportCommand, ViewportId, ViewportInfo};
use std::fmt::Display;
use std::sync::Arc;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::dpi::LogicalSize;
use winit::error::EventLoopError;
use winit::event::{StartCause, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::window::{Window, WindowId};

/// Later than this is never.
const NEVER: Duration = Duration::from_secs(3600);

/// While nothing can be shown, as in a window that is hidden, it is tried again after this.
const RETRY: Duration = Duration::from_millis(100);

/// What a window shows.
pub trait Show {
    /// The window is open; `adapter` is the name of what draws on the screen.
    fn opened(&mut self, context: &Context, adapter: &str);

    /// Lays out the next frame on `ui`, the whole window, and answers what was done in it. Who moves asks the context to
    /// repaint, who is done sends it [`ViewportCommand::Close`].
    fn draw(&mut self, ui: &mut Ui);
}

/// How a window opens.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WindowOptions {
    /// What its frame says.
    pub title: String,
    /// Width and height in points: pixels times what the system scales by.
    pub size: [usize; 2],
}

/// Opens a window and answers it until it is closed.
///
/// # Errors
/// [`WindowError`] where there is no display, or nothing draws on it.
pub fn open(options: &WindowOptions, show: &mut dyn Show) -> Result<(), WindowError> {
    let no_display = |fault: EventLoopError| WindowError::NoDisplay { fault: in_words(&fault) };
    let events = EventLoop::new().map_err(no_display)?;
    let mut host = Host { options, show, open: None, fault: None };
    events.run_app(&mut host).map_err(no_display)?;
    host.fault.map_or(Ok(()), Err)
}

/// What the system said, without the line of winit's source that passed it on.
fn in_words(fault: &impl Display) -> String {
    let text = fault.to_string();
    let words = text.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": ")).map(|(_, words)| words);
    words.unwrap_or(&text).trim_end_matches('.').to_owned()
}

struct Host<'a> {
    options: &'a WindowOptions,
    show: &'a mut dyn Show,
    open: Option<Open>,
    fault: Option<WindowError>,
}

/// What there is once there is a window.
struct Open {
    window: Arc<Window>,
    screen: Screen,
    egui: egui_winit::State,
    info: ViewportInfo,
}

impl Open {
    fn new(options: &WindowOptions, events: &ActiveEventLoop) -> Result<Self, WindowError> {
        let [width, height] = options.size.map(|side| side as f64);
        let attributes = Window::default_attributes()
            .with_title(options.title.clone())
            .with_inner_size(LogicalSize::new(width, height))
            .with_min_inner_size(LogicalSize::new(320.0, 240.0));
        let window = events.create_window(attributes).map_err(|e| WindowError::NoDisplay { fault: in_words(&e) })?;
        let window = Arc::new(window);
        let screen = Screen::new(&window, events)?;
        let context = Context::default();
        // What is drawn is drawn once.
        context.options_mut(|o| o.max_passes = std::num::NonZeroUsize::MIN);
        let (scale, longest) = (window.scale_factor() as f32, screen.longest_side());
        let egui = egui_winit::State::new(context, ViewportId::ROOT, &*window, Some(scale), None, Some(longest));
        Ok(Self { window, screen, egui, info: ViewportInfo::default() })
    }

    /// Draws a frame. Tells when the next one is due; `None` where the window is to close.
    fn draw(&mut self, show: &mut dyn Show) -> Result<Option<Duration>, WindowError> {
        let input = self.egui.take_egui_input(&self.window);
        let context = self.egui.egui_ctx().clone();
        let output = context.run_ui(input, |ui| show.draw(ui));
        self.egui.handle_platform_output(&self.window, output.platform_output);
        let primitives = context.tessellate(output.shapes, output.pixels_per_point);
        let is_shown = self.screen.paint(&primitives, output.textures_delta, output.pixels_per_point)?;
        let mut wait = if is_shown { NEVER } else { RETRY };
        for view in output.viewport_output.into_values() {
            if view.commands.contains(&ViewportCommand::Close) {
                return Ok(None);
            }
            let actions = &mut Vec::new();
            egui_winit::process_viewport_commands(&context, &mut self.info, view.commands, &self.window, actions);
            wait = if is_shown { wait.min(view.repaint_delay) } else { wait };
        }
        Ok(Some(wait))
    }
}

impl Host<'_> {
    fn end(&mut self, events: &ActiveEventLoop, fault: Option<WindowError>) {
        self.fault = fault;
        events.exit();
    }

    fn draw(&mut self, events: &ActiveEventLoop) {
        let Some(open) = &mut self.open else { return };
        match open.draw(self.show) {
            Ok(Some(Duration::ZERO)) => {
                open.window.request_redraw();
                events.set_control_flow(ControlFlow::Wait);
            }
            Ok(Some(wait)) if wait < NEVER => {
                events.set_control_flow(ControlFlow::WaitUntil(Instant::now() + wait));
            }
            Ok(Some(_)) => events.set_control_flow(ControlFlow::Wait),
            Ok(None) => self.end(events, None),
            Err(fault) => self.end(events, Some(fault)),
        }
    }
}

impl ApplicationHandler for Host<'_> {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.open.is_some() {
            return;
        }
        match Open::new(self.options, events) {
            Ok(open) => {
                self.show.opened(open.egui.egui_ctx(), open.screen.adapter());
                open.window.request_redraw();
                self.open = Some(open);
            }
            Err(fault) => self.end(events, Some(fault)),
        }
    }

    fn new_events(&mut self, _: &ActiveEventLoop, cause: StartCause) {
        if let (StartCause::ResumeTimeReached { .. }, Some(open)) = (cause, &self.open) {
            open.window.request_redraw();
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        match event {
            WindowEvent::RedrawRequested => return self.draw(events),
            WindowEvent::CloseRequested => return self.end(events, None),
            WindowEvent::Resized(size) => {
                if let Err(fault) = open.screen.resize([size.width, size.height]) {
                    return self.end(events, Some(fault));
                }
            }
            _ => {}
        }
        if open.egui.on_window_event(&open.window, &event).repaint {
            open.window.request_redraw();
        }
    }
}
