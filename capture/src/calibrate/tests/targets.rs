//! Targets of all kinds, and what must not matter about them.

use super::*;

/// The largest distance between where two calibrations put the cameras of the same frames on the target.
fn largest_shift(a: &Calibration, b: &Calibration, b_from_a: &Isometry3<f64>) -> f64 {
    let center =
        |c: &Calibration, k: usize| c.world_from_target.inverse_transform_point(&c.frames[k].camera.unwrap().center());
    (0..a.frames.len()).map(|k| (b_from_a * center(a, k) - center(b, k)).norm()).fold(0.0, f64::max)
}

#[test]
fn the_order_of_corners_and_points_does_not_matter() {
    let film = Film::new(25.0, 20);
    let sightings = film.sightings(70);
    let result = of_board(&sightings, &options());
    let reversed: Vec<Sighting> = sightings
        .iter()
        .map(|s| Sighting { corners: s.corners.iter().rev().map(|&(i, p)| (35 - i, p)).collect(), ..s.clone() })
        .collect();
    let points: Vec<_> = board().into_iter().rev().collect();
    let other = calibrate(&Target::Points(points), &reversed, &options()).unwrap();
    assert!(
        (other.intrinsics.fx - result.intrinsics.fx).abs() < 0.05,
        "{} {}",
        other.intrinsics.fx,
        result.intrinsics.fx
    );
    assert!(largest_shift(&result, &other, &Isometry3::identity()) < 1e-4);
}

#[test]
fn where_the_target_has_its_origin_and_its_unit_do_not_matter() {
    let film = Film::new(25.0, 20);
    let sightings = film.sightings(71);
    let result = of_board(&sightings, &options());
    // Upright, as boards on walls are.
    let moved = Isometry3::new(Vector3::new(3.0, -2.0, 0.5), Vector3::new(1.2, 0.4, -0.3));
    let points: Vec<_> = board().iter().map(|p| moved * p).collect();
    let other = calibrate(&Target::Points(points), &sightings, &options()).unwrap();
    assert!(largest_shift(&result, &other, &moved) < 1e-4);
    for scale in [1e-4, 1e4] {
        let points: Vec<_> = board().iter().map(|p| p * scale).collect();
        let other = calibrate(&Target::Points(points), &sightings, &options()).unwrap();
        assert!((other.intrinsics.fx / result.intrinsics.fx - 1.0).abs() < 1e-5, "{scale}");
        assert!(
            (other.world_from_target.translation.vector / scale - result.world_from_target.translation.vector).norm()
                < 1e-6
        );
    }
}

#[test]
fn a_chessboard_read_from_either_end_is_put_right_by_its_neighbours() {
    let film = Film { dropped: 0.0, ..Film::new(25.0, 36) };
    let mut sightings = film.sightings(72);
    for k in [3, 4, 11, 20, 21, 22, 35] {
        sightings[k].corners.iter_mut().for_each(|(index, _)| *index = 35 - *index);
    }
    let result = of_board(&sightings, &CalibrateOptions { upside_down: true, ..known() });
    assert!(result.frames.iter().all(|f| f.standing == Standing::Used));
    assert!(angle_error_deg(&result, &film.angles) < 0.02 && axis_error_deg(&result, &film) < 0.02);
    let lopsided: Vec<_> = board()[..35].to_vec();
    let options = CalibrateOptions { upside_down: true, ..known() };
    assert!(matches!(
        calibrate(&Target::Points(lopsided), &sightings, &options),
        Err(CalibrateError::Option { option: "upside_down", .. })
    ));
}

/// A box with a grid of points on each of two sides and on top.
fn solid() -> Vec<Point3<f64>> {
    let grid = (0..25).map(|k| (0.02 * (k % 5) as f64, 0.02 * (k / 5) as f64));
    grid.flat_map(|(a, b)| [Point3::new(a, b, 0.1), Point3::new(a, -0.01, 0.09 - b), Point3::new(-0.01, a, 0.09 - b)])
        .collect()
}

