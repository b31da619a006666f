//! Where light on materials comes from.

use super::{App, style};
use crate::viewer::Lamp;
use render::window::egui::{Sense, Slider, Stroke, Ui, Vec2};
use std::ops::RangeInclusive;

/// Side of the plot, in points, and how high above the plane its rim is, in degrees.
const SIDE: f32 = 150.0;
const RIM_DEG: f64 = -30.0;

/// How far materials are brightened.
const STOPS: RangeInclusive<f64> = -4.0..=6.0;

/// Where a light begins that is taken off the eye.
const FIRST: [f64; 2] = [-40.0, 45.0];

impl App<'_> {
    pub(super) fn light(&mut self, ui: &mut Ui) {
        let mut lamp = self.viewer.lamp;
        let fixed = match lamp {
            Lamp::Fixed { .. } => lamp,
            Lamp::WithEye => Lamp::Fixed { azimuth_deg: FIRST[0], elevation_deg: FIRST[1] },
        };
        ui.horizontal(|ui| {
            ui.radio_value(&mut lamp, Lamp::WithEye, "with the eye");
            ui.radio_value(&mut lamp, fixed, "fixed");
        });
        if let Lamp::Fixed { azimuth_deg, elevation_deg } = &mut lamp {
            plot(ui, azimuth_deg, elevation_deg);
            ui.add(Slider::new(azimuth_deg, -180.0..=180.0).fixed_decimals(0).suffix("° about"));
            ui.add(Slider::new(elevation_deg, RIM_DEG..=90.0).fixed_decimals(0).suffix("° up"));
        }
        self.viewer.lamp = lamp;
        ui.add(Slider::new(&mut self.viewer.stops, STOPS).fixed_decimals(1).suffix(" stops"));
    }
}

/// From above; the eye begins on the right.
fn plot(ui: &mut Ui, azimuth_deg: &mut f64, elevation_deg: &mut f64) {
    let (rect, response) = ui.allocate_exact_size(Vec2::splat(SIDE), Sense::click_and_drag());
    let (centre, radius) = (rect.center(), 0.5 * SIDE - 8.0);
    let span = 90.0 - RIM_DEG;
    if let Some(at) = response.interact_pointer_pos() {
        let off = at - centre;
        *azimuth_deg = f64::from((-off.y).atan2(off.x)).to_degrees();
        *elevation_deg = (90.0 - span * f64::from(off.length() / radius)).max(RIM_DEG);
    }
    let painter = ui.painter_at(rect);
    painter.circle(centre, radius, style::BACKGROUND, Stroke::new(1.0, style::LINE));
    painter.circle_stroke(centre, radius * (90.0 / span) as f32, Stroke::new(1.0, style::LINE));
    let out = radius * ((90.0 - *elevation_deg) / span) as f32;
    let angle = azimuth_deg.to_radians() as f32;
    let lamp = centre + Vec2::new(angle.cos(), -angle.sin()) * out;
    painter.line_segment([centre, lamp], Stroke::new(1.0, style::NOTICE.gamma_multiply(0.5)));
    painter.circle_filled(lamp, 6.0, style::NOTICE);
}
