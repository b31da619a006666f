//! The picture: dragged, flung, split, clicked on.

use super::{App, style};
use crate::viewer::{Panel, Side};
use capture::Image;
use render::window::egui::{
    Align2, Color32, ColorImage, Context, CursorIcon, Event, FontId, MouseWheelUnit, PointerButton, Pos2, Rect,
    Response, Sense, Stroke, TextureHandle, TextureOptions, Ui, Vec2, pos2,
};
use std::time::Instant;

/// Half the width of what takes hold of the divider, in points.
const GRIP: f32 = 7.0;

/// Pauses longer than this are none of the motion.
const LONGEST_STEP_S: f64 = 0.25;

/// What moves is drawn with fewer pixels where all of them take longer than this.
const PATIENCE_MS: f64 = 60.0;

/// So many pixels become one at most, along a side.
const COARSEST: usize = 4;

/// Frames over whose intervals frames a second are averaged.
const INTERVALS: usize = 30;

/// The picture on the screen.
#[derive(Default)]
pub(super) struct Stage {
    texture: Option<TextureHandle>,
    /// Width and height of the picture, in pixels.
    pub(super) size: [usize; 2],
    is_dividing: bool,
    last: Option<Instant>,
    /// How long the last picture with all its pixels took.
    whole_ms: f64,
    /// Seconds between the last frames that were drawn one after the other.
    intervals_s: Vec<f64>,
}

impl Stage {
    /// Frames a second, while anything moves.
    pub(super) fn frames_per_second(&self) -> Option<f64> {
        let sum: f64 = self.intervals_s.iter().sum();
        (sum > 0.0).then(|| self.intervals_s.len() as f64 / sum)
    }

    /// Pixels, along a side, that become one while something moves.
    fn coarseness(&self) -> usize {
        let pixels = (self.whole_ms / PATIENCE_MS).sqrt().ceil() as usize;
        pixels.clamp(1, COARSEST)
    }

    fn put(&mut self, context: &Context, frame: &Image<[u8; 4]>) {
        let size = [frame.width(), frame.height()];
        let picture = ColorImage::from_rgba_premultiplied(size, frame.pixels().as_flattened());
        let options = if size == self.size { TextureOptions::NEAREST } else { TextureOptions::LINEAR };
        match &mut self.texture {
            Some(texture) => texture.set(picture, options),
            none => *none = Some(context.load_texture("picture", picture, options)),
        }
    }

    /// Seconds since the last frame; 0 where nothing moved in that one, and a pause counts as a short one.
    fn step(&mut self) -> f64 {
        let now = Instant::now();
        let step = self.last.replace(now).map_or(0.0, |last| (now - last).as_secs_f64());
        step.min(LONGEST_STEP_S)
    }

    fn count(&mut self, is_new: bool, step: f64) {
        if !is_new || step == 0.0 || step >= LONGEST_STEP_S {
            self.intervals_s.clear();
            return;
        }
        if self.intervals_s.len() == INTERVALS {
            self.intervals_s.remove(0);
        }
        self.intervals_s.push(step);
    }
}

