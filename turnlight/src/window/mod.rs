//! The window of `turnlight view`: widgets around a [`Viewer`] (feature `window`).
//!
//! Each file lays out one part and hands what was done in it to the viewer, which makes every picture.

mod basis;
mod capture;
mod directions;
mod facets;
mod keys;
mod light;
mod look;
mod recorder;
mod stage;
mod status;
mod style;
mod times;

use crate::Error;
use crate::viewer::{Panel, Viewer};
use basis::Thumbnails;
use recorder::Recorder;
use render::window::egui::{
    self, CentralPanel, CollapsingHeader, Context, Frame, RichText, ScrollArea, Separator, Ui, ViewportCommand,
};
use render::window::{Show, open};
use stage::Stage;
use std::path::PathBuf;

/// How the window opens.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WindowOptions {
    /// What pictures and turns are named by, and what the window's frame says.
    pub name: String,
    /// Width and height, in points.
    pub size: [usize; 2],
    /// Panels that are unfolded.
    pub panels: Vec<Panel>,
    /// Whether there is anything but the picture to begin with.
    pub has_panels: bool,
    /// Write the first picture here and close.
    pub screenshot: Option<PathBuf>,
}

/// Width of the panels, in points.
const PANELS_WIDTH: f32 = 316.0;

/// Height of a line between them.
const SEPARATION: f32 = 2.0;

/// Shows what `viewer` sees until the window is closed.
///
/// # Errors
/// Where no window can be opened; where the picture that [`WindowOptions::screenshot`] asks for cannot be written.
pub fn show(viewer: Viewer<'_>, options: &WindowOptions) -> Result<(), Error> {
    let title = format!("{} · Turnlight", options.name);
    let mut app = App::new(viewer, options);
    open(&render::window::WindowOptions { title, size: options.size }, &mut app)?;
    app.recorder.finish()
}

/// The window's state beside the viewer's.
struct App<'a> {
    viewer: Viewer<'a>,
    panels: Vec<Panel>,
    has_panels: bool,
    /// What puts things on the screen.
    adapter: String,
    stage: Stage,
    thumbnails: Thumbnails,
    recorder: Recorder,
    is_spinning: bool,
    message: String,
}

impl Show for App<'_> {
    fn opened(&mut self, context: &Context, adapter: &str) {
        style::apply(context);
        self.adapter = adapter.to_owned();
    }

    fn draw(&mut self, ui: &mut Ui) {
        self.keys(ui.ctx());
        if self.has_panels {
            let status = Frame::new().fill(style::PANEL).inner_margin(egui::Margin::symmetric(12, 5));
            egui::Panel::bottom("status").frame(status).show(ui, |ui| self.status(ui));
            let frame = Frame::new().fill(style::PANEL).inner_margin(style::MARGIN);
            let panels = egui::Panel::right("panels").frame(frame).resizable(false).exact_size(PANELS_WIDTH);
            panels.show(ui, |ui| ScrollArea::vertical().auto_shrink(false).show(ui, |ui| self.panels(ui)));
        }
        let stage = Frame::new().fill(style::BACKGROUND);
        CentralPanel::default().frame(stage).show(ui, |ui| self.stage(ui));
        if let Some(note) = self.viewer.take_notes().pop() {
            self.message = note;
        }
        if let Some(message) = self.recorder.advance(&mut self.viewer, self.stage.size) {
            self.message = message;
        }
        if self.recorder.is_busy() {
            ui.ctx().request_repaint();
        }
        if self.recorder.is_done() {
            ui.ctx().send_viewport_cmd(ViewportCommand::Close);
        }
    }
}

impl<'a> App<'a> {
    fn new(viewer: Viewer<'a>, options: &WindowOptions) -> Self {
        Self {
            viewer,
            panels: options.panels.clone(),
            has_panels: options.has_panels,
            adapter: String::new(),
            stage: Stage::default(),
            thumbnails: Thumbnails::default(),
            recorder: Recorder::new(options.name.clone(), options.screenshot.clone()),
            is_spinning: false,
            message: String::new(),
        }
    }
}

