//! What shines on materials.

use capture::Camera;
use capture::btf::Encoding;
use nalgebra::{Point3, Vector3};
use std::f32::consts::PI;

/// A lamp; colours are linear RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Infinitely far away.
    Directional {
        /// Towards the light, in the world; of any length.
        toward: Vector3<f64>,
        /// On a surface that faces it.
        irradiance: [f32; 3],
    },
    /// At a point.
    Point {
        /// In the world.
        position: Point3<f64>,
        /// Irradiance at distance 1 on a surface that faces it.
        intensity: [f32; 3],
    },
}

/// All lamps, and how radiance is shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lighting {
    /// Summed.
    pub lights: Vec<Light>,
    /// Radiance is multiplied by 2 to the power of this; 1 after that is white.
    pub stops: f32,
}

impl Light {
    /// White light under which white matt paint that faces it is white.
    pub fn directional(toward: Vector3<f64>) -> Self {
        Self::Directional { toward, irradiance: [PI; 3] }
    }

    /// A white lamp that is at `lit` as bright as [`Light::directional`]; at `position` itself there is none.
    pub fn point(position: Point3<f64>, lit: &Point3<f64>) -> Self {
        let intensity = f64::from(PI) * (position - lit).norm_squared();
        Self::Point { position, intensity: [intensity as f32; 3] }
    }

    /// A lamp that goes with the camera, above its left shoulder: what is drawn where nobody said how it is lit.
    pub fn over_the_shoulder(camera: &Camera) -> Self {
        Self::directional(camera.rotation.transpose() * Vector3::new(-0.4, -0.6, -0.7))
    }

    /// Direction towards the light and irradiance perpendicular to it; `None` where it does not shine.
    pub(crate) fn at(&self, point: &Point3<f64>) -> Option<(Vector3<f64>, [f32; 3])> {
        let (toward, irradiance) = match *self {
            Self::Directional { toward, irradiance } => (toward, irradiance),
            Self::Point { position, intensity } => {
                let toward = position - point;
                let falloff = 1.0 / toward.norm_squared() as f32;
                (toward, intensity.map(|i| i * falloff))
            }
        };
        (toward.norm() > 0.0 && irradiance.iter().all(|e| e.is_finite())).then_some((toward, irradiance))
    }
}

impl Lighting {
    /// Encoded sRGB, 0..=255, clamped. NaN is black.
    pub fn displayed(&self, radiance: f32) -> f32 {
        255.0 * Encoding::Srgb.encode(radiance * self.stops.exp2()).min(1.0)
    }
}
