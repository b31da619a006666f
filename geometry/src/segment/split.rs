//! A chart cut in two: the way out wherever flattening fails.

use crate::mesh::Mesh;
use crate::mesh::half_edge::HalfEdges;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Splits an edge-connected chart of two faces or more into connected parts, both ends of its longest
/// extent growing at equal speed over its faces. Neither part is empty, so repeated splits end.
pub(crate) fn split_in_two(mesh: &Mesh, half_edges: &HalfEdges, chart: &[u32]) -> [Vec<u32>; 2] {
    let walk = Walk { mesh, half_edges, chart };
    let from_any = walk.distances(&[0]).0;
    let first = farthest(&from_any);
    let from_first = walk.distances(&[first]).0;
    let mut second = farthest(&from_first);
    if second == first {
        second = (first + 1) % chart.len();
    }
    let mut nearest_seed = walk.distances(&[first, second]).1;
    walk.straighten(&mut nearest_seed);
    let part = |seed: usize| (0..chart.len()).filter(|&i| nearest_seed[i] == seed as u32).map(|i| chart[i]).collect();
    [part(0), part(1)]
}

/// Position of the largest distance; the first of equals.
fn farthest(distances: &[u64]) -> usize {
    let best = distances.iter().enumerate().max_by_key(|&(i, &d)| (d, Reverse(i)));
    best.map_or(0, |(i, _)| i)
}

struct Walk<'a> {
    mesh: &'a Mesh,
    half_edges: &'a HalfEdges,
    chart: &'a [u32],
}

impl Walk<'_> {
    /// Dijkstra over face centroids from several seeds at once: per face of the chart the distance to
    /// and the number of the nearest seed. Distances are in 2^-40 of the longest step, as integers:
    /// equal paths tie in any unit.
    fn distances(&self, seeds: &[usize]) -> (Vec<u64>, Vec<u32>) {
        let unit = self.unit();
        let mut best = vec![u64::MAX; self.chart.len()];
        let mut seed_of = vec![0; self.chart.len()];
        let mut queue: BinaryHeap<_> = seeds.iter().zip(0_u32..).map(|(&i, s)| Reverse((0_u64, s, i))).collect();
        while let Some(Reverse((distance, seed, i))) = queue.pop() {
            if best[i] != u64::MAX {
                continue;
            }
            (best[i], seed_of[i]) = (distance, seed);
            for j in self.neighbours(i).filter(|&j| best[j] == u64::MAX) {
                queue.push(Reverse((distance.saturating_add((self.step(i, j) * unit) as u64 + 1), seed, j)));
            }
        }
        best.iter_mut().filter(|d| **d == u64::MAX).for_each(|d| *d = 0);
        (best, seed_of)
    }

    /// Gives a face with two neighbours in the other part to it: shorter cuts, see `super::straighten`.
    fn straighten(&self, parts: &mut [u32]) {
        for i in (0..parts.len()).chain(0..parts.len()) {
            let own = self.neighbours(i).filter(|&j| parts[j] == parts[i]).count();
            if own == 1 && self.neighbours(i).count() == 3 {
                parts[i] = 1 - parts[i];
            }
        }
    }

    fn unit(&self) -> f64 {
        let steps = (0..self.chart.len()).flat_map(|i| self.neighbours(i).map(move |j| (i, j)));
        let longest = steps.map(|(i, j)| self.step(i, j)).fold(f64::MIN_POSITIVE, f64::max);
        (1_u64 << 40) as f64 / longest
    }

    fn neighbours(&self, i: usize) -> impl Iterator<Item = usize> {
        let faces = (0..3).filter_map(move |k| self.half_edges.across(self.chart[i] as usize, k));
        faces.filter_map(|f| self.chart.binary_search(&(f as u32)).ok())
    }

    fn step(&self, i: usize, j: usize) -> f64 {
        let [a, b] = [i, j].map(|i| {
            let [a, b, c] = self.mesh.corners(self.chart[i] as usize);
            (a.coords + b.coords + c.coords) / 3.0
        });
        (b - a).norm()
    }
}
