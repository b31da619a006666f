//! Averages of a tile over ever larger cells, for footprints of many texels.
//!
//! Codecs answer texel by texel, and a footprint may hold the whole tile. So the picture of a pair of *measured*
//! directions is averaged in linear light when it is first asked for, and kept as encoded; directions between are
//! interpolated from up to 3 × 3 pairs. Each level has half the cells of the one before along each side, down to one;
//! of an odd side they are a little wider, so that none of the tile is left out.
//!
//! Levels of more than 64 × 64 cells are not kept: a pair takes up to 64 kB.

use capture::btf::Encoding;
use nalgebra::Vector3;
use std::ops::Range;
use std::sync::OnceLock;
use texture::btf::Sampler;

/// Cells of a level that is kept.
const MOST_CELLS: usize = 64 * 64;

/// Cells that a footprint spans before the next level is taken, along a side: at most four are looked up, then.
const SPANNED: f64 = 3.0;

/// The averages of a tile.
pub(super) struct Averages<'a> {
    sampler: &'a dyn Sampler,
    encoding: Encoding,
    /// Columns and rows of each level, the tile's texels first.
    sizes: Vec<[usize; 2]>,
    /// The first level that is kept.
    first: usize,
    /// Per (view, light): the cells of all levels that are kept, one after the other.
    kept: Vec<OnceLock<Vec<[f32; 3]>>>,
}

impl<'a> Averages<'a> {
    pub(super) fn new(sampler: &'a dyn Sampler, encoding: Encoding) -> Self {
        let frame = sampler.frame();
        let half = |size: &[usize; 2]| (*size != [1, 1]).then(|| size.map(|side| (side / 2).max(1)));
        let sizes: Vec<[usize; 2]> =
            std::iter::successors(Some([frame.width.max(1), frame.height.max(1)]), half).collect();
        let small = |[width, height]: &[usize; 2]| width * height <= MOST_CELLS;
        let first = sizes.iter().skip(1).take_while(|size| !small(size)).count() + 1;
        let kept = (0..frame.pairs()).map(|_| OnceLock::new()).collect();
        Self { sampler, encoding, sizes, first, kept }
    }

    /// The level for a footprint of `side` texels; 0 is the texels themselves, also where the level is not kept.
    pub(super) fn level(&self, side: f64) -> usize {
        let last = self.sizes.len() - 1;
        let level = (0..last).take_while(|&level| side > SPANNED * (1u64 << level) as f64).count();
        if level < self.first { 0 } else { level }
    }

    /// Columns and rows of a level.
    pub(super) fn size(&self, level: usize) -> [usize; 2] {
        self.sizes[level]
    }

    /// Encoded samples of some cells of a level that is kept, one after the other.
    pub(super) fn values(
        &self,
        level: usize,
        cells: impl Iterator<Item = usize>,
        light: &Vector3<f32>,
        view: &Vector3<f32>,
    ) -> impl Iterator<Item = [f32; 3]> {
        let start = self.sizes[self.first..level].iter().map(|[width, height]| width * height).sum::<usize>();
        let pairs = self.sampler.frame().blend(light, view);
        let pictures = pairs.map(|(pair, weight)| (weight > 0.0).then(|| (self.of_pair(pair), weight)));
        cells.map(move |cell| {
            let mut sum = [0.0; 3];
            for (picture, weight) in pictures.iter().flatten() {
                (0..3).for_each(|c| sum[c] += weight * picture[start + cell][c]);
            }
            sum
        })
    }

    /// The cells of a measured pair.
    fn of_pair(&self, pair: usize) -> &[[f32; 3]] {
        // Made outside of the lock: while a codec waits for its own threads, this one may come here again.
        match self.kept[pair].get() {
            Some(kept) => kept,
            None => {
                let made = self.make(pair);
                self.kept[pair].get_or_init(|| made)
            }
        }
    }

    fn make(&self, pair: usize) -> Vec<[f32; 3]> {
        let frame = self.sampler.frame();
        let (view, light) = (pair / frame.lights.len(), pair % frame.lights.len());
        let picture = self.sampler.picture(&frame.lights.vectors()[light].cast(), &frame.views.vectors()[view].cast());
        let decoded = |sample: &[f32; 3]| sample.map(|s| self.encoding.decode(s));
        let mut cells: Vec<[f32; 3]> = picture.as_chunks().0.iter().map(decoded).collect();
        let mut kept = Vec::new();
        for level in 1..self.sizes.len() {
            cells = averaged(&cells, self.sizes[level - 1], self.sizes[level]);
            if level >= self.first {
                kept.extend(cells.iter().map(|cell| cell.map(|c| self.encoding.encode(c))));
            }
        }
        kept
    }
}

/// Means over `to` cells of `from`, (columns, rows) each; cells that lie across a border count on both sides by their share.
fn averaged(cells: &[[f32; 3]], from: [usize; 2], to: [usize; 2]) -> Vec<[f32; 3]> {
    let mean = |[column, row]: [usize; 2]| {
        let mut sum = [0.0; 3];
        for (y, v) in shares(row, to[1], from[1]) {
            for (x, u) in shares(column, to[0], from[0]) {
                (0..3).for_each(|c| sum[c] += u * v * cells[y * from[0] + x][c]);
            }
        }
        sum
    };
    (0..to[0] * to[1]).map(|i| mean([i % to[0], i / to[0]])).collect()
}

/// The cells of `from` along a side that one of `to` covers, and their shares of it, which sum to 1.
fn shares(cell: usize, to: usize, from: usize) -> impl Iterator<Item = (usize, f32)> {
    // In units of 1 / (from · to) of the side.
    let covered: Range<usize> = cell * from..(cell + 1) * from;
    (covered.start / to..covered.end.div_ceil(to)).map(move |other| {
        let overlap = covered.end.min((other + 1) * to) - covered.start.max(other * to);
        (other, overlap as f32 / from as f32)
    })
}
