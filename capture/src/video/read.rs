//! Reads films frame by frame.

use super::orientation::quarter_turns;
use super::{failed, rgb_of};
use crate::load::reduced;
use crate::{CaptureError, Image};
use opencv::core::Mat;
use opencv::prelude::{VideoCaptureTrait, VideoCaptureTraitConst};
use opencv::videoio::{self, VideoCapture};
use std::path::{Path, PathBuf};

/// How a film is read.
#[derive(Clone, Copy, Debug)]
pub struct ReadOptions {
    /// Whole factor by which frames are reduced (area average).
    pub downscale: usize,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self { downscale: 1 }
    }
}

/// What the head of a film says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmInfo {
    /// Columns of the frames as they are handed out: upright and reduced.
    pub width: usize,
    /// Rows of the frames.
    pub height: usize,
    /// Frames promised; 0 where the film does not say. Some kinds of film only estimate it.
    pub frames: usize,
    /// Frames per second, on average; 25 where the film does not say.
    pub fps: f64,
}

/// One frame of a film.
#[derive(Clone, Debug)]
pub struct FilmFrame {
    /// Counted from 0, in the order they are shown.
    pub index: usize,
    /// Seconds since the start of the film, strictly increasing.
    pub time_s: f64,
    /// Upright, 8-bit sRGB.
    pub image: Image<[u8; 3]>,
}

/// A film being read, one frame in memory. As an iterator it ends after the last frame, or after the first fault.
#[derive(Debug)]
pub struct FilmReader {
    path: PathBuf,
    film: VideoCapture,
    info: FilmInfo,
    downscale: usize,
    quarter_turns: u8,
    frame: Mat,
    read: usize,
    last_time_s: f64,
    is_over: bool,
}

