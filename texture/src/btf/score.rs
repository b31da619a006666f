//! How far a coded material is from what was measured.
//!
//! Differences are of encoded samples times 255, not rounded; over all channels, texels and the pairs that
//! were measured, not filled in.
//!
//! | figure | definition |
//! |---|---|
//! | `rmse` | root of the mean squared difference, pooled over everything |
//! | `psnr_db` | `20 log10(255 / rmse)`: of the pooled error, not the mean of PSNRs; at most 99 |
//! | `psnr_low_db` | PSNR of the picture that 5 % of pictures fall below |
//! | `ssim` | structural similarity of luma as in [`crate::metrics`], mean over pixels and pictures |
//! | `error_mean_pct` | mean absolute difference, % of 255 |
//! | `rmse_stops` | of a high range alone: root mean squared difference of `log2(L + floor)` |

use super::Sampler;
use crate::metrics::{LUMA, ssim_map};
use capture::btf::{Btf, Encoding};
use rayon::prelude::*;

/// Where PSNR is capped, so that exact agreement stays a number.
const PSNR_CAP_DB: f64 = 99.0;

/// The figures; see the module's table.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Score {
    /// Pooled root mean squared error, levels of 0..=255.
    pub rmse: f64,
    /// Pooled peak signal-to-noise ratio.
    pub psnr_db: f64,
    /// The same of the picture that one in twenty falls below.
    pub psnr_low_db: f64,
    /// Mean structural similarity.
    pub ssim: f64,
    /// Mean absolute difference, % of 255.
    pub error_mean_pct: f64,
    /// Error of radiance of a high range, in stops.
    pub rmse_stops: Option<f64>,
    /// Pictures that were compared.
    pub pictures: usize,
}

/// Sums over one picture.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    squared: f64,
    absolute: f64,
    stops: f64,
    ssim: f64,
}

/// Compares a codec with the data it was fitted to, encoded as the codec saw them
/// ([`super::to_coded_range`]); the sizes must agree.
pub fn score(btf: &Btf, sampler: &dyn Sampler) -> Score {
    let pairs: Vec<(usize, usize)> = (0..btf.pairs()).map(|p| (p / btf.lights.len(), p % btf.lights.len())).collect();
    let measured: Vec<_> = pairs.into_iter().filter(|&(view, light)| btf.is_measured(view, light)).collect();
    let compare = |&(view, light): &(usize, usize)| {
        let decoded = sampler.picture(&btf.lights[light].cast(), &btf.views[view].cast());
        sums(btf, btf.picture(view, light), &decoded)
    };
    // In order, so that sums do not depend on how the work was shared.
    let per_picture: Vec<Sums> = measured.par_iter().map(compare).collect();
    pooled(&per_picture, 3 * btf.texels(), matches!(btf.encoding, Encoding::Log { .. }))
}

fn sums(btf: &Btf, measured: &[f32], decoded: &[f32]) -> Sums {
    let mut sums = Sums::default();
    for (&m, &d) in measured.iter().zip(decoded) {
        let difference = 255.0 * (f64::from(d) - f64::from(m));
        sums.squared += difference * difference;
        sums.absolute += difference.abs();
        if let Encoding::Log { floor, .. } = btf.encoding {
            let stops = |sample: f32| f64::from(btf.encoding.decode(sample) + floor).log2();
            sums.stops += (stops(d) - stops(m)).powi(2);
        }
    }
    let luma = |picture: &[f32]| -> Vec<f64> {
        let of = |rgb: &[f32]| 255.0 * (0..3).map(|c| LUMA[c] * f64::from(rgb[c])).sum::<f64>();
        picture.chunks_exact(3).map(of).collect()
    };
    let map = ssim_map(&luma(measured), &luma(decoded), btf.width, btf.height);
    sums.ssim = map.iter().sum::<f64>() / map.len() as f64;
    sums
}

fn pooled(pictures: &[Sums], samples: usize, high_range: bool) -> Score {
    let count = pictures.len().max(1) as f64;
    let all = samples as f64 * count;
    let total = |of: fn(&Sums) -> f64| pictures.iter().map(of).sum::<f64>();
    let mut psnrs: Vec<f64> = pictures.iter().map(|p| psnr_db(p.squared / samples as f64)).collect();
    psnrs.sort_by(f64::total_cmp);
    let mse = total(|p| p.squared) / all;
    Score {
        rmse: mse.sqrt(),
        psnr_db: psnr_db(mse),
        psnr_low_db: psnrs.get(psnrs.len() / 20).copied().unwrap_or(PSNR_CAP_DB),
        ssim: total(|p| p.ssim) / count,
        error_mean_pct: total(|p| p.absolute) / all / 2.55,
        rmse_stops: high_range.then(|| (total(|p| p.stops) / all).sqrt()),
        pictures: pictures.len(),
    }
}

fn psnr_db(mse: f64) -> f64 {
    if mse > 0.0 { (10.0 * (255.0 * 255.0 / mse).log10()).min(PSNR_CAP_DB) } else { PSNR_CAP_DB }
}

#[cfg(test)]
mod tests {
    use super::super::{Frame, fixtures};
    use super::*;
    use nalgebra::Vector3;

    /// Answers with the data plus an offset.
    struct Offset {
        frame: Frame,
        btf: Btf,
        offset: f32,
    }

    impl Sampler for Offset {
        fn frame(&self) -> &Frame {
            &self.frame
        }

        fn value(&self, texel: usize, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3] {
            let nearest = |all: &[Vector3<f64>], d: &Vector3<f32>| {
                let d: Vector3<f64> = d.cast();
                (0..all.len()).max_by(|&a, &b| all[a].dot(&d).total_cmp(&all[b].dot(&d))).unwrap()
            };
            let picture = self.btf.picture(nearest(&self.btf.views, view), nearest(&self.btf.lights, light));
            [0, 1, 2].map(|c| picture[3 * texel + c] + self.offset)
        }
    }

    fn btf() -> Btf {
        let directions = [Vector3::z(), Vector3::new(0.6, 0.0, 0.8)];
        let samples = (0..4 * 36).map(|i| (i % 7) as f32 / 10.0).collect();
        Btf { measured: vec![true, true, true, false], ..fixtures::btf([4, 3], &directions, samples) }
    }

    fn scored(btf: Btf, offset: f32) -> Score {
        score(&btf.clone(), &Offset { frame: Frame::of(&btf), btf, offset })
    }

    #[test]
    fn what_agrees_has_no_error() {
        let s = scored(btf(), 0.0);
        assert_eq!((s.rmse, s.psnr_db, s.psnr_low_db, s.error_mean_pct, s.pictures), (0.0, 99.0, 99.0, 0.0, 3));
        assert!((s.ssim - 1.0).abs() < 1e-12);
    }

    #[test]
    fn an_offset_of_a_fifth_is_51_levels() {
        let s = scored(btf(), 0.2);
        assert!((s.rmse - 51.0).abs() < 1e-4 && (s.error_mean_pct - 20.0).abs() < 1e-5);
        assert!((s.psnr_db - 20.0 * 5_f64.log10()).abs() < 1e-4);
        assert_eq!(s.rmse_stops, None);
    }

    #[test]
    fn a_high_range_is_judged_in_stops_too() {
        let mut btf = btf();
        btf.encoding = Encoding::Log { floor: 1.0, peak: 1023.0 };
        // ln(1 + L) / ln 1024: a tenth is one stop.
        assert!((scored(btf, 0.1).rmse_stops.unwrap() - 1.0).abs() < 1e-4);
    }
}
