//! Colour as a function of the point in space: value noise and its sums.

use crate::light::smoothstep;
use crate::material::Vec3;
use crate::sampler::{mix, unit};

/// Smooth noise in [0, 1] with features of unit size.
pub(crate) fn noise(p: Vec3, seed: u32) -> f32 {
    // Rounding down by hand: without SSE 4.1 `floor` is a call.
    let cell = p.map(|c| {
        let towards_zero = c as i32;
        towards_zero - i32::from(towards_zero as f32 > c)
    });
    let f = (p - cell.map(|c| c as f32)).map(smoothstep);
    // One number per lattice point, a step along an axis adding that axis' constant (odd, of no pattern).
    const STEPS: [u32; 3] = [0x8da6_b343, 0xd816_3841, 0xcb1a_b31f];
    let [x, y, z] = [0, 1, 2].map(|axis| (cell[axis] as u32).wrapping_mul(STEPS[axis]));
    let corner = x.wrapping_add(y).wrapping_add(z).wrapping_add(seed.wrapping_mul(0x9e37_79b9));
    let value = |corner: u32| unit(mix(corner));
    let along_x = |corner: u32| lerp(value(corner), value(corner.wrapping_add(STEPS[0])), f.x);
    let along_y = |corner: u32| lerp(along_x(corner), along_x(corner.wrapping_add(STEPS[1])), f.y);
    lerp(along_y(corner), along_y(corner.wrapping_add(STEPS[2])), f.z)
}

/// Sum of `octaves` of noise, each twice as fine and half as strong, scaled to [0, 1].
pub(crate) fn fractal(p: Vec3, octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut weight, mut total, mut q) = (0.0, 1.0, 0.0, p);
    for octave in 0..octaves {
        sum += weight * noise(q, seed.wrapping_add(octave));
        total += weight;
        weight *= 0.5;
        // An odd ratio keeps the lattices of the octaves from lining up.
        q *= 2.03;
    }
    if total > 0.0 { sum / total } else { 0.0 }
}

/// Linear interpolation.
pub(crate) fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// 0 below `edge − width/2`, 1 above `edge + width/2`.
pub(crate) fn step(edge: f32, width: f32, x: f32) -> f32 {
    smoothstep((x - edge) / width + 0.5)
}

/// 1 within `half` of a line through zero, softened by `soft`.
pub(crate) fn stripe(x: f32, half: f32, soft: f32) -> f32 {
    1.0 - step(half, soft, x.abs())
}

/// Distance to the nearest multiple of `period`, signed, in [−period/2, period/2].
pub(crate) fn wrap(x: f32, period: f32) -> f32 {
    x - (x / period).round() * period
}

/// Linear RGB of an 8-bit sRGB colour as painters name it.
pub(crate) fn color(srgb: [u8; 3]) -> Vec3 {
    Vec3::from(srgb.map(|c| capture::srgb::linear(f64::from(c) / 255.0) as f32))
}

/// Mixes two colours.
pub(crate) fn blend(a: Vec3, b: Vec3, t: f32) -> Vec3 {
    a + (b - a) * t
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_continuous_and_neither_flat_nor_the_same_everywhere() {
        let mut values = Vec::new();
        for i in 0..2000 {
            let r = |k: u32| unit(mix(7 * i + k)) * 40.0 - 20.0;
            let p = Vec3::new(r(0).round(), r(1), r(2));
            // Across the border of a cell, below zero too.
            let across = noise(p + Vec3::x() * 1e-3, 3) - noise(p - Vec3::x() * 1e-3, 3);
            assert!(across.abs() < 1e-4, "{across} at {p}");
            values.push(f64::from(noise(Vec3::new(r(3), r(4), r(5)), 3)));
        }
        let mean = values.iter().sum::<f64>() / 2000.0;
        let sigma = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 2000.0).sqrt();
        assert!((mean - 0.5).abs() < 0.02 && (0.1..0.25).contains(&sigma), "{mean} ± {sigma}");
    }
}
