//! A comparison as one HTML page that needs no other file.

use super::crops::{self, Cut, DIFFERENCE_GAIN};
use super::{Comparison, plot, table, view_path};
use crate::Error;
use crate::output::OutputFolder;
use std::fmt::Write;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:1500px;padding:0 1em}\
    table{border-collapse:collapse}td,th{padding:.2em .8em;text-align:right;border-bottom:1px solid #ddd}\
    th:first-child,td:first-child{text-align:left}figure{display:inline-block;margin:.3em;text-align:center}\
    figcaption{color:#555;font-size:13px}img{background:#000;max-width:100%}svg{max-width:100%;height:auto}";

/// The page: table, error per view, and crops of three views read back from `report`.
///
/// # Errors
/// Where a picture of the report cannot be read, or the plot cannot be drawn.
pub fn html(comparison: &Comparison, report: &OutputFolder) -> Result<String, Error> {
    let title = escaped(&comparison.capture);
    let mut page = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>{title}</title><style>{STYLE}</style>\n\
         <h1>{title}</h1>\n<p>{} views fitted, {} scored, {} left out: within {}° of a fitted view.</p>\n",
        comparison.train.len(),
        comparison.test.len(),
        comparison.left_out.len(),
        super::LEAK_DEG,
    );
    push_figures(&mut page, comparison);
    if let Some(geometry) = &comparison.geometry {
        page.push_str(&format!("<p>{}</p>\n", escaped(&geometry.text())));
    }
    page.push_str("<h2>Error per view</h2>\n");
    page.push_str(&plot::error_per_view(comparison)?);
    page.push_str("\n<h2>Held-out views</h2>\n");
    for position in shown_views(comparison) {
        push_crops(&mut page, comparison, position, report)?;
    }
    push_stages(&mut page, comparison);
    page.push_str("</html>\n");
    Ok(page)
}

fn push_figures(page: &mut String, comparison: &Comparison) {
    page.push_str("<table><tr><th></th>");
    comparison.methods.iter().for_each(|m| page.push_str(&format!("<th>{}</th>", m.method)));
    for column in &table::COLUMNS {
        page.push_str(&format!("</tr>\n<tr><td>{}</td>", column.0));
        comparison.methods.iter().for_each(|m| page.push_str(&format!("<td>{}</td>", table::cell(column, m))));
    }
    page.push_str("</tr></table>\n");
}

fn push_stages(page: &mut String, comparison: &Comparison) {
    page.push_str("<h2>Stages</h2>\n<table><tr><th>stage</th><th>seconds</th><th>peak MiB so far</th></tr>\n");
    for stage in &comparison.stages {
        let peak = stage.peak_bytes.map_or_else(|| "–".to_owned(), |bytes| (bytes >> 20).to_string());
        // Writing to a string cannot fail.
        let _ = writeln!(page, "<tr><td>{}</td><td>{:.2}</td><td>{peak}</td></tr>", stage.stage, stage.seconds);
    }
    page.push_str("</table>\n");
}

/// The views with the smallest, the middle and the largest error of the last method.
fn shown_views(comparison: &Comparison) -> Vec<usize> {
    let mut views = comparison.methods.last().map(|m| m.views.clone()).unwrap_or_default();
    views.sort_by(|a, b| a.score.error_mean_pct.total_cmp(&b.score.error_mean_pct));
    let mut shown: Vec<usize> = match views.len() {
        0 => Vec::new(),
        n => [n - 1, n / 2, 0].iter().map(|&i| views[i].view).collect(),
    };
    shown.dedup();
    shown
}

fn push_crops(page: &mut String, comparison: &Comparison, position: usize, report: &OutputFolder) -> Result<(), Error> {
    let file = |kind: &str| report.path().join(view_path(kind, position));
    let mask = capture::read_matte(&file("mask"))?;
    let reference = crops::masked(&capture::read_rgb(&file("reference"))?, &mask);
    let cut = Cut::around(&mask);
    page.push_str(&format!("<h3>View {position}</h3>\n<div>"));
    push_picture(page, &cut.data_uri(&reference)?, "reference");
    let mut differences = Vec::new();
    for method in &comparison.methods {
        let render = capture::read_rgb(&file(method.method))?;
        push_picture(page, &cut.data_uri(&render)?, method.method);
        differences.push((method.method, cut.data_uri(&crops::difference(&render, &reference))?));
    }
    page.push_str("</div>\n<div>");
    for (method, uri) in &differences {
        push_picture(page, uri, &format!("{method}, {DIFFERENCE_GAIN}× difference"));
    }
    page.push_str("</div>\n");
    Ok(())
}

fn push_picture(page: &mut String, uri: &str, caption: &str) {
    page.push_str(&format!("<figure><img src=\"{uri}\" alt=\"{caption}\"><figcaption>{caption}</figcaption></figure>"));
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
