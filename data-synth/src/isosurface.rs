//! A mesh of the zero set of a signed distance, for organic shapes.
//!
//! Naive surface nets (Gibson 1998): one vertex in each cell the surface crosses, joined across each
//! crossed grid edge, then moved onto the zero set by Newton's method. Closed as long as the surface
//! stays inside the grid; a manifold where the shape is thicker than two cells (tested per scene).

use crate::shape::MeshBuilder;
use nalgebra::Vector3;
use rayon::prelude::*;

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
    let cells: Vec<(usize, Vector3<f64>)> = (0..count)
        .into_par_iter()
        .filter_map(|i| Some((i, project(cell_vertex(grid, &values, grid.unindex(i))?, grid.step, &distance))))
        .collect();
    let mut builder = MeshBuilder::default();
    let ids = builder.ring(cells.iter().map(|c| c.1.into()));
    let mut vertex = vec![u32::MAX; count];
    cells.iter().zip(ids).for_each(|(cell, id)| vertex[cell.0] = id);
    for i in 0..count {
        (0..3).for_each(|axis| add_quad(grid, &values, &vertex, grid.unindex(i), axis, &mut builder));
    }
    builder
}

/// Mean of the crossings of the twelve edges of the cell at `p`; `None` where there are none.
fn cell_vertex(grid: &Grid, values: &[f64], p: [usize; 3]) -> Option<Vector3<f64>> {
    if (0..3).any(|a| p[a] + 1 >= grid.size[a]) {
        return None;
    }
    let (mut sum, mut n) = (Vector3::zeros(), 0);
    for corner in 0..8 {
        for axis in (0..3).filter(|a| corner >> a & 1 == 0) {
            let a = [0, 1, 2].map(|k| p[k] + (corner >> k & 1));
            let mut b = a;
            b[axis] += 1;
            let (va, vb) = (values[grid.index(a)], values[grid.index(b)]);
            if (va < 0.0) != (vb < 0.0) {
                sum += grid.point(a).lerp(&grid.point(b), va / (va - vb));
                n += 1;
            }
        }
    }
    (n > 0).then(|| sum / f64::from(n))
}

/// Moves a vertex onto the zero set, by no more than half a cell.
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
    start + moved * (0.5 * step / moved.norm().max(0.5 * step))
}

/// The quad across the grid edge from `p` along `axis`, if the surface crosses it.
fn add_quad(grid: &Grid, values: &[f64], vertex: &[u32], p: [usize; 3], axis: usize, builder: &mut MeshBuilder) {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    if p[axis] + 1 >= grid.size[axis] || p[u] == 0 || p[v] == 0 {
        return;
    }
    let mut q = p;
    q[axis] += 1;
    let inside = [p, q].map(|s| values[grid.index(s)] < 0.0);
    if inside[0] == inside[1] {
        return;
    }
    let cell = |du: usize, dv: usize| {
        let mut c = p;
        c[u] -= du;
        c[v] -= dv;
        vertex[grid.index(c)]
    };
    let mut quad = [cell(1, 1), cell(0, 1), cell(0, 0), cell(1, 0)];
    if quad.contains(&u32::MAX) {
        return;
    }
    if inside[1] {
        quad.reverse();
    }
    split(quad, builder);
}

/// Cuts a quad along its shorter diagonal.
fn split(q: [u32; 4], builder: &mut MeshBuilder) {
    let at = |i: usize| builder.mesh.positions[q[i] as usize];
    if nalgebra::distance_squared(&at(0), &at(2)) <= nalgebra::distance_squared(&at(1), &at(3)) {
        builder.face([q[0], q[1], q[2]]);
        builder.face([q[0], q[2], q[3]]);
    } else {
        builder.face([q[1], q[2], q[3]]);
        builder.face([q[1], q[3], q[0]]);
    }
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
