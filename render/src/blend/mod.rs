//! The texture of a model as seen from an eye, fast: what [`texture::Model::atlas`] says, in 8-bit layers and whole numbers.
//!
//! Of a frame's cost the blend is the part that grows with the layers: 20 of 512² texels are 15.7 MB to read. So:
//!
//! 1. only blocks of 16 × 16 texels that the frame looks at are blended ([`Wanted`]), and of these none whose weights are
//!    what they were: a static texture is blended once;
//! 2. layers stay the bytes they are in the file, laid out in the order in which they are read ([`pack`]), each facet with
//!    as many layers as its rank; weights are rounded to 16 bits ([`weights`]);
//! 3. multiply-adds of pairs on whatever vector unit there is ([`kernel`]), bit for bit the same on all;
//! 4. reductions for the mip levels at once, block by block, while the texels are in the cache. From the level where a block
//!    is one texel, layers were reduced beforehand: the blend is linear, so the share each facet has in a block tells that
//!    texel, for every block, at 1/128 of the cost. A sliver seen edge-on, whose lookups reach over half the atlas, so
//!    asks for no more blocks than its neighbours.
//!
//! A texel of the result is a number in shares of 1/32 level, from −1024 to 1024: bases overshoot 0..=255 and filters must
//! see it. Against [`texture::Model::atlas`] it is off by 1/64 for its own rounding and by what [`weights`] rounds, together
//! under 0.1 level for what photographs give.
//!
//! State: texels of blocks not wanted hold what they held before, or zero. A lumigraph has weights per texel
//! ([`rays`]); it is blended where it is wanted and filled between charts as a whole.

mod kernel;
mod pack;
mod rays;
mod wanted;
mod weights;

pub use wanted::Wanted;

use crate::filter::{FIXED_ONE, MipChain, halve_row, top_level};
use crate::simd::Level;
use capture::Image;
use nalgebra::Point3;
use pack::{Line, Packed, VALUES};
use rayon::prelude::*;
use rays::Rays;
use texture::{Appearance, Layers, Model};
use wanted::{BLOCK, BLOCK_LEVEL};
use weights::Weights;

/// The texture of one model, blended as eyes ask for it.
#[derive(Debug)]
pub struct Atlas<'a> {
    source: Source<'a>,
    /// Level 0, in 1/32 of a level of 0..=255.
    base: Image<[i16; 3]>,
    /// Levels from 1 on.
    reduced: Vec<Image<[i16; 3]>>,
    blocks: Vec<Block>,
    frame: u64,
    bytes: u64,
}

/// A coefficient that is what somebody says, whatever the eye asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pin {
    /// The facet; `None` for all of them.
    pub facet: Option<usize>,
    /// The layer; facets of a lower rank have none to hold.
    pub layer: usize,
    /// Its weight.
    pub weight: f32,
}

/// Where colours come from.
#[derive(Debug)]
enum Source<'a> {
    Layers(LayerSource<'a>),
    Rays(Box<Rays<'a>>),
}

#[derive(Debug)]
struct LayerSource<'a> {
    layers: &'a Layers,
    packed: Packed,
    facets: Vec<FacetState>,
    pins: Vec<Pin>,
    level: Level,
}

/// The weights a facet had when it was last looked at.
#[derive(Clone, Debug, Default)]
struct FacetState {
    is_wanted: bool,
    weights: Weights,
    /// The frame in which they became what they are.
    changed: u64,
}

/// What a block of texels holds.
#[derive(Clone, Copy, Debug, Default)]
struct Block {
    /// The frame in which it was blended.
    blended: u64,
    /// Mip levels made of it since.
    reduced: usize,
}

/// A row of blocks: its texels on the levels where a block has whole texels.
struct Strip<'a> {
    row: usize,
    levels: Vec<Rows<'a>>,
    blocks: &'a mut [Block],
}

/// Some rows of one level.
struct Rows<'a> {
    width: usize,
    texels: &'a mut [[i16; 3]],
}

impl<'a> Atlas<'a> {
    /// Lays out what `model` holds; nothing is blended yet.
    pub fn new(model: &'a Model) -> Self {
        Self::with_level(model, Level::widest())
    }

    pub(crate) fn with_level(model: &'a Model, level: Level) -> Self {
        let (source, [width, height]) = match &model.appearance {
            Appearance::Layers(layers) => {
                let facets = vec![FacetState::default(); layers.facets.len()];
                let size = [layers.facet_of_texel.width(), layers.facet_of_texel.height()];
                (
                    Source::Layers(LayerSource {
                        layers,
                        packed: Packed::new(layers),
                        facets,
                        pins: Vec::new(),
                        level,
                    }),
                    size,
                )
            }
            Appearance::Lumigraph(rays, surface) => {
                (Source::Rays(Box::new(Rays::new(rays, surface, level))), surface.size)
            }
        };
        let side = |length: usize, level: usize| length.div_ceil(1 << level);
        let empty = |level: usize| Image::filled(side(width, level), side(height, level), [0; 3]);
        Self {
            source,
            base: empty(0),
            reduced: (1..=top_level(width, height)).map(empty).collect(),
            blocks: vec![Block::default(); width.div_ceil(BLOCK) * height.div_ceil(BLOCK)],
            frame: 0,
            bytes: 0,
        }
    }

