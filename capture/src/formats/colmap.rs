//! COLMAP models, text and binary: `cameras` and `images`. Poses are world to camera in our axes, pixel
//! coordinates count from the corner of the first pixel (colmap `sensor/models.h`): nothing is converted.

use super::{bad_line, capture, checked_camera, find_image, frame, numbers, read_text};
use crate::{Capture, CaptureError, Distortion, Frame, Intrinsics};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// COLMAP's camera models by number, with how many parameters each has.
const MODELS: [(&str, usize); 11] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
];

type Cameras = BTreeMap<i64, Intrinsics>;

/// One entry of `images`: where it stands in the file, and its numbers.
struct Pose<'a> {
    place: String,
    /// Quaternion (w, x, y, z), then translation.
    numbers: [f64; 7],
    camera: i64,
    name: &'a str,
}

pub(super) fn read_text_model(folder: &Path) -> Result<Capture, CaptureError> {
    let cameras = cameras_from_text(&folder.join("cameras.txt"))?;
    let file = folder.join("images.txt");
    let text = read_text(&file)?;
    let mut frames = Vec::new();
    let mut lines = text.lines().enumerate().map(|(i, l)| (i + 1, l.trim()));
    while let Some((line, header)) = lines.next() {
        if header.is_empty() || header.starts_with('#') {
            continue;
        }
        // The second line of an image holds its points and may be empty: skipped unread.
        lines.next();
        let pose = pose_from_line(&file, line, header)?;
        frames.push(read_frame(&file, folder, &cameras, &pose)?);
    }
    Ok(capture(frames))
}

pub(super) fn read_binary(folder: &Path) -> Result<Capture, CaptureError> {
    let cameras = cameras_from_binary(&folder.join("cameras.bin"))?;
    let file = folder.join("images.bin");
    let bytes = std::fs::read(&file).map_err(|e| CaptureError::io(&file, e))?;
    let mut bytes = Bytes { file: &file, rest: &bytes };
    let count = bytes.count(64)?;
    let mut frames = Vec::with_capacity(count);
    for index in 0..count {
        bytes.i32()?;
        let mut numbers = [0.0; 7];
        for n in &mut numbers {
            *n = bytes.f64()?;
        }
        let camera = i64::from(bytes.i32()?);
        let name = bytes.name()?;
        let points = bytes.count(24)?;
        bytes.take(points * 24)?;
        let pose = Pose { place: format!("image {index} ({})", super::shortened(name)), numbers, camera, name };
        frames.push(read_frame(&file, folder, &cameras, &pose)?);
    }
    Ok(capture(frames))
}

fn pose_from_line<'a>(file: &Path, line: usize, text: &'a str) -> Result<Pose<'a>, CaptureError> {
    let short = || bad_line(file, line, "\"id qw qx qy qz tx ty tz camera name\" is expected");
    let mut rest = text;
    let mut next = || {
        let (word, after) = rest.trim_start().split_once(char::is_whitespace)?;
        rest = after;
        Some(word)
    };
    let words: Vec<&str> = (0..9).map_while(|_| next()).collect();
    // A name may hold blanks: it is the rest of the line.
    let name = rest.trim();
    let n = numbers(file, line, words.iter().copied())?;
    let numbers: [f64; 7] = n.get(1..8).and_then(|s| s.try_into().ok()).ok_or_else(short)?;
    let camera = words.get(8).and_then(|w| w.parse().ok()).ok_or_else(short)?;
    if name.is_empty() {
        return Err(short());
    }
    Ok(Pose { place: format!("line {line}"), numbers, camera, name })
}

fn read_frame(file: &Path, folder: &Path, cameras: &Cameras, pose: &Pose<'_>) -> Result<Frame, CaptureError> {
    let invalid = |fault: String, remedy: &str| CaptureError::invalid(file, format!("{}: {fault}", pose.place), remedy);
    let intrinsics = cameras
        .get(&pose.camera)
        .ok_or_else(|| invalid(format!("camera {} is not in cameras", pose.camera), "export the model again"))?;
    let [w, x, y, z, tx, ty, tz] = pose.numbers;
    let q = Quaternion::new(w, x, y, z);
    // The negated form refuses NaN too.
    if !(q.norm() >= 1e-6 && q.norm().is_finite()) {
        return Err(invalid("its quaternion has no length".into(), "export the model again"));
    }
    let rotation: Matrix3<f64> = UnitQuaternion::from_quaternion(q).to_rotation_matrix().into_inner();
    let camera = checked_camera(file, &pose.place, *intrinsics, rotation, Vector3::new(tx, ty, tz))?;
    Ok(frame(image_path(folder, pose.name), camera))
}

/// Images lie in `images/` beside the model or above it, or wherever the model's folder is.
fn image_path(folder: &Path, name: &str) -> PathBuf {
    let above = folder.ancestors().take(4);
    let places = above.flat_map(|a| [a.join("images"), a.to_owned()]);
    places.into_iter().find_map(|place| find_image(&place, name)).unwrap_or_else(|| folder.join("images").join(name))
}

