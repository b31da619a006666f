//! The report as one HTML page that needs no other file and no script.

use super::plot::{self, Figure};
use super::verdict::{measured, ranges};
use super::{FootageMotion, FootageReport, FrameReport, Grade, Thumbnail, dome};
use capture::light::LightKind;
use std::fmt::Write;

const STYLE: &str = include_str!("style.css");
/// Silhouettes that agree less with the others than this are shown in red.
const SUSPECT_AGREEMENT: f64 = 0.95;
/// Reprojection errors above this multiple of the middle one are shown in red.
const SUSPECT_RMS: f64 = 3.0;

const FIGURES: [Figure; 6] = [
    Figure { title: "Reprojection error of the board, px RMS", read: |f| f.rms_px, from_zero: true },
    Figure { title: "Sharpness, relative to the sharp frames", read: |f| f.sharpness, from_zero: true },
    Figure { title: "Blur at the edges of the board, px", read: |f| f.blur_px, from_zero: true },
    Figure { title: "Agreement of the silhouette with the others, IoU", read: |f| f.agreement, from_zero: false },
    Figure { title: "Turn of the platter, °", read: |f| f.angle_deg, from_zero: true },
    Figure { title: "Exposure gain", read: |f| f.exposure_gain, from_zero: false },
];

/// A column of the table: its head, and what a frame has there.
type Column = (&'static str, fn(&FrameReport) -> Option<String>);

const COLUMNS: [Column; 9] = [
    ("time, s", |f| f.time_s.map(|v| format!("{v:.2}"))),
    ("angle, °", |f| f.angle_deg.map(|v| format!("{v:.2}"))),
    ("± °", |f| f.angle_deviation_deg.map(|v| format!("{v:.3}"))),
    ("RMS, px", |f| f.rms_px.map(|v| format!("{v:.3}"))),
    ("corners", |f| f.corners.map(|v| v.to_string())),
    ("blur, px", |f| f.blur_px.map(|v| format!("{v:.2}"))),
    ("sharpness", |f| f.sharpness.map(|v| format!("{v:.2}"))),
    ("agreement", |f| f.agreement.map(|v| format!("{v:.3}"))),
    ("gain", |f| f.exposure_gain.map(|v| format!("{v:.3}"))),
];

/// The page. `pictures` are the frames kept, in the order of the capture.
pub fn html(report: &FootageReport, pictures: &[Thumbnail]) -> String {
    let title = escaped(&report.footage);
    let mut page = format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" \
         content=\"width=device-width\"><title>{title}</title>\n<style>\n{STYLE}</style></head>\n<body><main>\n\
         <h1>{title}</h1>\n<p class=\"facts\">{}</p>\n",
        facts(report)
    );
    push_verdict(&mut page, report);
    push_findings(&mut page, report);
    page.push_str("<div class=\"columns\">\n");
    push_dome(&mut page, report);
    push_cameras(&mut page, report);
    push_dropped(&mut page, report);
    page.push_str("</div>\n");
    push_sheet(&mut page, report, pictures);
    push_plots(&mut page, report);
    push_table(&mut page, report);
    page.push_str("</main></body></html>\n");
    page
}

fn facts(report: &FootageReport) -> String {
    let [width, height] = report.size;
    let motion = match report.motion {
        FootageMotion::Turntable => "turntable before a camera that stands",
        FootageMotion::FreeHand => "camera carried around the object",
        FootageMotion::Unknown => "motion unknown",
    };
    let count = report.frames.len();
    let length = report.duration_s.map_or_else(|| format!("{count} stills"), |s| format!("{count} frames, {s:.1} s"));
    format!("{length} · {width} × {height} px · {motion} · silhouettes: {}", escaped(&report.silhouettes))
}

fn push_verdict(page: &mut String, report: &FootageReport) {
    let (class, word) = match report.grade() {
        Grade::Good => ("good", "good"),
        Grade::Usable => ("usable", "usable, with flaws"),
        Grade::Unusable => ("unusable", "not usable"),
    };
    let text = escaped(&report.verdict().join(" "));
    // Writing to a string cannot fail.
    let _ = writeln!(page, "<section class=\"verdict {class}\"><b>{word}</b><p>{text}</p></section>");
}

