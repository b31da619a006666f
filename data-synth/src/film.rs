//! One picture: which pixels the object covers, how much of each, and the mean radiance there.
//!
//! Pixels are boxes. A pixel whose corners and centre all meet the object is full; one where none does,
//! beside others where none does, is empty; the rest, and all while the table turns, are measured with 8 × 8 stratified rays, so that the
//! coverage is fine even at few samples per pixel, and a fibre thinner than a pixel is seen. Radiance is
//! averaged over samples that meet the object and multiplied by coverage in linear light: the object on
//! black.
//!
//! Where a noise is asked for, a pilot of [`PILOT`] samples says how noisy each pixel is, and samples are
//! shared out in proportion: that reaches a mean square with the fewest (Neyman 1934). The pilot is then
//! thrown away, lest the choice bias the mean.

use crate::light::LightRig;
use crate::material::Vec3;
use crate::sampler::{Sampler, pixel_seed};
use crate::trace::{PathLimits, World};
use capture::{Camera, Image};
use nalgebra::{Matrix3, Point2, Rotation3, Vector3};
use rayon::prelude::*;

/// Rays across a pixel's side where coverage is measured.
const COVERAGE_SIDE: u32 = 8;
/// Samples that say how noisy a pixel is.
const PILOT: u32 = 16;
/// Pictures a pixel's samples are divided into to see how much they differ.
const BATCHES: u32 = 4;
/// The square of the error falls as this power of the number of samples: faster than the first, for more
/// samples are stratified finer (two seeds of the temple: 1.09 from 16 to 64, 1.07 from 16 to 128).
const GAIN: f64 = 1.08;
/// Aimed at below the noise asked for: a pilot may err by so much.
const MARGIN: f64 = 0.97;
/// Fewest and most samples of a pixel, where they are shared out.
const SHARED_OUT: [f64; 2] = [8.0, 4096.0];

/// How many paths are spent on a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Effort {
    /// So many on each pixel; powers of two are stratified best.
    Samples(u32),
    /// As many as it takes for this root mean square noise over the object, in levels of 255, up to 4096 on a
    /// pixel: what was reached is in [`crate::SynthReport::noise_rms`].
    Noise(f64),
}

/// What a picture is taken with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exposure<'a> {
    pub(crate) world: &'a World,
    pub(crate) rig: &'a LightRig,
    pub(crate) limits: PathLimits,
    pub(crate) effort: Effort,
    pub(crate) seed: u64,
    pub(crate) view: usize,
    /// Turn of the table while the shutter is open, in radians; the picture is taken in the middle.
    pub(crate) shutter_rad: f64,
    /// Whether the lights stay in the room meanwhile, and not with the object.
    pub(crate) lights_stay: bool,
}

/// A finished picture, in linear light.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Picture {
    /// Mean radiance, object on black, linear RGB.
    pub(crate) radiance: Image<[f32; 3]>,
    /// Share of the pixel the object covers, 0 to 1.
    pub(crate) coverage: Image<f32>,
    /// Standard error of the picture by pixel, in levels of 255 of sRGB, root mean square over channels;
    /// zero off the object, and where there was one sample.
    pub(crate) noise: Image<f32>,
    /// Distance along the optical axis of what the ray through the pixel's centre meets; infinite where it
    /// meets nothing.
    pub(crate) depth: Image<f32>,
    /// Unit normal there, in the world; zero where there is nothing.
    pub(crate) normal: Image<[f32; 3]>,
    /// Rays of every kind.
    pub(crate) rays: u64,
    /// Root mean square of `noise` over pixels covered by half or more; `None` at one sample per pixel.
    pub(crate) noise_rms: Option<f64>,
}

/// What is known of a pixel before radiance is.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cover {
    /// Which points of the grid of [`COVERAGE_SIDE`] meet the object, where it was tried.
    points: u64,
    is_tried: bool,
    is_full: bool,
    depth: f32,
    normal: Vec3,
}

/// A pixel's radiance with its standard error in levels.
#[derive(Clone, Copy, Debug, Default)]
struct Shade {
    radiance: Vec3,
    noise: Option<f32>,
    rays: u64,
}

/// Takes one picture. Rows are shared among threads; every pixel depends on its own seed alone, and on
/// the noise of the whole picture where samples are shared out.
pub(crate) fn expose(camera: &Camera, exposure: &Exposure<'_>) -> Picture {
    let shot = Shot::new(camera, exposure);
    let (covers, probes) = shot.covers();
    let (samples, piloted) = match exposure.effort {
        Effort::Samples(n) => (covers.map(|c| if c.share() > 0.0 { n } else { 0 }), 0),
        Effort::Noise(levels) => shot.share_out(&covers, levels),
    };
    let shades = shot.shade_all(&covers, &samples, 0);
    shot.assemble(&covers, &shades, probes + piloted)
}

