//! Which vector instructions this machine has.
//!
//! A [`Level`] is handed out only where it was found, so that what is compiled for one may be called with it.

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
            (Set::Avx512, is_x86_feature_detected_all()),
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
fn is_x86_feature_detected_all() -> bool {
    std::arch::is_x86_feature_detected!("avx512f") && std::arch::is_x86_feature_detected!("avx512bw")
}

/// Work without intrinsics that is worth compiling for wide registers. `run`, and what it calls, must be inlined to be.
pub(crate) trait Work {
    /// Does it.
    fn run(self);
}

impl Level {
    /// Does work as compiled for this level. The result is the same for all: nothing is fused or reordered.
    #[inline]
    pub(crate) fn run(self, work: impl Work) {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the level exists, so AVX2 was detected; what has AVX-512 has AVX2.
            #[allow(unsafe_code, reason = "calls into code compiled for instructions that were detected")]
            Set::Avx2 | Set::Avx512 => unsafe { run_avx2(work) },
            _ => work.run(),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2(work: impl Work) {
    work.run();
}
