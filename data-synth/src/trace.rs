//! A path tracer for one mesh under a light rig.
//!
//! At each surface point one shadow ray goes to every light (a choice among them is noisy wherever the
//! key light is hidden) and one ray is scattered; the two ways of finding a light are combined by the power heuristic (Veach 1997, chapter 9). The sky is found by
//! scattering alone: it is smooth. After [`PathLimits::surfaces`] surfaces a path ends, and what comes
//! by way of a second surface is clamped ([`PathLimits::clamp`]): the only bias, against fireflies.

use crate::accel::{Accel, Hit};
use crate::light::{LightRig, LightSample};
use crate::material::{Finish, Scatter, Surface, Vec3};
use crate::sampler::Sampler;
use crate::scene::Paint;
use geometry::Mesh;

/// A scene made ready for tracing.
#[derive(Debug)]
pub(crate) struct World {
    accel: Accel,
    faces: Vec<Face>,
    paint: Paint,
    /// By part; parts beyond the last are made of the last.
    finishes: Vec<Finish>,
    /// How far a scattered ray starts off the surface: beyond the rounding of a hit point.
    offset: f32,
}

/// Where paths end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathLimits {
    /// Surfaces a path may touch: 1 is direct light only.
    pub(crate) surfaces: usize,
    /// Largest radiance by way of a second surface.
    pub(crate) clamp: f32,
}

#[derive(Clone, Copy, Debug)]
struct Face {
    corners: [Vec3; 3],
    normals: [Vec3; 3],
    normal: Vec3,
    part: u8,
}

/// Radiance along a ray with its cost.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Traced {
    /// Linear RGB.
    pub(crate) radiance: Vec3,
    /// Rays cast after the first.
    pub(crate) rays: u32,
}

/// A surface point with its shading frame.
struct Point<'a> {
    position: Vec3,
    geometric: Vec3,
    frame: [Vec3; 3],
    wo: Vec3,
    surface: Surface<'a>,
}

impl World {
    /// Takes over a mesh with its shading normals, its part per face, its paint, and the finish of each part.
    pub(crate) fn new(mesh: &Mesh, normals: &[[Vec3; 3]], parts: &[u8], paint: Paint, finishes: Vec<Finish>) -> Self {
        let diagonal = mesh.aabb().map_or(1.0, |b| b.diagonal()) as f32;
        let face = |f: usize| Face {
            corners: mesh.corners(f).map(|p| p.coords.cast()),
            normals: normals.get(f).copied().unwrap_or([Vec3::zeros(); 3]),
            normal: mesh.face_area_vector(f).try_normalize(0.0).unwrap_or_default().cast(),
            part: parts.get(f).copied().unwrap_or(0),
        };
        let faces = (0..mesh.faces.len()).map(face).collect();
        Self { accel: Accel::new(mesh), faces, paint, finishes, offset: 1e-5 * diagonal }
    }

    /// What a camera ray meets.
    pub(crate) fn first_hit(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        self.accel.nearest(origin, direction, f32::INFINITY)
    }

    /// Radiance from `hit` back along the unit `direction` that found it.
    pub(crate) fn radiance(
        &self,
        hit: Hit,
        direction: Vec3,
        rig: &LightRig,
        limits: &PathLimits,
        sampler: &mut Sampler,
    ) -> Traced {
        let mut traced = Traced { radiance: Vec3::zeros(), rays: 0 };
        let mut throughput = Vec3::repeat(1.0);
        let mut next = Some((hit, direction));
        for depth in 0..limits.surfaces {
            let Some((hit, direction)) = next.take() else { break };
            let Some(point) = self.point(hit, direction) else { break };
            let clamp = if depth == 0 { f32::INFINITY } else { limits.clamp };
            let mut gather = |light: Vec3| traced.radiance += light.map(|c| c.min(clamp));
            // Look for each light with a shadow ray.
            for light in &rig.lights {
                let Some(sample) = light.sample(point.position, sampler.pair()) else { continue };
                let (seen, rays) = self.direct(&point, &sample);
                gather(throughput.component_mul(&seen));
                traced.rays += rays;
            }
            // Follow the surface; the ray finds the sky, a light, or the next surface.
            let Some((scatter, towards)) = point.scatter(sampler.pair()) else { break };
            traced.rays += 1;
            throughput.component_mul_assign(&scatter.weight);
            let origin = point.origin(towards, self.offset);
            let found = self.accel.nearest(origin, towards, f32::INFINITY);
            let reach = found.map_or(f32::INFINITY, |h| h.distance);
            if let Some(light) = rig.hit(point.position, towards, reach) {
                gather(throughput.component_mul(&light.radiance) * power_heuristic(scatter.pdf, light.pdf));
            } else if found.is_none() {
                gather(throughput.component_mul(&rig.sky.radiance(towards)));
            } else {
                next = found.map(|h| (h, towards));
            }
        }
        traced
    }

