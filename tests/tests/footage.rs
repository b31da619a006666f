//! Synthetic films, held against what is found in them.
#![cfg(feature = "video")]

use capture::Image;
use capture::footage::Footage as Film;
use capture::video::{FilmReader, FilmWriter, ReadOptions, WriteOptions, detect_board};
use data_synth::Scene;
use data_synth::footage::{Footage, FootageOptions, set_up};
use tests::iou;
use turnlight::footage::capture_footage;
use turnlight::stages::{Silent, Stages};

/// Distances in pixels between the board's corners as found in a picture and as the truth projects them, ascending.
fn errors(footage: &Footage, image: &Image<[u8; 3]>, frame: usize) -> Vec<f64> {
    let (board, camera) = (footage.board(), &footage.cameras()[frame]);
    let view = detect_board(image, board).expect("OpenCV works");
    let corners = board.corners();
    let distance = |(corner, found): &(usize, nalgebra::Point2<f64>)| {
        let truth = camera.project(&(footage.world_from_board() * corners[*corner])).expect("in front of the camera");
        (truth.pixel - found).norm()
    };
    let mut errors: Vec<f64> = view.corners.iter().map(distance).collect();
    errors.sort_by(f64::total_cmp);
    errors
}

#[test]
fn the_board_is_found_where_the_truth_says_and_a_codec_leaves_it_there() {
    const SIZE: [usize; 2] = [640, 480];
    let [width, height] = SIZE;
    let options = FootageOptions { frames: 2, width, height, seed: 3, ..FootageOptions::default() };
    let footage = set_up(Scene::Temple, &options).expect("a film");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("film.mp4");
    let mut film = FilmWriter::create(&path, SIZE, &WriteOptions::default()).expect("a codec");
    for frame in 0..footage.frames() {
        let image = footage.frame(frame).image;
        let errors = errors(&footage, &image, frame);
        println!("frame {frame}: {} corners, {errors:.3?}", errors.len());
        assert!(errors.len() >= 12 && errors[errors.len() / 2] < 0.06, "{errors:?}");
        // The farthest touch the object's outline.
        assert!(errors[errors.len() * 9 / 10] < 0.2, "{errors:?}");
        film.push(&image).expect("a frame");
    }
    film.finish().expect("a film");
    let frames = FilmReader::open(&path, &ReadOptions::default()).expect("a film");
    for (frame, film_frame) in frames.enumerate() {
        let errors = errors(&footage, &film_frame.expect("a frame").image, frame);
        println!("from the film: {} corners, {errors:.3?}", errors.len());
        assert!(errors.len() >= 12 && errors[errors.len() / 2] < 0.12, "{errors:?}");
    }
}

/// The whole way: light traced, a board, cloth, noise, uneven speed, a codec.
#[test]
fn a_traced_film_becomes_the_capture_that_the_truth_tells_of() {
    let options = FootageOptions { frames: 24, width: 400, height: 300, samples: 4, seed: 1, ..Default::default() };
    let footage = set_up(Scene::Temple, &options).expect("a film");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("film.mp4");
    let mut film = FilmWriter::create(&path, [400, 300], &WriteOptions::default()).expect("a codec");
    let mut masks = Vec::new();
    for frame in 0..footage.frames() {
        let view = footage.frame(frame);
        film.push(&view.image).expect("a frame");
        masks.push(view.matte);
    }
    film.finish().expect("a film");
    let film = Film::open(&[path]).expect("a film");
    let options = turnlight::footage::FootageOptions { length: Some(0.06), ..Default::default() };
    let found = capture_footage(&film, &options, &folder.path().join("capture"), &mut Stages::new(&Silent));
    let found = found.unwrap_or_else(|fault| panic!("{fault}"));
    let focal =
        found.shots.calibration.as_ref().expect("calibrated").intrinsics.fx / footage.cameras()[0].intrinsics.fx;
    let axis = found.shots.turntable().expect("a turntable").axis_direction.z.clamp(-1.0, 1.0).acos().to_degrees();
    let off = |k: usize| found.shots.shots[k].angle.expect("an angle") - (footage.angles()[k] - footage.angles()[0]);
    let angle = (0..footage.frames()).map(off).fold(0.0, |worst: f64, off| worst.max(off.abs())).to_degrees();
    let ious: Vec<f64> =
        found.selected.kept.iter().zip(&found.silhouettes.mattes).map(|(&at, m)| iou(m, &masks[at])).collect();
    let mean = ious.iter().sum::<f64>() / ious.len() as f64;
    println!("focal length {focal:.5}, axis {axis:.4}°, angles {angle:.4}°, {} silhouettes {mean:.4}", ious.len());
    assert!((focal - 1.0).abs() < 0.003 && axis < 0.1 && angle < 0.1);
    assert!(ious.len() >= 22 && mean > 0.98, "{mean} {ious:.3?}");
}
