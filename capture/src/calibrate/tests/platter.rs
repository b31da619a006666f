//! Axis, angles and moves of the camera.

use super::*;

#[test]
fn a_known_lens_and_a_tilted_axis_give_axis_and_angles() {
    let film = Film::new(25.0, 36);
    let result = of_board(&film.sightings(1), &known());
    let turntable = platter(&result);
    assert!(axis_error_deg(&result, &film) < 0.02);
    assert!(angle_error_deg(&result, &film.angles) < 0.01);
    let foot = turntable.axis_point - film.axis.0;
    assert!((foot - film.axis.1 * foot.dot(&film.axis.1)).norm() < 5e-5, "{foot}");
    assert_eq!(result.intrinsics, lens());
    // 0.1 px each way, less what the parameters take up.
    assert!((result.rms_px - 0.1414).abs() < 0.01, "{}", result.rms_px);
    assert_eq!(turntable.segments.len(), 1);
}

#[test]
fn the_world_stands_on_the_axis_and_cameras_see_what_was_seen() {
    let film = Film { noise: 0.0, dropped: 0.0, ..Film::new(30.0, 12) };
    let result = of_board(&film.sightings(1), &known());
    let world = result.world_from_target;
    assert!((world * film.axis.0).coords.xy().norm() < 1e-7);
    assert!((world.rotation * film.axis.1 - Vector3::z()).norm() < 1e-7);
    // The origin is where the axis meets the board, x stays in the plane of the axis and the board's x.
    assert!(world.inverse_transform_point(&Point3::origin()).z.abs() < 1e-7);
    assert!((world.rotation * Vector3::x()).y.abs() < 1e-7);
    for (k, frame) in result.frames.iter().enumerate() {
        let camera = frame.camera.unwrap();
        for point in board() {
            let truth = projection::project(&film.lens, &(film.pose(k) * point).coords).unwrap();
            assert!((camera.project(&(world * point)).unwrap().pixel - truth).norm() < 1e-5);
        }
        assert!(camera.center().z > 0.0);
    }
    let turntable = platter(&result);
    assert_eq!(turntable.angles[0], Some(0.0));
    assert!((turntable.angles[3].unwrap() - film.angles[3]).abs() < 1e-7);
}

/// A film whose camera is pushed at a frame, by metres and radians.
fn knocked(film: &Film, at: usize, by: f64) -> Vec<Sighting> {
    let push = Isometry3::new(Vector3::new(by, -0.5 * by, 0.3 * by), Vector3::new(0.5 * by, by, 0.8 * by));
    let moved = Film { camera: push * film.camera, ..film.clone() };
    let (before, after) = (film.sightings(20), moved.sightings(21));
    before[..at].iter().chain(&after[at..]).cloned().collect()
}

#[test]
fn a_camera_knocked_midway_makes_two_segments() {
    let film = Film::flat(30.0, 40);
    // Fifty pixels, and one.
    for by in [0.03, 0.0006] {
        let result = of_board(&knocked(&film, 22, by), &known());
        let turntable = platter(&result);
        let segments: Vec<(usize, usize)> = turntable.segments.iter().map(|s| (s.first, s.last)).collect();
        assert_eq!(segments, [(0, 21), (22, 39)], "{by}: {:?}", result.findings);
        assert!(result.findings.iter().any(|f| f.contains("moved between picture 21 and picture 22")));
        assert!(axis_error_deg(&result, &film) < 0.02);
        // The turn of the platter that the push looks like is nobody's.
        let steps = turntable.angles.windows(2).zip(film.angles.windows(2)).enumerate();
        for (k, (found, truth)) in steps.filter(|(k, _)| *k != 21) {
            assert!((found[1].unwrap() - found[0].unwrap() - truth[1] + truth[0]).abs() < 1e-3, "{by} {k}");
        }
        assert!((turntable.angles[39].unwrap() - film.angles[39]).abs() < 0.1);
        assert!(result.frames.iter().all(|f| f.standing == Standing::Used));
        // Nothing is known of the time between.
        assert!(result.camera_at(0, 21.5 / 30.0).is_none() && result.camera_at(0, 20.5 / 30.0).is_some());
    }
}

#[test]
fn a_camera_that_stands_still_has_one_segment() {
    for seed in 0..6 {
        let film = Film { noise: 0.3, ..Film::new(20.0, 60) };
        assert_eq!(platter(&of_board(&film.sightings(seed), &options())).segments.len(), 1);
    }
}

