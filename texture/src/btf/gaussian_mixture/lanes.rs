//! Sixteen numbers at a time: AVX-512, AVX2 with FMA, or plain loops, whichever the machine has.
//!
//! A kernel is written once over [`Vector`] and called through `kernel!`, which picks the instructions when it
//! runs. All three order their sums alike, so machines differ by the rounding of fused products alone.

#![allow(unsafe_code, reason = "vector instructions, used where the machine was found to have them")]

/// Lanes of a vector.
pub(super) const LANES: usize = 16;

/// The numbers of a vector in memory.
pub(super) type Row = [f32; LANES];

/// Natural logarithms below which an exponential is 0: products of what stays above with squares of colours are normal numbers, and
/// denormal ones cost tens of times as much.
const FLUSH: f32 = -60.0;

/// 1.5 · 2²³: what it is added to is rounded to a whole number, which then stands in the lowest bits.
const ROUNDING: f32 = 12_582_912.0;

/// Sixteen numbers.
pub(super) trait Vector: Copy {
    fn splat(value: f32) -> Self;
    fn load(from: &Row) -> Self;
    fn store(self, to: &mut Row);
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
    fn times(self, other: Self) -> Self;
    /// `self · factor + term`.
    fn times_plus(self, factor: Self, term: Self) -> Self;
    /// `self − d²`.
    fn less_square(self, d: Self) -> Self;
    fn larger(self, other: Self) -> Self;
    /// Bit k is set where lane k is at least the limit's.
    fn at_least(self, limit: Self) -> u32;
    /// 0 where `test` is below the limit.
    fn where_at_least(self, test: Self, limit: Self) -> Self;
    /// Times 2ⁿ, n in the lowest bits of `shifted`.
    fn times_two_to(self, shifted: Self) -> Self;

    /// To whole numbers, ties to even; of what is below 2²².
    #[inline(always)]
    fn rounded(self) -> Self {
        self.plus(Self::splat(ROUNDING)).minus(Self::splat(ROUNDING))
    }

    /// `exp` of what is not positive, to 2 units in the last place; 0 below [`FLUSH`].
    /// Cody and Waite's reduction, the polynomial of Cephes' `expf`.
    #[inline(always)]
    fn exp(self) -> Self {
        let magic = Self::splat(ROUNDING);
        let x = self.larger(Self::splat(FLUSH - 1.0));
        let shifted = x.times_plus(Self::splat(std::f32::consts::LOG2_E), magic);
        let n = shifted.minus(magic);
        let f = n.times_plus(Self::splat(-0.693_359_4), x);
        let f = n.times_plus(Self::splat(2.121_944_4e-4), f);
        let mut p = Self::splat(1.987_569_1e-4);
        for factor in [1.398_199_9e-3, 8.333_452e-3, 4.166_579_6e-2, 0.166_666_66, 0.5] {
            p = p.times_plus(f, Self::splat(factor));
        }
        let y = p.times_plus(f.times(f), f).plus(Self::splat(1.0));
        y.times_two_to(shifted).where_at_least(self, Self::splat(FLUSH))
    }

    /// Sum of the lanes, halves upon halves.
    #[inline(always)]
    fn sum(self) -> f32 {
        let mut row = [0.0; LANES];
        self.store(&mut row);
        for k in 0..8 {
            row[k] += row[k + 8];
        }
        for k in 0..4 {
            row[k] += row[k + 4];
        }
        (row[0] + row[2]) + (row[1] + row[3])
    }

    /// The largest lane.
    #[inline(always)]
    fn largest(self) -> f32 {
        let mut row = [0.0; LANES];
        self.store(&mut row);
        for k in 0..8 {
            row[k] = row[k].max(row[k + 8]);
        }
        for k in 0..4 {
            row[k] = row[k].max(row[k + 4]);
        }
        row[0].max(row[2]).max(row[1].max(row[3]))
    }
}

/// Plain loops.
#[derive(Clone, Copy)]
pub(super) struct Plain(Row);

impl Plain {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let mut row = self.0;
        for k in 0..LANES {
            row[k] = f(row[k], other.0[k]);
        }
        Self(row)
    }
}

impl Vector for Plain {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    fn load(from: &Row) -> Self {
        Self(*from)
    }

    #[inline(always)]
    fn store(self, to: &mut Row) {
        *to = self.0;
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }

    #[inline(always)]
    fn times(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }

    #[inline(always)]
    fn times_plus(self, factor: Self, term: Self) -> Self {
        self.times(factor).plus(term)
    }