impl FilmReader {
    /// Opens a film of any kind FFmpeg reads. The first frame is decoded, so that what is no film is refused here.
    /// Phones note how they were held: frames of .mp4 and .mov come out upright.
    ///
    /// # Errors
    /// [`CaptureError::Io`] where there is no such file, [`CaptureError::Invalid`] where it is empty, no film, cut
    /// off before its index, or has no frame, [`CaptureError::Downscale`] where nothing is left of the frames.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self, CaptureError> {
        let metadata = std::fs::metadata(path).map_err(|e| CaptureError::io(path, e))?;
        if !metadata.is_file() {
            return Err(CaptureError::invalid(
                path,
                "is no file",
                "give a film, or a folder of photographs to `import`",
            ));
        }
        let mut film = VideoCapture::from_file(path, videoio::CAP_FFMPEG).map_err(|e| failed(path, &e))?;
        if !film.is_opened().map_err(|e| failed(path, &e))? {
            return Err(CaptureError::invalid(
                path,
                unreadable(path),
                "copy it again from its source, or convert it to .mp4",
            ));
        }
        // Refused where OpenCV knows no orientation, and then does nothing about it.
        let _ = film.set(videoio::CAP_PROP_ORIENTATION_AUTO, 0.0).map_err(|e| failed(path, &e))?;
        let get = |property: i32| film.get(property).ok().filter(|v| v.is_finite() && *v > 0.0).unwrap_or(0.0);
        let frames = get(videoio::CAP_PROP_FRAME_COUNT) as usize;
        let fps = get(videoio::CAP_PROP_FPS);
        let fps = if fps > 0.0 { fps } else { 25.0 };
        let info = FilmInfo { width: 0, height: 0, frames, fps };
        let frame = Mat::default();
        let mut reader = Self {
            path: path.to_owned(),
            film,
            info,
            downscale: options.downscale,
            quarter_turns: quarter_turns(path),
            frame,
            read: 0,
            last_time_s: -1.0 / fps,
            is_over: false,
        };
        reader.open_first()?;
        Ok(reader)
    }

    /// What the film's head says.
    pub fn info(&self) -> FilmInfo {
        self.info
    }

    /// Decodes the first frame: its size is the truth, the head's may be before rotation.
    fn open_first(&mut self) -> Result<(), CaptureError> {
        if !self.advance()? {
            let remedy = "copy it again from its source, or film again";
            return Err(CaptureError::invalid(&self.path, "is a film without a frame that can be decoded", remedy));
        }
        let image = self.upright()?;
        let downscale = self.downscale;
        if downscale == 0 || image.width() / downscale == 0 || image.height() / downscale == 0 {
            return Err(CaptureError::Downscale { path: self.path.clone(), downscale });
        }
        self.info.width = image.width() / downscale;
        self.info.height = image.height() / downscale;
        Ok(())
    }

    /// Decodes the next frame, if there is one.
    fn advance(&mut self) -> Result<bool, CaptureError> {
        self.film.read(&mut self.frame).map_err(|e| failed(&self.path, &e))
    }

    /// The frame decoded last, turned as the camera was not.
    fn upright(&self) -> Result<Image<[u8; 3]>, CaptureError> {
        let image = rgb_of(&self.frame).map_err(|e| failed(&self.path, &e))?;
        let (w, h) = (image.width(), image.height());
        Ok(match self.quarter_turns {
            1 => rearranged(h, w, |x, y| image.at(y, h - 1 - x)),
            2 => rearranged(w, h, |x, y| image.at(w - 1 - x, h - 1 - y)),
            3 => rearranged(h, w, |x, y| image.at(w - 1 - y, x)),
            _ => image,
        })
    }

    /// Hands out the frame decoded last and decodes the one after it.
    fn take(&mut self) -> Result<FilmFrame, CaptureError> {
        let image = reduced(&self.upright()?, self.downscale);
        if (image.width(), image.height()) != (self.info.width, self.info.height) {
            let fault = format!("frame {} is of another size than the first one", self.read);
            return Err(CaptureError::invalid(&self.path, fault, "cut the film where its size changes"));
        }
        // Milliseconds of the frame just decoded. Streams without timestamps say 0 for ever.
        let said = self.film.get(videoio::CAP_PROP_POS_MSEC).unwrap_or(0.0) / 1e3;
        let least = self.last_time_s + 1e-6;
        let time_s = if said.is_finite() && said >= least { said } else { self.last_time_s + 1.0 / self.info.fps };
        let frame = FilmFrame { index: self.read, time_s, image };
        self.read += 1;
        self.last_time_s = time_s;
        self.is_over = !self.advance()?;
        Ok(frame)
    }

    /// The fault of a film that ended well before what it promised. Estimated counts may be a few frames off.
    fn cut_off(&self) -> Option<CaptureError> {
        let missing = self.info.frames.saturating_sub(self.read);
        let fault = format!("is cut off or damaged after {} of {} frames", self.read, self.info.frames);
        let remedy = "copy it again from its source, or use what there is of it by cutting it there";
        (missing > 2 + self.info.frames / 50).then(|| CaptureError::invalid(&self.path, fault, remedy))
    }
}

impl Iterator for FilmReader {
    type Item = Result<FilmFrame, CaptureError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.is_over {
            // Said once.
            let fault = self.cut_off();
            self.info.frames = self.read;
            return fault.map(Err);
        }
        let frame = self.take();
        if frame.is_err() {
            self.is_over = true;
            self.info.frames = self.read;
        }
        Some(frame)
    }
}

fn rearranged(width: usize, height: usize, pixel: impl Fn(usize, usize) -> [u8; 3]) -> Image<[u8; 3]> {
    let mut image = Image::filled(width, height, [0; 3]);
    for (place, value) in image.pixels_mut().iter_mut().enumerate() {
        *value = pixel(place % width, place / width);
    }
    image
}

/// Why FFmpeg would not open a file that is there.
fn unreadable(path: &Path) -> &'static str {
    use std::io::Read;
    let mut head = [0; 12];
    let read = std::fs::File::open(path).and_then(|file| file.take(12).read(&mut head));
    match read {
        Ok(0) => "is empty",
        // The family of .mp4 and .mov starts with a box of this kind; its index comes last.
        Ok(12) if &head[4..8] == b"ftyp" => "is cut off: its index, at the end, is missing",
        _ => "is no film that can be read",
    }
}