#[test]
fn pictures_without_the_board_get_their_camera_from_the_motion() {
    let film = Film { angles: uneven(120, 1.05), ..Film::flat(25.0, 120) };
    let mut sightings = film.sightings(30);
    // Every second one, and a quarter of a second on end.
    let is_lost = |k: usize| k % 2 == 1 || (50..58).contains(&k);
    (0..120).filter(|&k| is_lost(k)).for_each(|k| sightings[k].corners.clear());
    let result = of_board(&sightings, &known());
    let turntable = platter(&result);
    let offset = turntable.angles[0].unwrap() - film.angles[0];
    for (k, frame) in result.frames.iter().enumerate().filter(|(k, _)| is_lost(*k)) {
        let (angle, deviation) = (turntable.angles[k].unwrap(), frame.filled_deviation.unwrap());
        let error = (angle - offset - film.angles[k]).abs();
        assert!(error < 0.2_f64.to_radians() && error < 4.0 * deviation, "{k}: {error} ± {deviation}");
        assert!(matches!(frame.standing, Standing::Rejected(_)) && frame.camera.is_some());
    }
}

#[test]
fn angles_that_nothing_tells_are_not_made_up() {
    // Stills at steps by chance: nothing is known between them.
    let mut chance = Chance(4);
    let mut angles = vec![0.0];
    (1..30).for_each(|k| angles.push(angles[k - 1] + 0.1 + 0.2 * chance.uniform()));
    let film = Film { angles, ..Film::flat(25.0, 30) };
    let mut sightings = film.sightings(31);
    sightings[12].corners.clear();
    let result = of_board(&sightings, &known());
    assert_eq!(result.frames[12].camera, None);
    assert_eq!(platter(&result).angles[12], None);
    assert!(result.notes.iter().any(|f| f.contains("no camera")));
}

#[test]
fn several_turns_are_unwrapped_and_two_pictures_are_enough() {
    let film = Film { angles: uneven(90, 2.4), ..Film::new(25.0, 90) };
    let result = of_board(&film.sightings(32), &known());
    assert!(angle_error_deg(&result, &film.angles) < 0.02);
    assert!(platter(&result).angles[89].unwrap() > 2.3 * TAU);
    // A little more than a turn: two pictures of one angle.
    let film = Film { angles: (0..38).map(|k| (10 * k) as f64 * PI / 180.0).collect(), ..Film::new(25.0, 38) };
    assert!(angle_error_deg(&of_board(&film.sightings(33), &known()), &film.angles) < 0.02);
    let film = Film { angles: vec![0.0, 0.6], ..Film::new(25.0, 2) };
    let result = of_board(&film.sightings(34), &known());
    assert!((platter(&result).angles[1].unwrap() - 0.6).abs() < 0.003);
    // Backwards too.
    let film = Film { angles: uneven(40, -1.0), ..Film::new(25.0, 40) };
    assert!(angle_error_deg(&of_board(&film.sightings(35), &known()), &film.angles) < 0.02);
}

#[test]
fn a_platter_that_never_turns_has_no_axis() {
    let film = Film { angles: vec![0.3; 20], ..Film::new(25.0, 20) };
    let sightings = film.sightings(36);
    for motion in [None, Some(MotionKind::Turntable)] {
        let fault = calibrate(&Target::Points(board()), &sightings, &CalibrateOptions { motion, ..known() });
        assert!(matches!(fault, Err(CalibrateError::AxisUnobservable { turn_deg }) if turn_deg < 2.0), "{fault:?}");
    }
}

#[test]
fn a_carried_camera_is_no_turntable() {
    let sightings = waved(&lens(), 20, 0.1, 37);
    assert_eq!(of_board(&sightings, &options()).motion, Motion::FreeHand);
    let wanted = CalibrateOptions { motion: Some(MotionKind::Turntable), ..options() };
    let fault = calibrate(&Target::Points(board()), &sightings, &wanted);
    assert!(matches!(fault, Err(CalibrateError::NotATurntable { .. })), "{fault:?}");
}

#[test]
fn a_camera_above_the_axis_sees_it_turn() {
    // Of the two poses that a board seen from above allows, neighbours and the axis tell which.
    for (elevation, bound) in [(89.9, 0.15), (80.0, 0.05)] {
        let film = Film { noise: 0.2, ..Film::flat(elevation, 36) };
        let result = of_board(&film.sightings(38), &known());
        assert!(axis_error_deg(&result, &film) < bound, "{}", axis_error_deg(&result, &film));
        assert!(angle_error_deg(&result, &film.angles) < 0.05);
        assert!(result.frames.iter().all(|f| f.standing == Standing::Used));
    }
}

#[test]
fn a_camera_carried_around_in_a_circle_is_no_turntable() {
    let film = Film { dropped: 0.1, ..Film::flat(30.0, 60) };
    let mut chance = Chance(39);
    let poses: Vec<Isometry3<f64>> = (0..60)
        .map(|k| {
            // A hand that does its best: a few millimetres and half a degree.
            let mut shake = || Vector3::new(chance.normal(), chance.normal(), chance.normal());
            Isometry3::new(0.004 * shake(), 0.009 * shake()) * film.pose(k)
        })
        .collect();
    let result = of_board(&sightings(&film.lens, &film.points, &poses, 0.1, 0.1, 40), &options());
    assert_eq!(result.motion, Motion::FreeHand);
    assert!(result.rms_px < 0.16 && result.frames.iter().all(|f| f.standing == Standing::Used));
}