fn cameras_from_text(file: &Path) -> Result<Cameras, CaptureError> {
    let text = read_text(file)?;
    let mut cameras = Cameras::new();
    for (i, line) in text.lines().enumerate() {
        let words: Vec<&str> = line.split_whitespace().collect();
        if words.is_empty() || words[0].starts_with('#') {
            continue;
        }
        let [id, model, w, h, params @ ..] = words.as_slice() else {
            return Err(bad_line(file, i + 1, "\"id MODEL width height parameters\" is expected"));
        };
        let (Ok(id), Ok(w), Ok(h)) = (id.parse(), w.parse(), h.parse()) else {
            return Err(bad_line(file, i + 1, "id, width or height is no whole number"));
        };
        let n = numbers(file, i + 1, params.iter().copied())?;
        cameras.insert(id, intrinsics(file, &format!("line {}", i + 1), model, w, h, &n)?);
    }
    Ok(cameras)
}

fn cameras_from_binary(file: &Path) -> Result<Cameras, CaptureError> {
    let bytes = std::fs::read(file).map_err(|e| CaptureError::io(file, e))?;
    let mut bytes = Bytes { file, rest: &bytes };
    let mut cameras = Cameras::new();
    for index in 0..bytes.count(48)? {
        let id = i64::from(bytes.i32()?);
        let number = bytes.i32()?;
        let (w, h) = (bytes.u64()? as usize, bytes.u64()? as usize);
        let (model, count) =
            usize::try_from(number).ok().and_then(|n| MODELS.get(n)).copied().unwrap_or(("unknown", 0));
        let params = (0..count).map(|_| bytes.f64()).collect::<Result<Vec<_>, _>>()?;
        cameras.insert(id, intrinsics(file, &format!("camera {index}"), model, w, h, &params)?);
    }
    Ok(cameras)
}

fn intrinsics(
    file: &Path,
    place: &str,
    model: &str,
    width: usize,
    height: usize,
    p: &[f64],
) -> Result<Intrinsics, CaptureError> {
    let invalid = |fault: String| {
        let remedy = "calibrate with OPENCV, or undistort the images (colmap image_undistorter)";
        CaptureError::invalid(file, format!("{place}: {fault}"), remedy)
    };
    let with = |fx, fy, cx, cy, distortion| Intrinsics { fx, fy, skew: 0.0, cx, cy, distortion, width, height };
    let radial = |k1, k2| Distortion { k1, k2, ..Distortion::default() };
    Ok(match (model, p) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => with(f, f, cx, cy, Distortion::default()),
        ("PINHOLE", &[fx, fy, cx, cy]) => with(fx, fy, cx, cy, Distortion::default()),
        ("SIMPLE_RADIAL", &[f, cx, cy, k]) => with(f, f, cx, cy, radial(k, 0.0)),
        ("RADIAL", &[f, cx, cy, k1, k2]) => with(f, f, cx, cy, radial(k1, k2)),
        ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => with(fx, fy, cx, cy, Distortion { k1, k2, p1, p2, k3: 0.0 }),
        ("FULL_OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6]) => {
            if [k4, k5, k6] != [0.0; 3] {
                return Err(invalid("the rational coefficients k4 to k6 are not supported".into()));
            }
            with(fx, fy, cx, cy, Distortion { k1, k2, p1, p2, k3 })
        }
        _ if MODELS[..5].iter().chain(&MODELS[6..7]).any(|(name, _)| *name == model) => {
            return Err(invalid(format!("{model} has not {} parameters", p.len())));
        }
        _ => return Err(invalid(format!("the camera model '{}' is not supported", super::shortened(model)))),
    })
}

/// Little-endian numbers of a file, each read checked against what is left.
struct Bytes<'a> {
    file: &'a Path,
    rest: &'a [u8],
}

impl<'a> Bytes<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], CaptureError> {
        let (taken, rest) = self.rest.split_at_checked(count).ok_or_else(|| self.truncated())?;
        self.rest = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], CaptureError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    fn i32(&mut self) -> Result<i32, CaptureError> {
        Ok(i32::from_le_bytes(self.array()?))
    }

    fn u64(&mut self) -> Result<u64, CaptureError> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    fn f64(&mut self) -> Result<f64, CaptureError> {
        Ok(f64::from_le_bytes(self.array()?))
    }

    /// A count of entries of at least `size` bytes each; the rest of the file must be able to hold them.
    fn count(&mut self, size: usize) -> Result<usize, CaptureError> {
        let count = self.u64()?;
        if count > (self.rest.len() / size) as u64 {
            return Err(self.truncated());
        }
        Ok(count as usize)
    }

    /// A text that ends with a zero byte.
    fn name(&mut self) -> Result<&'a str, CaptureError> {
        let end = self.rest.iter().position(|&b| b == 0).ok_or_else(|| self.truncated())?;
        let name = self.take(end)?;
        self.take(1)?;
        std::str::from_utf8(name)
            .map_err(|e| CaptureError::invalid(self.file, format!("an image name is no text ({e})"), "export it again"))
    }

    fn truncated(&self) -> CaptureError {
        CaptureError::invalid(self.file, "is truncated, or no COLMAP file", "export the model again")
    }
}