impl Cover {
    /// Share of the pixel the object covers.
    pub(crate) fn share(&self) -> f32 {
        if self.is_full { 1.0 } else { self.points.count_ones() as f32 / (COVERAGE_SIDE * COVERAGE_SIDE) as f32 }
    }
}

/// A camera ready for many rays.
struct Lens {
    camera: Camera,
    origin: Vector3<f64>,
    world_from_pixel: Matrix3<f64>,
    shutter_rad: f64,
}

/// A ray through a pixel.
#[derive(Clone, Copy)]
pub(crate) struct Sight {
    pub(crate) origin: Vec3,
    pub(crate) direction: Vec3,
}

impl Lens {
    fn new(camera: &Camera, shutter_rad: f64) -> Self {
        let i = camera.intrinsics;
        let plane_from_pixel = Matrix3::new(
            1.0 / i.fx,
            -i.skew / (i.fx * i.fy),
            (i.skew * i.cy / i.fy - i.cx) / i.fx, //
            0.0,
            1.0 / i.fy,
            -i.cy / i.fy, //
            0.0,
            0.0,
            1.0,
        );
        Self {
            camera: *camera,
            origin: camera.center().coords,
            world_from_pixel: camera.rotation.transpose() * plane_from_pixel,
            shutter_rad,
        }
    }

    /// The ray through a point of the picture at a `moment` in [0, 1) of the exposure. Where a strong lens
    /// maps nothing to the point, the ray of the ideal lens.
    fn sight(&self, pixel: Point2<f64>, moment: f32) -> Sight {
        let ideal = match self.camera.intrinsics.distortion.is_none() {
            true => pixel,
            false => self.camera.intrinsics.undistort_pixel(pixel).unwrap_or(pixel),
        };
        let direction = (self.world_from_pixel * ideal.to_homogeneous()).normalize();
        if self.shutter_rad == 0.0 {
            return Sight { origin: self.origin.cast(), direction: direction.cast() };
        }
        // The table turns one way, the camera seen from it the other.
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), (f64::from(moment) - 0.5) * self.shutter_rad);
        Sight { origin: (turn * self.origin).cast(), direction: (turn * direction).cast() }
    }
}

/// A camera with what it takes a picture of.
pub(crate) struct Shot<'a> {
    exposure: &'a Exposure<'a>,
    lens: Lens,
}

impl<'a> Shot<'a> {
    pub(crate) fn new(camera: &Camera, exposure: &'a Exposure<'a>) -> Self {
        Self { exposure, lens: Lens::new(camera, exposure.shutter_rad) }
    }

    pub(crate) fn exposure(&self) -> &'a Exposure<'a> {
        self.exposure
    }

