//! From films to captures: good footage, and every kind of bad footage.
#![cfg(feature = "video")]

use capture::Image;
use capture::calibrate::{LensParameter, Motion};
use capture::footage::Footage;
use capture::video::{FilmWriter, WriteOptions};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use tests::cartoon::{Cartoon, Drawn};
use tests::{iou, turnlight};
use turnlight::footage::{CapturedFootage, FootageOptions, capture_footage};
use turnlight::stages::{Silent, Stages};

/// A platter that does not turn evenly: the angle of each frame of `turns` turns.
fn angles(frames: usize, turns: f64) -> Vec<f64> {
    let even = |k: usize| TAU * turns * k as f64 / frames as f64;
    (0..frames).map(|k| even(k) + 0.04 * (even(k) + 1.0).sin()).collect()
}

fn write_film(path: &Path, frames: &[Image<[u8; 3]>]) {
    write_film_of(path, frames, WriteOptions::default().fps);
}

/// With so many frames a second.
fn write_film_of(path: &Path, frames: &[Image<[u8; 3]>], fps: f64) {
    let size = [frames[0].width(), frames[0].height()];
    let mut film = FilmWriter::create(path, size, &WriteOptions { fps, ..WriteOptions::default() }).expect("a codec");
    frames.iter().for_each(|frame| film.push(frame).expect("a frame"));
    film.finish().expect("a film");
}

fn draw(cartoon: &Cartoon, angles: &[f64]) -> Vec<Drawn> {
    angles.iter().map(|&angle| cartoon.frame(angle)).collect()
}

fn images(drawn: &[Drawn]) -> Vec<Image<[u8; 3]>> {
    drawn.iter().map(|frame| frame.image.clone()).collect()
}

/// A film of the cartoon in a folder of its own.
fn film_of(frames: &[Image<[u8; 3]>]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("film.mp4");
    write_film(&path, frames);
    (folder, path)
}

fn captured(path: &Path, options: &FootageOptions) -> CapturedFootage {
    let footage = Footage::open(&[path.to_owned()]).expect("footage");
    let output = path.with_extension("capture");
    let found = capture_footage(&footage, options, &output, &mut Stages::new(&Silent));
    found.unwrap_or_else(|fault| panic!("{}: {fault}", path.display()))
}

/// Shares of the true silhouettes that are too much and too little.
fn errors(found: &CapturedFootage, drawn: &[Drawn]) -> [f64; 2] {
    let (mut extra, mut missing, mut all) = (0, 0, 0);
    for (&at, matte) in found.selected.kept.iter().zip(&found.silhouettes.mattes) {
        for (&f, &t) in matte.pixels().iter().zip(drawn[at].matte.pixels()) {
            extra += usize::from(f >= 128 && t < 128);
            missing += usize::from(f < 128 && t >= 128);
            all += usize::from(t >= 128);
        }
    }
    [extra, missing].map(|count| count as f64 / all as f64)
}

/// Of the silhouettes with the truth.
fn mean_iou(found: &CapturedFootage, drawn: &[Drawn]) -> f64 {
    let ious = found.selected.kept.iter().zip(&found.silhouettes.mattes).map(|(&at, m)| iou(m, &drawn[at].matte));
    ious.sum::<f64>() / found.selected.kept.len() as f64
}

