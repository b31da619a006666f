//! A material on show: on the flat, on a ball, on a cloth, on any mesh.
//!
//! z is up. The ball has radius 1 and its middle at the origin; the cloth lies in folds over [−1, 1]². Their texture
//! coordinates run over the whole square, so that a number of tiles fits them without a seam: around the ball's
//! equator, across the cloth. On a mesh as many tiles as asked for measure the longest side of its box.

use crate::Error;
use capture::{Camera, Image, Intrinsics};
use geometry::mesh::io::read_mesh;
use geometry::{Mesh, TexturedMesh};
use nalgebra::{Matrix3, Point2, Point3, Vector3};
use render::material::{Coat, Lighting};
use std::f64::consts::TAU;
use std::path::PathBuf;
use std::str::FromStr;
use texture::tile::{texel_sizes, texels_under};

/// What carries the material.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Shape {
    /// The tile itself, flat.
    Tile,
    /// A ball.
    Sphere,
    /// A cloth in folds.
    Cloth,
    /// A mesh with texture coordinates.
    Mesh(PathBuf),
}

/// Angle that the longer side of a picture spans.
const FIELD_OF_VIEW: f64 = 0.5;
/// Cells of ball and cloth along a side: normals of flat faces are then right to 10⁻³.
const CELLS: usize = 256;

impl FromStr for Shape {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let extension = text.rsplit_once('.').map_or_else(String::new, |(_, e)| e.to_ascii_lowercase());
        match text {
            "tile" => Ok(Self::Tile),
            "sphere" => Ok(Self::Sphere),
            "cloth" => Ok(Self::Cloth),
            _ if ["obj", "ply", "glb"].contains(&extension.as_str()) => Ok(Self::Mesh(text.into())),
            _ => Err("needs tile, sphere, cloth, or a mesh (.obj .ply .glb)".to_owned()),
        }
    }
}

impl Shape {
    /// The surface, and the world units that one of `tiles` repetitions measures; `None` of the flat tile.
    ///
    /// # Errors
    /// Where a mesh cannot be read or has no texture coordinates to lay a material by.
    pub fn surface(&self, tiles: f64) -> Result<Option<(TexturedMesh, f64)>, Error> {
        let whole = |mesh: TexturedMesh| {
            let across = texel_sizes(&mesh).first().copied().unwrap_or(0.0) * mesh.atlas_size[0] as f64;
            (mesh, across / tiles)
        };
        Ok(match self {
            Self::Tile => None,
            Self::Sphere => Some(whole(sheet([1024, 512], ball))),
            Self::Cloth => Some(whole(sheet([1024, 1024], fold))),
            Self::Mesh(path) => {
                let file = read_mesh(path)?;
                let fault = file.uv_fault.unwrap_or_else(|| "it has no texture coordinates".to_owned());
                let no_uvs = || Error::Failed(format!("{}: {fault}; unfold it first", path.display()));
                let mesh = file.textured.ok_or_else(no_uvs)?;
                let longest = mesh.mesh.aabb().map_or(1.0, |aabb| aabb.size().max());
                Some((mesh, longest / tiles))
            }
        })
    }
}

/// A surface over the whole atlas, seen unmirrored in it.
fn sheet(atlas_size: [usize; 2], point: impl Fn(f64, f64) -> Point3<f64>) -> TexturedMesh {
    let (mut mesh, mut uvs) = (Mesh::default(), Vec::new());
    for (j, i) in (0..=CELLS).flat_map(|j| (0..=CELLS).map(move |i| (j, i))) {
        let (u, v) = (i as f64 / CELLS as f64, j as f64 / CELLS as f64);
        mesh.positions.push(point(u, v));
        uvs.push(Point2::new(u, v));
    }
    for (j, i) in (0..CELLS).flat_map(|j| (0..CELLS).map(move |i| (j, i))) {
        let at = |dj: usize, di: usize| ((j + dj) * (CELLS + 1) + i + di) as u32;
        mesh.faces.extend([[at(0, 0), at(1, 0), at(1, 1)], [at(0, 0), at(1, 1), at(0, 1)]]);
    }
    let face_charts = vec![0; mesh.faces.len()];
    TexturedMesh { mesh, uvs, face_charts, atlas_size }
}

/// Longitude along u, from the pole above down along v.
fn ball(u: f64, v: f64) -> Point3<f64> {
    // The seam is at the back, seen from −y.
    let (azimuth, polar) = (TAU * (u + 0.25), 0.5 * TAU * v);
    Point3::new(polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos())
}

/// Folds that run down the cloth and fan out.
fn fold(u: f64, v: f64) -> Point3<f64> {
    let (x, y) = (2.0 * u - 1.0, 1.0 - 2.0 * v);
    let along = 4.2 * x + 1.3 * y + 0.7 * (1.9 * y + 0.5).sin();
    let height = 0.15 * along.sin() + 0.06 * (2.3 * x - 3.1 * y + 1.0).sin() - 0.14 * (x * x + y * y);
    Point3::new(x, y, height)
}

/// A camera that sees a mesh whole from a direction, z up in the picture; from straight above or below y is.
pub fn camera(mesh: &Mesh, from: &Vector3<f64>, [width, height]: [usize; 2]) -> Camera {
    let (center, radius) = mesh.aabb().map_or((Point3::origin(), 1.0), |b| (b.center(), 0.5 * b.size().norm()));
    let farthest = mesh.positions.iter().map(|p| (p - center).norm()).fold(0.0, f64::max);
    let radius = if farthest > 0.0 { farthest } else { radius };
    let forward = (-from).try_normalize(1e-12).unwrap_or_else(|| -Vector3::z());
    let right = forward.cross(&Vector3::z()).try_normalize(1e-6).unwrap_or_else(Vector3::x);
    let rotation = Matrix3::from_rows(&[right.transpose(), forward.cross(&right).transpose(), forward.transpose()]);
    let focal = 0.5 * width.max(height) as f64 / (0.5 * FIELD_OF_VIEW).tan();
    let shorter = (0.5 * width.min(height) as f64 / focal).atan();
    let eye = center - forward * (1.05 * radius / shorter.sin());
    Camera { intrinsics: Intrinsics::pinhole(focal, [width, height]), rotation, translation: -(rotation * eye.coords) }
}

/// `tiles` repetitions across a picture, flat and seen from one direction throughout.
pub fn flat(
    coat: &Coat<'_>,
    lighting: &Lighting,
    view: &Vector3<f64>,
    tiles: f64,
    [width, height]: [usize; 2],
) -> Image<[u8; 4]> {
    let tile = coat.picture(&lighting.lights, view);
    let size = [tile.width(), tile.height()];
    let scale = tiles * size[0] as f64 / width as f64;
    let mut out = Image::filled(width, height, [255; 4]);
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let mut mean = [0.0f32; 3];
        texels_under(scale * (x as f64 + 0.5), scale * (y as f64 + 0.5), scale, size, |texel, weight| {
            mean.iter_mut().zip(tile.pixels()[texel]).for_each(|(m, t)| *m += weight * t);
        });
        let [r, g, b] = mean.map(|radiance| lighting.displayed(radiance).round() as u8);
        out.set(x, y, [r, g, b, 255]);
    }
    out
}
