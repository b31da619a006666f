//! The nine variables of a sample: where, lit from where, seen from where, which colour.
//!
//! | | variable | unit |
//! |---|---|---|
//! | 0, 1 | x, y | texels, centres at half integers |
//! | 2, 3 | α, s of the light | radians, sine |
//! | 4, 5 | α, s of the eye | radians, sine |
//! | 6–8 | colour less the mean picture's | encoded, 0 to 1 |
//!
//! Directions are cut like an onion: β between a direction and the plane x = 0, α about the x axis. Stored is
//! s = sin β, for cells `Δα · Δs` are equal solid angles. The source's arccosines lose the sign of y, and exceed 1
//! by rounding in one of three directions within the plane of x; arctangents do neither.

use super::lanes::Vector;
use capture::btf::Btf;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::borrow::Cow;

/// Variables of a sample.
pub(super) const VARIABLES: usize = 9;
/// Those that are given when a colour is asked for.
pub(super) const INPUTS: usize = 6;

/// Smallest deviations: of an evenly lit texel, a sixth of the spacing of directions, half a step of 8 bits.
/// Below, a component holds single columns of the grid and its likelihood has no bound.
pub(super) const FLOORS: [f64; VARIABLES] = {
    const COLOUR: f64 = 0.5 / 255.0;
    const ANGLE: f64 = 0.0436;
    [0.3, 0.3, ANGLE, ANGLE, ANGLE, ANGLE, COLOUR, COLOUR, COLOUR]
};

/// Samples on their grid: every texel under every pair of light and view.
#[derive(Clone, Debug)]
pub(super) struct Grid<'a> {
    /// Per column, texels.
    pub(super) x: Vec<f32>,
    /// Per row, texels.
    pub(super) y: Vec<f32>,
    /// Of x and y.
    pub(super) periods: [Period; 2],
    /// α and s of each light.
    pub(super) lights: Vec<[f32; 2]>,
    /// α and s of each view.
    pub(super) views: Vec<[f32; 2]>,
    /// The mean picture (view, light, channel) as stored: 255 stands for 1.
    pub(super) mean: Vec<u8>,
    /// (view, light, y, x, channel).
    pub(super) samples: Cow<'a, [f32]>,
}

/// Whether places along an axis begin again, and after how many texels.
///
/// A difference from a mean is that to the mean's nearest image. The sum over all images, a wrapped normal, differs
/// from this by less than `2 exp(−T²/8σ²)` for deviations σ up to T, the period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Period {
    /// Texels; 0 where they do not.
    pub(super) length: f32,
    /// Its inverse; 0 where they do not.
    inverse: f32,
}

impl Period {
    /// After `length` texels.
    pub(super) fn of(length: usize) -> Self {
        Self { length: length as f32, inverse: 1.0 / length as f32 }
    }

    /// The shortest of differences that are whole periods apart.
    #[inline(always)]
    pub(super) fn nearest<V: Vector>(self, difference: V) -> V {
        difference.times(V::splat(self.inverse)).rounded().times_plus(V::splat(-self.length), difference)
    }

    /// The same of one number.
    pub(super) fn nearest_of(self, difference: f32) -> f32 {
        difference - self.length * (difference * self.inverse).round_ties_even()
    }

    /// The image of a place that lies within the tile.
    pub(super) fn within(self, place: f64) -> f64 {
        if self.length > 0.0 { place.rem_euclid(f64::from(self.length)) } else { place }
    }
}

/// Where the tile continues itself, texels differ across the border by at most this times what some neighbours within do.
const SEAM: f64 = 1.1;

/// Those of the axes along which the tile continues itself.
fn periods(btf: &Btf) -> [Period; 2] {
    let continues = |steps: &[f64]| match steps {
        [within @ .., border] => within.len() > 1 && *border <= SEAM * within.iter().copied().fold(0.0, f64::max),
        [] => false,
    };
    let [across, down] = steps(btf).map(|steps| continues(&steps));
    [(across, btf.width), (down, btf.height)]
        .map(|(continues, side)| if continues { Period::of(side) } else { Period::default() })
}

