//! The nearest face of each sub-sample of a tile.

use super::samples::{BLOCK_SAMPLES, Patch, Samples};
use super::setup::{EdgeFace, Linear};
use crate::resolve::sample_position;
use std::ops::Range;

/// Sub-samples tested side by side.
const LANES: usize = 4;

/// No face.
pub(super) const NONE: u32 = u32::MAX;

/// Depth and face buffer of a tile.
#[derive(Debug, Default)]
pub(super) struct Nearest {
    patch: Patch,
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
    pub(super) fn fill<'f>(
        &mut self,
        samples: &Samples,
        tile: usize,
        candidates: impl Iterator<Item = &'f EdgeFace> + Clone,
    ) {
        self.reset(samples.tile_patch(tile), samples.per_side());
        for front in [true, false] {
            for (slot, face) in candidates.clone().enumerate().filter(|(_, face)| face.is_front == front) {
                self.add(face, slot as u32, samples);
            }
            if front {
                self.summarise();
            }
        }
    }

    /// Positions in the candidates of the faces nearest to the tile's sub-samples of `row`, counted over
    /// the frame; [`NONE`] where there is none.
    pub(super) fn slots(&self, row: usize) -> &[u32] {
        let across = self.patch.columns.len();
        &self.slots[(row - self.patch.rows.start) * across..][..across]
    }

    fn reset(&mut self, patch: Patch, per_side: usize) {
        self.xs.clear();
        self.xs.extend(patch.columns.clone().map(|column| sample_position(column, 0, per_side).x));
        let samples = patch.columns.len() * patch.rows.len();
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
        for (y, row) in self.inverse_depths.chunks(width).enumerate() {
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
    fn add(&mut self, face: &EdgeFace, slot: u32, samples: &Samples) {
        let patch = self.patch.clone();
        samples.visit(&patch, face, |part| {
            if part.columns.is_empty() || part.rows.is_empty() || self.hides(&part, face) {
                return;
            }
            if samples.is_regular() {
                self.cover_grid(&part, face, slot, samples.per_side());
            } else {
                self.cover(&part, face, slot, samples);
            }
        });
    }

    /// Tests sub-samples on a regular grid, a few side by side.
    #[inline(always)]
    fn cover_grid(&mut self, part: &Patch, face: &EdgeFace, slot: u32, per_side: usize) {
        let [e0, e1, e2] = &face.edges;
        let [t0, t1, t2] = [threshold(e0), threshold(e1), threshold(e2)];
        let local = self.local(part);
        let xs = &self.xs[local.columns.clone()];
        for (row, line) in part.rows.clone().zip(local.rows) {
            let y = sample_position(0, row, per_side).y;
            let (r0, r1, r2) = (e0[1] * y + e0[2], e1[1] * y + e1[2], e2[1] * y + e2[2]);
            let start = line * self.patch.columns.len();
            let depths = &mut self.inverse_depths[start..][local.columns.clone()];
            let slots = &mut self.slots[start..][local.columns.clone()];
            let lanes = xs.chunks(LANES).zip(depths.chunks_mut(LANES)).zip(slots.chunks_mut(LANES));
            for ((xs, depths), slots) in lanes {
                // First without a branch, so that lanes share instructions.
                let (mut inside, mut inverse) = ([false; LANES], [0.0; LANES]);
                for (k, x) in xs.iter().enumerate() {
                    let (a, b, c) = (e0[0] * x + r0, e1[0] * x + r1, e2[0] * x + r2);
                    inverse[k] = (a + b + c) * face.inverse_det;
                    inside[k] = (a >= t0) & (b >= t1) & (c >= t2) & (inverse[k] > depths[k]);
                }
                for k in 0..xs.len() {
                    if inside[k] {
                        (depths[k], slots[k]) = (inverse[k], slot);
                    }
                }
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
                let i = line * self.patch.columns.len() + across;
                if inside && inverse_depth > self.inverse_depths[i] {
                    self.inverse_depths[i] = inverse_depth;
                    self.slots[i] = slot;
                }
            }
        }
    }
}