#[test]
fn a_film_of_a_turntable_becomes_a_capture() {
    let cartoon = Cartoon::default();
    let angles = angles(48, 1.08);
    let drawn = draw(&cartoon, &angles);
    let (_folder, path) = film_of(&images(&drawn));
    let found = captured(&path, &FootageOptions { board: Some(cartoon.board), ..FootageOptions::default() });
    let turntable = found.shots.turntable().expect("a turntable");
    let axis = turntable.axis_direction.z.clamp(-1.0, 1.0).acos().to_degrees();
    let off = |(k, shot): (usize, &turnlight::footage::Shot)| {
        let found = shot.angle.expect("an angle");
        ((found - (angles[k] - angles[0])).abs()).to_degrees()
    };
    let worst = found.shots.shots.iter().enumerate().map(off).fold(0.0, f64::max);
    let calibration = found.shots.calibration.as_ref().expect("calibrated");
    let (lens, focal) = (calibration.intrinsics, calibration.lens.terms[0]);
    let (mean, [extra, missing]) = (mean_iou(&found, &drawn), errors(&found, &drawn));
    println!("axis off by {axis:.4}°, angles by {worst:.4}°; {lens:?}, {focal:?}");
    println!("{} kept, IoU {mean:.4}, too much {extra:.4}, too little {missing:.4}", found.kept.len());
    found.shots.findings.iter().for_each(|finding| println!("{finding}"));
    assert!(axis < 0.1, "{axis}");
    assert!(worst < 0.1, "{worst}");
    // A flat board at one height tells the focal length to so much only.
    assert!(focal.parameter == LensParameter::Focal && focal.deviation < 0.01 * lens.fx, "{focal:?}");
    assert!((lens.fx - cartoon.lens().fx).abs() < 3.0 * focal.deviation, "{focal:?}");
    // Balls of ninety and sixty pixels: half a pixel of rim, in the mean, is a fortieth of them. It leans outward by a
    // third of a pixel, since cuts decide what belongs to the object.
    assert!(mean > 0.975 && (extra - missing).abs() < 0.02, "{mean} {extra} {missing}");
    // One turn is kept, what is beyond shows it again.
    assert!((40..=46).contains(&found.kept.len()), "{}", found.kept.len());
}

/// Runs the command on a film and returns what it complains of.
fn complaint(path: &Path, more: &[&str]) -> String {
    let folder = path.parent().expect("a folder");
    let film = path.file_name().expect("a name").to_string_lossy();
    let run = turnlight(folder, &[&["capture", &*film, "-o", "capture"][..], more].concat());
    assert_eq!(run.code, Some(1), "{}{}", run.stdout, run.stderr);
    let left = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").file_name());
    let left: Vec<_> = left.filter(|name| name.to_string_lossy() != film).collect();
    assert!(left.is_empty(), "a failed capture left {left:?}");
    assert!(run.stderr.contains(&*film), "the file is not named: {}", run.stderr);
    run.stderr
}

#[test]
fn footage_that_is_none_is_refused_by_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("notes.mp4");
    std::fs::write(&path, "a text named like a film").expect("written");
    assert!(complaint(&path, &[]).contains("no film"));
    std::fs::write(&path, "").expect("written");
    assert!(complaint(&path, &[]).contains("empty"));
}

#[test]
fn footage_without_a_board_says_what_to_do() {
    let plain = vec![Image::filled(320, 240, [120, 90, 60]); 6];
    let (_folder, path) = film_of(&plain);
    let said = complaint(&path, &[]);
    assert!(said.contains("no calibration board") && said.contains("turnlight board"), "{said}");
}

#[test]
fn a_board_of_another_kind_is_counted() {
    let cartoon = Cartoon::default();
    let (_folder, path) = film_of(&images(&draw(&cartoon, &angles(4, 0.2))));
    let said = complaint(&path, &["--board", "chessboard:9x6:25mm"]);
    assert!(said.contains("in 0 of 4 frames"), "{said}");
}

#[test]
fn a_table_that_never_turned_is_told() {
    let cartoon = Cartoon::default();
    let (_folder, path) = film_of(&images(&draw(&cartoon, &[0.3; 6])));
    let said = complaint(&path, &["--motion", "turntable"]);
    assert!(said.contains("turn"), "{said}");
}

#[test]
fn a_film_from_one_side_tells_what_calibration_found_all_the_same() {
    let held = |k: usize| Cartoon { elevation_deg: 29.0 + 0.3 * k as f64, ..Cartoon::default() };
    let frames: Vec<_> = (0..8).map(|k| held(k).frame(0.005 * k as f64).image).collect();
    let (_folder, path) = film_of(&frames);
    let said = complaint(&path, &["--motion", "free-hand"]);
    assert!(said.contains("in 8 of 8 frames") && said.contains("px RMS") && said.contains("one tilt"), "{said}");
    assert!(said.contains("1 view can be used") && said.contains("--calibration"), "{said}");
}

