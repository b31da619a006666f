//! The frames that were chosen, on disk.

use crate::Error;
use crate::stages::Observer;
use capture::footage::{Footage, FootageFrame, FrameSource};
use capture::{CaptureError, Image, read_rgb, srgb, write_rgb};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Frames written together.
const BATCH: usize = 8;

/// Chosen frames as PNG in a folder of their own, which goes when this does.
#[derive(Debug)]
pub(super) struct Pictures {
    _folder: TempDir,
    files: Vec<PathBuf>,
}

/// The pictures of frames at some positions of the footage, ascending.
#[derive(Debug)]
pub(super) struct Taken {
    pub(super) positions: Vec<usize>,
    pub(super) pictures: Pictures,
}

impl Taken {
    /// The pictures of those of them at `kept`, ascending; `None` where one of these was not taken.
    pub(super) fn only(mut self, kept: &[usize]) -> Option<Pictures> {
        let at = |position: &usize| self.positions.binary_search(position).ok();
        let files = kept.iter().map(|position| Some(self.pictures.files[at(position)?].clone()));
        self.pictures.files = files.collect::<Option<_>>()?;
        Some(self.pictures)
    }
}

impl Pictures {
    /// Takes the chosen frames out of the footage, in their order there.
    pub(super) fn extract(
        footage: &Footage,
        chosen: &[FrameSource],
        beside: &Path,
        observer: &dyn Observer,
    ) -> Result<Self, Error> {
        let folder = std::fs::create_dir_all(beside)
            .and_then(|()| tempfile::Builder::new().prefix(".turnlight-").tempdir_in(beside));
        let folder = folder.map_err(|e| Error::Failed(format!("{}: {e}; choose another folder", beside.display())))?;
        let files: Vec<PathBuf> = (0..chosen.len()).map(|i| folder.path().join(format!("{i:04}.png"))).collect();
        let mut wanted = chosen.iter().zip(&files).peekable();
        let mut frames = footage.frames();
        let mut written = 0;
        while wanted.peek().is_some() {
            let mut batch: Vec<(FootageFrame, &PathBuf)> = Vec::new();
            for frame in frames.by_ref() {
                let frame = frame?;
                let is_wanted = |(source, _): &(&FrameSource, &PathBuf)| {
                    (source.take, source.index) == (frame.source.take, frame.source.index)
                };
                if let Some((_, file)) = wanted.next_if(is_wanted) {
                    batch.push((frame, file));
                }
                if batch.len() == BATCH || wanted.peek().is_none() {
                    break;
                }
            }
            if batch.is_empty() {
                let fault = format!("{}: changed while it was read", footage.path().display());
                return Err(Error::Failed(format!("{fault}; try again when it is written")));
            }
            let write = |(frame, file): &(FootageFrame, &PathBuf)| write_rgb(file, &frame.image);
            batch.par_iter().map(write).collect::<Vec<_>>().into_iter().collect::<Result<(), _>>()?;
            written += batch.len();
            observer.advanced(written, chosen.len());
        }
        Ok(Self { _folder: folder, files })
    }

    /// The file of a picture.
    pub(super) fn file(&self, position: usize) -> &Path {
        &self.files[position]
    }

    /// Reads a picture.
    pub(super) fn read(&self, position: usize) -> Result<Image<[u8; 3]>, CaptureError> {
        read_rgb(&self.files[position])
    }

    /// Multiplies the linear light of every picture by its factors, where that makes a difference of a level.
    pub(super) fn even_out(&self, gains: &[[f64; 3]]) -> Result<(), Error> {
        let even = |(file, gains): (&PathBuf, &[f64; 3])| {
            if gains.iter().all(|gain| (gain - 1.0).abs() < LEAST_GAIN) {
                return Ok(());
            }
            write_rgb(file, &evened(&read_rgb(file)?, gains))
        };
        let done: Vec<Result<(), CaptureError>> = self.files.par_iter().zip(gains).map(even).collect();
        Ok(done.into_iter().collect::<Result<(), _>>()?)
    }
}

/// Half a level of 255 where the slope of the encoding is steepest to notice: at white, 0.45 × 255 levels per unit.
const LEAST_GAIN: f64 = 0.004;

/// A picture with the linear light of its channels multiplied; what goes beyond white stays white.
pub(super) fn evened(image: &Image<[u8; 3]>, gains: &[f64; 3]) -> Image<[u8; 3]> {
    let table = gains.map(|gain| {
        let level = |encoded: usize| {
            let linear = gain * srgb::linear(encoded as f64 / 255.0);
            (255.0 * srgb::encoded(linear.clamp(0.0, 1.0))).round() as u8
        };
        std::array::from_fn::<u8, 256, _>(level)
    });
    image.map(|p| [0, 1, 2].map(|c| table[c][usize::from(p[c])]))
}
