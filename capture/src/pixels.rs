//! Image files in and out: 8-bit colour, mattes, and the errors that name the file.

use crate::{CaptureError, Image, exif};
use ::image::metadata::Orientation;
use ::image::{DynamicImage, ImageDecoder, ImageError, ImageReader};
use std::path::Path;

/// Size of an image file, from its header.
pub(crate) fn size_of(path: &Path) -> Result<(usize, usize), CaptureError> {
    let (width, height) = reader(path)?.into_dimensions().map_err(|error| fault(path, error))?;
    Ok((width as usize, height as usize))
}

/// The focal length in pixels that the camera noted in the file, for a picture of this size; unreadable files say nothing.
pub(crate) fn noted_focal_px(path: &Path, size: [usize; 2]) -> Option<f64> {
    let notes = reader(path).ok()?.into_decoder().ok()?.exif_metadata().ok()??;
    exif::focal_px(&notes, size)
}

/// Whether the file has an alpha channel and some pixel of it is not opaque. Unreadable files have none.
pub fn has_transparency(path: &Path) -> bool {
    let declared = reader(path).ok().and_then(|r| r.into_decoder().ok()).is_some_and(|d| d.color_type().has_alpha());
    declared && decode(path).is_ok_and(|image| image.to_rgba8().pixels().any(|p| p.0[3] < 255))
}

/// Reads a PNG, JPEG or PNM as 8-bit RGB; grey is repeated, 16 bits rounded, alpha composited on black.
///
/// # Errors
/// When the file is missing, truncated or of an unknown kind.
pub fn read_rgb(path: &Path) -> Result<Image<[u8; 3]>, CaptureError> {
    Ok(split_alpha(&decode(path)?).0)
}

/// As [`read_rgb_and_alpha`], turned as the file's EXIF orientation says.
pub(crate) fn read_rgb_and_alpha_upright(path: &Path) -> Result<(Image<[u8; 3]>, Image<u8>), CaptureError> {
    let mut decoder = reader(path)?.into_decoder().map_err(|error| fault(path, error))?;
    // What cannot be read of the notes beside the picture is as if nothing were noted.
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let mut image = DynamicImage::from_decoder(decoder).map_err(|error| fault(path, error))?;
    image.apply_orientation(orientation);
    Ok(split_alpha(&image))
}

/// As [`read_rgb`], with the alpha channel as a matte (255 everywhere without one).
pub(crate) fn read_rgb_and_alpha(path: &Path) -> Result<(Image<[u8; 3]>, Image<u8>), CaptureError> {
    Ok(split_alpha(&decode(path)?))
}

/// Reads a silhouette: the brightest channel of each pixel. A file that uses the upper half of its
/// range is a matte with soft edges, whose object is where it is ≥ 128; in any other (0/1, label
/// numbers) every non-zero pixel is object.
///
/// # Errors
/// When the file is missing, truncated or of an unknown kind.
pub fn read_matte(path: &Path) -> Result<Image<u8>, CaptureError> {
    // 16 bits: a 16-bit 0/1 mask must not vanish in the conversion.
    let image = decode(path)?.into_rgba16();
    let coloured = image.pixels().any(|p| p.0[..3].iter().any(|&c| c > 0));
    let value = |p: &::image::Rgba<u16>| {
        let [r, g, b, a] = p.0;
        let bright = r.max(g).max(b);
        // A black shape on transparent ground is told by its alpha alone.
        if coloured { (u32::from(bright) * u32::from(a) / 65535) as u16 } else { a }
    };
    let opaque_black = !coloured && image.pixels().all(|p| p.0[3] == u16::MAX);
    let values: Vec<u16> = image.pixels().map(|p| if opaque_black { 0 } else { value(p) }).collect();
    let is_soft = values.iter().any(|&v| v >= 128 * 257);
    let level = |v: u16| if is_soft { ((u32::from(v) + 128) / 257) as u8 } else { u8::from(v > 0) * 255 };
    let (width, height) = (image.width() as usize, image.height() as usize);
    let pixels = values.into_iter().map(level).collect();
    Ok(Image::from_pixels(width, height, pixels).unwrap_or_default())
}

/// Writes an 8-bit RGB PNG.
///
/// # Errors
/// When the file cannot be written, for instance because the disk is full.
pub fn write_rgb(path: &Path, image: &Image<[u8; 3]>) -> Result<(), CaptureError> {
    write_png(path, image.width(), image.height(), png::ColorType::Rgb, image.pixels().as_flattened())
}

/// Writes an 8-bit grey PNG.
///
/// # Errors
/// When the file cannot be written, for instance because the disk is full.
pub fn write_matte(path: &Path, matte: &Image<u8>) -> Result<(), CaptureError> {
    write_png(path, matte.width(), matte.height(), png::ColorType::Grayscale, matte.pixels())
}

fn write_png(path: &Path, width: usize, height: usize, color: png::ColorType, data: &[u8]) -> Result<(), CaptureError> {
    let file = std::fs::File::create(path).map_err(|e| CaptureError::io(path, e))?;
    let png_error = |e: png::EncodingError| match e {
        png::EncodingError::IoError(e) => CaptureError::io(path, e),
        other => CaptureError::invalid(path, format!("cannot be written: {other}"), "report this as a bug"),
    };
    let mut encoder = png::Encoder::new(std::io::BufWriter::new(file), width as u32, height as u32);
    encoder.set_color(color);
    encoder.set_depth(png::BitDepth::Eight);
    // Ten times as quick as the usual, for files a tenth larger.
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header().map_err(png_error)?;
    writer.write_image_data(data).map_err(png_error)?;
    writer.finish().map_err(png_error)
}

fn split_alpha(image: &DynamicImage) -> (Image<[u8; 3]>, Image<u8>) {
    let rgba = image.to_rgba8();
    let (width, height) = (rgba.width() as usize, rgba.height() as usize);
    let composite = |p: &::image::Rgba<u8>| {
        let alpha = u32::from(p.0[3]);
        [0, 1, 2].map(|c: usize| ((u32::from(p.0[c]) * alpha + 127) / 255) as u8)
    };
    let colors = rgba.pixels().map(composite).collect();
    let alphas = rgba.pixels().map(|p| p.0[3]).collect();
    (
        Image::from_pixels(width, height, colors).unwrap_or_default(),
        Image::from_pixels(width, height, alphas).unwrap_or_default(),
    )
}

fn reader(path: &Path) -> Result<ImageReader<std::io::BufReader<std::fs::File>>, CaptureError> {
    let io = |e| CaptureError::io(path, e);
    ImageReader::open(path).map_err(io)?.with_guessed_format().map_err(io)
}

fn decode(path: &Path) -> Result<DynamicImage, CaptureError> {
    reader(path)?.decode().map_err(|error| fault(path, error))
}

fn fault(path: &Path, error: ImageError) -> CaptureError {
    match error {
        ImageError::IoError(e) if e.kind() != std::io::ErrorKind::UnexpectedEof => CaptureError::io(path, e),
        ImageError::Unsupported(e) => {
            CaptureError::invalid(path, format!("is of no readable kind ({e})"), "convert it to PNG or JPEG")
        }
        e => CaptureError::invalid(
            path,
            format!("is truncated or damaged ({e})"),
            "copy it again from its source, or leave the frame out",
        ),
    }
}
