//! Films of every kind this build can write, chosen by extension.

use crate::Error;
use capture::Image;
#[cfg(feature = "video")]
use capture::video::{FilmWriter, WriteOptions};
use std::path::Path;

/// Says whether a film of this name can be written, before any work is done.
///
/// # Errors
/// [`Error::Arguments`] for another extension, and for one that needs OpenCV in a build without.
pub fn check(path: &Path) -> Result<(), Error> {
    match extension(path).as_str() {
        "png" | "apng" => Ok(()),
        "mp4" | "mov" | "m4v" | "avi" | "mkv" if cfg!(feature = "video") => Ok(()),
        "mp4" | "mov" | "m4v" | "avi" | "mkv" => Err(Error::Arguments(format!(
            "{}: this turnlight was built without films of this kind; write .png (animated), or build it with \
             --features video",
            path.display()
        ))),
        _ => Err(Error::Arguments(format!(
            "{}: cannot write this kind of film; use .png or .apng (animated), .mp4 .mov .avi or .mkv",
            path.display()
        ))),
    }
}

/// Whether films of this name have frames of even sides only: their codecs store colour for blocks of 2 × 2.
pub fn needs_even_sides(path: &Path) -> bool {
    !matches!(extension(path).as_str(), "png" | "apng")
}

/// Writes RGBA frames of one size as a film, one in memory at a time. Animated PNGs keep the alpha; other kinds have
/// none, and what is transparent is black there.
///
/// # Errors
/// As [`check`]; [`Error::Render`] and [`Error::Capture`] where the frames cannot be a film or it cannot be written.
pub fn write_film<F>(path: &Path, frames: F, fps: f64) -> Result<(), Error>
where
    F: IntoIterator<Item = Image<[u8; 4]>>,
    F::IntoIter: ExactSizeIterator,
{
    check(path)?;
    if matches!(extension(path).as_str(), "png" | "apng") {
        return Ok(render::film::write_film(path, frames, fps)?);
    }
    encode(path, frames.into_iter(), fps)
}

#[cfg(feature = "video")]
fn encode(path: &Path, frames: impl Iterator<Item = Image<[u8; 4]>>, fps: f64) -> Result<(), Error> {
    let mut film: Option<Film> = None;
    for frame in frames {
        let started = match &mut film {
            Some(film) => film,
            none => none.insert(Film::create(path, [frame.width(), frame.height()], fps)?),
        };
        started.push(&frame)?;
    }
    let empty = || Error::Failed(format!("{}: a film without frames; render at least one", path.display()));
    film.ok_or_else(empty)?.finish()
}

/// A film of a kind without alpha that is written frame by frame.
#[cfg(feature = "video")]
#[derive(Debug)]
pub struct Film(FilmWriter);

#[cfg(feature = "video")]
impl Film {
    /// Starts one of frames of `size` (width, height); where it may not be, nothing is left.
    ///
    /// # Errors
    /// As [`FilmWriter::create`].
    pub fn create(path: &Path, size: [usize; 2], fps: f64) -> Result<Self, Error> {
        Ok(Self(FilmWriter::create(path, size, &WriteOptions { fps, ..WriteOptions::default() })?))
    }

    /// Appends a frame; what is transparent becomes black.
    ///
    /// # Errors
    /// As [`FilmWriter::push`].
    pub fn push(&mut self, frame: &Image<[u8; 4]>) -> Result<(), Error> {
        let opaque = frame.map(|[r, g, b, a]| [r, g, b].map(|c| ((u32::from(c) * u32::from(a) + 127) / 255) as u8));
        Ok(self.0.push(&opaque)?)
    }

    /// Makes the film appear at its place.
    ///
    /// # Errors
    /// As [`FilmWriter::finish`].
    pub fn finish(self) -> Result<(), Error> {
        self.0.finish()?;
        Ok(())
    }
}

/// Never reached: [`check`] refuses first.
#[cfg(not(feature = "video"))]
fn encode(path: &Path, _: impl Iterator<Item = Image<[u8; 4]>>, _: f64) -> Result<(), Error> {
    check(path)
}

fn extension(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_build_says_what_it_cannot_write() {
        assert!(check("a.png".as_ref()).is_ok());
        assert!(check("a.gif".as_ref()).is_err_and(|fault| fault.to_string().contains(".apng")));
        let film = check("a.mp4".as_ref());
        if cfg!(feature = "video") {
            assert!(film.is_ok());
        } else {
            assert!(film.is_err_and(|fault| fault.to_string().contains("--features video")));
        }
    }

    #[cfg(feature = "video")]
    #[test]
    fn what_is_transparent_is_black_in_a_film() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("film.mkv");
        let frames = vec![Image::filled(16, 16, [200, 100, 50, 0]), Image::filled(16, 16, [200, 100, 50, 255])];
        write_film(&path, frames, 12.0).unwrap();
        let film = capture::video::FilmReader::open(&path, &capture::video::ReadOptions::default()).unwrap();
        let colours: Vec<[u8; 3]> = film.map(|frame| frame.unwrap().image.at(3, 3)).collect();
        assert_eq!(colours, [[0, 0, 0], [200, 100, 50]]);
        assert!(write_film(&path, Vec::new(), 12.0).is_err());
    }
}
