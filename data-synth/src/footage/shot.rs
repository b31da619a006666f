//! One frame: the radiance of everything in view, and the matte of the object alone.
//!
//! The set is matt, so what it radiates is its albedo times what falls on it. Albedo is cheap and averaged over many
//! points of a pixel, which makes printed edges and the weave of the cloth sharp; light is dear and changes slowly, so
//! a few paths are shared with the pixels around on the same part. The object's own pixels, and those of outlines,
//! share nothing.

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
/// Paths of a pixel of the object, or of an outline, in those of the set.
const OVER_SET: u32 = 4;
/// Points at which the albedo of a pixel of the set is asked for; of one of several tones.
const TONES: [u32; 2] = [4, 64];
/// How far light is shared, in widths of the frame.
const SHARED: f64 = 1.0 / 100.0;
/// Albedo below which light is not told from it.
const DARKEST: f32 = 1e-3;

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

/// What the corners and the middle of a pixel show.
#[derive(Clone, Copy, Default)]
enum Content {
    /// The object, or more than one part.
    #[default]
    Whole,
    /// One part of the set, of one tone or several.
    Set { part: u8, is_even: bool },
}

/// A pixel before light is shared.
#[derive(Clone, Copy, Default)]
struct Shade {
    /// Radiance, or of the set radiance over albedo.
    light: Vec3,
    /// One, where it is not of the set.
    albedo: Vec3,
    /// Pixels of the same part of the set share their light.
    part: Option<u8>,
}

/// Takes one frame with the room turned by `yaw` in the middle of the exposure, of which the world and the rig are
/// those of a room that is not. Every pixel depends on its own seed and those around it alone.
pub(super) fn shoot(camera: &Camera, exposure: &Exposure<'_>, samples: u32, yaw: f64) -> Radiance {
    let shot = Shot::new(camera, exposure);
    let count = if exposure.shutter_rad == 0.0 { 1 } else { MOMENTS };
    let moment = |k: u32| {
        let at = (k as f32 + 0.5) / count as f32;
        let yaw = yaw as f32 + (at - 0.5) * exposure.shutter_rad as f32;
        Moment { world: exposure.world.turned(yaw), rig: exposure.rig.turned(yaw), at }
    };
    let moments: Vec<Moment> = (0..count).map(moment).collect();
    let (covers, _) = shot.covers();
    let contents = contents(&shot);
    let shades = shot.by_pixel(|x, y| {
        let seed = pixel_seed(exposure.seed, exposure.view, x, y);
        let pixel = Pixel { shot: &shot, moments: &moments, corner: Point2::new(x as f64, y as f64), seed };
        match contents.at(x, y) {
            Content::Whole => pixel.whole(samples),
            Content::Set { part, is_even } => {
                pixel.of_set(part, samples.div_ceil(OVER_SET), TONES[usize::from(!is_even)])
            }
        }
    });
    let radiance = shot.by_pixel(|x, y| share_light(&shades, x, y).into());
    Radiance { radiance, coverage: covers.map(|cover| cover.share()) }
}

fn contents(shot: &Shot<'_>) -> Image<Content> {
    let [width, height] = shot.size();
    let world = shot.world();
    let look = |x: f64, y: f64| {
        let sight = shot.sight(Point2::new(x, y), 0.5);
        world.first_hit(sight.origin, sight.direction).map(|hit| (world.part(&hit), world.is_dark(&hit)))
    };
    type Look = Option<(u8, bool)>;
    let corner_row = |y: usize| -> Vec<Look> { (0..=width).map(|x| look(x as f64, y as f64)).collect() };
    let corners: Vec<Vec<Look>> = (0..=height).into_par_iter().map(corner_row).collect();
    shot.by_pixel(|x, y| {
        let Some((part, is_dark)) = look(x as f64 + 0.5, y as f64 + 0.5) else { return Content::Whole };
        let around = [corners[y][x], corners[y][x + 1], corners[y + 1][x], corners[y + 1][x + 1]];
        let is_alone = around.iter().all(|corner| corner.is_some_and(|(other, _)| other == part));
        if part < super::SET || !is_alone {
            return Content::Whole;
        }
        Content::Set { part, is_even: around.iter().flatten().all(|(_, other)| *other == is_dark) }
    })
}

