//! Photographs of a folder, in order, upright.

use super::Take;
use crate::formats::{IMAGE_EXTENSIONS, images_in, list};
use crate::{CaptureError, Image, pixels};
use std::path::{Path, PathBuf};

const FILMS: [&str; 7] = ["mp4", "mov", "m4v", "avi", "mkv", "webm", "mts"];

/// Reads a photograph and turns it as its EXIF orientation says: cameras note how they were held.
///
/// # Errors
/// When the file is missing, truncated or of an unknown kind.
pub fn read_upright(path: &Path) -> Result<Image<[u8; 3]>, CaptureError> {
    Ok(pixels::read_rgb_and_alpha_upright(path)?.0)
}

/// Reads the alpha channel of a photograph as a matte, turned as [`read_upright`] does; 255 everywhere without one.
///
/// # Errors
/// As [`read_upright`].
pub fn read_upright_alpha(path: &Path) -> Result<Image<u8>, CaptureError> {
    Ok(pixels::read_rgb_and_alpha_upright(path)?.1)
}

pub(super) fn is_photograph(path: &Path) -> bool {
    has_extension(path, &IMAGE_EXTENSIONS)
}

fn is_film(path: &Path) -> bool {
    path.is_file() && has_extension(path, &FILMS)
}

fn has_extension(path: &Path, known: &[&str]) -> bool {
    path.extension().and_then(|e| e.to_str()).is_some_and(|e| known.contains(&e.to_ascii_lowercase().as_str()))
}

/// The photographs of a folder without their masks, or its only film.
pub(super) fn in_folder(folder: &Path) -> Result<Take, CaptureError> {
    let photographs: Vec<PathBuf> = images_in(folder)?.into_iter().filter(|path| !is_hidden(path)).collect();
    let films: Vec<PathBuf> = list(folder)?.into_iter().filter(|path| is_film(path) && !is_hidden(path)).collect();
    let invalid = |fault: &str, remedy: &str| Err(CaptureError::invalid(folder, fault, remedy));
    match (photographs.len(), &films[..]) {
        (1.., []) => Ok(Take::Stills(photographs)),
        (0, [film]) => Ok(Take::Film(film.clone())),
        (0, []) => invalid("holds no photographs and no film", "give a film, or a folder of .png or .jpg files"),
        (0, _) => invalid("holds several films", "name those that belong together one by one"),
        (stills, _) => {
            let fault = format!("holds both photographs ({stills}) and films ({})", films.len());
            invalid(&fault, "name the films one by one, or move the photographs or the films to a folder of their own")
        }
    }
}

/// Systems leave files of their own beside photographs, under names that begin with a dot.
fn is_hidden(path: &Path) -> bool {
    path.file_name().is_none_or(|name| name.to_string_lossy().starts_with('.'))
}