    #[inline(always)]
    fn less_square(self, d: Self) -> Self {
        self.minus(d.times(d))
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn at_least(self, limit: Self) -> u32 {
        let mut mask = 0;
        for k in 0..LANES {
            mask |= u32::from(self.0[k] >= limit.0[k]) << k;
        }
        mask
    }

    #[inline(always)]
    fn where_at_least(self, test: Self, limit: Self) -> Self {
        let mut row = self.0;
        for k in 0..LANES {
            row[k] = if test.0[k] >= limit.0[k] { row[k] } else { 0.0 };
        }
        Self(row)
    }

    #[inline(always)]
    fn times_two_to(self, shifted: Self) -> Self {
        self.zip(shifted, |y, t| f32::from_bits(y.to_bits().wrapping_add(t.to_bits() << 23)))
    }
}

#[cfg(target_arch = "x86_64")]
pub(super) use x86::{Avx2, Avx512};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{LANES, Row, Vector};
    use std::arch::x86_64::*;

    /// One register of 512 bits. Made by kernels that run where `avx512f` was found.
    #[derive(Clone, Copy)]
    pub(in super::super) struct Avx512(__m512);

    /// Two registers of 256 bits. Made by kernels that run where `avx2` and `fma` were found.
    #[derive(Clone, Copy)]
    pub(in super::super) struct Avx2(__m256, __m256);

    // SAFETY of all below: the types are used by kernels alone, which `kernel!` calls where the machine has the
    // instructions; loads and stores stay within arrays of 16 numbers and need no alignment.
    impl Vector for Avx512 {
        #[inline(always)]
        fn splat(value: f32) -> Self {
            // SAFETY: see above.
            Self(unsafe { _mm512_set1_ps(value) })
        }

        #[inline(always)]
        fn load(from: &Row) -> Self {
            // SAFETY: see above.
            Self(unsafe { _mm512_loadu_ps(from.as_ptr()) })
        }

        #[inline(always)]
        fn store(self, to: &mut Row) {
            // SAFETY: see above.
            unsafe { _mm512_storeu_ps(to.as_mut_ptr(), self.0) }
        }

