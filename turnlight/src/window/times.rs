//! How long the last frames took.

use super::{App, style};
use crate::viewer::TIMES;
use render::window::egui::{Align2, FontId, RichText, Sense, Stroke, Ui, Vec2, pos2};

/// Height of the graph, in points.
const HEIGHT: f32 = 84.0;

/// A screen of 60 frames a second has so long for each.
const SCREEN_MS: f64 = 1000.0 / 60.0;

impl App<'_> {
    pub(super) fn times(&mut self, ui: &mut Ui) {
        let times = self.viewer.times_ms();
        let mut sorted = times.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |share: f64| sorted.get((share * (sorted.len().max(1) - 1) as f64).round() as usize).copied();
        let (Some(median), Some(slow)) = (at(0.5), at(0.95)) else { return };
        let most = (1.25 * slow).max(1.2 * SCREEN_MS);
        let (rect, _) = ui.allocate_exact_size(Vec2::new(ui.available_width(), HEIGHT), Sense::hover());
        let painter = ui.painter_at(rect);
        painter.rect_filled(rect, 4.0, style::BACKGROUND);
        let height = |ms: f64| rect.bottom() - rect.height() * (ms / most).min(1.0) as f32;
        painter.hline(rect.x_range(), height(SCREEN_MS), Stroke::new(1.0, style::LINE));
        let label = pos2(rect.left() + 5.0, height(SCREEN_MS) - 2.0);
        painter.text(label, Align2::LEFT_BOTTOM, "60 a second", FontId::proportional(10.0), style::FAINT);
        let across = |k: usize| rect.right() - 3.0 - (times.len() - 1 - k) as f32 * rect.width() / TIMES as f32;
        let line = times.iter().enumerate().map(|(k, &ms)| pos2(across(k), height(ms))).collect();
        painter.line(line, Stroke::new(1.5, style::ACCENT));
        let rate = 1000.0 / median.max(1e-3);
        let text = format!("{median:.1} ms ({rate:.0} frames/s), one in 20 above {slow:.1} ms");
        ui.weak(RichText::new(text).small());
    }
}
