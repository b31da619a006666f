//! Readers of foreign calibrations, one file per format.
//!
//! Every conversion of pixel origins and axes lives here and nowhere else. Inside the crate the corner
//! of the first pixel is (0, 0); sources with (0, 0) at its centre gain one half here.

mod colmap;
mod matlab;
mod middlebury;
mod projections;
pub(crate) mod transforms;

use crate::{Camera, Capture, CaptureError, Frame, Intrinsics, MaskSource, pixels};
use nalgebra::{Matrix3, Vector3};
use std::cmp::Ordering;
use std::fmt;
use std::path::{Path, PathBuf};

/// The kinds of calibrated folder that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CaptureFormat {
    /// `transforms.json` of nerfstudio, instant-ngp or the original NeRF.
    Transforms,
    /// COLMAP's `cameras.bin` and `images.bin`.
    ColmapBinary,
    /// COLMAP's `cameras.txt` and `images.txt`.
    ColmapText,
    /// Middlebury's `NAME_par.txt`.
    Middlebury,
    /// `projections.txt`: an image name and twelve numbers a line.
    ProjectionList,
    /// One text file of twelve numbers per image.
    ProjectionFiles,
    /// A MATLAB 5 file with a cell array of 3×4 matrices.
    Matlab,
}

impl fmt::Display for CaptureFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Transforms => "transforms.json",
            Self::ColmapBinary => "COLMAP (binary)",
            Self::ColmapText => "COLMAP (text)",
            Self::Middlebury => "Middlebury par file",
            Self::ProjectionList => "projection matrices (list)",
            Self::ProjectionFiles => "projection matrices (a file per image)",
            Self::Matlab => "projection matrices (MATLAB)",
        })
    }
}

/// The calibration file (or COLMAP model folder) that `path` is or holds, and its kind.
///
/// # Errors
/// When there is none; the message lists what was looked for.
pub fn detect_format(path: &Path) -> Result<(CaptureFormat, PathBuf), CaptureError> {
    if path.is_dir() {
        return detect_in_folder(path)?.ok_or_else(|| no_capture(path));
    }
    std::fs::metadata(path).map_err(|e| CaptureError::io(path, e))?;
    detect_file(path).ok_or_else(|| no_capture(path))
}

pub(crate) fn read(path: &Path) -> Result<Capture, CaptureError> {
    let (format, file) = detect_format(path)?;
    let mut capture = match format {
        CaptureFormat::Transforms => transforms::read(&file)?,
        CaptureFormat::ColmapBinary => colmap::read_binary(&file)?,
        CaptureFormat::ColmapText => colmap::read_text_model(&file)?,
        CaptureFormat::Middlebury => middlebury::read(&file)?,
        CaptureFormat::ProjectionList => projections::read_list(&file)?,
        CaptureFormat::ProjectionFiles => projections::read_files(&file)?,
        CaptureFormat::Matlab => matlab::read(&file)?,
    };
    if capture.frames.is_empty() {
        return Err(CaptureError::invalid(&file, "lists no frames", "calibrate at least one image"));
    }
    if format != CaptureFormat::Transforms {
        // Folder formats list frames by id or at random; their names say the order of shooting.
        capture.frames.sort_by(|a, b| natural_order(&file_name(&a.image_path), &file_name(&b.image_path)));
    }
    Ok(capture)
}

fn detect_in_folder(folder: &Path) -> Result<Option<(CaptureFormat, PathBuf)>, CaptureError> {
    let mut files = list(folder)?;
    files.sort_by(|a, b| natural_order(&file_name(a), &file_name(b)));
    if let Some(file) = transforms_file(&files) {
        return Ok(Some((CaptureFormat::Transforms, file)));
    }
    for model in ["", "sparse/0", "sparse", "colmap/sparse/0", "colmap/sparse"] {
        if let Some(found) = colmap_model(&folder.join(model)) {
            return Ok(Some(found));
        }
    }
    for wanted in [
        CaptureFormat::Middlebury,
        CaptureFormat::ProjectionList,
        CaptureFormat::ProjectionFiles,
        CaptureFormat::Matlab,
    ] {
        if let Some(file) = files.iter().find(|f| f.is_file() && kind_by_name(f) == Some(wanted)) {
            let is_set = wanted == CaptureFormat::ProjectionFiles;
            return Ok(Some((wanted, if is_set { folder.to_owned() } else { file.clone() })));
        }
    }
    Ok(None)
}

fn detect_file(file: &Path) -> Option<(CaptureFormat, PathBuf)> {
    let folder = file.parent().unwrap_or(Path::new(""));
    match kind_by_name(file)? {
        kind @ (CaptureFormat::ColmapBinary | CaptureFormat::ColmapText | CaptureFormat::ProjectionFiles) => {
            Some((kind, folder.to_owned()))
        }
        kind => Some((kind, file.to_owned())),
    }
}

