//! Viewing directions of all pixels, cheaply; and cameras of a cut-out of a frame.

use crate::{Camera, Image, Intrinsics};
use nalgebra::{Point2, Point3, Vector3};

/// Pixels between nodes: the lens bends so little in between that it is followed to 1e-3 pixels.
const NODE: usize = 8;

/// Undistorted places on the normalised image plane, interpolated between nodes of a coarse lattice.
#[derive(Clone, Debug)]
pub(super) struct Directions {
    nodes: Image<Option<[f64; 2]>>,
}

impl Directions {
    pub(super) fn of(intrinsics: &Intrinsics) -> Self {
        let (columns, rows) = (intrinsics.width / NODE + 2, intrinsics.height / NODE + 2);
        let node = |at: usize| {
            let pixel = Point2::new((at % columns * NODE) as f64, (at / columns * NODE) as f64);
            let plane = intrinsics.distortion.undistort(intrinsics.plane_from_pixel(pixel))?;
            Some([plane.x, plane.y])
        };
        let nodes = (0..columns * rows).map(node).collect();
        Self { nodes: Image::from_pixels(columns, rows, nodes).unwrap_or_default() }
    }

    /// (X/Z, Y/Z) of the centre of a pixel; `None` where the lens model has no inverse.
    pub(super) fn at(&self, x: usize, y: usize) -> Option<[f64; 2]> {
        let place = |v: usize| (v / NODE, ((v % NODE) as f64 + 0.5) / NODE as f64);
        let ((column, fx), (row, fy)) = (place(x), place(y));
        let [a, b] = [self.nodes.at(column, row)?, self.nodes.at(column + 1, row)?];
        let [c, d] = [self.nodes.at(column, row + 1)?, self.nodes.at(column + 1, row + 1)?];
        let mix = |i: usize| {
            let top = a[i] + (b[i] - a[i]) * fx;
            let bottom = c[i] + (d[i] - c[i]) * fx;
            top + (bottom - top) * fy
        };
        Some([mix(0), mix(1)])
    }
}

/// Where the ray of a pixel meets z = 0; `None` where it does not, or meets it at a grazing angle.
pub(super) fn on_plane(camera: &Camera, center: &Point3<f64>, direction: [f64; 2]) -> Option<[f64; 2]> {
    let d = camera.rotation.tr_mul(&Vector3::new(direction[0], direction[1], 1.0));
    // 2 degrees: further out a pixel covers more of the plane than is to be known.
    if d.z * center.z >= 0.0 || d.z.abs() < 0.035 * d.norm() {
        return None;
    }
    let t = -center.z / d.z;
    Some([center.x + t * d.x, center.y + t * d.y])
}

/// A rectangle of whole pixels in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Cutout {
    pub(super) left: usize,
    pub(super) top: usize,
    pub(super) width: usize,
    pub(super) height: usize,
}

impl Cutout {
    pub(super) fn whole(camera: &Camera) -> Self {
        Self { left: 0, top: 0, width: camera.intrinsics.width, height: camera.intrinsics.height }
    }

    /// Around the corners of a box and `margin` pixels more; the whole frame where a corner is not seen.
    pub(super) fn around(bounds: &crate::Aabb, camera: &Camera, margin: f64) -> Self {
        let whole = Self::whole(camera);
        let corner = |i: usize| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
            camera.project(&Point3::new(pick(0), pick(1), pick(2))).map(|p| p.pixel)
        };
        let corners: Option<Vec<_>> = (0..8).map(corner).collect();
        let Some(corners) = corners else { return whole };
        let range = |values: &mut dyn Iterator<Item = f64>, size: usize| {
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            let from = (low - margin).floor().clamp(0.0, size as f64) as usize;
            (from, ((high + margin).ceil().clamp(0.0, size as f64) as usize).max(from))
        };
        let (left, right) = range(&mut corners.iter().map(|p| p.x), whole.width);
        let (top, bottom) = range(&mut corners.iter().map(|p| p.y), whole.height);
        if right <= left || bottom <= top {
            return whole;
        }
        Self { left, top, width: right - left, height: bottom - top }
    }

    /// The smallest rectangle around both.
    pub(super) fn and(&self, other: &Self) -> Self {
        let (left, top) = (self.left.min(other.left), self.top.min(other.top));
        let right = (self.left + self.width).max(other.left + other.width);
        let bottom = (self.top + self.height).max(other.top + other.height);
        Self { left, top, width: right - left, height: bottom - top }
    }

    pub(super) fn of<P: Copy>(&self, image: &Image<P>) -> Image<P> {
        let rows = (self.top..self.top + self.height).flat_map(|y| &image.row(y)[self.left..self.left + self.width]);
        let pixels: Vec<P> = rows.copied().collect();
        let fill = pixels.first().copied();
        Image::from_pixels(self.width, self.height, pixels)
            .or(fill.map(|p| Image::filled(0, 0, p)))
            .unwrap_or_else(|| image.clone())
    }

    /// The frame around the cut-out, `outside` elsewhere.
    pub(super) fn back<P: Copy>(&self, part: &Image<P>, camera: &Camera, outside: P) -> Image<P> {
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        let mut frame = Image::filled(width, height, outside);
        for y in 0..self.height {
            let start = (self.top + y) * width + self.left;
            frame.pixels_mut()[start..start + self.width].copy_from_slice(part.row(y));
        }
        frame
    }

    pub(super) fn camera(&self, camera: &Camera) -> Camera {
        let mut cut = *camera;
        cut.intrinsics.cx -= self.left as f64;
        cut.intrinsics.cy -= self.top as f64;
        cut.intrinsics.width = self.width;
        cut.intrinsics.height = self.height;
        cut
    }
}
