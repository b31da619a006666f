//! Faults of a real capture, all off by default and applied after the ideal picture is known: of the
//! sensor, the exposure, the mattes, and of what is believed about the cameras.
//!
//! Motion blur, lens distortion and jitter are faults of the rays, so the film applies them; the rest is
//! applied here, in linear light, the same for the same seed and view.

use crate::error::SynthError;
use crate::film::{Picture, encode};
use crate::sampler::{pixel_seed, splitmix};
use capture::{Camera, Image};
use nalgebra::{Rotation3, Vector3};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// What goes wrong. Standard deviations are of normal numbers, drawn anew for every view.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Faults {
    /// Noise of the sensor.
    pub sensor_noise: Option<SensorNoise>,
    /// Standard deviation of the exposure, in stops.
    pub exposure_drift_stops: f64,
    /// Standard deviation of where the camera points and stands, in degrees about each axis seen from the
    /// object; the cameras written are the true ones.
    pub camera_jitter_deg: f64,
    /// Standard deviation of the error in the cameras written, in pixels of the object's middle along each
    /// axis of the picture (and as much in roll, at the border).
    pub calibration_error_px: f64,
    /// Mattes grown by so many pixels; negative shrinks them.
    pub matte_grow_px: f64,
    /// Round holes in each matte, a twentieth of the picture's width across.
    pub matte_holes: usize,
    /// Turn of the table while the shutter is open, in degrees.
    pub motion_blur_deg: f64,
    /// Radial distortion `k1` of the lens (Brown's model), known to the capture.
    pub distortion_k1: f64,
}

/// Noise of a sensor: shot noise by a normal approximation, and read noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorNoise {
    /// Electrons that make a pixel white; fewer is noisier. A phone in good light has about 5000.
    pub full_well: f64,
    /// Standard deviation of the read-out, in electrons.
    pub read_electrons: f64,
}

/// What is drawn at random, so that no two faults share a number.
#[derive(Clone, Copy)]
enum Draw {
    Sensor = 1,
    Exposure,
    Jitter,
    Calibration,
    Holes,
}

impl Faults {
    pub(crate) fn check(&self) -> Result<(), SynthError> {
        let within = |option: &'static str, value: f64, [low, high]: [f64; 2]| {
            let ok = (low..=high).contains(&value);
            let allowed = || format!("between {low} and {high}");
            if ok { Ok(()) } else { Err(SynthError::Option { option, value: value.to_string(), allowed: allowed() }) }
        };
        within("exposure_drift_stops", self.exposure_drift_stops, [0.0, 4.0])?;
        within("camera_jitter_deg", self.camera_jitter_deg, [0.0, 5.0])?;
        within("calibration_error_px", self.calibration_error_px, [0.0, 100.0])?;
        within("matte_grow_px", self.matte_grow_px, [-100.0, 100.0])?;
        within("matte_holes", self.matte_holes as f64, [0.0, 1000.0])?;
        within("motion_blur_deg", self.motion_blur_deg, [0.0, 45.0])?;
        within("distortion_k1", self.distortion_k1, [-0.5, 0.5])?;
        let Some(sensor) = self.sensor_noise else { return Ok(()) };
        within("full_well", sensor.full_well, [1.0, 1e9])?;
        within("read_electrons", sensor.read_electrons, [0.0, 1e9])
    }

    /// The camera that takes a view, from where it should have stood: turned about `target`, then about
    /// itself a tenth as much, and through its true lens.
    pub(crate) fn true_camera(&self, camera: &Camera, target: Vector3<f64>, seed: u64, view: usize) -> Camera {
        let mut camera = *camera;
        camera.intrinsics.distortion.k1 += self.distortion_k1;
        if self.camera_jitter_deg == 0.0 {
            return camera;
        }
        let mut normals = Normals::new(seed, view, Draw::Jitter);
        let sigma = self.camera_jitter_deg.to_radians();
        let about_target = Rotation3::new(normals.vector() * sigma);
        let about_itself = Rotation3::new(normals.vector() * (0.1 * sigma));
        let center = target + about_target * (camera.center().coords - target);
        camera.rotation = about_itself.matrix() * camera.rotation * about_target.inverse().matrix();
        camera.translation = -(camera.rotation * center);
        camera
    }

    /// The camera a capture believes in.
    pub(crate) fn believed_camera(&self, camera: &Camera, seed: u64, view: usize) -> Camera {
        if self.calibration_error_px == 0.0 {
            return *camera;
        }
        let (i, n) = (camera.intrinsics, Normals::new(seed, view, Draw::Calibration).vector());
        let half = 0.5 * i.width.max(i.height) as f64;
        let turn = Vector3::new(n.x / i.fy, n.y / i.fx, n.z / half) * self.calibration_error_px;
        let turn = Rotation3::new(turn).into_inner();
        Camera { rotation: turn * camera.rotation, translation: turn * camera.translation, ..*camera }
    }

    /// Factor on the light of a view.
    pub(crate) fn exposure(&self, seed: u64, view: usize) -> f64 {
        let [stops, _] = Normals::new(seed, view, Draw::Exposure).pair();
        (stops * self.exposure_drift_stops).exp2()
    }

    /// The picture as the sensor gives it, 8-bit sRGB. White is where the encoding ends: what is brighter stays
    /// white whatever its noise.
    pub(crate) fn develop(&self, picture: &Picture, seed: u64, view: usize) -> Image<[u8; 3]> {
        develop(&picture.radiance, self.exposure(seed, view), self.sensor_noise, seed, view)
    }

    /// The matte as someone cut it.
    pub(crate) fn cut(&self, coverage: &Image<f32>, seed: u64, view: usize) -> Image<u8> {
        let mut matte = capture::grow(&coverage.map(|c| (c * 255.0).round() as u8), self.matte_grow_px);
        let (width, height) = (matte.width() as f64, matte.height() as f64);
        let radius2 = (0.025 * width).powi(2);
        for hole in 0..self.matte_holes {
            let state = splitmix(stream(seed, view, Draw::Holes) ^ splitmix(hole as u64));
            let (x, y) = ((state >> 32) as f64 / 4_294_967_296.0 * width, uniform(splitmix(state)) * height);
            for py in 0..matte.height() {
                for px in 0..matte.width() {
                    if (px as f64 + 0.5 - x).powi(2) + (py as f64 + 0.5 - y).powi(2) < radius2 {
                        matte.set(px, py, 0);
                    }
                }
            }
        }
        matte
    }
}