impl App<'_> {
    fn panels(&mut self, ui: &mut Ui) {
        self.look(ui);
        for panel in Panel::ALL {
            let title = match panel {
                Panel::Facets => "Facets and ranks",
                Panel::Directions => "View directions",
                Panel::Basis => "Basis",
                Panel::Light if self.viewer.has_materials() => "Light",
                Panel::Light => continue,
                Panel::Capture => "Photographs",
                Panel::Times => "Frame times",
                Panel::Keys => "Keys",
            };
            ui.add(Separator::default().spacing(SEPARATION));
            let is_open = self.panels.contains(&panel);
            let header = CollapsingHeader::new(RichText::new(title).strong()).id_salt(panel.name()).open(Some(is_open));
            let answer = header.show_unindented(ui, |ui| self.panel(ui, panel));
            if answer.header_response.clicked() {
                self.toggle(panel);
            }
        }
        ui.add(Separator::default().spacing(SEPARATION));
        self.files(ui);
    }

    fn panel(&mut self, ui: &mut Ui, panel: Panel) {
        match panel {
            Panel::Facets => self.facets(ui),
            Panel::Directions => self.directions(ui),
            Panel::Basis => self.basis(ui),
            Panel::Light => self.light(ui),
            Panel::Capture => self.capture(ui),
            Panel::Times => self.times(ui),
            Panel::Keys => keys::table(ui),
        }
    }

    fn toggle(&mut self, panel: Panel) {
        let before = self.panels.len();
        self.panels.retain(|open| *open != panel);
        if self.panels.len() == before {
            self.panels.push(panel);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::object::bumpy_ball;
    use crate::projector::Choice;
    use crate::scene::Scene;
    use crate::viewer::{Exhibit, ViewerOptions};
    use render::window::egui::{FullOutput, Pos2, RawInput, Rect, Shape, Vec2};

    /// All that is written in a frame.
    fn written(context: &Context, lay_out: impl FnMut(&mut Ui)) -> String {
        let screen = Rect::from_min_size(Pos2::ZERO, Vec2::new(800.0, 2600.0));
        let input = RawInput { screen_rect: Some(screen), max_texture_side: Some(4096), ..RawInput::default() };
        let FullOutput { shapes, mut textures_delta, .. } = context.run_ui(input, lay_out);
        // Nobody shows them.
        textures_delta.clear();
        let mut texts = String::new();
        shapes.iter().for_each(|clipped| read(&clipped.shape, &mut texts));
        texts
    }

    fn read(shape: &Shape, texts: &mut String) {
        match shape {
            Shape::Text(text) => texts.extend([text.galley.text(), "\n"]),
            Shape::Vec(shapes) => shapes.iter().for_each(|shape| read(shape, texts)),
            _ => {}
        }
    }

    #[test]
    fn every_panel_is_laid_out_without_a_screen() {
        let exhibits = [Exhibit::new("ball".to_owned(), Scene::of(bumpy_ball(1)))];
        let options = ViewerOptions { renderer: Choice::Cpu, ..ViewerOptions::default() };
        let coats = [vec![None]];
        let viewer = Viewer::new(&exhibits, &coats, options).unwrap();
        let panels = Panel::ALL.to_vec();
        let options =
            WindowOptions { name: "ball".to_owned(), size: [800, 2600], panels, has_panels: true, screenshot: None };
        let (mut app, context) = (App::new(viewer, &options), Context::default());
        app.opened(&context, "nothing");
        // Panels unfold in a few frames, and the first knows neither the size of the picture nor how long it takes.
        let texts = (0..30).map(|_| written(&context, |ui| app.draw(ui))).last().unwrap_or_default();
        let titles = ["Facets and ranks", "View directions", "Basis", "Photographs", "Frame times", "Keys"];
        let contents = ["20 layers", "directions", "layer 19", "--capture", "60 a second", "Space", "cpu, "];
        for word in titles.iter().chain(&contents) {
            assert!(texts.contains(word), "nothing says '{word}' in {texts}");
        }
        assert!(!texts.contains("with the eye"), "light without materials");
        assert!(written(&context, |ui| app.panel(ui, Panel::Light)).contains("with the eye"));
        app.panels.clear();
        let folded = (0..30).map(|_| written(&context, |ui| app.draw(ui))).last().unwrap_or_default();
        assert!(titles.iter().all(|title| folded.contains(title)) && !folded.contains("--capture"), "{folded}");
    }
}
