use super::*;
use crate::board::{Sheet, SheetOptions};
use crate::{Camera, Distortion, Intrinsics};
use nalgebra::{Rotation3, Vector2, Vector3};
use opencv::core::MatTraitConstManual;
use opencv::prelude::DictionaryTraitConst;

fn charuco() -> Board {
    "charuco:7x5:30mm:21mm:4x4_50".parse().unwrap()
}

/// A camera half a metre in front of the board, tilted and rolled.
pub(in crate::video) fn camera(tilt: f64, roll: f64, distance: f64) -> Camera {
    let intrinsics = Intrinsics {
        fx: 900.0,
        fy: 905.0,
        skew: 0.0,
        cx: 318.3,
        cy: 243.9,
        distortion: Distortion::default(),
        width: 640,
        height: 480,
    };
    // x stays, y up becomes y down.
    let facing = Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), roll)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), tilt)
        * Rotation3::from_axis_angle(&Vector3::y_axis(), 0.6 * tilt);
    let rotation = (turned * facing).into_inner();
    let centre = Vector3::new(0.105, 0.075, 0.0);
    Camera { intrinsics, rotation, translation: Vector3::new(0.004, -0.003, distance) - rotation * centre }
}

/// What the camera sees: 64 rays a pixel meet the printed plane.
pub(in crate::video) fn photograph(board: &Board, camera: &Camera) -> Image<[u8; 3]> {
    let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
    let mut image = Image::filled(width, height, [0_u8; 3]);
    for y in 0..height {
        for x in 0..width {
            let light = |i: u32| {
                // A Hammersley set: every ray has its own column and row, so that edges along the grid are met too.
                let offset = Vector2::new(f64::from(i), f64::from(i.reverse_bits() >> 26)).add_scalar(0.5) / 64.0;
                let ray = camera.ray(Point2::new(x as f64, y as f64) + offset).unwrap();
                let p = ray.origin - ray.direction * (ray.origin.z / ray.direction.z);
                if board.is_dark(p.xy()) { 35.0 } else { 205.0 }
            };
            let level = (0..64).map(light).sum::<f64>() / 64.0;
            image.set(x, y, [level.round() as u8; 3]);
        }
    }
    image
}

/// The same with noise of `rms` levels.
fn noisy(image: &Image<[u8; 3]>, rms: f64) -> Image<[u8; 3]> {
    let mut state = 1_u64;
    let mut random = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
    };
    // The sum of four uniform numbers is normal enough.
    image.map(|[level, ..]| {
        let grain = (0..4).map(|_| random()).sum::<f64>() * rms * 3.0_f64.sqrt();
        [(f64::from(level) + grain).round().clamp(0.0, 255.0) as u8; 3]
    })
}

/// Signed mean and RMS of the errors along x and y, in pixels.
fn errors(view: &BoardView, board: &Board, camera: &Camera) -> ([f64; 2], f64) {
    let places = board.corners();
    let errors: Vec<Vector2<f64>> =
        view.corners.iter().map(|(id, pixel)| pixel - camera.project(&places[*id]).unwrap().pixel).collect();
    let n = errors.len() as f64;
    let mean = errors.iter().sum::<Vector2<f64>>() / n;
    let rms = (errors.iter().map(Vector2::norm_squared).sum::<f64>() / (2.0 * n)).sqrt();
    ([mean.x, mean.y], rms)
}

const VIEWS: [(f64, f64, f64); 5] =
    [(0.0, 0.0, 0.4), (0.5, 0.3, 0.45), (-0.6, -1.0, 0.5), (0.9, 2.0, 0.5), (0.4, 3.0, 0.7)];

#[test]
fn charuco_corners_are_where_the_camera_puts_them() {
    let board = charuco();
    for (tilt, roll, distance) in VIEWS {
        let camera = camera(tilt, roll, distance);
        let image = photograph(&board, &camera);
        for (image, most) in [(noisy(&image, 3.0), 0.02), (image, 0.015)] {
            let view = detect_board(&image, &board).unwrap();
            let (mean, rms) = errors(&view, &board, &camera);
            println!("tilt {tilt}: {} corners, mean {mean:.4?}, rms {rms:.4}", view.corners.len());
            assert_eq!((view.markers.len(), view.corners.len()), (17, 24), "tilt {tilt}");
            assert!(mean.iter().all(|m| m.abs() < 0.01) && rms < most, "tilt {tilt}: {mean:?} {rms}");
        }
    }
}