#[test]
fn a_film_cut_short_is_used_as_far_as_it_goes_or_refused() {
    let cartoon = Cartoon::default();
    let frames = images(&draw(&cartoon, &angles(24, 0.9)));
    let (folder, path) = film_of(&frames);
    let whole = std::fs::read(&path).expect("a film");
    std::fs::write(&path, &whole[..whole.len() * 6 / 10]).expect("cut");
    // The index of an .mp4 comes last.
    assert!(complaint(&path, &[]).contains("cut off"));
    let path = folder.path().join("film.avi");
    write_film(&path, &frames);
    let whole = std::fs::read(&path).expect("a film");
    std::fs::write(&path, &whole[..whole.len() * 6 / 10]).expect("cut");
    let found = captured(&path, &FootageOptions { most: Some(8), ..FootageOptions::default() });
    assert!(found.shots.shots.len() < 20);
    assert!(found.shots.findings.iter().any(|finding| finding.contains("cut off")), "{:?}", found.shots.findings);
}

#[test]
fn of_half_blurred_footage_the_sharp_half_is_kept() {
    let cartoon = Cartoon::default();
    let angles = angles(40, 1.0);
    let mut frames = images(&draw(&cartoon, &angles));
    let is_blurred = |k: usize| k % 4 >= 2;
    for (k, frame) in frames.iter_mut().enumerate().filter(|(k, _)| is_blurred(*k)) {
        *frame = (0..3).fold(frame.clone(), |image, _| smeared(&image, 4 + k % 2));
    }
    let (_folder, path) = film_of(&frames);
    let found = captured(&path, &FootageOptions::default());
    assert!(found.selected.kept.iter().all(|&k| !is_blurred(k)), "{:?}", found.selected.kept);
    assert!(found.selected.kept.len() >= 16, "{:?}", found.selected.kept);
    let report = found.report(&Footage::open(&[path]).expect("footage")).text();
    assert!(report.contains("blurred"), "{report}");
}

/// The mean over `reach` pixels to the left and right.
fn smeared(image: &Image<[u8; 3]>, reach: usize) -> Image<[u8; 3]> {
    let mut smeared = image.clone();
    for y in 0..image.height() {
        for x in 0..image.width() {
            let row = &image.row(y)[x.saturating_sub(reach)..(x + reach + 1).min(image.width())];
            smeared.set(
                x,
                y,
                [0, 1, 2].map(|c| (row.iter().map(|p| usize::from(p[c])).sum::<usize>() / row.len()) as u8),
            );
        }
    }
    smeared
}

#[test]
fn a_camera_that_was_knocked_stands_in_two_places() {
    let cartoon = Cartoon::default();
    let knocked = Cartoon { elevation_deg: 32.0, ..cartoon.clone() };
    let angles = angles(40, 1.0);
    let mut drawn = draw(&cartoon, &angles[..20]);
    drawn.extend(draw(&knocked, &angles[20..]));
    let (_folder, path) = film_of(&images(&drawn));
    let found = captured(&path, &FootageOptions { most: Some(12), ..FootageOptions::default() });
    assert_eq!(found.shots.standpoints.len(), 2, "{:?}", found.shots.findings);
    assert!(found.shots.turntable().expect("a turntable").segments[1].first.abs_diff(20) <= 1);
    assert!(found.shots.findings.iter().any(|f| f.contains("20") && f.contains("moved")), "{:?}", found.shots.findings);
}

#[test]
fn of_two_turns_one_is_kept() {
    let cartoon = Cartoon::default();
    let (_folder, path) = film_of(&images(&draw(&cartoon, &angles(60, 2.05))));
    let found = captured(&path, &FootageOptions { most: Some(24), ..FootageOptions::default() });
    assert!((20..=24).contains(&found.kept.len()), "{}", found.kept.len());
    assert!((found.selected.rings[0].turns.expect("turns") - 2.0).abs() < 0.06);
    assert!(found.selected.rings[0].is_closed);
}

#[test]
fn an_object_of_the_backdrops_colour_is_cut_out_or_named() {
    let cartoon = Cartoon { balls: [[42, 150, 60], [45, 165, 62]], elevation_deg: 14.0, ..Cartoon::default() };
    let drawn = draw(&cartoon, &angles(30, 1.0));
    let (_folder, path) = film_of(&images(&drawn));
    let found = captured(&path, &FootageOptions::default());
    let (mean, findings) = (mean_iou(&found, &drawn), &found.silhouettes.findings);
    println!("IoU {mean:.4}, {findings:?}");
    assert!(mean > 0.95 || findings.iter().any(|f| f.contains("colour")), "{mean} {findings:?}");
}