fn push_findings(page: &mut String, report: &FootageReport) {
    if !report.film_again.is_empty() {
        page.push_str("<h2>What to film again</h2>\n<ul class=\"findings\">");
        report
            .film_again
            .iter()
            .for_each(|text| page.push_str(&format!("<li class=\"warning\">{}</li>", escaped(text))));
        page.push_str("</ul>\n");
    }
    if !report.findings.is_empty() {
        page.push_str("<h2>Noticed</h2>\n<ul class=\"findings\">");
        for finding in &report.findings {
            let severity = finding.severity;
            let _ = write!(page, "<li class=\"{severity}\"><b>{severity}</b> {}</li>", escaped(&finding.text));
        }
        page.push_str("</ul>\n");
    }
}

fn push_dome(page: &mut String, report: &FootageReport) {
    let Some(svg) = dome::svg(report) else { return };
    let _ = writeln!(
        page,
        "<section class=\"card\"><h2>Directions seen</h2>{svg}<p class=\"small legend\">\
         <span><i class=\"key kept\"></i>kept</span><span><i class=\"key dropped\"></i>left out</span>\
         <span><i class=\"key gap\"></i>missing</span><span>Seen from above; the rim is the horizon.</span></p></section>"
    );
}

fn push_cameras(page: &mut String, report: &FootageReport) {
    page.push_str("<section class=\"card\"><h2>Cameras</h2><table>");
    let mut row = |name: &str, value: String| {
        let _ = write!(page, "<tr><td>{name}</td><td class=\"wrap\">{value}</td></tr>");
    };
    if let Some(lens) = &report.lens {
        row("lens from", escaped(&lens.source));
        row("focal length, px", lens.focal_px.iter().map(|m| measured(m, 2)).collect::<Vec<_>>().join(", "));
        row("principal point, px", lens.principal_px.iter().map(|m| measured(m, 2)).collect::<Vec<_>>().join(", "));
        lens.distortion.iter().for_each(|(name, value)| row(&escaped(name), measured(value, 4)));
    }
    if let Some(board) = &report.board {
        row("board", format!("{}, {} corners", escaped(&board.text), board.corners));
        board.rms_px.iter().for_each(|rms| row("reprojection, px RMS", format!("{rms:.3}")));
    }
    if let Some(axis) = &report.axis {
        let vector = |v: [f64; 3]| v.map(|c| format!("{c:.3}")).join(", ");
        let deviation = |d: Option<f64>| d.map(|d| format!(" ± {d:.3}°")).unwrap_or_default();
        row("axis through", vector(axis.point));
        row("axis along", vector(axis.direction) + &deviation(axis.deviation_deg));
        axis.angle_deviation_deg.iter().for_each(|d| row("angle of a frame", format!("± {d:.3}°")));
    }
    if let Some([min, max]) = report.aabb {
        let size = [0, 1, 2].map(|i| report.unit.map_or(max[i] - min[i], |unit| 1e3 * unit * (max[i] - min[i])));
        let unit = if report.unit.is_some() { "mm" } else { "units" };
        row("box of the object", format!("{} {unit}", size.map(|s| format!("{s:.1}")).join(" × ")));
    }
    if let Some(light) = &report.light {
        let kind = match light.kind {
            LightKind::Room => "stays in the room",
            LightKind::Object => "turns with the object",
            LightKind::Undetermined => "not determined",
        };
        row("light", format!("{kind} (shading follows the turn by {:.1} %)", 100.0 * light.modulation));
    }
    page.push_str("</table>");
    for assumption in report.lens.iter().flat_map(|lens| &lens.assumptions) {
        let _ = write!(page, "<p class=\"small\">Assumed: {}</p>", escaped(assumption));
    }
    page.push_str("</section>\n");
}

fn push_dropped(page: &mut String, report: &FootageReport) {
    let dropped = report.dropped();
    if dropped.is_empty() {
        return;
    }
    page.push_str("<section class=\"card\"><h2>Left out, and why</h2><table>");
    for (why, frames) in dropped {
        let (count, list) = (frames.len(), ranges(&frames));
        let _ = write!(
            page,
            "<tr><td class=\"wrap\">{}<br><small class=\"wrap\">frames {list}</small></td><td>{count}</td></tr>",
            escaped(&why)
        );
    }
    page.push_str("</table></section>\n");
}