/// Linear radiance, white at 1, times `gain` as a sensor gives it: 8-bit sRGB.
pub(crate) fn develop(
    radiance: &Image<[f32; 3]>,
    gain: f64,
    noise: Option<SensorNoise>,
    seed: u64,
    view: usize,
) -> Image<[u8; 3]> {
    let mut linear = radiance.map(|p| p.map(|c| c * gain as f32));
    if let Some(sensor) = noise {
        sensor.apply(&mut linear, seed, view);
    }
    linear.map(|p| p.map(|c| encode(c).round() as u8))
}

impl SensorNoise {
    fn apply(&self, linear: &mut Image<[f32; 3]>, seed: u64, view: usize) {
        let width = linear.width().max(1);
        let seed = stream(seed, view, Draw::Sensor);
        linear.pixels_mut().par_iter_mut().enumerate().for_each(|(i, pixel)| {
            let mut state = u64::from(pixel_seed(seed, view, i % width, i / width));
            for c in pixel {
                state = splitmix(state);
                let electrons = f64::from(*c) * self.full_well;
                let sigma = (electrons + self.read_electrons * self.read_electrons).sqrt();
                *c = ((electrons + sigma * normal(state)[0]) / self.full_well).max(0.0) as f32;
            }
        });
    }
}

/// Normal numbers of one view.
struct Normals(u64);

impl Normals {
    fn new(seed: u64, view: usize, draw: Draw) -> Self {
        Self(stream(seed, view, draw))
    }

    fn pair(&mut self) -> [f64; 2] {
        self.0 = splitmix(self.0);
        normal(self.0)
    }

    fn vector(&mut self) -> Vector3<f64> {
        let ([x, y], [z, _]) = (self.pair(), self.pair());
        Vector3::new(x, y, z)
    }
}

fn stream(seed: u64, view: usize, draw: Draw) -> u64 {
    splitmix(seed ^ splitmix((view as u64) << 8 | draw as u64))
}

fn uniform(state: u64) -> f64 {
    (state >> 11) as f64 / (1_u64 << 53) as f64
}

