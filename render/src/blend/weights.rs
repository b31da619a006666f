//! Weights of layers in whole numbers.
//!
//! A facet's colour is `Σ_k w_k (offset_k + scale_k t_k)` with texels t of 8 bits. With `c = t − 128` it becomes
//! `Σ_k g_k c_k + b`, `g_k = w_k scale_k`, `b = Σ_k w_k (offset_k + 128 scale_k)`: b is known exactly, and the c of layers
//! about 128 are small, so that rounding g costs little: `|error| ≤ Σ_k |c_k| / 2^(Q+1)` levels for Q binary places.

use crate::filter::FIXED_PLACES;
use texture::Layer;

/// Most binary places of a weight: 1 must fit in 16 bits with its sign.
const MOST_PLACES: u32 = 14;

/// Weights of a facet's layers, two and two.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Weights {
    /// `g · 2^Q` of layers 2p and 2p + 1; 0 for a layer that is not there.
    pub(super) pairs: Vec<[i16; 2]>,
    /// `b · 2^Q`, and half of what is shifted away.
    pub(super) base: i32,
    /// Binary places to shift away: Q less those of a texel.
    pub(super) shift: u32,
}

impl Weights {
    /// Rounds `weights` of the first so many `layers`. Q is as large as 16-bit weights and 32-bit sums allow; where even
    /// those of a texel are too many, weights stop at ±1024. What is not a number counts as nothing.
    pub(super) fn round(&mut self, weights: &[f32], layers: &[Layer]) {
        let finite = |v: f64| if v.is_finite() { v } else { 0.0 };
        let gain = |(w, layer): (&f32, &Layer)| finite(f64::from(*w) * f64::from(layer.scale));
        let gains = || weights.iter().zip(layers).map(gain);
        let base = |(w, layer): (&f32, &Layer)| {
            finite(f64::from(*w) * (f64::from(layer.offset) + 128.0 * f64::from(layer.scale)))
        };
        let base: f64 = weights.iter().zip(layers).map(base).sum();
        let largest = gains().fold(0.0, |most: f64, g| most.max(g.abs()));
        let sum = gains().map(f64::abs).sum::<f64>() * 128.0 + base.abs();
        let fits = |places: u32| {
            let one = f64::from(1u32 << places);
            largest * one <= f64::from(i16::MAX) && sum * one <= f64::from(1 << 30)
        };
        let places = (FIXED_PLACES..=MOST_PLACES).rev().find(|&q| fits(q)).unwrap_or(FIXED_PLACES);
        let one = f64::from(1u32 << places);
        self.shift = places - FIXED_PLACES;
        // Casts saturate.
        self.base = ((base * one).round() as i32).saturating_add((1 << self.shift) >> 1);
        self.pairs.clear();
        self.pairs.resize(weights.len().div_ceil(2), [0; 2]);
        for (k, g) in gains().enumerate() {
            self.pairs[k / 2][k % 2] = (g * one).round() as i16;
        }
    }

    /// The weight of layer `k` times `of`, summed over the layers, and the base times `share`: in levels of 0..=255.
    pub(super) fn apply(&self, of: &[[f32; 3]], share: f32) -> [f32; 3] {
        let one = (1u32 << (self.shift + FIXED_PLACES)) as f32;
        let mut sum = [share * (self.base - ((1 << self.shift) >> 1)) as f32; 3];
        for (k, value) in of.iter().enumerate() {
            let weight = f32::from(self.pairs[k / 2][k % 2]);
            (0..3).for_each(|c| sum[c] += weight * value[c]);
        }
        sum.map(|s| s / one)
    }
}
