//! The nearest face of each sub-sample of a tile.

use super::samples::{BLOCK_SAMPLES, Patch, Samples};
use super::setup::{EdgeFace, Linear};
use crate::resolve::sample_position;
use crate::simd::{LANES, Lanes, RowTest};
use std::ops::Range;

/// No face.
pub(super) const NONE: u32 = u32::MAX;

/// Depth and face buffer of a tile.
#[derive(Debug, Default)]
pub(super) struct Nearest {
    patch: Patch,
    /// Sub-samples from one row to the next: those of the patch, up to whole [`LANES`].
    stride: usize,
    /// 1 / depth; zero where nothing was met.
    inverse_depths: Vec<f64>,
    /// Position in the tile's candidates.
    slots: Vec<u32>,
    /// Where the columns lie on a regular grid, in pixels.
    xs: Vec<f64>,
    /// Smallest 1 / depth in each block once the front faces are in; empty before.
    blocks: Vec<f64>,
}

/// The smallest value of an edge function that is inside. A sub-sample exactly on an edge goes to the
/// face on one side of it: top-left rule, in signs that the two faces never share.
fn threshold(edge: &Linear) -> f64 {
    let owned = edge[0] > 0.0 || (edge[0] == 0.0 && edge[1] > 0.0);
    if owned { 0.0 } else { f64::from_bits(1) }
}

