//! Grained leather: pebbles of two sizes with creases between them, pores, a waxed finish.

use super::cells::{cell, fractal, noise};
use crate::btf::patch::Patch;
use crate::material::Finish;
use crate::texture_field::{blend, color};
use std::f64::consts::FRAC_PI_2;

/// Length of the period.
pub(super) const SIDE_MM: f64 = 12.0;
const CELLS: usize = 320;
/// Pebbles along the period.
const PEBBLES: i64 = 13;

/// The hide.
pub(super) fn patch(seed: u64) -> Patch {
    let mut patch = Patch::new(SIDE_MM, Finish::glazed(0.28, 1.48));
    let (raised, creased) = (color([124, 70, 38]), color([52, 24, 14]));
    patch.relief(
        CELLS,
        |x, y| height(seed, x, y),
        |p| {
            let crease = (-p.z / 0.24).clamp(0.0, 1.0) as f32;
            let cloud = fractal(seed + 9, p.x / 3.0, p.y / 3.0, [4, 4], 4) as f32;
            blend(raised, creased, crease) * (0.75 + 0.5 * cloud)
        },
    );
    patch
}

/// Millimetres; pebbles rise to about zero.
fn height(seed: u64, x: f64, y: f64) -> f64 {
    let scale = PEBBLES as f64 / SIDE_MM;
    let period = [PEBBLES; 2];
    // The lattice of the points must not show: they are read at a place that wanders.
    let wander = |s: u64| 0.5 * (noise(seed + s, x * scale, y * scale, period) - 0.5);
    let (u, v) = (x * scale + wander(1), y * scale + wander(2));
    let pebble = cell(seed + 3, u, v, period);
    let fine = cell(seed + 4, 3.0 * u, 3.0 * v, period.map(|p| 3 * p));
    let dome = |edge: f64| ((edge.min(1.0)) * FRAC_PI_2).sin();
    let large = dome((pebble.second - pebble.first) / 0.7);
    let small = dome((fine.second - fine.first) / 0.5);
    let pore = (1.0 - (fine.first / 0.16).min(1.0)).powi(2);
    0.24 * (large - 1.0) + 0.03 * (small - 1.0) * large - 0.03 * pore + 0.05 * (pebble.own - 0.5) * large
}