#[test]
fn a_target_that_is_not_flat_tells_the_lens_from_one_round() {
    let film = Film { points: solid(), axis: (Point3::new(0.04, 0.04, 0.05), Vector3::z()), ..Film::flat(30.0, 24) };
    let result = calibrate(&Target::Points(solid()), &film.sightings(73), &options()).unwrap();
    assert_eq!(result.lens.constraint_ratio, None);
    assert!(!result.lens.is_degenerate, "{:?}", result.lens);
    assert!((result.intrinsics.fx / 1180.0 - 1.0).abs() < 0.005, "{}", result.intrinsics.fx);
    assert!(axis_error_deg(&result, &film) < 0.05);
}

/// Markers of 25 mm strewn about a plane, corner `4 id + k`.
fn strewn(ids: &[usize]) -> Vec<(usize, Point3<f64>)> {
    let mut chance = Chance(74);
    let mut points = Vec::new();
    for (n, id) in ids.iter().enumerate() {
        let (x, y) = (0.06 * (n % 4) as f64, 0.06 * (n / 4) as f64);
        let place = rig::flat_place(x + 0.02 * chance.uniform(), y + 0.02 * chance.uniform(), TAU * chance.uniform());
        points.extend((0..4).map(|k| (4 * id + k, rig::square_corner(&place, 0.025, k))));
    }
    points
}

/// What a film shows of markers; whole markers are covered now and then.
fn marker_sightings(film: &Film, layout: &[(usize, Point3<f64>)], seed: u64) -> Vec<Sighting> {
    let points: Vec<_> = layout.iter().map(|(_, p)| *p).collect();
    let mut chance = Chance(seed);
    let mut sightings = Film { points, dropped: 0.0, ..film.clone() }.sightings(seed);
    for sighting in &mut sightings {
        let covered: Vec<bool> = layout.chunks(4).map(|_| chance.uniform() < 0.4).collect();
        sighting.corners.retain(|(at, _)| !covered[at / 4]);
        sighting.corners.iter_mut().for_each(|(at, _)| *at = layout[*at].0);
    }
    sightings
}

/// Largest distance between learnt and true corners once the best rigid motion in the plane is taken out.
fn layout_error(result: &Calibration, truth: &[(usize, Point3<f64>)]) -> f64 {
    let learnt = |index: usize| result.points.iter().find(|(i, _)| *i == index).unwrap().1;
    let pairs: Vec<(Point3<f64>, Point3<f64>)> = truth.iter().map(|&(i, p)| (learnt(i), p)).collect();
    let n = pairs.len() as f64;
    let from = pairs.iter().map(|p| p.0.coords).sum::<Vector3<f64>>() / n;
    let to = pairs.iter().map(|p| p.1.coords).sum::<Vector3<f64>>() / n;
    let (mut dot, mut cross) = (0.0, 0.0);
    for (a, b) in &pairs {
        let (a, b) = ((a.coords - from).xy(), (b.coords - to).xy());
        dot += a.dot(&b);
        cross += a.perp(&b);
    }
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), cross.atan2(dot));
    pairs.iter().map(|(a, b)| (turn * (a.coords - from) + to - b.coords).norm()).fold(0.0, f64::max)
}

#[test]
fn a_free_layout_of_markers_is_learnt() {
    let layout = strewn(&[3, 7, 8, 12, 20, 21, 40, 41, 42, 43, 48, 49]);
    let film = Film { axis: (Point3::new(0.1, 0.07, 0.0), Vector3::z()), ..Film::flat(30.0, 30) };
    let film = Film { camera: look(30.0, 0.5, film.axis.0, 0.0), ..film };
    let mut sightings = marker_sightings(&film, &layout, 75);
    // One marker misread as another, one seen twice.
    sightings[4].corners.iter_mut().filter(|c| c.0 / 4 == 7).for_each(|c| c.0 += 4 * (20 - 7));
    sightings[9].corners.extend((0..4).map(|k| (4 * 12 + k, Point2::new(30.0 + 9.0 * k as f64, 40.0))));
    let result = calibrate(&Target::Markers { side: 0.025 }, &sightings, &known()).unwrap();
    assert_eq!(result.points.len(), layout.len());
    assert!(layout_error(&result, &layout) < 1e-4, "{}", layout_error(&result, &layout));
    assert!(angle_error_deg(&result, &film.angles) < 0.02, "{}", angle_error_deg(&result, &film.angles));
    assert!(result.rms_px < 0.16, "{}", result.rms_px);
}

