//! Which vector instructions this machine has.
//!
//! A [`Level`] is handed out only where it was found, so that what is compiled for one may be called with it.

use crate::filter::Eight;

/// A set of vector instructions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Set {
    /// What every machine of its kind has.
    Portable,
    /// 16 bytes at a time.
    #[cfg(target_arch = "x86_64")]
    Sse2,
    /// 32 bytes at a time.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// 64 bytes at a time: F and BW.
    #[cfg(target_arch = "x86_64")]
    Avx512,
    /// 16 bytes at a time.
    #[cfg(target_arch = "aarch64")]
    Neon,
}

/// A set of instructions that this machine has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Level(Set);

impl Level {
    /// All that this machine has, the widest last.
    pub(crate) fn available() -> impl Iterator<Item = Self> {
        let found = [
            (Set::Portable, true),
            #[cfg(target_arch = "x86_64")]
            (Set::Sse2, true),
            #[cfg(target_arch = "x86_64")]
            (Set::Avx2, std::arch::is_x86_feature_detected!("avx2")),
            #[cfg(target_arch = "x86_64")]
            (Set::Avx512, has_avx512()),
            #[cfg(target_arch = "aarch64")]
            (Set::Neon, std::arch::is_aarch64_feature_detected!("neon")),
        ];
        found.into_iter().filter(|(_, is_here)| *is_here).map(|(set, _)| Self(set))
    }

    /// The widest that this machine has.
    pub(crate) fn widest() -> Self {
        Self::available().last().unwrap_or(Self(Set::Portable))
    }

    /// Which one it is.
    #[inline]
    pub(crate) fn set(self) -> Set {
        self.0
    }
}

#[cfg(target_arch = "x86_64")]
fn has_avx512() -> bool {
    // What narrower registers do best is done in those.
    std::arch::is_x86_feature_detected!("avx2")
        && std::arch::is_x86_feature_detected!("avx512f")
        && std::arch::is_x86_feature_detected!("avx512bw")
}

/// Work that is worth compiling for wide registers. `run`, and what it calls, must be inlined to be.
pub(crate) trait Work {
    /// Does it, on `E`'s registers where it asks for them.
    fn run<E: Lanes>(self);
}

/// Sub-samples tested side by side.
pub(crate) const LANES: usize = 4;

/// Where a row of sub-samples stands to a face: at x its edge functions are `slopes · x + starts`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowTest {
    pub(crate) slopes: [f64; 3],
    pub(crate) starts: [f64; 3],
    /// Their smallest values inside.
    pub(crate) thresholds: [f64; 3],
    /// The functions' sum × this = 1 / depth.
    pub(crate) inverse_det: f64,
}

/// What is done in registers: texels mixed ([`Eight`]), sub-samples tested.
pub(crate) trait Lanes: Eight {
    /// Keeps the nearest of what the sub-samples at `xs` saw and the face `slot`: its 1 / depth, and its slot.
    fn keep_nearest(row: &RowTest, xs: &[f64; LANES], slot: u32, depths: &mut [f64; LANES], slots: &mut [u32; LANES]);
}

impl Lanes for [i16; 8] {
    #[inline(always)]
    fn keep_nearest(row: &RowTest, xs: &[f64; LANES], slot: u32, depths: &mut [f64; LANES], slots: &mut [u32; LANES]) {
        for k in 0..LANES {
            let [a, b, c] = [0, 1, 2].map(|e| row.slopes[e] * xs[k] + row.starts[e]);
            let inverse = (a + b + c) * row.inverse_det;
            let [s, t, u] = row.thresholds;
            let is_nearest = (a >= s) & (b >= t) & (c >= u) & (inverse > depths[k]);
            depths[k] = if is_nearest { inverse } else { depths[k] };
            slots[k] = if is_nearest { slot } else { slots[k] };
        }
    }
}

