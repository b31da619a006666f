//! Hierarchical face clustering (Garland, Willmott, Heckbert 2001): every face starts as a chart, and
//! the cheapest pair of neighbours merges until none is left that stays flat enough and a disc.
//!
//! The bend of a chart is the L2,1 error of its mean normal (Cohen-Steiner, Alliez, Desbrun 2004),
//! `Σ A |n - N|² = 2 (A - |Σ A n|)`: two sums per chart tell it, whatever the chart's size. Hull
//! creases are noisy, so no feature lines are traced; a crease shows as a bend.
//! Cost O(n log n) for n faces.

use super::FaceShapes;
use crate::mesh::half_edge::{HalfEdges, NO_TWIN, end, start};
use crate::mesh::{Mesh, half_edge::Sets};
use nalgebra::Vector3;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Weight of a chart's squared perimeter against its bend. A disc has `P²/4π = A`, so a round chart
/// costs as much as a bend of 0.05: roundness decides on flat ground and never against a crease.
const ROUNDNESS: f64 = 0.05;

/// Largest `P²/4πA` of a merged chart (a disc has 1, a square 1.3, a strip of 1 : 6 has 2.6), unless one
/// part was as ragged before: crescents pack badly.
const MAX_RAGGEDNESS: f64 = 2.6;

/// Share of the mesh's area below which a chart may be as ragged as it likes: a thin strip is better
/// unfolded in some pieces than in none.
const RAGGED_SHARE: f64 = 0.02;

/// Largest angle between the mean normals of two charts that merge, as a cosine (75°). Keeps a small
/// steep side from vanishing in a large flat chart, which the bend alone would allow.
const MIN_NORMAL_DOT: f64 = 0.26;

/// A chart in the making.
#[derive(Default)]
struct Cluster {
    area: f64,
    perimeter: f64,
    area_normal: Vector3<f64>,
    /// Vertices − edges + faces; 1 for a disc.
    euler: i64,
    borders: Vec<u32>,
    /// Counts merges, so that older queue entries are recognised.
    version: u32,
}

impl Cluster {
    fn raggedness(&self) -> f64 {
        self.perimeter * self.perimeter / (4.0 * std::f64::consts::PI * self.area)
    }
}

/// All edges between two clusters.
struct Border {
    sides: [u32; 2],
    half_edges: Vec<u32>,
    length: f64,
}

struct Growth<'a> {
    faces: &'a [[u32; 3]],
    clusters: Vec<Cluster>,
    borders: Vec<Border>,
    /// (cost, border, version of both sides added): cheapest first, ties by number.
    queue: BinaryHeap<Reverse<(u64, u32, u32)>>,
    owner: Sets,
    max_bend: f64,
    cost_unit: f64,
    ragged_area: f64,
}

/// A chart label per face.
pub(super) fn grow(mesh: &Mesh, half_edges: &HalfEdges, shapes: &FaceShapes, max_bend: f64) -> Vec<u32> {
    let mut growth = Growth::of_single_faces(mesh, half_edges, shapes, max_bend);
    for border in 0..growth.borders.len() {
        growth.enqueue(border as u32);
    }
    let mut slot_of_cluster = vec![u32::MAX; mesh.faces.len()];
    while let Some(Reverse((_, border, version))) = growth.queue.pop() {
        if growth.version(border) == Some(version) && growth.stays_disc(border) {
            growth.merge(border, &mut slot_of_cluster);
        }
    }
    (0..mesh.faces.len() as u32).map(|f| growth.owner.find(f)).collect()
}

impl<'a> Growth<'a> {
    fn of_single_faces(mesh: &'a Mesh, half_edges: &HalfEdges, shapes: &FaceShapes, max_bend: f64) -> Self {
        let length = |h: u32| {
            let [a, b] = [start(&mesh.faces, h), end(&mesh.faces, h)].map(|v| mesh.positions[v as usize]);
            (b - a).norm()
        };
        let mut clusters: Vec<Cluster> = (0..mesh.faces.len())
            .map(|f| Cluster {
                area: shapes.areas[f],
                perimeter: (0..3).map(|k| length(3 * f as u32 + k)).sum(),
                area_normal: shapes.normals[f] * shapes.areas[f],
                euler: 1,
                ..Cluster::default()
            })
            .collect();
        let mut borders = Vec::new();
        for (h, &twin) in half_edges.twins.iter().enumerate() {
            if twin != NO_TWIN && twin as usize > h {
                let sides = [h as u32 / 3, twin / 3];
                sides.iter().for_each(|&s| clusters[s as usize].borders.push(borders.len() as u32));
                borders.push(Border { sides, half_edges: vec![h as u32], length: length(h as u32) });
            }
        }
        let total: f64 = shapes.areas.iter().sum();
        Self {
            faces: &mesh.faces,
            owner: Sets::new(clusters.len()),
            clusters,
            borders,
            queue: BinaryHeap::new(),
            max_bend,
            ragged_area: RAGGED_SHARE * total,
            cost_unit: (1_u64 << 46) as f64 / total.max(f64::MIN_POSITIVE),
        }
    }

