//! The blend itself: `value = clamp16((base + Σ_p g_2p c_2p + g_2p+1 c_2p+1) >> shift)`, once for each vector unit.
//!
//! All in whole numbers, sums wrapping at 32 bits (what [`Weights::round`] hands out does not get there), so that every
//! level gives the same bits. One line of [`Line`]s is 32 values of two layers; the sums of 32 values stay in registers.
//! Bound by reading the lines: 64 bytes make 64 multiply-adds.

use super::pack::{Line, VALUES};
use super::weights::Weights;
use crate::simd::{Level, Set};

/// Blends groups of [`VALUES`] values: `lines` are groups × pairs of layers. Values whose layers are not there are those of
/// the weights' base.
pub(super) fn blend(level: Level, lines: &[Line], weights: &Weights, out: &mut [[i16; VALUES]]) {
    match level.set() {
        Set::Portable => portable(lines, weights, out),
        #[cfg(target_arch = "x86_64")]
        #[allow(unsafe_code, reason = "calls into code compiled for instructions that were detected")]
        // SAFETY: every x86-64 has SSE2.
        Set::Sse2 => unsafe { x86::sse2(lines, weights, out) },
        #[cfg(target_arch = "x86_64")]
        #[allow(unsafe_code, reason = "calls into code compiled for instructions that were detected")]
        // SAFETY: the level exists, so AVX2 was detected.
        Set::Avx2 => unsafe { x86::avx2(lines, weights, out) },
        #[cfg(target_arch = "x86_64")]
        #[allow(unsafe_code, reason = "calls into code compiled for instructions that were detected")]
        // SAFETY: the level exists, so AVX-512 F and BW were detected.
        Set::Avx512 => unsafe { x86::avx512(lines, weights, out) },
        #[cfg(target_arch = "aarch64")]
        #[allow(unsafe_code, reason = "calls into code compiled for instructions that were detected")]
        // SAFETY: the level exists, so NEON was detected.
        Set::Neon => unsafe { arm::neon(lines, weights, out) },
    }
}

/// The lines of each group of values, and where the values go.
#[inline(always)]
fn groups<'a>(
    lines: &'a [Line],
    weights: &Weights,
    out: &'a mut [[i16; VALUES]],
) -> impl Iterator<Item = (&'a [Line], &'a mut [i16; VALUES])> {
    let pairs = weights.pairs.len();
    out.iter_mut().enumerate().map(move |(i, out)| (lines.get(i * pairs..(i + 1) * pairs).unwrap_or_default(), out))
}

/// What the others must equal.
fn portable(lines: &[Line], weights: &Weights, out: &mut [[i16; VALUES]]) {
    for (lines, out) in groups(lines, weights, out) {
        let mut sums = [weights.base; VALUES];
        for (line, &[even, odd]) in lines.iter().zip(&weights.pairs) {
            for (sum, pair) in sums.iter_mut().zip(line.0.as_chunks::<2>().0) {
                let [a, b] = pair.map(i32::from);
                *sum = sum.wrapping_add(a * i32::from(even) + b * i32::from(odd));
            }
        }
        for (out, sum) in out.iter_mut().zip(sums) {
            *out = (sum >> weights.shift).clamp(i32::from(i16::MIN), i32::from(i16::MAX)) as i16;
        }
    }
}

