//! Coding of layers as images: JPEG with quantisation matched to a layer's scale, PNG without loss.
//!
//! All layers of a basis have coefficients of unit RMS, so the error that a layer's coding puts into a
//! view is the layer's own coding error, and the same quantiser step *in units of intensity* for all
//! of them is rate–distortion optimal (reverse water-filling). A layer stretched by a gain to
//! use 8 bits gets a quantisation table stretched by the same gain: weak layers cost few bits.

use capture::Image;
use image::ImageEncoder;
use jpeg_encoder::{ColorType, Encoder, QuantizationTableType, SamplingFactor};
use std::io::Cursor;

/// Luminance quantisation of ITU-T T.81, annex K.1, row by row: how visible each frequency is.
const LUMINANCE: [u16; 64] = [
    16, 11, 10, 16, 24, 40, 51, 61, 12, 12, 14, 19, 26, 58, 60, 55, 14, 13, 16, 24, 40, 57, 69, 56, 14, 17, 22, 29, 51,
    87, 80, 62, 18, 22, 37, 56, 68, 109, 103, 77, 24, 35, 55, 64, 81, 104, 113, 92, 49, 64, 78, 87, 103, 121, 120, 101,
    72, 92, 95, 98, 112, 100, 103, 99,
];

/// Share of a flat table in ours, the rest being annex K. Flat minimises squared error, the annex favours
/// the eye; on the temple ring at a step of 0.07, shares of 0, ½ and 1 gave 3.691, 3.690 and 3.687 % error in
/// 2.43, 2.36 and 2.62 MB.
const FLATNESS: f64 = 0.5;

/// Level of a flat table of the same coarseness as annex K for low frequencies.
const FLAT_LEVEL: f64 = 24.0;

/// How much coarser chroma is quantised than luma. Chroma keeps full resolution: coarser tables buy the
/// same, and halved chroma with optimised Huffman tables came back wrong from our decoder, like below.
const CHROMA: f64 = 2.0;

/// JPEG bytes of `image`. `step` is the coarseness of quantisation in 8-bit levels of the *stored*
/// image: 1 is annex K (quality 50), 0.2 is quality 90. `None` where the image is empty or too large.
///
/// Tables of its own make the file up to a third smaller and one scan per channel. Of such a file the
/// decoder here (zune-jpeg 0.5.15) shows the last rows wrong where they hold next to nothing, as they do
/// in gutters and weak layers; then the file with common tables and one scan is taken.
pub(crate) fn encode_jpeg(image: &Image<[u8; 3]>, step: f64) -> Option<Vec<u8>> {
    let size = [image.width(), image.height()];
    let (own, common) = (with_tables(image, step, true)?, with_tables(image, step, false)?);
    // Tables change no coefficient, so both files show the same if they are read right.
    let agree = matches!((decode(&own, size), decode(&common, size)), (Ok(a), Ok(b)) if a == b);
    Some(if agree { own } else { common })
}

fn with_tables(image: &Image<[u8; 3]>, step: f64, own: bool) -> Option<Vec<u8>> {
    let table = |chroma: f64| {
        let entry = |q: u16| ((1.0 - FLATNESS) * f64::from(q) + FLATNESS * FLAT_LEVEL) * step * chroma;
        QuantizationTableType::Custom(Box::new(LUMINANCE.map(|q| entry(q).round().clamp(1.0, 255.0) as u16)))
    };
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, 100);
    encoder.set_sampling_factor(SamplingFactor::R_4_4_4);
    encoder.set_quantization_tables(table(1.0), table(CHROMA));
    encoder.set_optimized_huffman_tables(own);
    let (width, height) = (u16::try_from(image.width()).ok()?, u16::try_from(image.height()).ok()?);
    encoder.encode(image.pixels().as_flattened(), width, height, ColorType::Rgb).ok()?;
    Some(bytes)
}

