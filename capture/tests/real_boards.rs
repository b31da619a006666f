//! Boards and films of `../shared/data` (see its README); skips, saying so, without them.
#![cfg(feature = "video")]
#![allow(clippy::unwrap_used, reason = "tests fail by panicking, helpers included")]

use capture::video::{FilmReader, ReadOptions, detect_board, detect_markers, guess_dictionary};
use capture::{Board, Image};
use std::path::{Path, PathBuf};

fn data(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data").join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: {} is absent", path.display());
    None
}

/// The pictures of a folder whose names start so, in order, every third of them.
fn pictures(folder: &Path, start: &str) -> Vec<Image<[u8; 3]>> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let is_wanted = |path: &PathBuf| {
        let name = path.file_name().unwrap().to_string_lossy();
        name.starts_with(start) && (name.ends_with(".png") || name.ends_with(".jpg"))
    };
    let mut paths: Vec<PathBuf> = entries.filter(is_wanted).collect();
    paths.sort();
    paths.iter().step_by(3).map(|path| capture::read_rgb(path).unwrap()).collect()
}

#[test]
fn markers_around_a_photographed_object_are_read() {
    let Some(folder) = data("aruco_earbuds/board02-png-22") else { return };
    let images = pictures(&folder, "");
    let dictionary = guess_dictionary(&images[..3]).unwrap().unwrap();
    let counts: Vec<usize> = images.iter().map(|image| detect_markers(image, dictionary).unwrap().len()).collect();
    let ids: Vec<usize> = detect_markers(&images[0], dictionary).unwrap().iter().map(|marker| marker.id).collect();
    println!("{dictionary}: {counts:?} markers; in the first picture {ids:?}");
    assert!(counts.iter().all(|&count| count >= 18), "{counts:?}");
}

#[test]
fn photographed_chessboards_are_found() {
    let Some(folder) = data("chessboard") else { return };
    let board: Board = "chessboard:10x7:25mm".parse().unwrap();
    let images = pictures(&folder, "left");
    let counts: Vec<usize> = images.iter().map(|image| detect_board(image, &board).unwrap().corners.len()).collect();
    println!("{counts:?} corners");
    assert!(counts.iter().filter(|&&count| count >= 50).count() >= images.len() - 1, "{counts:?}");
}

#[test]
fn a_chessboard_is_found_through_a_real_film() {
    let Some(path) = data("chessboard/chessboard_handheld_640x352_179f.mp4") else { return };
    let board: Board = "chessboard:10x7:25mm".parse().unwrap();
    let film = FilmReader::open(&path, &ReadOptions::default()).unwrap();
    println!("{:?}", film.info());
    let mut counts = Vec::new();
    let mut frames = 0;
    for frame in film {
        let frame = frame.unwrap();
        assert_eq!(frame.index, frames);
        frames += 1;
        if frame.index % 30 == 0 {
            counts.push(detect_board(&frame.image, &board).unwrap().corners.len());
        }
    }
    println!("{frames} frames, {counts:?} corners");
    assert_eq!(frames, 179);
    assert!(counts.iter().all(|&count| count >= 50), "{counts:?}");
}
