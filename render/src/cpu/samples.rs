//! Where the sub-samples of a frame lie on the ideal pixel plane, in tiles, and which faces each
//! tile may see.

use super::setup::EdgeFace;
use crate::resolve::{ideal_position, sample_position};
use capture::{Camera, Intrinsics};
use rayon::prelude::*;
use std::ops::Range;

/// Sub-samples along a tile's side: depths and faces of a tile stay in the second-level cache.
const TILE_SAMPLES: usize = 64;

/// Sub-samples along the side of a block, the unit of what is skipped.
pub(super) const BLOCK_SAMPLES: usize = 8;

/// A box on the ideal plane; empty where nothing was put in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    low: [f64; 2],
    high: [f64; 2],
}

/// A rectangle of sub-samples, counted over the frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Patch {
    pub(super) columns: Range<usize>,
    pub(super) rows: Range<usize>,
}

/// The sub-samples under a lens.
#[derive(Clone, Debug)]
struct Lens {
    /// Ideal pixel of each sub-sample, row by row; NaN where the lens has no inverse.
    ideal: Vec<[f64; 2]>,
    /// Bounds of the blocks, row by row over the frame.
    blocks: Vec<Bounds>,
    blocks_across: usize,
}

/// The sub-samples of a frame.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    intrinsics: Intrinsics,
    per_side: usize,
    tile_px: usize,
    tiles_across: usize,
    tiles_down: usize,
    lens: Option<Lens>,
}

/// Which faces each tile may see, in the order of the faces.
#[derive(Debug, Default)]
pub(super) struct Bins {
    /// Of each tile, and the end; none without faces.
    starts: Vec<u32>,
    faces: Vec<u32>,
    /// Tiles and faces as they come; kept for its memory alone.
    pairs: Vec<[u32; 2]>,
}

impl Bins {
    /// Indices into the faces that were binned.
    pub(super) fn of(&self, tile: usize) -> &[u32] {
        let (Some(&start), Some(&end)) = (self.starts.get(tile), self.starts.get(tile + 1)) else { return &[] };
        &self.faces[start as usize..end as usize]
    }

    /// Sorts the pairs by tile, of `tiles`; those of a tile stay in their order.
    fn sort(&mut self, tiles: usize) {
        self.starts.clear();
        self.starts.resize(tiles + 1, 0);
        // One place further on, so that each start is where the next face of its tile goes, and in the end its end.
        self.pairs.iter().filter(|[tile, _]| (*tile as usize) + 2 <= tiles).for_each(|[tile, _]| {
            self.starts[*tile as usize + 2] += 1;
        });
        for tile in 2..=tiles {
            self.starts[tile] += self.starts[tile - 1];
        }
        self.faces.clear();
        self.faces.resize(self.pairs.len(), 0);
        for &[tile, face] in &self.pairs {
            let slot = &mut self.starts[tile as usize + 1];
            self.faces[*slot as usize] = face;
            *slot += 1;
        }
    }
}

impl Samples {
    pub(super) fn new(camera: &Camera, per_side: usize) -> Self {
        let intrinsics = camera.intrinsics;
        // A multiple of whole blocks, whatever the supersampling.
        let tile_px = (TILE_SAMPLES / per_side).div_ceil(BLOCK_SAMPLES) * BLOCK_SAMPLES;
        let lens = (!intrinsics.distortion.is_none()).then(|| Lens::new(camera, per_side));
        Self {
            intrinsics,
            per_side,
            tile_px,
            tiles_across: intrinsics.width.div_ceil(tile_px),
            tiles_down: intrinsics.height.div_ceil(tile_px),
            lens,
        }
    }

    /// Whether these are the sub-samples of such a camera.
    pub(super) fn fit(&self, intrinsics: &Intrinsics, per_side: usize) -> bool {
        self.intrinsics == *intrinsics && self.per_side == per_side
    }

    pub(super) fn per_side(&self) -> usize {
        self.per_side
    }

    /// How many tiles there are.
    pub(super) fn tiles(&self) -> usize {
        self.tiles_across * self.tiles_down
    }

