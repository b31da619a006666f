//! Where an object stands in a scene.

use crate::material::{Light, Lighting};
use capture::Aabb;
#[cfg(feature = "gpu")]
use capture::Camera;
use nalgebra::{Matrix3, Point3, Vector3};

/// From an object's coordinates to the world: `X_world = scale · rotation · X_object + translation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// A proper rotation.
    pub rotation: Matrix3<f64>,
    /// In world units.
    pub translation: Vector3<f64>,
    /// World units per unit of the object, above 0.
    pub scale: f64,
}

impl Default for Pose {
    /// The object's coordinates are the world's.
    fn default() -> Self {
        Self { rotation: Matrix3::identity(), translation: Vector3::zeros(), scale: 1.0 }
    }
}

impl Pose {
    /// A point of the object, in the world.
    pub fn to_world(&self, point: &Point3<f64>) -> Point3<f64> {
        Point3::from(self.rotation * point.coords * self.scale + self.translation)
    }

    /// A point of the world, in the object's coordinates.
    pub fn to_object(&self, point: &Point3<f64>) -> Point3<f64> {
        Point3::from(self.rotation.transpose() * (point.coords - self.translation) / self.scale)
    }

    /// The corners of a box of the object, in the world.
    pub fn corners(&self, aabb: &Aabb) -> [Point3<f64>; 8] {
        let pick = |corner: usize, k: usize| if corner >> k & 1 == 0 { aabb.min[k] } else { aabb.max[k] };
        std::array::from_fn(|corner| self.to_world(&[0, 1, 2].map(|k| pick(corner, k)).into()))
    }

    /// A camera as the object sees it: the same picture, depths and lengths in units of the object.
    /// `X_c = R (s R_m X + t_m) + t = s (R R_m X + (R t_m + t) / s)`.
    #[cfg(feature = "gpu")]
    pub(crate) fn camera(&self, world: &Camera) -> Camera {
        Camera {
            rotation: world.rotation * self.rotation,
            translation: (world.rotation * self.translation + world.translation) / self.scale,
            ..*world
        }
    }

    /// The same light in the object's coordinates. Lamps come nearer as the object's unit grows: irradiance is kept.
    pub(crate) fn lighting(&self, world: &Lighting) -> Lighting {
        let light = |light: &Light| match *light {
            Light::Directional { toward, irradiance } => {
                Light::Directional { toward: self.rotation.transpose() * toward, irradiance }
            }
            Light::Point { position, intensity } => {
                let share = (self.scale * self.scale).recip() as f32;
                Light::Point { position: self.to_object(&position), intensity: intensity.map(|i| i * share) }
            }
        };
        Lighting { lights: world.lights.iter().map(light).collect(), stops: world.stops }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    fn pose() -> Pose {
        let rotation = Rotation3::from_euler_angles(0.3, -1.1, 2.0).into_inner();
        Pose { rotation, translation: Vector3::new(1.0, -2.0, 0.5), scale: 2.5 }
    }

    #[test]
    fn there_and_back() {
        let point = Point3::new(0.3, 0.1, -0.7);
        assert!((pose().to_object(&pose().to_world(&point)) - point).norm() < 1e-12);
    }

    #[test]
    fn light_on_a_point_of_the_object_stays_as_bright() {
        let point = Point3::new(0.3, 0.1, -0.7);
        let lamps = vec![Light::point(Point3::new(3.0, 3.0, 3.0), &Point3::origin()), Light::directional(Vector3::x())];
        let moved = pose().lighting(&Lighting { lights: lamps.clone(), stops: 0.0 });
        for (world, object) in lamps.iter().zip(&moved.lights) {
            let ((toward, bright), (local, same)) =
                (world.at(&pose().to_world(&point)).unwrap(), object.at(&point).unwrap());
            assert!((pose().rotation * local.normalize() - toward.normalize()).norm() < 1e-9);
            assert!((bright[0] - same[0]).abs() < 1e-5 * bright[0]);
        }
    }
}
