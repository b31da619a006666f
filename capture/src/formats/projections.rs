//! 3×4 projection matrices: `projections.txt` (a name and twelve numbers a line, row-major) or one text
//! file of twelve numbers per image.
//!
//! The pixel origin is documented nowhere. Matrices of this kind come from programs that count pixel centres
//! as integers (MATLAB, OpenCV), so they gain one half here, and so do Middlebury's. Measured with
//! `doctor` (share of silhouette rays that meet all views, gained by +½ over none): temple +0.03, dinosaur
//! +0.05, Oxford +0.04, squirrel 0.00, David −0.16. It does not decide: calibration errors of these sets
//! exceed half a pixel, where the exact captures peak at the right origin; and Oxford's masks are moved
//! against its photographs by more.

use super::{Origin, bad_line, capture, checked_camera, file_name, frame, half_pixel, image_and_size, kind_by_name};
use super::{list, natural_order, numbers, read_text};
use crate::votes::nearest_to_rays;
use crate::{Capture, CaptureError, CaptureFormat, Distortion, Frame, Intrinsics};
use nalgebra::{Matrix3, Matrix3x4, Point2, Vector3};
use std::path::{Path, PathBuf};

pub(super) fn read_list(file: &Path) -> Result<Capture, CaptureError> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let text = read_text(file)?;
    let lines = text.lines().enumerate().map(|(i, l)| (i + 1, l.trim()));
    let used = lines.filter(|(_, l)| !l.is_empty() && !l.starts_with('#'));
    let frames = used.map(|(line, text)| {
        let mut words = text.split_whitespace();
        let name = words.next().unwrap_or_default();
        let matrix = matrix(file, line, &numbers(file, line, words)?)?;
        projection_frame(file, folder, name, &format!("line {line}"), &matrix)
    });
    Ok(capture(facing_the_object(frames.collect::<Result<_, _>>()?)))
}

pub(super) fn read_files(folder: &Path) -> Result<Capture, CaptureError> {
    let mut files: Vec<PathBuf> = list(folder)?;
    files.retain(|f| kind_by_name(f) == Some(CaptureFormat::ProjectionFiles));
    files.sort_by(|a, b| natural_order(&file_name(a), &file_name(b)));
    let frames = files.iter().map(|file| {
        let n = numbers(file, 1, read_text(file)?.split_whitespace())?;
        let stem = file.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        projection_frame(file, folder, &stem, "its matrix", &matrix(file, 1, &n)?)
    });
    Ok(capture(facing_the_object(frames.collect::<Result<_, _>>()?)))
}

/// A projection matrix means the same with either sign, so what is in front is found from all of them:
/// the point nearest to the rays through the image centres. Where it lies behind most cameras, the matrices
/// were made for a left-handed world (oxford_dinosaur): its third axis is turned round, which makes the
/// world right-handed and the object what it is rather than its mirror image. `K` stays as it is.
pub(super) fn facing_the_object(mut frames: Vec<Frame>) -> Vec<Frame> {
    let middle = |f: &Frame| {
        let i = f.camera.intrinsics;
        f.camera.ray(Point2::new(0.5 * i.width as f64, 0.5 * i.height as f64))
    };
    let rays: Vec<_> = frames.iter().filter_map(middle).collect();
    let Some(object) = nearest_to_rays(&rays) else { return frames };
    let behind = frames.iter().filter(|f| f.camera.to_camera(&object).z < 0.0).count();
    if 2 * behind > frames.len() {
        for camera in frames.iter_mut().map(|f| &mut f.camera) {
            // M diag(1, 1, −1) has the other sign of determinant: −K R diag(1, 1, −1), −K t.
            camera.rotation *= Matrix3::from_diagonal(&Vector3::new(-1.0, -1.0, 1.0));
            camera.translation = -camera.translation;
        }
    }
    frames
}

/// The frame of an image in `folder` seen through `projection`.
pub(super) fn projection_frame(
    file: &Path,
    folder: &Path,
    name: &str,
    place: &str,
    projection: &Matrix3x4<f64>,
) -> Result<Frame, CaptureError> {
    let (path, width, height) = image_and_size(file, folder, name)?;
    let (k, rotation, translation) = decompose(projection).ok_or_else(|| {
        let fault = format!("{place}: the left 3×3 part of the projection matrix is singular");
        CaptureError::invalid(file, fault, "give matrices of cameras at a finite place")
    })?;
    let half = half_pixel(Origin::PixelCentre);
    let intrinsics = Intrinsics {
        fx: k[(0, 0)],
        fy: k[(1, 1)],
        skew: k[(0, 1)],
        cx: k[(0, 2)] + half,
        cy: k[(1, 2)] + half,
        distortion: Distortion::default(),
        width,
        height,
    };
    Ok(frame(path, checked_camera(file, place, intrinsics, rotation, translation)?))
}

/// `P = s K [R | t]` with `K` upper triangular, its diagonal positive and `K₂₂ = 1`, `det R = 1`
/// (Hartley and Zisserman, Multiple View Geometry, A4.1.1). `None` for a singular matrix.
pub(super) fn decompose(projection: &Matrix3x4<f64>) -> Option<(Matrix3<f64>, Matrix3<f64>, Vector3<f64>)> {
    let left = projection.fixed_columns::<3>(0).into_owned();
    let determinant = left.determinant();
    // Relative to the rows: their scale in a projection matrix is that of pixels, not of one.
    let size = left.row(0).norm() * left.row(1).norm() * left.row(2).norm();
    if !size.is_finite() || determinant.abs() <= 1e-14 * size || size == 0.0 {
        return None;
    }
    let p = projection * determinant.signum();
    let (mut k, mut r) = rq(&p.fixed_columns::<3>(0).into_owned());
    for i in 0..3 {
        if k[(i, i)] < 0.0 {
            k.column_mut(i).neg_mut();
            r.row_mut(i).neg_mut();
        }
    }
    let t = k.try_inverse()? * p.column(3);
    Some((k / k[(2, 2)], r, t))
}

/// `M = K R` from the QR decomposition of the row-reversed transpose.
fn rq(m: &Matrix3<f64>) -> (Matrix3<f64>, Matrix3<f64>) {
    let reverse = Matrix3::new(0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0);
    let qr = (reverse * m).transpose().qr();
    let k = reverse * qr.r().transpose() * reverse;
    let r = reverse * qr.q().transpose();
    // Rounding leaves dust below the diagonal.
    (k.upper_triangle(), r)
}

fn matrix(file: &Path, line: usize, n: &[f64]) -> Result<Matrix3x4<f64>, CaptureError> {
    if n.len() != 12 {
        return Err(bad_line(file, line, &format!("twelve numbers are needed, {} were found", n.len())));
    }
    Ok(Matrix3x4::from_row_slice(n))
}