    /// How many tiles lie side by side.
    pub(super) fn tiles_across(&self) -> usize {
        self.tiles_across
    }

    /// Pixel columns and rows of a tile.
    pub(super) fn tile_pixels(&self, tile: usize) -> (Range<usize>, Range<usize>) {
        let (x, y) = (tile % self.tiles_across * self.tile_px, tile / self.tiles_across * self.tile_px);
        let right = (x + self.tile_px).min(self.intrinsics.width);
        let bottom = (y + self.tile_px).min(self.intrinsics.height);
        (x..right, y..bottom)
    }

    /// Sub-samples of a tile.
    pub(super) fn tile_patch(&self, tile: usize) -> Patch {
        let n = self.per_side;
        let (columns, rows) = self.tile_pixels(tile);
        Patch { columns: n * columns.start..n * columns.end, rows: n * rows.start..n * rows.end }
    }

    /// Ideal pixel of a sub-sample.
    pub(super) fn ideal(&self, column: usize, row: usize) -> [f64; 2] {
        match &self.lens {
            None => sample_position(column, row, self.per_side).into(),
            Some(lens) => lens.ideal[row * self.intrinsics.width * self.per_side + column],
        }
    }

    /// Where a row of sub-samples lies on a regular grid, in pixels; `None` under a lens.
    #[inline(always)]
    pub(super) fn line(&self, row: usize) -> Option<f64> {
        self.is_regular().then(|| sample_position(0, row, self.per_side).y)
    }

    /// Where the columns from `column` on lie on a regular grid, in pixels.
    #[inline(always)]
    pub(super) fn across<const N: usize>(&self, column: usize) -> [f64; N] {
        let mut xs = [0.0; N];
        for (k, x) in xs.iter_mut().enumerate() {
            *x = sample_position(column + k, 0, self.per_side).x;
        }
        xs
    }

    /// Ideal pixels x and y of sub-samples side by side from (`column`, `row`) on, under a lens; zero beyond the last.
    pub(super) fn positions<const N: usize>(&self, column: usize, row: usize) -> [[f64; N]; 2] {
        let (mut xs, mut ys) = ([0.0; N], [0.0; N]);
        let ideal =
            self.lens.iter().flat_map(|lens| &lens.ideal[row * self.intrinsics.width * self.per_side + column..]);
        xs.iter_mut().zip(&mut ys).zip(ideal).for_each(|((x, y), ideal)| [*x, *y] = *ideal);
        [xs, ys]
    }

    /// Whether sub-samples lie on a regular grid.
    pub(super) fn is_regular(&self) -> bool {
        self.lens.is_none()
    }

    /// The sub-samples of `patch` that a face may cover, on a regular grid.
    #[inline(always)]
    pub(super) fn box_of(&self, patch: &Patch, face: &EdgeFace) -> Patch {
        let columns = self.reached(face.low[0], face.high[0], &patch.columns);
        let rows = self.reached(face.low[1], face.high[1], &patch.rows);
        Patch { columns, rows }
    }

    /// Visits the blocks of `patch` that a face may cover, under a lens.
    pub(super) fn visit(&self, patch: &Patch, face: &EdgeFace, mut visit: impl FnMut(Patch)) {
        let Some(lens) = &self.lens else { return };
        let blocks = |range: &Range<usize>| range.start / BLOCK_SAMPLES..range.end.div_ceil(BLOCK_SAMPLES);
        let inside = |block: usize, range: &Range<usize>| {
            (block * BLOCK_SAMPLES).max(range.start)..((block + 1) * BLOCK_SAMPLES).min(range.end)
        };
        for by in blocks(&patch.rows) {
            for bx in blocks(&patch.columns) {
                if lens.blocks[by * lens.blocks_across + bx].meets(face) {
                    visit(Patch { columns: inside(bx, &patch.columns), rows: inside(by, &patch.rows) });
                }
            }
        }
    }

