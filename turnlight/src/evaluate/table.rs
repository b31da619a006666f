//! A comparison as text and as CSV.

use super::{Comparison, MethodFigures};
use std::fmt::Write;

/// A column: its name, how it is read off a row, decimals in the text table.
type Column = (&'static str, fn(&MethodFigures) -> Option<f64>, usize);

/// The figures in the order every table shows them.
pub(super) const COLUMNS: [Column; 18] = [
    ("error_mean_pct", |m| Some(m.error_mean_pct), 3),
    ("error_max_pct", |m| Some(m.error_max_pct), 3),
    ("error_variance", |m| Some(m.error_variance), 3),
    ("error_union_pct", |m| Some(m.error_union_pct), 3),
    ("error_inner_pct", |m| m.error_inner_pct, 3),
    ("psnr_db", |m| Some(m.psnr_db), 2),
    ("psnr_full_db", |m| Some(m.psnr_full_db), 2),
    ("ssim", |m| Some(m.ssim), 4),
    ("mask_iou", |m| Some(m.mask_iou), 4),
    ("hole_pct", |m| Some(m.hole_pct), 3),
    ("spill_pct", |m| Some(m.spill_pct), 3),
    ("seam", |m| m.seam, 3),
    ("temporal", |m| m.temporal, 4),
    ("bytes", |m| Some(m.bytes as f64), 0),
    ("bytes_raw", |m| Some(m.bytes_raw as f64), 0),
    ("build_s", |m| Some(m.build_s), 2),
    ("frame_ms", |m| Some(m.frame_ms), 1),
    ("frame_width", |m| Some(m.frame_width as f64), 0),
];

/// One line per method, figures in full.
pub fn csv(comparison: &Comparison) -> String {
    let mut out = String::from("method");
    COLUMNS.iter().for_each(|(name, ..)| out.extend([",", name]));
    for method in &comparison.methods {
        out.extend(["\n", method.method]);
        for (_, read, _) in COLUMNS {
            out.push(',');
            if let Some(value) = read(method) {
                // Writing to a string cannot fail.
                let _ = write!(out, "{value}");
            }
        }
    }
    out.push('\n');
    out
}

/// What a person reads: methods side by side.
pub fn text(comparison: &Comparison) -> String {
    let mut out = format!(
        "{}: {} views fitted, {} scored, {} left out\n{:<16}",
        comparison.capture,
        comparison.train.len(),
        comparison.test.len(),
        comparison.left_out.len(),
        ""
    );
    comparison.methods.iter().for_each(|m| out.push_str(&format!("{:>12}", m.method)));
    for column in &COLUMNS {
        out.push_str(&format!("\n{:<16}", column.0));
        comparison.methods.iter().for_each(|m| out.push_str(&format!("{:>12}", cell(column, m))));
    }
    out.push('\n');
    if let Some(geometry) = &comparison.geometry {
        out.push_str(&format!("{}\n", geometry.text()));
    }
    out
}

/// A figure as tables show it; a dash where there is none.
pub(super) fn cell((_, read, decimals): &Column, method: &MethodFigures) -> String {
    read(method).map_or_else(|| "–".to_owned(), |value| format!("{value:.decimals$}"))
}
