//! A frame for the contact sheet: a small JPEG, and over it as vectors the silhouette, the world axes and the box.

use crate::Error;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use capture::contour::Contours;
use capture::{Aabb, Camera, Image};
use jpeg_encoder::{ColorType, Encoder};
use nalgebra::{Point2, Point3, Vector2, Vector3};
use std::fmt::Write;

/// Longest side in pixels: 72 of them take 2 MB.
const MAX_SIDE: usize = 320;
const JPEG_QUALITY: u8 = 78;
/// Outlines are simplified by at most this many pixels of the thumbnail.
const OUTLINE_TOLERANCE: f64 = 0.3;
/// Straight edges are bent by the lens: points per edge.
const EDGE_POINTS: usize = 8;
/// Room left around the object where thumbnails are cut to it, relative to the longer side of the cut.
const ROOM: f64 = 0.15;

/// What is drawn over the frames besides silhouettes.
#[derive(Clone, Copy, Debug)]
pub struct Overlay {
    /// The object's box.
    pub aabb: Option<Aabb>,
    /// Where the axes start: the origin of the world.
    pub origin: Point3<f64>,
    /// Length of the axes, world units.
    pub axis_length: f64,
    /// The part of the frame that is shown, first and last corner in pixels; the whole where `None`.
    pub window: Option<[[usize; 2]; 2]>,
}

/// A frame of the contact sheet.
#[derive(Clone, Debug)]
pub struct Thumbnail {
    width: usize,
    height: usize,
    jpeg: Vec<u8>,
    outline: String,
    axes: [String; 3],
    edges: String,
}

impl Overlay {
    /// The world axes from its origin, half as long as the box, on whole frames.
    pub fn of_box(aabb: Option<Aabb>) -> Self {
        let axis_length = aabb.map_or(1.0, |aabb| 0.5 * aabb.size().max());
        Self { aabb, origin: Point3::origin(), axis_length, window: None }
    }

    /// The same, cut to where the cameras see the box, one window for all. Whole frames stay where there is no box, or
    /// a camera does not see all of it.
    pub fn cut_to_box<'a>(mut self, cameras: impl IntoIterator<Item = &'a Camera> + Clone) -> Self {
        let corners = self.aabb.map(|aabb| box_corners(&aabb)).unwrap_or_default();
        let seen = cameras.clone().into_iter().flat_map(|c| corners.iter().map(|p| c.project(p).map(|p| p.pixel)));
        let size = cameras.into_iter().map(|c| [c.intrinsics.width, c.intrinsics.height]).next();
        self.window = seen.collect::<Option<Vec<_>>>().zip(size).and_then(|(seen, size)| window(&seen, size));
        self
    }
}

impl Thumbnail {
    /// The thumbnail of a photograph with its matte and camera, all of one size.
    ///
    /// # Errors
    /// Where the picture is empty or cannot be encoded.
    pub fn new(image: &Image<[u8; 3]>, matte: &Image<u8>, camera: &Camera, overlay: &Overlay) -> Result<Self, Error> {
        let [low, high] = overlay.window.unwrap_or([[0, 0], [image.width(), image.height()]]);
        let high = [high[0].min(image.width()), high[1].min(image.height())];
        let size = [0, 1].map(|i| high[i].saturating_sub(low[i]));
        let factor = size[0].max(size[1]).div_ceil(MAX_SIDE).max(1);
        let small = reduced(image, low, size, factor);
        let place = Place { low: Vector2::new(low[0] as f64, low[1] as f64), scale: 1.0 / factor as f64 };
        let end = |i: usize| overlay.origin + Vector3::ith(i, overlay.axis_length);
        let edges: Vec<_> = overlay.aabb.iter().flat_map(box_edges).collect();
        Ok(Self {
            width: small.width(),
            height: small.height(),
            jpeg: jpeg(&small)?,
            outline: outline(matte, &place),
            axes: [0, 1, 2].map(|i| edge_path(camera, overlay.origin, end(i), &place)),
            edges: edges.iter().map(|[a, b]| edge_path(camera, *a, *b, &place)).collect(),
        })
    }

