//! Colour as the books hold it: luminance, which is scaled, and chroma, which is not.
//!
//! `Y = 0.299 R + 0.587 G + 0.114 B`, `Cr = (R − Y)/1.402`, `Cb = (B − Y)/1.772` (ITU-R BT.601) of the samples
//! as they are encoded, sRGB or logarithmic alike. For the latter, Cr and Cb are logarithms of
//! ratios: a surface of one hue has one chroma in light and shade. The source takes LogLuv
//! (Larson, "LogLuv Encoding for Full-Gamut, High-Dynamic Range Images", 1998) for a high range. Errors are judged on
//! encoded RGB, to which YCrCb is linear and LogLuv is not, and LogLuv's chroma of dark texels is noise; hence
//! YCrCb for both.

use crate::metrics::LUMA;

/// What a unit of Y, Cr, Cb adds to the squared error of RGB, as lengths, `√(3, 0.714² + 1.402², 0.344² + 1.772²)`, chroma
/// multiplied by [`CHROMA`]: what is called RMSE in levels is that of RGB where colours agree, and more where they do not. Cross
/// terms are left out, so that an error is a sum over luminance and chroma.
pub(super) const LENGTHS: [f32; 3] = [1.732_050_8, CHROMA * 1.573_385_3, CHROMA * 1.805_081];
/// Chroma counts more than its error, for it is the first to go: texels of like shading share items whatever their colours, which
/// become grey as the mean. At equal bytes, 1.6 errs less than 1 in RGB too (weave 24.2 to 25.0 at 1:500).
const CHROMA: f32 = 1.6;

/// Luminance, red and blue difference of an RGB triple.
pub fn ycrcb([r, g, b]: [f32; 3]) -> [f32; 3] {
    let [of_r, of_g, of_b] = LUMA.map(|weight| weight as f32);
    let y = of_r * r + of_g * g + of_b * b;
    [y, (r - y) / 1.402, (b - y) / 1.772]
}

/// The inverse of [`ycrcb`].
#[inline]
pub fn rgb([y, cr, cb]: [f32; 3]) -> [f32; 3] {
    [y + 1.402 * cr, y - 0.714_136_3 * cr - 0.344_136_3 * cb, y + 1.772 * cb]
}