fn kind_by_name(file: &Path) -> Option<CaptureFormat> {
    let name = file_name(file);
    let extension = file.extension().and_then(|e| e.to_str()).unwrap_or_default();
    match name.as_str() {
        "cameras.bin" | "images.bin" => Some(CaptureFormat::ColmapBinary),
        "cameras.txt" | "images.txt" => Some(CaptureFormat::ColmapText),
        "projections.txt" => Some(CaptureFormat::ProjectionList),
        _ if name.ends_with("_par.txt") => Some(CaptureFormat::Middlebury),
        _ => match extension {
            "json" => Some(CaptureFormat::Transforms),
            "pa" | "P" | "proj" => Some(CaptureFormat::ProjectionFiles),
            "mat" => Some(CaptureFormat::Matlab),
            _ => None,
        },
    }
}

/// `transforms.json`, or the only `transforms*.json`, or that of the training views.
fn transforms_file(files: &[PathBuf]) -> Option<PathBuf> {
    let is_candidate = |name: &str| name.starts_with("transforms") && name.ends_with(".json");
    let candidates: Vec<&PathBuf> = files.iter().filter(|f| f.is_file() && is_candidate(&file_name(f))).collect();
    let named = |name: &str| candidates.iter().find(|f| file_name(f) == name);
    let only = if candidates.len() == 1 { candidates.first() } else { None };
    named("transforms.json").or(only).or(named("transforms_train.json")).map(|f| (*f).clone())
}

fn colmap_model(folder: &Path) -> Option<(CaptureFormat, PathBuf)> {
    let has = |name: &str| folder.join(name).is_file();
    if has("cameras.bin") && has("images.bin") {
        return Some((CaptureFormat::ColmapBinary, folder.to_owned()));
    }
    (has("cameras.txt") && has("images.txt")).then(|| (CaptureFormat::ColmapText, folder.to_owned()))
}

fn no_capture(path: &Path) -> CaptureError {
    CaptureError::invalid(
        path,
        "is no capture: looked for transforms.json, COLMAP's cameras and images (.bin, .txt; also in sparse/0), \
         Middlebury's *_par.txt, projections.txt, *.pa and *.mat",
        "give the folder or the file of a calibration",
    )
}

// ---- What the readers share ----

/// Where a source puts the origin of pixel coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Origin {
    /// Centre of the first pixel: gains one half.
    PixelCentre,
}

/// Coordinates gained by the move to corner origin.
fn half_pixel(origin: Origin) -> f64 {
    match origin {
        Origin::PixelCentre => 0.5,
    }
}

/// A calibrated frame without the optional parts.
fn frame(image_path: PathBuf, camera: Camera) -> Frame {
    Frame { image_path, mask_path: None, camera, light_direction: None, exposure: None }
}

fn capture(frames: Vec<Frame>) -> Capture {
    Capture { frames, aabb: None, unit: None, mask_source: MaskSource::Automatic }
}

/// Largest deviation of `R Rᵀ` from 1 that rounding in a file can explain.
const ROTATION_TOLERANCE: f64 = 1e-2;

/// Longest side of an image in pixels that is believed.
const MAX_SIDE: usize = 1 << 17;

/// Checks a camera from a file, and makes its rotation exact.
fn checked_camera(
    file: &Path,
    place: &str,
    intrinsics: Intrinsics,
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
) -> Result<Camera, CaptureError> {
    let invalid = |fault: &str, remedy: &str| CaptureError::invalid(file, format!("{place}: {fault}"), remedy);
    let i = &intrinsics;
    let d = i.distortion;
    let lens = [i.fx, i.fy, i.skew, i.cx, i.cy, d.k1, d.k2, d.k3, d.p1, d.p2];
    if lens.iter().chain(rotation.iter()).chain(translation.iter()).any(|v| !v.is_finite()) {
        return Err(invalid("a camera number is not finite", "calibrate again, or leave the frame out"));
    }
    if i.fx <= 0.0 || i.fy <= 0.0 {
        let fault = format!("the focal length {} x {} is not positive", i.fx, i.fy);
        return Err(invalid(&fault, "give it in pixels"));
    }
    if !(1..=MAX_SIDE).contains(&i.width) || !(1..=MAX_SIDE).contains(&i.height) {
        let fault = format!("the image size {}x{} is not usable", i.width, i.height);
        return Err(invalid(&fault, "give the width and height in pixels"));
    }
    let deviation = (rotation * rotation.transpose() - Matrix3::identity()).amax();
    if deviation > ROTATION_TOLERANCE {
        let fault = format!("its rotation is none: R Rᵀ differs from 1 by {deviation:.2e}");
        return Err(invalid(&fault, "remove scale and shear from the pose"));
    }
    if rotation.determinant() < 0.0 {
        return Err(invalid("its rotation mirrors (determinant −1)", "flip one axis of the pose, not of the image"));
    }
    let rotation = if deviation > 1e-12 { nearest_rotation(rotation) } else { rotation };
    Ok(Camera { intrinsics, rotation, translation })
}

/// The rotation with the smallest sum of squared differences (orthogonal Procrustes).
fn nearest_rotation(matrix: Matrix3<f64>) -> Matrix3<f64> {
    let svd = matrix.svd(true, true);
    match (svd.u, svd.v_t) {
        (Some(u), Some(v_t)) => u * v_t,
        _ => matrix,
    }
}

