//! All texels of one view under all lights.
//!
//! A texel is a box on the reference plane. Through stratified points in it a ray goes along the view;
//! where it meets the surface, every light is asked for by a shadow ray (they are directions: nothing to
//! sample), and one scattered ray goes on to the next surface, where every light is asked for again. All
//! lights share the paths, so what is left of noise looks the same under all of them.

use super::tile::{Point, Tile};
use crate::material::Vec3;
use crate::sampler::{Sampler, pixel_seed};
use capture::btf::DIRECTIONS;
use rayon::prelude::*;

/// Largest radiance by way of a second surface, under unit irradiance: three times a white surface.
/// The only bias, against speckles of a highlight seen in a highlight.
const CLAMP: f32 = 1.0;

/// How texels are measured.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tracing {
    /// Texels per side.
    pub(crate) size: usize,
    /// Paths per texel and view.
    pub(crate) samples: u32,
    /// Surfaces a path may touch.
    pub(crate) surfaces: usize,
    /// Of everything random.
    pub(crate) seed: u64,
}

/// Mean radiance of one texel under each light.
type Texel = [Vec3; DIRECTIONS];

impl Tracing {
    /// Radiance towards `towards`, laid out (light, y, x, channel), of the view numbered `view`.
    pub(crate) fn view(&self, tile: &Tile, lights: &[Vec3; DIRECTIONS], view: usize, towards: Vec3) -> Vec<f32> {
        let n = self.size;
        let texel = |i: usize| self.texel(tile, lights, view, towards, [i % n, i / n]);
        let texels: Vec<Texel> = (0..n * n).into_par_iter().map(texel).collect();
        (0..DIRECTIONS).flat_map(|l| texels.iter().flat_map(move |t| [t[l].x, t[l].y, t[l].z])).collect()
    }

    fn texel(&self, tile: &Tile, lights: &[Vec3; DIRECTIONS], view: usize, towards: Vec3, at: [usize; 2]) -> Texel {
        let mut sum = [Vec3::zeros(); DIRECTIONS];
        let seed = pixel_seed(self.seed, view, at[0], at[1]);
        let pitch = tile.side() / self.size as f32;
        for i in 0..self.samples {
            let mut sampler = Sampler::new(seed, i, self.samples);
            let [dx, dy] = sampler.pair();
            // Rows run down, y runs up.
            let (x, y) = (at[0] as f32 + dx, self.size as f32 - at[1] as f32 - dy);
            let first = tile.seen(x * pitch, y * pitch, towards);
            self.follow(tile, lights, first, &mut sampler, &mut sum);
        }
        sum.map(|s| s / self.samples as f32)
    }

    /// Adds what a path brings under each light.
    fn follow<'a>(
        &self,
        tile: &'a Tile,
        lights: &[Vec3; DIRECTIONS],
        first: Option<Point<'a>>,
        sampler: &mut Sampler,
        sum: &mut Texel,
    ) {
        let mut throughput = Vec3::repeat(1.0);
        let mut next = first;
        for depth in 0..self.surfaces {
            let Some(point) = next.take() else { break };
            let clamp = if depth == 0 { f32::INFINITY } else { CLAMP };
            for (light, sum) in lights.iter().zip(sum.iter_mut()) {
                let seen = direct(tile, &point, *light).component_mul(&throughput);
                *sum += seen.map(|c| c.min(clamp));
            }
            if depth + 1 == self.surfaces {
                break;
            }
            let Some(scatter) = point.surface.sample(point.wo, sampler.pair()) else { break };
            let towards = point.to_world(scatter.wi);
            if towards.dot(&point.geometric) <= 0.0 {
                break;
            }
            throughput.component_mul_assign(&scatter.weight);
            if depth > 0 && !survives(&mut throughput, sampler) {
                break;
            }
            next = tile.nearest(tile.start(&point, towards), towards);
        }
    }
}

/// Ends dark paths at random, and makes up for it in those that live.
fn survives(throughput: &mut Vec3, sampler: &mut Sampler) -> bool {
    let chance = throughput.max().min(1.0);
    let lives = sampler.pair()[0] < chance;
    if lives {
        *throughput /= chance;
    }
    lives
}

/// Radiance under unit irradiance perpendicular to `light`: `f cos_i` where the light is not hidden.
fn direct(tile: &Tile, point: &Point<'_>, light: Vec3) -> Vec3 {
    if light.dot(&point.geometric) <= 0.0 {
        return Vec3::zeros();
    }
    let wi = point.to_local(light);
    let f = point.surface.evaluate(wi, point.wo);
    // Less than 1e-4 of what white reflects is not worth a ray.
    if f.max() * wi.z < 1e-5 || !tile.is_lit(point, light) { Vec3::zeros() } else { f * wi.z }
}
