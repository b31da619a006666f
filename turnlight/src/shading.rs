//! Brightness of points on the object over a turn, for [`capture::light::judge_light`] to judge the light by.

use capture::light::ShadingSample;
use capture::{View, srgb};
use geometry::Mesh;
use geometry::depth::DepthMap;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// Points that are looked at: enough for a middle that holds.
const POINTS: usize = 600;
/// Points are left out where the cosine between normal and view is below this: slanted, they slide on the picture.
const MIN_COSINE: f64 = 0.5;
/// Points are left out where the cosine between normal and axis is above this: level, they are lit alike at every angle.
const MAX_LEVEL: f64 = 0.8;
/// Depths that differ by less than this share are the same surface.
const DEPTH_TOLERANCE: f64 = 0.01;
/// Half the side of the square of pixels whose mean is the brightness: what a mesh misses by.
const REACH: isize = 2;

/// A point of the surface.
struct Probe {
    point: Point3<f64>,
    normal: Vector3<f64>,
}

/// Samples points of `mesh` in the views that see them; `angles` are the turns of the object about `axis` (a unit vector)
/// in radians, one per view. Brightness is linear light, 0 to 1; clipped pixels are left out, faces without area and
/// level ones too.
pub fn shading_samples(mesh: &Mesh, views: &[View], angles: &[f64], axis: &Vector3<f64>) -> Vec<ShadingSample> {
    let probes = probes(mesh, axis);
    let of_view = |(view, &angle): (&View, &f64)| -> Vec<ShadingSample> {
        let depth = DepthMap::render(mesh, &view.camera);
        let sample = |(point, probe): (usize, &Probe)| {
            Some(ShadingSample { angle, point, brightness: brightness(view, &depth, probe)? })
        };
        probes.iter().enumerate().filter_map(sample).collect()
    };
    views.par_iter().zip(angles.par_iter()).map(of_view).flatten_iter().collect()
}

/// Middles of faces, evenly through the mesh.
fn probes(mesh: &Mesh, axis: &Vector3<f64>) -> Vec<Probe> {
    let probe = |face: &[u32; 3]| {
        let corner = |k: usize| mesh.positions.get(face[k] as usize);
        let (a, b, c) = (corner(0)?, corner(1)?, corner(2)?);
        let normal = (b - a).cross(&(c - a)).try_normalize(1e-300)?;
        let point = Point3::from((a.coords + b.coords + c.coords) / 3.0);
        (normal.dot(axis).abs() < MAX_LEVEL).then_some(Probe { point, normal })
    };
    mesh.faces.iter().step_by((mesh.faces.len() / POINTS).max(1)).filter_map(probe).collect()
}

/// Mean brightness about the pixel that shows a point; `None` where it is hidden, slanted, clipped or at the border.
fn brightness(view: &View, depth: &DepthMap, probe: &Probe) -> Option<f64> {
    let toward = (view.camera.center() - probe.point).try_normalize(1e-12)?;
    let seen = view.camera.project(&probe.point)?;
    if toward.dot(&probe.normal) < MIN_COSINE || !view.camera.in_frame(seen.pixel) {
        return None;
    }
    let (x, y) = (seen.pixel.x as usize, seen.pixel.y as usize);
    let nearest = f64::from(depth.depth.at(x, y));
    if (nearest - seen.depth).abs() > DEPTH_TOLERANCE * seen.depth {
        return None;
    }
    let mut sum = 0.0;
    for (dx, dy) in (-REACH..=REACH).flat_map(|dx| (-REACH..=REACH).map(move |dy| (dx, dy))) {
        let (x, y) = (x as isize + dx, y as isize + dy);
        let pixel = view.image.at_clamped(x, y);
        if view.matte.at_clamped(x, y) < 128 || pixel.contains(&255) {
            return None;
        }
        sum += pixel.map(linear).iter().sum::<f64>() / 3.0;
    }
    Some(sum / ((2 * REACH + 1) * (2 * REACH + 1)) as f64)
}

/// Linear light of an sRGB level.
fn linear(level: u8) -> f64 {
    srgb::linear(f64::from(level) / 255.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use capture::{Camera, Image, Intrinsics};
    use nalgebra::Matrix3;

    /// A square `z = depth` that faces the camera at the origin, split in two.
    fn square(depth: f64, half: f64) -> Mesh {
        let corners = [[-half, -half], [-half, half], [half, half], [half, -half]];
        let positions = corners.map(|[x, y]| Point3::new(x, y, depth)).to_vec();
        Mesh { positions, faces: vec![[0, 1, 2], [0, 2, 3]] }
    }

    fn view(level: u8) -> View {
        let intrinsics = Intrinsics::pinhole(60.0, [64, 48]);
        View {
            index: 0,
            name: String::new(),
            image: Image::filled(64, 48, [level; 3]),
            matte: Image::filled(64, 48, 255),
            is_complete: true,
            camera: Camera { intrinsics, rotation: Matrix3::identity(), translation: Vector3::zeros() },
        }
    }

    #[test]
    fn points_seen_are_sampled_in_linear_light() {
        let samples = shading_samples(&square(4.0, 1.0), &[view(188), view(99)], &[0.0, 0.5], &Vector3::y());
        assert_eq!(
            samples.iter().map(|s| (s.point, s.angle)).collect::<Vec<_>>(),
            [(0, 0.0), (1, 0.0), (0, 0.5), (1, 0.5)]
        );
        assert!((samples[0].brightness - 0.5).abs() < 3e-3, "sRGB 188 is half the light of white");
    }

    #[test]
    fn hidden_clipped_level_and_masked_points_are_not() {
        let count = |mesh: &Mesh, view: View, axis| shading_samples(mesh, &[view], &[0.0], &axis).len();
        let mut hidden = square(4.0, 0.3);
        let front = square(2.0, 1.0);
        hidden.faces.extend(front.faces.iter().map(|f| f.map(|v| v + 4)));
        hidden.positions.extend(front.positions);
        assert_eq!(count(&hidden, view(99), Vector3::y()), 2, "the near square alone is seen");
        assert_eq!(count(&square(4.0, 1.0), view(255), Vector3::y()), 0);
        assert_eq!(count(&square(4.0, 1.0), view(99), Vector3::z()), 0);
        let masked = View { matte: Image::filled(64, 48, 0), ..view(99) };
        assert_eq!(count(&square(4.0, 1.0), masked, Vector3::y()), 0);
        assert_eq!(count(&Mesh { positions: vec![], faces: vec![] }, view(99), Vector3::y()), 0);
    }
}
