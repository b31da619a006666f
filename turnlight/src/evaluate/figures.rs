//! The records of a comparison, and how views are averaged.

use super::{Cost, Judged};
use crate::stages::Stage;
use crate::truth::TruthFigures;
use serde::Serialize;
use texture::Method;
use texture::metrics::ViewScore;

/// What a comparison found.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// What was compared on.
    pub capture: String,
    /// Positions of the views fitted.
    pub train: Vec<usize>,
    /// Positions of the views scored.
    pub test: Vec<usize>,
    /// Positions asked for and left out: fitted themselves, or within 2° of a view that was.
    pub left_out: Vec<usize>,
    /// How near the shape comes to the truth, where the truth is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub geometry: Option<TruthFigures>,
    /// What the stages cost.
    pub stages: Vec<Stage>,
    /// One row per method.
    pub methods: Vec<MethodFigures>,
}

/// The figures of one method: means over the test views unless the name says otherwise.
#[derive(Clone, Debug, Serialize)]
pub struct MethodFigures {
    /// `static`, `vdtm`, `lumigraph` or `dyntex`.
    pub method: &'static str,
    /// Mean absolute error over the reference mask, % of 255.
    pub error_mean_pct: f64,
    /// Its maximum over views.
    pub error_max_pct: f64,
    /// Its population variance over views.
    pub error_variance: f64,
    /// Mean absolute error over the union of both masks.
    pub error_union_pct: f64,
    /// Mean absolute error inside both masks, away from the rim.
    pub error_inner_pct: Option<f64>,
    /// PSNR over the mask.
    pub psnr_db: f64,
    /// PSNR over the frame.
    pub psnr_full_db: f64,
    /// Structural similarity over the mask.
    pub ssim: f64,
    /// Intersection over union of the masks.
    pub mask_iou: f64,
    /// Mask not rendered, % of the mask.
    pub hole_pct: f64,
    /// Rendered outside the mask, % of the mask.
    pub spill_pct: f64,
    /// Jump across facet borders beyond the photograph's, % of 255; `None` where no border is seen.
    pub seam: Option<f64>,
    /// Second difference of intensity along a smooth path, % of 255.
    pub temporal: Option<f64>,
    /// Appearance as stored in the file.
    pub bytes: u64,
    /// Appearance as raw 8-bit layers.
    pub bytes_raw: u64,
    /// Seconds to fit, with what all methods share of it.
    pub build_s: f64,
    /// Median milliseconds per frame, from the eye to the picture.
    pub frame_ms: f64,
    /// Its width in pixels.
    pub frame_width: usize,
    /// Its height in pixels.
    pub frame_height: usize,
    /// What rendered it.
    pub frame_device: String,
    /// The views one by one.
    pub views: Vec<ViewFigures>,
}

/// The figures of one view, each rounded to six decimals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ViewFigures {
    /// Its position in the capture.
    pub view: usize,
    /// The score, under its own names.
    #[serde(flatten)]
    pub score: ViewScore,
}

impl ViewFigures {
    pub(super) fn new(view: usize, score: &ViewScore) -> Self {
        let score = ViewScore {
            error_mean_pct: round6(score.error_mean_pct),
            error_union_pct: round6(score.error_union_pct),
            error_inner_pct: score.error_inner_pct.map(round6),
            psnr_db: round6(score.psnr_db),
            psnr_full_db: round6(score.psnr_full_db),
            ssim: round6(score.ssim),
            mask_iou: round6(score.mask_iou),
            hole_pct: round6(score.hole_pct),
            spill_pct: round6(score.spill_pct),
        };
        Self { view, score }
    }
}

impl MethodFigures {
    pub(super) fn new(method: Method, cost: Cost, judged: Judged) -> Self {
        let views = judged.views;
        let over = |figure: fn(&ViewFigures) -> f64| views.iter().map(figure).collect::<Vec<f64>>();
        let mean_of = |figure: fn(&ViewFigures) -> f64| round6(mean(&over(figure)));
        let errors = over(|v| v.score.error_mean_pct);
        let inner: Vec<f64> = views.iter().filter_map(|v| v.score.error_inner_pct).collect();
        Self {
            method: method.name(),
            error_mean_pct: round6(mean(&errors)),
            error_max_pct: round6(errors.iter().copied().fold(0.0, f64::max)),
            error_variance: round6(variance(&errors)),
            error_union_pct: mean_of(|v| v.score.error_union_pct),
            error_inner_pct: (!inner.is_empty()).then(|| round6(mean(&inner))),
            psnr_db: mean_of(|v| v.score.psnr_db),
            psnr_full_db: mean_of(|v| v.score.psnr_full_db),
            ssim: mean_of(|v| v.score.ssim),
            mask_iou: mean_of(|v| v.score.mask_iou),
            hole_pct: mean_of(|v| v.score.hole_pct),
            spill_pct: mean_of(|v| v.score.spill_pct),
            seam: judged.seam,
            temporal: judged.temporal,
            bytes: cost.bytes,
            bytes_raw: cost.bytes_raw,
            build_s: cost.build_s,
            frame_ms: judged.frame_ms,
            frame_width: judged.frame_size[0],
            frame_height: judged.frame_size[1],
            frame_device: format!("cpu, {} threads", rayon::current_num_threads()),
            views,
        }
    }
}

/// To six decimals, as reports print figures.
pub(super) fn round6(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn variance(values: &[f64]) -> f64 {
    let center = mean(values);
    values.iter().map(|v| (v - center).powi(2)).sum::<f64>() / values.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn averages_have_their_textbook_values() {
        assert_eq!(variance(&[1.0, 3.0]), 1.0);
        assert_eq!(round6(0.123_456_78), 0.123_457);
    }
}
