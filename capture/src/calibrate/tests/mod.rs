//! Cameras told from corners whose truth is known.

mod chance;
mod deviation;
mod faults;
mod lens;
mod platter;
mod targets;

use super::*;
use crate::Distortion;
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

/// Turns a little unevenly: 3 % once a turn and 1 % seven times a turn.
fn uneven(frames: usize, turns: f64) -> Vec<f64> {
    let steady = |k: usize| TAU * turns * k as f64 / frames as f64;
    (0..frames).map(|k| steady(k) + 0.03 * steady(k).sin() + 0.01 / 7.0 * (7.0 * steady(k)).sin()).collect()
}
