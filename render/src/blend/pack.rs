//! Layers as a blend reads them: straight through, and only those that a facet has.
//!
//! Blocks of the atlas follow one another; within a block its facets ([`Chunk`]); within these, 32 values (a value is a
//! channel of a texel) after 32; of these, the layers two by two. So one line of cache holds 32 values of two layers, side
//! by side as the multiply-add of pairs of all vector units wants them. No byte is read that the facet's rank does not ask for.

use super::wanted::{BLOCK, BLOCK_LEVEL};
use texture::Layers;

/// Values blended side by side.
pub(super) const VALUES: usize = 32;

/// A line of cache: of each value, two layers' texels less 128.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct Line(pub(super) [i8; 2 * VALUES]);

/// Texels of one row of the atlas.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    /// Column of the first.
    pub(super) column: u32,
    /// Row within the block.
    pub(super) row: u16,
    /// How many there are.
    pub(super) length: u16,
}

/// The texels of a block that belong to one facet.
#[derive(Clone, Debug, Default)]
pub(super) struct Chunk {
    pub(super) facet: u32,
    /// Where its texels lie, in the order of its values.
    pub(super) runs: Vec<Run>,
    /// Its first line, and how many.
    pub(super) first: usize,
    pub(super) count: usize,
    /// Its share of the block, as reductions to one texel weigh it.
    pub(super) share: f32,
    /// Of each layer, its part of that texel: `Σ weight · (texel − 128)`.
    pub(super) means: Vec<[f32; 3]>,
}

/// All layers.
#[derive(Debug)]
pub(super) struct Packed {
    /// Of each block, row by row.
    pub(super) blocks: Vec<Vec<Chunk>>,
    pub(super) lines: Vec<Line>,
}

impl Packed {
    pub(super) fn new(layers: &Layers) -> Self {
        let map = &layers.facet_of_texel;
        let (across, down) = (map.width().div_ceil(BLOCK), map.height().div_ceil(BLOCK));
        let mut packed = Self { blocks: Vec::with_capacity(across * down), lines: Vec::new() };
        for (by, bx) in (0..down).flat_map(|by| (0..across).map(move |bx| (by, bx))) {
            let reduction = [reduction(map.width() - bx * BLOCK), reduction(map.height() - by * BLOCK)];
            let put = |chunk| packed.put(layers, [bx, by], chunk, &reduction);
            let chunks = chunks(layers, bx, by).into_iter().map(put).collect();
            packed.blocks.push(chunks);
        }
        packed
    }

    fn put(
        &mut self,
        layers: &Layers,
        [bx, by]: [usize; 2],
        mut chunk: Chunk,
        [columns, rows]: &[[f32; BLOCK]; 2],
    ) -> Chunk {
        let rank = layers.facets[chunk.facet as usize].rank.min(layers.layers.len());
        let places = chunk.runs.iter().flat_map(|run| {
            let first = run.column as usize;
            (first..first + usize::from(run.length)).map(|column| [column, usize::from(run.row)])
        });
        let places: Vec<[usize; 2]> = places.collect();
        let weight = |&[column, row]: &[usize; 2]| columns[column - bx * BLOCK] * rows[row];
        let (pairs, groups) = (rank.div_ceil(2), (3 * places.len()).div_ceil(VALUES));
        chunk.first = self.lines.len();
        chunk.count = pairs * groups;
        chunk.share = places.iter().map(weight).sum();
        self.lines.resize(chunk.first + chunk.count, Line([0; 2 * VALUES]));
        let lines = &mut self.lines[chunk.first..];
        for (k, layer) in layers.layers[..rank].iter().enumerate() {
            let mut mean = [0.0; 3];
            for (t, place) in places.iter().enumerate() {
                let texel = layer.texels.at(place[0], by * BLOCK + place[1]).map(|v| (v ^ 0x80).cast_signed());
                for (c, value) in texel.into_iter().enumerate() {
                    let i = 3 * t + c;
                    lines[i / VALUES * pairs + k / 2].0[2 * (i % VALUES) + k % 2] = value;
                    mean[c] += weight(place) * f32::from(value);
                }
            }
            chunk.means.push(mean);
        }
        chunk
    }
}

/// What each of `left` texels side by side (of at most a block) weighs when they are halved to one, a last one without
/// a pair being repeated.
fn reduction(left: usize) -> [f32; BLOCK] {
    let length = left.min(BLOCK);
    let weight = |of: usize| {
        let mut line = vec![0.0; length];
        line[of] = 1.0;
        for _ in 0..BLOCK_LEVEL {
            line = line.chunks(2).map(|pair| 0.5 * (pair[0] + pair[pair.len() - 1])).collect();
        }
        line[0]
    };
    std::array::from_fn(|of| if of < length { weight(of) } else { 0.0 })
}

/// The facets of a block in the order in which they first come, with their runs.
fn chunks(layers: &Layers, bx: usize, by: usize) -> Vec<Chunk> {
    let map = &layers.facet_of_texel;
    let columns = bx * BLOCK..((bx + 1) * BLOCK).min(map.width());
    let mut chunks: Vec<Chunk> = Vec::new();
    for (row, y) in (by * BLOCK..((by + 1) * BLOCK).min(map.height())).enumerate() {
        let mut column = columns.start;
        for same in map.row(y)[columns.clone()].chunk_by(|a, b| a == b) {
            let facet = u32::from(same[0]);
            let run = Run { column: column as u32, row: row as u16, length: same.len() as u16 };
            column += same.len();
            match chunks.iter_mut().find(|chunk| chunk.facet == facet) {
                Some(chunk) => chunk.runs.push(run),
                None => chunks.push(Chunk { facet, runs: vec![run], ..Chunk::default() }),
            }
        }
    }
    chunks
}
