//! What keys do.

use super::App;
use crate::viewer::Side;
use render::window::egui::{Context, Event, Grid, Key, Modifiers, Popup, RichText, Ui, ViewportCommand};

/// Radians, and e-folds of distance, a second that a held key asks for.
const PUSH: f64 = 1.4;

/// Radians a second of an object that turns by itself: a turn in twelve seconds.
const SPIN: f64 = 0.52;

/// The numbers of the methods.
const DIGITS: [Key; 9] =
    [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6, Key::Num7, Key::Num8, Key::Num9];

/// What the panel says.
const TABLE: [(&str, &str); 15] = [
    ("drag", "turn"),
    ("right drag, shift drag", "move"),
    ("wheel, pinch, + -", "zoom"),
    ("click", "choose a facet"),
    ("arrows", "turn"),
    ("Home", "back to the start"),
    ("Space", "turn by itself"),
    ("1 to 9", "method"),
    ("V", "split"),
    ("F, R", "facets, ranks"),
    ("N", "go to the photograph"),
    ("E", "difference from it"),
    ("S, T", "picture, turn around"),
    ("P", "panels"),
    ("Esc", "close"),
];

pub(super) fn table(ui: &mut Ui) {
    ui.spacing_mut().interact_size.y = 15.0;
    Grid::new("keys").num_columns(2).spacing([14.0, 4.0]).show(ui, |ui| {
        for (key, does) in TABLE {
            ui.label(RichText::new(key).small());
            ui.weak(RichText::new(does).small());
            ui.end_row();
        }
    });
}

/// Whether keys are for the picture, not for a widget.
fn are_ours(context: &Context) -> bool {
    !context.egui_wants_keyboard_input() && !Popup::is_any_open(context)
}

/// Whether a key went down; the repetitions of a held one are taken from widgets, and count for nothing.
fn pressed(context: &Context, key: Key) -> bool {
    let is_it = |event: &Event| matches!(event, Event::Key { key: k, pressed: true, repeat: false, .. } if *k == key);
    context.input_mut(|i| {
        let is_new = i.events.iter().any(is_it);
        i.consume_key(Modifiers::NONE, key) && is_new
    })
}

impl App<'_> {
    /// Does what keys say that went down.
    pub(super) fn keys(&mut self, context: &Context) {
        if !are_ours(context) {
            return;
        }
        let pressed = |key: Key| pressed(context, key);
        for (k, key) in DIGITS.into_iter().enumerate().take(self.viewer.exhibits().len()) {
            if pressed(key) {
                self.viewer.left = Side::Method(k);
            }
        }
        let current = self.viewer.current();
        for (key, side) in
            [(Key::F, Side::Facets(current)), (Key::R, Side::Ranks(current)), (Key::E, Side::Difference(current))]
        {
            let is_there = key != Key::E || self.viewer.photographs().is_some();
            if pressed(key) && is_there {
                self.viewer.left = if self.viewer.left == side { Side::Method(current) } else { side };
            }
        }
        if pressed(Key::V) {
            self.split();
        }
        if pressed(Key::N)
            && let Some(nearest) = self.viewer.nearest_photograph(&self.viewer.camera(self.stage.size))
        {
            self.visit(nearest);
        }
        if pressed(Key::Home) {
            self.is_spinning = false;
            self.viewer.steer().go_home();
        }
        self.is_spinning ^= pressed(Key::Space);
        self.has_panels ^= pressed(Key::P);
        if pressed(Key::S) {
            self.recorder.ask_picture();
        }
        if pressed(Key::T) {
            self.recorder.ask_turn();
        }
        if pressed(Key::Escape) {
            context.send_viewport_cmd(ViewportCommand::Close);
        }
    }

    /// What held keys, and turning by itself, ask of the eye.
    pub(super) fn push(&self, context: &Context) -> [f64; 3] {
        let is_held = |keys: &[Key]| are_ours(context) && context.input(|i| keys.iter().any(|&key| i.key_down(key)));
        let held = |keys: &[Key]| f64::from(u8::from(is_held(keys)));
        let azimuth = held(&[Key::ArrowRight]) - held(&[Key::ArrowLeft]);
        let elevation = held(&[Key::ArrowUp]) - held(&[Key::ArrowDown]);
        let distance = held(&[Key::Minus]) - held(&[Key::Plus, Key::Equals]);
        let spin = if self.is_spinning { SPIN } else { 0.0 };
        [PUSH * azimuth + spin, PUSH * elevation, PUSH * distance]
    }

    /// Splits the picture: another method on the right where there is one, else the photograph, else the facets.
    pub(super) fn split(&mut self) {
        let current = self.viewer.current();
        let count = self.viewer.exhibits().len();
        self.viewer.right = match self.viewer.right {
            Some(_) => None,
            None if count > 1 => Some(Side::Method((current + 1) % count)),
            None if self.viewer.photographs().is_some() => Some(Side::Photograph),
            None => Some(Side::Facets(current)),
        };
    }
}
