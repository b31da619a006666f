//! What shines on the object: a sky that changes with height, and area lights.
//!
//! Lights are given in the room, whose +x points at the camera; turning the room about z by the
//! camera's azimuth is what a turntable does to the light seen from the object.

use crate::material::{Vec3, concentric_disk, frame_around};
use std::f32::consts::PI;

/// Outline of an area light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum LightShape {
    /// An ellipse with the two half axes.
    Disk,
    /// A rectangle with the two half sides.
    Rectangle,
    /// A ball whose radius is the length of the first half axis; it shines all around.
    Sphere,
}

/// A light: flat and shining to one side, or a ball.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AreaLight {
    /// Outline.
    pub(crate) shape: LightShape,
    /// Centre.
    pub(crate) center: Vec3,
    /// Perpendicular half axes; it shines along `u × v`.
    pub(crate) half_axes: [Vec3; 2],
    /// Emitted radiance, linear RGB.
    pub(crate) radiance: Vec3,
}

/// Radiance from far away, by the height of the direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sky {
    /// From straight below.
    pub(crate) ground: Vec3,
    /// From the horizon.
    pub(crate) horizon: Vec3,
    /// From straight above.
    pub(crate) zenith: Vec3,
}

/// All lights of one picture.
#[derive(Clone, Debug)]
pub(crate) struct LightRig {
    /// The far surroundings.
    pub(crate) sky: Sky,
    /// Near lights; the first is the key light.
    pub(crate) lights: Vec<AreaLight>,
}

/// A point on a light, seen from the surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightSample {
    /// Unit direction towards it.
    pub(crate) direction: Vec3,
    /// How far it is.
    pub(crate) distance: f32,
    /// What it emits towards the surface.
    pub(crate) radiance: Vec3,
    /// Density in solid angle.
    pub(crate) pdf: f32,
}

impl AreaLight {
    /// A light of half sizes `half` at `center` facing the point `target`.
    pub(crate) fn facing(shape: LightShape, center: Vec3, target: Vec3, half: [f32; 2], radiance: Vec3) -> Self {
        let w = (target - center).try_normalize(1e-9).unwrap_or_else(|| -Vec3::z());
        let side = Vec3::z().cross(&w).try_normalize(1e-6).unwrap_or_else(Vec3::x);
        Self { shape, center, half_axes: [side * half[0], w.cross(&side) * half[1]], radiance }
    }

    /// The normal, as long as the area; of a ball, its cross-section's, towards where `facing` turned it.
    fn normal_area(&self) -> Vec3 {
        let factor = if self.shape == LightShape::Rectangle { 4.0 } else { PI };
        self.half_axes[0].cross(&self.half_axes[1]) * factor
    }

    fn point(&self, u: [f32; 2]) -> Vec3 {
        let [a, b] = match self.shape {
            LightShape::Disk | LightShape::Sphere => concentric_disk(u),
            LightShape::Rectangle => [2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0],
        };
        self.center + self.half_axes[0] * a + self.half_axes[1] * b
    }

    /// Distance along a ray to the shining side.
    fn intersect(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
        if self.shape == LightShape::Sphere {
            return self.intersect_ball(origin, direction);
        }
        let n = self.half_axes[0].cross(&self.half_axes[1]);
        let facing = -direction.dot(&n);
        if facing <= 0.0 {
            return None;
        }
        let t = (origin - self.center).dot(&n) / facing;
        if t <= 0.0 {
            return None;
        }
        let p = origin + direction * t - self.center;
        let [a, b] = self.half_axes.map(|axis| p.dot(&axis) / axis.norm_squared());
        let inside = match self.shape {
            LightShape::Disk | LightShape::Sphere => a * a + b * b <= 1.0,
            LightShape::Rectangle => a.abs() <= 1.0 && b.abs() <= 1.0,
        };
        inside.then_some(t)
    }

    fn intersect_ball(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
        let to_center = self.center - origin;
        let along = to_center.dot(&direction);
        let half2 = self.half_axes[0].norm_squared() - (to_center - direction * along).norm_squared();
        (half2 >= 0.0).then(|| along - half2.sqrt()).filter(|&t| t > 0.0)
    }

