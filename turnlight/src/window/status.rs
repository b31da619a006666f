//! The line below the picture.

use super::{App, style};
use render::window::egui::{Align, Layout, RichText, Ui};

impl App<'_> {
    pub(super) fn status(&self, ui: &mut Ui) {
        let [width, height] = self.stage.size;
        let last = self.viewer.times_ms().last().map(|ms| format!("{ms:.1} ms"));
        let rate = self.stage.frames_per_second().map(|fps| format!("{fps:.0} frames/s"));
        let figures = [Some(format!("{width} × {height}")), last, rate];
        let device = format!("drawn by {}", self.viewer.device());
        let parts: Vec<String> =
            [Some(device), Some(format!("shown by {}", self.adapter))].into_iter().chain(figures).flatten().collect();
        ui.horizontal(|ui| {
            ui.weak(RichText::new(parts.join("   ·   ")).small());
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                ui.label(RichText::new(&self.message).small().color(style::NOTICE));
            });
        });
    }
}
