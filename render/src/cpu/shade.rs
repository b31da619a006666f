//! Texture lookups, materials, and the average over each pixel's sub-samples.

use super::fragments::{Fragment, Fragments};
use super::samples::Samples;
use super::visibility::NONE;
use crate::filter::MipChain;
use crate::material::{Lit, Spot};
use crate::resolve::Accumulator;
use capture::Image;
use nalgebra::{Point2, Point3};
use rayon::prelude::*;

/// What sub-samples show.
#[derive(Debug)]
pub(super) struct Look<'a> {
    pub(super) chain: &'a MipChain<'a>,
    pub(super) lit: Option<&'a Lit<'a>>,
    pub(super) eye: Point3<f64>,
    pub(super) background: Option<[u8; 3]>,
}

/// Fills in what the tiles see; the rest of `frame` stays as it is.
pub(super) fn frame(frame: &mut Image<[u8; 4]>, samples: &Samples, tiles: &[Fragments], look: &Look<'_>) {
    let per_pixel = samples.per_side() * samples.per_side();
    let shaded: Vec<Vec<[u8; 4]>> = tiles.par_iter().map(|tile| pixels(tile, look, per_pixel)).collect();
    let width = frame.width();
    for (tile, pixels) in shaded.iter().enumerate().filter(|(_, pixels)| !pixels.is_empty()) {
        let (columns, rows) = samples.tile_pixels(tile);
        for (y, line) in rows.zip(pixels.chunks(columns.len())) {
            frame.pixels_mut()[y * width + columns.start..y * width + columns.end].copy_from_slice(line);
        }
    }
}

/// The pixels of one tile, row by row.
fn pixels(tile: &Fragments, look: &Look<'_>, per_pixel: usize) -> Vec<[u8; 4]> {
    let mut fragments = tile.fragments.iter();
    let mut coated = tile.coated.iter();
    tile.counts
        .iter()
        .map(|&count| {
            let mut sum = Accumulator::default();
            for fragment in fragments.by_ref().take(usize::from(count)) {
                sum.add(match (look.lit, coated.next()) {
                    (Some(lit), Some(&face)) if face != NONE => look.lit(lit, face, fragment),
                    _ => look.chain.sample(fragment.x, fragment.y, fragment.level),
                });
            }
            sum.finish(per_pixel, look.background)
        })
        .collect()
}

impl Look<'_> {
    fn lit(&self, lit: &Lit<'_>, face: u32, fragment: &Fragment) -> [f32; 3] {
        let [width, height] = [self.chain.level(0).width(), self.chain.level(0).height()].map(|side| side as f64);
        let uv = Point2::new(f64::from(fragment.x) / width, f64::from(fragment.y) / height);
        let side = (f64::from(fragment.level) / (width * height)).sqrt();
        lit.colour(&Spot { face: face as usize, uv, side }, &self.eye)
    }
}