    pub(crate) fn world(&self) -> &'a World {
        self.exposure.world
    }

    /// The ray through a point of the picture at a `moment` in [0, 1) of the exposure.
    pub(crate) fn sight(&self, pixel: Point2<f64>, moment: f32) -> Sight {
        self.lens.sight(pixel, moment)
    }

    /// Width and height.
    pub(crate) fn size(&self) -> [usize; 2] {
        [self.lens.camera.intrinsics.width, self.lens.camera.intrinsics.height]
    }

    fn meets(&self, x: f64, y: f64, moment: f32) -> bool {
        let sight = self.lens.sight(Point2::new(x, y), moment);
        let world = self.exposure.world;
        world.first_hit(sight.origin, sight.direction).is_some_and(|hit| world.is_object(&hit))
    }

    /// Coverage, depth and normal of the object in every pixel, and the rays it took.
    pub(crate) fn covers(&self) -> (Image<Cover>, u64) {
        let [width, height] = self.size();
        let corner_row = |y: usize| -> Vec<bool> { (0..=width).map(|x| self.meets(x as f64, y as f64, 0.5)).collect() };
        let corners: Vec<Vec<bool>> = (0..=height).into_par_iter().map(corner_row).collect();
        let centers = self.by_pixel(|x, y| self.center(x, y));
        let touched = |x: usize, y: usize| {
            let around = [corners[y][x], corners[y][x + 1], corners[y + 1][x], corners[y + 1][x + 1]];
            around.into_iter().chain([centers.at(x, y).is_full]).filter(|&met| met).count()
        };
        let probed = self.by_pixel(touched);
        let covers = self.by_pixel(|x, y| {
            let cover = centers.at(x, y);
            match probed.at(x, y) {
                // A turning table smears what the middle of the exposure shows as full.
                5 if self.lens.shutter_rad == 0.0 => cover,
                // Nor does it show all of what passes through.
                0 if self.lens.shutter_rad == 0.0 && self.is_alone(&probed, x, y) => cover,
                _ => Cover { points: self.grid(x, y), is_tried: true, is_full: false, ..cover },
            }
        });
        let grids = covers.pixels().iter().filter(|c| c.is_tried).count() as u64;
        let rays = ((width + 1) * (height + 1) + width * height) as u64;
        (covers, rays + grids * u64::from(COVERAGE_SIDE * COVERAGE_SIDE))
    }

    /// What the ray through the middle of a pixel meets.
    fn center(&self, x: usize, y: usize) -> Cover {
        let nothing = Cover { depth: f32::INFINITY, ..Cover::default() };
        let sight = self.lens.sight(Point2::new(x as f64 + 0.5, y as f64 + 0.5), 0.5);
        let world = self.exposure.world;
        let hit = world.first_hit(sight.origin, sight.direction).filter(|hit| world.is_object(hit));
        hit.map_or(nothing, |hit| {
            let along = f64::from(hit.distance) * sight.direction.cast::<f64>().dot(&self.lens.camera.forward());
            let normal = world.shading_normal(hit, sight.direction);
            Cover { is_full: true, depth: along as f32, normal, ..nothing }
        })
    }

    /// Whether no ray through the pixels around met anything either.
    fn is_alone(&self, probed: &Image<usize>, x: usize, y: usize) -> bool {
        let around = |dy: isize| (-1..=1).map(move |dx| (dx, dy));
        (-1..=1).flat_map(around).all(|(dx, dy)| probed.at_clamped(x as isize + dx, y as isize + dy) == 0)
    }

    /// Point `i` of a pixel's coverage grid, in the picture.
    fn grid_point(&self, x: usize, y: usize, i: u32) -> (Point2<f64>, f32) {
        // An independent stream: these points choose which samples are shaded.
        let seed = !pixel_seed(self.exposure.seed, self.exposure.view, x, y);
        let mut sampler = Sampler::new(seed, i, COVERAGE_SIDE * COVERAGE_SIDE);
        let [dx, dy] = sampler.pair();
        (Point2::new(x as f64 + f64::from(dx), y as f64 + f64::from(dy)), sampler.pair()[0])
    }

    fn grid(&self, x: usize, y: usize) -> u64 {
        (0..COVERAGE_SIDE * COVERAGE_SIDE).fold(0, |points, i| {
            let (p, moment) = self.grid_point(x, y, i);
            points | u64::from(self.meets(p.x, p.y, moment)) << i
        })
    }

    /// How many samples each pixel gets for a noise of `levels`, and the rays of finding out.
    fn share_out(&self, covers: &Image<Cover>, levels: f64) -> (Image<u32>, u64) {
        let pilot = self.shade_all(covers, &covers.map(|c| if c.share() > 0.0 { PILOT } else { 0 }), 1);
        let errors = pilot.map(|s| f64::from(s.noise.unwrap_or(0.0)).powi(2));
        // A pixel's own is known badly: its neighbours are asked too.
        let around = |x: usize, y: usize| {
            let near = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
            let at = |(dx, dy)| errors.at_clamped(x as isize + dx, y as isize + dy);
            ((near.map(at).sum::<f64>() + 3.0 * errors.at(x, y)) / 12.0).sqrt()
        };
        let error = self.by_pixel(|x, y| if covers.at(x, y).share() > 0.0 { around(x, y) } else { 0.0 });
        let judged = |(e, c): (&f64, &Cover)| (c.share() >= 0.5).then_some(*e);
        let object: Vec<f64> = error.pixels().iter().zip(covers.pixels()).filter_map(judged).collect();
        // With n_i = c e_i samples and errors that fall as n^−g, the mean of e_i² (PILOT/n_i)^g is the aim squared.
        let mean = object.iter().map(|e| e.powf(2.0 - GAIN)).sum::<f64>() / object.len().max(1) as f64;
        let aim = MARGIN * levels;
        let scale = f64::from(PILOT) * (mean / (aim * aim)).powf(1.0 / GAIN);
        let count = |e: f64| ((e * scale).clamp(SHARED_OUT[0], SHARED_OUT[1]) as u32).next_multiple_of(BATCHES);
        let samples = self.by_pixel(|x, y| if covers.at(x, y).share() > 0.0 { count(error.at(x, y)) } else { 0 });
        (samples, pilot.pixels().iter().map(|s| s.rays).sum())
    }

    /// Shades every pixel; `stream` tells pilot and picture apart.
    fn shade_all(&self, covers: &Image<Cover>, samples: &Image<u32>, stream: u32) -> Image<Shade> {
        self.by_pixel(|x, y| match samples.at(x, y) {
            0 => Shade::default(),
            n => self.shade(x, y, covers.at(x, y), n, stream),
        })
    }

    /// Mean radiance over `samples` that meet the object, times coverage; the noise from how much
    /// [`BATCHES`] parts of them differ.
    fn shade(&self, x: usize, y: usize, cover: Cover, samples: u32, stream: u32) -> Shade {
        let exposure = self.exposure;
        let seed = pixel_seed(exposure.seed, exposure.view, x, y).wrapping_add(stream);
        let points: Vec<u32> = (0..COVERAGE_SIDE * COVERAGE_SIDE).filter(|i| cover.points >> i & 1 == 1).collect();
        let (mut batches, mut met) = ([Vec3::zeros(); BATCHES as usize], [0_u32; BATCHES as usize]);
        let mut rays = 0;
        for i in 0..samples {
            let mut sampler = Sampler::new(seed, i, samples);
            let (place, moment) = self.place(x, y, &points, sampler.pair());
            let sight = self.lens.sight(place, moment);
            rays += 1;
            let Some(hit) = exposure.world.first_hit(sight.origin, sight.direction) else { continue };
            let turned = self.turned_rig(moment);
            let rig = turned.as_ref().unwrap_or(exposure.rig);
            let traced = exposure.world.radiance(hit, sight.direction, rig, &exposure.limits, &mut sampler);
            // Samples in a row, a net of their own.
            let batch = (i * BATCHES / samples) as usize;
            batches[batch] += traced.radiance;
            met[batch] += 1;
            rays += u64::from(traced.rays);
        }
        let share = cover.share();
        let radiance = batches.iter().sum::<Vec3>() * (share / met.iter().sum::<u32>().max(1) as f32);
        Shade { radiance, noise: standard_error(&batches, &met, share), rays }
    }

    /// The lights as the object sees them at a moment of an open shutter, where that differs from the middle's.
    fn turned_rig(&self, moment: f32) -> Option<LightRig> {
        let Exposure { rig, shutter_rad, lights_stay, .. } = self.exposure;
        (*lights_stay && *shutter_rad != 0.0).then(|| rig.turned((moment - 0.5) * *shutter_rad as f32))
    }

    /// Where in the pixel, and when, a sample looks: anywhere in a full one, otherwise at one of the points
    /// of the grid that the object covers.
    fn place(&self, x: usize, y: usize, points: &[u32], [u, v]: [f32; 2]) -> (Point2<f64>, f32) {
        if points.is_empty() {
            return (Point2::new(x as f64 + f64::from(u), y as f64 + f64::from(v)), 0.5);
        }
        let at = (u * points.len() as f32) as usize;
        self.grid_point(x, y, points[at.min(points.len() - 1)])
    }

    fn assemble(&self, covers: &Image<Cover>, shades: &Image<Shade>, rays: u64) -> Picture {
        let pairs = || shades.pixels().iter().zip(covers.pixels());
        let judged = |(s, c): (&Shade, &Cover)| s.noise.filter(|_| c.share() >= 0.5).map(f64::from);
        let noises: Vec<f64> = pairs().filter_map(judged).collect();
        let mean_square = noises.iter().map(|n| n * n).sum::<f64>() / noises.len() as f64;
        Picture {
            radiance: shades.map(|s| s.radiance.into()),
            coverage: covers.map(|c| c.share()),
            noise: shades.map(|s| s.noise.unwrap_or(0.0)),
            depth: covers.map(|c| c.depth),
            normal: covers.map(|c| c.normal.into()),
            rays: rays + shades.pixels().iter().map(|s| s.rays).sum::<u64>(),
            noise_rms: (!noises.is_empty()).then(|| mean_square.sqrt()),
        }
    }

    /// Calls `at` for every pixel, rows shared among threads.
    pub(crate) fn by_pixel<T: Default + Copy + Send>(&self, at: impl Fn(usize, usize) -> T + Sync) -> Image<T> {
        let [width, height] = self.size();
        let mut image = Image::filled(width, height, T::default());
        image.pixels_mut().par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
            row.iter_mut().enumerate().for_each(|(x, value)| *value = at(x, y));
        });
        image
    }
}