    /// `1 − cos` of the half angle under which a ball is seen; none from inside.
    fn cone(&self, point: Vec3) -> Option<f32> {
        let sin2 = self.half_axes[0].norm_squared() / (self.center - point).norm_squared();
        // 1 − √(1 − s²) without cancellation.
        (sin2 < 1.0).then(|| sin2 / (1.0 + (1.0 - sin2).sqrt()))
    }

    /// A direction of the cone under which a ball is seen, all alike.
    fn sample_ball(&self, point: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let one_minus_cos = self.cone(point)? * u[0];
        let cos = 1.0 - one_minus_cos;
        let sin = (one_minus_cos * (1.0 + cos)).sqrt();
        let [x, y, z] = frame_around((self.center - point).normalize());
        let (s, c) = (2.0 * PI * u[1]).sin_cos();
        let direction = (x * (sin * c) + y * (sin * s) + z * cos).normalize();
        // At the very rim rounding may miss; the distance to the middle then serves as well.
        let distance = self.intersect_ball(point, direction).unwrap_or((self.center - point).norm());
        Some(LightSample { direction, distance, radiance: self.radiance, pdf: self.pdf_ball(point)? })
    }

    fn pdf_ball(&self, point: Vec3) -> Option<f32> {
        Some(1.0 / (2.0 * PI * self.cone(point)?))
    }

    /// Draws a point on the light; `None` where it shines away.
    pub(crate) fn sample(&self, point: Vec3, u: [f32; 2]) -> Option<LightSample> {
        if self.shape == LightShape::Sphere {
            return self.sample_ball(point, u);
        }
        let to_light = self.point(u) - point;
        let distance = to_light.norm();
        let direction = to_light / distance;
        let pdf = self.pdf(direction, distance);
        (pdf > 0.0 && pdf.is_finite()).then_some(LightSample { direction, distance, radiance: self.radiance, pdf })
    }

    /// Density in solid angle of [`AreaLight::sample`]: dω = dA cos / d², area and normal in one vector.
    fn pdf(&self, direction: Vec3, distance: f32) -> f32 {
        let facing = -direction.dot(&self.normal_area());
        if facing <= 0.0 { 0.0 } else { distance * distance / facing }
    }

    /// How much the light might give at a point, for picking one of several: never zero, for a part of it
    /// may shine where its middle does not.
    pub(crate) fn share(&self, point: Vec3, normal: Vec3) -> f32 {
        let to_light = self.center - point;
        let d2 = to_light.norm_squared().max(f32::MIN_POSITIVE);
        let cos = normal.dot(&to_light) / d2.sqrt();
        self.radiance.max() * self.normal_area().norm() / d2 * (0.1 + 0.9 * cos.max(0.0))
    }

    fn turned(&self, yaw: f32) -> Self {
        let turn = |v: Vec3| turn_about_z(v, yaw);
        Self { center: turn(self.center), half_axes: self.half_axes.map(turn), ..*self }
    }
}

impl Sky {
    /// Radiance from unit direction `d`.
    pub(crate) fn radiance(&self, d: Vec3) -> Vec3 {
        let t = smoothstep(d.z.abs());
        self.horizon.lerp(if d.z < 0.0 { &self.ground } else { &self.zenith }, t)
    }

    /// The same from everywhere.
    #[cfg(test)]
    pub(crate) fn uniform(radiance: f32) -> Self {
        let c = Vec3::repeat(radiance);
        Self { ground: c, horizon: c, zenith: c }
    }
}

