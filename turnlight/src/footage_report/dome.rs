//! Directions of view, seen from above: the zenith in the middle, the horizon at the rim.

use super::{FootageReport, FrameReport};
use capture::choose::azimuth;
use nalgebra::Vector3;
use std::fmt::Write;

const SIZE: f64 = 420.0;
/// Radius of the horizon.
const RIM: f64 = 172.0;
/// Half the width of what a gap's wedge covers around the elevations filmed, degrees.
const WEDGE_DEG: f64 = 6.0;

/// A direction of view in degrees: azimuth counter-clockwise, elevation above the table.
#[derive(Clone, Copy)]
struct Seen {
    azimuth: f64,
    elevation: f64,
}

/// The plot as an SVG element, or `None` where no direction is known.
pub(super) fn svg(report: &FootageReport) -> Option<String> {
    let seen: Vec<(&FrameReport, Seen)> = report.frames.iter().filter_map(|f| Some((f, seen(report, f)?))).collect();
    if seen.is_empty() {
        return None;
    }
    let mut svg = format!(
        "<svg class=\"dome\" viewBox=\"0 0 {SIZE} {SIZE}\" role=\"img\" aria-label=\"directions of view from above\">"
    );
    push_grid(&mut svg);
    push_gaps(&mut svg, report, &seen);
    // Kept frames last, on top.
    for wants_kept in [false, true] {
        for (frame, seen) in seen.iter().filter(|(frame, _)| frame.kept.is_some() == wants_kept) {
            push_dot(&mut svg, frame, *seen);
        }
    }
    svg.push_str("</svg>");
    Some(svg)
}

/// The side from which the object is seen: gaps are named so too.
fn seen(report: &FootageReport, frame: &FrameReport) -> Option<Seen> {
    let up = Vector3::from(report.coverage.up).try_normalize(1e-12)?;
    let direction = Vector3::from(frame.direction?).try_normalize(1e-12)?;
    Some(Seen {
        azimuth: azimuth(&direction, &up).to_degrees(),
        elevation: direction.dot(&up).clamp(-1.0, 1.0).asin().to_degrees(),
    })
}

/// Where a direction lies in the plot; below the horizon it goes on outwards.
fn place(seen: Seen) -> [f64; 2] {
    let (sin, cos) = seen.azimuth.to_radians().sin_cos();
    let radius = RIM * (1.0 - seen.elevation / 90.0).min(1.12);
    [0.5 * SIZE + radius * cos, 0.5 * SIZE - radius * sin]
}

fn push_grid(svg: &mut String) {
    let middle = 0.5 * SIZE;
    for elevation in [0, 30, 60] {
        let radius = RIM * (1.0 - f64::from(elevation) / 90.0);
        // Writing to a string cannot fail.
        let _ = write!(svg, "<circle class=\"grid\" cx=\"{middle}\" cy=\"{middle}\" r=\"{radius:.1}\"/>");
    }
    for elevation in [30, 60] {
        let [x, y] = place(Seen { azimuth: 75.0, elevation: f64::from(elevation) });
        let _ = write!(svg, "<text x=\"{x:.1}\" y=\"{:.1}\">{elevation}° up</text>", y + 14.0);
    }
    for azimuth in (0..360).step_by(30) {
        let at = |elevation| place(Seen { azimuth: f64::from(azimuth), elevation });
        let ([x1, y1], [x2, y2]) = (at(90.0), at(0.0));
        let _ = write!(svg, "<line class=\"grid\" x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\"/>");
        let (sin, cos) = f64::from(azimuth).to_radians().sin_cos();
        let (x, y) = (middle + (RIM + 22.0) * cos, middle - (RIM + 22.0) * sin + 4.0);
        let _ = write!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\">{azimuth}°</text>");
    }
}

/// A wedge over each gap, at the elevations of the frames kept.
fn push_gaps(svg: &mut String, report: &FootageReport, seen: &[(&FrameReport, Seen)]) {
    let elevations = seen.iter().filter(|(f, _)| f.kept.is_some()).map(|(_, s)| s.elevation);
    let [low, high] = elevations.fold([90.0, -90.0], |[l, h]: [f64; 2], e| [l.min(e), h.max(e)]);
    let [low, high] = if low > high { [0.0, 90.0] } else { [(low - WEDGE_DEG).max(0.0), (high + WEDGE_DEG).min(90.0)] };
    for gap in &report.coverage.gaps {
        let steps = ((gap.to_deg - gap.from_deg) / 3.0).ceil().max(1.0) as usize;
        let along = |elevation: f64| {
            (0..=steps).map(move |k| {
                let azimuth = gap.from_deg + (gap.to_deg - gap.from_deg) * k as f64 / steps as f64;
                place(Seen { azimuth, elevation })
            })
        };
        let points = along(low).chain(along(high).collect::<Vec<_>>().into_iter().rev());
        let text: Vec<String> = points.map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        let _ = write!(
            svg,
            "<polygon class=\"gap\" points=\"{}\"><title>nothing seen {gap}</title></polygon>",
            text.join(" ")
        );
    }
}

fn push_dot(svg: &mut String, frame: &FrameReport, seen: Seen) {
    let [x, y] = place(seen);
    let (class, radius, why) = match &frame.dropped {
        Some(why) if frame.kept.is_none() => ("dropped", 2.4, format!(", left out: {why}")),
        _ => ("kept", 4.2, String::new()),
    };
    let _ = write!(
        svg,
        "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\"><title>frame {}: {:.1}°, {:.1}° up{}</title></circle>",
        frame.position,
        seen.azimuth.rem_euclid(360.0),
        seen.elevation,
        super::page::escaped(&why),
    );
}
