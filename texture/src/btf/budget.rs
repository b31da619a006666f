//! What a budget comes to: bytes for a codec's parts, or an error.

use super::Budget;
use super::container::header_bytes;
use crate::TextureError;
use capture::btf::Btf;

impl Budget {
    /// Refuses what is out of range.
    pub(super) fn checked(self) -> Result<Self, TextureError> {
        let (fault, remedy) = match self {
            Self::Ratio(ratio) if !(ratio.is_finite() && ratio > 0.0) => {
                (format!("a compression ratio of {ratio}"), "ask for a positive ratio")
            }
            Self::Quality(quality) if !(0.0..=100.0).contains(&quality) => {
                (format!("a quality of {quality}"), "choose between 0 (small) and 100 (faithful)")
            }
            _ => return Ok(self),
        };
        Err(TextureError::Degenerate { fault, remedy: remedy.into() })
    }
}

/// Bytes that a ratio leaves a codec, beside the header of the file.
pub(super) fn bytes_for(ratio: f64, btf: &Btf) -> usize {
    (btf.raw_bytes() as f64 / ratio) as usize - header_bytes(btf).min((btf.raw_bytes() as f64 / ratio) as usize)
}

/// RMSE that a quality stands for, of samples of nominal range 1: PSNR runs from 25 dB at 0 to 50 dB at 100.
pub(super) fn error_of(quality: f64) -> f64 {
    10f64.powf(-(25.0 + 0.25 * quality) / 20.0)
}

/// Refuses samples that are no numbers, or so large that sums of their products overflow.
pub(super) fn check_samples(btf: &Btf) -> Result<(), TextureError> {
    if btf.samples.len() == 3 * btf.texels() * btf.pairs() && btf.samples.iter().all(|s| s.abs() < 1e6) {
        return Ok(());
    }
    Err(TextureError::Degenerate {
        fault: "the BTF lacks samples, or holds some that are not finite or beyond a million".into(),
        remedy: "check it with `Btf::check`, and encode a high range by its logarithm".into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_out_of_range_is_refused() {
        for bad in [Budget::Ratio(0.0), Budget::Ratio(f64::NAN), Budget::Quality(-1.0), Budget::Quality(f64::NAN)] {
            assert!(bad.checked().is_err(), "{bad:?}");
        }
        assert!(Budget::Quality(100.0).checked().is_ok());
    }

    #[test]
    fn qualities_are_decibels() {
        assert!((error_of(0.0) * 255.0 - 14.34).abs() < 0.01);
        assert!((error_of(100.0) * 255.0 - 0.806).abs() < 0.001);
    }
}
