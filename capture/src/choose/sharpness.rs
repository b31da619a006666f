//! How sharp a picture is, for comparison with others of the same film.

use crate::Image;

/// Rows that are looked at, evenly through the picture: more say no more.
const MOST_ROWS: usize = 270;
/// Differences within this many standard deviations of the noise are noise.
const NOISE_SIGMAS: f64 = 3.0;
/// Share of all pixels that lie in flat parts of any picture.
const FLAT_SHARE: f64 = 0.25;
/// Quantile of `|x|` at [`FLAT_SHARE`], of normally distributed `x` with standard deviation 1.
const FLAT_QUANTILE: f64 = 0.318_64;

/// Sharpness of a picture: the energy of its second differences along x and along y (after Pech-Pacheco et al.: *Diatom
/// autofocusing in brightfield microscopy*, ICPR 2000), each smoothed across and without what noise adds, relative to
/// the mean squared brightness, in 10⁻⁶: neither exposure nor the amount of a black backdrop changes it. Of the two
/// their geometric mean, so that blur along one of them shows. 0 of pictures that are flat, black or less than five
/// pixels wide or high.
pub fn sharpness(image: &Image<[u8; 3]>) -> f64 {
    let (width, height) = (image.width(), image.height());
    if width < 5 || height < 5 {
        return 0.0;
    }
    let luma = image.map(|[r, g, b]| i32::from(r) + 2 * i32::from(g) + i32::from(b));
    let light = luma.pixels().iter().map(|&v| f64::from(v).powi(2)).sum::<f64>() / (width * height) as f64;
    if light <= 0.0 {
        return 0.0;
    }
    let along_x = energy(&luma, 1, width);
    let along_y = energy(&luma, width, 1);
    1e6 * (along_x * along_y).sqrt() / (16.0 * light)
}

/// Mean square of −1 2 −1 along the axis with stride `ahead`, after 1 2 1 along the axis with stride `aside`.
fn energy(luma: &Image<i32>, ahead: usize, aside: usize) -> f64 {
    let (width, height) = (luma.width(), luma.height());
    let v = luma.pixels();
    let smooth = |at: usize| v[at - aside] + 2 * v[at] + v[at + aside];
    let mut squares = Vec::with_capacity(width * height);
    for y in (2..height - 2).step_by(height.div_ceil(MOST_ROWS)) {
        for x in 2..width - 2 {
            let at = y * width + x;
            let difference = 2 * smooth(at) - smooth(at - ahead) - smooth(at + ahead);
            squares.push(difference.unsigned_abs());
        }
    }
    let count = squares.len();
    let flat = (FLAT_SHARE * count as f64) as usize;
    let (_, &mut quantile, _) = squares.select_nth_unstable(flat.min(count - 1));
    let noise = f64::from(quantile) / FLAT_QUANTILE;
    let signal = squares.iter().map(|&d| f64::from(d)).filter(|&d| d > NOISE_SIGMAS * noise);
    signal.map(|d| d * d - noise * noise).sum::<f64>() / count as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_free::noise;

    /// A disc with a ramp of `blur` pixels at its edge, brightness `gain`, noise up to ± `level`.
    fn disc(blur: [f64; 2], gain: f64, level: i64) -> Image<[u8; 3]> {
        let mut image = Image::filled(160, 120, [0; 3]);
        for y in 0..120_usize {
            for x in 0..160_usize {
                let (dx, dy) = (x as f64 - 80.0, y as f64 - 60.0);
                let r = dx.hypot(dy).max(1e-9);
                let width = (dx / r * blur[0]).hypot(dy / r * blur[1]) + 1.0;
                let value = gain * (60.0 + 140.0 * ((40.0 - r) / width + 0.5).clamp(0.0, 1.0));
                let value = value.round() as i64 + noise(x + 160 * y, level);
                image.set(x, y, [value.clamp(0, 255) as u8; 3]);
            }
        }
        image
    }

    mod rand_free {
        /// The finaliser of SplitMix64, uniform in ± `level`.
        pub(super) fn noise(at: usize, level: i64) -> i64 {
            let mut z = (at as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 1) as i64 % (2 * level + 1) - level
        }
    }

    #[test]
    fn blur_lowers_it_along_one_axis_as_along_both() {
        let sharp = sharpness(&disc([0.0; 2], 1.0, 0));
        let (along_x, along_y) = (sharpness(&disc([3.0, 0.0], 1.0, 0)), sharpness(&disc([0.0, 3.0], 1.0, 0)));
        assert!(along_x < 0.5 * sharp && along_y < 0.5 * sharp, "{sharp} {along_x} {along_y}");
        assert!(sharpness(&disc([3.0; 2], 1.0, 0)) < 0.2 * sharp);
    }

    #[test]
    fn noise_and_exposure_change_it_little() {
        let [sharp, noisy, dark] = [(1.0, 0), (1.0, 4), (0.7, 0)].map(|(g, n)| sharpness(&disc([0.0; 2], g, n)));
        assert!((noisy / sharp - 1.0).abs() < 0.1, "{sharp} {noisy}");
        assert!((dark / sharp - 1.0).abs() < 0.05, "{sharp} {dark}");
        let blurred = sharpness(&disc([6.0; 2], 1.0, 4));
        assert!(blurred < 0.1 * sharp, "noise is not sharpness: {blurred}");
    }

    #[test]
    fn pictures_without_content_have_none() {
        for (width, height) in [(0, 0), (4, 100), (100, 1), (50, 50)] {
            assert_eq!(sharpness(&Image::filled(width, height, [80; 3])), 0.0);
        }
        assert_eq!(sharpness(&Image::filled(50, 50, [0; 3])), 0.0);
    }
}