/// How much texels differ from those of the next column, and of the next row, summed over both; last, across the border.
fn steps(btf: &Btf) -> [Vec<f64>; 2] {
    let (width, height) = (btf.width, btf.height);
    let of_picture = |picture: &[f32]| {
        let difference = |a: usize, b: usize| -> f64 {
            (0..3).map(|c| f64::from((picture[3 * a + c] - picture[3 * b + c]).abs())).sum()
        };
        let (mut across, mut down) = (vec![0.0; width], vec![0.0; height]);
        for texel in 0..width * height {
            let (x, y) = (texel % width, texel / width);
            across[x] += difference(texel, y * width + (x + 1) % width);
            down[y] += difference(texel, (y + 1) % height * width + x);
        }
        [across, down]
    };
    let pictures: Vec<[Vec<f64>; 2]> = btf.samples.par_chunks(3 * btf.texels()).map(of_picture).collect();
    let sum = |axis: usize, k: usize| pictures.iter().map(|steps| steps[axis][k]).sum::<f64>();
    [(0..width).map(|x| sum(0, x)).collect(), (0..height).map(|y| sum(1, y)).collect()]
}

/// α and s = sin β of a unit vector; α is 0 where the direction is along the x axis and has none.
pub(super) fn onion_slice(direction: &Vector3<f64>) -> [f64; 2] {
    let across = direction.y.hypot(direction.z);
    let alpha = if across < 1e-7 { 0.0 } else { direction.y.atan2(direction.z) };
    [alpha, direction.x]
}

impl<'a> Grid<'a> {
    /// The samples of a measurement, less nothing yet: [`Grid::residual`] subtracts the mean.
    pub(super) fn of(btf: &'a Btf) -> Self {
        let slices = |all: &[Vector3<f64>]| all.iter().map(|d| onion_slice(d).map(|v| v as f32)).collect();
        Self {
            x: centres(btf.width),
            y: centres(btf.height),
            periods: periods(btf),
            lights: slices(&btf.lights),
            views: slices(&btf.views),
            mean: mean_picture(btf),
            samples: Cow::Borrowed(&btf.samples),
        }
    }

    /// Texels of the tile.
    pub(super) fn texels(&self) -> usize {
        self.x.len() * self.y.len()
    }

    /// View and light of a pair.
    pub(super) fn view_and_light(&self, pair: usize) -> [usize; 2] {
        [pair / self.lights.len(), pair % self.lights.len()]
    }

    /// α and s of light, then view, of a pair.
    pub(super) fn angles(&self, pair: usize) -> [f32; 4] {
        let [view, light] = self.view_and_light(pair);
        let ([light_alpha, light_s], [view_alpha, view_s]) = (self.lights[light], self.views[view]);
        [light_alpha, light_s, view_alpha, view_s]
    }

    /// The picture of a pair, (y, x, channel).
    pub(super) fn picture(&self, pair: usize) -> &[f32] {
        &self.samples[pair * 3 * self.texels()..][..3 * self.texels()]
    }

    /// The mean colour of a pair.
    pub(super) fn mean_colour(&self, pair: usize) -> [f32; 3] {
        [0, 1, 2].map(|channel| f32::from(self.mean[3 * pair + channel]) / 255.0)
    }

    /// Colour less the mean, of a texel under a pair.
    pub(super) fn residual(&self, pair: usize, texel: usize) -> [f32; 3] {
        let (colour, mean) = (&self.picture(pair)[3 * texel..][..3], self.mean_colour(pair));
        [0, 1, 2].map(|channel| colour[channel] - mean[channel])
    }

    /// All nine variables of a sample.
    pub(super) fn sample(&self, pair: usize, texel: usize) -> [f64; VARIABLES] {
        let ([la, ls, va, vs], [r, g, b]) = (self.angles(pair), self.residual(pair, texel));
        let (x, y) = (self.x[texel % self.x.len()], self.y[texel / self.x.len()]);
        [x, y, la, ls, va, vs, r, g, b].map(f64::from)
    }
}

/// Of texels along a side.
pub(super) fn centres(count: usize) -> Vec<f32> {
    (0..count).map(|i| i as f32 + 0.5).collect()
}

/// The mean over the texels of each pair, (view, light, channel), in 8 bits.
fn mean_picture(btf: &Btf) -> Vec<u8> {
    let mean = |picture: &[f32]| {
        let sum = |channel: usize| picture.iter().skip(channel).step_by(3).map(|&s| f64::from(s)).sum::<f64>();
        [0, 1, 2].map(|channel| (255.0 * sum(channel) / btf.texels() as f64).round().clamp(0.0, 255.0) as u8)
    };
    btf.samples.chunks_exact(3 * btf.texels()).flat_map(mean).collect()
}
