//! Writes films.

use super::{FilmReader, ReadOptions, failed};
use crate::{CaptureError, Image};
use opencv::core::{Mat, Size, Vec3b};
use opencv::prelude::{VideoWriterTrait, VideoWriterTraitConst};
use opencv::videoio::{self, VideoWriter};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// How a film is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WriteOptions {
    /// Frames per second.
    pub fps: f64,
    /// 1 to 100, of Motion JPEG alone; the other codecs choose for themselves.
    pub quality: u8,
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self { fps: 30.0, quality: 90 }
    }
}

/// How frames are compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Codec {
    /// H.264 at constant quality (x264's rate factor 23), half the chroma resolution, as phones film.
    H264,
    /// MPEG-4 part 2, where FFmpeg was built without x264.
    Mpeg4,
    /// Every frame a JPEG.
    MotionJpeg,
    /// Without loss.
    Ffv1,
}

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Written {
    /// How many frames.
    pub frames: usize,
    /// How they are compressed.
    pub codec: Codec,
}

/// A film being written beside its place. Dropped without [`FilmWriter::finish`], it leaves nothing.
#[derive(Debug)]
pub struct FilmWriter {
    path: PathBuf,
    film: VideoWriter,
    beside: TempDir,
    size: [usize; 2],
    written: Written,
}

impl Codec {
    /// Those to try for an extension, best first.
    fn for_extension(path: &Path) -> &'static [Self] {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        match extension.as_str() {
            "mp4" | "mov" | "m4v" => &[Self::H264, Self::Mpeg4],
            "avi" => &[Self::MotionJpeg],
            "mkv" => &[Self::Ffv1],
            _ => &[],
        }
    }

    fn open(self, path: &Path, size: [usize; 2], options: &WriteOptions) -> opencv::Result<VideoWriter> {
        let (backend, [a, b, c, d]) = match self {
            Self::H264 => (videoio::CAP_FFMPEG, *b"avc1"),
            Self::Mpeg4 => (videoio::CAP_FFMPEG, *b"mp4v"),
            Self::MotionJpeg => (videoio::CAP_OPENCV_MJPEG, *b"MJPG"),
            Self::Ffv1 => (videoio::CAP_FFMPEG, *b"FFV1"),
        };
        let code = VideoWriter::fourcc(a.into(), b.into(), c.into(), d.into())?;
        let size = Size::new(size[0] as i32, size[1] as i32);
        let mut film = VideoWriter::new_with_backend(path, backend, code, options.fps, size, true)?;
        if self == Self::MotionJpeg && film.is_opened()? {
            film.set(videoio::VIDEOWRITER_PROP_QUALITY, f64::from(options.quality))?;
        }
        Ok(film)
    }
}

impl FilmWriter {
    /// Starts a film of frames of `size` (width, height). The extension chooses: `.mp4 .mov .m4v` H.264, `.avi` Motion
    /// JPEG, `.mkv` without loss.
    ///
    /// # Errors
    /// [`CaptureError::Invalid`] for another extension, sides that are odd or outside 2..=16384, a rate outside
    /// 1..=1000 or a quality outside 1..=100, or where no codec is to be had; [`CaptureError::Io`] where the folder
    /// cannot be written to.
    pub fn create(path: &Path, size: [usize; 2], options: &WriteOptions) -> Result<Self, CaptureError> {
        let codecs = Codec::for_extension(path);
        if codecs.is_empty() {
            return Err(CaptureError::invalid(path, "is no kind of film", "use .mp4 .mov .avi or .mkv"));
        }
        // Codecs store colour for blocks of 2 × 2.
        if size.iter().any(|&side| !(2..=16384).contains(&side) || side % 2 == 1) {
            let fault = format!("frames of {} × {} cannot be a film", size[0], size[1]);
            return Err(CaptureError::invalid(path, fault, "choose even sides from 2 to 16384"));
        }
        if !(1.0..=1000.0).contains(&options.fps) || !(1..=100).contains(&options.quality) {
            let fault = format!("{} frames a second of quality {}", options.fps, options.quality);
            return Err(CaptureError::invalid(path, fault, "ask for 1 to 1000 frames of quality 1 to 100"));
        }
        let parent = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let beside = tempfile::Builder::new().prefix(".turnlight-").tempdir_in(parent);
        let beside = beside.map_err(|e| CaptureError::io(path, e))?;
        let staged = staged(&beside, path);
        for &codec in codecs {
            let film = codec.open(&staged, size, options).map_err(|e| failed(path, &e))?;
            if film.is_opened().map_err(|e| failed(path, &e))? {
                let written = Written { frames: 0, codec };
                return Ok(Self { path: path.to_owned(), film, beside, size, written });
            }
        }
        let remedy = "choose another extension, or an OpenCV with FFmpeg and x264";
        Err(CaptureError::invalid(path, "no codec for this kind of film was found", remedy))
    }

    /// Appends a frame.
    ///
    /// # Errors
    /// [`CaptureError::Invalid`] for a frame of another size.
    pub fn push(&mut self, frame: &Image<[u8; 3]>) -> Result<(), CaptureError> {
        if [frame.width(), frame.height()] != self.size {
            let fault = format!("frame {} is {} × {}", self.written.frames, frame.width(), frame.height());
            return Err(CaptureError::invalid(&self.path, fault, "give all frames the size the film was started with"));
        }
        let bgr: Vec<Vec3b> = frame.pixels().iter().map(|&[r, g, b]| Vec3b::from([b, g, r])).collect();
        let write = |film: &mut VideoWriter| -> opencv::Result<()> {
            let mat = Mat::new_rows_cols_with_data(self.size[1] as i32, self.size[0] as i32, &bgr)?;
            film.write(&mat)
        };
        write(&mut self.film).map_err(|e| failed(&self.path, &e))?;
        self.written.frames += 1;
        Ok(())
    }

    /// Makes the film appear at its place.
    ///
    /// # Errors
    /// [`CaptureError::Invalid`] without frames, or where fewer can be read back than were pushed (a full disk);
    /// [`CaptureError::Io`] where it cannot be put into its place.
    pub fn finish(mut self) -> Result<Written, CaptureError> {
        let path = &self.path;
        if self.written.frames == 0 {
            return Err(CaptureError::invalid(path, "a film without frames", "push at least one"));
        }
        self.film.release().map_err(|e| failed(path, &e))?;
        let staged = staged(&self.beside, path);
        // Encoders keep silent about a full disk.
        let promised = FilmReader::open(&staged, &ReadOptions::default()).map_or(0, |film| film.info().frames);
        if promised < self.written.frames {
            let fault = format!("only {promised} of {} frames were written", self.written.frames);
            return Err(CaptureError::invalid(path, fault, "free some space, or write to another disk"));
        }
        let sync = std::fs::OpenOptions::new().append(true).open(&staged).and_then(|file| file.sync_all());
        sync.and_then(|()| std::fs::rename(&staged, path)).map_err(|e| CaptureError::io(path, e))?;
        Ok(self.written)
    }
}

/// Where the film is while it is being written; its extension says the container.
fn staged(beside: &TempDir, path: &Path) -> PathBuf {
    beside.path().join("film").with_extension(path.extension().unwrap_or_default())
}
