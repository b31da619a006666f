//! The three families of axis-parallel rays and their crossings with the hull.

use super::cone::{ACROSS, Cone, Pencil};
use super::grid::Grid;
use super::intervals::{Span, append_crossings, carve};
use rayon::prelude::*;

/// All rays along one axis: ray (b, c) has index `c · nodes(b) + b`, b and c the other axes in ascending
/// order. Its crossings ascend in grid units and alternate between entering and leaving.
#[derive(Debug)]
pub(super) struct RaySet {
    axis: usize,
    stride: usize,
    starts: Vec<usize>,
    crossings: Vec<f64>,
}

impl RaySet {
    /// Intersects all cones along every ray, forgiving `allowed` dissenting cones at every point.
    pub(super) fn cast(cones: &[Cone], axis: usize, grid: &Grid, allowed: u32) -> Self {
        let mut pencils: Vec<Pencil> = cones.par_iter().map(|cone| Pencil::new(cone, axis, grid)).collect();
        spread(&mut pencils);
        let [b, c] = ACROSS[axis];
        let rows: Vec<(Vec<usize>, Vec<f64>)> =
            (0..grid.nodes[c]).into_par_iter().map(|row| cast_row(&pencils, axis, grid, allowed, row)).collect();
        let mut starts = Vec::with_capacity(grid.nodes[b] * grid.nodes[c] + 1);
        let mut crossings = Vec::with_capacity(rows.iter().map(|r| r.1.len()).sum());
        starts.push(0);
        for (ends, values) in rows {
            starts.extend(ends.iter().map(|end| crossings.len() + end));
            crossings.extend_from_slice(&values);
        }
        Self { axis, stride: grid.nodes[b], starts, crossings }
    }

    /// Crossings made elsewhere, for tests.
    #[cfg(test)]
    pub(super) fn from_rays(axis: usize, grid: &Grid, ray: impl Fn(usize, usize) -> Vec<f64>) -> Self {
        let [b, c] = ACROSS[axis].map(|a| grid.nodes[a]);
        let mut set = Self { axis, stride: b, starts: vec![0], crossings: Vec::new() };
        for index in 0..b * c {
            set.crossings.extend(ray(index % b, index / b));
            set.starts.push(set.crossings.len());
        }
        set
    }

    /// The crossings of ray (`b`, `c`).
    pub(super) fn ray(&self, b: usize, c: usize) -> &[f64] {
        let index = c * self.stride + b;
        &self.crossings[self.starts[index]..self.starts[index + 1]]
    }

    /// Number of crossings of all rays.
    pub(super) fn len(&self) -> usize {
        self.crossings.len()
    }

    /// All rays that have crossings, as (b, c, crossings).
    pub(super) fn occupied(&self) -> impl ParallelIterator<Item = (usize, usize, &[f64])> {
        (0..self.starts.len() - 1)
            .into_par_iter()
            .map(|index| (index % self.stride, index / self.stride, index))
            .map(|(b, c, i)| (b, c, &self.crossings[self.starts[i]..self.starts[i + 1]]))
            .filter(|(_, _, crossings)| !crossings.is_empty())
    }

    /// Smallest and largest coordinates of all crossings in grid units; `None` where there are none.
    pub(super) fn bounds(&self) -> Option<[[f64; 3]; 2]> {
        let [b, c] = ACROSS[self.axis];
        self.occupied()
            .map(|(ib, ic, crossings)| {
                let mut low = [0.0; 3];
                (low[b], low[c], low[self.axis]) = (ib as f64, ic as f64, crossings[0]);
                let mut high = low;
                high[self.axis] = crossings[crossings.len() - 1];
                [low, high]
            })
            .reduce_with(|x, y| [[0, 1, 2].map(|a| x[0][a].min(y[0][a])), [0, 1, 2].map(|a| x[1][a].max(y[1][a]))])
    }

    /// Crossings on the lower and on the upper wall of the box.
    pub(super) fn wall_crossings(&self, grid: &Grid) -> [usize; 2] {
        [grid.low[self.axis], grid.high[self.axis]]
            .map(|wall| self.crossings.par_iter().filter(|&&t| t == wall).count())
    }
}

/// The ends of the rays of one row in its crossings.
fn cast_row(pencils: &[Pencil], axis: usize, grid: &Grid, allowed: u32, c: usize) -> (Vec<usize>, Vec<f64>) {
    let [axis_b, axis_c] = ACROSS[axis];
    let mut ends = Vec::with_capacity(grid.nodes[axis_b]);
    let mut crossings = Vec::new();
    let (mut spans, mut scratch) = (Vec::new(), Vec::new());
    let (mut toggles, mut inside) = (Vec::new(), Vec::new());
    for b in 0..grid.nodes[axis_b] {
        if grid.spans(axis_b, b) && grid.spans(axis_c, c) {
            spans.clear();
            spans.push(Span { enter: grid.low[axis], leave: grid.high[axis], misses: 0 });
            for pencil in pencils {
                pencil.intervals(b as f64, c as f64, &mut toggles, &mut inside);
                carve(&mut spans, &mut scratch, &inside, allowed);
                if spans.is_empty() {
                    break;
                }
            }
            append_crossings(&spans, &mut crossings);
        }
        ends.push(crossings.len());
    }
    (ends, crossings)
}

/// Bit-reversed order, so that early views of a ring look from all around and empty rays end soon.
fn spread<T>(items: &mut Vec<T>) {
    let bits = items.len().next_power_of_two().trailing_zeros();
    let mut keyed: Vec<(usize, T)> =
        items.drain(..).enumerate().map(|(i, item)| (i.reverse_bits() >> (usize::BITS - bits.max(1)), item)).collect();
    keyed.sort_by_key(|(key, _)| *key);
    items.extend(keyed.into_iter().map(|(_, item)| item));
}
