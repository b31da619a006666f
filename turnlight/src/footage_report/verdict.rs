//! The whole report in three sentences, and in one word.

use super::{Dropping, FootageMotion, FootageReport, FrameReport, Measured, Severity};
use serde::Serialize;
use std::collections::BTreeMap;

/// Fewer views than this make no hull worth the name.
const FEW_VIEWS: usize = 8;

/// The report in one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Grade {
    /// Nothing to mend.
    Good,
    /// Can be used; something will show in the model.
    Usable,
    /// Cannot be used.
    Unusable,
}

impl FootageReport {
    /// The report in one word.
    pub fn grade(&self) -> Grade {
        let gravest = self.findings.iter().map(|f| f.severity).min();
        let kept = self.kept().count();
        match gravest {
            _ if kept < 2 => Grade::Unusable,
            Some(Severity::Fault) => Grade::Unusable,
            Some(Severity::Warning) => Grade::Usable,
            _ if kept < FEW_VIEWS || !self.film_again.is_empty() || !self.coverage.gaps.is_empty() => Grade::Usable,
            _ => Grade::Good,
        }
    }

    /// The whole in three sentences: whether it can be used, how exact it is, what to mind.
    pub fn verdict(&self) -> [String; 3] {
        [usability(self), precision(self), advice(self)]
    }

    /// Frames left out, by reason, the commonest first.
    pub fn dropped(&self) -> Vec<(String, Vec<usize>)> {
        let mut groups: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for frame in &self.frames {
            if let Some(why) = &frame.dropped {
                groups.entry(why.to_string()).or_default().push(frame.position);
            }
        }
        let mut groups: Vec<_> = groups.into_iter().collect();
        groups.sort_by_key(|(_, frames)| std::cmp::Reverse(frames.len()));
        groups
    }

    /// What a person reads on the command line.
    pub fn text(&self) -> String {
        let mut lines = vec![self.verdict().join(" ")];
        let dropped = self.dropped().into_iter();
        lines.extend(dropped.map(|(why, frames)| format!("left out, {why}: frames {}", ranges(&frames))));
        lines.extend(self.findings.iter().map(|finding| format!("{}: {}", finding.severity, finding.text)));
        lines.extend(self.film_again.iter().skip(1).map(|again| format!("film again: {again}")));
        lines.join("\n")
    }

    /// As a program reads it: the report with its grade and verdict.
    pub fn json(&self) -> serde_json::Value {
        let mut json = serde_json::json!({ "grade": self.grade(), "verdict": self.verdict() });
        if let (Some(all), serde_json::Value::Object(report)) = (json.as_object_mut(), serde_json::json!(self)) {
            all.extend(report);
        }
        json
    }
}

fn usability(report: &FootageReport) -> String {
    let (kept, all) = (report.kept().count(), report.frames.len());
    let what = if report.is_stills() { "stills" } else { "frames" };
    match report.grade() {
        Grade::Unusable if kept < 2 => format!("This footage makes no capture: {kept} of {all} {what} can be used."),
        Grade::Unusable => {
            format!("This footage makes no capture as it is, though {kept} of {all} {what} have cameras.")
        }
        _ => format!("{kept} of {all} {what} make the capture, {}.", covered(report)),
    }
}

fn covered(report: &FootageReport) -> String {
    let coverage = &report.coverage;
    let step = coverage.step_deg.map(|step| format!(" in steps of {step:.1}°")).unwrap_or_default();
    let carried = if report.motion == FootageMotion::FreeHand { "carried " } else { "" };
    match coverage.turns {
        _ if coverage.is_closed => format!("{carried}all around{step}"),
        Some(_) => {
            let missing: f64 = coverage.gaps.iter().map(|gap| gap.to_deg - gap.from_deg).sum();
            format!("{carried}around {:.0}° of 360°{step}", 360.0 - missing)
        }
        None => "from directions not yet known".to_owned(),
    }
}

fn precision(report: &FootageReport) -> String {
    let mut parts = Vec::new();
    if let Some(rms) = report.board.as_ref().and_then(|board| board.rms_px) {
        parts.push(format!("the board reprojects to {rms:.2} px RMS"));
    }
    if let Some(lens) = &report.lens {
        parts.push(format!("the focal length is {} px", measured(&lens.focal_px[0], 1)));
    }
    if let Some(deviation) = report.axis.as_ref().and_then(|axis| axis.deviation_deg) {
        parts.push(format!("the axis is known to {deviation:.3}°"));
    }
    if let Some((middle, worst)) = agreement(report) {
        let at = worst.position;
        let worst = worst.agreement.unwrap_or(middle);
        parts.push(format!("silhouettes agree to {middle:.3} in the middle and {worst:.3} at worst (frame {at})"));
    }
    match parts.as_slice() {
        [] => "How exact the cameras are was not measured.".to_owned(),
        [only] => format!("{}.", capitalised(only)),
        [most @ .., last] => format!("{} and {last}.", capitalised(&most.join(", "))),
    }
}

/// The middle agreement of the frames kept, and the frame with the worst.
fn agreement(report: &FootageReport) -> Option<(f64, &FrameReport)> {
    let mut frames: Vec<&FrameReport> = report.kept().filter(|f| f.agreement.is_some()).collect();
    frames.sort_by(|a, b| a.agreement.unwrap_or(1.0).total_cmp(&b.agreement.unwrap_or(1.0)));
    Some((frames.get(frames.len() / 2)?.agreement?, frames.first()?))
}

fn advice(report: &FootageReport) -> String {
    let finding = report.findings.iter().find(|finding| finding.severity < Severity::Note);
    match (report.film_again.first(), finding) {
        (Some(again), _) => again.clone(),
        (None, Some(finding)) => finding.text.clone(),
        _ if report.grade() == Grade::Good => "Nothing needs filming again.".to_owned(),
        _ => match report.coverage.gaps.first() {
            Some(gap) => format!("Film again {gap}."),
            None => "More views would make a better model.".to_owned(),
        },
    }
}

impl std::fmt::Display for Dropping {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Choice(reason) => reason.fmt(f),
            Self::Silhouette => f.write_str("silhouette contradicts the others"),
            Self::Other(why) => f.write_str(why),
        }
    }
}

impl std::fmt::Display for Severity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Fault => "fault",
            Self::Warning => "warning",
            Self::Note => "note",
        })
    }
}

/// A value with its deviation.
pub(super) fn measured(value: &Measured, decimals: usize) -> String {
    match value.deviation {
        Some(deviation) => format!("{:.decimals$} ± {deviation:.decimals$}", value.value),
        None => format!("{:.decimals$}", value.value),
    }
}

/// Ascending positions, neighbours joined: `0–4, 9`.
pub(super) fn ranges(positions: &[usize]) -> String {
    let mut runs: Vec<[usize; 2]> = Vec::new();
    for &at in positions {
        match runs.last_mut() {
            Some(run) if run[1] + 1 == at => run[1] = at,
            _ => runs.push([at, at]),
        }
    }
    let word = |[from, to]: &[usize; 2]| if from == to { from.to_string() } else { format!("{from}–{to}") };
    runs.iter().map(word).collect::<Vec<_>>().join(", ")
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}