    /// Width and height of the atlas.
    pub fn size(&self) -> [usize; 2] {
        [self.base.width(), self.base.height()]
    }

    /// What to write down for [`Atlas::blend`].
    pub fn wanted(&self) -> Wanted {
        match self.source {
            Source::Layers(_) => Wanted::up_to(BLOCK_LEVEL - 1, self.size()),
            Source::Rays(_) => Wanted::none(self.size()),
        }
    }

    /// Holds these weights fast from now on, and no others; of two for one layer the last. Rays have none.
    pub fn pin(&mut self, pins: &[Pin]) {
        if let Source::Layers(source) = &mut self.source {
            source.pins = pins.to_vec();
        }
    }

    /// Makes what is `wanted` what `eye`, in the model's coordinates, sees. `wanted` must be this atlas's.
    pub fn blend(&mut self, eye: &Point3<f64>, wanted: &Wanted) {
        self.frame += 1;
        let top = wanted.top().min(self.reduced.len());
        match &mut self.source {
            Source::Layers(source) => source.weigh(eye, wanted, self.frame),
            Source::Rays(rays) => rays.blend(eye, wanted),
        }
        let (source, frame) = (&self.source, self.frame);
        let finest = if matches!(source, Source::Layers(_)) { BLOCK_LEVEL - 1 } else { BLOCK_LEVEL };
        let strips = strips(&mut self.base, &mut self.reduced, &mut self.blocks, top.min(finest));
        self.bytes = strips.into_par_iter().map(|strip| source.fill(strip, wanted, frame)).sum();
        if let (Source::Layers(source), true) = (&self.source, top >= BLOCK_LEVEL) {
            source.reduce(&mut self.reduced[BLOCK_LEVEL - 1]);
        }
        for level in BLOCK_LEVEL + 1..=top {
            let (fine, coarse) = self.reduced.split_at_mut(level - 1);
            halve(&fine[level - 2], &mut coarse[0]);
        }
    }

    /// What was blended, ready to be looked up; up to the coarsest level that was wanted.
    pub(crate) fn chain(&self, wanted: &Wanted) -> MipChain<'_, i16> {
        MipChain::of(&self.base, &self.reduced[..wanted.top().min(self.reduced.len())])
    }

    /// The blended texture in 1/32 of a level of 0..=255; what was not wanted holds anything.
    pub fn texels(&self) -> &Image<[i16; 3]> {
        &self.base
    }

    /// Bytes of layers or rays that the last blend read.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}

/// Rows of blocks, each with its part of the levels 0..=`top`, on all of which a block has whole texels.
fn strips<'a>(
    base: &'a mut Image<[i16; 3]>,
    reduced: &'a mut [Image<[i16; 3]>],
    blocks: &'a mut [Block],
    top: usize,
) -> Vec<Strip<'a>> {
    let across = base.width().div_ceil(BLOCK).max(1);
    let strip = |(row, blocks)| Strip { row, levels: Vec::with_capacity(1 + BLOCK_LEVEL), blocks };
    let mut strips: Vec<Strip<'a>> = blocks.chunks_mut(across).enumerate().map(strip).collect();
    let levels = std::iter::once(base).chain(reduced).take(1 + top);
    for (level, image) in levels.enumerate() {
        let width = image.width();
        let parts = image.pixels_mut().chunks_mut(width.max(1) * (BLOCK >> level));
        strips.iter_mut().zip(parts).for_each(|(strip, texels)| strip.levels.push(Rows { width, texels }));
    }
    strips
}

/// One level out of the one below it.
fn halve(fine: &Image<[i16; 3]>, coarse: &mut Image<[i16; 3]>) {
    let width = coarse.width().max(1);
    for (y, row) in coarse.pixels_mut().chunks_mut(width).enumerate() {
        halve_row(fine.row(2 * y), fine.row((2 * y + 1).min(fine.height() - 1)), row);
    }
}