    /// The picture and what lies over it.
    pub(super) fn html(&self, caption: &str) -> String {
        let (w, h) = (self.width, self.height);
        let [x, y, z] = &self.axes;
        format!(
            "<div class=\"picture\"><img loading=\"lazy\" width=\"{w}\" height=\"{h}\" alt=\"{caption}\" \
             src=\"data:image/jpeg;base64,{}\"><svg viewBox=\"0 0 {w} {h}\"><path class=\"box\" d=\"{}\"/>\
             <path class=\"casing\" d=\"{o}\"/><path class=\"outline\" d=\"{o}\"/><path class=\"axis x\" d=\"{x}\"/>\
             <path class=\"axis y\" d=\"{y}\"/><path class=\"axis z\" d=\"{z}\"/></svg></div>",
            STANDARD.encode(&self.jpeg),
            self.edges,
            o = self.outline,
        )
    }
}

/// From pixels of the frame to those of the thumbnail.
struct Place {
    low: Vector2<f64>,
    scale: f64,
}

impl Place {
    fn of(&self, pixel: Point2<f64>) -> Point2<f64> {
        (pixel - self.low) * self.scale
    }
}

/// The rectangle around points, with room, inside a frame of `size`; `None` where there are none or nothing is left.
fn window(points: &[Point2<f64>], size: [usize; 2]) -> Option<[[usize; 2]; 2]> {
    let first = points.first()?;
    let (low, high) = points.iter().fold((*first, *first), |(low, high), p| (low.inf(p), high.sup(p)));
    let room = ROOM * (high - low).max();
    let clipped = |v: f64, i: usize| v.clamp(0.0, size[i] as f64) as usize;
    let low = [0, 1].map(|i| clipped(low[i] - room, i));
    let high = [0, 1].map(|i| clipped((high[i] + room).ceil(), i));
    (low[0] < high[0] && low[1] < high[1]).then_some([low, high])
}

/// Area average over blocks of the part of `size` from `low` on; a rest at the right and bottom is dropped.
fn reduced(image: &Image<[u8; 3]>, low: [usize; 2], size: [usize; 2], factor: usize) -> Image<[u8; 3]> {
    let (width, height) = (size[0] / factor, size[1] / factor);
    let mut small = Image::filled(width, height, [0; 3]);
    let count = factor * factor;
    for y in 0..height {
        for x in 0..width {
            let (left, top) = (low[0] + x * factor, low[1] + y * factor);
            let block = (0..count).map(|k| image.at(left + k % factor, top + k / factor));
            let sum = block.fold([0_usize; 3], |s, p| [0, 1, 2].map(|c| s[c] + usize::from(p[c])));
            small.set(x, y, sum.map(|s| ((s + count / 2) / count) as u8));
        }
    }
    small
}

fn jpeg(image: &Image<[u8; 3]>) -> Result<Vec<u8>, Error> {
    let encode = || -> Result<Vec<u8>, Box<dyn std::error::Error>> {
        let mut bytes = Vec::new();
        let (width, height) = (u16::try_from(image.width())?, u16::try_from(image.height())?);
        Encoder::new(&mut bytes, JPEG_QUALITY).encode(image.pixels().as_flattened(), width, height, ColorType::Rgb)?;
        Ok(bytes)
    };
    encode().map_err(|fault| Error::Failed(format!("a picture of the report cannot be encoded: {fault}")))
}

/// The silhouette as a path, simplified.
fn outline(matte: &Image<u8>, place: &Place) -> String {
    let contours = Contours::from_matte(matte);
    let mut path = String::new();
    for polygon in contours.loops() {
        let points: Vec<Point2<f64>> = polygon.iter().map(|p| place.of(*p)).collect();
        let Some(middle) = points.len().checked_sub(1).map(|last| last / 2) else { continue };
        let mut kept = simplified(&points[..=middle]);
        kept.extend(simplified(&points[middle..]).into_iter().skip(1));
        push_path(&mut path, kept.into_iter());
        path.push('Z');
    }
    path
}

/// Fewest points found by splitting where a polyline is farthest from its chord (Douglas, Peucker: *Algorithms for the
/// reduction of the number of points*, Cartographica 10, 1973).
fn simplified(points: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let mut kept = Vec::new();
    // Ends of the pieces still to be looked at, the leftmost last.
    let mut open = vec![(0, points.len().saturating_sub(1))];
    while let Some((from, to)) = open.pop() {
        let chord = points[to] - points[from];
        let distance = |p: Point2<f64>| {
            let off = p - points[from];
            if chord.norm() > 0.0 { off.perp(&chord).abs() / chord.norm() } else { off.norm() }
        };
        let farthest = (from + 1..to).max_by(|&a, &b| distance(points[a]).total_cmp(&distance(points[b])));
        match farthest.filter(|&at| distance(points[at]) > OUTLINE_TOLERANCE) {
            Some(at) => open.extend([(at, to), (from, at)]),
            None => kept.push(points[from]),
        }
    }
    kept.extend(points.last());
    kept
}

