//! One period of a surface that repeats in x and y.

use crate::material::{Finish, Vec3};
use geometry::Mesh;
use nalgebra::{Point3, Vector3};

/// A period of a surface, in millimetres. Faces may cross its border; the surface is this mesh and all
/// its copies by multiples of `side` along x and y. z = 0 is the reference plane.
#[derive(Clone, Debug)]
pub(crate) struct Patch {
    /// Length of the period along x and along y.
    pub(crate) side: f64,
    /// Triangles, counter-clockwise from the side that is seen.
    pub(crate) mesh: Mesh,
    /// Shading normal of each vertex; zero for that of the face.
    pub(crate) normals: Vec<Vec3>,
    /// Reflectance at each vertex, linear RGB.
    pub(crate) colors: Vec<Vec3>,
    /// What all of it is made of; not of glass, and what is translucent is taken for glazed.
    pub(crate) finish: Finish,
}

impl Patch {
    /// Nothing yet.
    pub(crate) fn new(side: f64, finish: Finish) -> Self {
        Self { side, mesh: Mesh::default(), normals: Vec::new(), colors: Vec::new(), finish }
    }

    /// Adds a vertex and returns its index.
    pub(crate) fn vertex(&mut self, position: Vector3<f64>, normal: Vector3<f64>, color: Vec3) -> u32 {
        self.mesh.positions.push(Point3::from(position));
        self.normals.push(normal.try_normalize(0.0).unwrap_or_default().cast());
        self.colors.push(color);
        (self.mesh.positions.len() - 1) as u32
    }

    /// Adds `z = height(x, y)` on `cells × cells` squares; `height` repeats with the side. `look` gives
    /// the colour at a point of the surface.
    pub(crate) fn relief(
        &mut self,
        cells: usize,
        height: impl Fn(f64, f64) -> f64,
        look: impl Fn(Vector3<f64>) -> Vec3,
    ) {
        let step = self.side / cells as f64;
        let first = self.mesh.positions.len() as u32;
        let row = cells as u32 + 1;
        let heights: Vec<f64> = grid(cells).map(|(i, j)| height(i as f64 * step, j as f64 * step)).collect();
        let at = |i: usize, j: usize| heights[(j % cells) * (cells + 1) + i % cells];
        for (i, j) in grid(cells) {
            let p = Vector3::new(i as f64 * step, j as f64 * step, at(i, j));
            let slope_x = (at(i + 1, j) - at(i + cells - 1, j)) / (2.0 * step);
            let slope_y = (at(i, j + 1) - at(i, j + cells - 1)) / (2.0 * step);
            let color = look(p);
            self.vertex(p, Vector3::new(-slope_x, -slope_y, 1.0), color);
        }
        for j in 0..cells as u32 {
            for i in 0..cells as u32 {
                let a = first + j * row + i;
                self.mesh.faces.extend([[a, a + 1, a + row + 1], [a, a + row + 1, a + row]]);
            }
        }
    }

    /// Adds a tube of `sides` sides around the points of `path`, open at both ends. `color` is a function
    /// of the position along the path, 0 to 1.
    pub(crate) fn tube(&mut self, path: &[Section], sides: usize, color: impl Fn(f64) -> Vec3) {
        let first = self.mesh.positions.len() as u32;
        for (k, section) in path.iter().enumerate() {
            let color = color(k as f64 / (path.len() - 1).max(1) as f64);
            for s in 0..sides {
                let (sin, cos) = (std::f64::consts::TAU * s as f64 / sides as f64).sin_cos();
                let [u, v] = section.axes;
                // The normal of an ellipse has its half axes swapped.
                let normal = u * (cos * v.norm() / u.norm()) + v * (sin * u.norm() / v.norm());
                self.vertex(section.center + u * cos + v * sin, normal, color);
            }
        }
        let sides = sides as u32;
        for k in 0..path.len().saturating_sub(1) as u32 {
            for s in 0..sides {
                let (a, b) = (first + k * sides + s, first + k * sides + (s + 1) % sides);
                self.mesh.faces.extend([[a, b, b + sides], [a, b + sides, a + sides]]);
            }
        }
    }
}

/// A cross-section of a tube: an ellipse. The tube runs along `axes[0] × axes[1]`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Section {
    /// Its middle.
    pub(crate) center: Vector3<f64>,
    /// Its half axes.
    pub(crate) axes: [Vector3<f64>; 2],
}

/// Sections of radius `radius(t)` along a curve, `t` from 0 to 1.
pub(crate) fn sections(points: &[Vector3<f64>], radius: impl Fn(f64) -> f64) -> Vec<Section> {
    let last = points.len().saturating_sub(1);
    let section = |(k, &center): (usize, &Vector3<f64>)| {
        let tangent = points[(k + 1).min(last)] - points[k.saturating_sub(1)];
        let [u, v] = across(tangent);
        let r = radius(k as f64 / last.max(1) as f64);
        Section { center, axes: [u * r, v * r] }
    };
    points.iter().enumerate().map(section).collect()
}

/// Two unit vectors perpendicular to a tangent, the second as far up as can be; `u × v` along it.
pub(crate) fn across(tangent: Vector3<f64>) -> [Vector3<f64>; 2] {
    let t = tangent.try_normalize(0.0).unwrap_or_else(Vector3::x);
    let up = if t.z.abs() > 0.999 { Vector3::x() } else { Vector3::z() };
    let v = (up - t * t.dot(&up)).normalize();
    [v.cross(&t), v]
}

fn grid(cells: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..=cells).flat_map(move |j| (0..=cells).map(move |i| (i, j)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tubes_face_outward() {
        let mut patch = Patch::new(1.0, Finish::Matt);
        let points: Vec<_> = (0..9).map(|k| Vector3::new(f64::from(k) / 8.0, 0.3, 0.1 * f64::from(k % 2))).collect();
        patch.tube(&sections(&points, |_| 0.1), 8, |_| Vec3::zeros());
        for (f, face) in patch.mesh.faces.iter().enumerate() {
            assert!(patch.mesh.face_area_vector(f).dot(&patch.normals[face[0] as usize].cast()) > 0.0);
        }
    }
}