#[test]
fn chessboards_are_read_from_their_top_left_whichever_way_they_lie() {
    // Ten squares by seven: upside down the corner squares are light.
    let board: Board = "chessboard:10x7:21mm".parse().unwrap();
    for (tilt, roll, distance) in VIEWS {
        let camera = camera(tilt, roll, distance + 0.05);
        let view = detect_board(&noisy(&photograph(&board, &camera), 1.0), &board).unwrap();
        let (mean, rms) = errors(&view, &board, &camera);
        println!("tilt {tilt}: {} corners, mean {mean:.4?}, rms {rms:.4}", view.corners.len());
        assert_eq!(view.corners.len(), 54, "tilt {tilt}");
        assert!(mean.iter().all(|m| m.abs() < 0.01) && rms < 0.02, "tilt {tilt}: {mean:?} {rms}");
    }
}

#[test]
fn marker_corners_of_a_grid_are_found_to_a_fifth_of_a_pixel() {
    let board: Board = "aruco:4x3:40mm:12mm:5x5_100".parse().unwrap();
    let camera = camera(0.4, 0.7, 0.5);
    let view = detect_board(&noisy(&photograph(&board, &camera), 1.0), &board).unwrap();
    let (mean, rms) = errors(&view, &board, &camera);
    println!("{} corners, mean {mean:.4?}, rms {rms:.4}", view.corners.len());
    assert_eq!(view.corners.len(), 48);
    assert!(mean.iter().all(|m| m.abs() < 0.05) && rms < 0.2, "{mean:?} {rms}");
}

#[test]
fn what_hides_the_board_moves_no_corner() {
    let board = charuco();
    let camera = camera(0.5, 0.3, 0.45);
    let mut image = noisy(&photograph(&board, &camera), 1.0);
    // A disc as an object would stand there, over a third of the pattern.
    for y in 0..480 {
        for x in 0..640 {
            if (x as f64 - 330.0).hypot(y as f64 - 250.0) < 90.0 {
                image.set(x, y, [(60 + x / 8) as u8, 90, 70]);
            }
        }
    }
    let view = detect_board(&image, &board).unwrap();
    let places = board.corners();
    for (id, pixel) in &view.corners {
        let truth = camera.project(&places[*id]).unwrap().pixel;
        assert!((pixel - truth).norm() < 0.3, "corner {id} at {pixel}, not {truth}");
    }
    println!("{} corners left", view.corners.len());
    assert!((8..24).contains(&view.corners.len()));
}

#[test]
fn corners_are_found_where_markers_are_too_small_to_be_read() {
    let board = charuco();
    // Two metres away a module is a pixel and a half.
    let camera = camera(0.5, 0.4, 2.0);
    let view = detect_board(&noisy(&photograph(&board, &camera), 2.0), &board).unwrap();
    let (mean, rms) = errors(&view, &board, &camera);
    println!("{} markers, {} corners, mean {mean:.4?}, rms {rms:.4}", view.markers.len(), view.corners.len());
    assert!(view.markers.len() < 12 && view.corners.len() == 24);
    assert!(mean.iter().all(|m| m.abs() < 0.02) && rms < 0.03, "{mean:?} {rms}");
}

#[test]
fn nothing_is_found_where_nothing_is() {
    for (width, height) in [(0, 0), (3, 3), (320, 240)] {
        let image = Image::filled(width, height, [127; 3]);
        for board in
            [charuco(), "chessboard:10x7:21mm".parse().unwrap(), "aruco:4x3:40mm:12mm:5x5_100".parse().unwrap()]
        {
            assert_eq!(detect_board(&image, &board).unwrap(), BoardView::default(), "{board}");
        }
    }
}

#[test]
fn the_dictionary_is_found_by_trying() {
    for name in ["4x4_50", "5x5_250", "6x6_250", "7x7_50", "aruco_original", "apriltag_36h11"] {
        let dictionary: Dictionary = name.parse().unwrap();
        // Enough markers that the smaller of its family would not do.
        let board = Board::ArucoGrid { columns: 13, rows: 9, marker: 0.02, gap: 0.005, dictionary };
        let board = if name.ends_with("_50") { format!("aruco:7x5:40mm:10mm:{name}").parse().unwrap() } else { board };
        let grey = board.raster(2500.0, 0.02).unwrap();
        let image = grey.map(|v| [v; 3]);
        let found = guess_dictionary(std::slice::from_ref(&image)).unwrap();
        assert_eq!(found, Some(dictionary));
    }
    assert_eq!(guess_dictionary(&[Image::filled(64, 64, [200; 3])]).unwrap(), None);
}

