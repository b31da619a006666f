//! Crumpled aluminium foil. A sheet that does not stretch buckles into cones and the creases between
//! them, so the height is a sum of cones around scattered points, up and down, at three scales.

use super::cells::{cell, noise, random};
use crate::btf::patch::Patch;
use crate::material::{Finish, Vec3};

/// Length of the period.
pub(super) const SIDE_MM: f64 = 60.0;
const CELLS: usize = 320;
/// Reflectance of aluminium at normal incidence, linear RGB.
const ALUMINIUM: [f32; 3] = [0.91, 0.92, 0.92];

/// The sheet.
pub(super) fn patch(seed: u64) -> Patch {
    let mut patch = Patch::new(SIDE_MM, Finish::metal(0.18));
    patch.relief(CELLS, |x, y| height(seed, x, y), |_| Vec3::from(ALUMINIUM));
    patch
}

/// Millimetres around zero.
fn height(seed: u64, x: f64, y: f64) -> f64 {
    let (u, v) = (x / SIDE_MM, y / SIDE_MM);
    let crease = |s: u64, count: i64, tilt: f64| {
        let n = count as f64;
        let bent = |k: u64| 0.35 * (noise(seed + s + k, n * u, n * v, [count; 2]) - 0.5);
        let (a, b) = (n * u + bent(50), n * v + bent(51));
        let cones = cell(seed + s, a, b, [count; 2]).first - cell(seed + s + 1, a, b, [count; 2]).first;
        tilt * cones * SIDE_MM / n * (0.8 + 0.4 * random(seed, [s as i64, 0, 0]))
    };
    crease(1, 4, 0.30) + crease(3, 9, 0.22) + crease(5, 23, 0.10)
}