/// Standard error of a pixel in levels of 255, root mean square over channels, from parts of its samples, and
/// from what finer stratification takes off the whole ([`GAIN`]); rather high than low. `None` with fewer
/// than two parts.
fn standard_error(batches: &[Vec3], met: &[u32], share: f32) -> Option<f32> {
    let level = |(b, &m): (&Vec3, &u32)| (m > 0).then(|| (b * (share / m as f32)).map(encode));
    let levels: Vec<Vec3> = batches.iter().zip(met).filter_map(level).collect();
    let n = levels.len() as f32;
    let mean = levels.iter().sum::<Vec3>() / n.max(1.0);
    let squares = levels.iter().map(|l| (l - mean).norm_squared()).sum::<f32>();
    let finer = n.powf(1.0 - GAIN as f32);
    (levels.len() > 1).then(|| (squares / (3.0 * n * (n - 1.0)) * finer).sqrt())
}

/// Linear radiance to the sRGB scale 0..=255 (IEC 61966-2-1).
pub(crate) fn encode(linear: f32) -> f32 {
    let c = linear.clamp(0.0, 1.0);
    255.0 * capture::srgb::encoded(f64::from(c)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::Sky;
    use crate::material::Finish;
    use crate::scene::Paint;
    use crate::shape::{corner_normals, sphere};
    use crate::turntable::{Layout, cameras, stations};

    #[test]
    fn a_turning_table_smears_a_matte_without_loss() {
        // A small ball in front of the axis passes across the picture: what it covers for a part of the exposure adds up
        // to what it covers at rest, within what perspective makes of 10° either way (2 %).
        let mut mesh = sphere(0.01, 40);
        mesh.positions.iter_mut().for_each(|p| p.x += 0.1);
        let world =
            World::new(&mesh, &corner_normals(&mesh, 1.0), &[], Paint::Plain(Vec3::repeat(0.5)), vec![Finish::Matt]);
        let stations = stations(&Layout::Rings { elevations_deg: vec![0.0] }, 1, 0).unwrap();
        let camera = cameras(&stations, &sphere(0.12, 16), &sphere(0.12, 16).aabb().unwrap(), [96, 72])[0];
        let rig = LightRig { sky: Sky::uniform(1.0), lights: vec![] };
        let area = |shutter_rad: f64| {
            let limits = PathLimits { surfaces: 1 };
            let effort = Effort::Samples(1);
            let exposure =
                Exposure { world: &world, rig: &rig, limits, effort, seed: 1, view: 0, shutter_rad, lights_stay: true };
            expose(&camera, &exposure).coverage.pixels().iter().copied().map(f64::from).sum::<f64>()
        };
        let (still, smeared) = (area(0.0), area(20.0_f64.to_radians()));
        assert!((smeared / still - 1.0).abs() < 0.02, "{smeared} against {still}");
    }

    #[test]
    fn matte_of_a_sphere_has_the_area_of_its_outline() {
        // A sphere of radius r seen from d shows the disk tan² = r² / (d² − r²) on the image plane.
        let mesh = sphere(0.1, 200);
        let world =
            World::new(&mesh, &corner_normals(&mesh, 1.0), &[], Paint::Plain(Vec3::repeat(0.5)), vec![Finish::Matt]);
        let stations = stations(&Layout::Rings { elevations_deg: vec![0.0] }, 1, 0).unwrap();
        let camera = cameras(&stations, &mesh, &mesh.aabb().unwrap(), [128, 96])[0];
        let rig = LightRig { sky: Sky::uniform(1.0), lights: vec![] };
        let limits = PathLimits { surfaces: 2 };
        let exposure = Exposure {
            world: &world,
            rig: &rig,
            limits,
            effort: Effort::Samples(4),
            seed: 1,
            view: 0,
            shutter_rad: 0.0,
            lights_stay: true,
        };
        let picture = expose(&camera, &exposure);
        let area: f64 = picture.coverage.pixels().iter().copied().map(f64::from).sum();
        let d2 = camera.center().coords.norm_squared();
        let expected = std::f64::consts::PI * camera.intrinsics.fx.powi(2) * 0.01 / (d2 - 0.01);
        assert!((area / expected - 1.0).abs() < 2e-3, "{area} against {expected}");
        // Half-grey under a white sky is half-grey; edges are darker by their coverage.
        let middle = picture.radiance.at(64, 48);
        assert!(middle.iter().all(|&c| (c - 0.5).abs() < 1e-3), "{middle:?}");
    }
}