impl Source<'_> {
    /// Makes the wanted blocks of a strip; how many bytes it read.
    fn fill(&self, strip: Strip<'_>, wanted: &Wanted, frame: u64) -> u64 {
        let Strip { row, mut levels, blocks } = strip;
        let across = blocks.len();
        let mut bytes = 0;
        for (column, block) in blocks.iter_mut().enumerate().filter(|(column, _)| wanted.holds(row * across + column)) {
            let [base, ..] = levels.as_mut_slice() else { continue };
            let blended = match self {
                Self::Layers(source) => source.fill(row * across + column, block, base),
                Self::Rays(rays) => Some(rays.fill([column, row], base)),
            };
            if let Some(read) = blended {
                *block = Block { blended: frame, reduced: 0 };
                bytes += read;
            }
            for level in block.reduced + 1..levels.len() {
                let (fine, coarse) = levels.split_at_mut(level);
                coarse[0].halve(&fine[level - 1], column, BLOCK >> level);
                block.reduced = level;
            }
        }
        bytes
    }
}

impl LayerSource<'_> {
    /// Finds the weights of the facets in the wanted blocks.
    fn weigh(&mut self, eye: &Point3<f64>, wanted: &Wanted, frame: u64) {
        // Coarse levels show them all.
        let are_all_wanted = wanted.top() >= BLOCK_LEVEL;
        self.facets.iter_mut().for_each(|facet| facet.is_wanted = are_all_wanted);
        for (_, chunks) in self.packed.blocks.iter().enumerate().filter(|(block, _)| wanted.holds(*block)) {
            chunks.iter().for_each(|chunk| self.facets[chunk.facet as usize].is_wanted = true);
        }
        let layers = &self.layers.layers;
        let pins = &self.pins;
        let facets = self.facets.par_iter_mut().zip(&self.layers.facets).enumerate().with_min_len(8);
        facets.filter(|(_, (state, _))| state.is_wanted).for_each_init(
            Weights::default,
            |weights, (i, (state, facet))| {
                let mut asked = facet.at(eye);
                for pin in pins.iter().filter(|pin| pin.facet.is_none_or(|facet| facet == i)) {
                    asked.get_mut(pin.layer).into_iter().for_each(|weight| *weight = pin.weight);
                }
                weights.round(&asked, layers);
                if *weights != state.weights {
                    std::mem::swap(weights, &mut state.weights);
                    state.changed = frame;
                }
            },
        );
    }

    /// The level where a block is one texel.
    fn reduce(&self, texels: &mut Image<[i16; 3]>) {
        let texels = texels.pixels_mut().par_iter_mut().zip(&self.packed.blocks).with_min_len(64);
        texels.for_each(|(texel, chunks)| {
            let mut sum = [0.0; 3];
            for chunk in chunks {
                let part = self.facets[chunk.facet as usize].weights.apply(&chunk.means, chunk.share);
                (0..3).for_each(|c| sum[c] += part[c]);
            }
            // Casts saturate.
            *texel = sum.map(|s: f32| (s * FIXED_ONE).round_ties_even() as i16);
        });
    }

    /// Blends a block, unless all its weights are what they were; how many bytes it read.
    fn fill(&self, index: usize, block: &Block, rows: &mut Rows<'_>) -> Option<u64> {
        let chunks = &self.packed.blocks[index];
        let is_fresh = |chunk: &pack::Chunk| self.facets[chunk.facet as usize].changed <= block.blended;
        if block.blended > 0 && chunks.iter().all(is_fresh) {
            return None;
        }
        let mut values = [[0; VALUES]; 3 * BLOCK * BLOCK / VALUES];
        let mut lines = 0;
        for chunk in chunks {
            let weights = &self.facets[chunk.facet as usize].weights;
            let texels: usize = chunk.runs.iter().map(|run| usize::from(run.length)).sum();
            let groups = &mut values[..(3 * texels).div_ceil(VALUES)];
            kernel::blend(self.level, &self.packed.lines[chunk.first..][..chunk.count], weights, groups);
            rows.scatter(&chunk.runs, values.as_flattened());
            lines += chunk.count;
        }
        Some((lines * size_of::<Line>()) as u64)
    }
}

impl Rows<'_> {
    /// Puts values where their texels lie.
    fn scatter(&mut self, runs: &[pack::Run], mut values: &[i16]) {
        for run in runs {
            let (length, first) = (usize::from(run.length), usize::from(run.row) * self.width + run.column as usize);
            let (head, rest) = values.split_at(3 * length);
            self.texels[first..first + length].as_flattened_mut().copy_from_slice(head);
            values = rest;
        }
    }

    /// Half of the `column`th block of the level below, `side` texels here.
    fn halve(&mut self, fine: &Rows<'_>, column: usize, side: usize) {
        let part = |width: usize, side: usize| column * side..((column + 1) * side).min(width);
        let (here, there) = (part(self.width, side), part(fine.width, 2 * side));
        // Rows end where the image does: its last one is repeated.
        let last = fine.texels.len() / fine.width - 1;
        for (y, row) in self.texels.chunks_mut(self.width).enumerate() {
            let fine = |y: usize| &fine.texels[y.min(last) * fine.width..][there.clone()];
            halve_row(fine(2 * y), fine(2 * y + 1), &mut row[here.clone()]);
        }
    }
}

#[cfg(test)]
mod tests;
