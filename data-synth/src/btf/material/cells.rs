//! Noise that repeats, and the cells around scattered points (Worley, "A Cellular Texture Basis
//! Function", SIGGRAPH 1996). Coordinates are in cells; the pattern repeats after `period` of them.

use crate::light::smoothstep;
use crate::sampler::{splitmix, unit};

/// A number in [0, 1), a function of seed and place.
pub(super) fn random(seed: u64, place: [i64; 3]) -> f64 {
    let state = place.into_iter().fold(splitmix(seed), |state, c| splitmix(state ^ c as u64));
    f64::from(unit((state >> 32) as u32))
}

/// Smooth noise in [0, 1] with features of one cell.
pub(super) fn noise(seed: u64, x: f64, y: f64, period: [i64; 2]) -> f64 {
    let (cx, cy) = (x.floor(), y.floor());
    let [fx, fy] = [x - cx, y - cy].map(|f| f64::from(smoothstep(f as f32)));
    let at = |i: i64, j: i64| {
        random(seed, [(cx as i64 + i).rem_euclid(period[0]), (cy as i64 + j).rem_euclid(period[1]), 0])
    };
    let along = |j| at(0, j) * (1.0 - fx) + at(1, j) * fx;
    along(0) * (1.0 - fy) + along(1) * fy
}

/// Sum of `octaves` of noise, each twice as fine and half as strong, scaled to [0, 1].
pub(super) fn fractal(seed: u64, x: f64, y: f64, period: [i64; 2], octaves: u32) -> f64 {
    let octave = |o: u32| {
        let scale = 1_i64 << o;
        let fine = noise(seed + u64::from(o), x * scale as f64, y * scale as f64, period.map(|p| p * scale));
        fine / scale as f64
    };
    (0..octaves).map(octave).sum::<f64>() / (2.0 - 2.0_f64.powi(1 - octaves as i32))
}

/// What scattered points say about a place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    /// Distance to the nearest point.
    pub(super) first: f64,
    /// Distance to the second nearest.
    pub(super) second: f64,
    /// A number in [0, 1) of the nearest point's own.
    pub(super) own: f64,
}

/// The cell a place lies in; one point per unit square.
pub(super) fn cell(seed: u64, x: f64, y: f64, period: [i64; 2]) -> Cell {
    let (cx, cy) = (x.floor() as i64, y.floor() as i64);
    let mut found = Cell { first: f64::INFINITY, second: f64::INFINITY, own: 0.0 };
    for (i, j) in (-2..=2).flat_map(|j| (-2..=2).map(move |i| (cx + i, cy + j))) {
        let place = |k| random(seed, [i.rem_euclid(period[0]), j.rem_euclid(period[1]), k]);
        let distance = (i as f64 + place(0) - x).hypot(j as f64 + place(1) - y);
        if distance < found.first {
            found = Cell { first: distance, second: found.first, own: place(2) };
        } else {
            found.second = found.second.min(distance);
        }
    }
    found
}
