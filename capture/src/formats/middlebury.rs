//! Middlebury multi-view stereo: `NAME_par.txt`, a count, then per line
//! `name k11..k33 r11..r33 t1 t2 t3`, row-major, `P = K [R | t]`, axes as ours.
//!
//! Whether an integer pixel coordinate is a centre or a corner is not documented by the authors
//! (Seitz, Curless, Diebel, Scharstein, Szeliski, CVPR 2006). See `projections` for how it was decided.

use super::{Origin, bad_line, capture, checked_camera, frame, half_pixel, image_and_size, numbers, read_text};
use crate::{Aabb, Capture, CaptureError, Distortion, Frame, Intrinsics};
use nalgebra::{Matrix3, Point3, Vector3};
use std::path::Path;

pub(super) fn read(file: &Path) -> Result<Capture, CaptureError> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let text = read_text(file)?;
    let mut lines = text.lines().enumerate().map(|(i, l)| (i + 1, l.trim())).filter(|(_, l)| !l.is_empty());
    let (_, count) = lines.next().unwrap_or((1, ""));
    let count: usize =
        count.parse().map_err(|e| bad_line(file, 1, &format!("the number of images is missing ({e})")))?;
    let frames = lines.map(|(number, line)| parse_line(file, folder, number, line)).collect::<Result<Vec<_>, _>>()?;
    if frames.len() != count {
        let fault = format!("announces {count} images and lists {}", frames.len());
        return Err(CaptureError::invalid(file, fault, "copy it again, or correct its first line"));
    }
    Ok(Capture { aabb: box_from_readme(folder), unit: Some(1.0), ..capture(frames) })
}

fn parse_line(file: &Path, folder: &Path, line: usize, text: &str) -> Result<Frame, CaptureError> {
    let mut words = text.split_whitespace();
    let name = words.next().unwrap_or_default();
    let n = numbers(file, line, words)?;
    if n.len() != 21 {
        return Err(bad_line(file, line, &format!("a name and 21 numbers are needed, {} were found", n.len())));
    }
    if (n[3], n[6], n[7]) != (0.0, 0.0, 0.0) || n[8] == 0.0 {
        return Err(bad_line(file, line, "K is not upper triangular"));
    }
    let (path, width, height) = image_and_size(file, folder, name)?;
    let half = half_pixel(Origin::PixelCentre);
    let k = |i: usize| n[i] / n[8];
    let intrinsics = Intrinsics {
        fx: k(0),
        fy: k(4),
        skew: k(1),
        cx: k(2) + half,
        cy: k(5) + half,
        distortion: Distortion::default(),
        width,
        height,
    };
    let rotation = Matrix3::from_row_slice(&n[9..18]);
    let camera =
        checked_camera(file, &format!("line {line}"), intrinsics, rotation, Vector3::new(n[18], n[19], n[20]))?;
    Ok(frame(path, camera))
}

/// The tight box of the README: two lines of three numbers in parentheses.
fn box_from_readme(folder: &Path) -> Option<Aabb> {
    let text = String::from_utf8_lossy(&std::fs::read(folder.join("README.txt")).ok()?).into_owned();
    let corners: Vec<Point3<f64>> = text.lines().filter_map(corner).collect();
    match corners.as_slice() {
        [a, b, ..] => Aabb::around([*a, *b]),
        _ => None,
    }
}

fn corner(line: &str) -> Option<Point3<f64>> {
    let inner = line.trim().strip_prefix('(')?.strip_suffix(')')?;
    let n: Vec<f64> = inner.split([' ', ',', '\t']).filter(|w| !w.is_empty()).map_while(|w| w.parse().ok()).collect();
    match n.as_slice() {
        &[x, y, z] if n.iter().all(|v| v.is_finite()) => Some(Point3::new(x, y, z)),
        _ => None,
    }
}
