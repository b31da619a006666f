//! Error against view, one curve per method.

use super::Comparison;
use crate::Error;
use plotters::prelude::*;

/// One colour per method, told apart by the colour-blind too (Okabe and Ito, 2008).
const COLORS: [RGBColor; 4] =
    [RGBColor(230, 159, 0), RGBColor(86, 180, 233), RGBColor(0, 158, 115), RGBColor(204, 121, 167)];

/// The plot as an SVG document.
///
/// # Errors
/// Where the plotting library fails.
pub(super) fn error_per_view(comparison: &Comparison) -> Result<String, Error> {
    let mut svg = String::new();
    draw(comparison, &mut svg).map_err(|fault| Error::Failed(format!("the plot cannot be drawn: {fault}")))?;
    Ok(svg)
}

fn draw(comparison: &Comparison, svg: &mut String) -> Result<(), Box<dyn std::error::Error>> {
    let errors = comparison.methods.iter().flat_map(|m| m.views.iter().map(|v| v.score.error_mean_pct));
    let top = errors.fold(1.0_f64, f64::max) * 1.1;
    let last = comparison.test.last().copied().unwrap_or(0) + 1;
    let root = SVGBackend::with_string(svg, (960, 320)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(10)
        .x_label_area_size(36)
        .y_label_area_size(48)
        .build_cartesian_2d(0..last, 0.0..top)?;
    chart.configure_mesh().x_desc("view").y_desc("error, % of 255").draw()?;
    for (method, color) in comparison.methods.iter().zip(COLORS.iter().cycle()) {
        let points = method.views.iter().map(|v| (v.view, v.score.error_mean_pct));
        let line = LineSeries::new(points, color.stroke_width(2)).point_size(2);
        chart
            .draw_series(line)?
            .label(method.method)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], color.stroke_width(2)));
    }
    chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK.mix(0.3)).draw()?;
    drop(chart);
    root.present()?;
    Ok(())
}
