//! A coarse hull by votes: for each cell of a grid, how many views see it inside the silhouette.
//!
//! For telling clutter and lost parts from the object, and bad cameras from good ones; the exact hull is
//! the business of `geometry`.

use crate::{Aabb, Camera, Image};
use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

/// Votes of all views on the cells of a box.
#[derive(Clone, Debug)]
pub(crate) struct Votes {
    object_box: Aabb,
    /// Cells along x, y, z.
    size: [usize; 3],
    /// Edge of a cell in world units.
    cell: f64,
    /// Per cell, x fastest: views that see it inside, views that have it in their frame.
    counts: Vec<(u16, u16)>,
}

impl Votes {
    /// Votes of the `silhouettes` (object ≥ 128) on about `resolution` cells along the longest side.
    pub(crate) fn count(object_box: &Aabb, resolution: usize, views: &[(&Camera, &Image<u8>)]) -> Self {
        let extent = object_box.size();
        let cell = extent.max() / resolution as f64;
        let size = [0, 1, 2].map(|i| ((extent[i] / cell).ceil() as usize).clamp(1, resolution));
        let mut votes = Self { object_box: *object_box, size, cell, counts: Vec::new() };
        let total = size[0] * size[1] * size[2];
        votes.counts = (0..total)
            .into_par_iter()
            .map(|index| {
                let point = votes.center(index);
                views.iter().fold((0, 0), |(inside, seen), (camera, matte)| match sample(camera, matte, &point) {
                    Some(value) => (inside + u16::from(value >= 128), seen + 1),
                    None => (inside, seen),
                })
            })
            .collect();
        votes
    }

    /// Cells which at least `fraction` of the views that see them call inside, seen by at least a third as
    /// many views as the best-seen cell; of those the largest connected part.
    pub(crate) fn object(&self, fraction: f64) -> Vec<bool> {
        let most = self.counts.iter().map(|c| c.1).max().unwrap_or(0);
        let least = (most / 3).max(1);
        let is_in = |&(inside, seen): &(u16, u16)| seen >= least && f64::from(inside) >= fraction * f64::from(seen);
        let cells: Vec<bool> = self.counts.iter().map(is_in).collect();
        self.largest_part(&cells)
    }

    /// The box around `cells`, one cell wider.
    pub(crate) fn box_of(&self, cells: &[bool]) -> Option<Aabb> {
        let centers = cells.iter().enumerate().filter(|(_, c)| **c).map(|(i, _)| self.center(i));
        let margin = Vector3::repeat(1.5 * self.cell);
        Aabb::around(centers).map(|b| Aabb { min: b.min - margin, max: b.max + margin })
    }

    /// The silhouette of `cells` in a view (255), too large by up to a cell; and a cell's size in pixels.
    pub(crate) fn project(&self, cells: &[bool], camera: &Camera) -> (Image<u8>, f64) {
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        let mut image = Image::filled(width, height, 0);
        let mut largest = 0.0_f64;
        for index in self.surface(cells) {
            let Some(projected) = camera.project(&self.center(index)) else { continue };
            let size = self.cell * camera.intrinsics.fx.max(camera.intrinsics.fy) / projected.depth;
            largest = largest.max(size);
            // Half the diagonal of a cell covers it from any side.
            fill_square(&mut image, projected.pixel.x, projected.pixel.y, 0.87 * size);
        }
        (image, largest)
    }

    fn center(&self, index: usize) -> Point3<f64> {
        let [nx, ny, _] = self.size;
        let at = Vector3::new((index % nx) as f64, (index / nx % ny) as f64, (index / nx / ny) as f64);
        self.object_box.min + (at + Vector3::repeat(0.5)) * self.cell
    }

    /// Cells with a free neighbour: the inner ones cannot change a silhouette.
    fn surface<'a>(&'a self, cells: &'a [bool]) -> impl Iterator<Item = usize> + 'a {
        let is_free = move |n: Option<usize>| n.is_none_or(|n| !cells[n]);
        (0..cells.len()).filter(move |&i| cells[i] && neighbours(self.size, i).into_iter().any(is_free))
    }

    fn largest_part(&self, cells: &[bool]) -> Vec<bool> {
        let mut label = vec![0_u32; cells.len()];
        let mut best = (0, 0);
        let mut open = Vec::new();
        let mut labels = 0;
        for start in 0..cells.len() {
            if !cells[start] || label[start] != 0 {
                continue;
            }
            labels += 1;
            let mut size = 0;
            label[start] = labels;
            open.push(start);
            while let Some(at) = open.pop() {
                size += 1;
                for next in neighbours(self.size, at).into_iter().flatten() {
                    if cells[next] && label[next] == 0 {
                        label[next] = labels;
                        open.push(next);
                    }
                }
            }
            best = best.max((size, labels));
        }
        label.iter().map(|&l| l != 0 && l == best.1).collect()
    }
}

