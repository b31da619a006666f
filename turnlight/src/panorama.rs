//! Pictures of light from all around.

use crate::Error;
use capture::Image;
use capture::btf::Encoding;
use image::{DynamicImage, ImageReader};
use std::path::Path;

/// Reads a panorama as linear radiance: floats (.exr) as they are, 8 and 16 bits (.png .jpg) from sRGB.
///
/// # Errors
/// Where the file is missing or broken, or is no picture of a known kind.
pub fn read_panorama(path: &Path) -> Result<Image<[f32; 3]>, Error> {
    let refused =
        |fault: String| Error::Failed(format!("{}: {fault}; give a panorama as .exr, .png or .jpg", path.display()));
    let file = ImageReader::open(path).and_then(ImageReader::with_guessed_format);
    let picture = file.map_err(|e| refused(e.to_string()))?.decode().map_err(|e| refused(e.to_string()))?;
    let is_linear = matches!(picture, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_));
    let picture = picture.into_rgb32f();
    let radiance = |sample: f32| if is_linear { sample } else { Encoding::Srgb.decode(sample) };
    let pixels = picture.pixels().map(|p| p.0.map(radiance)).collect();
    Image::from_pixels(picture.width() as usize, picture.height() as usize, pixels)
        .ok_or_else(|| refused("it has no pixels".to_owned()))
}
