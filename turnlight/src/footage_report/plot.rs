//! A figure of every frame along the footage, as an SVG element that takes its colours from the page.

use super::{FootageReport, FrameReport};
use std::fmt::Write;

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 190.0;
const LEFT: f64 = 46.0;
const RIGHT: f64 = 8.0;
const TOP: f64 = 10.0;
const BOTTOM: f64 = 30.0;

/// What is plotted, and against which line it is to be held.
pub(super) struct Figure {
    /// What it is, with its unit.
    pub(super) title: &'static str,
    /// Reads it off a frame.
    pub(super) read: fn(&FrameReport) -> Option<f64>,
    /// Whether the axis starts at zero.
    pub(super) from_zero: bool,
}

/// The plot; `None` where fewer than two frames have the figure.
pub(super) fn svg(report: &FootageReport, figure: &Figure) -> Option<String> {
    let points: Vec<(&FrameReport, f64)> =
        report.frames.iter().filter_map(|f| Some((f, (figure.read)(f).filter(|v| v.is_finite())?))).collect();
    if points.len() < 2 {
        return None;
    }
    let axis = Axis::around(points.iter().map(|p| p.1), figure.from_zero);
    let last = report.frames.len().saturating_sub(1).max(1) as f64;
    let x = |position: usize| LEFT + (WIDTH - LEFT - RIGHT) * position as f64 / last;
    let mut svg = format!(
        "<figure><figcaption>{t}</figcaption><svg class=\"plot\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{t}\">",
        t = figure.title
    );
    push_ticks(&mut svg, &axis);
    push_frames_axis(&mut svg, report.frames.len(), x);
    let line: Vec<String> = points.iter().map(|(f, v)| format!("{:.1},{:.1}", x(f.position), axis.place(*v))).collect();
    // Writing to a string cannot fail.
    let _ = write!(svg, "<polyline class=\"line\" points=\"{}\"/>", line.join(" "));
    for (frame, value) in &points {
        let class = if frame.kept.is_some() { "kept" } else { "dropped" };
        let (cx, cy) = (x(frame.position), axis.place(*value));
        let decimals = axis.decimals() + 1;
        let _ = write!(
            svg,
            "<circle class=\"{class}\" cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"2.4\"><title>frame {}: {value:.decimals$}</title></circle>",
            frame.position
        );
    }
    svg.push_str("</svg></figure>");
    Some(svg)
}

/// A vertical axis with ticks at round numbers.
struct Axis {
    low: f64,
    high: f64,
    step: f64,
}

impl Axis {
    fn around(values: impl Iterator<Item = f64>, from_zero: bool) -> Self {
        let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)]);
        let low = if from_zero { low.min(0.0) } else { low };
        let span = (high - low).max(1e-3 * high.abs()).max(1e-9);
        let step = round_step(span / 4.0);
        Self {
            low: (low / step).floor() * step,
            high: (high / step).ceil().max((low / step).floor() + 1.0) * step,
            step,
        }
    }

    fn place(&self, value: f64) -> f64 {
        TOP + (HEIGHT - TOP - BOTTOM) * (self.high - value) / (self.high - self.low)
    }

    /// Decimals that tell ticks apart.
    fn decimals(&self) -> usize {
        (-self.step.log10().floor()).clamp(0.0, 9.0) as usize
    }

    fn ticks(&self) -> impl Iterator<Item = f64> + '_ {
        let count = ((self.high - self.low) / self.step).round() as usize;
        (0..=count).map(|k| self.low + self.step * k as f64)
    }
}

/// The next of 1, 2 and 5 times a power of ten.
fn round_step(least: f64) -> f64 {
    let power = 10_f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0].map(|m| m * power).into_iter().find(|step| *step >= least * 0.999).unwrap_or(10.0 * power)
}

fn push_ticks(svg: &mut String, axis: &Axis) {
    let decimals = axis.decimals();
    for value in axis.ticks() {
        let y = axis.place(value);
        let _ = write!(
            svg,
            "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/>\
             <text class=\"y\" x=\"{}\" y=\"{:.1}\">{value:.decimals$}</text>",
            WIDTH - RIGHT,
            LEFT - 6.0,
            y + 4.0
        );
    }
}

fn push_frames_axis(svg: &mut String, frames: usize, x: impl Fn(usize) -> f64) {
    let step = round_step(frames as f64 / 8.0).max(1.0) as usize;
    for position in (0..frames).step_by(step) {
        let _ = write!(svg, "<text x=\"{:.1}\" y=\"{}\">{position}</text>", x(position), HEIGHT - 10.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_cover_the_values() {
        let axis = Axis::around([0.12, 0.43].into_iter(), true);
        assert_eq!(axis.ticks().map(|t| format!("{t:.1}")).collect::<Vec<_>>(), ["0.0", "0.2", "0.4", "0.6"]);
        let flat = Axis::around([7.0, 7.0].into_iter(), false);
        assert!(flat.low <= 7.0 && flat.high >= 7.0 && flat.high > flat.low && flat.ticks().count() < 10);
        let zero = Axis::around([0.0].into_iter(), true);
        assert!(zero.place(0.0).is_finite());
    }
}
