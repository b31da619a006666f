use super::*;
use capture::{Aabb, Camera, Image, Intrinsics};
use nalgebra::{Matrix3, Point3, Vector3};

fn frame(position: usize) -> FrameReport {
    let angle = 30.0 * position as f64;
    FrameReport {
        position,
        name: format!("film.mp4 frame {position}"),
        time_s: Some(0.5 * position as f64),
        kept: Some(position),
        dropped: None,
        pose: PoseSource::Measured,
        angle_deg: Some(angle),
        angle_deviation_deg: Some(0.004),
        direction: Some([angle.to_radians().cos(), -angle.to_radians().sin(), 0.5]),
        rms_px: Some(0.1),
        corners: Some(30),
        sharpness: Some(1.0),
        blur_px: Some(0.2),
        agreement: Some(0.98 + 0.001 * position as f64),
        exposure_gain: Some(1.0),
    }
}

/// A turn of twelve frames, all well.
fn report() -> FootageReport {
    let exactly = |value| Measured { value, deviation: None };
    FootageReport {
        footage: "cup & <saucer>.mp4".to_owned(),
        motion: FootageMotion::Turntable,
        duration_s: Some(6.0),
        size: [640, 480],
        frames: (0..12).map(frame).collect(),
        coverage: Coverage {
            turns: Some(1.0),
            is_closed: true,
            step_deg: Some(30.0),
            gaps: Vec::new(),
            up: [0.0, 0.0, 1.0],
        },
        lens: Some(LensReport {
            focal_px: [Measured { value: 588.81, deviation: Some(0.42) }; 2],
            principal_px: [exactly(320.0), exactly(240.0)],
            distortion: vec![("k1".to_owned(), exactly(-0.06))],
            source: "this footage".to_owned(),
            assumptions: vec!["The pixels are square.".to_owned()],
        }),
        board: Some(BoardReport { text: "charuco:7x7".to_owned(), corners: 36, rms_px: Some(0.118) }),
        axis: Some(AxisReport {
            point: [0.0; 3],
            direction: [0.0, 0.0, 1.0],
            deviation_deg: Some(0.02),
            angle_deviation_deg: Some(0.004),
        }),
        silhouettes: "masks given".to_owned(),
        light: None,
        aabb: Some([[0.0; 3], [0.1, 0.2, 0.3]]),
        unit: Some(1.0),
        findings: Vec::new(),
        film_again: Vec::new(),
    }
}

fn camera() -> Camera {
    let intrinsics = Intrinsics::pinhole(800.0, [640, 480]);
    Camera { intrinsics, rotation: Matrix3::identity(), translation: Vector3::new(0.0, 0.0, 2.0) }
}

fn thumbnail(overlay: &Overlay) -> Thumbnail {
    let mut matte = Image::filled(640, 480, 0);
    (200..280).for_each(|y| (280..360).for_each(|x| matte.set(x, y, 255)));
    Thumbnail::new(&Image::filled(640, 480, [90, 120, 60]), &matte, &camera(), overlay).unwrap()
}

fn overlay() -> Overlay {
    Overlay::of_box(Some(Aabb { min: Point3::new(-0.1, -0.1, -0.1), max: Point3::new(0.1, 0.1, 0.1) }))
}

#[test]
fn the_verdict_is_three_sentences_with_the_figures() {
    let [first, second, third] = report().verdict();
    assert_eq!(report().grade(), Grade::Good);
    assert_eq!(first, "12 of 12 frames make the capture, all around in steps of 30.0°.");
    assert_eq!(
        second,
        "The board reprojects to 0.12 px RMS, the focal length is 588.8 ± 0.4 px, the axis is known to 0.020° and \
         silhouettes agree to 0.986 in the middle and 0.980 at worst (frame 0)."
    );
    assert_eq!(third, "Nothing needs filming again.");
}

#[test]
fn gaps_and_findings_lower_the_grade_and_say_what_to_do() {
    let mut report = report();
    report.coverage.gaps = vec![Gap { from_deg: 120.0, to_deg: 180.0 }];
    report.coverage.is_closed = false;
    assert_eq!(report.grade(), Grade::Usable);
    assert!(report.verdict()[0].contains("around 300° of 360°"));
    assert_eq!(report.verdict()[2], "Film again between 120° and 180°.");
    report.findings.push(Finding { severity: Severity::Fault, text: "The camera moved.".to_owned() });
    assert_eq!(report.grade(), Grade::Unusable);
    assert_eq!(report.verdict()[0], "This footage makes no capture as it is, though 12 of 12 frames have cameras.");
    assert_eq!(report.verdict()[2], "The camera moved.");
}

