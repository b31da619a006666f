//! What light and view make of the range map: displacement and bump mapping.
//!
//! At each texel the ray from the eye finds the place of the surface that is seen there (what lies at height h shifts
//! by `−h tan θ` along the view's azimuth), and a ray from there to the light whether it is lit. Eight features of the
//! place, without their means, are what pictures regress on:
//!
//! | feature | stands for |
//! |---|---|
//! | `√max(0, n·l)` where lit | diffuse light, as encodings compress it |
//! | `max(0, n·h)¹⁶` where lit | gloss |
//! | height | light that only peaks receive, and colour that changes with depth |
//! | mean height over 5 × 5 texels, less height | hollows |
//! | `n·v` | fuzz, seen at grazing angles |
//! | 1 where lit | shadows that other light fills |
//! | `n·l` | light that is scattered under the surface or between fibres before it leaves |
//! | mean height about, over 9 × 9 texels | what is seen of the coarse form where fine relief hides it |

use super::range_map::gradient;
use nalgebra::Vector3;
use rayon::prelude::*;

pub(super) const FEATURES: usize = 8;
/// Steps of a ray through the relief: half a texel each, at most as many.
const MOST_STEPS: f64 = 96.0;
/// Rays are no flatter than this: the cosine of 85°.
const LEAST_COSINE: f64 = 0.087;
const GLOSS: i32 = 16;
/// A relief lower than this, texels, is flat.
const FLAT: f64 = 1e-6;
/// Clears the surface a ray starts from, as a share of the relief.
const CLEARANCE: f64 = 0.02;

/// A range map with what is derived from it, (y, x).
#[derive(Clone, Debug)]
pub(super) struct Relief {
    size: [usize; 2],
    heights: Vec<f64>,
    /// Along x and down the rows.
    slopes: Vec<[f64; 2]>,
    hollows: Vec<f64>,
    smooth: Vec<f64>,
    low: f64,
    high: f64,
}

/// What is seen at a texel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// The texel of the surface, y · width + x.
    pub(super) texel: usize,
    pub(super) features: [f64; FEATURES],
    /// Of three channels, 0 where it is not kept.
    pub(super) reflectance: [f64; 3],
}

impl Relief {
    pub(super) fn new(heights: Vec<f64>, size: [usize; 2]) -> Self {
        let smooth = smoothed(&smoothed(&heights, size), size);
        let hollows = smoothed(&heights, size).iter().zip(&heights).map(|(mean, h)| mean - h).collect();
        let slopes = gradient(&heights, size);
        let low = heights.iter().copied().fold(f64::INFINITY, f64::min);
        let high = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Self { size, slopes, hollows, smooth, low, high, heights }
    }

    /// The same form, higher or lower.
    pub(super) fn scaled(&self, scale: f64) -> Self {
        Self::new(self.heights.iter().map(|h| h * scale).collect(), self.size)
    }

    pub(super) fn heights(&self) -> &[f64] {
        &self.heights
    }

    /// Under light and view, each texel of the reference plane, (y, x).
    pub(super) fn seen(&self, light: &Vector3<f64>, view: &Vector3<f64>) -> Vec<Seen> {
        let count = self.heights.len();
        if self.high - self.low < FLAT {
            return (0..count).map(|texel| Seen { texel, features: [0.0; FEATURES], reflectance: [0.0; 3] }).collect();
        }
        let middle = (light + view).try_normalize(1e-6).unwrap_or_else(Vector3::z);
        let mut seen: Vec<Seen> =
            (0..count).into_par_iter().map(|texel| self.seen_at(texel, light, view, &middle)).collect();
        for feature in 0..FEATURES {
            let mean = seen.iter().map(|s| s.features[feature]).sum::<f64>() / count as f64;
            seen.iter_mut().for_each(|s| s.features[feature] -= mean);
        }
        seen
    }

