//! Procedural meshes and cameras.

#![allow(dead_code, reason = "every test binary uses some of it")]

use capture::{Camera, Image, Intrinsics};
use geometry::{Mesh, TexturedMesh};
use nalgebra::{Matrix3, Point2, Point3, Vector3};
use std::f64::consts::TAU;

/// A surface over the unit square, in `across × down` cells of two triangles. Each cell is a chart of
/// its own in an atlas of cells (`charts`), or the whole square one chart.
pub(crate) fn surface(
    across: usize,
    down: usize,
    charts: bool,
    mut point: impl FnMut(f64, f64) -> Point3<f64>,
) -> TexturedMesh {
    let (mut positions, mut uvs, mut faces, mut face_charts) = (vec![], vec![], vec![], vec![]);
    for (j, i) in (0..down).flat_map(|j| (0..across).map(move |i| (j, i))) {
        let first = positions.len() as u32;
        for (dj, di) in [(0, 0), (0, 1), (1, 1), (1, 0)] {
            let (s, t) = ((i + di) as f64 / across as f64, (j + dj) as f64 / down as f64);
            positions.push(point(s, t));
            // A chart keeps clear of its neighbours, in a place of its own.
            let gap = |d: usize| if charts { 0.1 + 0.8 * d as f64 } else { d as f64 };
            let cell = if charts { (i * 7) % across } else { i };
            uvs.push(Point2::new((cell as f64 + gap(di)) / across as f64, (j as f64 + gap(dj)) / down as f64));
        }
        let chart = if charts { (j * across + i) as u32 } else { 0 };
        for face in [[0, 1, 2], [0, 2, 3]] {
            faces.push(face.map(|k| first + k));
            face_charts.push(chart);
        }
    }
    TexturedMesh { mesh: Mesh { positions, faces }, uvs, face_charts, atlas_size: [1024, 1024] }
}

/// Radius 1.
pub(crate) fn sphere(across: usize, down: usize) -> TexturedMesh {
    surface(across, down, true, |s, t| {
        let (phi, theta) = (TAU * s, 0.5 * TAU * t);
        Point3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
    })
}

/// A tube along a (2, 3) torus knot, about 1 in radius.
pub(crate) fn knot(across: usize, down: usize) -> TexturedMesh {
    let centre = |s: f64| {
        let (a, r) = (TAU * s, 0.7 + 0.25 * (3.0 * TAU * s).cos());
        Point3::new(r * (2.0 * a).cos(), r * (2.0 * a).sin(), 0.25 * (3.0 * a).sin())
    };
    surface(across, down, true, |s, t| {
        let tangent = centre(s + 1e-4) - centre(s - 1e-4);
        let side = tangent.cross(&Vector3::z()).normalize();
        let up = side.cross(&tangent).normalize();
        centre(s) + 0.16 * (side * (TAU * t).cos() + up * (TAU * t).sin())
    })
}

/// Radii 0.75 and 0.3, one chart.
pub(crate) fn torus(across: usize, down: usize) -> TexturedMesh {
    surface(across, down, false, |s, t| {
        let r = 0.75 + 0.3 * (TAU * t).cos();
        Point3::new(r * (TAU * s).cos(), r * (TAU * s).sin(), 0.3 * (TAU * t).sin())
    })
}

/// Waves, checks and noise, some of it beyond 0..=255 as a linear basis leaves it.
pub(crate) fn atlas(width: usize, height: usize) -> Image<[f32; 3]> {
    let mut image = Image::filled(width, height, [0.0; 3]);
    let mut state = 1_u32;
    for y in 0..height {
        for x in 0..width {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = (state >> 8) as f32 / (1 << 24) as f32;
            let check = if (x / 16 + y / 16) % 2 == 0 { 40.0 } else { -40.0 };
            let wave = |k: f32| 128.0 + 90.0 * (x as f32 * 0.021 * k).sin() * (y as f32 * 0.017 * k).cos();
            image.set(x, y, [wave(1.0) + check, wave(1.7) - check, wave(2.3) + 60.0 * (noise - 0.5)]);
        }
    }
    image
}

/// A camera at `eye` that looks at `target`, z up.
pub(crate) fn look_at(eye: Point3<f64>, target: Point3<f64>, focal: f64, width: usize, height: usize) -> Camera {
    let forward = (target - eye).normalize();
    let right = forward.cross(&Vector3::z()).try_normalize(1e-9).unwrap_or_else(Vector3::x);
    let down = forward.cross(&right);
    let rotation = Matrix3::from_rows(&[right.transpose(), down.transpose(), forward.transpose()]);
    let intrinsics = Intrinsics::pinhole(focal, [width, height]);
    Camera { intrinsics, rotation, translation: -(rotation * eye.coords) }
}
