//! Writes a capture folder: beside its place first, then renamed, so that it appears whole or not at all.

use crate::formats::transforms;
use crate::{Capture, CaptureError, Frame, Image, MaskSource, pixels};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Files that are written beside `transforms.json`, by name.
pub(crate) type Beside<'a> = [(&'a str, &'a [u8])];

/// What a capture folder may hold, and be replaced.
const OURS: [&str; 5] = ["transforms.json", "images", "masks", "report.html", "report.json"];

pub(crate) fn write(
    capture: &Capture,
    mattes: Option<&[Image<u8>]>,
    files: &Beside,
    dir: &Path,
) -> Result<(), CaptureError> {
    if let Some(mattes) = mattes.filter(|m| m.len() != capture.frames.len()) {
        let fault = format!("{} mattes were given for {} frames", mattes.len(), capture.frames.len());
        return Err(CaptureError::invalid(dir, fault, "load all views and pass their mattes"));
    }
    check_replaceable(dir)?;
    let parent = match dir.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    fs::create_dir_all(parent).map_err(|e| CaptureError::io(parent, e))?;
    let beside = tempfile::Builder::new().prefix(".turnlight-").tempdir_in(parent);
    let beside = beside.map_err(|e| CaptureError::io(parent, e))?;
    let staged = beside.path().join("capture");
    fill(capture, mattes, &staged)?;
    for (name, bytes) in files {
        let to = staged.join(name);
        fs::write(&to, bytes).map_err(|e| CaptureError::io(&to, e))?;
        sync(&to)?;
    }
    // The temporary folder keeps the replaced capture until it is dropped.
    if dir.exists() {
        let replaced = beside.path().join("replaced");
        fs::rename(dir, &replaced).map_err(|e| CaptureError::io(dir, e))?;
        return fs::rename(&staged, dir).map_err(|e| {
            // Best effort: the rename's own error is the one to report.
            let _ = fs::rename(&replaced, dir);
            CaptureError::io(dir, e)
        });
    }
    fs::rename(&staged, dir).map_err(|e| CaptureError::io(dir, e))
}

/// Refuses to replace what was not written here.
pub(crate) fn check_replaceable(dir: &Path) -> Result<(), CaptureError> {
    if !dir.exists() {
        return Ok(());
    }
    let foreign = |e: fs::DirEntry| !OURS.contains(&e.file_name().to_string_lossy().as_ref());
    let mut entries = fs::read_dir(dir).map_err(|e| CaptureError::io(dir, e))?;
    if entries.any(|entry| entry.map_or(true, foreign)) {
        return Err(CaptureError::invalid(dir, "exists and holds other files", "choose another name, or remove it"));
    }
    Ok(())
}

fn fill(capture: &Capture, mattes: Option<&[Image<u8>]>, dir: &Path) -> Result<(), CaptureError> {
    let has_masks = mattes.is_some() || capture.frames.iter().any(|f| f.mask_path.is_some());
    for folder in [Some("images"), has_masks.then_some("masks")].into_iter().flatten() {
        let folder = dir.join(folder);
        fs::create_dir_all(&folder).map_err(|e| CaptureError::io(&folder, e))?;
    }
    let names = unique_names(&capture.frames);
    let mut images = Vec::new();
    let mut masks = Vec::new();
    for (i, (frame, (stem, extension))) in capture.frames.iter().zip(&names).enumerate() {
        let image = PathBuf::from("images").join(format!("{stem}{extension}"));
        copy(&frame.image_path, &dir.join(&image))?;
        images.push(image);
        let mask = PathBuf::from("masks").join(format!("{stem}.png"));
        masks.push(write_mask(capture, frame, mattes.map(|m| &m[i]), &dir.join(&mask))?.then_some(mask));
    }
    let file = transforms::to_file(capture, &images, &masks);
    write_json(&file, &dir.join("transforms.json"))
}

/// Whether there was a mask to write.
fn write_mask(capture: &Capture, frame: &Frame, matte: Option<&Image<u8>>, to: &Path) -> Result<bool, CaptureError> {
    match (matte, &frame.mask_path) {
        (Some(matte), _) => pixels::write_matte(to, matte)?,
        (None, None) => return Ok(false),
        (None, Some(mask)) if capture.mask_source == MaskSource::InvertedDynamic => {
            pixels::write_matte(to, &pixels::read_matte(mask)?.map(|v| 255 - v))?;
        }
        // Not copied: a mask that is no PNG must not get a name that says so.
        (None, Some(mask)) => pixels::write_matte(to, &pixels::read_matte(mask)?)?,
    }
    sync(to)?;
    Ok(true)
}

fn write_json(file: &transforms::TransformsFile, to: &Path) -> Result<(), CaptureError> {
    let text = serde_json::to_string_pretty(file)
        .map_err(|e| CaptureError::invalid(to, format!("cannot be written: {e}"), "report this as a bug"))?;
    fs::write(to, text + "\n").map_err(|e| CaptureError::io(to, e))?;
    sync(to)
}

fn copy(from: &Path, to: &Path) -> Result<(), CaptureError> {
    fs::File::open(from).map_err(|e| CaptureError::io(from, e))?;
    fs::copy(from, to).map_err(|e| CaptureError::io(to, e))?;
    sync(to)
}

fn sync(path: &Path) -> Result<(), CaptureError> {
    let file = fs::OpenOptions::new().append(true).open(path).map_err(|e| CaptureError::io(path, e))?;
    file.sync_data().map_err(|e| CaptureError::io(path, e))
}

/// Stem and extension for every frame. Stems, not only names, are unique (`a.png` and `a.jpg` would share
/// a mask), also where the file system ignores case.
fn unique_names(frames: &[Frame]) -> Vec<(String, String)> {
    let mut taken = BTreeSet::new();
    let name = |(i, frame): (usize, &Frame)| {
        let part = |p: Option<&std::ffi::OsStr>| p.map(|s| s.to_string_lossy().into_owned());
        let stem = part(frame.image_path.file_stem()).unwrap_or_else(|| "frame".into());
        let extension = part(frame.image_path.extension()).map(|e| format!(".{e}")).unwrap_or_default();
        let mut unique = stem.clone();
        let mut attempt = i;
        while !taken.insert(unique.to_lowercase()) {
            unique = format!("{stem}_{attempt:04}");
            attempt += 1;
        }
        (unique, extension)
    };
    frames.iter().enumerate().map(name).collect()
}
