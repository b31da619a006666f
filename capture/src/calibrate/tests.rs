//! Cameras told from corners whose truth is known.

use super::*;
use crate::{Board, Distortion};
use nalgebra::{Rotation3, UnitQuaternion};
use std::f64::consts::{PI, TAU};

const SIZE: [usize; 2] = [1280, 720];

/// Numbers by chance: SplitMix64.
struct Chance(u64);

impl Chance {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Of deviation 1 (Box and Muller 1958).
    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}

fn lens() -> Intrinsics {
    let distortion = Distortion { k1: -0.06, k2: 0.02, ..Distortion::default() };
    Intrinsics { fx: 1180.0, fy: 1180.0, skew: 0.0, cx: 652.0, cy: 351.0, distortion, width: SIZE[0], height: SIZE[1] }
}

/// 7 × 7 squares of 30 mm.
fn board() -> Vec<Point3<f64>> {
    (0..36).map(|k| Point3::new(0.03 + 0.03 * (k % 6) as f64, 0.18 - 0.03 * (k / 6) as f64, 0.0)).collect()
}

/// A camera that looks at a point of the target from an elevation and distance.
fn look(elevation_deg: f64, distance: f64, at: Point3<f64>, roll: f64) -> Isometry3<f64> {
    let e = elevation_deg.to_radians();
    let eye = at + distance * Vector3::new(0.0, -e.cos(), e.sin());
    let forward = (at - eye).normalize();
    let right = Vector3::x();
    let down = forward.cross(&right);
    let rotation = Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_rows(&[
        right.transpose(),
        down.transpose(),
        forward.transpose(),
    ]));
    let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), roll) * rotation;
    Isometry3::from_parts((-(rotation * eye.coords)).into(), UnitQuaternion::from_rotation_matrix(&rotation))
}

/// A platter with a board on it, and what a camera sees of it.
#[derive(Clone)]
struct Film {
    lens: Intrinsics,
    points: Vec<Point3<f64>>,
    /// In target coordinates.
    axis: (Point3<f64>, Vector3<f64>),
    camera: Isometry3<f64>,
    /// In radians.
    angles: Vec<f64>,
    noise: f64,
    /// Part of the corners that are not found.
    dropped: f64,
}

impl Film {
    fn new(elevation_deg: f64, frames: usize) -> Self {
        let tilt = Rotation3::from_axis_angle(&Vector3::x_axis(), 5_f64.to_radians());
        let axis = (Point3::new(0.112, 0.098, 0.0), tilt * Vector3::z());
        Self {
            lens: lens(),
            points: board(),
            axis,
            camera: look(elevation_deg, 0.5, axis.0 + Vector3::new(0.0, 0.0, 0.03), 0.02),
            angles: (0..frames).map(|k| TAU * k as f64 / frames as f64).collect(),
            noise: 0.1,
            dropped: 0.3,
        }
    }

    fn flat(elevation_deg: f64, frames: usize) -> Self {
        let film = Self::new(elevation_deg, frames);
        Self { axis: (film.axis.0, Vector3::z()), ..film }
    }

    /// Target to camera.
    fn pose(&self, frame: usize) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_scaled_axis(self.axis.1 * self.angles[frame]);
        let to = Isometry3::translation(self.axis.0.x, self.axis.0.y, self.axis.0.z);
        self.camera * to * Isometry3::from_parts(nalgebra::Translation3::identity(), turn) * to.inverse()
    }

    fn sightings(&self, seed: u64) -> Vec<Sighting> {
        let poses: Vec<_> = (0..self.angles.len()).map(|k| self.pose(k)).collect();
        sightings(&self.lens, &self.points, &poses, self.noise, self.dropped, seed)
    }
}

