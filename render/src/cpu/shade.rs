//! Texture lookups, materials, and the average over each pixel's sub-samples.

use super::samples::Samples;
use super::seen::{Run, SPAN, Seen, Span, Surface};
use crate::filter::{Channel, Eight, MipChain, quick_level_of_footprint};
use crate::material::{Lit, Spot};
use crate::resolve::Accumulator;
use crate::simd::{Lanes, Level, Work};
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
    fn run<E: Lanes>(self) {
        let Shading { samples, tiles, background, .. } = self.shading;
        self.pixels.fill(Accumulator::default().finish(1, *background));
        let across = samples.tiles_across();
        for tile in self.band * across..(self.band + 1) * across {
            self.shading.tile::<E>(&tiles[tile], tile, self.width, self.pixels);
        }
    }
}

impl<T: Channel> Shading<'_, T> {
    /// Draws a tile into its band, pixel row by pixel row.
    #[inline(always)]
    fn tile<E: Eight>(&self, seen: &Seen, tile: usize, width: usize, band: &mut [[u8; 4]]) {
        let n = self.samples.per_side();
        let (columns, rows) = self.samples.tile_pixels(tile);
        let mut sums = vec![Accumulator::default(); columns.len()];
        for runs in seen.runs.chunk_by(|a, b| a.row as usize / n == b.row as usize / n) {
            let y = runs[0].row as usize / n - rows.start;
            let pixels = &mut band[y * width..][columns.clone()];
            sums.fill(Accumulator::default());
            for run in runs {
                let first = run.column as usize - n * columns.start;
                let surface = &seen.surfaces[run.surface as usize];
                if n == 1 && !surface.is_coated {
                    self.pixels::<E>(run, surface, &mut pixels[first..]);
                } else {
                    self.add::<E>(run, surface, first, &mut sums);
                }
            }
            for (pixel, sum) in pixels.iter_mut().zip(&sums).filter(|(_, sum)| !sum.is_empty()) {
                *pixel = sum.finish(n * n, self.background);
            }
        }
    }

    /// Draws the pixels of a run of which each is one sub-sample.
    #[inline(always)]
    fn pixels<E: Eight>(&self, run: &Run, surface: &Surface, pixels: &mut [[u8; 4]]) {
        let pixels = pixels.chunks_mut(SPAN).take(usize::from(run.length).div_ceil(SPAN)).enumerate();
        for (k, pixels) in pixels {
            let count = (usize::from(run.length) - k * SPAN).min(SPAN).min(pixels.len());
            let colours = self.look_up::<E>(surface, &self.span(run, k * SPAN, surface), count);
            // The mean of one. A plain loop: `map` over an array is not always inlined.
            let mut means = [[0; 4]; SPAN];
            for (mean, colour) in means.as_flattened_mut().iter_mut().zip(colours.as_flattened()) {
                *mean = colour.rounded();
            }
            means.iter_mut().for_each(|mean| mean[3] = 255);
            match pixels.first_chunk_mut::<SPAN>() {
                Some(pixels) if count == SPAN => *pixels = means,
                _ => pixels[..count].copy_from_slice(&means[..count]),
            }
        }
    }

    /// Adds the sub-samples of a run, from place `first` of the tile's row on, to the `sums` of their pixels.
    #[inline(always)]
    fn add<E: Eight>(&self, run: &Run, surface: &Surface, first: usize, sums: &mut [Accumulator]) {
        let n = self.samples.per_side();
        let look = &self.looks[surface.part as usize];
        for start in (0..usize::from(run.length)).step_by(SPAN) {
            let count = (usize::from(run.length) - start).min(SPAN);
            let span = self.span(run, start, surface);
            let mut add = |k: usize, colour: [f32; 3]| sums[(first + start + k) / n].add(colour);
            match look.lit.as_ref().filter(|_| surface.is_coated) {
                Some(lit) => (0..count).for_each(|k| add(k, look.lit(lit, surface.face, &span, k))),
                None => {
                    let colours = self.look_up::<E>(surface, &span, count);
                    for (k, [r, g, b, _]) in colours.into_iter().enumerate().take(count) {
                        add(k, [r, g, b].map(|v| v.widened() * T::LEVELS));
                    }
                }
            }
        }
    }

    /// Where the sub-samples of a run look, from its `start` on.
    #[inline(always)]
    fn span(&self, run: &Run, start: usize, surface: &Surface) -> Span {
        let (column, row) = (run.column as usize + start, run.row as usize);
        match self.samples.line(row) {
            Some(y) => surface.look_up(&self.samples.across(column), &[y; SPAN]),
            None => {
                let [xs, ys] = self.samples.positions(column, row);
                surface.look_up(&xs, &ys)
            }
        }
    }

    /// The texels at the first `count` places of a span.
    #[inline(always)]
    fn look_up<E: Eight>(&self, surface: &Surface, span: &Span, count: usize) -> [[T; 4]; SPAN] {
        let mut levels = [0.0; SPAN];
        for k in 0..SPAN {
            levels[k] = quick_level_of_footprint(span.footprint[k]);
        }
        let chain = &self.looks[surface.part as usize].chain;
        chain.look_up::<E>([&span.x, &span.y, &levels], count)
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