    /// Changes whenever either side does; `None` once the two sides are one.
    fn version(&self, border: u32) -> Option<u32> {
        let [a, b] = self.borders[border as usize].sides;
        (a != b).then(|| self.clusters[a as usize].version + self.clusters[b as usize].version)
    }

    fn enqueue(&mut self, border: u32) {
        if let (Some(cost), Some(version)) = (self.cost(border), self.version(border)) {
            // Rounded to 2^-46 of the mesh's area: ties of symmetric meshes stay ties in any unit.
            self.queue.push(Reverse(((cost * self.cost_unit).round() as u64, border, version)));
        }
    }

    /// Area times (bend + roundness) of the merged chart; `None` if it would bend too far.
    fn cost(&self, border: u32) -> Option<f64> {
        let Border { sides: [a, b], length, .. } = &self.borders[border as usize];
        let (a, b) = (&self.clusters[*a as usize], &self.clusters[*b as usize]);
        let area = a.area + b.area;
        let bend = area - (a.area_normal + b.area_normal).norm();
        let facing = a.area_normal.dot(&b.area_normal) >= MIN_NORMAL_DOT * a.area_normal.norm() * b.area_normal.norm();
        let perimeter = a.perimeter + b.perimeter - 2.0 * length;
        let disc = perimeter * perimeter / (4.0 * std::f64::consts::PI);
        let cost = bend.max(0.0) + ROUNDNESS * disc;
        let ragged = area > self.ragged_area && disc > MAX_RAGGEDNESS.max(a.raggedness()).max(b.raggedness()) * area;
        (facing && !ragged && bend <= self.max_bend * area && cost.is_finite()).then_some(cost)
    }

    /// Whether both sides together are a disc: χ(A ∪ B) = χ(A) + χ(B) − χ(A ∩ B) = 1.
    fn stays_disc(&self, border: u32) -> bool {
        self.merged_euler(border) == 1
    }

    fn merged_euler(&self, border: u32) -> i64 {
        let Border { sides: [a, b], half_edges, .. } = &self.borders[border as usize];
        let mut vertices: Vec<u32> =
            half_edges.iter().flat_map(|&h| [start(self.faces, h), end(self.faces, h)]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let shared = vertices.len() as i64 - half_edges.len() as i64;
        self.clusters[*a as usize].euler + self.clusters[*b as usize].euler - shared
    }

    /// Dissolves the border between two clusters; `slots` is scratch, all `u32::MAX` before and after.
    fn merge(&mut self, border: u32, slots: &mut [u32]) {
        let euler = self.merged_euler(border);
        let [a, b] = self.borders[border as usize].sides;
        let shared = self.borders[border as usize].length;
        let (kept, gone) = (a.min(b), a.max(b));
        let lost = std::mem::take(&mut self.clusters[gone as usize]);
        let cluster = &mut self.clusters[kept as usize];
        cluster.area += lost.area;
        cluster.perimeter += lost.perimeter - 2.0 * shared;
        cluster.area_normal += lost.area_normal;
        cluster.euler = euler;
        cluster.version += lost.version + 1;
        let mut own = std::mem::take(&mut cluster.borders);
        own.retain(|&e| e != border);
        self.owner.join(kept, gone);
        for &e in &own {
            slots[self.other_side(e, kept) as usize] = e;
        }
        for e in lost.borders.into_iter().filter(|&e| e != border) {
            self.adopt(e, gone, kept, &mut own, slots);
        }
        self.borders[border as usize].sides = [kept; 2];
        for &e in &own {
            slots[self.other_side(e, kept) as usize] = u32::MAX;
        }
        self.clusters[kept as usize].borders = own.clone();
        own.into_iter().for_each(|e| self.enqueue(e));
    }

    /// Turns border `e` of `gone` into one of `kept`, or joins it to the one `kept` has already.
    fn adopt(&mut self, e: u32, gone: u32, kept: u32, own: &mut Vec<u32>, slots: &mut [u32]) {
        let other = self.other_side(e, gone);
        let twin = slots[other as usize];
        if twin == u32::MAX {
            self.borders[e as usize].sides = [kept.min(other), kept.max(other)];
            slots[other as usize] = e;
            own.push(e);
            return;
        }
        let dissolved = std::mem::take(&mut self.borders[e as usize].half_edges);
        let length = self.borders[e as usize].length;
        self.borders[e as usize].sides = [kept; 2];
        let joined = &mut self.borders[twin as usize];
        joined.half_edges.extend(dissolved);
        joined.length += length;
        self.clusters[other as usize].borders.retain(|&o| o != e);
    }

    fn other_side(&self, border: u32, side: u32) -> u32 {
        let [a, b] = self.borders[border as usize].sides;
        if a == side { b } else { a }
    }
}
