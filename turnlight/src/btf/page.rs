//! A comparison of codecs as one HTML page that needs no other file.

use super::compare::sheet_path;
use super::plot::{Axis, error_over};
use super::{CodecComparison, CodecRun, DIFFERENCE_GAIN, Delta, Evaluation};
use crate::Error;
use crate::output::OutputFolder;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:1100px;padding:0 1em}\
    table{border-collapse:collapse}td,th{padding:.2em .8em;text-align:right;border-bottom:1px solid #ddd}\
    th:first-child,td:first-child{text-align:left}img{max-width:100%;image-rendering:pixelated}\
    svg{max-width:100%;height:auto}figcaption{color:#555;font-size:13px}";

/// A column: its heading, and what stands in it.
type Column = (&'static str, fn(&Evaluation) -> String);

const COLUMNS: [Column; 11] = [
    ("ratio", |e| format!("{:.1}", e.ratio)),
    ("as printed", |e| e.ratio_as_printed.map_or_else(|| "–".into(), |ratio| format!("{ratio:.1}"))),
    ("bytes", |e| e.bytes.to_string()),
    ("RMSE", |e| format!("{:.3}", e.score.rmse)),
    ("PSNR, dB", |e| format!("{:.2}", e.score.psnr_db)),
    ("5 % below, dB", |e| format!("{:.2}", e.score.psnr_low_db)),
    ("SSIM", |e| format!("{:.4}", e.score.ssim)),
    ("stops", |e| e.score.rmse_stops.map_or_else(|| "–".into(), |stops| format!("{stops:.3}"))),
    ("M answers/s, one core", |e| millions(e.speed.map(|s| s.evals_per_s_core))),
    ("M texels/s, tiles", |e| millions(e.speed.map(|s| s.texels_per_s_core))),
    ("fit, s", |e| e.fit_s.map_or_else(|| "–".into(), |s| format!("{s:.1}"))),
];

fn millions(rate: Option<f64>) -> String {
    rate.map_or_else(|| "–".into(), |rate| format!("{:.2}", rate / 1e6))
}

/// The page: table, plots, and the pictures read back from `report`.
///
/// # Errors
/// Where a picture of the report cannot be read, or a plot cannot be drawn.
pub fn html(comparison: &CodecComparison, report: &OutputFolder) -> Result<String, Error> {
    let title = comparison.material.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let [width, height] = comparison.size;
    let [views, lights] = comparison.directions;
    let mut page = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>{title}</title><style>{STYLE}</style>\n<h1>{title}</h1>\n\
         <p>{width} × {height} texels, {views} views × {lights} lights, {} bytes raw; numbers stored {}.</p>\n",
        comparison.raw_bytes, comparison.precision,
    );
    push_table(&mut page, &comparison.runs);
    page.push_str("<h2>Error against size</h2>\n");
    page.push_str(&error_over(comparison, Axis::BytesPerTexel)?);
    if !comparison.deltas.is_empty() {
        page.push_str("\n<h2>At equal size</h2>\n");
        push_deltas(&mut page, &comparison.deltas);
    }
    page.push_str("\n<h2>Error against time</h2>\n");
    page.push_str(&error_over(comparison, Axis::NanosecondsPerAnswer)?);
    page.push_str(&format!("\n<h2>Original, decoded, {DIFFERENCE_GAIN}× difference</h2>\n"));
    for run in comparison.runs.iter().filter(|run| run.evaluation.is_some()) {
        push_sheet(&mut page, run, report)?;
    }
    page.push_str("</html>\n");
    Ok(page)
}

fn push_table(page: &mut String, runs: &[CodecRun]) {
    page.push_str("<table><tr><th>codec</th>");
    COLUMNS.iter().for_each(|column| page.push_str(&format!("<th>{}</th>", column.0)));
    page.push_str("</tr>\n");
    for run in runs {
        page.push_str(&format!("<tr><td>{}</td>", run.name));
        match &run.evaluation {
            Some(e) => COLUMNS.iter().for_each(|column| page.push_str(&format!("<td>{}</td>", column.1(e)))),
            None => {
                let fault = run.fault.as_deref().unwrap_or("no figures").replace('<', "&lt;");
                page.push_str(&format!("<td colspan=\"{}\">{fault}</td>", COLUMNS.len()));
            }
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</table>\n");
}

/// RMSE of the codec of the row over that of the column, on average over the sizes both have (Bjøntegaard).
fn push_deltas(page: &mut String, deltas: &[Delta]) {
    let mut names: Vec<&str> = deltas.iter().map(|delta| delta.codec).collect();
    names.dedup();
    page.push_str("<table><tr><th>RMSE over that of</th>");
    names.iter().for_each(|name| page.push_str(&format!("<th>{name}</th>")));
    page.push_str("</tr>\n");
    for row in &names {
        page.push_str(&format!("<tr><td>{row}</td>"));
        for column in &names {
            let found = deltas.iter().find(|delta| delta.codec == *row && delta.against == *column);
            let cell = found.map_or_else(|| "–".into(), |d| format!("{:+.2} ({:+.2} dB)", d.rmse, d.psnr_db));
            page.push_str(&format!("<td>{cell}</td>"));
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</table>\n");
}

fn push_sheet(page: &mut String, run: &CodecRun, report: &OutputFolder) -> Result<(), Error> {
    let path = report.path().join(sheet_path(run.name, run.ratio_asked));
    let bytes = std::fs::read(&path).map_err(|fault| Error::Failed(format!("{}: {fault}", path.display())))?;
    let asked = run.ratio_asked.map_or_else(String::new, |ratio| format!(", 1:{ratio} asked"));
    let caption = format!("{}{asked}", run.name);
    let uri = STANDARD.encode(bytes);
    page.push_str(&format!(
        "<figure><img src=\"data:image/png;base64,{uri}\" alt=\"{caption}\"><figcaption>{caption}</figcaption></figure>\n"
    ));
    Ok(())
}
