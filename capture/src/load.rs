//! Brings frames into memory as views.

use crate::{Capture, CaptureError, Frame, Image, LoadOptions, MaskSource, View, pixels, silhouette};
use rayon::prelude::*;
use std::path::Path;

/// One decoded frame; the matte is missing where silhouettes are to be found.
struct Decoded {
    image: Image<[u8; 3]>,
    matte: Option<Image<u8>>,
}

pub(crate) fn load_views(
    capture: &Capture,
    positions: &[usize],
    options: &LoadOptions,
) -> Result<Vec<View>, CaptureError> {
    let frames = capture.frames.len();
    if let Some(&position) = positions.iter().find(|&&p| p >= frames) {
        return Err(CaptureError::Position { position, frames });
    }
    if capture.mask_source == MaskSource::Automatic {
        return load_without_masks(capture, positions, options);
    }
    let decoded = decode_all(capture, positions, options)?;
    positions
        .iter()
        .zip(decoded)
        .map(|(&at, d)| view(capture, at, options, d.image, d.matte.unwrap_or_default()))
        .collect()
}

/// Silhouettes come from all views together, so a few views asked for alone get company.
fn load_without_masks(
    capture: &Capture,
    positions: &[usize],
    options: &LoadOptions,
) -> Result<Vec<View>, CaptureError> {
    let all = with_company(positions, capture.frames.len());
    let images: Vec<_> = decode_all(capture, &all, options)?.into_iter().map(|d| d.image).collect();
    let cameras: Vec<_> = all.iter().map(|&at| capture.frames[at].camera.downscaled(options.downscale)).collect();
    let mattes = silhouette::find_mattes_in_box(&images, &cameras, capture.aabb.as_ref());
    let found = all.iter().zip(images).zip(mattes).take(positions.len());
    found.map(|((&at, image), matte)| view(capture, at, options, image, matte)).collect()
}

/// The positions asked for, then others spread evenly, up to two dozen: enough that a vote of views
/// tells clutter from object.
fn with_company(positions: &[usize], frames: usize) -> Vec<usize> {
    let mut all = positions.to_vec();
    let wanted = 24.min(frames);
    for i in 0..wanted {
        let other = i * frames / wanted;
        if all.len() < wanted && !all.contains(&other) {
            all.push(other);
        }
    }
    all
}

fn decode_all(capture: &Capture, positions: &[usize], options: &LoadOptions) -> Result<Vec<Decoded>, CaptureError> {
    // Collected before the errors are looked at, so that the first in order is reported, always the same.
    let decoded: Vec<_> =
        positions.par_iter().map(|&at| decode(&capture.frames[at], capture.mask_source, options.downscale)).collect();
    decoded.into_iter().collect()
}

fn decode(frame: &Frame, source: MaskSource, downscale: usize) -> Result<Decoded, CaptureError> {
    let (width, height) = (frame.camera.intrinsics.width, frame.camera.intrinsics.height);
    let path = &frame.image_path;
    if downscale == 0 || width / downscale == 0 || height / downscale == 0 {
        return Err(CaptureError::Downscale { path: path.clone(), downscale });
    }
    let (image, alpha) = pixels::read_rgb_and_alpha(path)?;
    check_size(path, image.width(), image.height(), width, height)?;
    let matte = match (source, &frame.mask_path) {
        (MaskSource::Automatic, _) => None,
        (MaskSource::Alpha, _) => Some(alpha),
        (_, Some(mask)) => Some(read_mask(mask, source, width, height)?),
        (_, None) => return Err(CaptureError::invalid(path, "has no mask", "give every frame a mask, or none")),
    };
    Ok(Decoded { image: reduced(&image, downscale), matte: matte.map(|m| reduced_matte(&m, downscale)) })
}

fn read_mask(path: &Path, source: MaskSource, width: usize, height: usize) -> Result<Image<u8>, CaptureError> {
    let matte = pixels::read_matte(path)?;
    check_size(path, matte.width(), matte.height(), width, height)?;
    Ok(if source == MaskSource::InvertedDynamic { matte.map(|v| 255 - v) } else { matte })
}

