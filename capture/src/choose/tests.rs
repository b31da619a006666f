use super::*;
use std::f64::consts::PI;

fn frame(viewpoint: Option<Viewpoint>) -> FilmFrame {
    FilmFrame { time_s: 0.0, sharpness: 1.0, blur_px: None, viewpoint, pose: PoseSource::Measured, motion: 1.0 }
}

fn turned(deg: f64) -> FilmFrame {
    frame(Some(Viewpoint::Angle(deg.to_radians())))
}

fn film(angles_deg: impl Iterator<Item = f64>) -> Vec<FilmFrame> {
    angles_deg.map(turned).collect()
}

fn choose(frames: &[FilmFrame]) -> Choice {
    choose_frames(frames, &ChooseOptions::default())
}

fn reason(choice: &Choice, position: usize) -> Option<DropReason> {
    choice.dropped.iter().find(|d| d.position == position).map(|d| d.reason)
}

#[test]
fn an_even_turn_gives_even_steps() {
    let choice = choose(&film((0..360).map(f64::from)));
    assert_eq!(choice.kept.len(), 72);
    assert!(choice.kept.windows(2).all(|k| k[1] - k[0] == 5), "{:?}", choice.kept);
    assert!(choice.is_closed && choice.gaps.is_empty());
    assert!((choice.step_deg.unwrap() - 5.0).abs() < 1e-9);
    assert_eq!(choice.kept.len() + choice.dropped.len(), 360);
}

#[test]
fn stills_at_even_steps_are_all_kept() {
    for steps in [4, 12, 36, 72] {
        let choice = choose(&film((0..steps).map(|i| 17.0 + 360.0 / f64::from(steps) * f64::from(i))));
        assert_eq!(choice.kept.len(), steps as usize);
        assert!(choice.is_closed, "{steps}");
    }
}

#[test]
fn of_two_turns_the_sharper_frame_of_a_direction_stays() {
    let mut frames = film((0..144).map(|i| 5.0 * f64::from(i)));
    (0..144).for_each(|i| frames[i].sharpness = if (i < 72) == (i % 2 == 0) { 1.0 } else { 0.8 });
    let choice = choose(&frames);
    assert_eq!(choice.kept.len(), 72);
    assert!(choice.kept.iter().all(|&i| frames[i].sharpness == 1.0));
    assert!(choice.dropped.iter().all(|d| d.reason == DropReason::SameDirection), "{:?}", choice.dropped);
    assert!((choice.turns.unwrap() - 143.0 / 72.0).abs() < 1e-9);
}

#[test]
fn half_the_frames_blurred_leaves_the_sharp_half() {
    let mut frames = film((0..144).map(|i| 2.5 * f64::from(i)));
    (0..144).for_each(|i| frames[i].sharpness = if i % 2 == 0 { 1.0 } else { 0.1 });
    let choice = choose(&frames);
    assert_eq!(choice.kept, (0..144).step_by(2).collect::<Vec<_>>());
    assert!(choice.dropped.iter().all(|d| d.reason == DropReason::Blurred));
}

#[test]
fn a_side_with_little_detail_is_not_blurred() {
    let mut frames = film((0..72).map(|i| 5.0 * f64::from(i)));
    frames.iter_mut().enumerate().for_each(|(i, f)| f.sharpness = 0.6 + 0.4 * (TAU * i as f64 / 72.0).cos());
    assert_eq!(choose(&frames).kept.len(), 72);
}

#[test]
fn a_long_blurred_stretch_is_left_out() {
    let mut frames = film((0..144).map(|i| 2.5 * f64::from(i)));
    frames[40..70].iter_mut().for_each(|f| f.sharpness = 0.05);
    let choice = choose(&frames);
    assert!((40..70).all(|i| reason(&choice, i) == Some(DropReason::Blurred)));
    assert_eq!(choice.gaps.len(), 1);
}

#[test]
fn measured_blur_rules_out_unless_all_frames_have_it() {
    let mut frames = film((0..72).map(|i| 5.0 * f64::from(i)));
    frames.iter_mut().for_each(|f| f.blur_px = Some(0.3));
    frames[7].blur_px = Some(4.0);
    assert_eq!(reason(&choose(&frames), 7), Some(DropReason::Blurred));
    frames.iter_mut().for_each(|f| f.blur_px = Some(4.0));
    assert_eq!(choose(&frames).kept.len(), 72);
}

