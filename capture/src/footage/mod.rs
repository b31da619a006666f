//! Footage: what was filmed of one object, as films, folders of photographs, or several of them one after the other.
//!
//! Frames are handed out one at a time, upright, so that memory does not grow with the length of a film. Every film
//! and every folder is a *take*: within one the camera may have stood still, between two it was moved.

mod stills;

use crate::{CaptureError, Image, pixels};
use std::path::{Path, PathBuf};

pub use stills::{read_upright, read_upright_alpha};

/// Focal lengths noted that differ by less, in parts of them, are one.
const SAME_FOCAL: f64 = 0.01;

/// Films and folders of photographs of one object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Footage {
    /// In the order given.
    pub takes: Vec<Take>,
}

/// Frames taken without a break.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Take {
    /// A film.
    Film(PathBuf),
    /// Photographs, in the order of the numbers in their names.
    Stills(Vec<PathBuf>),
}

/// Where a frame of footage comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameSource {
    /// Position of its take.
    pub take: usize,
    /// What its take is called: the film without its extension, or the folder of the photographs.
    pub take_name: String,
    /// Counted from 0 within the take.
    pub index: usize,
    /// Seconds since the start of the take; of photographs, their number.
    pub time_s: f64,
    /// What to call it where it is spoken of: the file of a photograph, or film and number.
    pub name: String,
    /// The file of a photograph.
    pub file: Option<PathBuf>,
}

/// One frame of footage.
#[derive(Clone, Debug)]
pub struct FootageFrame {
    /// Where it comes from.
    pub source: FrameSource,
    /// Upright, 8-bit sRGB.
    pub image: Image<[u8; 3]>,
}

/// The frames of a [`Footage`], one in memory. Ends after the first fault.
#[derive(Debug)]
pub struct Frames<'a> {
    footage: &'a Footage,
    take: usize,
    index: usize,
    #[cfg(feature = "video")]
    film: Option<crate::video::FilmReader>,
    size: Option<[usize; 2]>,
}

impl Footage {
    /// Lists what there is at `paths`, each a film, a photograph, or a folder of photographs. Nothing is decoded yet.
    ///
    /// # Errors
    /// Names the path that is missing, or the folder that has neither photographs nor films, both, or more than one film.
    pub fn open(paths: &[PathBuf]) -> Result<Self, CaptureError> {
        let mut takes = Vec::new();
        for (i, path) in paths.iter().enumerate() {
            match (take(path)?, takes.last_mut()) {
                // Photographs named one by one are one take.
                (Take::Stills(more), Some(Take::Stills(files))) if path.is_file() && paths[i - 1].is_file() => {
                    files.extend(more);
                }
                (take, _) => takes.push(take),
            }
        }
        Ok(Self { takes })
    }

    /// All frames, in order.
    pub fn frames(&self) -> Frames<'_> {
        Frames {
            footage: self,
            take: 0,
            index: 0,
            #[cfg(feature = "video")]
            film: None,
            size: None,
        }
    }

    /// Where the photographs come from, in order; films are known only when they are read.
    pub fn photographs(&self) -> Vec<FrameSource> {
        let of_take = |(take, files): (usize, &Take)| match files {
            Take::Stills(files) => files.iter().enumerate().map(|(i, file)| source_of(take, i, file)).collect(),
            Take::Film(_) => Vec::new(),
        };
        self.takes.iter().enumerate().flat_map(of_take).collect()
    }

    /// The focal length in pixels, for pictures of this size, that the camera noted in the photographs (EXIF), to a tenth or
    /// so. `None` of films, where none has a note, and where they disagree by a hundredth: the zoom was touched.
    pub fn noted_focal_px(&self, size: [usize; 2]) -> Option<f64> {
        let sources = self.photographs();
        let files = sources.iter().filter_map(|source| source.file.as_deref());
        let noted: Vec<f64> = files.filter_map(|file| pixels::noted_focal_px(file, size)).collect();
        let first = *noted.first()?;
        noted.iter().all(|focal| (focal / first - 1.0).abs() < SAME_FOCAL).then_some(first)
    }

    /// Whether there is a film in it.
    pub fn has_film(&self) -> bool {
        self.takes.iter().any(|take| matches!(take, Take::Film(_)))
    }

    /// What the footage is called: the file or folder of its first take.
    pub fn path(&self) -> &Path {
        match self.takes.first() {
            Some(Take::Film(path)) => path,
            Some(Take::Stills(files)) => files.first().and_then(|file| file.parent()).unwrap_or_else(|| Path::new(".")),
            None => Path::new("."),
        }
    }
}

