//! Finds the silhouette files of a capture under every spelling in use.

use crate::{CaptureError, Frame, pixels};
use std::fmt;
use std::path::{Path, PathBuf};

/// Where the silhouettes of a capture come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MaskSource {
    /// None given: found in the photographs.
    #[default]
    Automatic,
    /// `mask_path` in `transforms.json`.
    MaskPath,
    /// `masks/IMAGE.EXT.png`, the spelling of COLMAP.
    MasksImageExt,
    /// `masks/IMAGE.png`.
    MasksImage,
    /// `IMAGE.mask.png` beside the image.
    Beside,
    /// The alpha channel of the images.
    Alpha,
    /// `dynamic_mask_IMAGE.png` beside the image, the spelling of instant-ngp: non-zero is *not* object.
    InvertedDynamic,
}

impl fmt::Display for MaskSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Automatic => "no masks given, silhouettes found in the photographs",
            Self::MaskPath => "masks named by mask_path",
            Self::MasksImageExt => "masks in masks/IMAGE.EXT.png",
            Self::MasksImage => "masks in masks/IMAGE.png",
            Self::Beside => "masks in IMAGE.mask.png",
            Self::Alpha => "masks from the alpha channel of the images",
            Self::InvertedDynamic => "masks in dynamic_mask_IMAGE.png, inverted",
        })
    }
}

/// The spellings that are files, in the order in which they are tried.
const FILES: [MaskSource; 4] =
    [MaskSource::MasksImageExt, MaskSource::MasksImage, MaskSource::Beside, MaskSource::InvertedDynamic];

/// Fills in `mask_path` of all frames by the first spelling that any of them has.
pub(crate) fn find(frames: &mut [Frame]) -> Result<MaskSource, CaptureError> {
    if frames.iter().any(|f| f.mask_path.is_some()) {
        return all_or_error(frames, MaskSource::MaskPath);
    }
    for source in FILES {
        if source == MaskSource::InvertedDynamic && has_alpha_mask(frames) {
            return Ok(MaskSource::Alpha);
        }
        let found: Vec<_> = frames.iter().map(|f| spelled(&f.image_path, source)).collect();
        if found.iter().any(Option::is_some) {
            frames.iter_mut().zip(found).for_each(|(frame, mask)| frame.mask_path = mask);
            return all_or_error(frames, source);
        }
    }
    Ok(MaskSource::Automatic)
}

/// Half a set of masks would give frames whose silhouettes mean different things.
fn all_or_error(frames: &[Frame], source: MaskSource) -> Result<MaskSource, CaptureError> {
    let Some(missing) = frames.iter().find(|f| f.mask_path.is_none()) else { return Ok(source) };
    let given = frames.iter().filter(|f| f.mask_path.is_some()).count();
    Err(CaptureError::invalid(
        &missing.image_path,
        format!("has no mask, while {given} of {} frames have ({source})", frames.len()),
        "give every frame a mask, or none",
    ))
}

fn spelled(image: &Path, source: MaskSource) -> Option<PathBuf> {
    let name = image.file_name()?.to_str()?;
    let stem = image.file_stem()?.to_str()?;
    let beside = image.parent()?;
    let file = match source {
        MaskSource::MasksImageExt => format!("{name}.png"),
        MaskSource::MasksImage => format!("{stem}.png"),
        MaskSource::Beside => format!("{stem}.mask.png"),
        MaskSource::InvertedDynamic => format!("dynamic_mask_{stem}.png"),
        MaskSource::Automatic | MaskSource::MaskPath | MaskSource::Alpha => return None,
    };
    let candidates = match source {
        MaskSource::MasksImageExt | MaskSource::MasksImage => {
            [Some(beside.join("masks").join(&file)), beside.parent().map(|up| up.join("masks").join(&file))]
        }
        _ => [Some(beside.join(&file)), None],
    };
    candidates.into_iter().flatten().find(|path| path.is_file())
}

/// An alpha channel that is opaque everywhere says nothing; the first frame speaks for all.
fn has_alpha_mask(frames: &[Frame]) -> bool {
    frames.first().is_some_and(|f| pixels::has_transparency(&f.image_path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_spelling_is_found() {
        for (file, source) in [
            ("masks/a.b.jpg.png", MaskSource::MasksImageExt),
            ("masks/a.b.png", MaskSource::MasksImage),
            ("images/a.b.mask.png", MaskSource::Beside),
            ("images/dynamic_mask_a.b.png", MaskSource::InvertedDynamic),
        ] {
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, "").unwrap();
            let found = spelled(&dir.path().join("images/a.b.jpg"), source);
            assert_eq!(found, Some(path), "{source}");
        }
    }
}
