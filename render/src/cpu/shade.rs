//! Texture lookups, materials, and the average over each pixel's sub-samples.

use super::samples::Samples;
use super::seen::{Run, SPAN, Seen, Span, Surface};
use crate::filter::{Channel, MipChain, quick_level_of_footprint};
use crate::material::{Lit, Spot};
use crate::resolve::Accumulator;
use crate::simd::{Level, Work};
use capture::Image;
use nalgebra::{Point2, Point3};
use rayon::prelude::*;

/// What the sub-samples of one part show.
#[derive(Debug)]
pub(super) struct Look<'a, T: Channel> {
    pub(super) chain: MipChain<'a, T>,
    pub(super) lit: Option<Lit<'a>>,
    /// In the part's coordinates.
    pub(super) eye: Point3<f64>,
}

/// What all tiles show.
#[derive(Debug)]
pub(super) struct Shading<'a, T: Channel> {
    pub(super) samples: &'a Samples,
    pub(super) tiles: &'a [Seen],
    /// One per part.
    pub(super) looks: &'a [Look<'a, T>],
    pub(super) background: Option<[u8; 3]>,
}

impl<T: Channel> Shading<'_, T> {
    /// Draws every pixel of `frame`.
    pub(super) fn draw(&self, frame: &mut Image<[u8; 4]>, level: Level) {
        let (width, (_, rows)) = (frame.width(), self.samples.tile_pixels(0));
        let bands = frame.pixels_mut().par_chunks_mut(width * rows.len()).enumerate();
        bands.for_each(|(band, pixels)| level.run(Band { shading: self, band, width, pixels }));
    }
}

/// A row of tiles.
struct Band<'a, T: Channel> {
    shading: &'a Shading<'a, T>,
    band: usize,
    width: usize,
    pixels: &'a mut [[u8; 4]],
}

impl<T: Channel> Work for Band<'_, T> {
    #[inline(always)]
    fn run(self) {
        let Shading { samples, tiles, background, .. } = self.shading;
        self.pixels.fill(Accumulator::default().finish(1, *background));
        let across = samples.tiles_across();
        for tile in self.band * across..(self.band + 1) * across {
            self.shading.tile(&tiles[tile], tile, self.width, self.pixels);
        }
    }
}

impl<T: Channel> Shading<'_, T> {
    /// Draws a tile into its band, pixel row by pixel row.
    #[inline(always)]
    fn tile(&self, seen: &Seen, tile: usize, width: usize, band: &mut [[u8; 4]]) {
        let n = self.samples.per_side();
        let (columns, rows) = self.samples.tile_pixels(tile);
        let mut sums = vec![Accumulator::default(); columns.len()];
        let mut scratch = Scratch::default();
        for runs in seen.runs.chunk_by(|a, b| a.row as usize / n == b.row as usize / n) {
            sums.fill(Accumulator::default());
            for run in runs {
                let first = run.column as usize - n * columns.start;
                self.run(run, &seen.surfaces[run.surface as usize], &mut scratch, |k, colour| {
                    let pixel = if n == 1 { first + k } else { (first + k) / n };
                    sums[pixel].add(colour);
                });
            }
            let y = runs[0].row as usize / n - rows.start;
            let pixels = &mut band[y * width..][columns.clone()];
            for (pixel, sum) in pixels.iter_mut().zip(&sums).filter(|(_, sum)| !sum.is_empty()) {
                *pixel = sum.finish(n * n, self.background);
            }
        }
    }

    /// Tells the colour of each sub-sample of a run.
    #[inline(always)]
    fn run(&self, run: &Run, surface: &Surface, scratch: &mut Scratch, mut tell: impl FnMut(usize, [f32; 3])) {
        let length = usize::from(run.length);
        let Scratch { xs, ys, span } = scratch;
        let (xs, ys) = (&mut xs[..length], &mut ys[..length]);
        self.samples.positions(run.column as usize, run.row as usize, xs, ys);
        surface.look_up(xs, ys, span);
        let look = &self.looks[surface.part as usize];
        if let (Some(lit), true) = (&look.lit, surface.is_coated) {
            return (0..length).for_each(|k| tell(k, look.lit(lit, surface.face, span, k)));
        }
        let mut levels = [0.0; SPAN];
        for (level, &footprint) in levels.iter_mut().zip(&span.footprint[..length]) {
            *level = quick_level_of_footprint(footprint);
        }
        for k in 0..length {
            tell(k, look.chain.sample(span.x[k], span.y[k], levels[k]));
        }
    }
}

/// Where sub-samples lie and what they look up.
struct Scratch {
    xs: [f64; SPAN],
    ys: [f64; SPAN],
    span: Span,
}

impl Default for Scratch {
    fn default() -> Self {
        let span = Span { x: [0.0; SPAN], y: [0.0; SPAN], footprint: [0.0; SPAN] };
        Self { xs: [0.0; SPAN], ys: [0.0; SPAN], span }
    }
}

impl<T: Channel> Look<'_, T> {
    fn lit(&self, lit: &Lit<'_>, face: u32, span: &Span, k: usize) -> [f32; 3] {
        let [width, height] = [self.chain.level(0).width(), self.chain.level(0).height()].map(|side| side as f64);
        let uv = Point2::new(f64::from(span.x[k]) / width, f64::from(span.y[k]) / height);
        let side = (f64::from(span.footprint[k]) / (width * height)).sqrt();
        lit.colour(&Spot { face: face as usize, uv, side }, &self.eye)
    }
}
