//! Synthetic films, held against what is found in them.
#![cfg(feature = "video")]

use capture::Image;
use capture::video::{FilmReader, FilmWriter, ReadOptions, WriteOptions, detect_board};
use data_synth::Scene;
use data_synth::footage::{Footage, FootageOptions, set_up};

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