    /// Light arriving from a sampled point, and the rays it took.
    fn direct(&self, point: &Point<'_>, light: &LightSample) -> (Vec3, u32) {
        let wi = point.to_local(light.direction);
        let f = point.surface.evaluate(wi, point.wo);
        if light.direction.dot(&point.geometric) <= 0.0 || f.max() <= 0.0 {
            return (Vec3::zeros(), 0);
        }
        let origin = point.origin(light.direction, self.offset);
        if self.accel.is_blocked(origin, light.direction, light.distance) {
            return (Vec3::zeros(), 1);
        }
        let weight = power_heuristic(light.pdf, point.surface.pdf(wi, point.wo));
        (f.component_mul(&light.radiance) * (wi.z / light.pdf * weight), 1)
    }

    /// The surface at a hit; `None` on its inner side, which no light reaches.
    fn point(&self, hit: Hit, direction: Vec3) -> Option<Point<'_>> {
        let face = &self.faces[hit.face as usize];
        if direction.dot(&face.normal) >= 0.0 {
            return None;
        }
        let [u, v] = hit.barycentric;
        let mixed = |c: &[Vec3; 3]| c[0] * (1.0 - u - v) + c[1] * u + c[2] * v;
        let position = mixed(&face.corners);
        // Where the interpolated normal turns away from the eye, the facet's own is the honest one.
        let smooth = mixed(&face.normals).try_normalize(1e-6).filter(|n| n.dot(&direction) < 0.0);
        let normal = smooth.unwrap_or(face.normal);
        let frame = frame_around(normal);
        let wo = frame.map(|axis| -direction.dot(&axis)).into();
        let albedo = self.paint.albedo(position, normal, face.part);
        let finish = self.finishes.get(usize::from(face.part)).or(self.finishes.last());
        let coat = match finish {
            Some(Finish::Glazed(coat)) => Some(coat),
            Some(Finish::Matt) | None => None,
        };
        let surface = Surface { albedo, coat };
        Some(Point { position, geometric: face.normal, frame, wo, surface })
    }
}

impl Point<'_> {
    fn to_local(&self, d: Vec3) -> Vec3 {
        self.frame.map(|axis| d.dot(&axis)).into()
    }

    /// A direction to follow in the world; none below the facet itself.
    fn scatter(&self, u: [f32; 2]) -> Option<(Scatter, Vec3)> {
        let s = self.surface.sample(self.wo, u)?;
        let [x, y, z] = self.frame;
        let towards = x * s.wi.x + y * s.wi.y + z * s.wi.z;
        (towards.dot(&self.geometric) > 0.0).then_some((s, towards))
    }

    fn origin(&self, towards: Vec3, offset: f32) -> Vec3 {
        self.position + self.geometric * offset.copysign(towards.dot(&self.geometric))
    }
}

fn power_heuristic(a: f32, b: f32) -> f32 {
    // Scaled by the larger, lest the squares overflow.
    let r = b / a;
    if r.is_finite() { 1.0 / (1.0 + r * r) } else { 0.0 }
}

