//! The line below the picture.

use super::{App, style};
use render::window::egui::{Align, Label, Layout, RichText, Ui};

impl App<'_> {
    pub(super) fn status(&self, ui: &mut Ui) {
        let [width, height] = self.stage.size;
        let last = self.viewer.times_ms().last().map(|ms| format!("{ms:.1} ms"));
        let rate = self.stage.frames_per_second().map(|fps| format!("{fps:.0} frames/s"));
        let parts = [Some(self.viewer.device().to_owned()), Some(format!("{width} × {height}")), last, rate];
        let figures: Vec<String> = parts.into_iter().flatten().collect();
        ui.horizontal(|ui| {
            let figures = ui.weak(RichText::new(figures.join("   ·   ")).small());
            let shown = format!("shown by {}", self.adapter);
            let why: Vec<&str> = [Some(shown.as_str()), self.viewer.why_cpu()].into_iter().flatten().collect();
            figures.on_hover_text(why.join("\n"));
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                let message = RichText::new(&self.message).small().color(style::NOTICE);
                ui.add(Label::new(message).truncate());
            });
        });
    }
}
