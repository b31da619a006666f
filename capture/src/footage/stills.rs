//! Photographs of a folder, in order, upright.

use super::Take;
use crate::{CaptureError, Image, pixels};
use std::cmp::Ordering;
use std::path::{Path, PathBuf};

const PHOTOGRAPHS: [&str; 6] = ["png", "jpg", "jpeg", "pnm", "ppm", "pgm"];
const FILMS: [&str; 7] = ["mp4", "mov", "m4v", "avi", "mkv", "webm", "mts"];

/// Reads a photograph and turns it as its EXIF orientation says: cameras note how they were held.
///
/// # Errors
/// When the file is missing, truncated or of an unknown kind.
pub fn read_upright(path: &Path) -> Result<Image<[u8; 3]>, CaptureError> {
    pixels::read_rgb_upright(path)
}

pub(super) fn is_photograph(path: &Path) -> bool {
    has_extension(path, &PHOTOGRAPHS)
}

fn has_extension(path: &Path, known: &[&str]) -> bool {
    path.extension().and_then(|e| e.to_str()).is_some_and(|e| known.contains(&e.to_ascii_lowercase().as_str()))
}

/// The photographs of a folder; the film, where it holds one film and no photograph.
pub(super) fn in_folder(folder: &Path) -> Result<Take, CaptureError> {
    let entries = std::fs::read_dir(folder).map_err(|e| CaptureError::io(folder, e))?;
    let mut files = Vec::new();
    for entry in entries {
        let path = entry.map_err(|e| CaptureError::io(folder, e))?.path();
        let is_hidden = path.file_name().is_none_or(|name| name.to_string_lossy().starts_with('.'));
        if path.is_file() && !is_hidden {
            files.push(path);
        }
    }
    let mut photographs: Vec<PathBuf> = files.iter().filter(|f| is_photograph(f)).cloned().collect();
    let films: Vec<&PathBuf> = files.iter().filter(|f| has_extension(f, &FILMS)).collect();
    photographs.sort_by(|a, b| in_natural_order(&name(a), &name(b)));
    match (photographs.len(), &films[..]) {
        (1.., _) => Ok(Take::Stills(photographs)),
        (0, [film]) => Ok(Take::Film((*film).clone())),
        (0, []) => Err(CaptureError::invalid(
            folder,
            "holds no photographs and no film",
            "give a film, or a folder of .png or .jpg files",
        )),
        _ => Err(CaptureError::invalid(folder, "holds several films", "name those that belong together one by one")),
    }
}

fn name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// `image_2` before `image_10`: runs of digits compare as numbers.
fn in_natural_order(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (parts(a).into_iter(), parts(b).into_iter());
    loop {
        let order = match (left.next(), right.next()) {
            (None, None) => return a.cmp(b),
            (None, Some(_)) => return Ordering::Less,
            (Some(_), None) => return Ordering::Greater,
            (Some(x), Some(y)) if is_number(x) && is_number(y) => {
                let [x, y] = [x, y].map(|digits| digits.trim_start_matches('0'));
                x.len().cmp(&y.len()).then(x.cmp(y))
            }
            (Some(x), Some(y)) => x.to_lowercase().cmp(&y.to_lowercase()),
        };
        if order != Ordering::Equal {
            return order;
        }
    }
}

fn is_number(part: &str) -> bool {
    part.starts_with(|c: char| c.is_ascii_digit())
}

/// Runs of digits and of anything else, in turn.
fn parts(text: &str) -> Vec<&str> {
    let mut parts = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let is_same = |c: char| c.is_ascii_digit() == first.is_ascii_digit();
        let end = rest.find(|c| !is_same(c)).unwrap_or(rest.len());
        let (part, more) = rest.split_at(end);
        parts.push(part);
        rest = more;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_are_counted_not_spelled() {
        let mut names =
            ["image_10.jpg", "image_2.jpg", "Image_1.jpg", "image_010b.jpg", "a.jpg", "image.jpg", "é9", "é10"];
        names.sort_by(|a, b| in_natural_order(a, b));
        let expected =
            ["a.jpg", "image.jpg", "Image_1.jpg", "image_2.jpg", "image_10.jpg", "image_010b.jpg", "é9", "é10"];
        assert_eq!(names, expected);
    }
}