fn check_size(path: &Path, width: usize, height: usize, w: usize, h: usize) -> Result<(), CaptureError> {
    if (width, height) == (w, h) {
        return Ok(());
    }
    let fault = format!("is {width}x{height}, its camera is for {w}x{h}");
    Err(CaptureError::invalid(path, fault, "use the images that were calibrated, or scale the calibration"))
}

fn view(
    capture: &Capture,
    index: usize,
    options: &LoadOptions,
    image: Image<[u8; 3]>,
    matte: Image<u8>,
) -> Result<View, CaptureError> {
    let frame = &capture.frames[index];
    if !matte.pixels().iter().any(|&v| v >= 128) {
        let file = frame.mask_path.as_ref().unwrap_or(&frame.image_path);
        return Err(CaptureError::invalid(file, "its silhouette is empty", empty_remedy(capture.mask_source)));
    }
    let name = frame.image_path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let is_complete = !touches_border(&matte);
    Ok(View { index, name, image, matte, is_complete, camera: frame.camera.downscaled(options.downscale) })
}

impl View {
    /// The same view with image, matte and camera reduced by a whole factor (area average), at most to one pixel.
    pub fn downscaled(&self, factor: usize) -> Self {
        let factor = factor.clamp(1, self.image.width().min(self.image.height()).max(1));
        Self {
            index: self.index,
            name: self.name.clone(),
            image: reduced(&self.image, factor),
            matte: reduced_matte(&self.matte, factor),
            is_complete: self.is_complete,
            camera: self.camera.downscaled(factor),
        }
    }
}

fn empty_remedy(source: MaskSource) -> &'static str {
    match source {
        MaskSource::Automatic => "leave the frame out, or give masks",
        _ => "leave the frame out, or mark the object in the mask",
    }
}

/// Whether object pixels lie on the outermost ring of the frame.
pub(crate) fn touches_border(matte: &Image<u8>) -> bool {
    let (w, h) = (matte.width(), matte.height());
    if w == 0 || h == 0 {
        return false;
    }
    let is_object = |x: usize, y: usize| matte.at(x, y) >= 128;
    (0..w).any(|x| is_object(x, 0) || is_object(x, h - 1)) || (0..h).any(|y| is_object(0, y) || is_object(w - 1, y))
}

/// Area average over whole blocks, in encoded values, of each channel; a rest at the right and bottom
/// is dropped, as `Camera::downscaled` assumes.
pub fn reduced(image: &Image<[u8; 3]>, factor: usize) -> Image<[u8; 3]> {
    if factor <= 1 {
        return image.clone();
    }
    blocks(image, factor, |sum, p| (0..3).for_each(|c| sum[c] += u32::from(p[c])), |mean| mean)
}

fn reduced_matte(matte: &Image<u8>, factor: usize) -> Image<u8> {
    if factor == 1 {
        return matte.clone();
    }
    blocks(matte, factor, |sum, p| sum[0] += u32::from(p), |mean| mean[0])
}

fn blocks<P: Copy, F: Fn(&mut [u32; 3], P)>(
    image: &Image<P>,
    factor: usize,
    add: F,
    pixel: impl Fn([u8; 3]) -> P,
) -> Image<P> {
    let (width, height) = (image.width() / factor, image.height() / factor);
    let count = (factor * factor) as u32;
    let mut pixels = Vec::with_capacity(width * height);
    for y in 0..height {
        for x in 0..width {
            let mut sum = [0_u32; 3];
            for row in y * factor..(y + 1) * factor {
                image.row(row)[x * factor..(x + 1) * factor].iter().for_each(|&p| add(&mut sum, p));
            }
            pixels.push(pixel(sum.map(|s| ((s + count / 2) / count) as u8)));
        }
    }
    Image::from_pixels(width, height, pixels).unwrap_or_else(|| Image::filled(0, 0, pixel([0; 3])))
}