/// An orthonormal frame with the given z (Duff et al., "Building an Orthonormal Basis, Revisited",
/// JCGT 2017).
fn frame_around(n: Vec3) -> [Vec3; 3] {
    let sign = 1.0_f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    [Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3::new(b, sign + n.y * n.y * a, -n.y), n]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::{AreaLight, LightShape, Sky};
    use crate::sampler::{mix, pixel_seed};
    use crate::shape::{MeshBuilder, corner_normals, sphere};
    use std::f64::consts::PI;

    const LIMITS: PathLimits = PathLimits { surfaces: 4, clamp: f32::INFINITY };

    fn world(mesh: &Mesh, albedo: f32, finish: Finish) -> World {
        World::new(mesh, &corner_normals(mesh, 1.0), &[], Paint::Plain(Vec3::repeat(albedo)), vec![finish])
    }

    /// Mean and standard error over `n` pixels of one sample each along one ray.
    fn measure(world: &World, origin: Vec3, direction: Vec3, rig: &LightRig, n: usize) -> (f64, f64) {
        let hit = world.first_hit(origin, direction).unwrap();
        let (mut sum, mut sum2) = (0.0, 0.0);
        for i in 0..n {
            let mut sampler = Sampler::new(mix(pixel_seed(5, 0, i, 0)), 0, 1);
            let x = f64::from(world.radiance(hit, direction, rig, &LIMITS, &mut sampler).radiance.x);
            sum += x;
            sum2 += x * x;
        }
        let mean = sum / n as f64;
        (mean, ((sum2 / n as f64 - mean * mean).max(0.0) / n as f64).sqrt())
    }

    fn plane() -> Mesh {
        let mut b = MeshBuilder::default();
        let r = b.rectangle([50.0, 50.0], 0.0);
        b.cap(&r);
        b.mesh
    }

    #[test]
    fn white_sphere_vanishes_in_a_white_furnace() {
        let rig = LightRig { sky: Sky::uniform(1.0), lights: vec![] };
        for (finish, slack) in [(Finish::Matt, 1e-6), (Finish::glazed(0.15, 1.5), 2e-3)] {
            let world = world(&sphere(1.0, 64), 1.0, finish);
            for x in [0.0, 0.5, 0.9] {
                let (mean, error) = measure(&world, Vec3::new(x, 0.1, 5.0), -Vec3::z(), &rig, 40_000);
                assert!((mean - 1.0).abs() < 3.0 * error + slack, "at {x}: {mean} ± {error}");
            }
        }
    }

    #[test]
    fn plane_under_a_parallel_disk_light() {
        // On the axis E = π L r² / (r² + h²); seen radiance is albedo E / π.
        let (r, h, albedo, l) = (1.5, 2.0, 0.6, 3.0);
        let light = AreaLight::facing(LightShape::Disk, Vec3::new(0.0, 0.0, h), Vec3::zeros(), [r, r], Vec3::repeat(l));
        let rig = LightRig { sky: Sky::uniform(0.0), lights: vec![light] };
        let direction = Vec3::new(0.6, 0.0, -0.8);
        let (mean, error) = measure(&world(&plane(), albedo, Finish::Matt), -direction, direction, &rig, 100_000);
        let expected = f64::from(albedo * l * r * r / (r * r + h * h));
        assert!((mean - expected).abs() < 3.0 * error, "{mean} ± {error} against {expected}");
    }

    #[test]
    fn plane_beside_a_rectangle_light() {
        // Irradiance of a parallel rectangle from above one of its corners (e.g. Howell, view
        // factor B-3): E = L/2 [A/√(1+A²) atan(B/√(1+A²)) + B/√(1+B²) atan(A/√(1+B²))], A=a/h, B=b/h.
        let (a, b, h) = (2.0_f64, 1.0_f64, 1.5_f64);
        let light = AreaLight {
            shape: LightShape::Rectangle,
            center: Vec3::new(1.0, 0.5, 1.5),
            half_axes: [Vec3::new(0.0, 0.5, 0.0), Vec3::new(1.0, 0.0, 0.0)],
            radiance: Vec3::repeat(2.0),
        };
        let rig = LightRig { sky: Sky::uniform(0.0), lights: vec![light] };
        let (mean, error) =
            measure(&world(&plane(), 1.0, Finish::Matt), Vec3::new(0.0, 0.0, 1.0), -Vec3::z(), &rig, 100_000);
        let (x, y) = (a / h, b / h);
        let half = |x: f64, y: f64| x / (1.0 + x * x).sqrt() * (y / (1.0 + x * x).sqrt()).atan();
        let expected = 2.0 / 2.0 * (half(x, y) + half(y, x)) / PI;
        assert!((mean - expected).abs() < 3.0 * error, "{mean} ± {error} against {expected}");
    }

    #[test]
    fn several_lights_add_up() {
        let disk = |h: f32, l: f32| {
            AreaLight::facing(LightShape::Disk, Vec3::new(0.0, 0.0, h), Vec3::zeros(), [1.0, 1.0], Vec3::repeat(l))
        };
        let rig = LightRig { sky: Sky::uniform(0.5), lights: vec![disk(3.0, 0.0), disk(2.0, 4.0)] };
        let (mean, error) =
            measure(&world(&plane(), 0.5, Finish::Matt), Vec3::new(0.0, 0.0, 1.0), -Vec3::z(), &rig, 100_000);
        // The disk covers r² / (r² + h²) = 1/5 of the projected hemisphere, and hides the sky there.
        let expected = 0.5 * (4.0 / 5.0 + 0.5 * 4.0 / 5.0);
        assert!((mean - expected).abs() < 3.0 * error + 1e-6, "{mean} ± {error} against {expected}");
    }
}
