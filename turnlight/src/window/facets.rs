//! Facets and ranks in false colour.

use super::App;
use crate::viewer::{Side, basis, false_colour};
use render::window::egui::{Color32, Rect, RichText, Sense, Ui, Vec2, pos2};

impl App<'_> {
    pub(super) fn facets(&mut self, ui: &mut Ui) {
        let current = self.viewer.current();
        ui.horizontal(|ui| {
            for (text, side) in [
                ("Appearance", Side::Method(current)),
                ("Facets", Side::Facets(current)),
                ("Ranks", Side::Ranks(current)),
            ] {
                ui.selectable_value(&mut self.viewer.left, side, text);
            }
        });
        if let Some((model, ..)) = self.viewer.picked_model(current) {
            ui.weak(RichText::new(figures(model)).small());
        }
        if let Some(exhibit) = self.viewer.exhibits().get(current) {
            let are_rays = exhibit.scene.models.iter().all(|model| basis::layers(model).is_none());
            let unit = if are_rays { "rays" } else { "layers" };
            ramp(ui, false_colour::of_rank, ["1".to_owned(), format!("{} {unit}", exhibit.most_layers())]);
        }
    }
}

fn figures(model: &texture::Model) -> String {
    match basis::layers(model) {
        Some(layers) => {
            let ranks: usize = layers.facets.iter().map(|facet| facet.rank).sum();
            let mean = ranks as f64 / layers.facets.len().max(1) as f64;
            format!("{} facets, {} layers, {mean:.1} in the mean", layers.facets.len(), layers.layers.len())
        }
        None => "a lumigraph: colours are charts, ranks are rays".to_owned(),
    }
}

/// A strip of all colours with its ends named.
pub(super) fn ramp(ui: &mut Ui, colour: fn(f64) -> [u8; 3], [low, high]: [String; 2]) {
    ui.horizontal(|ui| {
        ui.weak(RichText::new(low).small());
        let (rect, _) = ui.allocate_exact_size(Vec2::new(150.0, 10.0), Sense::hover());
        const STEPS: usize = 64;
        for k in 0..STEPS {
            let at = |k: usize| rect.left() + rect.width() * k as f32 / STEPS as f32;
            let [r, g, b] = colour(k as f64 / (STEPS - 1) as f64);
            let strip = Rect::from_min_max(pos2(at(k), rect.top()), pos2(at(k + 1), rect.bottom()));
            ui.painter().rect_filled(strip, 0.0, Color32::from_rgb(r, g, b));
        }
        ui.weak(RichText::new(high).small());
    });
}
