//! What either side shows.

use super::App;
use crate::viewer::Side;
use render::window::egui::{ComboBox, RichText, Ui};

/// Room for all that a side can show, in points.
const MENU_HEIGHT: f32 = 480.0;

impl App<'_> {
    pub(super) fn look(&mut self, ui: &mut Ui) {
        let names: Vec<String> = self.viewer.exhibits().iter().map(|exhibit| exhibit.name.clone()).collect();
        ui.horizontal_wrapped(|ui| {
            for (k, name) in names.iter().enumerate() {
                let is_shown = self.viewer.left == Side::Method(k);
                if ui.selectable_label(is_shown, RichText::new(name).heading()).clicked() {
                    self.viewer.left = Side::Method(k);
                }
            }
        });
        let mut is_split = self.viewer.right.is_some();
        ui.horizontal(|ui| {
            if ui.checkbox(&mut is_split, "Split").changed() {
                self.split();
            }
            let Some(mut right) = self.viewer.right else { return };
            let mut left = self.viewer.left;
            self.choose(ui, "left", &mut left);
            self.choose(ui, "right", &mut right);
            (self.viewer.left, self.viewer.right) = (left, Some(right));
        });
    }

    fn choose(&self, ui: &mut Ui, salt: &str, side: &mut Side) {
        ComboBox::from_id_salt(salt).width(92.0).height(MENU_HEIGHT).selected_text(self.name(*side)).show_ui(
            ui,
            |ui| {
                for choice in self.sides() {
                    ui.selectable_value(side, choice, self.name(choice));
                }
            },
        );
    }

    /// All that a side can show.
    fn sides(&self) -> Vec<Side> {
        let current = self.viewer.current();
        let methods = (0..self.viewer.exhibits().len()).map(Side::Method);
        let mut sides: Vec<Side> = methods.chain([Side::Facets(current), Side::Ranks(current)]).collect();
        if self.viewer.photographs().is_some() {
            sides.extend([Side::Photograph, Side::Difference(current)]);
        }
        sides
    }

    /// What a side is called.
    pub(super) fn name(&self, side: Side) -> String {
        let what = match side {
            Side::Method(k) => return self.exhibit_name(k),
            Side::Facets(_) => "facets",
            Side::Ranks(_) => "ranks",
            Side::Difference(_) => "difference",
            Side::Photograph => "photograph",
        };
        what.to_owned()
    }

    /// The same, with the method it is about.
    pub(super) fn full_name(&self, side: Side) -> String {
        match side {
            Side::Method(_) | Side::Photograph => self.name(side),
            Side::Facets(k) | Side::Ranks(k) | Side::Difference(k) => {
                format!("{}, {}", self.exhibit_name(k), self.name(side))
            }
        }
    }

    fn exhibit_name(&self, k: usize) -> String {
        self.viewer.exhibits().get(k).map(|exhibit| exhibit.name.clone()).unwrap_or_default()
    }
}
