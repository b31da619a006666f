//! White noise that depends on a seed and a place alone, so that any part of it can be had in any order.

use std::f64::consts::TAU;

/// The next of a sequence of evenly distributed words (Steele, Lea, Flood, "Fast splittable pseudorandom number
/// generators", 2014: SplitMix64).
pub(super) fn word(seed: u64, place: u64) -> u64 {
    let mut z = seed
        .wrapping_mul(0xD1B5_4A32_D192_ED03)
        .wrapping_add(place.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Even in [0, 1).
pub(super) fn even(seed: u64, place: u64) -> f64 {
    (word(seed, place) >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
}

/// A field of independent standard normal numbers (Box and Muller).
pub(super) fn gaussian_field(seed: u64, stream: u64, count: usize) -> Vec<f64> {
    let seed = word(seed, stream);
    let normal = |i: usize| {
        let [a, b] = [0, 1].map(|half| even(seed, 2 * i as u64 + half));
        (-2.0 * (1.0 - a).ln()).sqrt() * (TAU * b).cos()
    };
    (0..count).map(normal).collect()
}
