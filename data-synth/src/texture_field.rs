//! Colour as a function of the point in space: value noise and its sums.

use crate::light::smoothstep;
use crate::material::Vec3;
use crate::sampler::{mix, unit};

/// Smooth noise in [0, 1] with features of unit size.
pub(crate) fn noise(p: Vec3, seed: u32) -> f32 {
    let cell = p.map(f32::floor);
    let f = (p - cell).map(smoothstep);
    let at = |dx: i32, dy: i32, dz: i32| {
        let [x, y, z] =
            [(cell.x as i32).wrapping_add(dx), (cell.y as i32).wrapping_add(dy), (cell.z as i32).wrapping_add(dz)];
        unit(mix(mix(mix(x as u32 ^ seed) ^ y as u32) ^ z as u32))
    };
    let along_x = |dy, dz| lerp(at(0, dy, dz), at(1, dy, dz), f.x);
    lerp(lerp(along_x(0, 0), along_x(1, 0), f.y), lerp(along_x(0, 1), along_x(1, 1), f.y), f.z)
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
    Vec3::from(srgb.map(|c| {
        let c = f32::from(c) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    }))
}

/// Mixes two colours.
pub(crate) fn blend(a: Vec3, b: Vec3, t: f32) -> Vec3 {
    a + (b - a) * t
}