#[test]
fn two_films_from_two_heights_tell_the_lens() {
    let low = Cartoon::default();
    let high = Cartoon { elevation_deg: 50.0, ..low.clone() };
    let (folder, first) = film_of(&images(&draw(&low, &angles(24, 0.95))));
    let second = folder.path().join("high.mp4");
    write_film(&second, &images(&draw(&high, &angles(24, 0.95))));
    let footage = Footage::open(&[first.clone(), second]).expect("footage");
    let options = FootageOptions { board: Some(low.board), ..FootageOptions::default() };
    let output = first.with_extension("capture");
    let found = capture_footage(&footage, &options, &output, &mut Stages::new(&Silent)).expect("a capture");
    let lens = found.shots.calibration.as_ref().expect("calibrated").intrinsics;
    println!("{lens:?}, true {:?}; {} kept", low.lens(), found.kept.len());
    assert!((lens.fx / low.lens().fx - 1.0).abs() < 0.003, "{}", lens.fx);
    assert!((lens.cx - low.lens().cx).abs() < 2.0 && (lens.cy - low.lens().cy).abs() < 2.0, "{lens:?}");
    assert_eq!(found.shots.standpoints.len(), 2);
    // Both rings are kept.
    assert_eq!(found.selected.rings.len(), 2);
    assert!(found.kept.len() > 40, "{}", found.kept.len());
}

#[test]
fn a_carried_camera_is_told_from_a_turntable() {
    let cartoon = Cartoon::default();
    let carried = |k: usize| {
        let wobble = (1.3 * k as f64).sin();
        let held = Cartoon { elevation_deg: 30.0 + 6.0 * wobble, ..cartoon.clone() };
        held.frame(TAU * (k as f64 + 0.4 * wobble) / 24.0)
    };
    let drawn: Vec<Drawn> = (0..24).map(carried).collect();
    let (_folder, path) = film_of(&images(&drawn));
    let found = captured(&path, &FootageOptions { board: Some(cartoon.board), ..FootageOptions::default() });
    let motion = found.shots.calibration.as_ref().map(|c| c.motion.clone());
    assert_eq!(motion, Some(Motion::FreeHand));
    let mean = mean_iou(&found, &drawn);
    println!("IoU {mean:.4}");
    assert!(mean > 0.95, "{mean}");
}

#[test]
fn frames_before_the_board_is_seen_do_not_spoil_the_turn() {
    let cartoon = Cartoon::default();
    let angles = angles(40, 1.0);
    let mut frames = images(&draw(&cartoon, &angles));
    for frame in &mut frames[..3] {
        *frame = Image::filled(frame.width(), frame.height(), [90, 80, 70]);
    }
    let (_folder, path) = film_of(&frames);
    let options = FootageOptions { board: Some(cartoon.board), most: Some(10), ..FootageOptions::default() };
    let found = captured(&path, &options);
    let ring = &found.selected.rings[0];
    assert!(ring.turns.is_some_and(|turns| turns > 0.8) && ring.step_deg.is_some(), "{ring:?}");
    assert_eq!(found.selected.kept.len(), 10, "{:?}", found.selected.kept);
}

#[test]
fn masks_and_cameras_from_elsewhere_go_by_name() {
    let cartoon = Cartoon::default();
    let drawn = draw(&cartoon, &angles(12, 0.95));
    let folder = tempfile::tempdir().expect("a folder");
    let (photographs, masks) = (folder.path().join("photographs"), folder.path().join("masks"));
    [&photographs, &masks].iter().for_each(|folder| std::fs::create_dir(folder).expect("made"));
    for (k, frame) in drawn.iter().enumerate() {
        capture::write_rgb(&photographs.join(format!("p{k}.png")), &frame.image).expect("written");
        capture::write_matte(&masks.join(format!("p{k}.png")), &frame.matte).expect("written");
    }
    let options = FootageOptions { masks: Some(masks.clone()), ..FootageOptions::default() };
    let found = captured(&photographs, &options);
    assert_eq!((found.kept.len(), mean_iou(&found, &drawn)), (12, 1.0), "{:?}", found.selected.dropped);
    let output = folder.path().join("first");
    found
        .write(&found.report(&Footage::open(std::slice::from_ref(&photographs)).expect("footage")), &output)
        .expect("written");
    drop(found);
    // The capture just written gives the cameras of the same photographs, under its own names.
    for (k, name) in (0..12).map(|k| (k, format!("{k:04}.png"))) {
        std::fs::rename(photographs.join(format!("p{k}.png")), photographs.join(&name)).expect("renamed");
        std::fs::rename(masks.join(format!("p{k}.png")), masks.join(&name)).expect("renamed");
    }
    let args = ["capture", "photographs", "--cameras", "first", "--masks", "masks", "-o", "second"];
    let run = turnlight(folder.path(), &args);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let second = capture::Capture::read(&folder.path().join("second")).expect("a capture");
    assert_eq!(second.frames.len(), 12);
    std::fs::remove_file(masks.join("0007.png")).expect("removed");
    let run = turnlight(folder.path(), &args);
    assert!(run.code == Some(1) && run.stderr.contains("0007.png"), "{}", run.stderr);
}

