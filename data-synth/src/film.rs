//! One picture: which pixels the object covers, how much of each, and the mean radiance there.
//!
//! Pixels are boxes. A pixel whose corners and centre all meet the object is full; one where none
//! does is empty; the others are measured with 8 × 8 stratified rays, so that the matte has sub-pixel
//! alpha even at few samples per pixel. Radiance is averaged over samples that meet the object and
//! multiplied by coverage in linear light, then encoded: the object on black.

use crate::light::LightRig;
use crate::material::Vec3;
use crate::sampler::{Sampler, pixel_seed};
use crate::trace::{PathLimits, World};
use capture::{Camera, Image};
use nalgebra::{Matrix3, Point2};
use rayon::prelude::*;

/// Rays across a pixel's side where coverage is measured.
const COVERAGE_SIDE: u32 = 8;

/// What a picture is taken with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exposure<'a> {
    pub(crate) world: &'a World,
    pub(crate) rig: &'a LightRig,
    pub(crate) limits: PathLimits,
    pub(crate) samples: u32,
    pub(crate) seed: u64,
    pub(crate) view: usize,
}

/// A finished picture.
#[derive(Debug)]
pub(crate) struct Picture {
    /// 8-bit sRGB on black.
    pub(crate) image: Image<[u8; 3]>,
    /// Coverage, 255 = all.
    pub(crate) matte: Image<u8>,
    /// Rays of every kind.
    pub(crate) rays: u64,
    /// Sum over object pixels and channels of the squared noise in 8-bit levels.
    pub(crate) noise_squared: f64,
    /// Terms of that sum.
    pub(crate) noise_terms: u64,
}

#[derive(Clone, Copy, Default)]
struct Pixel {
    srgb: [u8; 3],
    matte: u8,
    rays: u32,
    noise_squared: Option<f32>,
}

/// Takes one picture. Rows are shared among threads; every pixel depends on its own seed alone.
pub(crate) fn expose(camera: &Camera, exposure: &Exposure<'_>) -> Picture {
    let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
    let lens = Lens::new(camera);
    let corner_row =
        |y: usize| -> Vec<bool> { (0..=width).map(|x| exposure.is_covered(&lens, x as f64, y as f64)).collect() };
    let corners: Vec<Vec<bool>> = (0..=height).into_par_iter().map(corner_row).collect();
    let row = |y: usize| -> Vec<Pixel> {
        let touched = |x: usize| [corners[y][x], corners[y][x + 1], corners[y + 1][x], corners[y + 1][x + 1]];
        (0..width).map(|x| exposure.pixel(&lens, x, y, touched(x))).collect()
    };
    let rows: Vec<Vec<Pixel>> = (0..height).into_par_iter().map(row).collect();
    assemble(width, height, &rows)
}

fn assemble(width: usize, height: usize, rows: &[Vec<Pixel>]) -> Picture {
    let mut picture = Picture {
        image: Image::filled(width, height, [0; 3]),
        matte: Image::filled(width, height, 0),
        rays: ((width + 1) * (height + 1)) as u64,
        noise_squared: 0.0,
        noise_terms: 0,
    };
    for (y, row) in rows.iter().enumerate() {
        for (x, pixel) in row.iter().enumerate() {
            picture.image.set(x, y, pixel.srgb);
            picture.matte.set(x, y, pixel.matte);
            picture.rays += u64::from(pixel.rays);
            if let Some(noise) = pixel.noise_squared.filter(|_| pixel.matte >= 128) {
                picture.noise_squared += f64::from(noise);
                picture.noise_terms += 3;
            }
        }
    }
    picture
}

/// A camera without distortion, ready for many rays.
struct Lens {
    origin: Vec3,
    world_from_pixel: Matrix3<f64>,
}

impl Lens {
    fn new(camera: &Camera) -> Self {
        let i = camera.intrinsics;
        let plane_from_pixel = Matrix3::new(
            1.0 / i.fx,
            0.0,
            -i.cx / i.fx, //
            0.0,
            1.0 / i.fy,
            -i.cy / i.fy, //
            0.0,
            0.0,
            1.0,
        );
        Self { origin: camera.center().coords.cast(), world_from_pixel: camera.rotation.transpose() * plane_from_pixel }
    }

    fn ray(&self, pixel: Point2<f64>) -> Vec3 {
        (self.world_from_pixel * pixel.to_homogeneous()).normalize().cast()
    }
}

