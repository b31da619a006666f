//! PNG in memory: what reports and renders are written as, and read back from.

use crate::Error;
use capture::Image;
use std::path::Path;

/// A PNG of a render.
///
/// # Errors
/// Where the picture is empty or too large for the format.
pub fn png_rgba(image: &Image<[u8; 4]>) -> Result<Vec<u8>, Error> {
    encode(image.width(), image.height(), png::ColorType::Rgba, image.pixels().as_flattened())
}

/// A PNG of a photograph.
///
/// # Errors
/// Where the picture is empty or too large for the format.
pub fn png_rgb(image: &Image<[u8; 3]>) -> Result<Vec<u8>, Error> {
    encode(image.width(), image.height(), png::ColorType::Rgb, image.pixels().as_flattened())
}

/// A PNG of a mask.
///
/// # Errors
/// Where the picture is empty or too large for the format.
pub fn png_grey(image: &Image<u8>) -> Result<Vec<u8>, Error> {
    encode(image.width(), image.height(), png::ColorType::Grayscale, image.pixels())
}

/// Reads what [`png_rgba`] wrote.
///
/// # Errors
/// Where the file is missing or is something else.
pub fn read_png_rgba(path: &Path) -> Result<Image<[u8; 4]>, Error> {
    let (size, bytes) = decode(path, png::ColorType::Rgba)?;
    image_of(path, size, bytes.as_chunks().0.to_vec())
}

/// Reads what [`png_rgb`] wrote.
///
/// # Errors
/// Where the file is missing or is something else.
pub fn read_png_rgb(path: &Path) -> Result<Image<[u8; 3]>, Error> {
    let (size, bytes) = decode(path, png::ColorType::Rgb)?;
    image_of(path, size, bytes.as_chunks().0.to_vec())
}

/// Reads what [`png_grey`] wrote.
///
/// # Errors
/// Where the file is missing or is something else.
pub fn read_png_grey(path: &Path) -> Result<Image<u8>, Error> {
    let (size, bytes) = decode(path, png::ColorType::Grayscale)?;
    image_of(path, size, bytes)
}

fn encode(width: usize, height: usize, color: png::ColorType, samples: &[u8]) -> Result<Vec<u8>, Error> {
    let failed = |fault: String| Error::Failed(format!("a picture of {width} × {height} cannot be a PNG: {fault}"));
    let side = |n: usize| u32::try_from(n).map_err(|e| failed(e.to_string()));
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, side(width)?, side(height)?);
    encoder.set_color(color);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(|e| failed(e.to_string()))?;
    writer.write_image_data(samples).map_err(|e| failed(e.to_string()))?;
    writer.finish().map_err(|e| failed(e.to_string()))?;
    Ok(bytes)
}

fn decode(path: &Path, color: png::ColorType) -> Result<([usize; 2], Vec<u8>), Error> {
    let failed = |fault: String| unreadable(path, &fault);
    let file = std::fs::File::open(path).map_err(|e| failed(e.to_string()))?;
    let mut reader =
        png::Decoder::new(std::io::BufReader::new(file)).read_info().map_err(|e| failed(e.to_string()))?;
    let size = reader.output_buffer_size().ok_or_else(|| failed("it is too large".to_owned()))?;
    let mut bytes = vec![0; size];
    let info = reader.next_frame(&mut bytes).map_err(|e| failed(e.to_string()))?;
    if (info.color_type, info.bit_depth) != (color, png::BitDepth::Eight) {
        return Err(failed(format!("it is {:?}, not 8-bit {color:?}", info.color_type)));
    }
    Ok(([info.width as usize, info.height as usize], bytes))
}

fn image_of<P: Copy>(path: &Path, [width, height]: [usize; 2], pixels: Vec<P>) -> Result<Image<P>, Error> {
    Image::from_pixels(width, height, pixels).ok_or_else(|| unreadable(path, "it has too few pixels"))
}

fn unreadable(path: &Path, fault: &str) -> Error {
    Error::Failed(format!("{}: cannot be read: {fault}; run again", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_come_back_as_written() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("x.png");
        let image = Image::from_pixels(2, 1, vec![[1, 2, 3, 4], [5, 6, 7, 0]]).unwrap();
        std::fs::write(&path, png_rgba(&image).unwrap()).unwrap();
        assert_eq!(read_png_rgba(&path).unwrap(), image);
        assert!(read_png_rgb(&path).is_err());
        std::fs::write(&path, &png_rgba(&image).unwrap()[..40]).unwrap();
        assert!(read_png_rgba(&path).is_err());
        assert!(png_grey(&Image::filled(0, 5, 0)).is_err());
    }
}