/// The report of a run with `--json`, and the capture it wrote.
fn done(folder: &Path, args: &[&str], output: &str) -> (serde_json::Value, capture::Capture) {
    let run = turnlight(folder, &[&["capture", "--json"][..], args, &["-o", output]].concat());
    assert_eq!(run.code, Some(0), "{args:?}: {}", run.stderr);
    let report = serde_json::from_str(&run.stdout).expect("JSON");
    (report, capture::Capture::read(&folder.join(output)).expect("a capture"))
}

/// Position in the footage of every frame in the capture, in their order there.
fn positions(report: &serde_json::Value) -> Vec<usize> {
    let frames = report["frames"].as_array().expect("frames").iter().enumerate();
    let mut kept: Vec<(u64, usize)> = frames.filter_map(|(at, f)| Some((f["kept"].as_u64()?, at))).collect();
    kept.sort_unstable();
    kept.into_iter().map(|(_, at)| at).collect()
}

/// Of the masks written with the truth, in the mean.
fn written_iou(report: &serde_json::Value, capture: &capture::Capture, drawn: &[Drawn]) -> f64 {
    let positions = positions(report);
    assert_eq!(positions.len(), capture.frames.len());
    let mask = |frame: &capture::Frame| capture::read_matte(frame.mask_path.as_ref().expect("a mask")).expect("read");
    let ious = capture.frames.iter().zip(&positions).map(|(frame, &at)| iou(&mask(frame), &drawn[at].matte));
    ious.sum::<f64>() / positions.len() as f64
}

#[test]
fn what_is_said_of_a_film_is_heeded() {
    let cartoon = Cartoon { mirror: Some([90.0, 80.0, 40.0]), ..Cartoon::default() };
    let drawn = draw(&cartoon, &angles(24, 0.96));
    let (folder, path) = film_of(&images(&drawn));
    let (place, waved) = (folder.path(), folder.path().join("waved"));
    std::fs::create_dir(&waved).expect("made");
    for (k, elevation_deg) in [25.0, 33.0, 41.0, 49.0, 57.0, 65.0, 73.0, 80.0].into_iter().enumerate() {
        let tilted = Cartoon { elevation_deg, mirror: None, ..cartoon.clone() };
        capture::write_rgb(&waved.join(format!("{k}.png")), &tilted.frame(0.7 * k as f64).image).expect("written");
    }
    capture::write_rgb(&place.join("set.png"), &cartoon.set()).expect("written");
    let said = ["film.mp4", "--square", "30mm", "--calibration", "waved", "--clean-plate", "set.png"];
    let more = ["--light-ball", "92,79,38", "--frames", "12", "--model", "owl.glb"];
    let (report, captured) = done(place, &[&said[..], &more].concat(), "owl");
    // --square: metres.
    assert_eq!((captured.unit, &report["unit"]), (Some(1.0), &serde_json::json!(1.0)));
    let distance = (captured.frames[0].camera.center() - nalgebra::Point3::new(0.0, 0.0, 0.03)).norm();
    assert!((distance / 0.5 - 1.0).abs() < 0.01, "{distance}");
    // --calibration: the lens is that of the other shots, and held.
    assert_eq!(report["lens"]["source"], "separate shots of a board");
    let focal = captured.frames[0].camera.intrinsics.fx;
    assert!((focal / cartoon.lens().fx - 1.0).abs() < 0.005, "{focal}");
    assert!(report["lens"]["focal_px"][0]["deviation"].is_null(), "{}", report["lens"]);
    // --clean-plate spoils nothing; that it is read shows below, where another's is refused.
    let mean = written_iou(&report, &captured, &drawn);
    println!("distance {distance:.4}, focal {focal:.2}, IoU {mean:.4}");
    assert!(mean > 0.96, "{mean}");
    // --light-ball: the lamp stands still before the camera.
    assert!((10..=12).contains(&captured.frames.len()));
    for frame in &captured.frames {
        let found = frame.light_direction.expect("a direction");
        let off = (frame.camera.rotation * found).angle(&cartoon.lamp()).to_degrees();
        assert!(off < 2.0, "{off}°");
    }
    // --model.
    let model = turnlight(place, &["info", "owl.glb", "--json"]);
    assert_eq!(model.code, Some(0), "{}", model.stderr);
    // A plate of another set.
    capture::write_rgb(&place.join("black.png"), &Image::filled(640, 480, [0; 3])).expect("written");
    let run = turnlight(place, &["capture", "film.mp4", "--clean-plate", "black.png", "--frames", "8", "-o", "black"]);
    assert_eq!(run.code, Some(1), "{}", run.stdout);
    assert!(run.stderr.contains("black.png") && run.stderr.contains("leave --clean-plate away"), "{}", run.stderr);
    assert!(!place.join("black").exists() && path.is_file());
}