fn take(path: &Path) -> Result<Take, CaptureError> {
    let found = std::fs::metadata(path).map_err(|e| CaptureError::io(path, e))?;
    if found.is_dir() {
        return stills::in_folder(path);
    }
    Ok(if stills::is_photograph(path) { Take::Stills(vec![path.to_owned()]) } else { Take::Film(path.to_owned()) })
}

impl Frames<'_> {
    /// The next frame; `None` after the last.
    fn advance(&mut self) -> Option<Result<FootageFrame, CaptureError>> {
        loop {
            let next = match self.footage.takes.get(self.take)? {
                Take::Stills(files) => {
                    let file = files.get(self.index);
                    file.map(|file| photograph(self.take, self.index, file))
                }
                Take::Film(path) => self.film_frame(path),
            };
            match next {
                Some(frame) => {
                    self.index += 1;
                    return Some(frame);
                }
                None => {
                    self.take += 1;
                    self.index = 0;
                }
            }
        }
    }

    #[cfg(feature = "video")]
    fn film_frame(&mut self, path: &Path) -> Option<Result<FootageFrame, CaptureError>> {
        use crate::video::{FilmReader, ReadOptions};
        if self.film.is_none() {
            match FilmReader::open(path, &ReadOptions::default()) {
                Ok(film) => self.film = Some(film),
                Err(fault) => return Some(Err(fault)),
            }
        }
        let Some(frame) = self.film.as_mut().and_then(Iterator::next) else {
            self.film = None;
            return None;
        };
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let named = |frame: crate::video::FilmFrame| {
            let name = format!("{name} frame {}", frame.index);
            let take_name = path.file_stem().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
            let (index, time_s) = (frame.index, frame.time_s);
            let source = FrameSource { take: self.take, take_name, index, time_s, name, file: None };
            FootageFrame { source, image: frame.image }
        };
        Some(frame.map(named))
    }

    #[cfg(not(feature = "video"))]
    fn film_frame(&mut self, path: &Path) -> Option<Result<FootageFrame, CaptureError>> {
        let remedy = "give a folder of photographs, or build with the feature `video` \
            (it needs libopencv-dev, clang and libclang-dev)";
        Some(Err(CaptureError::invalid(path, "is no photograph, and this build reads no films", remedy)))
    }

    /// One lens sees all: frames of another size have another.
    fn check_size(&mut self, frame: FootageFrame) -> Result<FootageFrame, CaptureError> {
        let size = [frame.image.width(), frame.image.height()];
        let [width, height] = *self.size.get_or_insert(size);
        if size == [width, height] {
            return Ok(frame);
        }
        let fault = format!("is {}x{}, the frames before it are {width}x{height}", size[0], size[1]);
        let remedy = "give footage of one camera, held one way, at one zoom";
        Err(CaptureError::invalid(Path::new(&frame.source.name), fault, remedy))
    }
}

impl Iterator for Frames<'_> {
    type Item = Result<FootageFrame, CaptureError>;

    fn next(&mut self) -> Option<Self::Item> {
        let frame = self.advance()?.and_then(|frame| self.check_size(frame));
        if frame.is_err() {
            self.take = self.footage.takes.len();
        }
        Some(frame)
    }
}

fn photograph(take: usize, index: usize, file: &Path) -> Result<FootageFrame, CaptureError> {
    Ok(FootageFrame { image: read_upright(file)?, source: source_of(take, index, file) })
}

fn source_of(take: usize, index: usize, file: &Path) -> FrameSource {
    let name = file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let folder = file.parent().and_then(Path::file_name);
    let take_name = folder.map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    FrameSource { take, take_name, index, time_s: index as f64, name, file: Some(file.to_owned()) }
}

#[cfg(test)]
mod tests;
