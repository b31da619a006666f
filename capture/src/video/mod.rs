//! Films in and out, and boards found in them: the boundary to OpenCV (feature `video`).
//!
//! OpenCV puts pixel *centres* at whole numbers and keeps colours as blue, green, red; both are converted here
//! and nowhere else.

mod blur;
mod detect;
mod observe;
mod orientation;
mod read;
mod recognise;
mod write;

pub use detect::{BoardView, FoundMarker, detect_board, detect_markers, guess_dictionary};
pub use observe::{Observations, Observed, observe, recognise_in_footage};
pub use read::{FilmFrame, FilmInfo, FilmReader, ReadOptions};
pub use recognise::{Pattern, detect_pattern, recognise_pattern};
pub use write::{Codec, FilmWriter, WriteOptions, Written};

use crate::{CaptureError, Image};
use opencv::core::{Mat, MatTraitConst, MatTraitConstManual, Vec3b};
use std::path::Path;

/// A fault of OpenCV itself in the work on a file.
fn failed(path: &Path, error: &opencv::Error) -> CaptureError {
    CaptureError::invalid(path, format!("OpenCV failed ({})", error.message.trim()), "report this as a bug")
}

/// A continuous 8-bit blue, green, red matrix as our image.
fn rgb_of(mat: &Mat) -> opencv::Result<Image<[u8; 3]>> {
    let pixels = mat.data_typed::<Vec3b>()?.iter().map(|p| [p[2], p[1], p[0]]).collect();
    let (width, height) = (mat.cols() as usize, mat.rows() as usize);
    let fault = || opencv::Error::new(opencv::core::StsUnmatchedSizes, "a frame of another size than it says");
    Image::from_pixels(width, height, pixels).ok_or_else(fault)
}

#[cfg(test)]
mod tests;
