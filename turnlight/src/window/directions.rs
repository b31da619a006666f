//! Where the chosen facet was photographed from, and where the eye is among it.

use super::{App, style};
use crate::viewer::dome::Dome;
use render::window::egui::{Align2, FontId, Pos2, RichText, Sense, Stroke, Ui, Vec2};

/// Side of the plot, in points.
const SIDE: f32 = 276.0;

impl App<'_> {
    pub(super) fn directions(&mut self, ui: &mut Ui) {
        let current = self.viewer.current();
        let dome = self.viewer.dome(current, &self.viewer.camera(self.stage.size));
        let (Some(dome), Some(picked)) = (dome, self.viewer.picked(current)) else {
            ui.weak("Click on the object to choose a facet.");
            return;
        };
        plot(ui, &dome);
        let of = format!("facet {}, {} directions", picked.facet, dome.sites.len());
        ui.label(RichText::new(of).small());
        let share = |(site, share): &(usize, f64)| format!("{:.0} % of direction {site}", 100.0 * share);
        let shares: Vec<String> = dome.shares.iter().filter(|(_, share)| *share >= 0.005).map(share).collect();
        let blend = match (dome.sites.len(), shares.as_slice()) {
            (0, _) => "the same from everywhere".to_owned(),
            (_, []) => "the nearest rays of every texel".to_owned(),
            _ => shares.join(", "),
        };
        ui.weak(RichText::new(blend).small());
    }
}

fn plot(ui: &mut Ui, dome: &Dome) {
    let (rect, _) = ui.allocate_exact_size(Vec2::new(ui.available_width(), SIDE), Sense::hover());
    let painter = ui.painter_at(rect);
    let radius = (0.5 * SIDE - 14.0) / dome.reach as f32;
    let place = |[x, y]: [f64; 2]| -> Pos2 { rect.center() + Vec2::new(x as f32, -y as f32) * radius };
    for degrees in [30.0_f32, 60.0, 90.0] {
        let stroke = Stroke::new(if degrees == 90.0 { 1.5 } else { 1.0 }, style::LINE);
        painter.circle_stroke(rect.center(), radius * degrees / 90.0, stroke);
        let label = format!("{:.0}°", 90.0 - degrees);
        let at = rect.center() + Vec2::angled(-0.9) * (radius * degrees / 90.0 + 9.0);
        painter.text(at, Align2::CENTER_CENTER, label, FontId::proportional(10.0), style::FAINT);
    }
    for arc in &dome.arcs {
        painter
            .line(arc.iter().map(|&point| place(point)).collect(), Stroke::new(1.0, style::ACCENT.gamma_multiply(0.4)));
    }
    for &site in &dome.sites {
        painter.circle_filled(place(site), 2.4, style::FAINT);
    }
    let eye = place(dome.eye);
    for &(site, share) in &dome.shares {
        painter.line_segment([eye, place(dome.sites[site])], Stroke::new(1.5, style::NOTICE.gamma_multiply(0.7)));
        painter.circle_filled(place(dome.sites[site]), 3.0 + 4.0 * share as f32, style::NOTICE);
    }
    painter.circle(eye, 5.0, style::PANEL, Stroke::new(2.0, style::TEXT));
    painter.circle_filled(eye, 1.5, style::TEXT);
}