        #[inline(always)]
        fn plus(self, other: Self) -> Self {
            // SAFETY: see above.
            Self(unsafe { _mm512_add_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn minus(self, other: Self) -> Self {
            // SAFETY: see above.
            Self(unsafe { _mm512_sub_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn times(self, other: Self) -> Self {
            // SAFETY: see above.
            Self(unsafe { _mm512_mul_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn times_plus(self, factor: Self, term: Self) -> Self {
            // SAFETY: see above.
            Self(unsafe { _mm512_fmadd_ps(self.0, factor.0, term.0) })
        }

        #[inline(always)]
        fn less_square(self, d: Self) -> Self {
            // SAFETY: see above.
            Self(unsafe { _mm512_fnmadd_ps(d.0, d.0, self.0) })
        }

        #[inline(always)]
        fn larger(self, other: Self) -> Self {
            // SAFETY: see above.
            Self(unsafe { _mm512_max_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn at_least(self, limit: Self) -> u32 {
            // SAFETY: see above.
            u32::from(unsafe { _mm512_cmp_ps_mask::<_CMP_GE_OQ>(self.0, limit.0) })
        }

        #[inline(always)]
        fn where_at_least(self, test: Self, limit: Self) -> Self {
            // SAFETY: see above.
            Self(unsafe { _mm512_maskz_mov_ps(_mm512_cmp_ps_mask::<_CMP_GE_OQ>(test.0, limit.0), self.0) })
        }

        #[inline(always)]
        fn times_two_to(self, shifted: Self) -> Self {
            // SAFETY: see above.
            Self(unsafe {
                let exponent = _mm512_slli_epi32::<23>(_mm512_castps_si512(shifted.0));
                _mm512_castsi512_ps(_mm512_add_epi32(_mm512_castps_si512(self.0), exponent))
            })
        }
    }

    impl Vector for Avx2 {
        #[inline(always)]
        fn splat(value: f32) -> Self {
            // SAFETY: see above.
            unsafe { Self(_mm256_set1_ps(value), _mm256_set1_ps(value)) }
        }

        #[inline(always)]
        fn load(from: &Row) -> Self {
            // SAFETY: see above.
            unsafe { Self(_mm256_loadu_ps(from.as_ptr()), _mm256_loadu_ps(from.as_ptr().add(LANES / 2))) }
        }

        #[inline(always)]
        fn store(self, to: &mut Row) {
            // SAFETY: see above.
            unsafe {
                _mm256_storeu_ps(to.as_mut_ptr(), self.0);
                _mm256_storeu_ps(to.as_mut_ptr().add(LANES / 2), self.1);
            }
        }

        #[inline(always)]
        fn plus(self, other: Self) -> Self {
            // SAFETY: see above.
            unsafe { Self(_mm256_add_ps(self.0, other.0), _mm256_add_ps(self.1, other.1)) }
        }

        #[inline(always)]
        fn minus(self, other: Self) -> Self {
            // SAFETY: see above.
            unsafe { Self(_mm256_sub_ps(self.0, other.0), _mm256_sub_ps(self.1, other.1)) }
        }

        #[inline(always)]
        fn times(self, other: Self) -> Self {
            // SAFETY: see above.
            unsafe { Self(_mm256_mul_ps(self.0, other.0), _mm256_mul_ps(self.1, other.1)) }
        }

        #[inline(always)]
        fn times_plus(self, factor: Self, term: Self) -> Self {
            // SAFETY: see above.
            unsafe { Self(_mm256_fmadd_ps(self.0, factor.0, term.0), _mm256_fmadd_ps(self.1, factor.1, term.1)) }
        }

        #[inline(always)]
        fn less_square(self, d: Self) -> Self {
            // SAFETY: see above.
            unsafe { Self(_mm256_fnmadd_ps(d.0, d.0, self.0), _mm256_fnmadd_ps(d.1, d.1, self.1)) }
        }

        #[inline(always)]
        fn larger(self, other: Self) -> Self {
            // SAFETY: see above.
            unsafe { Self(_mm256_max_ps(self.0, other.0), _mm256_max_ps(self.1, other.1)) }
        }

        #[inline(always)]
        fn at_least(self, limit: Self) -> u32 {
            // SAFETY: see above.
            let [low, high] = unsafe {
                [
                    _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GE_OQ>(self.0, limit.0)),
                    _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GE_OQ>(self.1, limit.1)),
                ]
            };
            low as u32 | (high as u32) << (LANES / 2)
        }

        #[inline(always)]
        fn where_at_least(self, test: Self, limit: Self) -> Self {
            // SAFETY: see above.
            unsafe {
                Self(
                    _mm256_and_ps(_mm256_cmp_ps::<_CMP_GE_OQ>(test.0, limit.0), self.0),
                    _mm256_and_ps(_mm256_cmp_ps::<_CMP_GE_OQ>(test.1, limit.1), self.1),
                )
            }
        }

        #[inline(always)]
        fn times_two_to(self, shifted: Self) -> Self {
            // SAFETY: see above.
            unsafe { Self(scaled(self.0, shifted.0), scaled(self.1, shifted.1)) }
        }
    }

    /// # Safety
    /// Needs AVX2.
    #[inline(always)]
    unsafe fn scaled(y: __m256, shifted: __m256) -> __m256 {
        // SAFETY: the caller's.
        unsafe {
            let exponent = _mm256_slli_epi32::<23>(_mm256_castps_si256(shifted));
            _mm256_castsi256_ps(_mm256_add_epi32(_mm256_castps_si256(y), exponent))
        }
    }
}

/// A function that runs a generic kernel with the widest vectors of the machine. The kernel and all it calls
/// must be `#[inline(always)]`, for only what is inlined is compiled for those instructions.
macro_rules! kernel {
    ($(#[$doc:meta])* fn $name:ident($($arg:ident: $type:ty),* $(,)?) $(-> $answer:ty)? = $generic:ident $(, $count:tt)?) => {
        $(#[$doc])*
        #[allow(unsafe_code, reason = "calls what needs instructions the machine was found to have")]
        pub(super) fn $name($($arg: $type),*) $(-> $answer)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f")]
                fn wide($($arg: $type),*) $(-> $answer)? {
                    $generic::<super::lanes::Avx512 $(, $count)?>($($arg),*)
                }
                #[target_feature(enable = "avx2,fma")]
                fn halves($($arg: $type),*) $(-> $answer)? {
                    $generic::<super::lanes::Avx2 $(, $count)?>($($arg),*)
                }
                if std::arch::is_x86_feature_detected!("avx512f") {
                    // SAFETY: the machine has AVX-512.
                    return unsafe { wide($($arg),*) };
                }
                if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
                    // SAFETY: the machine has AVX2 and FMA.
                    return unsafe { halves($($arg),*) };
                }
            }
            $generic::<super::lanes::Plain $(, $count)?>($($arg),*)
        }
    };
}
pub(super) use kernel;