/// The cells of a grid (x fastest) that share a face with one.
pub(crate) fn neighbours([nx, ny, nz]: [usize; 3], index: usize) -> [Option<usize>; 6] {
    let (x, y, z) = (index % nx, index / nx % ny, index / nx / ny);
    let plane = nx * ny;
    [
        (x > 0).then(|| index - 1),
        (x + 1 < nx).then(|| index + 1),
        (y > 0).then(|| index - nx),
        (y + 1 < ny).then(|| index + nx),
        (z > 0).then(|| index - plane),
        (z + 1 < nz).then(|| index + plane),
    ]
}

/// The matte where a point lands; `None` outside the frame or behind the camera.
fn sample(camera: &Camera, matte: &Image<u8>, point: &Point3<f64>) -> Option<u8> {
    let pixel = camera.project(point)?.pixel;
    camera.in_frame(pixel).then(|| matte.at(pixel.x as usize, pixel.y as usize))
}

fn fill_square(image: &mut Image<u8>, x: f64, y: f64, half: f64) {
    let range = |c: f64, size: usize| {
        let from = (c - half).floor().max(0.0) as usize;
        let to = (c + half).ceil().clamp(0.0, size as f64) as usize;
        from.min(size)..to
    };
    let columns = range(x, image.width());
    for row in range(y, image.height()) {
        let start = row * image.width();
        if columns.start < columns.end {
            image.pixels_mut()[start + columns.start..start + columns.end].fill(255);
        }
    }
}

/// A cube that holds the object of most views: about the point nearest to the rays through the centroids
/// of the silhouettes, and as large as the largest of the central half of the silhouettes asks for.
pub(crate) fn rough_box(views: &[(&Camera, &Image<u8>)]) -> Option<Aabb> {
    let extents: Vec<_> = views.iter().map(|(camera, matte)| extent(matte).map(|e| (*camera, e))).collect();
    let extents: Vec<_> = extents.into_iter().flatten().collect();
    let rays: Vec<_> = extents.iter().filter_map(|(c, e)| c.ray(e.0.into())).collect();
    let center = nearest_to_rays(&rays)?;
    let mut radii: Vec<f64> = extents
        .iter()
        .filter_map(|(camera, (_, radius))| {
            let depth = camera.project(&center)?.depth;
            Some(radius * depth / camera.intrinsics.fx.min(camera.intrinsics.fy))
        })
        .collect();
    radii.sort_by(f64::total_cmp);
    let radius = radii.get(radii.len() * 3 / 4).copied().filter(|r| r.is_finite() && *r > 0.0)?;
    let half = Vector3::repeat(1.15 * radius);
    Some(Aabb { min: center - half, max: center + half })
}

/// Centroid of a silhouette and the largest distance of its pixels from it.
fn extent(matte: &Image<u8>) -> Option<([f64; 2], f64)> {
    let (mut count, mut x_sum, mut y_sum) = (0.0, 0.0, 0.0);
    let object = || {
        let width = matte.width();
        let inside = matte.pixels().iter().enumerate().filter(|(_, v)| **v >= 128);
        inside.map(move |(i, _)| ((i % width) as f64 + 0.5, (i / width) as f64 + 0.5))
    };
    for (x, y) in object() {
        count += 1.0;
        x_sum += x;
        y_sum += y;
    }
    if count == 0.0 {
        return None;
    }
    let (x, y) = (x_sum / count, y_sum / count);
    let radius = object().map(|(u, v)| (u - x).hypot(v - y)).fold(0.0, f64::max);
    Some(([x, y], radius))
}

/// Least-squares nearest point of lines: `Σ (I − d dᵀ)(X − o) = 0`. `None` for parallel lines.
pub(crate) fn nearest_to_rays(rays: &[crate::Ray]) -> Option<Point3<f64>> {
    let mut left = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for ray in rays {
        let across = Matrix3::identity() - ray.direction * ray.direction.transpose();
        left += across;
        right += across * ray.origin.coords;
    }
    let eigenvalues = left.symmetric_eigenvalues();
    // Below this the rays differ by less than half a degree and say nothing of depth.
    if eigenvalues.min() < 1e-4 * eigenvalues.max() {
        return None;
    }
    Some(Point3::from(left.try_inverse()? * right))
}
