//! A coarse hull between cells: each keeps the value that all but a few views exceed, so that its
//! silhouette is known to a fraction of a cell.

use super::optics::Directions;
use crate::votes::neighbours;
use crate::{Aabb, Camera, Image};
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// What the views agree on, on the cells of a box.
#[derive(Clone, Debug)]
pub(super) struct Consensus {
    bounds: Aabb,
    /// Cells along x, y, z.
    size: [usize; 3],
    /// Edge of a cell in world units.
    cell: f64,
    /// Per cell, x fastest: matte that all but the tolerated number of views exceed, 0 where too few views look.
    values: Vec<u8>,
    /// Per block of cells, x fastest: whether it or a block beside it holds anything.
    occupied: Vec<bool>,
}

/// Cells along the edge of a block.
const BLOCK: usize = 4;

/// How many views may contradict before a cell is carved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dissent {
    /// As a share of the views that see the cell.
    pub(super) share: f64,
    /// At least.
    pub(super) least: usize,
}

/// Parts smaller than this share of the largest are clutter.
const LEAST_PART: f64 = 0.05;

impl Consensus {
    /// On about `resolution` cells along the longest side of `bounds`. `None` where nothing is left of it.
    pub(super) fn of(
        bounds: &Aabb,
        resolution: usize,
        views: &[(&Camera, &Image<u8>)],
        dissent: Dissent,
    ) -> Option<Self> {
        let extent = bounds.size();
        let cell = extent.max() / resolution as f64;
        if !(cell.is_finite() && cell > 0.0) {
            return None;
        }
        let size = [0, 1, 2].map(|i| ((extent[i] / cell).ceil() as usize).clamp(1, resolution));
        let mut hull = Self { bounds: *bounds, size, cell, values: Vec::new(), occupied: Vec::new() };
        let total = size[0] * size[1] * size[2];
        let views = far_apart(views);
        let polled: Vec<(u8, u16)> = (0..total)
            .into_par_iter()
            .map_init(Vec::new, |values, index| poll(&hull.center(index), &views, dissent, values))
            .collect();
        let most = polled.iter().map(|p| p.1).max().unwrap_or(0);
        let least = (most / 3).max(1);
        hull.values = polled.into_iter().map(|(value, seen)| if seen >= least { value } else { 0 }).collect();
        hull.drop_clutter();
        hull.mark_occupied();
        hull.values.iter().any(|&v| v >= 128).then_some(hull)
    }

    /// The box around the object, `cells` wider.
    pub(super) fn tight_box(&self, cells: f64) -> Option<Aabb> {
        let object = self.values.iter().enumerate().filter(|(_, v)| **v >= 128).map(|(i, _)| self.center(i));
        let margin = Vector3::repeat(cells * self.cell);
        Aabb::around(object).map(|b| Aabb { min: b.min - margin, max: b.max + margin })
    }

    /// The largest value along the ray of each pixel: a silhouette that is object from 128 on.
    pub(super) fn silhouette(&self, camera: &Camera) -> Image<u8> {
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        let directions = Directions::of(&camera.intrinsics);
        let turn = camera.rotation.transpose();
        let origin = (camera.center() - self.bounds.min) / self.cell;
        let row = |y: usize| {
            let value = |x: usize| {
                let d = directions.at(x, y).map(|d| turn * Vector3::new(d[0], d[1], 1.0));
                d.map_or(0, |d| self.largest_along(&origin, &d))
            };
            (0..width).map(value).collect::<Vec<u8>>()
        };
        let pixels: Vec<u8> = (0..height).flat_map(row).collect();
        Image::from_pixels(width, height, pixels).unwrap_or_default()
    }

    /// With all that is below the object down to the floor of the box: where it may stand.
    pub(super) fn with_support(&self) -> Self {
        let mut solid = self.clone();
        let layer = self.size[0] * self.size[1];
        for at in (0..solid.values.len().saturating_sub(layer)).rev() {
            solid.values[at] = solid.values[at].max(solid.values[at + layer]);
        }
        solid.mark_occupied();
        solid
    }

    /// Column, row and layer of a cell.
    fn place(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.size;
        [index % nx, index / nx % ny, index / nx / ny]
    }

    fn center(&self, index: usize) -> Point3<f64> {
        let at = Vector3::from(self.place(index).map(|v| v as f64 + 0.5));
        self.bounds.min + at * self.cell
    }

    /// `origin` and `direction` in cells.
    fn largest_along(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> u8 {
        let direction = direction.normalize();
        let (mut from, mut to) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let (o, d) = (origin[axis], direction[axis]);
            // Half a cell more than the box: values fade out there.
            let (low, high) = (-0.5, self.size[axis] as f64 + 0.5);
            if d.abs() < 1e-12 {
                if o < low || o > high {
                    return 0;
                }
                continue;
            }
            let (a, b) = ((low - o) / d, (high - o) / d);
            from = from.max(a.min(b));
            to = to.min(a.max(b));
        }
        let mut largest = 0.0_f32;
        let mut at = from;
        while at <= to && largest < 254.0 {
            let place = origin + direction * at;
            if !self.is_occupied(&place) {
                at += BLOCK as f64 - 1.0;
                continue;
            }
            largest = largest.max(self.trilinear(&place));
            at += 0.7;
        }
        largest as u8
    }

    fn blocks(&self) -> [usize; 3] {
        self.size.map(|n| n.div_ceil(BLOCK))
    }