impl Level {
    /// Does work as compiled for this level. The result is the same for all: nothing is fused or reordered.
    #[inline]
    pub(crate) fn run(self, work: impl Work) {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the level exists, so AVX2 was detected; with AVX-512, too.
            #[allow(unsafe_code, reason = "calls into code compiled for instructions that were detected")]
            Set::Avx2 | Set::Avx512 => unsafe { run_avx2(work) },
            _ => work.run::<[i16; 8]>(),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2(work: impl Work) {
    work.run::<wide::Register>();
}

#[cfg(target_arch = "x86_64")]
mod wide {
    #![allow(unsafe_code, reason = "instructions of SSSE3, which whatever has AVX2 has")]

    use super::{LANES, Lanes, RowTest};
    use crate::filter::{Eight, PLACES};
    use std::arch::x86_64::*;

    /// Named in [`super::run_avx2`] alone.
    #[derive(Clone, Copy)]
    pub(super) struct Register(__m128i);

    impl Eight for Register {
        #[inline(always)]
        fn load(from: &[i16; 8]) -> Self {
            // SAFETY: eight numbers, loaded without alignment.
            Self(unsafe { _mm_loadu_si128(from.as_ptr().cast()) })
        }

        #[inline(always)]
        fn toward(self, to: Self, t: i16) -> Self {
            // SAFETY: a register exists only in code that runs where AVX2 was detected, and with it SSSE3.
            Self(unsafe { _mm_add_epi16(self.0, _mm_mulhrs_epi16(_mm_sub_epi16(to.0, self.0), _mm_set1_epi16(t))) })
        }

        #[inline(always)]
        fn second(self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm_srli_si128::<6>(self.0) })
        }

        #[inline(always)]
        fn first(self) -> [i16; 4] {
            // SAFETY: as above; eight bytes are four numbers.
            unsafe { std::mem::transmute::<i64, [i16; 4]>(_mm_cvtsi128_si64(self.0)) }
        }

        #[inline(always)]
        fn whole(numbers: &[f32; PLACES]) -> [i32; PLACES] {
            let mut whole = [0; PLACES];
            // SAFETY: named only in code that runs where AVX2 was detected; eight numbers each, without alignment.
            unsafe {
                _mm256_storeu_si256(whole.as_mut_ptr().cast(), _mm256_cvttps_epi32(_mm256_loadu_ps(numbers.as_ptr())));
            }
            whole
        }
    }

    impl Lanes for Register {
        #[inline(always)]
        fn keep_nearest(
            row: &RowTest,
            xs: &[f64; LANES],
            slot: u32,
            depths: &mut [f64; LANES],
            slots: &mut [u32; LANES],
        ) {
            // SAFETY: named only in code that runs where AVX2 was detected; four numbers each, without alignment.
            unsafe {
                let (x, before) = (_mm256_loadu_pd(xs.as_ptr()), _mm256_loadu_pd(depths.as_ptr()));
                let edge = |e: usize| {
                    _mm256_add_pd(_mm256_mul_pd(_mm256_set1_pd(row.slopes[e]), x), _mm256_set1_pd(row.starts[e]))
                };
                let [a, b, c] = [edge(0), edge(1), edge(2)];
                let sum = _mm256_add_pd(_mm256_add_pd(a, b), c);
                let inverse = _mm256_mul_pd(sum, _mm256_set1_pd(row.inverse_det));
                let is_inside = |edge, e: usize| _mm256_cmp_pd::<_CMP_GE_OQ>(edge, _mm256_set1_pd(row.thresholds[e]));
                let inside = _mm256_and_pd(_mm256_and_pd(is_inside(a, 0), is_inside(b, 1)), is_inside(c, 2));
                let nearest = _mm256_and_pd(inside, _mm256_cmp_pd::<_CMP_GT_OQ>(inverse, before));
                // No selection by the mask: compilers make masked stores of it, which are slow on some machines.
                _mm256_storeu_pd(depths.as_mut_ptr(), _mm256_max_pd(before, _mm256_and_pd(inside, inverse)));
                // Of each lane's two halves, which are alike, one.
                let (low, high) = (_mm256_castpd256_pd128(nearest), _mm256_extractf128_pd::<1>(nearest));
                let halves = _mm_shuffle_ps::<0b10_00_10_00>(_mm_castpd_ps(low), _mm_castpd_ps(high));
                let known = _mm_loadu_si128(slots.as_ptr().cast());
                let change = _mm_sub_epi32(_mm_set1_epi32(slot.cast_signed()), known);
                let kept = _mm_add_epi32(known, _mm_and_si128(change, _mm_castps_si128(halves)));
                _mm_storeu_si128(slots.as_mut_ptr().cast(), kept);
            }
        }
    }
}
