//! Colours and sizes, as in the browser's player.

use crate::viewer;
use render::window::egui::{Color32, Context, CornerRadius, FontId, Margin, Stroke, TextStyle, Theme, Vec2};

pub(super) const BACKGROUND: Color32 = {
    let [r, g, b] = viewer::BACKGROUND;
    Color32::from_rgb(r, g, b)
};
pub(super) const PANEL: Color32 = Color32::from_rgb(34, 37, 42);
pub(super) const TEXT: Color32 = Color32::from_rgb(232, 230, 227);
pub(super) const FAINT: Color32 = Color32::from_rgb(169, 167, 163);
pub(super) const LINE: Color32 = Color32::from_rgb(74, 78, 86);
pub(super) const ACCENT: Color32 = Color32::from_rgb(127, 178, 240);
pub(super) const NOTICE: Color32 = Color32::from_rgb(240, 198, 116);

/// Space around what is in a panel.
pub(super) const MARGIN: Margin = Margin { left: 12, right: 12, top: 10, bottom: 10 };

pub(super) fn apply(context: &Context) {
    context.set_theme(Theme::Dark);
    context.all_styles_mut(|style| {
        style.spacing.item_spacing = Vec2::new(8.0, 7.0);
        style.spacing.button_padding = Vec2::new(9.0, 4.0);
        style.spacing.slider_width = 132.0;
        style.spacing.combo_width = 120.0;
        for (text, size) in [(TextStyle::Body, 13.5), (TextStyle::Button, 13.5), (TextStyle::Small, 11.5)] {
            style.text_styles.insert(text, FontId::proportional(size));
        }
        style.text_styles.insert(TextStyle::Heading, FontId::proportional(15.0));
        style.text_styles.insert(TextStyle::Monospace, FontId::monospace(12.0));
        let visuals = &mut style.visuals;
        visuals.override_text_color = Some(TEXT);
        visuals.weak_text_color = Some(FAINT);
        (visuals.panel_fill, visuals.window_fill, visuals.extreme_bg_color) = (PANEL, PANEL, BACKGROUND);
        visuals.selection.bg_fill = ACCENT.gamma_multiply(0.45);
        visuals.selection.stroke = Stroke::new(1.0, TEXT);
        visuals.slider_trailing_fill = true;
        let widgets = &mut visuals.widgets;
        widgets.noninteractive.bg_stroke = Stroke::new(1.0, LINE.gamma_multiply(0.6));
        for (state, fill) in [
            (&mut widgets.inactive, Color32::from_rgb(48, 52, 60)),
            (&mut widgets.hovered, Color32::from_rgb(60, 65, 75)),
            (&mut widgets.active, Color32::from_rgb(72, 78, 90)),
            (&mut widgets.open, Color32::from_rgb(48, 52, 60)),
        ] {
            (state.bg_fill, state.weak_bg_fill) = (fill, fill);
            state.corner_radius = CornerRadius::same(5);
        }
    });
}