fn sightings(
    lens: &Intrinsics,
    points: &[Point3<f64>],
    poses: &[Isometry3<f64>],
    noise: f64,
    dropped: f64,
    seed: u64,
) -> Vec<Sighting> {
    let mut chance = Chance(seed);
    let see = |(frame, pose): (usize, &Isometry3<f64>)| {
        let mut corners = Vec::new();
        for (index, point) in points.iter().enumerate() {
            let (x, y, keep) = (chance.normal(), chance.normal(), chance.uniform() >= dropped);
            let Some(pixel) = projection::project(lens, &(pose * point).coords) else { continue };
            let is_inside = pixel.x > 0.0 && pixel.y > 0.0 && pixel.x < SIZE[0] as f64 && pixel.y < SIZE[1] as f64;
            if keep && is_inside {
                corners.push((index, pixel + noise * nalgebra::Vector2::new(x, y)));
            }
        }
        Sighting { frame, time_s: frame as f64 / 30.0, corners, film: 0 }
    };
    poses.iter().enumerate().map(see).collect()
}

/// A board held before the camera at many tilts.
fn waved(lens: &Intrinsics, count: usize, noise: f64, seed: u64) -> Vec<Sighting> {
    let mut chance = Chance(seed ^ 0x77);
    let poses: Vec<Isometry3<f64>> = (0..count)
        .map(|_| {
            let mut span = |half: f64| half * (2.0 * chance.uniform() - 1.0);
            let turn = Vector3::new(PI + span(0.7), span(0.7), span(3.0));
            let at = Vector3::new(span(0.13), span(0.06), 0.42 + span(0.1));
            Isometry3::from_parts(at.into(), UnitQuaternion::from_euler_angles(turn.x, turn.y, turn.z))
                * Isometry3::translation(-0.105, -0.105, 0.0)
        })
        .collect();
    sightings(lens, &board(), &poses, noise, 0.0, seed)
}

fn options() -> CalibrateOptions {
    CalibrateOptions::new(SIZE)
}

fn known() -> CalibrateOptions {
    CalibrateOptions { lens: LensKnowledge::Known(lens()), ..options() }
}

fn of_board(sightings: &[Sighting], options: &CalibrateOptions) -> Calibration {
    calibrate(&Target::Points(board()), sightings, options).unwrap()
}

fn platter(result: &Calibration) -> &Turntable {
    match &result.motion {
        Motion::Turntable(turntable) => turntable,
        Motion::FreeHand => panic!("not a turntable: {:?}", result.findings),
    }
}

fn term(result: &Calibration, parameter: LensParameter) -> LensTerm {
    result.lens.terms[parameter as usize]
}

/// RMS of the angles' errors, their first taken out, in degrees.
fn angle_error_deg(result: &Calibration, truth: &[f64]) -> f64 {
    let angles = &platter(result).angles;
    let known: Vec<f64> = angles.iter().zip(truth).filter_map(|(a, t)| Some((*a)? - t)).collect();
    let mean = known.iter().sum::<f64>() / known.len() as f64;
    (known.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / known.len() as f64).sqrt().to_degrees()
}

fn axis_error_deg(result: &Calibration, film: &Film) -> f64 {
    platter(result).axis_direction.angle(&film.axis.1).to_degrees()
}

#[test]
fn a_known_lens_and_a_tilted_axis_give_axis_and_angles() {
    let film = Film::new(25.0, 36);
    let result = of_board(&film.sightings(1), &known());
    let turntable = platter(&result);
    println!(
        "axis {:.4}°, angles {:.4}°, {:.3} px",
        axis_error_deg(&result, &film),
        angle_error_deg(&result, &film.angles),
        result.rms_px
    );
    println!("{:#?}", result.findings);
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
fn a_flat_board_alone_leaves_the_lens_to_assumptions_and_says_so() {
    let result = of_board(&Film::flat(25.0, 36).sightings(2), &options());
    println!("{:#?}\n{:#?}", result.lens, result.findings);
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
    println!("{:#?}\n{:#?}", result.lens, result.findings);
    assert!((result.intrinsics.fx / 1180.0 - 1.0).abs() < 0.003, "{}", result.intrinsics.fx);
    assert!(!result.lens.is_degenerate);
    assert_eq!(platter(&result).segments.len(), 2);
}

#[test]
fn a_board_waved_by_hand_tells_the_lens() {
    let result = of_board(&waved(&lens(), 20, 0.1, 5), &options());
    println!("{:#?}\n{:#?}", result.lens, result.findings);
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
