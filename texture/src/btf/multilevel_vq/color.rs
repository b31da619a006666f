//! Colour as the books hold it: luminance, which is scaled, and chroma, which is not.
//!
//! *YCrCb*: `Y = 0.299 R + 0.587 G + 0.114 B`, `Cr = (R − Y)/1.402`, `Cb = (B − Y)/1.772` (ITU-R BT.601) of the samples
//! as they are encoded, sRGB or logarithmic alike. For the latter, Cr and Cb are logarithms of
//! ratios: a surface of one hue has one chroma in light and shade.
//!
//! *LogLuv*, of a high range alone, as the source takes it: CIE luminance and chromaticity in the steps of Larson's 32 bits,
//!
//! ```text
//! L = ⌊256 (log₂ Y + 64)⌋,   u = ⌊410 u'⌋,   v = ⌊410 v'⌋,   u' = 4X/(X + 15Y + 3Z),   v' = 9Y/(X + 15Y + 3Z)
//! ```
//!
//! Black has L = 0 and the chroma of white. Y, over the floor of the data's logarithm, is then encoded as they are, for scales
//! multiply it. Errors are judged on encoded RGB, to which YCrCb is linear and LogLuv is not, and LogLuv's chroma of dark
//! texels is noise at full weight; hence YCrCb unless asked otherwise.
//!
//! Source: Larson, "LogLuv Encoding for Full-Gamut, High-Dynamic Range Images", Journal of Graphics Tools 3(1), 1998.

use crate::TextureError;
use crate::metrics::LUMA;
use capture::btf::Encoding;

/// What a unit of Y, Cr, Cb adds to the squared error of RGB, as lengths, `√(3, 0.714² + 1.402², 0.344² + 1.772²)`, chroma
/// multiplied by [`CHROMA`]: what is called RMSE in levels is that of RGB where colours agree, and more where they do not. Cross
/// terms are left out, so that an error is a sum over luminance and chroma.
const LENGTHS: [f32; 3] = [1.732_050_8, CHROMA * 1.573_385_3, CHROMA * 1.805_081];
/// Chroma counts more than its error, for it is the first to go: texels of like shading share items whatever their colours, which
/// become grey as the mean. At equal bytes, 1.6 errs less than 1 in RGB too (weave 24.2 to 25.0 at 1:500).
const CHROMA: f32 = 1.6;
/// What a unit of u', v' adds to the logarithms of RGB at white, as lengths.
const LOG_LUV_LENGTHS: [f32; 2] = [17.093_73, 13.931_47];
/// RGB of ITU-R BT.709 to XYZ.
const XYZ_OF_RGB: [[f32; 3]; 3] = [
    [0.412_456_4, 0.357_576_1, 0.180_437_5],
    [0.212_672_9, 0.715_152_2, 0.072_175],
    [0.019_333_9, 0.119_192, 0.950_304_1],
];
/// Its inverse.
const RGB_OF_XYZ: [[f32; 3]; 3] = [
    [3.240_455, -1.537_138_9, -0.498_531_5],
    [-0.969_266_4, 1.876_010_9, 0.041_556_1],
    [0.055_643_4, -0.204_025_9, 1.057_225_2],
];
/// u' and v' of white, of D65.
const WHITE: [f32; 2] = [0.197_839_8, 0.468_336_3];
/// Below this v' colours would leave every gamut.
const LEAST_V: f32 = 1e-3;

/// How colours stand in the books.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorSpace {
    /// Luma and two differences of encoded samples.
    #[default]
    YCrCb,
    /// Logarithmic luminance and chromaticity; of a high range.
    LogLuv,
}

/// The same, and what it takes to go there and back.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Color {
    #[default]
    YCrCb,
    LogLuv {
        /// Peak over floor of the logarithm that encodes the samples.
        range: f32,
    },
}

impl Color {
    /// # Errors
    /// Where the range is not high.
    pub(super) fn new(space: ColorSpace, encoding: Encoding) -> Result<Self, TextureError> {
        match (space, encoding) {
            (ColorSpace::YCrCb, _) => Ok(Self::YCrCb),
            (ColorSpace::LogLuv, Encoding::Log { floor, peak }) => Ok(Self::LogLuv { range: peak / floor }),
            (ColorSpace::LogLuv, _) => Err(TextureError::Degenerate {
                fault: "LogLuv is for a high range, and these samples are of 8 bits".into(),
                remedy: "leave the colour at YCrCb, or give linear data".into(),
            }),
        }
    }