    fn mark_occupied(&mut self) {
        let [nx, ny, nz] = self.blocks();
        let mut occupied = vec![false; nx * ny * nz];
        for (at, _) in self.values.iter().enumerate().filter(|(_, v)| **v > 0) {
            let [x, y, z] = self.place(at).map(|v| v / BLOCK);
            for w in z.saturating_sub(1)..(z + 2).min(nz) {
                for v in y.saturating_sub(1)..(y + 2).min(ny) {
                    let row = (w * ny + v) * nx;
                    occupied[row + x.saturating_sub(1)..row + (x + 2).min(nx)].fill(true);
                }
            }
        }
        self.occupied = occupied;
    }

    /// Whether anything is within a block of a place in cells.
    fn is_occupied(&self, place: &Vector3<f64>) -> bool {
        let blocks = self.blocks();
        // Casts of what lies just outside saturate at 0.
        let at = |axis: usize| (place[axis] as usize / BLOCK).min(blocks[axis] - 1);
        self.occupied[(at(2) * blocks[1] + at(1)) * blocks[0] + at(0)]
    }

    /// Value at a place in cells; 0 outside.
    fn trilinear(&self, place: &Vector3<f64>) -> f32 {
        let [nx, ny, nz] = self.size;
        // From half a cell outside on: one more keeps the casts, which cut, from rounding up below 0.
        let shifted = place.map(|p| (p + 0.5).max(0.0));
        let base = shifted.map(|p| p as usize);
        let f = Vector3::new(shifted.x - base.x as f64, shifted.y - base.y as f64, shifted.z - base.z as f64);
        let f = f.map(|v| v as f32);
        let at = |dx: usize, dy: usize, dz: usize| {
            let (x, y, z) = (base.x + dx, base.y + dy, base.z + dz);
            let is_in = x > 0 && y > 0 && z > 0 && x <= nx && y <= ny && z <= nz;
            if is_in { f32::from(self.values[((z - 1) * ny + y - 1) * nx + x - 1]) } else { 0.0 }
        };
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let along_x = |dy: usize, dz: usize| mix(at(0, dy, dz), at(1, dy, dz), f.x);
        let along_y = |dz: usize| mix(along_x(0, dz), along_x(1, dz), f.y);
        mix(along_y(0), along_y(1), f.z)
    }

    /// Carves all but the parts that may be the object.
    fn drop_clutter(&mut self) {
        let mut labels = vec![0_u32; self.values.len()];
        let mut sizes: Vec<usize> = Vec::new();
        let mut open = Vec::new();
        for start in 0..labels.len() {
            if self.values[start] < 128 || labels[start] != 0 {
                continue;
            }
            let label = sizes.len() as u32 + 1;
            labels[start] = label;
            open.push(start);
            let mut size = 0;
            while let Some(at) = open.pop() {
                size += 1;
                for next in neighbours(self.size, at).into_iter().flatten() {
                    if self.values[next] >= 128 && labels[next] == 0 {
                        labels[next] = label;
                        open.push(next);
                    }
                }
            }
            sizes.push(size);
        }
        let largest = sizes.iter().max().copied().unwrap_or(0);
        let is_kept = |label: u32| sizes[label as usize - 1] as f64 >= LEAST_PART * largest as f64;
        for (value, &label) in self.values.iter_mut().zip(&labels) {
            if label != 0 && !is_kept(label) {
                *value = 0;
            }
        }
    }
}

/// Neighbours see the same; in this order the first few see it all.
fn far_apart<T: Copy>(views: &[T]) -> Vec<T> {
    let stride = (views.len() as f64 * 0.382).round().max(1.0) as usize;
    let stride = (stride..).find(|s| gcd(*s, views.len()) == 1).unwrap_or(1);
    (0..views.len()).map(|i| views[i * stride % views.len()]).collect()
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// The matte all but the tolerated number of views exceed at `point`, and how many views see it. Where more than
/// could be tolerated see next to nothing there, the rest is not asked.
fn poll(point: &Point3<f64>, views: &[(&Camera, &Image<u8>)], dissent: Dissent, values: &mut Vec<u8>) -> (u8, u16) {
    let tolerated = |seen: usize| ((dissent.share * seen as f64) as usize).max(dissent.least).min(seen / 3);
    let most_tolerated = tolerated(views.len());
    values.clear();
    let mut against = 0;
    for (camera, matte) in views {
        let Some(value) = sample(camera, matte, point) else { continue };
        values.push(value);
        against += usize::from(value < 16);
        if against > most_tolerated {
            return (0, 0);
        }
    }
    let seen = values.len();
    if seen == 0 {
        return (0, 0);
    }
    let (_, value, _) = values.select_nth_unstable(tolerated(seen));
    (*value, seen as u16)
}

/// The matte where a point lands, between pixels; `None` outside the frame or behind the camera.
fn sample(camera: &Camera, matte: &Image<u8>, point: &Point3<f64>) -> Option<u8> {
    let pixel = camera.project(point)?.pixel;
    if !camera.in_frame(pixel) {
        return None;
    }
    let (x, y) = (pixel.x - 0.5, pixel.y - 0.5);
    let (x0, y0) = (x.floor(), y.floor());
    let (fx, fy) = ((x - x0) as f32, (y - y0) as f32);
    let at = |dx: isize, dy: isize| f32::from(matte.at_clamped(x0 as isize + dx, y0 as isize + dy));
    let top = at(0, 0) + (at(1, 0) - at(0, 0)) * fx;
    let bottom = at(0, 1) + (at(1, 1) - at(0, 1)) * fx;
    Some((top + (bottom - top) * fy).round() as u8)
}