/// A pixel to be shaded.
struct Pixel<'a> {
    shot: &'a Shot<'a>,
    moments: &'a [Moment],
    corner: Point2<f64>,
    seed: u32,
}

impl Pixel<'_> {
    /// Mean radiance of whatever it shows.
    fn whole(&self, samples: u32) -> Shade {
        let light = (0..samples).map(|i| self.path(i, samples).0).sum::<Vec3>() / samples as f32;
        Shade { light, albedo: Vec3::repeat(1.0), part: None }
    }

    /// Light on a part of the set by `samples` paths, its albedo by `tones` looks.
    fn of_set(&self, part: u8, samples: u32, tones: u32) -> Shade {
        let over = |(radiance, albedo): (Vec3, Vec3)| radiance.component_div(&albedo.map(|a| a.max(DARKEST)));
        let light = (0..samples).map(|i| over(self.path(i, samples))).sum::<Vec3>() / samples as f32;
        let albedo = (0..tones).map(|i| self.look(i, tones)).sum::<Vec3>() / tones as f32;
        Shade { light, albedo, part: Some(part) }
    }

    /// Radiance along path `i` of `samples`, and the albedo where it starts. Samples in a row, which are a net of
    /// their own, share a moment.
    fn path(&self, i: u32, samples: u32) -> (Vec3, Vec3) {
        let moment = &self.moments[i as usize * self.moments.len() / samples as usize];
        let mut sampler = Sampler::new(self.seed, i, samples);
        let sight = self.sight(sampler.pair(), moment);
        let limits = &self.shot.exposure().limits;
        match moment.world.first_hit(sight.origin, sight.direction) {
            Some(hit) => {
                let traced = moment.world.radiance(hit, sight.direction, &moment.rig, limits, &mut sampler);
                (traced.radiance, moment.world.albedo(hit, sight.direction))
            }
            None => (moment.rig.sky.radiance(sight.direction), Vec3::repeat(1.0)),
        }
    }

    /// The albedo at point `i` of `tones`; white where there is nothing.
    fn look(&self, i: u32, tones: u32) -> Vec3 {
        let moment = &self.moments[i as usize * self.moments.len() / tones as usize];
        // Other points than those of the paths.
        let sight = self.sight(Sampler::new(!self.seed, i, tones).pair(), moment);
        let hit = moment.world.first_hit(sight.origin, sight.direction);
        hit.map_or(Vec3::repeat(1.0), |hit| moment.world.albedo(hit, sight.direction))
    }

    fn sight(&self, [dx, dy]: [f32; 2], moment: &Moment) -> crate::film::Sight {
        self.shot.sight(Point2::new(self.corner.x + f64::from(dx), self.corner.y + f64::from(dy)), moment.at)
    }
}

/// Radiance of a pixel, its light the mean of that around it on the same part, the nearer the more.
fn share_light(shades: &Image<Shade>, x: usize, y: usize) -> Vec3 {
    let here = shades.at(x, y);
    if here.part.is_none() {
        return here.light;
    }
    let reach = ((shades.width() as f64 * SHARED).ceil() as usize).max(1);
    let (mut sum, mut total) = (Vec3::zeros(), 0.0);
    for v in y.saturating_sub(reach)..(y + reach + 1).min(shades.height()) {
        for u in x.saturating_sub(reach)..(x + reach + 1).min(shades.width()) {
            let other = shades.at(u, v);
            let away = (u.abs_diff(x).pow(2) + v.abs_diff(y).pow(2)) as f32;
            let weight = (1.0 - away / ((reach + 1) * (reach + 1)) as f32).max(0.0);
            if other.part == here.part {
                sum += other.light * weight;
                total += weight;
            }
        }
    }
    here.albedo.component_mul(&(sum / total))
}