#[test]
fn the_page_needs_no_other_file_and_escapes_names() {
    let page = html(&report(), &vec![thumbnail(&overlay()); 12]);
    assert!(page.contains("cup &amp; &lt;saucer&gt;.mp4") && !page.contains("<saucer>"));
    assert_eq!(page.matches("data:image/jpeg;base64,").count(), 12);
    for outside in ["http:", "https:", "<script", "url(", "<link"] {
        assert!(!page.contains(outside), "{outside}");
    }
    assert!(!page.contains("NaN") && !page.contains("inf "));
    assert!(page.contains("100.0 × 200.0 × 300.0 mm") && page.contains("588.81 ± 0.42"));
    assert!(page.contains("± 0.020°") && page.contains("± 0.004°"));
}

#[test]
fn the_outline_and_the_box_lie_where_the_camera_sees_them() {
    let picture = thumbnail(&overlay()).html("a");
    // Reduced by two: the square of 80 pixels about (320, 240) becomes 40 about (160, 120).
    let outline = picture.split("class=\"outline\" d=\"").nth(1).and_then(|rest| rest.split('"').next()).unwrap();
    assert!(outline.starts_with("M140") && outline.len() < 120, "{outline}");
    // x runs from the middle to the right: 0.1 units at 2 with f = 800 are 40 pixels, 20 here.
    assert!(picture.contains("class=\"axis x\" d=\"M160 120"), "{picture}");
    // Cut to the box, 0.1 units at 1.9 or 42.1 pixels and 12.6 of room to each side, nothing is reduced.
    let cut = thumbnail(&overlay().cut_to_box([&camera()])).html("a");
    assert!(cut.contains("width=\"110\" height=\"110\"") && cut.contains("class=\"axis x\" d=\"M55 55"), "{cut}");
    let behind = Overlay { origin: Point3::new(0.0, 0.0, -5.0), ..overlay() };
    assert!(thumbnail(&behind).html("a").contains("class=\"axis x\" d=\"\""));
}

#[test]
fn dropped_frames_are_grouped_and_listed_in_ranges() {
    let mut report = report();
    for (position, reason) in [(3, DropReason::Blurred), (4, DropReason::Blurred), (9, DropReason::Blurred)] {
        report.frames[position].kept = None;
        report.frames[position].dropped = Some(Dropping::Choice(reason));
    }
    report.frames[5].kept = None;
    report.frames[5].dropped = Some(Dropping::Silhouette);
    let text = report.text();
    assert!(text.contains("left out, blurred: frames 3–4, 9"), "{text}");
    assert!(text.contains("silhouette contradicts the others: frames 5"), "{text}");
    let page = html(&report, &[]);
    assert!(page.contains("frames 3–4, 9"));
}

#[test]
fn footage_that_gave_nothing_has_a_page_too() {
    let nothing = FootageReport {
        frames: vec![FrameReport {
            kept: None,
            pose: PoseSource::Missing,
            angle_deg: None,
            direction: None,
            rms_px: None,
            ..frame(0)
        }],
        coverage: Coverage::default(),
        lens: None,
        board: None,
        axis: None,
        aabb: None,
        duration_s: None,
        motion: FootageMotion::Unknown,
        film_again: vec!["Put a board under the object.".to_owned()],
        ..report()
    };
    assert_eq!(nothing.grade(), Grade::Unusable);
    let page = html(&nothing, &[]);
    assert!(page.contains("makes no capture: 0 of 1 stills") && page.contains("Put a board under the object."));
    assert_eq!(html(&FootageReport { frames: Vec::new(), ..nothing.clone() }, &[]).matches("<tr>").count(), 1);
}

#[test]
fn frames_are_drawn_where_the_camera_was() {
    let carried = FootageReport { motion: FootageMotion::FreeHand, axis: None, ..report() };
    let page = html(&carried, &[]);
    // Frame 3 was turned by 90°; its camera was at −y, half as high as far.
    assert!(page.contains("frame 3: 270.0°, 26.6° up"), "direction, not turn");
    assert!(html(&report(), &[]).contains("frame 3: 270.0°, 26.6° up"), "of a turntable too");
    assert!(carried.verdict()[0].contains("carried all around"));
}

#[test]
fn the_json_has_the_verdict_and_units_in_its_names() {
    let json = report().json();
    assert_eq!(json["grade"], "good");
    assert_eq!(json["verdict"].as_array().map(Vec::len), Some(3));
    assert_eq!(json["frames"][2]["angle_deg"], 60.0);
    assert_eq!(json["frames"][2]["angle_deviation_deg"], 0.004);
    assert_eq!(json["lens"]["focal_px"][0]["deviation"], 0.42);
}
