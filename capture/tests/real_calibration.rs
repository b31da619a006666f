//! Cameras from pictures of `../shared/data` (see its README); skips, saying so, without them.
#![cfg(feature = "video")]
#![allow(clippy::unwrap_used, reason = "tests fail by panicking, helpers included")]

use capture::Board;
use capture::calibrate::{CalibrateOptions, Calibration, Motion, Sighting, Standing, Target, calibrate};
use capture::video::{FilmReader, ReadOptions, detect_board, detect_markers};
use nalgebra::Point2;
use std::path::{Path, PathBuf};

fn data(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data").join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: {} is absent", path.display());
    None
}

/// The pictures of a folder whose names start so, in order.
fn pictures(folder: &Path, start: &str) -> Vec<capture::Image<[u8; 3]>> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let is_wanted = |path: &PathBuf| {
        let name = path.file_name().unwrap().to_string_lossy();
        name.starts_with(start) && (name.ends_with(".png") || name.ends_with(".jpg"))
    };
    let mut paths: Vec<PathBuf> = entries.filter(is_wanted).collect();
    paths.sort();
    paths.iter().map(|path| capture::read_rgb(path).unwrap()).collect()
}

fn sighting(frame: usize, corners: Vec<(usize, Point2<f64>)>) -> Sighting {
    Sighting { frame, time_s: frame as f64, corners, film: 0 }
}

fn report(result: &Calibration) {
    let used = result.frames.iter().filter(|f| f.standing == Standing::Used).count();
    println!("{used} of {} pictures, {:.3} px, {:?}", result.frames.len(), result.rms_px, result.intrinsics);
    result.findings.iter().for_each(|finding| println!("{finding}"));
}

#[test]
fn photographed_chessboards_tell_the_lens() {
    let Some(folder) = data("chessboard") else { return };
    let board: Board = "chessboard:10x7:25mm".parse().unwrap();
    let images = pictures(&folder, "left");
    let corners = images.iter().map(|image| detect_board(image, &board).unwrap().corners);
    let sightings: Vec<Sighting> = corners.enumerate().map(|(k, corners)| sighting(k, corners)).collect();
    let result = calibrate(&Target::Points(board.corners()), &sightings, &CalibrateOptions::new([640, 512])).unwrap();
    report(&result);
    assert_eq!(result.motion, Motion::FreeHand);
    assert!((result.intrinsics.fx - 518.0).abs() < 3.0 && result.rms_px < 0.15);
    assert_eq!(result.frames.iter().filter(|f| f.standing == Standing::Used).count(), 24);
}

#[test]
fn a_chessboard_filmed_by_hand_tells_the_lens() {
    let Some(path) = data("chessboard/chessboard_handheld_640x352_179f.mp4") else { return };
    let board: Board = "chessboard:10x7:25mm".parse().unwrap();
    let film = FilmReader::open(&path, &ReadOptions::default()).unwrap();
    let frames = film.map(Result::unwrap).filter(|frame| frame.index % 6 == 0);
    let sightings: Vec<Sighting> = frames
        .map(|frame| {
            let corners = detect_board(&frame.image, &board).unwrap().corners;
            Sighting { frame: frame.index, time_s: frame.time_s, corners, film: 0 }
        })
        .collect();
    let result = calibrate(&Target::Points(board.corners()), &sightings, &CalibrateOptions::new([640, 352])).unwrap();
    report(&result);
    assert_eq!(result.motion, Motion::FreeHand);
    assert!(result.rms_px < 0.4, "{}", result.rms_px);
}

#[test]
fn markers_around_a_photographed_object_tell_the_cameras_whatever_they_lie_on() {
    let Some(folder) = data("aruco_earbuds/board02-png-22") else { return };
    let images = pictures(&folder, "");
    let seen = images.iter().map(|image| detect_markers(image, "6x6_50".parse().unwrap()).unwrap());
    let corners =
        seen.map(|found| found.iter().flat_map(|m| [0, 1, 2, 3].map(|k| (4 * m.id + k, m.corners[k]))).collect());
    let sightings: Vec<Sighting> = corners.enumerate().map(|(k, corners)| sighting(k, corners)).collect();
    let result = calibrate(&Target::Markers { side: 0.035 }, &sightings, &CalibrateOptions::new([1280, 720])).unwrap();
    report(&result);
    assert!(result.frames.iter().all(|f| f.standing == Standing::Used));
    // As a flat grid they are 1.9 px off: the sheet curls.
    assert!(result.rms_px < 0.4, "{}", result.rms_px);
    // 35 mm and gaps of 5 mm, from what the pictures say alone.
    let corner = |index: usize| result.points.iter().find(|(i, _)| *i == index).unwrap().1;
    let apart = (corner(4 * 34) - corner(4 * 4)).norm();
    assert!((apart / 0.24 - 1.0).abs() < 0.01, "{apart}");
}