    fn seen_at(&self, texel: usize, light: &Vector3<f64>, view: &Vector3<f64>, middle: &Vector3<f64>) -> Seen {
        let foot = [(texel % self.size[0]) as f64, (texel / self.size[0]) as f64];
        let place = self.hit(foot, view);
        let height = self.sample(&self.heights, place);
        let slope = [0, 1].map(|axis| self.blend(place, |i| self.slopes[i][axis]));
        let n = Vector3::new(-slope[0], slope[1], 1.0).normalize();
        let lit = if self.is_lit(place, height, light) { 1.0 } else { 0.0 };
        let features = [
            lit * n.dot(light).max(0.0).sqrt(),
            lit * n.dot(middle).max(0.0).powi(GLOSS),
            height / (self.high - self.low),
            self.sample(&self.hollows, place) / (self.high - self.low),
            n.dot(view),
            lit,
            n.dot(light),
            self.sample(&self.smooth, place) / (self.high - self.low),
        ];
        let [x, y] = [0, 1].map(|axis| (place[axis].round() as isize).rem_euclid(self.size[axis] as isize) as usize);
        Seen { texel: y * self.size[0] + x, features, reflectance: [0.0; 3] }
    }

    /// Where the ray through a point of the plane z = 0 first meets the surface, from above.
    fn hit(&self, foot: [f64; 2], view: &Vector3<f64>) -> [f64; 2] {
        let (slant, steps) = self.ray(view);
        let place = |z: f64| [foot[0] + slant[0] * z, foot[1] + slant[1] * z];
        let above = |z: f64| z - self.sample(&self.heights, place(z));
        let step = (self.high - self.low) / steps;
        let (mut z, mut gap) = (self.high, above(self.high));
        while gap > 0.0 && z > self.low {
            let below = above(z - step);
            if below <= 0.0 {
                return place(z - step * gap / (gap - below));
            }
            (z, gap) = (z - step, below);
        }
        place(z)
    }

    fn is_lit(&self, start: [f64; 2], height: f64, light: &Vector3<f64>) -> bool {
        let (slant, steps) = self.ray(light);
        let range = self.high - self.low;
        let first = height + CLEARANCE * range;
        let count = ((self.high - first) / range * steps).ceil().max(0.0) as usize;
        let clear = |k: usize| {
            let rise = (k as f64 + 1.0) * range / steps;
            self.sample(&self.heights, [start[0] + slant[0] * rise, start[1] + slant[1] * rise]) <= first + rise
        };
        (0..count).all(clear)
    }

    /// Texels a ray moves along x and down the rows per texel of height, and steps through the relief.
    fn ray(&self, direction: &Vector3<f64>) -> ([f64; 2], f64) {
        let z = direction.z.max(LEAST_COSINE);
        let slant = [direction.x / z, -direction.y / z];
        let length = (self.high - self.low) * slant[0].hypot(slant[1]).max(1.0);
        (slant, (2.0 * length).ceil().clamp(1.0, MOST_STEPS))
    }

    fn sample(&self, field: &[f64], place: [f64; 2]) -> f64 {
        self.blend(place, |i| field[i])
    }

    /// Bilinear, wrapped; texel centres are at whole numbers.
    fn blend(&self, place: [f64; 2], value: impl Fn(usize) -> f64) -> f64 {
        let floor = place.map(f64::floor);
        let [x, y] = [0, 1].map(|axis| (floor[axis] as isize).rem_euclid(self.size[axis] as isize) as usize);
        let [u, v] = [place[0] - floor[0], place[1] - floor[1]];
        let [right, below] = [(x + 1) % self.size[0], (y + 1) % self.size[1]];
        let row = |y: usize| {
            let start = y * self.size[0];
            value(start + x) * (1.0 - u) + value(start + right) * u
        };
        row(y) * (1.0 - v) + row(below) * v
    }
}

/// Means over 5 × 5 texels, wrapped.
fn smoothed(field: &[f64], [width, height]: [usize; 2]) -> Vec<f64> {
    let along = |field: &[f64], width: usize, height: usize| -> Vec<f64> {
        let mean = |i: usize| {
            let (x, row) = (i % width + 3 * width, i / width * width);
            (0..5).map(|k| field[row + (x + k - 2) % width]).sum::<f64>() / 5.0
        };
        // Transposed on the way out, so that the second pass runs down the columns.
        (0..field.len()).map(|j| mean(j % height * width + j / height)).collect()
    };
    along(&along(field, width, height), height, width)
}