/// The eight corners of a box; bit i of a corner's number says on which side it lies along axis i.
fn box_corners(aabb: &Aabb) -> Vec<Point3<f64>> {
    let corner = |k: usize| Point3::from([0, 1, 2].map(|i| if k >> i & 1 == 0 { aabb.min[i] } else { aabb.max[i] }));
    (0..8).map(corner).collect()
}

/// The twelve edges of a box.
fn box_edges(aabb: &Aabb) -> Vec<[Point3<f64>; 2]> {
    let corners = box_corners(aabb);
    let edges = (0..8).flat_map(|k| (0..3).filter(move |i| k >> i & 1 == 0).map(move |i| (k, k | 1 << i)));
    edges.map(|(a, b)| [corners[a], corners[b]]).collect()
}

/// A straight edge as the lens shows it; empty where a part of it cannot be seen.
fn edge_path(camera: &Camera, from: Point3<f64>, to: Point3<f64>, place: &Place) -> String {
    let at = |k: usize| camera.project(&(from + (to - from) * (k as f64 / EDGE_POINTS as f64)));
    let points: Option<Vec<_>> = (0..=EDGE_POINTS).map(|k| at(k).map(|p| place.of(p.pixel))).collect();
    let mut path = String::new();
    push_path(&mut path, points.unwrap_or_default().into_iter());
    path
}

/// Writes a polyline in tenths of pixels, relative from point to point.
fn push_path(path: &mut String, points: impl Iterator<Item = Point2<f64>>) {
    let mut last: Option<[i64; 2]> = None;
    let tenth = |v: i64| format!("{}", v as f64 / 10.0);
    for point in points {
        let [x, y] = [point.x, point.y].map(|v| (10.0 * v).round() as i64);
        let (command, dx, dy) = match last {
            None => ('M', x, y),
            Some([lx, ly]) if [lx, ly] == [x, y] => continue,
            Some([lx, ly]) => ('l', x - lx, y - ly),
        };
        last = Some([x, y]);
        // Writing to a string cannot fail.
        let _ = write!(path, "{command}{} {}", tenth(dx), tenth(dy));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outline_keeps_corners_and_drops_what_lies_between() {
        let straight: Vec<_> = (0..=50).map(|i| Point2::new(f64::from(i), 0.2 * f64::from(i % 2))).collect();
        assert_eq!(simplified(&straight), [Point2::new(0.0, 0.0), Point2::new(50.0, 0.0)]);
        let bent: Vec<_> = (0..=20).map(|i| Point2::new(f64::from(i), f64::from((i - 10_i32).max(0)))).collect();
        assert_eq!(simplified(&bent), [(0.0, 0.0), (10.0, 0.0), (20.0, 10.0)].map(|(x, y)| Point2::new(x, y)));
        assert_eq!(simplified(&bent[..1]), [bent[0], bent[0]]);
    }

    #[test]
    fn the_window_is_the_box_with_room_inside_the_frame() {
        let points = [(200.0, 100.0), (300.0, 180.0)].map(|(x, y)| Point2::new(x, y));
        assert_eq!(window(&points, [640, 480]), Some([[185, 85], [315, 195]]));
        assert_eq!(window(&points, [250, 120]), Some([[185, 85], [250, 120]]));
        assert_eq!(window(&points, [100, 480]), None);
        assert_eq!(window(&[], [640, 480]), None);
    }

    #[test]
    fn paths_are_short() {
        let mut path = String::new();
        push_path(&mut path, [(1.0, 2.0), (1.01, 2.0), (1.5, 1.0)].map(|(x, y)| Point2::new(x, y)).into_iter());
        assert_eq!(path, "M1 2l0.5 -1");
    }

    #[test]
    fn a_box_has_twelve_edges() {
        let aabb = Aabb { min: Point3::origin(), max: Point3::new(1.0, 2.0, 3.0) };
        let edges = box_edges(&aabb);
        assert_eq!(edges.len(), 12);
        assert_eq!(edges.iter().map(|[a, b]| (b - a).norm()).sum::<f64>(), 24.0);
    }
}
