//! Error against size, and against time.

use super::{CodecComparison, Evaluation};
use crate::Error;
use plotters::coord::combinators::{BindKeyPoints, IntoLogRange};
use plotters::prelude::*;

/// Told apart by the colour-blind too (Okabe and Ito, 2008), then again with hollow marks.
const COLORS: [RGBColor; 7] = [
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(213, 94, 0),
    RGBColor(0, 114, 178),
    RGBColor(90, 90, 90),
];

/// What stands along the horizontal axis.
#[derive(Clone, Copy, Debug)]
pub(super) enum Axis {
    /// Bytes of the file over texels.
    BytesPerTexel,
    /// Nanoseconds of one core for an answer.
    NanosecondsPerAnswer,
}

/// RMSE, from 0, over a logarithmic axis, marks of one colour per codec, as an SVG document.
///
/// # Errors
/// Where the plotting library fails.
pub(super) fn error_over(comparison: &CodecComparison, axis: Axis) -> Result<String, Error> {
    let mut svg = String::new();
    draw(comparison, axis, &mut svg).map_err(|fault| Error::Failed(format!("the plot cannot be drawn: {fault}")))?;
    Ok(svg)
}

impl Axis {
    fn of(self, evaluation: &Evaluation, texels: usize) -> Option<f64> {
        match self {
            Self::BytesPerTexel => Some(evaluation.bytes as f64 / texels as f64),
            Self::NanosecondsPerAnswer => evaluation.speed.map(|speed| 1e9 / speed.evals_per_s_core),
        }
    }

    /// Whether error follows from it: marks of one codec are then joined.
    fn joins_sizes(self) -> bool {
        matches!(self, Self::BytesPerTexel)
    }

    fn label(self) -> &'static str {
        match self {
            Self::BytesPerTexel => "bytes per texel",
            Self::NanosecondsPerAnswer => "nanoseconds per answer, one core",
        }
    }
}

/// One curve.
struct Curve {
    name: &'static str,
    points: Vec<(f64, f64)>,
}

fn curves(comparison: &CodecComparison, axis: Axis) -> Vec<Curve> {
    let texels = comparison.size[0] * comparison.size[1];
    let mut curves: Vec<Curve> = Vec::new();
    for run in &comparison.runs {
        let Some(evaluation) = &run.evaluation else { continue };
        let Some(x) = axis.of(evaluation, texels) else { continue };
        let point = (x, evaluation.score.rmse);
        match curves.iter_mut().find(|curve| curve.name == run.name) {
            Some(curve) => curve.points.push(point),
            None => curves.push(Curve { name: run.name, points: vec![point] }),
        }
    }
    curves
}

fn draw(comparison: &CodecComparison, axis: Axis, svg: &mut String) -> Result<(), Box<dyn std::error::Error>> {
    let curves = curves(comparison, axis);
    let range = |of: fn(&(f64, f64)) -> f64| {
        let values = curves.iter().flat_map(|c| c.points.iter().map(of));
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)));
        if low > high { 1.0..10.0 } else { low / 1.3..high * 1.3 }
    };
    let along = range(|p| p.0);
    // Where nothing is lost there is an axis, too.
    let highest = range(|p| p.1).end.max(1.0);
    let root = SVGBackend::with_string(svg, (960, 420)).into_drawing_area();
    root.fill(&WHITE)?;
    // Beside the plot, where the names cover no mark.
    let (plot, names) = root.split_horizontally(820);
    let mut chart = ChartBuilder::on(&plot)
        .margin(10)
        .x_label_area_size(36)
        .y_label_area_size(56)
        .build_cartesian_2d(along.clone().log_scale().with_key_points(ticks(&along)), 0.0..highest)?;
    let number = |value: &f64| format!("{}", (value * 1000.0).round() / 1000.0);
    chart
        .configure_mesh()
        .x_desc(axis.label())
        .y_desc("RMSE, levels of 255")
        .x_label_formatter(&number)
        .y_label_formatter(&number)
        .draw()?;
    for (i, curve) in curves.iter().enumerate() {
        let color = COLORS[i % COLORS.len()];
        let style = if i < COLORS.len() { color.filled() } else { color.stroke_width(2) };
        if axis.joins_sizes() {
            chart.draw_series(LineSeries::new(curve.points.iter().copied(), color.stroke_width(2)))?;
        }
        chart.draw_series(curve.points.iter().map(|&p| Circle::new(p, 4, style)))?;
        let y = 24 + 20 * i as i32;
        names.draw(&Circle::new((8, y), 4, style))?;
        names.draw(&Text::new(curve.name, (20, y - 6), ("sans-serif", 13)))?;
    }
    drop(chart);
    root.present()?;
    Ok(())
}

/// 1, 2 and 5 times powers of ten within a range; of a short one its ends.
fn ticks(range: &std::ops::Range<f64>) -> Vec<f64> {
    let (first, last) = (range.start.log10().floor() as i32, range.end.log10().ceil() as i32);
    let steps = (first..=last).flat_map(|power| [1.0, 2.0, 5.0].map(|step| step * 10f64.powi(power)));
    let ticks: Vec<f64> = steps.filter(|tick| range.contains(tick)).collect();
    if ticks.len() < 2 { vec![range.start, range.end] } else { ticks }
}
