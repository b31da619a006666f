//! The photograph nearest to the eye, and how far the model is from it.

use super::App;
use super::facets::ramp;
use crate::viewer::difference::FULL;
use crate::viewer::{Side, false_colour};
use render::window::egui::{RichText, Ui};

impl App<'_> {
    pub(super) fn capture(&mut self, ui: &mut Ui) {
        let camera = self.viewer.camera(self.stage.size);
        let nearest = self.viewer.nearest_photograph(&camera);
        let (Some(photographs), Some(nearest)) = (self.viewer.photographs(), nearest) else {
            ui.weak("Name the photographs with --capture.");
            return;
        };
        let count = photographs.len();
        let is_there = self.viewer.visited().is_some();
        let place = format!("{}, {} of {count}", photographs.name(nearest), nearest + 1);
        ui.label(if is_there { format!("At {place}") } else { format!("Nearest: {place}") });
        ui.horizontal(|ui| {
            if ui.button("Go there").clicked() {
                self.visit(nearest);
            }
            if ui.button("Previous").clicked() {
                self.visit((nearest + count - 1) % count);
            }
            if ui.button("Next").clicked() {
                self.visit((nearest + 1) % count);
            }
        });
        let current = self.viewer.current();
        ui.horizontal(|ui| {
            for (text, side) in [
                ("Appearance", Side::Method(current)),
                ("Photograph", Side::Photograph),
                ("Difference", Side::Difference(current)),
            ] {
                ui.selectable_value(&mut self.viewer.left, side, text);
            }
        });
        let figures = match self.viewer.difference(current, &camera) {
            Some(Ok((_, found))) => {
                format!("mean {:.2} %, root mean square {:.2} % of 255", found.mean_pct, found.rms_pct)
            }
            Some(Err(fault)) => fault.to_string(),
            None => "the model is not in this photograph".to_owned(),
        };
        ui.weak(RichText::new(figures).small());
        let most = format!("{:.0} % and more", 100.0 * FULL / 255.0);
        ramp(ui, false_colour::of_difference, ["0".to_owned(), most]);
    }

    /// Goes to where a photograph was taken, and stays there.
    pub(super) fn visit(&mut self, photograph: usize) {
        self.is_spinning = false;
        self.viewer.visit(photograph);
    }
}