    /// Luminance and chroma of an encoded RGB triple.
    pub(super) fn of_rgb(self, rgb: [f32; 3]) -> [f32; 3] {
        let Self::LogLuv { range } = self else { return ycrcb(rgb) };
        let radiance = rgb.map(|c| (c.max(0.0) * range.ln_1p()).exp_m1());
        let [y, u, v] = yuv(log_luv(radiance));
        [y.ln_1p() / range.ln_1p(), u, v]
    }

    /// The inverse of [`Color::of_rgb`], but for its steps.
    #[inline]
    pub(super) fn rgb(self, color: [f32; 3]) -> [f32; 3] {
        let Self::LogLuv { range } = self else { return rgb(color) };
        let y = (color[0].clamp(0.0, 2.0) * range.ln_1p()).exp_m1();
        let radiance = rgb_of_yuv([y, color[1].clamp(0.0, 1.0), color[2].clamp(LEAST_V, 1.0)]);
        radiance.map(|c| c.max(0.0).ln_1p() / range.ln_1p())
    }

    /// What units of luminance and chroma count; of LogLuv, where RGB is about white.
    pub(super) fn lengths(self) -> [f32; 3] {
        match self {
            Self::YCrCb => LENGTHS,
            Self::LogLuv { range } => {
                let [u, v] = LOG_LUV_LENGTHS.map(|length| CHROMA * length / range.ln_1p());
                [LENGTHS[0], u, v]
            }
        }
    }
}

/// Luminance, red and blue difference of an RGB triple.
pub(super) fn ycrcb([r, g, b]: [f32; 3]) -> [f32; 3] {
    let [of_r, of_g, of_b] = LUMA.map(|weight| weight as f32);
    let y = of_r * r + of_g * g + of_b * b;
    [y, (r - y) / 1.402, (b - y) / 1.772]
}

/// The inverse of [`ycrcb`].
#[inline]
pub(super) fn rgb([y, cr, cb]: [f32; 3]) -> [f32; 3] {
    [y + 1.402 * cr, y - 0.714_136_3 * cr - 0.344_136_3 * cb, y + 1.772 * cb]
}

/// L, u, v of radiance in linear RGB.
pub(super) fn log_luv(rgb: [f32; 3]) -> [u16; 3] {
    let [x, y, z] = XYZ_OF_RGB.map(|row| (0..3).map(|c| row[c] * rgb[c]).sum::<f32>());
    let sum = x + 15.0 * y + 3.0 * z;
    let [u, v] = if y > 0.0 && sum > 0.0 { [4.0 * x / sum, 9.0 * y / sum] } else { WHITE };
    [luminance_code(y), log_luv_code(u).into(), log_luv_code(v).into()]
}

/// 0 of nothing; steps are 0.27 %.
pub(super) fn luminance_code(y: f32) -> u16 {
    if y > 0.0 { (256.0 * (y.log2() + 64.0)).clamp(1.0, 32_767.0) as u16 } else { 0 }
}

/// u' or v' in 8 bits.
pub(super) fn log_luv_code(chromaticity: f32) -> u8 {
    (410.0 * chromaticity).clamp(0.0, 255.0) as u8
}

/// The middle of what a code stands for.
pub(super) fn log_luv_value(code: u8) -> f32 {
    (f32::from(code) + 0.5) / 410.0
}

/// Luminance, u' and v' in the middle of what codes stand for.
fn yuv([l, u, v]: [u16; 3]) -> [f32; 3] {
    let y = if l == 0 { 0.0 } else { ((f32::from(l) + 0.5) / 256.0 - 64.0).exp2() };
    [y, log_luv_value(u as u8), log_luv_value(v as u8)]
}

/// Linear RGB of luminance, u' and v' > 0; negative outside its gamut.
fn rgb_of_yuv([y, u, v]: [f32; 3]) -> [f32; 3] {
    let xyz = [2.25 * y * u / v, y, y * (12.0 - 3.0 * u - 20.0 * v) / (4.0 * v)];
    RGB_OF_XYZ.map(|row| (0..3).map(|c| row[c] * xyz[c]).sum())
}