/// The page as it is printed, ruler and all.
#[test]
fn every_marker_and_corner_of_a_printed_sheet_is_found() {
    for text in ["charuco:7x5:30mm:22.5mm:4x4_50", "charuco:6x8:25mm:18mm:6x6_250:light-first", "chessboard:10x7:20mm"]
    {
        let board: Board = text.parse().unwrap();
        let sheet = Sheet::new(&board, &SheetOptions { dpi: 150.0, ..SheetOptions::default() }).unwrap();
        let image = sheet.raster().unwrap().map(|v| [v; 3]);
        let view = detect_board(&image, &board).unwrap();
        assert_eq!((view.markers.len(), view.corners.len()), (board.markers().len(), board.corners().len()), "{text}");
        // To scale: the distance of two corners on the page.
        let places = board.corners();
        let pixels_per_metre = (150.0_f64 / 0.0254).round();
        for pair in view.corners.windows(2) {
            let expected = (places[pair[1].0] - places[pair[0].0]).norm() * pixels_per_metre;
            let error = (pair[1].1 - pair[0].1).norm() - expected;
            assert!(error.abs() < 0.05, "{text}: {error} px");
        }
    }
}

/// OpenCV draws the same board: pixel by pixel, where pixels divide squares and modules.
#[test]
fn our_charuco_board_is_opencvs() {
    for (columns, rows) in [(7, 5), (6, 8), (8, 7)] {
        let text = format!("charuco:{columns}x{rows}:30mm:18mm:5x5_100");
        let board: Board = text.parse().unwrap();
        // A module of 7 is 18/7 mm: 70 pixels a square of 42 pixels of marker.
        let ours = board.raster(70.0 / 0.03, 0.0).unwrap();
        let theirs = opencv_dictionary(board.dictionary().unwrap()).unwrap();
        let mut theirs = aruco::CharucoBoard::create(columns, rows, 0.03, 0.018, &theirs).unwrap();
        let mut picture = Mat::default();
        let size = Size::new(70 * columns, 70 * rows);
        opencv::prelude::CharucoBoardTrait::draw(&mut theirs, size, &mut picture, 0, 1).unwrap();
        let differing = picture.data_bytes().unwrap().iter().zip(ours.pixels()).filter(|(a, b)| a.abs_diff(**b) > 100);
        let differing = differing.count();
        assert!(differing * 1000 < ours.pixels().len(), "{text}: {differing} pixels differ");
        let corners = opencv::prelude::CharucoBoardTraitConst::chessboard_corners(&theirs);
        let mut expected: Vec<Point3<f64>> = corners.iter().map(|p| [p.x, p.y, p.z].map(f64::from).into()).collect();
        // Before 4.7 it counts corners from the bottom.
        expected.sort_by(|a, b| b.y.total_cmp(&a.y).then(a.x.total_cmp(&b.x)));
        for (a, b) in board.corners().iter().zip(&expected) {
            assert!((a - b).norm() < 1e-6, "{text}: {a} {b}");
        }
    }
}

fn opencv_codes(dictionary: Dictionary) -> Vec<u64> {
    let theirs = opencv_dictionary(dictionary).unwrap();
    let list = theirs.bytes_list();
    let n = theirs.marker_size();
    assert_eq!(n as usize, dictionary.modules());
    let code = |id: i32| {
        let row = list.row(id).unwrap();
        let bits = aruco::Dictionary::get_bits_from_byte_list(&row, n).unwrap();
        bits.data_bytes().unwrap().iter().fold(0, |code, &bit| code << 1 | u64::from(bit))
    };
    (0..list.rows()).map(code).collect()
}

#[test]
fn our_tables_are_opencvs() {
    for &dictionary in Dictionary::all() {
        let theirs = opencv_codes(dictionary);
        assert_eq!(theirs.len(), dictionary.len(), "{dictionary}");
        for (id, code) in theirs.into_iter().enumerate() {
            assert_eq!(
                dictionary.code(id),
                Some(code),
                "{dictionary} {id}; `cargo test -p capture --features video -- --ignored write_tables`"
            );
        }
    }
}

#[test]
#[ignore = "rewrites the tables of marker codes from OpenCV's"]
fn write_tables() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/board/codes");
    for name in ["4x4_1000", "5x5_1000", "6x6_1000", "7x7_1000", "apriltag_36h11"] {
        let dictionary: Dictionary = name.parse().unwrap();
        let path = folder.join(format!("{}.txt", name.trim_end_matches("_1000")));
        let old = std::fs::read_to_string(&path).unwrap();
        let comments = old.lines().filter(|line| line.starts_with('#')).map(str::to_owned);
        let digits = (dictionary.modules() * dictionary.modules()).div_ceil(4);
        let codes: Vec<String> = opencv_codes(dictionary).iter().map(|code| format!("{code:0digits$x}")).collect();
        let lines = comments.chain(codes.chunks(120 / (digits + 1)).map(|line| line.join(" ")));
        std::fs::write(&path, lines.map(|line| line + "\n").collect::<String>()).unwrap();
    }
}
