//! Layers as pictures, with their weights as sliders.

use super::{App, style};
use crate::viewer::basis;
use capture::Image;
use render::blend::Pin;
use render::window::egui::{ColorImage, Context, RichText, Slider, TextureHandle, TextureOptions, Ui, Vec2};
use texture::{Layers, Model};

/// Longest side of a picture, in pixels, and of one in the list, in points.
const LARGE: usize = 256;
const SMALL: f32 = 44.0;

/// Pictures of layers, kept for one model.
#[derive(Default)]
pub(super) struct Thumbnails {
    /// Exhibit and object.
    of: Option<[usize; 2]>,
    textures: Vec<TextureHandle>,
    /// Whether sliders hold the weights of all facets, not of the chosen one alone.
    is_whole: bool,
}

impl Thumbnails {
    fn make(&mut self, context: &Context, of: [usize; 2], model: &Model, layers: &Layers) {
        if self.of == Some(of) {
            return;
        }
        let texture = |picture: &Image<[u8; 3]>| {
            let picture = ColorImage::from_rgb([picture.width(), picture.height()], picture.pixels().as_flattened());
            context.load_texture("layer", picture, TextureOptions::LINEAR)
        };
        self.textures = basis::thumbnails(model, layers, LARGE).iter().map(texture).collect();
        self.of = Some(of);
    }
}

impl App<'_> {
    pub(super) fn basis(&mut self, ui: &mut Ui) {
        let current = self.viewer.current();
        let Some((model, _, picked)) = self.viewer.picked_model(current) else {
            ui.weak("Click on the object to choose a facet.");
            return;
        };
        let coefficients = self.viewer.coefficients(current, &self.viewer.camera(self.stage.size));
        let (Some(layers), Some(coefficients)) = (basis::layers(model), coefficients) else {
            ui.weak("A lumigraph has rays, no layers.");
            return;
        };
        self.thumbnails.make(ui.ctx(), [current, picked.object], model, layers);
        ui.horizontal(|ui| {
            ui.radio_value(&mut self.thumbnails.is_whole, false, format!("facet {}", picked.facet));
            ui.radio_value(&mut self.thumbnails.is_whole, true, "all facets");
            let is_held = !self.viewer.pins(current).is_empty();
            if ui.add_enabled(is_held, render::window::egui::Button::new("Reset")).clicked() {
                self.viewer.unpin(current);
            }
        });
        let facet = (!self.thumbnails.is_whole).then_some(picked.facet);
        for (layer, coefficient) in coefficients.iter().enumerate() {
            let held = self.viewer.pins(current).iter().rev().find(|(object, pin)| {
                *object == picked.object
                    && pin.layer == layer
                    && (pin.facet.is_none() || pin.facet == Some(picked.facet))
            });
            let mut weight = held.map_or(coefficient.asked, |(_, pin)| f64::from(pin.weight));
            let is_held = held.is_some();
            if self.row(ui, layer, is_held, (&mut weight, coefficient.range)) {
                self.viewer.pin(current, picked.object, Pin { facet, layer, weight: weight as f32 });
            }
        }
    }

    /// A layer's picture and slider; whether it was moved.
    fn row(&self, ui: &mut Ui, layer: usize, is_held: bool, (weight, [low, high]): (&mut f64, [f64; 2])) -> bool {
        let row = ui.horizontal(|ui| {
            if let Some(texture) = self.thumbnails.textures.get(layer) {
                let small = texture.size_vec2() * (SMALL / texture.size_vec2().max_elem().max(1.0));
                let large = texture.size_vec2();
                ui.image((texture.id(), small)).on_hover_ui(|ui| {
                    ui.image((texture.id(), large));
                });
            }
            ui.vertical(|ui| {
                let colour = if is_held { style::NOTICE } else { style::FAINT };
                let name = if is_held { format!("layer {layer}, held") } else { format!("layer {layer}") };
                ui.label(RichText::new(name).small().color(colour));
                ui.spacing_mut().item_spacing = Vec2::new(6.0, 2.0);
                ui.add(Slider::new(weight, low..=high).custom_formatter(|weight, _| format!("{:.2}", weight + 0.0)))
                    .changed()
            })
        });
        row.inner.inner
    }
}