fn push_sheet(page: &mut String, report: &FootageReport, pictures: &[Thumbnail]) {
    if pictures.is_empty() {
        return;
    }
    page.push_str("<h2>The frames of the capture</h2>\n");
    for (id, label) in [("outlines", "silhouettes"), ("axes", "world axes: x red, y green, z blue"), ("box", "box")] {
        let _ = write!(page, "<input type=\"checkbox\" id=\"{id}\" checked> <label for=\"{id}\">{label}</label>");
    }
    page.push_str("\n<div class=\"sheet\">\n");
    let mut kept: Vec<&FrameReport> = report.kept().collect();
    kept.sort_by_key(|frame| frame.kept);
    for (frame, picture) in kept.iter().zip(pictures) {
        let class = if is_suspect(frame) { " class=\"suspect\"" } else { "" };
        let name = format!("frame {}", frame.position);
        let parts = [
            frame.angle_deg.map(|angle| format!("{angle:.1}°")),
            frame.rms_px.map(|rms| format!("{rms:.2} px")),
            frame.agreement.map(|agreement| format!("{agreement:.3}")),
        ];
        let caption: String = parts.into_iter().flatten().map(|part| format!("<span>{part}</span>")).collect();
        let _ = writeln!(
            page,
            "<figure{class}>{}<figcaption><b>{}</b>{caption}</figcaption></figure>",
            picture.html(&name),
            frame.position
        );
    }
    page.push_str("</div>\n<p class=\"small\">Below each frame: its number, angle, reprojection error, agreement of its silhouette.</p>\n");
}

fn push_plots(page: &mut String, report: &FootageReport) {
    let plots: Vec<String> = FIGURES.iter().filter_map(|figure| plot::svg(report, figure)).collect();
    if plots.is_empty() {
        return;
    }
    let _ = writeln!(page, "<h2>Frame by frame</h2>\n<div class=\"plots\">{}</div>", plots.concat());
}

fn push_table(page: &mut String, report: &FootageReport) {
    let columns: Vec<&Column> =
        COLUMNS.iter().filter(|(_, read)| report.frames.iter().any(|f| read(f).is_some())).collect();
    let mut rms: Vec<f64> = report.kept().filter_map(|f| f.rms_px).collect();
    rms.sort_by(f64::total_cmp);
    let most_rms = rms.get(rms.len() / 2).map_or(f64::INFINITY, |middle| SUSPECT_RMS * middle);
    page.push_str("<h2>All frames</h2>\n<div class=\"scroll\"><table><thead><tr><th>frame</th>");
    columns.iter().for_each(|(head, _)| page.push_str(&format!("<th>{head}</th>")));
    page.push_str("<th class=\"left\">in the capture</th></tr></thead><tbody>\n");
    for frame in &report.frames {
        let class = if frame.kept.is_some() { "" } else { " class=\"out\"" };
        let _ = write!(page, "<tr{class}><td>{}</td>", frame.position);
        for (head, read) in &columns {
            let is_off = match *head {
                "RMS, px" => frame.rms_px.is_some_and(|rms| rms > most_rms),
                "agreement" => is_suspect(frame),
                _ => false,
            };
            let class = if is_off { " class=\"off\"" } else { "" };
            let _ = write!(page, "<td{class}>{}</td>", read(frame).unwrap_or_else(|| "–".to_owned()));
        }
        let state = match (&frame.dropped, frame.kept) {
            (_, Some(at)) => format!("view {at}"),
            (Some(why), None) => escaped(&why.to_string()),
            (None, None) => "–".to_owned(),
        };
        let _ = writeln!(page, "<td class=\"left\">{state}</td></tr>");
    }
    page.push_str("</tbody></table></div>\n");
}

fn is_suspect(frame: &FrameReport) -> bool {
    frame.agreement.is_some_and(|agreement| agreement < SUSPECT_AGREEMENT)
}

pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