/// PNG bytes of `image`; `None` where it is empty.
pub(crate) fn encode_png(image: &Image<[u8; 3]>) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new_with_quality(
        &mut bytes,
        image::codecs::png::CompressionType::Best,
        image::codecs::png::FilterType::Adaptive,
    );
    let (width, height) = (image.width() as u32, image.height() as u32);
    encoder.write_image(image.pixels().as_flattened(), width, height, image::ExtendedColorType::Rgb8).ok()?;
    Some(bytes)
}

/// Decodes JPEG or PNG bytes to 8-bit RGB of exactly `size`; `Err` says what is wrong. The header is
/// read before anything is allocated.
pub(crate) fn decode(bytes: &[u8], size: [usize; 2]) -> Result<Image<[u8; 3]>, String> {
    let reader = || image::ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string());
    let (width, height) = reader()?.into_dimensions().map_err(|e| e.to_string())?;
    if [width as usize, height as usize] != size {
        return Err(format!("an image of {width}×{height} where {}×{} is declared", size[0], size[1]));
    }
    let rgb = reader()?.decode().map_err(|e| e.to_string())?.into_rgb8();
    let pixels = rgb.pixels().map(|p| p.0).collect();
    Image::from_pixels(size[0], size[1], pixels).ok_or_else(|| "an image of the wrong length".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> Image<[u8; 3]> {
        let grain = |i: usize| (i.wrapping_mul(2_654_435_761) >> 9) % 60;
        let pixels = (0..64 * 48).map(|i| [i % 64 * 3 + grain(i), i / 64 * 5, i / 128].map(|v| v as u8)).collect();
        Image::from_pixels(64, 48, pixels).unwrap()
    }

    #[test]
    fn png_is_lossless_and_jpeg_close() {
        let original = picture();
        assert_eq!(decode(&encode_png(&original).unwrap(), [64, 48]).unwrap(), original);
        let coded = decode(&encode_jpeg(&original, 0.05).unwrap(), [64, 48]).unwrap();
        let error = original.pixels().iter().zip(coded.pixels()).map(|(a, b)| a[1].abs_diff(b[1]) as f64).sum::<f64>();
        assert!(error / (64.0 * 48.0) < 3.0, "mean error {error}");
    }

    #[test]
    fn plain_and_nearly_plain_images_survive_coding() {
        let noise = |i: usize, spread: usize| (i.wrapping_mul(2_654_435_761) >> 7) % (spread + 1);
        for (width, height) in [(8, 8), (8, 200), (96, 64), (64, 48), (130, 70)] {
            for color in [[0u8; 3], [255; 3], [128; 3], [90, 140, 200], [200, 10, 60]] {
                for (spread, step) in [(0, 0.07), (1, 0.07), (3, 0.07), (0, 1e-6), (1, 1e-6), (60, 1e-6)] {
                    let value = |i: usize, c: usize| color[c].saturating_add(noise(3 * i + c, spread) as u8);
                    let pixels = (0..width * height).map(|i| [0, 1, 2].map(|c| value(i, c))).collect();
                    let image = Image::from_pixels(width, height, pixels).unwrap();
                    let coded = decode(&encode_jpeg(&image, step).unwrap(), [width, height]).unwrap();
                    let differences = image.pixels().as_flattened().iter().zip(coded.pixels().as_flattened());
                    let largest = differences.map(|(a, b)| a.abs_diff(*b)).max().unwrap();
                    assert!(largest <= 12, "{largest} of {color:?} ± {spread} at {step}, {width}×{height}");
                }
            }
        }
    }

    #[test]
    fn coarser_steps_cost_fewer_bytes() {
        let sizes = [0.1, 0.4, 2.0].map(|step| encode_jpeg(&picture(), step).unwrap().len());
        assert!(sizes[0] > sizes[1] && sizes[1] > sizes[2], "{sizes:?}");
    }

    #[test]
    fn broken_images_are_refused() {
        let bytes = encode_png(&picture()).unwrap();
        assert!(decode(&bytes, [65, 48]).is_err(), "another size");
        assert!(decode(&bytes[..bytes.len() / 2], [64, 48]).is_err(), "truncated");
        assert!(decode(b"not an image", [64, 48]).is_err(), "garbage");
    }
}