#[test]
fn a_measured_pose_goes_before_a_sharper_one_filled_in() {
    let mut frames = film((0..144).map(|i| 2.5 * f64::from(i)));
    (0..144).filter(|i| i % 2 == 0).for_each(|i| {
        frames[i].pose = PoseSource::Filled;
        frames[i].sharpness = 1.2;
    });
    assert!(choose(&frames).kept.iter().all(|i| i % 2 == 1));
}

#[test]
fn lost_and_rejected_frames_say_so_and_leave_a_gap() {
    let mut frames = film((0..72).map(|i| 5.0 * f64::from(i)));
    for i in 25..30 {
        frames[i].pose = PoseSource::Missing;
    }
    frames[40].pose = PoseSource::Rejected;
    frames[50].viewpoint = Some(Viewpoint::Angle(f64::NAN));
    let choice = choose(&frames);
    assert_eq!(choice.gaps.iter().map(ToString::to_string).collect::<Vec<_>>(), ["between 120° and 150°"]);
    assert!(!choice.is_closed);
    assert_eq!(
        [25, 40, 50].map(|i| reason(&choice, i)),
        [Some(DropReason::NoPose), Some(DropReason::RejectedPose), Some(DropReason::NoPose)]
    );
}

#[test]
fn half_a_turn_is_spread_from_end_to_end() {
    let choice = choose(&film((0..=200).map(f64::from)));
    assert_eq!((choice.kept.first(), choice.kept.last()), (Some(&0), Some(&200)));
    assert_eq!(choice.kept.len(), 41);
    assert_eq!(choice.gaps, [Gap { from_deg: 200.0_f64.to_radians().to_degrees(), to_deg: 360.0 }]);
}

#[test]
fn a_stopped_table_leaves_one_frame() {
    let choice = choose(&film((0..50).map(|_| 30.0)));
    assert_eq!(choice.kept.len(), 1);
    assert_eq!((choice.turns, choice.is_closed, choice.gaps.len()), (Some(0.0), false, 1));
    assert!(choice.dropped.iter().all(|d| d.reason == DropReason::TooClose));
}

#[test]
fn no_frames_and_one_frame_have_an_answer() {
    assert_eq!(choose(&[]), Choice::default());
    assert_eq!(choose(&[turned(0.0)]).kept, [0]);
    let nan = FilmFrame { sharpness: f64::NAN, motion: f64::NAN, blur_px: Some(f64::NAN), ..frame(None) };
    assert_eq!(choose(&[nan; 5]).kept.len(), 5);
    let few = ChooseOptions { most: 0, ..ChooseOptions::default() };
    assert_eq!(choose_frames(&film((0..9).map(f64::from)), &few).kept.len(), 1);
}

#[test]
fn free_hand_frames_lie_apart_and_cover_the_dome() {
    // A spiral over the upper half, densely: directions by the golden angle.
    let direction = |i: usize| {
        let (z, azimuth) = (i as f64 / 2000.0, 2.399_963 * i as f64);
        let r = (1.0 - z * z).sqrt();
        frame(Some(Viewpoint::Direction(3.0 * Vector3::new(r * azimuth.cos(), r * azimuth.sin(), z))))
    };
    let frames: Vec<FilmFrame> = (0..2000).map(direction).collect();
    let choice = choose(&frames);
    let at = |i: usize| match frames[i].viewpoint {
        Some(Viewpoint::Direction(d)) => d,
        _ => Vector3::zeros(),
    };
    assert_eq!(choice.kept.len(), 72);
    let nearest =
        |from: usize| choice.kept.iter().filter(|&&o| o != from).map(|&o| at(from).angle(&at(o))).fold(PI, f64::min);
    // 72 caps that cover half the sphere have a radius of at least acos(1 − 1/72) = 9.6°.
    let apart = choice.kept.iter().map(|&i| nearest(i)).fold(PI, f64::min);
    let hole = (0..2000).filter(|i| !choice.kept.contains(i)).map(nearest).fold(0.0, f64::max);
    assert!(apart.to_degrees() > 12.0 && hole.to_degrees() < 14.0, "{apart} {hole}");
}

#[test]
fn without_directions_frames_are_even_in_motion() {
    // The table stands still for the first half.
    let still =
        |i: usize| FilmFrame { motion: if i < 200 { 0.0 } else { 1.0 }, pose: PoseSource::Missing, ..frame(None) };
    let frames: Vec<FilmFrame> = (0..400).map(still).collect();
    let choice = choose(&frames);
    assert!(choice.kept.iter().filter(|&&i| i < 200).count() <= 1, "{:?}", choice.kept);
    assert!((70..=72).contains(&choice.kept.len()));
    assert_eq!((choice.turns, choice.gaps.len()), (None, 0));
}