#[test]
fn markers_never_seen_with_the_others_are_named() {
    let layout = strewn(&[0, 1, 2, 3, 4, 5]);
    let film = Film { axis: (Point3::new(0.1, 0.07, 0.0), Vector3::z()), ..Film::flat(30.0, 30) };
    let film = Film { camera: look(30.0, 0.5, film.axis.0, 0.0), ..film };
    let mut sightings = marker_sightings(&film, &layout, 76);
    for (k, sighting) in sightings.iter_mut().enumerate() {
        sighting.corners.retain(|(index, _)| (index / 4 == 5) == (k % 6 == 5));
    }
    let result = calibrate(&Target::Markers { side: 0.025 }, &sightings, &known()).unwrap();
    assert!(result.findings.iter().any(|f| f.contains("Markers 5 are never seen together")), "{:?}", result.findings);
    assert_eq!(result.points.len(), 20);
}

#[test]
fn markers_on_paper_that_curls_leave_its_plane() {
    let mut layout = strewn(&(0..16).collect::<Vec<_>>());
    // Rolled about y, by a radius of 0.4 m.
    for (_, p) in &mut layout {
        let turn = p.x / 0.4;
        *p = Point3::new(0.4 * turn.sin(), p.y, 0.4 * (1.0 - turn.cos()));
    }
    let film = Film { axis: (Point3::new(0.1, 0.09, 0.02), Vector3::z()), ..Film::flat(35.0, 30) };
    let film = Film { camera: look(35.0, 0.5, film.axis.0, 0.0), ..film };
    let sightings = marker_sightings(&film, &layout, 77);
    let result = calibrate(&Target::Markers { side: 0.025 }, &sightings, &known()).unwrap();
    assert!(result.rms_px < 0.3, "{} {:?}", result.rms_px, result.findings);
    // In parts of a marker's side, so that it is said alike in metres and in sides of a marker.
    let curl = |result: &Calibration| result.notes.iter().find(|n| n.contains("% of their side out of")).cloned();
    assert!(curl(&result).is_some(), "{:?}", result.notes);
    let unscaled = calibrate(&Target::Markers { side: 1.0 }, &sightings, &known()).unwrap();
    assert_eq!(curl(&unscaled), curl(&result));
    // The axis of the film in the world is the world's.
    assert!(angle_error_deg(&result, &film.angles) < 0.02);
    let flat = marker_sightings(&film, &strewn(&(0..16).collect::<Vec<_>>()), 77);
    let result = calibrate(&Target::Markers { side: 0.025 }, &flat, &known()).unwrap();
    assert!(result.points.iter().all(|(_, p)| p.z == 0.0));
}

#[test]
fn a_board_that_curls_is_unrolled_and_a_flat_one_is_left_alone() {
    // Rolled about a slanted line through its middle, by a radius of 0.7 m.
    let across = Vector3::new(0.8, 0.6, 0.0);
    let middle = Point3::new(0.105, 0.105, 0.0);
    let rolled = |p: &Point3<f64>| {
        let u = across.dot(&(p - middle));
        let turn = u / 0.7;
        p + across * (0.7 * turn.sin() - u) + Vector3::z() * (0.7 * (1.0 - turn.cos()))
    };
    let flat = Film::flat(35.0, 24);
    let film = Film { points: board().iter().map(rolled).collect(), ..flat.clone() };
    for options in [known(), options()] {
        let result = of_board(&film.sightings(78), &options);
        assert!(result.rms_px < 0.16, "{}", result.rms_px);
        assert!(result.notes.iter().any(|n| n.contains("board is bent")), "{:?}", result.notes);
        let truth: Vec<(usize, Point3<f64>)> = film.points.iter().copied().enumerate().collect();
        let heights: Vec<f64> = truth.iter().map(|(k, p)| result.points[*k].1.z - p.z).collect();
        let mean = heights.iter().sum::<f64>() / heights.len() as f64;
        assert!(heights.iter().all(|h| (h - mean).abs() < 2e-4), "{heights:?}");
        assert!(axis_error_deg(&result, &film) < 0.1, "{}", axis_error_deg(&result, &film));
        assert!(angle_error_deg(&result, &film.angles) < 0.02);
    }
    let result = of_board(&flat.sightings(79), &known());
    assert!(result.points.iter().all(|(k, p)| *p == board()[*k]), "{:?}", result.notes);
}