impl LightRig {
    /// A photographer's table: a large warm window-like key at the upper left, a tall cool strip on
    /// the right, a round light behind. Sized for an object of radius `radius` around `target`.
    pub(crate) fn studio(target: Vec3, radius: f32) -> Self {
        let light = |shape, azimuth_deg: f32, elevation_deg: f32, half: [f32; 2], radiance: [f32; 3]| {
            let (sa, ca) = azimuth_deg.to_radians().sin_cos();
            let (se, ce) = elevation_deg.to_radians().sin_cos();
            let center = target + Vec3::new(ce * ca, ce * sa, se) * (6.0 * radius);
            AreaLight::facing(shape, center, target, half.map(|h| h * radius), Vec3::from(radiance))
        };
        Self {
            sky: Sky {
                ground: Vec3::new(0.30, 0.28, 0.26),
                horizon: Vec3::new(0.38, 0.39, 0.41),
                zenith: Vec3::new(0.60, 0.63, 0.68),
            },
            lights: vec![
                light(LightShape::Rectangle, -42.0, 44.0, [1.15, 1.15], [16.0, 14.8, 13.4]),
                light(LightShape::Rectangle, 58.0, 20.0, [0.45, 2.2], [5.0, 5.6, 6.6]),
                light(LightShape::Disk, 165.0, 40.0, [1.2, 1.2], [7.0, 7.0, 7.0]),
            ],
        }
    }

    /// Soft boxes above a table: a warm key at the upper left, a cooler fill on the right, a light from above
    /// and behind, a pale ceiling. Sized by the `length` of the set, so that white paper comes out light, not white.
    pub(crate) fn film_set(length: f32) -> Self {
        let target = Vec3::zeros();
        let light = |azimuth_deg: f32, elevation_deg: f32, half: [f32; 2], radiance: [f32; 3]| {
            let (sa, ca) = azimuth_deg.to_radians().sin_cos();
            let (se, ce) = elevation_deg.to_radians().sin_cos();
            let center = target + Vec3::new(ce * ca, ce * sa, se) * (5.0 * length);
            AreaLight::facing(LightShape::Rectangle, center, target, half.map(|h| h * length), Vec3::from(radiance))
        };
        Self {
            sky: Sky {
                ground: Vec3::new(0.10, 0.10, 0.10),
                horizon: Vec3::new(0.22, 0.22, 0.23),
                zenith: Vec3::new(0.30, 0.31, 0.33),
            },
            lights: vec![
                light(-52.0, 48.0, [1.1, 1.1], [8.6, 8.0, 7.2]),
                light(62.0, 38.0, [0.8, 1.4], [2.7, 3.0, 3.5]),
                light(160.0, 58.0, [1.0, 1.0], [3.4, 3.4, 3.4]),
            ],
        }
    }

    /// The rig turned about z by `yaw` radians.
    pub(crate) fn turned(&self, yaw: f32) -> Self {
        Self { sky: self.sky, lights: self.lights.iter().map(|l| l.turned(yaw)).collect() }
    }

    /// The nearest light a ray meets within `limit`, with the density [`AreaLight::sample`] gives it, and
    /// its index.
    pub(crate) fn hit(&self, point: Vec3, direction: Vec3, limit: f32) -> Option<(LightSample, usize)> {
        let reach = |light: &AreaLight| light.intersect(point, direction).filter(|&t| t < limit);
        let met = self.lights.iter().enumerate().filter_map(|(i, light)| Some((i, reach(light)?)));
        let (index, distance) = met.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let light = &self.lights[index];
        let pdf = match light.shape {
            LightShape::Sphere => light.pdf_ball(point)?,
            _ => light.pdf(direction, distance),
        };
        Some((LightSample { direction, distance, radiance: light.radiance, pdf }, index))
    }
}

fn turn_about_z(v: Vec3, yaw: f32) -> Vec3 {
    let (s, c) = yaw.sin_cos();
    Vec3::new(c * v.x - s * v.y, s * v.x + c * v.y, v.z)
}

/// Hermite step between 0 and 1, flat at both ends.
pub(crate) fn smoothstep(t: f32) -> f32 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hit_light_has_the_density_it_is_sampled_with() {
        let rig = LightRig::studio(Vec3::zeros(), 0.1);
        let p = Vec3::new(0.02, 0.01, 0.05);
        for i in 0..100 {
            // Off the very edge, where rounding decides.
            let u = [i, i + 500].map(|k| 0.02 + 0.96 * crate::sampler::unit(crate::sampler::mix(k)));
            for light in &rig.lights {
                let s = light.sample(p, u).unwrap();
                let (h, _) = rig.hit(p, s.direction, f32::INFINITY).unwrap();
                assert!((s.pdf / h.pdf - 1.0).abs() < 1e-3, "{} against {}", s.pdf, h.pdf);
            }
        }
    }
}