    /// Sub-samples on a regular grid between two pixel coordinates, within `range`.
    #[inline(always)]
    fn reached(&self, low: f64, high: f64, range: &Range<usize>) -> Range<usize> {
        let n = self.per_side as f64;
        // Casts saturate: the infinite bounds of a face through the camera's plane reach the ends of the range.
        let first = ((low * n - 0.5).ceil() as usize).clamp(range.start, range.end);
        let last = ((high * n - 0.5).floor() + 1.0) as usize;
        first..last.clamp(first, range.end)
    }

    /// Whether all sub-samples are known to lie beside a box of ideal pixels, as they do beside most of small faces.
    #[inline(always)]
    pub(super) fn are_beside(&self, low: [f64; 2], high: [f64; 2]) -> bool {
        let size = [self.intrinsics.width, self.intrinsics.height];
        self.is_regular() && (0..2).any(|k| self.reached(low[k], high[k], &(0..self.per_side * size[k])).is_empty())
    }

    /// Sorts faces into tiles, of which a lens needs the bounds.
    pub(super) fn bin(&self, faces: &[EdgeFace], bounds: &[Bounds], bins: &mut Bins) {
        bins.pairs.clear();
        for (index, face) in (0..).zip(faces) {
            self.tiles_of(face, bounds, |tile| bins.pairs.push([tile as u32, index]));
        }
        bins.sort(self.tiles());
    }

    /// Where the sub-samples of each tile lie under a lens; nothing without.
    pub(super) fn tile_bounds(&self) -> Vec<Bounds> {
        match &self.lens {
            None => Vec::new(),
            Some(_) => (0..self.tiles()).map(|tile| self.bounds_of(tile)).collect(),
        }
    }

    fn tiles_of(&self, face: &EdgeFace, bounds: &[Bounds], mut add: impl FnMut(usize)) {
        if self.lens.is_some() {
            return (0..self.tiles()).filter(|&tile| bounds[tile].meets(face)).for_each(add);
        }
        let n = self.per_side;
        let columns = self.reached(face.low[0], face.high[0], &(0..n * self.intrinsics.width));
        let rows = self.reached(face.low[1], face.high[1], &(0..n * self.intrinsics.height));
        if columns.is_empty() || rows.is_empty() {
            return;
        }
        let side = n * self.tile_px;
        for y in rows.start / side..=(rows.end - 1) / side {
            for x in columns.start / side..=(columns.end - 1) / side {
                add(y * self.tiles_across + x);
            }
        }
    }

    fn bounds_of(&self, tile: usize) -> Bounds {
        let patch = self.tile_patch(tile);
        let mut bounds = Bounds::empty();
        for row in patch.rows {
            patch.columns.clone().for_each(|column| bounds.add(self.ideal(column, row)));
        }
        bounds
    }
}

impl Lens {
    fn new(camera: &Camera, per_side: usize) -> Self {
        let (width, height) = (camera.intrinsics.width * per_side, camera.intrinsics.height * per_side);
        let ideal: Vec<[f64; 2]> = (0..width * height)
            .into_par_iter()
            .with_min_len(1024)
            .map(|i| ideal_position(camera, i % width, i / width, per_side).map_or([f64::NAN; 2], Into::into))
            .collect();
        let (across, down) = (width.div_ceil(BLOCK_SAMPLES), height.div_ceil(BLOCK_SAMPLES));
        let mut blocks = vec![Bounds::empty(); across * down];
        for (i, &position) in ideal.iter().enumerate() {
            blocks[i / width / BLOCK_SAMPLES * across + i % width / BLOCK_SAMPLES].add(position);
        }
        Self { ideal, blocks, blocks_across: across }
    }
}

impl Bounds {
    fn empty() -> Self {
        Self { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2] }
    }

    /// NaN adds nothing.
    fn add(&mut self, p: [f64; 2]) {
        for k in 0..2 {
            self.low[k] = self.low[k].min(p[k]);
            self.high[k] = self.high[k].max(p[k]);
        }
    }

    fn meets(&self, face: &EdgeFace) -> bool {
        (0..2).all(|k| self.low[k] <= face.high[k] && face.low[k] <= self.high[k])
    }
}
