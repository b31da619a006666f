use super::*;
use crate::video::detect::tests::{camera, photograph};

const VIEWS: [(f64, f64); 3] = [(0.2, 0.3), (-0.5, 1.0), (0.6, 2.6)];

fn pictures(board: &Board) -> Vec<Image<[u8; 3]>> {
    // So far away that it is seen whole.
    pictures_from(board, 2.4)
}

/// From a distance in longer sides of the board.
fn pictures_from(board: &Board, distance: f64) -> Vec<Image<[u8; 3]>> {
    let [width, height] = board.size();
    let view = |&(tilt, roll): &(f64, f64)| {
        let mut seen = camera(tilt, roll, 0.0);
        // In the middle.
        let centre = nalgebra::Vector3::new(0.5 * width, 0.5 * height, 0.0);
        seen.translation = nalgebra::Vector3::new(0.0, 0.0, distance * width.max(height)) - seen.rotation * centre;
        photograph(board, &seen)
    };
    VIEWS.iter().map(view).collect()
}

/// The same board with squares (or markers) of one.
fn in_squares(board: &Board) -> Board {
    let mut board = *board;
    match &mut board {
        Board::Chessboard { square, .. } => *square = 1.0,
        Board::Charuco { square, marker, .. } => (*square, *marker) = (1.0, *marker / *square),
        Board::ArucoGrid { marker, gap, .. } => (*marker, *gap) = (1.0, *gap / *marker),
    }
    board
}

#[test]
fn every_kind_of_board_is_found_out_by_looking_at_it() {
    for text in [
        "charuco:7x5:30mm:22.5mm:4x4_50",
        "charuco:6x8:20mm:14mm:5x5_50:light-first",
        "charuco:7x7:20mm:15mm:4x4_50",
        "aruco:5x4:30mm:8mm:6x6_50",
        "chessboard:10x7:25mm",
        "chessboard:8x8:25mm",
    ] {
        let board: Board = text.parse().unwrap();
        let Some(Pattern::Board(found)) = recognise_pattern(&pictures(&board)).unwrap() else { panic!("{text}") };
        let expected = in_squares(&board);
        match (found, expected) {
            (Board::ArucoGrid { gap, .. }, Board::ArucoGrid { gap: true_gap, .. }) => {
                assert!((gap - true_gap).abs() < 0.01, "{gap} for {true_gap}");
                assert_eq!(found.counts(), expected.counts());
            }
            _ => assert_eq!(found, expected, "{text}"),
        }
    }
}

/// Of small markers the corners are found too far out, towards the squares beside them.
#[test]
fn small_markers_are_found_as_large_as_they_are() {
    for text in ["charuco:7x7:20mm:15mm:4x4_50", "charuco:7x7:20mm:14mm:4x4_50", "charuco:7x7:20mm:16mm:4x4_50"] {
        let board: Board = text.parse().unwrap();
        let found = recognise_pattern(&pictures_from(&board, 4.5)).unwrap();
        assert_eq!(found, Some(Pattern::Board(in_squares(&board))), "{text}");
    }
}

/// Puts a marker into the upper left corner of a picture, 48 pixels wide.
fn put_marker(image: &mut Image<[u8; 3]>, dictionary: Dictionary, id: usize) {
    let board = Board::ArucoGrid { columns: id + 1, rows: 1, marker: 1.0, gap: 0.5, dictionary };
    let top_left = board.markers()[id].corners[0];
    for (x, y) in (0..48).flat_map(|y| (0..48).map(move |x| (x, y))) {
        let place = Point2::new(top_left.x + (x as f64 + 0.5) / 48.0, top_left.y - (y as f64 + 0.5) / 48.0);
        image.set(16 + x, 16 + y, if board.is_dark(place) { [35; 3] } else { [205; 3] });
    }
}

#[test]
fn one_marker_beside_a_chessboard_does_not_hide_it() {
    let board: Board = "chessboard:10x7:25mm".parse().unwrap();
    let dictionary = "4x4_50".parse().unwrap();
    let mut images = pictures(&board);
    put_marker(&mut images[1], dictionary, 3);
    assert_eq!(guess_dictionary(&images).unwrap(), Some(dictionary));
    assert_eq!(recognise_pattern(&images).unwrap(), Some(Pattern::Board(in_squares(&board))));
    // Alone it is what there is.
    let mut alone = Image::filled(640, 480, [205; 3]);
    put_marker(&mut alone, dictionary, 3);
    assert_eq!(recognise_pattern(&[alone]).unwrap(), Some(Pattern::Markers(dictionary)));
}

/// Glitter on chrome, say.
#[test]
fn a_stray_marker_of_a_high_id_makes_no_board_longer() {
    for text in ["charuco:7x7:20mm:15mm:4x4_50", "aruco:5x4:30mm:8mm:4x4_50"] {
        let board: Board = text.parse().unwrap();
        let mut images = pictures(&board);
        put_marker(&mut images[1], "4x4_250".parse().unwrap(), 160);
        // The board is hidden here.
        let mut alone = Image::filled(640, 480, [120; 3]);
        put_marker(&mut alone, "4x4_250".parse().unwrap(), 160);
        images.push(alone);
        let Some(Pattern::Board(found)) = recognise_pattern(&images).unwrap() else { panic!("{text}") };
        assert_eq!((found.counts(), found.dictionary()), (board.counts(), board.dictionary()));
    }
}

#[test]
fn markers_in_no_order_are_left_in_none() {
    // Of a grid each picture shows every other marker moved: no board fits.
    let board: Board = "aruco:5x4:30mm:8mm:6x6_50".parse().unwrap();
    let dictionary = board.dictionary().unwrap();
    let mut seen: Vec<FoundMarker> = detect_markers(&pictures(&board)[0], dictionary).unwrap();
    seen.iter_mut().for_each(|marker| marker.id = (marker.id * 7) % 20);
    let fits = candidates(dictionary, 19).filter(|b| misfit(b, std::slice::from_ref(&seen)).is_some_and(|m| m < FIT));
    assert_eq!(fits.count(), 0);
}

#[test]
fn where_no_pattern_is_none_is_found() {
    let plain = vec![Image::filled(320, 240, [90, 120, 80]); 2];
    assert_eq!(recognise_pattern(&plain).unwrap(), None);
    assert_eq!(recognise_pattern(&[]).unwrap(), None);
    assert_eq!(recognise_pattern(&[Image::filled(3, 3, [0; 3])]).unwrap(), None);
}
