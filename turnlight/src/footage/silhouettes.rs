//! The object in every frame that was chosen.

use super::pictures::Pictures;
use super::{FootageOptions, Shots};
use crate::Error;
use capture::footage::{FrameSource, read_upright};
use capture::silhouette::{SilhouetteOptions, Silhouettes, StageSetup, check_silhouettes, find_silhouettes};
use capture::{Image, read_matte};
use std::path::{Path, PathBuf};

/// Finds the silhouettes, or reads and judges those given.
pub(super) fn find(
    pictures: &Pictures,
    shots: &Shots,
    kept: &[usize],
    options: &FootageOptions,
) -> Result<Silhouettes, Error> {
    let setup = setup(shots, kept, options)?;
    match &options.masks {
        Some(folder) => {
            let takes = shots.takes();
            let mask = |&at: &usize| given(folder, &shots.shots[at].source, takes, shots.size);
            let mattes = kept.iter().map(mask).collect::<Result<Vec<_>, _>>()?;
            Ok(check_silhouettes(&mattes, &setup)?)
        }
        None => Ok(find_silhouettes(&|at| pictures.read(at), &setup, &SilhouetteOptions::default())?),
    }
}

fn setup(shots: &Shots, kept: &[usize], options: &FootageOptions) -> Result<StageSetup, Error> {
    // Standpoints of which no frame was kept are none.
    let mut standpoints: Vec<usize> = kept.iter().filter_map(|&at| shots.shots[at].standpoint).collect();
    standpoints.sort_unstable();
    standpoints.dedup();
    let segment = |&at: &usize| shots.shots[at].standpoint.and_then(|s| standpoints.binary_search(&s).ok());
    Ok(StageSetup {
        cameras: kept.iter().filter_map(|&at| shots.shots[at].camera).collect(),
        segments: kept.iter().map(segment).collect(),
        has_plane: shots.has_plane,
        print: shots.print,
        clean_plates: clean_plates(shots, &standpoints, options)?,
        aabb: None,
        numbers: kept.to_vec(),
    })
}

/// Per standpoint the plate of its take: of a camera that was moved within a take only where it stood first.
fn clean_plates(
    shots: &Shots,
    standpoints: &[usize],
    options: &FootageOptions,
) -> Result<Vec<Option<Image<[u8; 3]>>>, Error> {
    if options.clean_plates.is_empty() {
        return Ok(Vec::new());
    }
    let segments = shots.standpoints();
    if segments.is_empty() || options.clean_plates.len() > shots.takes() {
        let fault = "--clean-plate: shows the set before a camera that stands still, one for every film or folder";
        return Err(Error::Arguments(format!("{fault}; leave it away for a camera that was carried")));
    }
    let plate = |&at: &usize| {
        let is_first = segments.iter().position(|s| s.film == segments[at].film) == Some(at);
        let path = options.clean_plates.get(segments[at].film).filter(|_| is_first);
        path.map(|path| clean_plate(path, shots.size)).transpose()
    };
    standpoints.iter().map(plate).collect()
}

fn clean_plate(path: &Path, size: [usize; 2]) -> Result<Image<[u8; 3]>, Error> {
    let plate = read_upright(path)?;
    check_size(path, [plate.width(), plate.height()], size).map(|()| plate)
}

/// The mask of a frame, of the frame's size.
fn given(folder: &Path, source: &FrameSource, takes: usize, size: [usize; 2]) -> Result<Image<u8>, Error> {
    let path = mask_of(folder, source, takes)?;
    let mask = read_matte(&path)?;
    check_size(&path, [mask.width(), mask.height()], size).map(|()| mask)
}

/// The file of a frame's mask: `NAME.png`, `NAME.EXT.png` or `NAME.mask.png` of a photograph, the number of the frame counted
/// from 0 (any number of leading zeros) of a film. Of several takes each has a folder of its name.
pub(super) fn mask_of(folder: &Path, source: &FrameSource, takes: usize) -> Result<PathBuf, Error> {
    let folder = if takes > 1 { folder.join(&source.take_name) } else { folder.to_owned() };
    let names = match &source.file {
        Some(file) => {
            let part = |p: Option<&std::ffi::OsStr>| p.map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
            let (stem, name) = (part(file.file_stem()), part(file.file_name()));
            vec![format!("{stem}.png"), format!("{name}.png"), format!("{stem}.mask.png")]
        }
        None => (1..=6).map(|digits| format!("{:0digits$}.png", source.index)).collect(),
    };
    let path = names.iter().map(|name| folder.join(name)).find(|path| path.is_file());
    let missing = || {
        let fault = format!("{}: has no mask for {} (looked for {})", folder.display(), source.name, names.join(", "));
        Error::Failed(format!("{fault}; add it, or leave the frame out of the footage"))
    };
    path.ok_or_else(missing)
}

/// Refuses a picture of another size than the frames.
pub(super) fn check_size(path: &Path, [w, h]: [usize; 2], [width, height]: [usize; 2]) -> Result<(), Error> {
    if [w, h] == [width, height] {
        return Ok(());
    }
    let fault = format!("{}: is {w}x{h}, the frames (or their cameras) are {width}x{height}", path.display());
    Err(Error::Failed(format!("{fault}; make it of the same size")))
}
