//! What shines on the object: a sky that changes with height, and flat area lights.
//!
//! Lights are given in the room, whose +x points at the camera; turning the room about z by the
//! camera's azimuth is what a turntable does to the light seen from the object.

use crate::material::{Vec3, concentric_disk};
use std::f32::consts::PI;

/// Outline of an area light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum LightShape {
    /// An ellipse with the two half axes.
    Disk,
    /// A rectangle with the two half sides.
    Rectangle,
}

/// A flat light shining to one side.
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
    /// Density in solid angle, including the choice of the light.
    pub(crate) pdf: f32,
}

impl AreaLight {
    /// A light of half sizes `half` at `center` facing the point `target`.
    pub(crate) fn facing(shape: LightShape, center: Vec3, target: Vec3, half: [f32; 2], radiance: Vec3) -> Self {
        let w = (target - center).try_normalize(1e-9).unwrap_or_else(|| -Vec3::z());
        let side = Vec3::z().cross(&w).try_normalize(1e-6).unwrap_or_else(Vec3::x);
        Self { shape, center, half_axes: [side * half[0], w.cross(&side) * half[1]], radiance }
    }

    fn normal_area(&self) -> Vec3 {
        let factor = if self.shape == LightShape::Disk { PI } else { 4.0 };
        self.half_axes[0].cross(&self.half_axes[1]) * factor
    }

    fn point(&self, u: [f32; 2]) -> Vec3 {
        let [a, b] = match self.shape {
            LightShape::Disk => concentric_disk(u),
            LightShape::Rectangle => [2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0],
        };
        self.center + self.half_axes[0] * a + self.half_axes[1] * b
    }

    /// Distance along a ray to the shining side.
    fn intersect(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
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
            LightShape::Disk => a * a + b * b <= 1.0,
            LightShape::Rectangle => a.abs() <= 1.0 && b.abs() <= 1.0,
        };
        inside.then_some(t)
    }

    /// Rough irradiance at a point, ignoring occlusion: how often the light is worth a shadow ray.
    fn importance(&self, point: Vec3, normal: Vec3) -> f32 {
        let to_light = self.center - point;
        let d2 = to_light.norm_squared().max(1e-12);
        let direction = to_light / d2.sqrt();
        // The floor keeps lights whose centre has set but whose edge has not.
        self.radiance.sum() * self.normal_area().norm() / d2 * direction.dot(&normal).max(0.1)
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
                ground: Vec3::new(0.13, 0.12, 0.11),
                horizon: Vec3::new(0.20, 0.21, 0.23),
                zenith: Vec3::new(0.36, 0.39, 0.44),
            },
            lights: vec![
                light(LightShape::Rectangle, -48.0, 44.0, [2.0, 2.0], [5.6, 5.1, 4.5]),
                light(LightShape::Rectangle, 62.0, 22.0, [0.7, 2.6], [1.9, 2.1, 2.5]),
                light(LightShape::Disk, 170.0, 38.0, [1.5, 1.5], [3.2, 3.2, 3.2]),
            ],
        }
    }

    /// The rig turned about z by `yaw` radians.
    pub(crate) fn turned(&self, yaw: f32) -> Self {
        Self { sky: self.sky, lights: self.lights.iter().map(|l| l.turned(yaw)).collect() }
    }

    /// Draws a point on one of the lights; `None` where it shines away or there is none.
    pub(crate) fn sample(&self, point: Vec3, normal: Vec3, mut u: [f32; 2]) -> Option<LightSample> {
        let (light, chance) = self.choose(point, normal, &mut u[0])?;
        let to_light = light.point(u) - point;
        let distance = to_light.norm();
        let direction = to_light / distance;
        let pdf = chance * solid_angle_pdf(light, direction, distance);
        (pdf > 0.0 && pdf.is_finite()).then_some(LightSample { direction, distance, radiance: light.radiance, pdf })
    }

    /// The nearest light a ray meets within `limit`, with the density [`LightRig::sample`] gives it.
    pub(crate) fn hit(&self, point: Vec3, normal: Vec3, direction: Vec3, limit: f32) -> Option<LightSample> {
        let reach = |light: &AreaLight| light.intersect(point, direction).filter(|&t| t < limit);
        let (i, distance) = self
            .lights
            .iter()
            .enumerate()
            .filter_map(|(i, light)| Some((i, reach(light)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1))?;
        let total: f32 = self.lights.iter().map(|l| l.importance(point, normal)).sum();
        let light = &self.lights[i];
        let chance = light.importance(point, normal) / total;
        let pdf = chance * solid_angle_pdf(light, direction, distance);
        Some(LightSample { direction, distance, radiance: light.radiance, pdf })
    }

    /// Picks a light by importance and stretches `u` back to [0, 1).
    fn choose(&self, point: Vec3, normal: Vec3, u: &mut f32) -> Option<(&AreaLight, f32)> {
        let total: f32 = self.lights.iter().map(|l| l.importance(point, normal)).sum();
        if total.is_nan() || total <= 0.0 {
            return None;
        }
        let mut below = 0.0;
        for (i, light) in self.lights.iter().enumerate() {
            let share = light.importance(point, normal) / total;
            if share > 0.0 && (*u < below + share || i + 1 == self.lights.len()) {
                *u = ((*u - below) / share).clamp(0.0, 0.999_999_94);
                return Some((light, share));
            }
            below += share;
        }
        None
    }
}

fn solid_angle_pdf(light: &AreaLight, direction: Vec3, distance: f32) -> f32 {
    // dω = dA cos / d²; the area and its normal are one vector.
    let facing = -direction.dot(&light.normal_area());
    if facing <= 0.0 { 0.0 } else { distance * distance / facing }
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
        let (p, n) = (Vec3::new(0.02, 0.01, 0.05), Vec3::z());
        for i in 0..100 {
            let u = [crate::sampler::unit(crate::sampler::mix(i)), crate::sampler::unit(crate::sampler::mix(i + 500))];
            let s = rig.sample(p, n, u).unwrap();
            let h = rig.hit(p, n, s.direction, f32::INFINITY).unwrap();
            assert!((s.pdf / h.pdf - 1.0).abs() < 1e-3, "{} against {}", s.pdf, h.pdf);
        }
    }
}
