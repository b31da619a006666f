//! Corduroy: wales of cut pile along y on a twill ground. The pile is tufts of fibres that stand on the
//! wale, part towards its flanks and lean with the nap, +y.

use super::cells::{fractal, noise, random};
use crate::btf::patch::{Patch, sections};
use crate::material::Finish;
use crate::texture_field::color;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Length of the period.
pub(super) const SIDE_MM: f64 = 9.0;
const WALES: usize = 5;
const CELLS: usize = 160;
/// Fibres of the pile.
const FIBRES: i64 = 9000;
const FIBRE_POINTS: usize = 4;
const FIBRE_LENGTH_MM: f64 = 0.34;
const FIBRE_RADIUS_MM: f64 = 0.018;

/// The fabric.
pub(super) fn patch(seed: u64) -> Patch {
    let mut patch = Patch::new(SIDE_MM, Finish::Matt);
    let cotton = color([176, 122, 62]);
    let ground = move |x: f64, y: f64| height(seed, x, y);
    patch.relief(CELLS, ground, |p| {
        let worn = fractal(seed + 7, p.x * 2.0, p.y * 2.0, [18, 18], 3) as f32;
        cotton * (0.55 + 0.3 * worn)
    });
    for fibre in 0..FIBRES {
        let own = |k: i64| random(seed ^ 0xc0_4d00, [fibre, k, 0]);
        let (root, slope) = root(seed, own(0), own(1), own(2));
        // Half parts towards the flank, half follows the nap.
        let lean = Vector3::new(-0.6 * slope + 0.7 * (own(3) - 0.5), 0.35 + 0.7 * (own(4) - 0.5), 1.0);
        let bend = Vector3::new(own(5) - 0.5, own(6) - 0.3, -0.35) * 0.8;
        let length = FIBRE_LENGTH_MM * (0.55 + 0.6 * own(7));
        let point = |k: usize| {
            let t = k as f64 / (FIBRE_POINTS - 1) as f64;
            root + (lean * t + bend * (t * t)) * length
        };
        let points: Vec<_> = (0..FIBRE_POINTS).map(point).collect();
        let shade = 0.75 + 0.5 * own(8) as f32;
        // Dust and wear pale the tips.
        patch.tube(&sections(&points, |t| FIBRE_RADIUS_MM * (1.0 - 0.5 * t)), 3, |t| {
            cotton * (shade * (0.8 + 0.35 * t as f32))
        });
    }
    patch
}

/// Where a fibre stands and the slope across the wale there: denser on the wale than in the furrow.
fn root(seed: u64, a: f64, b: f64, c: f64) -> (Vector3<f64>, f64) {
    let pitch = SIDE_MM / WALES as f64;
    let wale = (a * WALES as f64).floor();
    // Within the wale, −0.4 to 0.4 of the pitch.
    let across = 0.8 * (c - 0.5);
    let (x, y) = ((wale + 0.5 + across) * pitch, b * SIDE_MM);
    let step = 0.02 * pitch;
    let slope = (height(seed, x + step, y) - height(seed, x - step, y)) / (2.0 * step);
    (Vector3::new(x, y, height(seed, x, y)), slope)
}

/// Round wales, a narrow furrow with the floats of the twill in it.
fn height(seed: u64, x: f64, y: f64) -> f64 {
    let pitch = SIDE_MM / WALES as f64;
    let sway = 0.06 * (noise(seed + 1, x, y, [9, 9]) - 0.5);
    let phase = (x / pitch + sway).rem_euclid(1.0) - 0.5;
    let wale = (1.0 - (2.0 * phase).powi(2)).max(0.0).sqrt();
    let tufts = 0.06 * (noise(seed + 2, x * 4.0, y * 4.0, [36, 36]) - 0.5);
    let twill = 0.03 * (TAU * (x * 16.0 + y * 16.0) / SIDE_MM).sin() * (1.0 - wale);
    // The reference plane lies just below the top of the pile.
    0.85 * wale + tufts * wale + twill - 0.8
}
