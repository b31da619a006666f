//! Colour as the books hold it: luminance, which is scaled, and chroma, which is not.
//!
//! `Y = 0.299 R + 0.587 G + 0.114 B`, `Cr = (R − Y)/1.402`, `Cb = (B − Y)/1.772` (ITU-R BT.601) of the samples
//! as they are encoded, sRGB or logarithmic alike. For the latter, Cr and Cb are logarithms of
//! ratios: a surface of one hue has one chroma in light and shade. [`LogLuv`], which Larson gave
//! for linear radiance, says the same in fixed steps: 0.27 % of luminance, 1/410 of u′ and v′. Errors
//! are judged on encoded RGB, to which YCrCb is linear and LogLuv is not, and LogLuv's chroma of dark texels is noise;
//! hence YCrCb for both. LogLuv is for exchange with programs that speak it.

/// What a unit of Y, Cr, Cb adds to the squared error of RGB, as lengths: `√(3, 0.714² + 1.402², 0.344² + 1.772²)`.
/// Cross terms are left out, so that an error is a sum over luminance and chroma.
pub(super) const LENGTHS: [f32; 3] = [1.732_050_8, 1.573_385_3, 1.805_081];
/// Steps of `log₂ Y` in [`LogLuv`].
const STEPS_PER_STOP: f64 = 256.0;
/// Steps of u′ and of v′.
const CHROMA_STEPS: f64 = 410.0;
/// u′, v′ of D65, the chroma of what has none.
const WHITE: [f64; 2] = [0.197_84, 0.468_34];

/// Luminance, red and blue difference of an RGB triple.
pub fn ycrcb([r, g, b]: [f32; 3]) -> [f32; 3] {
    let y = 0.299 * r + 0.587 * g + 0.114 * b;
    [y, (r - y) / 1.402, (b - y) / 1.772]
}

/// The inverse of [`ycrcb`].
#[inline]
pub fn rgb([y, cr, cb]: [f32; 3]) -> [f32; 3] {
    [y + 1.402 * cr, y - 0.714_136_3 * cr - 0.344_136_3 * cb, y + 1.772 * cb]
}

/// Radiance in 32 bits. Source: Larson, "LogLuv Encoding for Full-Gamut, High-Dynamic Range Images", 1998.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogLuv {
    /// `⌊256 (log₂ Y + 64)⌋`; 0 is black.
    pub luminance: u16,
    /// `⌊410 u′⌋`.
    pub u: u8,
    /// `⌊410 v′⌋`.
    pub v: u8,
}

impl LogLuv {
    /// Of CIE XYZ; what is not brighter than 0 becomes black, and has the chroma of white.
    pub fn of_xyz([x, y, z]: [f64; 3]) -> Self {
        let sum = x + 15.0 * y + 3.0 * z;
        let lit = y > 0.0 && sum > 0.0 && sum.is_finite();
        let luminance = if lit { (STEPS_PER_STOP * (y.log2() + 64.0)).clamp(0.0, 32767.0) as u16 } else { 0 };
        let [u, v] = if luminance > 0 { [4.0 * x / sum, 9.0 * y / sum] } else { WHITE };
        let code = |c: f64| (CHROMA_STEPS * c).clamp(0.0, 255.0) as u8;
        Self { luminance, u: code(u), v: code(v) }
    }

    /// CIE XYZ, at the middle of the steps.
    pub fn to_xyz(self) -> [f64; 3] {
        if self.luminance == 0 {
            return [0.0; 3];
        }
        let y = ((f64::from(self.luminance) + 0.5) / STEPS_PER_STOP - 64.0).exp2();
        let [u, v] = [self.u, self.v].map(|c| (f64::from(c) + 0.5) / CHROMA_STEPS);
        [y * 9.0 * u / (4.0 * v), y, y * (12.0 - 3.0 * u - 20.0 * v) / (4.0 * v)]
    }
}
