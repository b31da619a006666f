//! Texture lookups and the average over each pixel's sub-samples.

use super::fragments::Fragments;
use super::samples::Samples;
use crate::filter::MipChain;
use crate::resolve::Accumulator;
use capture::Image;
use rayon::prelude::*;

/// Fills in what the tiles see; the rest of `frame` stays as it is.
pub(super) fn frame(
    frame: &mut Image<[u8; 4]>,
    samples: &Samples,
    tiles: &[Fragments],
    chain: &MipChain,
    background: Option<[u8; 3]>,
) {
    let per_pixel = samples.per_side() * samples.per_side();
    let shaded: Vec<Vec<[u8; 4]>> = tiles.par_iter().map(|tile| pixels(tile, chain, per_pixel, background)).collect();
    let width = frame.width();
    for (tile, pixels) in shaded.iter().enumerate().filter(|(_, pixels)| !pixels.is_empty()) {
        let (columns, rows) = samples.tile_pixels(tile);
        for (y, line) in rows.zip(pixels.chunks(columns.len())) {
            frame.pixels_mut()[y * width + columns.start..y * width + columns.end].copy_from_slice(line);
        }
    }
}

/// The pixels of one tile, row by row.
fn pixels(tile: &Fragments, chain: &MipChain, per_pixel: usize, background: Option<[u8; 3]>) -> Vec<[u8; 4]> {
    let mut fragments = tile.fragments.iter();
    tile.counts
        .iter()
        .map(|&count| {
            let mut sum = Accumulator::default();
            for fragment in fragments.by_ref().take(usize::from(count)) {
                sum.add(chain.sample(fragment.x, fragment.y, fragment.level));
            }
            sum.finish(per_pixel, background)
        })
        .collect()
}
