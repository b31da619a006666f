//! The lumigraph, blended where it is looked at.
//!
//! What [`texture::appearance::Lumigraph::blend`] says, in `f32`: of a texel's rays the four nearest to the eye by angle
//! weigh `(1 − pen / thresh) / pen`, thresh the fifth smallest penalty. Penalties are chords, lengths of differences of unit
//! vectors, and so hold near zero. Directions of rays do not depend on the eye: they are found once, in 16 bits a
//! coordinate (off by 3e-5 rad), 6 bytes a ray beside the 5 it has.
//!
//! Texels without rays, and those between charts, are filled by push–pull from all others. Where nobody looks these are
//! the means of their rays, so that a frame depends on the eye alone, not on the frame before.

use super::Rows;
use super::wanted::{BLOCK, Wanted};
use crate::filter::FIXED_ONE;
use crate::simd::{Lanes, Level, Work};
use capture::Image;
use geometry::atlas::PushPull;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use std::sync::Arc;
use texture::SurfaceTexels;
use texture::appearance::{Lumigraph, NO_RAY};

/// Rays blended for one texel.
const BLENDED: usize = 4;

/// One in the coordinates of a direction.
const UNIT: f32 = 32767.0;

/// Penalty of a ray that is not there: beyond any chord.
const NOWHERE: f32 = 1e9;

/// All rays, ready to be asked, and what they last answered.
#[derive(Debug)]
pub(super) struct Rays<'a> {
    laid: Arc<Laid<'a>>,
    /// As last seen.
    seen: Image<[f32; 3]>,
}

/// What does not depend on the eye: objects of one model share it.
#[derive(Debug)]
struct Laid<'a> {
    rays: &'a Lumigraph,
    surface: &'a SurfaceTexels,
    /// Towards the views, coordinate by coordinate, per texel: 3 × rays.
    directions: Vec<i16>,
    /// Where the texels of each row of the atlas begin, and the end.
    rows: Vec<usize>,
    /// Mean colours of texels with rays.
    means: Image<[f32; 3]>,
    fill: PushPull,
    level: Level,
}

impl<'a> Rays<'a> {
    pub(super) fn new(rays: &'a Lumigraph, surface: &'a SurfaceTexels, level: Level) -> Self {
        let [width, height] = surface.size;
        let directions = (0..surface.len()).into_par_iter().flat_map_iter(|t| directions(rays, surface, t)).collect();
        let rows = (0..=height).map(|y| surface.index.partition_point(|&at| (at as usize) < y * width)).collect();
        let mut means = Image::filled(width, height, [0.0; 3]);
        let mut known = vec![false; width * height];
        for (t, &at) in surface.index.iter().enumerate() {
            if let Some(mean) = mean(rays, t) {
                means.pixels_mut()[at as usize] = mean;
                known[at as usize] = true;
            }
        }
        let fill = PushPull::new(surface.size, &known);
        let seen = means.clone();
        Self { laid: Arc::new(Laid { rays, surface, directions, rows, means, fill, level }), seen }
    }

    /// The same rays for another eye.
    pub(super) fn another(&self) -> Self {
        Self { laid: Arc::clone(&self.laid), seen: self.laid.means.clone() }
    }

    /// Blends what is wanted.
    pub(super) fn blend(&mut self, eye: &Point3<f64>, wanted: &Wanted) {
        let Self { laid, seen } = self;
        let width = laid.surface.size[0].max(1);
        let rows = seen.pixels_mut().par_chunks_mut(width).zip(laid.means.pixels().par_chunks(width)).enumerate();
        rows.for_each(|(y, (row, means))| {
            row.copy_from_slice(means);
            laid.level.run(Row { rays: laid, eye, wanted, y, texels: row });
        });
        laid.fill.apply(seen.pixels_mut().as_flattened_mut(), 3);
    }

    /// Puts a block where it is looked up; how many bytes were read for it.
    pub(super) fn fill(&self, [bx, by]: [usize; 2], rows: &mut Rows<'_>) -> u64 {
        let columns = bx * BLOCK..((bx + 1) * BLOCK).min(rows.width);
        for (y, row) in rows.texels.chunks_mut(rows.width).enumerate() {
            for (texel, seen) in row[columns.clone()].iter_mut().zip(&self.seen.row(by * BLOCK + y)[columns.clone()]) {
                *texel = seen.map(|v| (v * FIXED_ONE).round_ties_even() as i16);
            }
        }
        let bytes_of_ray = 3 + size_of::<u16>() + 3 * size_of::<i16>();
        (columns.len() * rows.texels.len() / rows.width * self.laid.rays.rays * bytes_of_ray) as u64
    }
}