pub(crate) const IMAGE_EXTENSIONS: [&str; 12] =
    ["png", "jpg", "jpeg", "ppm", "pgm", "pnm", "PNG", "JPG", "JPEG", "PPM", "PGM", "PNM"];

/// The images in a folder, masks left out, in the order a person counts.
pub(crate) fn images_in(folder: &Path) -> Result<Vec<PathBuf>, CaptureError> {
    let is_dynamic_mask = |path: &Path| file_name(path).starts_with("dynamic_mask_");
    let mut images: Vec<PathBuf> = list(folder)?.into_iter().filter(|p| is_image(p) && !is_dynamic_mask(p)).collect();
    images.sort_by(|a, b| natural_order(&file_name(a), &file_name(b)));
    Ok(images)
}

fn is_image(path: &Path) -> bool {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    let is_mask = path.file_stem().and_then(|s| s.to_str()).is_some_and(|s| s.ends_with(".mask"));
    path.is_file() && IMAGE_EXTENSIONS.contains(&extension) && !is_mask
}

/// The image file a calibration means by `name`: as written, or with another extension, or with one added.
fn find_image(folder: &Path, name: &str) -> Option<PathBuf> {
    // Windows tools write back slashes.
    let path = folder.join(name.replace('\\', "/"));
    if path.is_file() {
        return Some(path);
    }
    let appended = |e: &&str| {
        let mut text = path.clone().into_os_string();
        text.push(".");
        text.push(e);
        PathBuf::from(text)
    };
    let added = IMAGE_EXTENSIONS.iter().map(appended);
    let replaced = IMAGE_EXTENSIONS.iter().map(|e| path.with_extension(e));
    added.chain(replaced).find(|p| p.is_file())
}

/// As [`find_image`]; an error where the image size is needed and there is no image to ask.
fn image_and_size(file: &Path, folder: &Path, name: &str) -> Result<(PathBuf, usize, usize), CaptureError> {
    let path = find_image(folder, name).ok_or_else(|| {
        let missing = folder.join(name);
        let fault = format!("the image named in {} does not exist", file.display());
        CaptureError::invalid(&missing, fault, "copy the image there, or remove it from the calibration")
    })?;
    let (width, height) = pixels::size_of(&path)?;
    Ok((path, width, height))
}

fn read_text(file: &Path) -> Result<String, CaptureError> {
    let bytes = std::fs::read(file).map_err(|e| CaptureError::io(file, e))?;
    String::from_utf8(bytes)
        .map_err(|e| CaptureError::invalid(file, format!("is no text ({e})"), "give the calibration as text"))
}

/// Finite numbers of one line.
fn numbers<'a>(file: &Path, line: usize, words: impl Iterator<Item = &'a str>) -> Result<Vec<f64>, CaptureError> {
    words
        .map(|word| match word.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(bad_line(file, line, &format!("'{}' is not a finite number", shortened(word)))),
        })
        .collect()
}

fn bad_line(file: &Path, line: usize, fault: &str) -> CaptureError {
    CaptureError::invalid(file, format!("line {line}: {fault}"), "correct the line, or remove the frame")
}

fn shortened(word: &str) -> String {
    word.chars().take(40).collect()
}

pub(crate) fn list(folder: &Path) -> Result<Vec<PathBuf>, CaptureError> {
    let entries = std::fs::read_dir(folder).map_err(|e| CaptureError::io(folder, e))?;
    entries.map(|entry| entry.map(|e| e.path()).map_err(|e| CaptureError::io(folder, e))).collect()
}

fn file_name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Order in which `image_2` comes before `image_10`: runs of digits compare as numbers.
pub(crate) fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut a_rest, mut b_rest) = (a, b);
    loop {
        let (a_run, b_run) = (next_run(&mut a_rest), next_run(&mut b_rest));
        let order = match (a_run, b_run) {
            (None, None) => return a.cmp(b),
            (None, Some(_)) => return Ordering::Less,
            (Some(_), None) => return Ordering::Greater,
            (Some(a_run), Some(b_run)) => compare_runs(a_run, b_run),
        };
        if order != Ordering::Equal {
            return order;
        }
    }
}

fn next_run<'a>(rest: &mut &'a str) -> Option<&'a str> {
    let first = rest.chars().next()?;
    let end = rest.find(|c: char| c.is_ascii_digit() != first.is_ascii_digit()).unwrap_or(rest.len());
    let (run, after) = rest.split_at(end);
    *rest = after;
    Some(run)
}

fn compare_runs(a: &str, b: &str) -> Ordering {
    let is_number = |s: &str| s.starts_with(|c: char| c.is_ascii_digit());
    if !(is_number(a) && is_number(b)) {
        return a.cmp(b);
    }
    let (a, b) = (a.trim_start_matches('0'), b.trim_start_matches('0'));
    a.len().cmp(&b.len()).then_with(|| a.cmp(b))
}

#[cfg(test)]
mod tests;