/// Two weights side by side, as a multiply-add of pairs takes them.
#[cfg(target_arch = "x86_64")]
fn packed([even, odd]: [i16; 2]) -> i32 {
    i32::from(even.cast_unsigned()) | i32::from(odd) << 16
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    #![allow(unsafe_code, reason = "loads and stores of whole registers")]

    use super::{Line, VALUES, Weights, groups, packed};
    use std::arch::x86_64::*;

    #[target_feature(enable = "sse2")]
    pub(super) fn sse2(lines: &[Line], weights: &Weights, out: &mut [[i16; VALUES]]) {
        for (lines, out) in groups(lines, weights, out) {
            let mut sums = [_mm_set1_epi32(weights.base); 8];
            for (line, &pair) in lines.iter().zip(&weights.pairs) {
                let pair = _mm_set1_epi32(packed(pair));
                for k in 0..4 {
                    // SAFETY: 16 of the line's 64 bytes, which are aligned to 64.
                    let texels = unsafe { _mm_load_si128(line.0.as_ptr().add(16 * k).cast()) };
                    // Each byte above itself, shifted down again: with its sign.
                    let low = _mm_srai_epi16::<8>(_mm_unpacklo_epi8(texels, texels));
                    let high = _mm_srai_epi16::<8>(_mm_unpackhi_epi8(texels, texels));
                    sums[2 * k] = _mm_add_epi32(sums[2 * k], _mm_madd_epi16(low, pair));
                    sums[2 * k + 1] = _mm_add_epi32(sums[2 * k + 1], _mm_madd_epi16(high, pair));
                }
            }
            let shift = _mm_cvtsi32_si128(weights.shift.cast_signed());
            for (sums, out) in sums.as_chunks::<2>().0.iter().zip(out.as_chunks_mut::<8>().0) {
                let [low, high] = sums.map(|sum| _mm_sra_epi32(sum, shift));
                // SAFETY: eight values, stored without alignment.
                unsafe { _mm_storeu_si128(out.as_mut_ptr().cast(), _mm_packs_epi32(low, high)) };
            }
        }
    }

    #[target_feature(enable = "avx2")]
    pub(super) fn avx2(lines: &[Line], weights: &Weights, out: &mut [[i16; VALUES]]) {
        for (lines, out) in groups(lines, weights, out) {
            let mut sums = [_mm256_set1_epi32(weights.base); 4];
            for (line, &pair) in lines.iter().zip(&weights.pairs) {
                let pair = _mm256_set1_epi32(packed(pair));
                for (k, sum) in sums.iter_mut().enumerate() {
                    // SAFETY: 16 of the line's 64 bytes, which are aligned to 64.
                    let texels = unsafe { _mm_load_si128(line.0.as_ptr().add(16 * k).cast()) };
                    *sum = _mm256_add_epi32(*sum, _mm256_madd_epi16(_mm256_cvtepi8_epi16(texels), pair));
                }
            }
            let shift = _mm_cvtsi32_si128(weights.shift.cast_signed());
            for (sums, out) in sums.as_chunks::<2>().0.iter().zip(out.as_chunks_mut::<16>().0) {
                let [low, high] = sums.map(|sum| _mm256_sra_epi32(sum, shift));
                // Packing works within halves of the register: quarters 0 2 1 3 come out.
                let values = _mm256_permute4x64_epi64::<0b11_01_10_00>(_mm256_packs_epi32(low, high));
                // SAFETY: sixteen values, stored without alignment.
                unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), values) };
            }
        }
    }

    #[target_feature(enable = "avx512f,avx512bw")]
    pub(super) fn avx512(lines: &[Line], weights: &Weights, out: &mut [[i16; VALUES]]) {
        for (lines, out) in groups(lines, weights, out) {
            let mut sums = [_mm512_set1_epi32(weights.base); 2];
            for (line, &pair) in lines.iter().zip(&weights.pairs) {
                let pair = _mm512_set1_epi32(packed(pair));
                for (k, sum) in sums.iter_mut().enumerate() {
                    // SAFETY: 32 of the line's 64 bytes, which are aligned to 64.
                    let texels = unsafe { _mm256_load_si256(line.0.as_ptr().add(32 * k).cast()) };
                    *sum = _mm512_add_epi32(*sum, _mm512_madd_epi16(_mm512_cvtepi8_epi16(texels), pair));
                }
            }
            let shift = _mm_cvtsi32_si128(weights.shift.cast_signed());
            for (sum, out) in sums.iter().zip(out.as_chunks_mut::<16>().0) {
                let values = _mm512_cvtsepi32_epi16(_mm512_sra_epi32(*sum, shift));
                // SAFETY: sixteen values, stored without alignment.
                unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), values) };
            }
        }
    }
}

#[cfg(target_arch = "aarch64")]
mod arm {
    #![allow(unsafe_code, reason = "loads and stores of whole registers")]

    use super::{Line, VALUES, Weights, groups};
    use std::arch::aarch64::*;

    #[target_feature(enable = "neon")]
    pub(super) fn neon(lines: &[Line], weights: &Weights, out: &mut [[i16; VALUES]]) {
        for (lines, out) in groups(lines, weights, out) {
            let mut sums = [vdupq_n_s32(weights.base); 8];
            for (line, &[even, odd]) in lines.iter().zip(&weights.pairs) {
                for k in 0..4 {
                    // SAFETY: 16 of the line's 64 bytes, told apart into two layers.
                    let pair = unsafe { vld2_s8(line.0.as_ptr().add(16 * k)) };
                    let (a, b) = (vmovl_s8(pair.0), vmovl_s8(pair.1));
                    sums[2 * k] = vmlal_n_s16(vmlal_n_s16(sums[2 * k], vget_low_s16(a), even), vget_low_s16(b), odd);
                    sums[2 * k + 1] =
                        vmlal_n_s16(vmlal_n_s16(sums[2 * k + 1], vget_high_s16(a), even), vget_high_s16(b), odd);
                }
            }
            // Shifting left by less than nothing is shifting right.
            let shift = vdupq_n_s32(-weights.shift.cast_signed());
            for (sums, out) in sums.as_chunks::<2>().0.iter().zip(out.as_chunks_mut::<8>().0) {
                let [low, high] = sums.map(|sum| vqmovn_s32(vshlq_s32(sum, shift)));
                // SAFETY: eight values, stored without alignment.
                unsafe { vst1q_s16(out.as_mut_ptr(), vcombine_s16(low, high)) };
            }
        }
    }
}
