//! What stands behind a scene: a panorama, infinitely far away.

use crate::material::environment::position;
use crate::{frame_size, is_usable};
use capture::btf::Encoding;
use capture::{Camera, Image};
use nalgebra::{Point2, Vector3};
use rayon::prelude::*;

/// Puts `panorama` (linear radiance, longitude by latitude as [`crate::material::environment`] has it; 1 is white) behind a
/// frame that `camera` drew with nothing behind it. Where the lens has no inverse the frame stays open. One lookup a pixel,
/// at its centre, bilinear: of a panorama much finer than the frame some pixels are left out.
pub fn put_behind(frame: &mut Image<[u8; 4]>, panorama: &Image<[f32; 3]>, camera: &Camera) {
    let (width, height) = frame_size(camera);
    let is_drawn = (frame.width(), frame.height()) == (width, height) && width > 0;
    if !is_drawn || !is_usable(camera) || panorama.pixels().is_empty() {
        return;
    }
    let to_world = camera.rotation.transpose();
    frame.pixels_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.iter_mut().enumerate().filter(|(_, pixel)| pixel[3] < 255) {
            let centre = Point2::new(x as f64 + 0.5, y as f64 + 0.5);
            let Some(ideal) = camera.intrinsics.undistort_pixel(centre) else { continue };
            let plane = camera.intrinsics.plane_from_pixel(ideal);
            let behind = look_up(panorama, &(to_world * Vector3::new(plane.x, plane.y, 1.0)));
            *pixel = over(*pixel, behind.map(|radiance| 255.0 * Encoding::Srgb.encode(radiance).min(1.0)));
        }
    });
}

/// A pixel that is not premultiplied over something opaque.
fn over([r, g, b, a]: [u8; 4], behind: [f32; 3]) -> [u8; 4] {
    let share = f32::from(a) / 255.0;
    let mixed = |front: u8, behind: f32| (f32::from(front) * share + behind * (1.0 - share) + 0.5) as u8;
    [mixed(r, behind[0]), mixed(g, behind[1]), mixed(b, behind[2]), 255]
}

/// The radiance from a direction, bilinear; columns go round.
fn look_up(panorama: &Image<[f32; 3]>, direction: &Vector3<f64>) -> [f32; 3] {
    let [x, y] = position(panorama, direction);
    let (left, top) = ((x - 0.5).floor(), (y - 0.5).floor());
    let (s, t) = ((x - 0.5 - left) as f32, (y - 0.5 - top) as f32);
    let texel = |dx: i64, dy: i64| {
        let column = (left as i64 + dx).rem_euclid(panorama.width() as i64) as usize;
        panorama.at(column, (top as i64 + dy).clamp(0, panorama.height() as i64 - 1) as usize)
    };
    let [a, b, c, d] = [texel(0, 0), texel(1, 0), texel(0, 1), texel(1, 1)];
    std::array::from_fn(|k| {
        let (above, below) = (a[k] + s * (b[k] - a[k]), c[k] + s * (d[k] - c[k]));
        above + t * (below - above)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::turntable_cameras;
    use capture::Aabb;

    /// Red towards +x, green towards +y, blue upwards.
    fn panorama() -> Image<[f32; 3]> {
        let mut image = Image::filled(64, 32, [0.0; 3]);
        for (y, x) in (0..32).flat_map(|y| (0..64).map(move |x| (y, x))) {
            let d = crate::material::environment::direction(&image, x, y);
            image.set(x, y, [d.x, d.y, d.z].map(|c| c.max(0.0) as f32));
        }
        image
    }

    #[test]
    fn a_pixel_shows_what_lies_in_its_direction() {
        let aabb = Aabb { min: [-1.0; 3].into(), max: [1.0; 3].into() };
        for camera in turntable_cameras(&aabb, None, 7, 40, 30, Vector3::z()) {
            let mut frame = Image::filled(40, 30, [0; 4]);
            put_behind(&mut frame, &panorama(), &camera);
            let axis = camera.rotation.row(2);
            let middle = frame.at(20, 15);
            for c in 0..3 {
                let found = Encoding::Srgb.decode(f32::from(middle[c]) / 255.0);
                // Half a pixel off the axis, and texels of 6 degrees.
                assert!((found - (axis[c] as f32).max(0.0)).abs() < 0.08, "{middle:?} along {axis}");
            }
        }
    }

    #[test]
    fn what_covers_stays_and_edges_mix() {
        let aabb = Aabb { min: [-1.0; 3].into(), max: [1.0; 3].into() };
        let camera = turntable_cameras(&aabb, None, 1, 40, 30, Vector3::z())[0];
        let mut frame = Image::filled(40, 30, [10, 20, 30, 255]);
        frame.set(3, 3, [100, 100, 100, 51]);
        put_behind(&mut frame, &Image::filled(8, 4, [1.0; 3]), &camera);
        assert_eq!((frame.at(0, 0), frame.at(3, 3)), ([10, 20, 30, 255], [224, 224, 224, 255]));
        let nothing = frame.clone();
        put_behind(&mut frame, &Image::filled(0, 0, [0.0; 3]), &camera);
        assert_eq!(frame, nothing);
    }
}