/// A program in the place of COLMAP, which finds the cameras of the frames drawn and keeps the masks it gets in `seen`.
#[cfg(unix)]
fn stand_in(place: &Path, drawn: &[Drawn]) {
    use std::os::unix::fs::PermissionsExt;
    let model = place.join("model");
    std::fs::create_dir(&model).expect("made");
    let lens = drawn[0].camera.intrinsics;
    let d = lens.distortion;
    let [w, h] = [lens.width, lens.height];
    let camera = format!("1 OPENCV {w} {h} {} {} {} {} {} {} 0 0\n", lens.fx, lens.fy, lens.cx, lens.cy, d.k1, d.k2);
    let image = |(k, frame): (usize, &Drawn)| {
        let turn = nalgebra::Rotation3::from_matrix_unchecked(frame.camera.rotation);
        let (q, t) = (nalgebra::UnitQuaternion::from_rotation_matrix(&turn), frame.camera.translation);
        format!("{} {} {} {} {} {} {} {} 1 {k:06}.png\n\n", k + 1, q.w, q.i, q.j, q.k, t.x, t.y, t.z)
    };
    std::fs::write(model.join("cameras.txt"), camera).expect("written");
    let images: String = drawn.iter().enumerate().map(image).collect();
    std::fs::write(model.join("images.txt"), images).expect("written");
    // feature_extractor --database_path D --image_path I …, mapper --database_path D --image_path I --output_path O
    let script = format!(
        "#!/bin/sh\ncase \"$1 $2\" in *' -h') ;; 'feature_extractor '*) cp -r $5/../masks {seen} ;;\n\
         'mapper '*) cp -r {model} $7/0 ;; esac\n",
        seen = place.join("seen").display(),
        model = model.display()
    );
    let program = place.join("colmap");
    std::fs::write(&program, script).expect("written");
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).expect("executable");
}

