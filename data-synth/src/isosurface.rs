//! A mesh of the zero set of a signed distance, for organic shapes.
//!
//! Marching tetrahedra (Doi and Koide 1991) on Kuhn's division of the cube into six: a closed manifold
//! for any field whose zero set stays inside the grid, creases and thin parts included (surface nets
//! pinched at both). Vertices are then moved onto the zero set by Newton's method.

use crate::shape::MeshBuilder;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::HashMap;

/// Crossings stay this share of an edge away from its ends, against slivers.
const EDGE_MARGIN: f64 = 0.15;
/// Kuhn's tetrahedra: walks from corner 0 to corner 7 along the axes in every order; a corner's bits
/// are its steps along x, y, z.
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]];

/// A regular grid of samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    /// The first sample.
    pub(crate) origin: Vector3<f64>,
    /// Between samples.
    pub(crate) step: f64,
    /// Number of samples along each axis.
    pub(crate) size: [usize; 3],
}

impl Grid {
    /// Covers the box with margins of two cells.
    pub(crate) fn around(low: Vector3<f64>, high: Vector3<f64>, step: f64) -> Self {
        let size = (high - low).map(|e| (e / step).ceil().max(0.0) as usize + 5);
        Self { origin: low - Vector3::repeat(2.0 * step), step, size: size.into() }
    }

    fn index(&self, p: [usize; 3]) -> usize {
        (p[2] * self.size[1] + p[1]) * self.size[0] + p[0]
    }

    fn unindex(&self, i: usize) -> [usize; 3] {
        let [nx, ny, _] = self.size;
        [i % nx, i / nx % ny, i / (nx * ny)]
    }

    fn point(&self, p: [usize; 3]) -> Vector3<f64> {
        self.origin + Vector3::from(p.map(|c| c as f64)) * self.step
    }
}

/// Meshes `{distance = 0}`, negative inside, facing outward.
pub(crate) fn extract(grid: &Grid, distance: impl Fn(Vector3<f64>) -> f64 + Sync) -> MeshBuilder {
    let count = grid.size.iter().product::<usize>();
    let values: Vec<f64> = (0..count).into_par_iter().map(|i| distance(grid.point(grid.unindex(i)))).collect();
    let mut march = March { grid, values: &values, points: Vec::new(), ids: HashMap::new(), faces: Vec::new() };
    for i in 0..count {
        march.cell(grid.unindex(i));
    }
    let March { points, faces, .. } = march;
    let moved: Vec<Vector3<f64>> = points.into_par_iter().map(|p| project(p, grid.step, &distance)).collect();
    let mut builder = MeshBuilder::default();
    builder.ring(moved.into_iter().map(Into::into));
    faces.into_iter().for_each(|face| builder.face(face));
    builder
}

/// The state of a march through the cells, in their order.
struct March<'a> {
    grid: &'a Grid,
    values: &'a [f64],
    points: Vec<Vector3<f64>>,
    /// Vertex on the edge between two samples, lower first. Looked up, never iterated.
    ids: HashMap<(usize, usize), u32>,
    faces: Vec<[u32; 3]>,
}

impl March<'_> {
    fn cell(&mut self, p: [usize; 3]) {
        if (0..3).any(|a| p[a] + 1 >= self.grid.size[a]) {
            return;
        }
        let corners: [usize; 8] =
            std::array::from_fn(|c| self.grid.index([p[0] + (c & 1), p[1] + (c >> 1 & 1), p[2] + (c >> 2)]));
        let inside = corners.iter().filter(|&&c| self.values[c] < 0.0).count();
        if inside != 0 && inside != 8 {
            TETRAHEDRA.iter().for_each(|t| self.tetrahedron(t.map(|c| corners[c])));
        }
    }

    /// One triangle cuts off a lone corner, two separate a pair from a pair.
    fn tetrahedron(&mut self, corners: [usize; 4]) {
        let (inner, outer): (Vec<usize>, Vec<usize>) = corners.into_iter().partition(|&c| self.values[c] < 0.0);
        let outward = self.mean(&outer) - self.mean(&inner);
        match (inner.as_slice(), outer.as_slice()) {
            (&[a], &[b, c, d]) | (&[b, c, d], &[a]) => {
                let face = [b, c, d].map(|other| self.vertex(a, other));
                self.face(face, outward);
            }
            (&[a, b], &[c, d]) => {
                let [p, q, r, s] = [(a, c), (a, d), (b, d), (b, c)].map(|(i, o)| self.vertex(i, o));
                self.face([p, q, r], outward);
                self.face([p, r, s], outward);
            }
            _ => {}
        }
    }

    fn face(&mut self, [a, b, c]: [u32; 3], outward: Vector3<f64>) {
        let [p, q, r] = [a, b, c].map(|i| self.points[i as usize]);
        let faces_out = (q - p).cross(&(r - p)).dot(&outward) > 0.0;
        self.faces.push(if faces_out { [a, b, c] } else { [a, c, b] });
    }

    fn vertex(&mut self, a: usize, b: usize) -> u32 {
        let (a, b) = (a.min(b), a.max(b));
        let next = self.points.len() as u32;
        let id = *self.ids.entry((a, b)).or_insert(next);
        if id == next {
            let (va, vb) = (self.values[a], self.values[b]);
            let t = (va / (va - vb)).clamp(EDGE_MARGIN, 1.0 - EDGE_MARGIN);
            self.points.push(self.sample(a).lerp(&self.sample(b), t));
        }
        id
    }

    fn sample(&self, i: usize) -> Vector3<f64> {
        self.grid.point(self.grid.unindex(i))
    }

    fn mean(&self, samples: &[usize]) -> Vector3<f64> {
        samples.iter().map(|&i| self.sample(i)).sum::<Vector3<f64>>() / samples.len().max(1) as f64
    }
}

/// Moves a vertex onto the zero set, by no more than a third of a cell.
fn project(start: Vector3<f64>, step: f64, distance: &impl Fn(Vector3<f64>) -> f64) -> Vector3<f64> {
    let mut p = start;
    for _ in 0..2 {
        let h = 0.05 * step;
        let slope = |a: usize| {
            let mut e = Vector3::zeros();
            e[a] = h;
            (distance(p + e) - distance(p - e)) / (2.0 * h)
        };
        let gradient = Vector3::new(slope(0), slope(1), slope(2));
        p -= gradient * (distance(p) / gradient.norm_squared().max(0.1));
    }
    let moved = p - start;
    start + moved * (0.33 * step / moved.norm().max(0.33 * step))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sphere_comes_back() {
        let grid = Grid::around(Vector3::repeat(-1.0), Vector3::repeat(1.0), 0.1);
        let mesh = extract(&grid, |p| p.norm() - 1.0).mesh;
        assert!(crate::shape::is_closed(&mesh));
        assert!(mesh.positions.iter().all(|p| (p.coords.norm() - 1.0).abs() < 1e-4));
        assert!((mesh.signed_volume() / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 0.01);
    }
}