impl App<'_> {
    /// Lays out the picture where there is room left.
    pub(super) fn stage(&mut self, ui: &mut Ui) {
        let scale = ui.ctx().pixels_per_point();
        let area = pixels_of(ui.max_rect(), scale);
        let size = [area.width(), area.height()].map(|side| side.max(1.0) as usize);
        if std::mem::replace(&mut self.stage.size, size) != size {
            // Panels, which come first, knew another eye.
            ui.ctx().request_repaint();
        }
        let rect = Rect::from_min_max((area.min.to_vec2() / scale).to_pos2(), (area.max.to_vec2() / scale).to_pos2());
        let response = ui.allocate_rect(rect, Sense::click_and_drag());
        let step = self.stage.step();
        self.divide(ui, &response, rect);
        let is_moving = self.steer(ui, &response, step, scale) || self.stage.is_dividing;
        // A slider that is held, too.
        let is_changing = is_moving || ui.ctx().egui_is_using_pointer();
        let coarseness = if is_changing { self.stage.coarseness() } else { 1 };
        self.stage.last = self.stage.last.filter(|_| is_changing);
        let frame = self.viewer.frame_if_changed(size.map(|side| side.div_ceil(coarseness)));
        self.stage.count(frame.is_some(), step);
        if let Some(frame) = frame {
            self.stage.put(ui.ctx(), &frame);
            let whole_ms = self.viewer.times_ms().last().filter(|_| coarseness == 1);
            self.stage.whole_ms = whole_ms.copied().unwrap_or(self.stage.whole_ms);
        }
        if is_moving {
            ui.ctx().request_repaint();
        }
        let whole = Rect::from_min_max(Pos2::ZERO, pos2(1.0, 1.0));
        if let Some(texture) = &self.stage.texture {
            ui.painter().image(texture.id(), rect, whole, Color32::WHITE);
        }
        self.mark_facet(ui, rect, scale);
        self.mark_sides(ui, rect);
    }

    fn divide(&mut self, ui: &Ui, response: &Response, rect: Rect) {
        if self.viewer.right.is_none() {
            self.stage.is_dividing = false;
            return;
        }
        let x = rect.left() + self.viewer.divider as f32 * rect.width();
        let is_near = |pointer: Option<Pos2>| pointer.is_some_and(|at| (at.x - x).abs() <= GRIP);
        if response.drag_started_by(PointerButton::Primary) {
            self.stage.is_dividing = is_near(ui.input(|i| i.pointer.press_origin()));
        }
        if response.drag_stopped() {
            self.stage.is_dividing = false;
        }
        if let (true, Some(at)) = (self.stage.is_dividing, response.interact_pointer_pos()) {
            self.viewer.divider = f64::from((at.x - rect.left()) / rect.width()).clamp(0.02, 0.98);
        }
        if self.stage.is_dividing || is_near(response.hover_pos()) {
            ui.ctx().set_cursor_icon(CursorIcon::ResizeHorizontal);
        }
    }

    /// Moves the eye; whether it is in motion.
    fn steer(&mut self, ui: &Ui, response: &Response, step: f64, scale: f32) -> bool {
        let (size, push) = (self.stage.size, self.push(ui.ctx()));
        let moved = response.drag_delta() * scale;
        let moved = [moved.x, moved.y].map(f64::from);
        let is_shifted = ui.input(|i| i.modifiers.shift);
        let pans = response.dragged_by(PointerButton::Secondary)
            || response.dragged_by(PointerButton::Middle)
            || (is_shifted && response.dragged_by(PointerButton::Primary));
        let turns = !pans && !self.stage.is_dividing && response.dragged_by(PointerButton::Primary);
        if pans && moved != [0.0; 2] {
            self.viewer.steer().pan(moved, size);
        }
        // A press that has not moved yet leaves the eye at its photograph.
        if turns && (moved != [0.0; 2] || self.viewer.orbit().is_moving()) {
            self.viewer.steer().drag(moved, size[1], step);
        } else if !turns && (push != [0.0; 3] || self.viewer.orbit().is_moving()) {
            self.viewer.steer().advance(step, push);
        }
        if response.clicked()
            && let Some(at) = response.interact_pointer_pos()
        {
            let pixel = (at - response.rect.min) * scale;
            self.viewer.pick([pixel.x, pixel.y].map(f64::from), size);
        }
        if response.contains_pointer() {
            self.scroll(ui);
        }
        turns || pans || push != [0.0; 3] || self.viewer.orbit().is_moving()
    }

    /// Wheels and touchpads.
    fn scroll(&mut self, ui: &Ui) {
        let events = ui.input(|i| i.raw.events.clone());
        for event in events {
            match event {
                // Sideways, which is nothing here.
                Event::MouseWheel { delta, .. } if delta.y == 0.0 => {}
                Event::MouseWheel { unit: MouseWheelUnit::Point, delta, .. } => {
                    self.viewer.steer().pinch((f64::from(delta.y) * 0.004).exp());
                }
                Event::MouseWheel { delta, .. } => self.viewer.steer().wheel(delta.y.into()),
                Event::Zoom(factor) => self.viewer.steer().pinch(factor.into()),
                _ => {}
            }
        }
    }

    /// A ring where the chosen facet is, while a panel is about it.
    fn mark_facet(&self, ui: &Ui, rect: Rect, scale: f32) {
        let is_about_it = |panel: &Panel| matches!(panel, Panel::Directions | Panel::Basis);
        if !self.has_panels || !self.panels.iter().any(is_about_it) {
            return;
        }
        let camera = self.viewer.camera(self.stage.size);
        let picked = self.viewer.picked(self.viewer.current());
        if let Some(seen) = picked.and_then(|picked| camera.project(&picked.point)) {
            let at = rect.min + Vec2::new(seen.pixel.x as f32, seen.pixel.y as f32) / scale;
            let painter = ui.painter_at(rect);
            painter.circle_stroke(at, 7.0, Stroke::new(3.5, Color32::from_black_alpha(150)));
            painter.circle_stroke(at, 7.0, Stroke::new(1.5, style::ACCENT));
        }
    }

    /// The divider, and what is on either side.
    fn mark_sides(&self, ui: &Ui, rect: Rect) {
        let Some(right) = self.viewer.right else { return };
        let painter = ui.painter_at(rect);
        let scale = ui.ctx().pixels_per_point();
        let x = (rect.left() + (self.viewer.divider as f32 * rect.width() * scale).round() / scale).round();
        painter.vline(x, rect.y_range(), Stroke::new(3.0, Color32::from_black_alpha(130)));
        painter.vline(x, rect.y_range(), Stroke::new(1.0, style::TEXT));
        painter.circle(pos2(x, rect.center().y), 6.0, style::PANEL, Stroke::new(1.5, style::TEXT));
        let chip = |at: Pos2, align: Align2, side: Side| {
            let galley = painter.layout_no_wrap(self.full_name(side), FontId::proportional(13.5), style::TEXT);
            let text = align.anchor_size(at, galley.size());
            painter.rect_filled(text.expand2(Vec2::new(8.0, 4.0)), 6.0, style::BACKGROUND.gamma_multiply(0.75));
            painter.galley(text.min, galley, style::TEXT);
        };
        chip(pos2(x - 16.0, rect.top() + 14.0), Align2::RIGHT_TOP, self.viewer.left);
        chip(pos2(x + 16.0, rect.top() + 14.0), Align2::LEFT_TOP, right);
    }
}

/// The whole pixels of an area in points.
fn pixels_of(area: Rect, scale: f32) -> Rect {
    let (min, max) = (area.min.to_vec2() * scale, area.max.to_vec2() * scale);
    Rect::from_min_max(min.round().to_pos2(), max.round().to_pos2())
}
