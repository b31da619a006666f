//! One frame: the radiance of everything in view, and the matte of the object alone.

use crate::film::{Exposure, Shot};
use crate::light::LightRig;
use crate::material::Vec3;
use crate::sampler::{Sampler, pixel_seed};
use crate::trace::World;
use capture::{Camera, Image};
use nalgebra::Point2;
use rayon::prelude::*;

/// Moments of an open shutter at which the room is turned.
const MOMENTS: u32 = 4;
/// Samples of a pixel that shows an edge, in those of another.
const AT_EDGES: u32 = 4;

/// A frame in linear light.
pub(super) struct Radiance {
    /// Mean radiance, linear RGB, white at 1.
    pub(super) radiance: Image<[f32; 3]>,
    /// Share of the pixel the object covers.
    pub(super) coverage: Image<f32>,
}

/// The room at one moment of the exposure.
struct Moment {
    world: World,
    rig: LightRig,
    /// In [0, 1) of the exposure.
    at: f32,
}

/// Takes one frame with the room turned by `yaw` in the middle of the exposure, of which the world and the rig are
/// those of a room that is not. Every pixel depends on its own seed alone.
pub(super) fn shoot(camera: &Camera, exposure: &Exposure<'_>, samples: u32, yaw: f64) -> Radiance {
    let shot = Shot::new(camera, exposure);
    let count = if exposure.shutter_rad == 0.0 { 1 } else { MOMENTS.min(samples) };
    let moment = |k: u32| {
        let at = (k as f32 + 0.5) / count as f32;
        let yaw = yaw as f32 + (at - 0.5) * exposure.shutter_rad as f32;
        Moment { world: exposure.world.turned(yaw), rig: exposure.rig.turned(yaw), at }
    };
    let moments: Vec<Moment> = (0..count).map(moment).collect();
    let (covers, _) = shot.covers();
    let edges = edges(&shot);
    let radiance = shot.by_pixel(|x, y| {
        let n = if edges.at(x, y) { samples * AT_EDGES } else { samples };
        pixel(&shot, &moments, [x, y], n)
    });
    Radiance { radiance, coverage: covers.map(|cover| cover.share()) }
}

/// Which pixels show more than one region: their corners and their middle do not agree.
fn edges(shot: &Shot<'_>) -> Image<bool> {
    let [width, height] = shot.size();
    let region = |x: f64, y: f64| {
        let sight = shot.sight(Point2::new(x, y), 0.5);
        let hit = shot.world().first_hit(sight.origin, sight.direction);
        hit.map_or(u16::MAX, |hit| shot.world().region(&hit))
    };
    let corner_row = |y: usize| -> Vec<u16> { (0..=width).map(|x| region(x as f64, y as f64)).collect() };
    let corners: Vec<Vec<u16>> = (0..=height).into_par_iter().map(corner_row).collect();
    shot.by_pixel(|x, y| {
        let middle = region(x as f64 + 0.5, y as f64 + 0.5);
        let around = [corners[y][x], corners[y][x + 1], corners[y + 1][x], corners[y + 1][x + 1]];
        around.into_iter().any(|corner| corner != middle)
    })
}

/// Mean radiance of a pixel; samples in a row, which are a net of their own, share a moment.
fn pixel(shot: &Shot<'_>, moments: &[Moment], [x, y]: [usize; 2], samples: u32) -> [f32; 3] {
    let exposure = shot.exposure();
    let seed = pixel_seed(exposure.seed, exposure.view, x, y);
    let mut sum = Vec3::zeros();
    for i in 0..samples {
        let moment = &moments[i as usize * moments.len() / samples as usize];
        let mut sampler = Sampler::new(seed, i, samples);
        let [dx, dy] = sampler.pair();
        let sight = shot.sight(Point2::new(x as f64 + f64::from(dx), y as f64 + f64::from(dy)), moment.at);
        sum += match moment.world.first_hit(sight.origin, sight.direction) {
            Some(hit) => {
                moment.world.radiance(hit, sight.direction, &moment.rig, &exposure.limits, &mut sampler).radiance
            }
            None => moment.rig.sky.radiance(sight.direction),
        };
    }
    (sum / samples as f32).into()
}
