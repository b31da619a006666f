//! Stockinette: rows of loops, each drawn forward through the loop below. On this side only their legs
//! lie in front and make the V; heads and feet hide behind them.
//!
//! Centre line of a row, by wale width W and height of a course C (a trigonometric form of the loop in
//! Leaf and Glaskin, "The Geometry of a Plain Knitted Loop", 1955):
//!
//! ```text
//! x = W (s/2π + a sin 2s),   y = −b cos s,   z = −d cos 2s,   2b ≈ 2C
//! ```

use super::cells::noise;
use super::yarn::Yarn;
use crate::btf::patch::Patch;
use crate::material::{Finish, Vec3};
use crate::texture_field::color;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Length of the period.
pub(super) const SIDE_MM: f64 = 12.0;
const WALES: usize = 4;
const COURSES: usize = 5;
/// Points along a loop.
const POINTS: usize = 48;

/// The fabric.
pub(super) fn patch(seed: u64) -> Patch {
    let mut patch = Patch::new(SIDE_MM, Finish::glazed(0.45, 1.5));
    let wool = color([190, 52, 44]);
    let (width, course) = (SIDE_MM / WALES as f64, SIDE_MM / COURSES as f64);
    let radius = 0.185 * width;
    for row in 0..COURSES {
        let path = row_path(seed, row, width, course, radius);
        let yarn = Yarn {
            radius: [radius; 2],
            plies: 3,
            turns: 3.0 * WALES as f64,
            fibres: 8,
            loose: 30 * WALES,
            color: wool,
            seed: seed.wrapping_add(row as u64),
        };
        yarn.spin(&mut patch, &path);
    }
    // What lies behind: the sample is mounted on dark felt.
    patch.relief(1, |_, _| -3.2 * radius, |_| Vec3::repeat(0.04));
    patch
}

fn row_path(seed: u64, row: usize, width: f64, course: f64, radius: f64) -> Vec<Vector3<f64>> {
    let uneven = |k: u64, place: f64, amount: f64| {
        let wave = noise(seed.wrapping_add(100 * k), place, row as f64 + 0.5, [2 * WALES as i64, COURSES as i64]);
        amount * (wave - 0.5)
    };
    let point = |i: usize| {
        let loops = (i as f64) / POINTS as f64;
        let s = TAU * loops;
        let x = width * (loops + 0.17 * (2.0 * s).sin() + uneven(1, 2.0 * loops, 0.10));
        let y = course * (row as f64 + 0.5 - 0.88 * s.cos() + uneven(2, 2.0 * loops, 0.12));
        let z = -radius * (1.15 * (2.0 * s).cos() + 0.6 + uneven(3, 2.0 * loops, 0.3));
        Vector3::new(x, y, z)
    };
    (0..=POINTS * WALES).map(point).collect()
}
