//! Corners that are missing, misread or no corners.

use super::*;
use nalgebra::Vector2;

#[test]
fn a_fifth_of_the_corners_is_enough() {
    let film = Film { dropped: 0.8, ..Film::new(25.0, 60) };
    let result = of_board(&film.sightings(50), &known());
    assert!(axis_error_deg(&result, &film) < 0.05, "{}", axis_error_deg(&result, &film));
    // Even pictures of two and three corners have an angle.
    let placed = result.frames.iter().filter(|f| f.camera.is_some()).count();
    assert!(placed >= 58, "{placed}: {:?}", result.findings);
    assert!(angle_error_deg(&result, &film.angles) < 0.05);
}

#[test]
fn a_picture_with_wrong_ids_is_rejected_and_named() {
    let film = Film::new(25.0, 36);
    let mut sightings = film.sightings(51);
    sightings[7].corners.iter_mut().for_each(|(index, _)| *index = 35 - *index);
    sightings[7].corners.retain(|(index, _)| index % 5 != 0);
    for (n, corner) in sightings[8].corners.iter_mut().enumerate() {
        corner.0 = (7 * n) % 36;
    }
    let result = of_board(&sightings, &known());
    assert!(axis_error_deg(&result, &film) < 0.02);
    assert!(matches!(&result.frames[8].standing, Standing::Rejected(_)), "{:?}", result.frames[8]);
    assert!(result.notes.iter().any(|f| f.starts_with("Picture 8 ")), "{:?}", result.notes);
    // It turns with the others all the same.
    let error = platter(&result).angles[8].unwrap() - film.angles[8];
    assert!(error.abs() < 0.005, "{error}");
}

#[test]
fn single_misread_corners_are_left_out() {
    let film = Film::new(25.0, 36);
    let mut sightings = film.sightings(52);
    for sighting in &mut sightings {
        for n in [2, 9, 13] {
            sighting.corners[n].1 += Vector2::new(15.0 + n as f64, -20.0);
        }
    }
    let result = of_board(&sightings, &known());
    assert!(axis_error_deg(&result, &film) < 0.02 && angle_error_deg(&result, &film.angles) < 0.02);
    assert!(result.frames.iter().all(|f| f.dropped.len() >= 3));
    assert!(result.rms_px < 0.16, "{}", result.rms_px);
}

#[test]
fn corners_that_are_none_are_passed_over() {
    let film = Film::new(25.0, 12);
    let clean = film.sightings(53);
    let mut sightings = clean.clone();
    sightings[3].corners.extend([(36, Point2::new(1.0, 2.0)), (usize::MAX, Point2::new(1.0, 2.0))]);
    sightings[4].corners[2].1 = Point2::new(f64::NAN, 3.0);
    let twice = (sightings[5].corners[1].0, Point2::new(5.0, 5.0));
    sightings[5].corners.push(twice);
    let result = of_board(&sightings, &known());
    assert!(axis_error_deg(&result, &film) < 0.05);
    assert_eq!(result.frames[5].used.iter().filter(|&&index| index == twice.0).count(), 0);
    assert!(result.notes.iter().any(|f| f.contains("twice")), "{:?}", result.notes);
}

#[test]
fn what_cannot_be_told_is_refused_with_the_remedy() {
    let target = Target::Points(board());
    let few = |fault: Result<Calibration, CalibrateError>| matches!(fault, Err(CalibrateError::TooFew { .. }));
    let film = Film::new(25.0, 12).sightings(54);
    assert!(few(calibrate(&target, &[], &known())));
    assert!(few(calibrate(&target, &film[..1], &known())));
    let in_line: Vec<Sighting> = film
        .iter()
        .cloned()
        .map(|mut s| {
            s.corners.retain(|(index, _)| *index < 6);
            s
        })
        .collect();
    assert!(few(calibrate(&target, &in_line, &known())));
    let markers = Target::Markers { side: 0.03 };
    assert!(few(calibrate(&markers, &[Sighting { corners: Vec::new(), ..film[0].clone() }], &options())));
    for target in [
        Target::Points(board()[..3].to_vec()),
        Target::Points(board()[..6].to_vec()),
        Target::Points(vec![Point3::new(f64::NAN, 0.0, 0.0); 8]),
        Target::Markers { side: 0.0 },
    ] {
        let fault = calibrate(&target, &film, &known());
        assert!(matches!(fault, Err(CalibrateError::Target { .. })), "{fault:?}");
    }
    for lens in [
        LensKnowledge::Guess(f64::NAN),
        LensKnowledge::Known(Intrinsics { fx: 0.0, ..lens() }),
        LensKnowledge::Known(Intrinsics { width: 640, ..lens() }),
    ] {
        let fault = calibrate(&target, &film, &CalibrateOptions { lens, ..options() });
        assert!(matches!(fault, Err(CalibrateError::Option { .. })), "{fault:?}");
    }
}

#[test]
fn one_picture_and_a_known_lens_give_its_pose() {
    let film = Film::new(25.0, 12);
    let options = CalibrateOptions { motion: Some(MotionKind::FreeHand), ..known() };
    let result = of_board(&film.sightings(55)[2..3], &options);
    let truth = film.pose(2).inverse_transform_point(&Point3::origin());
    let found = result.world_from_target.inverse_transform_point(&result.frames[0].camera.unwrap().center());
    assert!((found - truth).norm() < 0.003, "{found} for {truth}");
}

#[test]
fn noise_alone_ends_in_an_answer() {
    let mut chance = Chance(56);
    let sightings: Vec<Sighting> = (0..10)
        .map(|frame| {
            let mut at = |size: usize| chance.uniform() * size as f64;
            let corners = (0..36).map(|index| (index, Point2::new(at(SIZE[0]), at(SIZE[1])))).collect();
            Sighting { frame, time_s: frame as f64, corners, film: 0 }
        })
        .collect();
    // Whatever is said of it, it is not that all is well.
    if let Ok(result) = calibrate(&Target::Points(board()), &sightings, &options()) {
        assert!(result.findings.iter().any(|f| f.contains("too far to trust")), "{:?}", result.findings);
        assert!(result.intrinsics.fx.is_finite() && result.rms_px.is_finite());
    }
}
