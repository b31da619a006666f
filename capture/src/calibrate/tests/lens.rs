//! What is told of a lens, and what is only assumed.

use super::*;

#[test]
fn a_flat_board_alone_leaves_the_lens_to_assumptions_and_says_so() {
    let film = Film::flat(25.0, 36);
    let film = Film { camera: look(25.0, 1.2, film.axis.0, 0.02), ..film };
    let result = of_board(&film.sightings(2), &options());
    assert!(result.lens.is_degenerate);
    assert!(result.lens.advice.contains("height"));
    assert!(result.lens.constraint_ratio.unwrap() < 1e-2);
    let focal = term(&result, LensParameter::Focal);
    assert!((focal.value - 1180.0).abs() < 4.0 * focal.deviation, "{focal:?}");
}

#[test]
fn two_heights_tell_the_lens_from_nothing() {
    let (low, high) = (Film::flat(25.0, 36), Film::flat(50.0, 36));
    let mut sightings = low.sightings(3);
    sightings.extend(high.sightings(4).into_iter().map(|s| Sighting { film: 1, ..s }));
    let result = of_board(&sightings, &options());
    assert!((result.intrinsics.fx / 1180.0 - 1.0).abs() < 0.003, "{}", result.intrinsics.fx);
    assert!(!result.lens.is_degenerate);
    assert_eq!(platter(&result).segments.len(), 2);
}

#[test]
fn a_board_waved_by_hand_tells_the_lens() {
    let result = of_board(&waved(&lens(), 20, 0.1, 5), &options());
    assert_eq!(result.motion, Motion::FreeHand);
    let truth = [
        (LensParameter::Focal, 1180.0),
        (LensParameter::Cx, 652.0),
        (LensParameter::Cy, 351.0),
        (LensParameter::K1, -0.06),
    ];
    for (parameter, truth) in truth {
        let term = term(&result, parameter);
        assert_eq!(term.source, Source::Footage, "{term:?}");
        assert!((term.value - truth).abs() < 4.0 * term.deviation, "{term:?} for {truth}");
    }
    assert!((result.intrinsics.fx / 1180.0 - 1.0).abs() < 0.002);
}

#[test]
fn a_focal_length_noted_by_the_camera_narrows_what_few_pictures_leave_open() {
    // Three pictures from afar: hardly any perspective.
    let pinhole = Intrinsics { distortion: Distortion::default(), ..lens() };
    let film = Film { lens: pinhole, noise: 0.3, ..Film::flat(30.0, 3) };
    let film = Film { camera: look(30.0, 2.5, film.axis.0, 0.02), ..film };
    let sightings = film.sightings(8);
    let focal = |lens: LensKnowledge| {
        term(&of_board(&sightings, &CalibrateOptions { lens, ..options() }), LensParameter::Focal)
    };
    // Noted 4 % too long.
    let (unknown, noted) = (focal(LensKnowledge::Unknown), focal(LensKnowledge::Guess(1.04 * 1180.0)));
    assert!(noted.deviation < 0.1 * noted.value && noted.deviation < 0.8 * unknown.deviation, "{unknown:?} {noted:?}");
    assert!((noted.value - 1180.0).abs() < 2.0 * noted.deviation, "{noted:?}");
    assert_eq!(noted.source, Source::Assumption);
}

#[test]
fn without_distortion_one_tilt_tells_no_lens_at_all() {
    let pinhole = Intrinsics { distortion: Distortion::default(), ..lens() };
    let film = Film { lens: pinhole, ..Film::flat(35.0, 24) };
    let result = of_board(&film.sightings(7), &options());
    assert!(result.lens.is_degenerate, "{:?}", result.lens);
    let row = term(&result, LensParameter::Cy);
    assert!(row.deviation > 5.0 && row.footage_deviation > row.deviation, "{row:?}");
    assert!(result.findings.iter().any(|f| f.contains("seen at one tilt")), "{:?}", result.findings);
    // What is assumed is still not far off.
    let focal = term(&result, LensParameter::Focal);
    assert!((focal.value - pinhole.fx).abs() < 3.0 * focal.deviation, "{focal:?}");
}

#[test]
fn deviations_are_those_of_repeated_measurements() {
    const RUNS: u64 = 40;
    let parameters = [LensParameter::Focal, LensParameter::Cx, LensParameter::Cy, LensParameter::K1];
    let mut squares = [0.0; 4];
    for run in 0..RUNS {
        let result = of_board(&waved(&lens(), 8, 0.2, 1000 + run), &options());
        for (sum, (parameter, truth)) in
            squares.iter_mut().zip(parameters.into_iter().zip([1180.0, 652.0, 351.0, -0.06]))
        {
            let term = term(&result, parameter);
            *sum += ((term.value - truth) / term.deviation).powi(2) / RUNS as f64;
        }
    }
    // The mean of 40 squares of deviation 1 deviates by 0.22.
    assert!(squares.iter().all(|s| (0.4..1.8).contains(s)), "{squares:?}");
}

#[test]
fn tangential_distortion_is_told_where_it_is_and_held_where_not() {
    let mut decentred = lens();
    decentred.distortion.p1 = 0.003;
    let result = of_board(&waved(&decentred, 20, 0.1, 8), &options());
    assert!((result.intrinsics.distortion.p1 - 0.003).abs() < 5e-4, "{:?}", result.lens);
    let result = of_board(&waved(&lens(), 20, 0.1, 8), &options());
    assert_eq!(term(&result, LensParameter::P1).source, Source::Held);
    assert_eq!(result.intrinsics.fx, result.intrinsics.fy);
}

#[test]
fn strong_distortion_and_long_lenses_are_told_too() {
    let barrel = Intrinsics { distortion: Distortion { k1: -0.28, k2: 0.1, ..Distortion::default() }, ..lens() };
    let result = of_board(&waved(&barrel, 20, 0.1, 9), &options());
    assert!((result.intrinsics.fx / barrel.fx - 1.0).abs() < 0.003, "{:?}", result.intrinsics);
    let long = Intrinsics { fx: 3000.0, fy: 3000.0, ..lens() };
    let poses: Vec<_> = (0..20_i32)
        .map(|k| {
            let turn = UnitQuaternion::from_euler_angles(
                PI + 0.6 * f64::from(k).sin(),
                0.5 * f64::from(k).cos(),
                f64::from(k),
            );
            Isometry3::from_parts(Vector3::new(0.0, 0.0, 1.2).into(), turn)
                * Isometry3::translation(-0.105, -0.105, 0.0)
        })
        .collect();
    let result = of_board(&sightings(&long, &board(), &poses, 0.1, 0.0, 10), &options());
    let focal = term(&result, LensParameter::Focal);
    assert!((focal.value - 3000.0).abs() < 4.0 * focal.deviation && focal.deviation < 30.0, "{focal:?}");
}