/// Two standard normal numbers (Box and Muller 1958).
pub(crate) fn normal(state: u64) -> [f64; 2] {
    let u = ((state >> 32) as f64 + 0.5) / 4_294_967_296.0;
    let v = (state & 0xffff_ffff) as f64 / 4_294_967_296.0;
    let (r, (s, c)) = ((-2.0 * u.ln()).sqrt(), (TAU * v).sin_cos());
    [r * c, r * s]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::turntable::{Layout, cameras, stations};

    fn camera() -> Camera {
        let mesh = crate::shape::sphere(0.1, 16);
        let stations = stations(&Layout::Rings { elevations_deg: vec![20.0] }, 1, 0).unwrap();
        cameras(&stations, &mesh, &mesh.aabb().unwrap(), [160, 120])[0]
    }

    #[test]
    fn noise_has_the_stated_spread_in_linear_light() {
        let noise = SensorNoise { full_well: 2000.0, read_electrons: 10.0 };
        let level = 0.2_f32;
        let mut image = Image::filled(200, 200, [level; 3]);
        noise.apply(&mut image, 4, 0);
        let values: Vec<f64> = image.pixels().iter().map(|p| f64::from(p[1])).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let sigma = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt();
        let expected = (f64::from(level) * 2000.0 + 100.0).sqrt() / 2000.0;
        assert!((mean - f64::from(level)).abs() < 4.0 * expected / 200.0);
        assert!((sigma / expected - 1.0).abs() < 0.02, "{sigma} against {expected}");
    }

    #[test]
    fn what_is_brighter_than_white_stays_white_whatever_its_noise() {
        let noise = SensorNoise { full_well: 100.0, read_electrons: 10.0 };
        let faults = Faults { sensor_noise: Some(noise), ..Faults::default() };
        let flat = |value: f32| Picture {
            radiance: Image::filled(40, 40, [value; 3]),
            coverage: Image::filled(40, 40, 1.0),
            noise: Image::filled(40, 40, 0.0),
            depth: Image::filled(40, 40, 1.0),
            normal: Image::filled(40, 40, [0.0, 0.0, 1.0]),
            rays: 0,
            noise_rms: None,
        };
        let white = |value| faults.develop(&flat(value), 1, 0).pixels().iter().filter(|p| **p == [255; 3]).count();
        assert_eq!(white(4.0), 1600);
        assert!(white(1.0) < 800);
    }

    #[test]
    fn a_calibration_error_moves_the_middle_by_its_pixels() {
        let faults = Faults { calibration_error_px: 0.5, ..Faults::default() };
        let camera = camera();
        let middle = nalgebra::Point3::origin();
        let at = camera.project(&middle).unwrap().pixel;
        let moved: Vec<_> =
            (0..2000).map(|v| faults.believed_camera(&camera, 3, v).project(&middle).unwrap().pixel - at).collect();
        for axis in 0..2 {
            let rms = (moved.iter().map(|d| d[axis] * d[axis]).sum::<f64>() / 2000.0).sqrt();
            // Two standard errors of a spread from 2000 numbers are three per cent.
            assert!((rms / 0.5 - 1.0).abs() < 0.05, "{rms}");
        }
    }

    #[test]
    fn a_jittered_camera_is_still_a_camera_that_looks_at_the_object() {
        let faults = Faults { camera_jitter_deg: 1.0, ..Faults::default() };
        let still = camera();
        let jittered = faults.true_camera(&still, Vector3::zeros(), 3, 1);
        assert!((jittered.rotation.determinant() - 1.0).abs() < 1e-12);
        assert!((jittered.center() - still.center()).norm() > 1e-4);
        let distance = |c: &Camera| c.center().coords.norm();
        assert!((distance(&jittered) / distance(&still) - 1.0).abs() < 1e-12);
        let middle = jittered.project(&nalgebra::Point3::origin()).unwrap().pixel;
        assert!((middle.x - 80.0).abs() < 10.0 && (middle.y - 60.0).abs() < 10.0);
    }

    #[test]
    fn mattes_grow_shrink_and_get_holes() {
        let mut coverage = Image::filled(80, 60, 0.0_f32);
        for (x, y) in (20..60).flat_map(|x| (15..45).map(move |y| (x, y))) {
            coverage.set(x, y, 1.0);
        }
        let area =
            |faults: Faults| faults.cut(&coverage, 1, 0).pixels().iter().map(|&m| f64::from(m) / 255.0).sum::<f64>();
        let grown = |px| area(Faults { matte_grow_px: px, ..Faults::default() });
        assert_eq!(area(Faults::default()), 1200.0);
        // The rectangle's border is 140 pixels long; corners are round when grown.
        assert!((grown(2.0) - (1200.0 + 280.0 + 4.0 * std::f64::consts::PI)).abs() < 4.0, "{}", grown(2.0));
        assert!((grown(-2.0) - (1200.0 - 280.0 + 16.0)).abs() < 4.0, "{}", grown(-2.0));
        let holes: f64 = (0..20)
            .map(|seed| {
                let faults = Faults { matte_holes: 3, ..Faults::default() };
                1200.0 - faults.cut(&coverage, seed, 0).pixels().iter().map(|&m| f64::from(m) / 255.0).sum::<f64>()
            })
            .sum();
        // Sixty holes of radius 2 in an 80 × 60 picture, a quarter of it object: overlaps and borders take little.
        let expected = 60.0 * std::f64::consts::PI * 4.0 * 0.25;
        assert!((holes / expected - 1.0).abs() < 0.4, "{holes} against {expected}");
    }

    #[test]
    fn exposure_drifts_by_stops() {
        let faults = Faults { exposure_drift_stops: 0.3, ..Faults::default() };
        let stops: Vec<f64> = (0..2000).map(|v| faults.exposure(9, v).log2()).collect();
        let rms = (stops.iter().map(|s| s * s).sum::<f64>() / 2000.0).sqrt();
        assert!((rms / 0.3 - 1.0).abs() < 0.05, "{rms}");
        assert_eq!(Faults::default().exposure(9, 1), 1.0);
    }
}
