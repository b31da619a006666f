//! Bark: long plates that follow the trunk, +y, torn apart by fissures, rough at every scale.

use super::cells::{cell, fractal};
use crate::btf::patch::Patch;
use crate::light::smoothstep;
use crate::material::Finish;
use crate::texture_field::{blend, color};

/// Length of the period.
pub(super) const SIDE_MM: f64 = 120.0;
const CELLS: usize = 320;
/// Plates along x and along y.
const PLATES: [i64; 2] = [6, 2];

/// The bark.
pub(super) fn patch(seed: u64) -> Patch {
    let mut patch = Patch::new(SIDE_MM, Finish::Matt);
    let (crest, flank, gap) = (color([150, 134, 116]), color([104, 80, 60]), color([44, 28, 20]));
    let lichen = color([132, 136, 112]);
    patch.relief(
        CELLS,
        |x, y| height(seed, x, y),
        |p| {
            let t = (1.0 + p.z as f32 / 12.0).clamp(0.0, 1.0);
            let wood = if t > 0.5 { blend(flank, crest, 2.0 * t - 1.0) } else { blend(gap, flank, 2.0 * t) };
            let spots = fractal(seed + 31, p.x / 12.0, p.y / 12.0, [10, 10], 4) as f32;
            let grey = fractal(seed + 32, p.x / 4.0, p.y / 8.0, [30, 15], 3) as f32;
            blend(wood, lichen, smoothstep((spots - 0.56) * 9.0) * t) * (0.65 + 0.7 * grey)
        },
    );
    patch
}

/// Millimetres, about −14 to 2.
fn height(seed: u64, x: f64, y: f64) -> f64 {
    let [px, py] = PLATES;
    let (u, v) = (x / SIDE_MM, y / SIDE_MM);
    let wander = |s: u64, amount: f64| amount * (fractal(seed + s, 6.0 * u, 5.0 * v, [6, 5], 4) - 0.5);
    let plate = cell(seed, u * px as f64 + wander(1, 1.1), v * py as f64 + wander(2, 0.8), PLATES);
    let edge = ((plate.second - plate.first) / 0.42).min(1.0);
    // Steep sides, flat top.
    let top = 1.0 - (1.0 - edge).powi(3);
    let flakes = fractal(seed + 11, 18.0 * u, 6.0 * v, [18, 6], 5);
    let grain = fractal(seed + 21, 48.0 * u, 24.0 * v, [48, 24], 3);
    let scale = cell(seed + 5, 14.0 * u + wander(3, 1.0), 10.0 * v + wander(4, 1.0), [14, 10]);
    let cracks = 1.0 - ((scale.second - scale.first) / 0.12).min(1.0);
    12.0 * (top - 1.0) + 5.0 * (flakes - 0.5) + 1.6 * (grain - 0.5) + 2.0 * (plate.own - 0.5) * top - 1.2 * cracks
}