impl Nearest {
    /// Finds the nearest faces of a tile among `candidates`, in their order where depths are equal.
    ///
    /// Front faces go first. On a closed mesh they then hide nearly every back face, block by block,
    /// at a fraction of the cost of testing it.
    #[inline(always)]
    pub(super) fn fill<'f, E: Lanes>(
        &mut self,
        samples: &Samples,
        tile: usize,
        candidates: impl Iterator<Item = &'f EdgeFace> + Clone,
    ) {
        self.reset(samples.tile_patch(tile), samples.per_side());
        for front in [true, false] {
            for (slot, face) in candidates.clone().enumerate().filter(|(_, face)| face.is_front == front) {
                self.add::<E>(face, slot as u32, samples);
            }
            if front {
                self.summarise();
            }
        }
    }

    /// Positions in the candidates of the faces nearest to the tile's sub-samples of `row`, counted over
    /// the frame; [`NONE`] where there is none.
    pub(super) fn slots(&self, row: usize) -> &[u32] {
        &self.slots[(row - self.patch.rows.start) * self.stride..][..self.patch.columns.len()]
    }

    fn reset(&mut self, patch: Patch, per_side: usize) {
        self.stride = patch.columns.len().next_multiple_of(LANES);
        self.xs.clear();
        let columns = patch.columns.start..patch.columns.start + self.stride;
        self.xs.extend(columns.map(|column| sample_position(column, 0, per_side).x));
        let samples = self.stride * patch.rows.len();
        self.inverse_depths.clear();
        self.inverse_depths.resize(samples, 0.0);
        self.slots.clear();
        self.slots.resize(samples, NONE);
        self.blocks.clear();
        self.patch = patch;
    }

    /// Rows and columns of `part` counted from the tile's corner.
    fn local(&self, part: &Patch) -> Patch {
        let (x, y) = (self.patch.columns.start, self.patch.rows.start);
        Patch { columns: part.columns.start - x..part.columns.end - x, rows: part.rows.start - y..part.rows.end - y }
    }

    fn summarise(&mut self) {
        let (width, height) = (self.patch.columns.len(), self.patch.rows.len());
        let across = width.div_ceil(BLOCK_SAMPLES);
        self.blocks.resize(across * height.div_ceil(BLOCK_SAMPLES), f64::INFINITY);
        for (y, row) in self.inverse_depths.chunks(self.stride.max(1)).enumerate() {
            let row = &row[..width];
            let blocks = &mut self.blocks[y / BLOCK_SAMPLES * across..][..across];
            for (block, depths) in blocks.iter_mut().zip(row.chunks(BLOCK_SAMPLES)) {
                *block = depths.iter().copied().fold(*block, f64::min);
            }
        }
    }

    /// Whether all of `part` is known to lie in front of `face`.
    #[inline(always)]
    fn hides(&self, part: &Patch, face: &EdgeFace) -> bool {
        if self.blocks.is_empty() {
            return false;
        }
        let across = self.patch.columns.len().div_ceil(BLOCK_SAMPLES);
        let local = self.local(part);
        let blocks = |range: &Range<usize>| range.start / BLOCK_SAMPLES..range.end.div_ceil(BLOCK_SAMPLES);
        // More than the rounding of interpolated depths.
        let nearest = face.nearest * (1.0 + 1e-9);
        blocks(&local.rows).all(|y| self.blocks[y * across..][blocks(&local.columns)].iter().all(|&b| b > nearest))
    }

    /// Puts a face in where it is nearest.
    #[inline(always)]
    fn add<E: Lanes>(&mut self, face: &EdgeFace, slot: u32, samples: &Samples) {
        let patch = self.patch.clone();
        if samples.is_regular() {
            let part = samples.box_of(&patch, face);
            if !part.columns.is_empty() && !part.rows.is_empty() && !self.hides(&part, face) {
                self.cover_grid::<E>(&part, face, slot, samples.per_side());
            }
            return;
        }
        samples.visit(&patch, face, |part| {
            if !self.hides(&part, face) {
                self.cover(&part, face, slot, samples);
            }
        });
    }

    /// Tests sub-samples on a regular grid, in whole [`LANES`]: a few beyond the part, which cannot be inside.
    #[inline(always)]
    fn cover_grid<E: Lanes>(&mut self, part: &Patch, face: &EdgeFace, slot: u32, per_side: usize) {
        let [e0, e1, e2] = &face.edges;
        let (thresholds, inverse_det) = (face.edges.map(|e| threshold(&e)), face.inverse_det);
        let local = self.local(part);
        let columns = local.columns.start / LANES * LANES..local.columns.end.next_multiple_of(LANES);
        let xs = self.xs[columns.clone()].as_chunks::<LANES>().0;
        for (row, line) in part.rows.clone().zip(local.rows) {
            let y = sample_position(0, row, per_side).y;
            let (r0, r1, r2) = (e0[1] * y + e0[2], e1[1] * y + e1[2], e2[1] * y + e2[2]);
            let start = line * self.stride;
            let depths = self.inverse_depths[start..][columns.clone()].as_chunks_mut::<LANES>().0;
            let slots = self.slots[start..][columns.clone()].as_chunks_mut::<LANES>().0;
            let row = RowTest { slopes: [e0[0], e1[0], e2[0]], starts: [r0, r1, r2], thresholds, inverse_det };
            for ((xs, depths), slots) in xs.iter().zip(depths).zip(slots) {
                E::keep_nearest(&row, xs, slot, depths, slots);
            }
        }
    }

    /// Tests sub-samples that lie anywhere.
    #[inline(always)]
    fn cover(&mut self, part: &Patch, face: &EdgeFace, slot: u32, samples: &Samples) {
        let thresholds = face.edges.map(|e| threshold(&e));
        let local = self.local(part);
        for (row, line) in part.rows.clone().zip(local.rows) {
            for (column, across) in part.columns.clone().zip(local.columns.clone()) {
                let [x, y] = samples.ideal(column, row);
                let weights = face.edges.map(|e| e[0] * x + (e[1] * y + e[2]));
                let inverse_depth = (weights[0] + weights[1] + weights[2]) * face.inverse_det;
                let inside = (0..3).all(|k| weights[k] >= thresholds[k]);
                let i = line * self.stride + across;
                if inside && inverse_depth > self.inverse_depths[i] {
                    self.inverse_depths[i] = inverse_depth;
                    self.slots[i] = slot;
                }
            }
        }
    }
}
