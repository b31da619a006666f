//! The object in every frame that was chosen.

use super::pictures::Pictures;
use super::{FootageOptions, Shots};
use crate::Error;
use capture::footage::{FrameSource, read_upright};
use capture::silhouette::{SilhouetteOptions, Silhouettes, StageSetup, check_silhouettes, find_silhouettes};
use capture::{Image, read_matte};
use std::path::Path;

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
            let mattes =
                kept.iter().map(|&at| given(folder, &shots.shots[at].source)).collect::<Result<Vec<_>, _>>()?;
            Ok(check_silhouettes(&mattes, &setup)?)
        }
        None => Ok(find_silhouettes(&|at| pictures.read(at), &setup, &SilhouetteOptions::default())?),
    }
}

fn setup(shots: &Shots, kept: &[usize], options: &FootageOptions) -> Result<StageSetup, Error> {
    let clean_plates = options.clean_plates.iter().map(|path| Ok(Some(clean_plate(path, shots.size)?)));
    Ok(StageSetup {
        cameras: kept.iter().filter_map(|&at| shots.shots[at].camera).collect(),
        segments: kept.iter().map(|&at| shots.shots[at].standpoint).collect(),
        has_plane: shots.has_plane,
        print: shots.print,
        clean_plates: clean_plates.collect::<Result<_, Error>>()?,
        aabb: None,
    })
}

fn clean_plate(path: &Path, [width, height]: [usize; 2]) -> Result<Image<[u8; 3]>, Error> {
    let plate = read_upright(path)?;
    check_size(path, [plate.width(), plate.height()], [width, height]).map(|()| plate)
}

/// The mask of a frame: `NAME.png`, `NAME.EXT.png` or `NAME.mask.png` of a photograph, the number of the frame (any
/// number of leading zeros) of a film.
pub(super) fn given(folder: &Path, source: &FrameSource) -> Result<Image<u8>, Error> {
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
    Ok(read_matte(&path.ok_or_else(missing)?)?)
}

fn check_size(path: &Path, [w, h]: [usize; 2], [width, height]: [usize; 2]) -> Result<(), Error> {
    if [w, h] == [width, height] {
        return Ok(());
    }
    let fault = format!("{}: is {w}x{h}, the frames are {width}x{height}", path.display());
    Err(Error::Failed(format!("{fault}; make it of the same size")))
}
