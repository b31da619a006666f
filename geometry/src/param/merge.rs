//! Small charts joined to a neighbour.
//!
//! On a noisy hull segmentation leaves shards, and splitting more of them; each costs a seam and its
//! gutter. Here a shard and a neighbour are flattened as one chart, and if the result is as good as
//! before they stay one: a trial by the same judge that accepts every chart. All trials of a round are
//! of different charts and run in parallel; their choice and their outcome do not depend on threads.

use super::{FlatChart, FlatteningLimits, Patch, flatten_whole};
use crate::mesh::Mesh;
use crate::mesh::half_edge::HalfEdges;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

/// Charts below this share of the whole area look for a neighbour.
const SMALL_SHARE: f64 = 0.01;

/// Least share of a small chart's border that it has in common with the neighbour: less would hang on
/// by a thread and pack badly. At 0.25 the templeRing atlas is filled to 0.65 in 235 charts, here to
/// 0.62 in 184.
const MIN_SHARED: f64 = 0.15;

/// Stretch up to which any joined chart is accepted.
const FREE_STRETCH: f64 = 1.02;

/// Largest ratio of a joined chart's stretch to that of its worse part, beyond [`FREE_STRETCH`].
const MAX_GROWTH: f64 = 1.005;

/// Rounds at most; most meshes run out of untried pairs far earlier.
const ROUNDS: usize = 64;

/// Joins small charts to neighbours as long as the joined chart is valid and stretched as little.
pub(crate) fn merge_small(
    mesh: &Mesh,
    half_edges: &HalfEdges,
    charts: Vec<FlatChart>,
    limits: &FlatteningLimits,
) -> Vec<FlatChart> {
    let mut merging = Merging::new(mesh, half_edges, charts);
    for _ in 0..ROUNDS {
        let pairs = merging.pairs();
        if pairs.is_empty() {
            break;
        }
        let join = |pair: &[u32; 2]| merging.join(*pair, limits);
        let joined: Vec<_> = pairs.par_iter().map(join).collect();
        pairs.into_iter().zip(joined).for_each(|(pair, chart)| merging.settle(pair, chart));
    }
    merging.charts.into_iter().flatten().collect()
}

struct Merging<'a> {
    mesh: &'a Mesh,
    half_edges: &'a HalfEdges,
    /// `None` where a chart has gone into another.
    charts: Vec<Option<FlatChart>>,
    chart_of_face: Vec<u32>,
    /// Pairs (small, other) that did not work.
    tried: BTreeSet<[u32; 2]>,
    small_area: f64,
}

impl<'a> Merging<'a> {
    fn new(mesh: &'a Mesh, half_edges: &'a HalfEdges, charts: Vec<FlatChart>) -> Self {
        let mut chart_of_face = vec![0; mesh.faces.len()];
        for (chart, number) in charts.iter().zip(0..) {
            chart.patch.faces.iter().for_each(|&f| chart_of_face[f as usize] = number);
        }
        let small_area = SMALL_SHARE * charts.iter().map(|c| c.patch.area()).sum::<f64>();
        let charts = charts.into_iter().map(Some).collect();
        Self { mesh, half_edges, charts, chart_of_face, tried: BTreeSet::new(), small_area }
    }

    /// Small charts, smallest first, each with the neighbour of the longest common border; none twice.
    fn pairs(&self) -> Vec<[u32; 2]> {
        let present = self.charts.iter().zip(0..).filter_map(|(chart, i)| chart.as_ref().map(|c| (c.patch.area(), i)));
        let mut small: Vec<(u64, u32)> =
            present.filter(|c| c.0 < self.small_area).map(|(area, i)| ((area * 1e12).round() as u64, i)).collect();
        small.sort_unstable();
        let mut taken = vec![false; self.charts.len()];
        let mut pairs = Vec::new();
        for (_, chart) in small {
            let Some(other) = self.best_neighbour(chart) else { continue };
            if !taken[chart as usize] && !taken[other as usize] {
                (taken[chart as usize], taken[other as usize]) = (true, true);
                pairs.push([chart, other]);
            }
        }
        pairs
    }

    fn best_neighbour(&self, number: u32) -> Option<u32> {
        let patch = &self.charts[number as usize].as_ref()?.patch;
        let mut shared: BTreeMap<u32, f64> = BTreeMap::new();
        for &face in &patch.faces {
            let corners = self.mesh.corners(face as usize);
            for k in 0..3 {
                let Some(other) = self.half_edges.across(face as usize, k) else { continue };
                let other = self.chart_of_face[other];
                if other != number {
                    *shared.entry(other).or_default() += (corners[(k + 1) % 3] - corners[k]).norm();
                }
            }
        }
        let least = MIN_SHARED * patch.border_length();
        let untried = |&(other, length): &(u32, f64)| length >= least && !self.tried.contains(&[number, other]);
        let key = |&(other, length): &(u32, f64)| ((length * 1e12).round() as u64, Reverse(other));
        shared.into_iter().filter(untried).max_by_key(key).map(|(other, _)| other)
    }

    /// Both charts flattened as one; `None` if that is worse than apart.
    fn join(&self, pair: [u32; 2], limits: &FlatteningLimits) -> Option<FlatChart> {
        let [a, b] = pair.map(|i| self.charts[i as usize].as_ref());
        let (a, b) = (a?, b?);
        let mut faces = [&a.patch.faces[..], &b.patch.faces[..]].concat();
        faces.sort_unstable();
        let patch = Patch::new(self.mesh, self.half_edges, &faces);
        let (flat, quality) = flatten_whole(&patch, limits)?;
        let bearable = FREE_STRETCH.max(MAX_GROWTH * a.quality.stretch_l2.max(b.quality.stretch_l2));
        (quality.stretch_l2 <= bearable).then_some(FlatChart { patch, flat, quality })
    }

    fn settle(&mut self, [small, other]: [u32; 2], joined: Option<FlatChart>) {
        match joined {
            None => {
                self.tried.insert([small, other]);
            }
            Some(chart) => {
                chart.patch.faces.iter().for_each(|&f| self.chart_of_face[f as usize] = other);
                self.charts[small as usize] = None;
                self.charts[other as usize] = Some(chart);
            }
        }
    }
}
