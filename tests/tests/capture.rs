//! From films to captures: good footage, and every kind of bad footage.
#![cfg(feature = "video")]

use capture::footage::Footage;
use capture::video::{FilmWriter, WriteOptions};
use capture::{Image, calibrate::Motion};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use tests::cartoon::{Cartoon, Drawn};
use tests::turnlight;
use turnlight::footage::{CapturedFootage, FootageOptions, capture_footage};
use turnlight::stages::{Silent, Stages};

/// A platter that does not turn evenly: the angle of each frame of `turns` turns.
fn angles(frames: usize, turns: f64) -> Vec<f64> {
    let even = |k: usize| TAU * turns * k as f64 / frames as f64;
    (0..frames).map(|k| even(k) + 0.04 * (even(k) + 1.0).sin()).collect()
}

fn write_film(path: &Path, frames: &[Image<[u8; 3]>]) {
    let size = [frames[0].width(), frames[0].height()];
    let mut film = FilmWriter::create(path, size, &WriteOptions::default()).expect("a codec");
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

fn iou(a: &Image<u8>, b: &Image<u8>) -> f64 {
    let both = a.pixels().iter().zip(b.pixels()).map(|(&a, &b)| (a >= 128, b >= 128));
    let (and, or) = both.fold((0, 0), |(and, or), (a, b)| (and + usize::from(a && b), or + usize::from(a || b)));
    f64::from(and) / f64::from(or.max(1))
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
    let lens = found.shots.calibration.as_ref().expect("calibrated").intrinsics;
    let ious: Vec<f64> = found
        .selected
        .kept
        .iter()
        .zip(&found.silhouettes.mattes)
        .map(|(&at, matte)| iou(matte, &drawn[at].matte))
        .collect();
    let mean = ious.iter().sum::<f64>() / ious.len() as f64;
    println!(
        "axis off by {axis:.4}°, angles by {worst:.4}°; {lens:?}; {} kept, IoU {mean:.4} {ious:.3?}",
        found.kept.len()
    );
    found.shots.findings.iter().for_each(|finding| println!("{finding}"));
    assert!(axis < 0.1, "{axis}");
    assert!(worst < 0.1, "{worst}");
    assert!((lens.fx / cartoon.lens().fx - 1.0).abs() < 0.003, "{}", lens.fx);
    assert!(mean > 0.985, "{mean}");
    // One turn is kept, what is beyond shows it again.
    assert!((40..=46).contains(&found.kept.len()), "{}", found.kept.len());
}
