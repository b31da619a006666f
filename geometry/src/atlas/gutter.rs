//! Smooth content for the texels between charts, by push-pull (Gortler, Grzeszczuk, Szeliski, Cohen
//! 1996; Morse, Goodman, Reiser 1999).
//!
//! Push: every pixel of a half-size level is the mean of its known children. Pull: every unknown pixel
//! is the bilinear interpolation of the level above. Which pixels count depends on the mask alone, so
//! the fill is a linear operator: filled layers blend to the fill of the blend, and a constant stays
//! constant. Smooth gutters keep chart borders out of the image codec's high frequencies. Cost: 4/3 of
//! the atlas once, memory 1/3 of the image.

use rayon::prelude::*;

/// A push-pull fill for one mask, reusable for any number of images of its size.
#[derive(Clone, Debug)]
pub struct PushPull {
    levels: Vec<Level>,
}

#[derive(Clone, Debug)]
struct Level {
    width: usize,
    height: usize,
    known: Vec<bool>,
}

impl PushPull {
    /// Prepares the fill of a `width` × `height` image that is known where `known` (row by row) is
    /// true. A short mask counts as unknown beyond its end.
    pub fn new([width, height]: [usize; 2], known: &[bool]) -> Self {
        let mut finest = known.to_vec();
        finest.resize(width * height, false);
        let mut levels = vec![Level { width, height, known: finest }];
        while let Some(coarser) = levels.last().and_then(Level::coarser) {
            levels.push(coarser);
        }
        Self { levels }
    }

    /// Fills the unknown pixels of an image with `channels` interleaved channels; known ones stay as
    /// they are. Without any known pixel everything becomes 0. An image of another size is left alone.
    pub fn apply(&self, image: &mut [f32], channels: usize) {
        if channels == 0 || image.len() != self.levels[0].known.len() * channels || image.is_empty() {
            return;
        }
        match channels {
            1 => self.fill::<1>(image, 1),
            3 => self.fill::<3>(image, 3),
            4 => self.fill::<4>(image, 4),
            _ => self.fill::<0>(image, channels),
        }
    }

    /// `C` is the number of channels where it is known to the compiler, else 0.
    fn fill<const C: usize>(&self, image: &mut [f32], channels: usize) {
        let mut pyramid: Vec<Vec<f32>> = Vec::with_capacity(self.levels.len());
        for pair in self.levels.windows(2) {
            let finer = pyramid.last().map_or(&*image, Vec::as_slice);
            let coarser = push::<C>(&pair[0], finer, &pair[1], channels);
            pyramid.push(coarser);
        }
        for i in (0..pyramid.len()).rev() {
            let (finer, coarser) = pyramid.split_at_mut(i);
            let target = finer.last_mut().map_or(&mut *image, |finer| finer.as_mut_slice());
            pull::<C>(&self.levels[i], target, &self.levels[i + 1], &coarser[0], channels);
        }
        if self.levels.last().is_some_and(|top| !top.known.contains(&true)) {
            image.fill(0.0);
        }
    }
}

impl Level {
    /// The next level, or `None` above one pixel or one that is known everywhere.
    fn coarser(&self) -> Option<Self> {
        if self.width * self.height <= 1 || self.known.iter().all(|&k| k) {
            return None;
        }
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let any = |i: usize| self.children(i % width, i / width).any(|child| self.known[child]);
        Some(Self { width, height, known: (0..width * height).map(any).collect() })
    }

    /// The pixels of this level below pixel (x, y) of the next.
    fn children(&self, x: usize, y: usize) -> impl Iterator<Item = usize> {
        let columns = 2 * x..(2 * x + 2).min(self.width);
        (2 * y..(2 * y + 2).min(self.height)).flat_map(move |y| columns.clone().map(move |x| y * self.width + x))
    }
}

/// Means of known children.
fn push<const C: usize>(finer: &Level, image: &[f32], coarser: &Level, channels: usize) -> Vec<f32> {
    let channels = if C > 0 { C } else { channels };
    let mut out = vec![0.0; coarser.known.len() * channels];
    out.par_chunks_mut(coarser.width * channels).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.chunks_exact_mut(channels).enumerate() {
            let mut count = 0.0;
            for child in finer.children(x, y).filter(|&child| finer.known[child]) {
                count += 1.0;
                add(pixel, &image[child * channels..][..channels], 1.0);
            }
            if count > 1.0 {
                pixel.iter_mut().for_each(|v| *v /= count);
            }
        }
    });
    out
}

/// Interpolates unknown pixels. A pixel's centre lies a quarter of a coarse pixel from its parent's, so
/// the weights are 9, 3, 3 and 1 sixteenths; every coarse pixel has a value by then.
fn pull<const C: usize>(finer: &Level, image: &mut [f32], coarser: &Level, above: &[f32], channels: usize) {
    let channels = if C > 0 { C } else { channels };
    image.par_chunks_mut(finer.width * channels).enumerate().for_each(|(y, row)| {
        let known = &finer.known[y * finer.width..][..finer.width];
        let rows = parents(y, coarser.height);
        for (x, pixel) in row.chunks_exact_mut(channels).enumerate().filter(|(x, _)| !known[*x]) {
            pixel.fill(0.0);
            for (py, wy) in rows {
                for (px, wx) in parents(x, coarser.width) {
                    add(pixel, &above[(py * coarser.width + px) * channels..][..channels], wx * wy);
                }
            }
        }
    });
}

/// The two coarse neighbours along one axis, with their weights.
fn parents(i: usize, coarse_length: usize) -> [(usize, f32); 2] {
    let own = i / 2;
    let other = if i.is_multiple_of(2) { own.saturating_sub(1) } else { (own + 1).min(coarse_length - 1) };
    [(own, 0.75), (other, 0.25)]
}

fn add(pixel: &mut [f32], values: &[f32], weight: f32) {
    pixel.iter_mut().zip(values).for_each(|(p, v)| *p += weight * v);
}