/// Unit vectors towards a texel's views, 0 where there is none.
fn directions(rays: &Lumigraph, surface: &SurfaceTexels, texel: usize) -> Vec<i16> {
    let mut out = vec![0; 3 * rays.rays];
    for (k, &view) in rays.views[texel * rays.rays..][..rays.rays].iter().enumerate().filter(|(_, v)| **v != NO_RAY) {
        let toward = rays.centers[usize::from(view)] - surface.positions[texel];
        let unit = toward.try_normalize(1e-300).unwrap_or_default() * f64::from(UNIT);
        (0..3).for_each(|c| out[c * rays.rays + k] = unit[c].round() as i16);
    }
    out
}

/// The mean of a texel's rays.
fn mean(rays: &Lumigraph, texel: usize) -> Option<[f32; 3]> {
    let row = texel * rays.rays..(texel + 1) * rays.rays;
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for k in row.filter(|&k| rays.views[k] != NO_RAY) {
        (0..3).for_each(|c| sum[c] += f32::from(rays.colors[k][c]));
        count += 1.0;
    }
    (count > 0.0).then(|| sum.map(|s| s / count))
}

/// The wanted texels of a row.
struct Row<'a> {
    rays: &'a Laid<'a>,
    eye: &'a Point3<f64>,
    wanted: &'a Wanted,
    y: usize,
    texels: &'a mut [[f32; 3]],
}

impl Work for Row<'_> {
    #[inline(always)]
    fn run<E: Lanes>(self) {
        let width = self.texels.len();
        let blocks = self.y / BLOCK * width.div_ceil(BLOCK);
        let mut penalties = vec![0.0; self.rays.rays.rays];
        for t in self.rays.rows[self.y]..self.rays.rows[self.y + 1] {
            let x = self.rays.surface.index[t] as usize - self.y * width;
            if !self.wanted.holds(blocks + x / BLOCK) {
                continue;
            }
            let Some(to_eye) = (self.eye - self.rays.surface.positions[t]).try_normalize(1e-300) else { continue };
            self.rays.penalise(t, &to_eye.cast(), &mut penalties);
            if let Some(color) = self.rays.mix(t, &penalties) {
                self.texels[x] = color;
            }
        }
    }
}

impl Laid<'_> {
    /// Squared penalties of a texel's rays.
    #[inline(always)]
    fn penalise(&self, texel: usize, to_eye: &Vector3<f32>, penalties: &mut [f32]) {
        let rays = penalties.len();
        let directions = &self.directions[texel * 3 * rays..][..3 * rays];
        let (xs, rest) = directions.split_at(rays);
        let (ys, zs) = rest.split_at(rays);
        let views = &self.rays.views[texel * rays..][..rays];
        for k in 0..rays {
            let apart = |c: i16, e: f32| {
                let d = f32::from(c) * (1.0 / UNIT) - e;
                d * d
            };
            let squared = apart(xs[k], to_eye.x) + apart(ys[k], to_eye.y) + apart(zs[k], to_eye.z);
            penalties[k] = if views[k] == NO_RAY { NOWHERE } else { squared };
        }
    }

    /// The colour of a texel by the squared penalties of its rays; `None` without rays.
    #[inline(always)]
    fn mix(&self, texel: usize, penalties: &[f32]) -> Option<[f32; 3]> {
        // Nearest first, one more than is blended: the last one is the threshold. Penalties are not negative, so their
        // bits order as they do; the ray's number below them keeps the first of equals first.
        let mut nearest = [u64::MAX; BLENDED + 1];
        for (k, penalty) in (0u64..).zip(penalties) {
            let mut key = u64::from(penalty.to_bits()) << 32 | k;
            for place in &mut nearest {
                (*place, key) = ((*place).min(key), (*place).max(key));
            }
        }
        let nearest = nearest.map(|key| (f32::from_bits((key >> 32) as u32), key as u32 as usize));
        // What is left of the start is not a number.
        let found = nearest.iter().filter(|n| n.0 < NOWHERE).count();
        let last = nearest.get(found.checked_sub(1)?)?.0.sqrt();
        let threshold = if found > BLENDED { last } else { 1.01 * last } + 1e-12;
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for &(squared, k) in nearest.iter().take(found.min(BLENDED)) {
            let penalty = squared.sqrt();
            let weight = (1.0 - penalty / threshold).max(0.0) / penalty.max(1e-6) + 1e-9;
            total += weight;
            let color = self.rays.colors[texel * self.rays.rays + k];
            (0..3).for_each(|c| sum[c] += weight * f32::from(color[c]));
        }
        Some(sum.map(|s| s / total))
    }
}