#[cfg(unix)]
#[test]
fn a_film_without_a_board_takes_cameras_from_elsewhere() {
    let cartoon = Cartoon { has_platter: false, ..Cartoon::default() };
    let drawn = draw(&cartoon, &(0..24).map(|k| TAU / 24.0 * k as f64).collect::<Vec<_>>());
    let folder = tempfile::tempdir().expect("a folder");
    let place = folder.path();
    write_film_of(&place.join("film.mp4"), &images(&drawn), 6.0);
    stand_in(place, &drawn);
    let (report, captured) = done(place, &["film.mp4", "--colmap", "./colmap"], "found");
    let mean = written_iou(&report, &captured, &drawn);
    println!("COLMAP: {} frames, IoU {mean:.4}", captured.frames.len());
    assert!(captured.frames.len() >= 20 && mean > 0.95, "{} {mean}", captured.frames.len());
    // COLMAP saw the object and not the room.
    let seen = capture::read_matte(&place.join("seen/000005.png.png")).expect("a mask");
    let (object, room) = (&drawn[5].matte, |at: usize| seen.pixels()[at] < 128);
    let of_room = (0..object.pixels().len()).filter(|&at| object.pixels()[at] == 0);
    let (hidden, all) = of_room.fold((0, 0), |(hidden, all), at| (hidden + usize::from(room(at)), all + 1));
    assert!(hidden * 100 > all * 95, "{hidden} of {all} pixels of the room are masked");
    assert!(iou(&seen, object) > 0.5, "{}", iou(&seen, object));
    // A capture of the film has the cameras of its frames by its report, any other by their numbers.
    for (cameras, again) in [("found", "again"), ("model", "numbered")] {
        let (report, captured) = done(place, &["film.mp4", "--cameras", cameras, "--frames", "9"], again);
        assert_eq!(captured.frames.len(), 9);
        for (frame, at) in captured.frames.iter().zip(positions(&report)) {
            assert!((frame.camera.center() - drawn[at].camera.center()).norm() < 1e-6, "{cameras} {at}");
        }
    }
    // Of the nine the pictures' numbers are no longer those of the frames.
    for (cameras, third) in [("again", "folder"), ("again/transforms.json", "file")] {
        let (report, captured) = done(place, &["film.mp4", "--cameras", cameras], third);
        assert!(captured.frames.len() >= 8 && positions(&report).iter().enumerate().any(|(i, &at)| i != at));
        for (frame, at) in captured.frames.iter().zip(positions(&report)) {
            assert!((frame.camera.center() - drawn[at].camera.center()).norm() < 1e-6, "{cameras} {at}");
        }
    }
    // The first of them and an even turn of 15° a sixth of a second.
    let refused = turnlight(place, &["capture", "film.mp4", "--step", "90", "-o", "even"]);
    assert_eq!(refused.code, Some(2), "a step and no camera: {}", refused.stderr);
    let (report, captured) = done(place, &["film.mp4", "--cameras", "found", "--step", "90"], "even");
    for (frame, at) in captured.frames.iter().zip(positions(&report)) {
        let off = (frame.camera.center() - drawn[at].camera.center()).norm();
        assert!(off < 2e-3, "{at}: {off}");
    }
    let mean = written_iou(&report, &captured, &drawn);
    println!("even turn: {} frames, IoU {mean:.4}", captured.frames.len());
    assert!(captured.frames.len() >= 20 && mean > 0.95, "{} {mean}", captured.frames.len());
    assert!(report["coverage"]["is_closed"] == true && report["motion"] == "turntable", "{}", report["coverage"]);
    assert!(report["findings"].to_string().contains("taken to turn evenly, by 90° a second"), "{}", report["findings"]);
    // A capture of something else.
    let stranger = tests::small_capture(place, 2);
    let run = turnlight(place, &["capture", "film.mp4", "--cameras", &stranger.to_string_lossy(), "-o", "none"]);
    assert!(run.code == Some(1) && run.stderr.contains("film.mp4: is 640x480"), "{}", run.stderr);
}

/// Where box `name` of an .mp4 starts, inside the boxes before it (ISO 14496-12).
fn find_box(bytes: &[u8], names: &[&[u8; 4]]) -> usize {
    let (mut at, mut end) = (0, bytes.len());
    for (depth, name) in names.iter().enumerate() {
        at += if depth > 0 { 8 } else { 0 };
        loop {
            assert!(at < end, "no {}", String::from_utf8_lossy(*name));
            let size = u32::from_be_bytes(bytes[at..at + 4].try_into().expect("four bytes")) as usize;
            if &bytes[at + 4..at + 8] == *name {
                end = at + size;
                break;
            }
            at += size;
        }
    }
    at
}

