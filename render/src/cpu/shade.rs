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
        let mut scratch = Scratch::default();
        for runs in seen.runs.chunk_by(|a, b| a.row as usize / n == b.row as usize / n) {
            let y = runs[0].row as usize / n - rows.start;
            let pixels = &mut band[y * width..][columns.clone()];
            sums.fill(Accumulator::default());
            for run in runs {
                let first = run.column as usize - n * columns.start;
                let surface = &seen.surfaces[run.surface as usize];
                let colours = self.look_up::<E>(run, surface, &mut scratch);
                if n == 1 && !surface.is_coated {
                    // The mean of one.
                    for (pixel, &[r, g, b, _]) in pixels[first..].iter_mut().zip(colours) {
                        *pixel = [r.rounded(), g.rounded(), b.rounded(), 255];
                    }
                    continue;
                }
                for k in 0..usize::from(run.length) {
                    sums[(first + k) / n].add(self.colour(surface, &scratch, k));
                }
            }
            for (pixel, sum) in pixels.iter_mut().zip(&sums).filter(|(_, sum)| !sum.is_empty()) {
                *pixel = sum.finish(n * n, self.background);
            }
        }
    }

    /// Where the sub-samples of a run look, and the texels there unless the surface carries a material.
    #[inline(always)]
    fn look_up<'s, E: Eight>(&self, run: &Run, surface: &Surface, scratch: &'s mut Scratch<T>) -> &'s [[T; 4]] {
        let length = usize::from(run.length);
        let Scratch { xs, ys, span, colours } = scratch;
        let (xs, ys) = (&mut xs[..length], &mut ys[..length]);
        self.samples.positions(run.column as usize, run.row as usize, xs, ys);
        surface.look_up(xs, ys, span);
        if surface.is_coated {
            return &[];
        }
        let mut levels = [0.0; SPAN];
        for (level, &footprint) in levels.iter_mut().zip(&span.footprint[..length]) {
            *level = quick_level_of_footprint(footprint);
        }
        let chain = &self.looks[surface.part as usize].chain;
        chain.look_up_all::<E, SPAN>([&span.x, &span.y, &levels], &mut colours[..length]);
        &colours[..length]
    }

    /// What sub-sample `k` of the run looked up shows.
    #[inline(always)]
    fn colour(&self, surface: &Surface, scratch: &Scratch<T>, k: usize) -> [f32; 3] {
        let look = &self.looks[surface.part as usize];
        match (&look.lit, surface.is_coated) {
            (Some(lit), true) => look.lit(lit, surface.face, &scratch.span, k),
            _ => {
                let [r, g, b, _] = scratch.colours[k];
                [r, g, b].map(|v| v.widened() * T::LEVELS)
            }
        }
    }
}

/// Where sub-samples lie and what they look up.
struct Scratch<T> {
    xs: [f64; SPAN],
    ys: [f64; SPAN],
    span: Span,
    colours: [[T; 4]; SPAN],
}

impl<T: Channel> Default for Scratch<T> {
    fn default() -> Self {
        let span = Span { x: [0.0; SPAN], y: [0.0; SPAN], footprint: [0.0; SPAN] };
        Self { xs: [0.0; SPAN], ys: [0.0; SPAN], span, colours: [[T::default(); 4]; SPAN] }
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
