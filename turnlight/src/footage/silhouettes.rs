//! The object in every frame that was chosen: as masks from elsewhere or the alpha of the photographs say, else found.

use super::pictures::Pictures;
use super::{FootageOptions, Shots};
use crate::Error;
use capture::footage::{FrameSource, read_upright, read_upright_alpha};
use capture::silhouette::{
    Evidence, SilhouetteOptions, Silhouettes, StageSetup, check_silhouettes, clean_plate_likeness, find_silhouettes,
};
use capture::{Image, has_transparency, read_matte};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Frames that a clean plate is held against.
const PLATE_WITNESSES: usize = 12;

/// The share of the border that a clean plate has to show: where the camera is near, the table, which is no part of the
/// plate, reaches out of the frame on three sides.
const LEAST_LIKENESS: f64 = 0.2;

/// Finds the silhouettes, or reads and judges those given.
pub(super) fn find(
    pictures: &Pictures,
    shots: &Shots,
    kept: &[usize],
    options: &FootageOptions,
) -> Result<Silhouettes, Error> {
    let setup = setup(pictures, shots, kept, options)?;
    let sources: Vec<&FrameSource> = kept.iter().map(|&at| &shots.shots[at].source).collect();
    match (&options.masks, with_alpha(&sources)) {
        (Some(folder), _) => {
            let mask = |source: &&FrameSource| given(folder, source, shots.takes(), shots.size);
            let mattes = sources.iter().map(mask).collect::<Result<Vec<_>, _>>()?;
            Ok(check_silhouettes(&mattes, &setup)?)
        }
        (None, Some(files)) => {
            let mattes = files.iter().map(|file| read_upright_alpha(file)).collect::<Result<Vec<_>, _>>()?;
            Ok(Silhouettes { evidence: Evidence::Alpha, ..check_silhouettes(&mattes, &setup)? })
        }
        (None, None) => Ok(find_silhouettes(&|at| pictures.read(at), &setup, &SilhouetteOptions::default())?),
    }
}

/// The files of the photographs, where their alpha says what the object is: not where there are films among them, nor where
/// it is opaque everywhere. As for captures that are read, the first speaks for all.
pub(super) fn with_alpha<'a>(sources: &[&'a FrameSource]) -> Option<Vec<&'a Path>> {
    let files: Vec<&Path> = sources.iter().map(|source| source.file.as_deref()).collect::<Option<_>>()?;
    files.first().is_some_and(|first| has_transparency(first)).then_some(files)
}

fn setup(pictures: &Pictures, shots: &Shots, kept: &[usize], options: &FootageOptions) -> Result<StageSetup, Error> {
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
        clean_plates: clean_plates(pictures, shots, kept, &standpoints, options)?,
        aabb: None,
        numbers: kept.to_vec(),
    })
}

/// Per standpoint the plate of its take: of a camera that was moved within a take only where it stood first.
fn clean_plates(
    pictures: &Pictures,
    shots: &Shots,
    kept: &[usize],
    standpoints: &[usize],
    options: &FootageOptions,
) -> Result<Vec<Option<Image<[u8; 3]>>>, Error> {
    if options.clean_plates.is_empty() {
        return Ok(Vec::new());
    }
    let places = &shots.standpoints;
    if places.is_empty() || options.clean_plates.len() > shots.takes() {
        let fault = "--clean-plate: shows the set before a camera that stands still, one for every film or folder";
        return Err(Error::Arguments(format!("{fault}; leave it away for a camera that was carried")));
    }
    let plate = |&at: &usize| {
        let is_first = places.iter().position(|place| place.take == places[at].take) == Some(at);
        let path = options.clean_plates.get(places[at].take).filter(|_| is_first);
        let before_it = || (0..kept.len()).filter(|&i| shots.shots[kept[i]].standpoint == Some(at)).collect();
        path.map(|path| clean_plate(path, shots.size, pictures, before_it())).transpose()
    };
    standpoints.iter().map(plate).collect()
}

/// Reads a plate, and refuses one that shows another set than the pictures at positions `frames`.
fn clean_plate(
    path: &Path,
    size: [usize; 2],
    pictures: &Pictures,
    frames: Vec<usize>,
) -> Result<Image<[u8; 3]>, Error> {
    let plate = read_upright(path)?;
    check_size(path, [plate.width(), plate.height()], size)?;
    let step = frames.len().div_ceil(PLATE_WITNESSES).max(1);
    let witnesses: Vec<_> = frames.par_iter().step_by(step).map(|&at| pictures.read(at)).collect();
    let witnesses: Vec<Image<[u8; 3]>> = witnesses.into_iter().collect::<Result<_, _>>()?;
    match clean_plate_likeness(&plate, &witnesses) {
        Some(likeness) if likeness < LEAST_LIKENESS => {
            let alike = 100.0 * likeness;
            let fault = format!("{}: is no picture of this set: of what stays the same", path.display());
            let shown = format!("at the border of the frames it shows {alike:.0} %");
            let remedy = "take it with the camera as it stood, in the same light, or leave --clean-plate away";
            Err(Error::Failed(format!("{fault} {shown}; {remedy}")))
        }
        _ => Ok(plate),
    }
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