impl Exposure<'_> {
    fn is_covered(&self, lens: &Lens, x: f64, y: f64) -> bool {
        self.world.first_hit(lens.origin, lens.ray(Point2::new(x, y))).is_some()
    }

    fn pixel(&self, lens: &Lens, x: usize, y: usize, corners: [bool; 4]) -> Pixel {
        let center = self.is_covered(lens, x as f64 + 0.5, y as f64 + 0.5);
        let seed = pixel_seed(self.seed, self.view, x, y);
        if !center && corners == [false; 4] {
            return Pixel { rays: 1, ..Pixel::default() };
        }
        if center && corners == [true; 4] {
            let inside = |sampler: &mut Sampler, _| {
                let [dx, dy] = sampler.pair();
                Point2::new(x as f64 + f64::from(dx), y as f64 + f64::from(dy))
            };
            return self.shade(lens, seed, 1.0, inside);
        }
        let hits = self.coverage(lens, seed, x, y);
        let rays = COVERAGE_SIDE * COVERAGE_SIDE + 1;
        if hits.is_empty() {
            return Pixel { rays, ..Pixel::default() };
        }
        let share = hits.len() as f32 / (COVERAGE_SIDE * COVERAGE_SIDE) as f32;
        // Samples are spread evenly over the covered part.
        let covered = |sampler: &mut Sampler, i: u32| {
            let [u, _] = sampler.pair();
            let at = (i as f32 + u) / self.samples as f32 * hits.len() as f32;
            hits[(at as usize).min(hits.len() - 1)]
        };
        let pixel = self.shade(lens, seed, share, covered);
        Pixel { rays: pixel.rays + rays, ..pixel }
    }

    /// The points of a jittered 8 × 8 grid that the object covers.
    fn coverage(&self, lens: &Lens, seed: u32, x: usize, y: usize) -> Vec<Point2<f64>> {
        let n = COVERAGE_SIDE * COVERAGE_SIDE;
        let point = |i: u32| {
            // An independent stream: these points choose which samples are shaded.
            let [dx, dy] = Sampler::new(!seed, i, n).pair();
            Point2::new(x as f64 + f64::from(dx), y as f64 + f64::from(dy))
        };
        (0..n).map(point).filter(|p| self.is_covered(lens, p.x, p.y)).collect()
    }

    /// Mean radiance over samples, times coverage; the noise from two independent halves.
    fn shade(
        &self,
        lens: &Lens,
        seed: u32,
        share: f32,
        mut place: impl FnMut(&mut Sampler, u32) -> Point2<f64>,
    ) -> Pixel {
        let mut halves = [Vec3::zeros(); 2];
        let (mut met, mut rays) = ([0_u32; 2], 0);
        for i in 0..self.samples {
            let mut sampler = Sampler::new(seed, i, self.samples);
            let direction = lens.ray(place(&mut sampler, i));
            rays += 1;
            let Some(hit) = self.world.first_hit(lens.origin, direction) else { continue };
            let traced = self.world.radiance(hit, direction, self.rig, &self.limits, &mut sampler);
            // The low bits of the sample number choose the stratum: even and odd would be two parts of
            // the pixel, not two pictures of it.
            let half = usize::from(2 * i >= self.samples);
            halves[half] += traced.radiance;
            met[half] += 1;
            rays += traced.rays;
        }
        let total = (halves[0] + halves[1]) * (share / (met[0] + met[1]).max(1) as f32);
        let noise_squared = (met[0] > 0 && met[1] > 0).then(|| {
            // The mean of two independent halves errs by half their difference.
            let [a, b] = [0, 1].map(|h| (halves[h] * (share / met[h] as f32)).map(encode));
            (a - b).norm_squared() * 0.25
        });
        Pixel {
            srgb: total.map(|c| encode(c).round() as u8).into(),
            matte: (share * 255.0).round() as u8,
            rays,
            noise_squared,
        }
    }
}

/// Linear radiance to the sRGB scale 0..=255 (IEC 61966-2-1).
pub(crate) fn encode(linear: f32) -> f32 {
    let c = linear.clamp(0.0, 1.0);
    255.0 * if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
}

/// The inverse of [`encode`].
pub(crate) fn decode(srgb: f32) -> f32 {
    let c = (srgb / 255.0).clamp(0.0, 1.0);
    if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
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
    fn matte_of_a_sphere_has_the_area_of_its_outline() {
        // A sphere of radius r seen from d shows the disk tan² = r² / (d² − r²) on the image plane.
        let mesh = sphere(0.1, 200);
        let world =
            World::new(&mesh, &corner_normals(&mesh, 1.0), &[], Paint::Plain(Vec3::repeat(0.5)), vec![Finish::Matt]);
        let stations = stations(&Layout::Rings { elevations_deg: vec![0.0] }, 1, 0).unwrap();
        let camera = cameras(&stations, &mesh, &mesh.aabb().unwrap(), [128, 96])[0];
        let rig = LightRig { sky: Sky::uniform(1.0), lights: vec![] };
        let limits = PathLimits { surfaces: 2, clamp: 10.0 };
        let exposure = Exposure { world: &world, rig: &rig, limits, samples: 4, seed: 1, view: 0 };
        let picture = expose(&camera, &exposure);
        let area: f64 = picture.matte.pixels().iter().map(|&a| f64::from(a) / 255.0).sum();
        let d2 = camera.center().coords.norm_squared();
        let expected = std::f64::consts::PI * camera.intrinsics.fx.powi(2) * 0.01 / (d2 - 0.01);
        assert!((area / expected - 1.0).abs() < 2e-3, "{area} against {expected}");
        // Half-grey under a white sky is half-grey; edges are darker by their coverage.
        let middle = picture.image.at(64, 48);
        assert!(middle.iter().all(|&c| (i32::from(c) - 188).abs() <= 1), "{middle:?}");
    }

    #[test]
    fn srgb_round_trips() {
        assert!((0..=255_u8).all(|c| encode(decode(f32::from(c))).round() as u8 == c));
    }
}