#[test]
fn a_film_taken_with_the_phone_upright_becomes_upright_views() {
    let cartoon = Cartoon { size: [480, 640], elevation_deg: 35.0, ..Cartoon::default() };
    let drawn = draw(&cartoon, &angles(16, 0.95));
    // The sensor lies on its side: the film's pixel (x, y) is shown at (479 − y, x).
    let lying = |upright: &Image<[u8; 3]>| {
        let pixels = (0..480).flat_map(|y| (0..640).map(move |x| upright.at(479 - y, x))).collect();
        Image::from_pixels(640, 480, pixels).expect("a picture")
    };
    let (folder, path) = film_of(&drawn.iter().map(|frame| lying(&frame.image)).collect::<Vec<_>>());
    let mut bytes = std::fs::read(&path).expect("a film");
    // The matrix [a b u c d v x y w] of the track's head, 40 bytes into its body.
    let matrix = find_box(&bytes, &[b"moov", b"trak", b"tkhd"]) + 8 + 40;
    for (position, value) in [(0, 0), (1, 1 << 16), (3, -1 << 16), (4, 0_i32)] {
        bytes[matrix + 4 * position..][..4].copy_from_slice(&value.to_be_bytes());
    }
    std::fs::write(&path, bytes).expect("written");
    let run = turnlight(folder.path(), &["capture", "film.mp4", "--frames", "10", "-o", "capture"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let capture = capture::Capture::read(&folder.path().join("capture")).expect("a capture");
    let sizes = capture.frames.iter().map(|f| [f.camera.intrinsics.width, f.camera.intrinsics.height]);
    assert!(
        capture.frames.len() >= 8 && sizes.clone().all(|size| size == [480, 640]),
        "{:?}",
        sizes.collect::<Vec<_>>()
    );
    // Upright, the camera looks down: the axis of the table runs from the bottom of the picture to its top.
    assert!(capture.frames.iter().all(|f| f.camera.rotation[(1, 2)] < -0.7), "{}", capture.frames[0].camera.rotation);
}

/// Sets the times of the frames of an .mkv in milliseconds: each block has 16 bits for its time since its cluster's
/// (RFC 9559).
fn set_times(film: &mut [u8], times_ms: &[i64]) {
    // An element's number and the size of its body are as long as the zeros before their first bit say.
    let length = |byte: u8| byte.leading_zeros() as usize + 1;
    let (mut at, mut cluster, mut block) = (0, 0, 0);
    while at < film.len() {
        let id = &film[at..at + length(film[at])];
        let body = at + id.len() + length(film[at + id.len()]);
        let size = film[at + id.len()..body].iter().fold(0, |sum, &byte| sum << 8 | u64::from(byte));
        let size = size & ((1 << (7 * (body - at - id.len()))) - 1);
        match id {
            // Segment and cluster: what is in them comes next.
            [0x18, 0x53, 0x80, 0x67] | [0x1f, 0x43, 0xb6, 0x75] => at = body,
            [0xe7] => {
                cluster = film[body..body + size as usize].iter().fold(0, |sum, &byte| sum << 8 | i64::from(byte));
                at = body + size as usize;
            }
            [0xa3] => {
                let relative = i16::try_from(times_ms[block] - cluster).expect("near its cluster");
                film[body + 1..body + 3].copy_from_slice(&relative.to_be_bytes());
                block += 1;
                at = body + size as usize;
            }
            _ => at = body + size as usize,
        }
    }
    assert_eq!(block, times_ms.len(), "blocks");
}

#[test]
fn frames_without_the_board_are_placed_by_their_times_whatever_the_rate() {
    let cartoon = Cartoon::default();
    // A phone in the dark: one, two or three thirtieths of a second from frame to frame.
    let steps = [33, 100, 67, 33, 33, 100, 100, 67];
    let times: Vec<i64> = (0..32).scan(0, |at, k| Some(std::mem::replace(at, *at + steps[k % steps.len()]))).collect();
    let turned: Vec<f64> = times.iter().map(|&ms| 0.95 * TAU * ms as f64 / times[31] as f64).collect();
    let mut frames = images(&draw(&cartoon, &turned));
    let without = [6, 13, 22];
    for k in without {
        frames[k] = Image::filled(640, 480, [90, 80, 70]);
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("film.mkv");
    write_film(&path, &frames);
    let mut bytes = std::fs::read(&path).expect("a film");
    set_times(&mut bytes, &times);
    std::fs::write(&path, bytes).expect("written");
    let found =
        captured(&path, &FootageOptions { board: Some(cartoon.board), most: Some(8), ..FootageOptions::default() });
    let shots = &found.shots.shots;
    assert_eq!(shots.len(), times.len());
    for (shot, (&time, truth)) in shots.iter().zip(times.iter().zip(&turned)) {
        assert!((shot.source.time_s - time as f64 / 1e3).abs() < 2e-3, "{} {time}", shot.source.time_s);
        let off = (shot.angle.expect("an angle") - truth).to_degrees().abs();
        // By the frames' numbers those without the board would be off by up to five degrees.
        assert!(off < 0.5, "{}: off by {off}°", shot.source.name);
    }
    assert!(without.iter().all(|&k| shots[k].corners == 0 && shots[k].angle_deviation.is_some()));
}
