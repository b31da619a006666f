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
    let next = |hash: u32, c: i32| [mix(hash ^ c as u32), mix(hash ^ c.wrapping_add(1) as u32)];
    let along_x = |[a, b]: [u32; 2]| lerp(unit(a), unit(b), f.x);
    // Hashes of the corners share those of the edges they lie on.
    let [near, far] = [cell.x, cell.x.wrapping_add(1)].map(|x| next(mix(x as u32 ^ seed), cell.y));
    let ends = |y: usize| {
        let (a, b) = (next(near[y], cell.z), next(far[y], cell.z));
        [along_x([a[0], b[0]]), along_x([a[1], b[1]])]
    };
    let ([a, b], [c, d]) = (ends(0), ends(1));
    lerp(lerp(a, c, f.y), lerp(b, d, f.y), f.z)
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
