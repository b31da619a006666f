//! A path tracer for one mesh under a light rig.
//!
//! At the first surface one shadow ray goes to every light (a choice among them is noisy wherever the key
//! light is hidden), later to one light picked by what it might give; then one ray is scattered. The two
//! ways of finding a light are combined by the power heuristic (Veach 1997, chapter 9). The sky is found
//! by scattering alone: it is smooth. Paths end by Russian roulette on what they may still carry, so the
//! mean is unbiased but for what [`PathLimits`], [`MAX_PASSAGES`] and [`MAX_CROSSINGS`] cut, and for paths that a
//! smooth normal sends to the wrong side of a facet of glass. Lights do not hide one another from shadow rays: rigs
//! keep them apart.

use crate::accel::{Accel, Hit};
use crate::footage::{SET, Set};
use crate::light::{LightRig, LightSample};
use crate::material::{Coat, Finish, Lobes, Surface, Vec3, frame_around, fresnel_dielectric, reflect};
use crate::medium::{Medium, Profile};
use crate::sampler::Sampler;
use crate::scene::Paint;
use crate::shape::{MeshBuilder, corner_normals};
use geometry::Mesh;
use std::sync::Arc;

/// Passages of glass a path may make: beyond, what is left is less than roulette would keep.
const MAX_PASSAGES: usize = 64;
/// Crossings of a probe through a translucent body that are considered.
const MAX_CROSSINGS: usize = 16;
/// Odds of probing along the tangents and the normal: on a flat part only the normal finds anything.
const AXIS_ODDS: [f32; 3] = [0.1, 0.1, 0.8];
/// Faces of a set that meet under more than this are shaded apart.
const SET_CREASE_RAD: f64 = 0.6;
/// Most a path is likely to survive a surface by roulette.
const SURVIVAL: f32 = 0.95;

/// A scene made ready for tracing; clones share it.
#[derive(Clone, Debug)]
pub(crate) struct World {
    accel: Arc<Accel>,
    faces: Arc<Vec<Face>>,
    paint: Paint,
    /// By part; parts beyond the last are made of the last.
    finishes: Arc<Vec<Finish>>,
    /// What the object stands on and before, where there is anything.
    set: Option<Arc<Set>>,
    /// Turn of the room about z against the object, in radians.
    yaw: f32,
    /// How far a scattered ray starts off the surface: beyond the rounding of a hit point.
    offset: f32,
}

/// Where paths end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathLimits {
    /// Surfaces a path may touch, glass apart: 1 is direct light only.
    pub(crate) surfaces: usize,
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

/// A surface point with its shading frame, on the side the light path is on.
struct Point<'a> {
    position: Vec3,
    geometric: Vec3,
    frame: [Vec3; 3],
    wo: Vec3,
    surface: Surface<'a>,
}

/// A path on its way.
struct Path<'a> {
    world: &'a World,
    rig: &'a LightRig,
    sampler: &'a mut Sampler,
    throughput: Vec3,
    /// Surfaces met that scatter.
    surfaces: usize,
    traced: Traced,
}

/// A ray that leaves a surface.
struct Leaving {
    origin: Vec3,
    direction: Vec3,
    /// Density of the direction in solid angle, and where lights were looked for; none where only this ray
    /// can find them.
    looked: Option<(f32, LookedFor)>,
}

/// How lights were looked for from a point.
#[derive(Clone, Copy)]
struct LookedFor {
    position: Vec3,
    normal: Vec3,
    /// Sum of the shares by which one light was picked; none where all were looked for.
    total_share: Option<f32>,
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
        let (accel, faces, finishes) = (Arc::new(Accel::new(mesh)), Arc::new(faces), Arc::new(finishes));
        Self { accel, faces, paint, finishes, set: None, yaw: 0.0, offset: 1e-5 * diagonal }
    }

    /// Puts the `object` the world was made from on a set, all of it matt.
    pub(crate) fn on_set(self, object: &Mesh, set: Set) -> Self {
        let MeshBuilder { mesh, parts, .. } = set.build();
        let normals = corner_normals(&mesh, SET_CREASE_RAD);
        let furniture = Self::new(&mesh, &normals, &parts, self.paint, Vec::new());
        let mut all = object.clone();
        let first = all.positions.len() as u32;
        all.positions.extend(mesh.positions);
        all.faces.extend(mesh.faces.iter().map(|face| face.map(|v| v + first)));
        let faces = self.faces.iter().chain(furniture.faces.iter()).copied().collect();
        Self { accel: Arc::new(Accel::new(&all)), faces: Arc::new(faces), set: Some(Arc::new(set)), ..self }
    }

    /// The same with the room turned about z by `yaw` radians; the object, and what turns with it, stay.
    pub(crate) fn turned(&self, yaw: f32) -> Self {
        Self { yaw, ..self.clone() }
    }

    /// Whether a hit is on the object, not on the set.
    pub(crate) fn is_object(&self, hit: &Hit) -> bool {
        self.part(hit) < SET
    }

    /// Which part a hit is on.
    pub(crate) fn part(&self, hit: &Hit) -> u8 {
        self.faces[hit.face as usize].part
    }

    /// Whether a hit is on what is printed dark on the board of the set.
    pub(crate) fn is_dark(&self, hit: &Hit) -> bool {
        let face = &self.faces[hit.face as usize];
        self.set.as_ref().is_some_and(|set| set.is_dark(face.position(hit.barycentric), face.part))
    }

    /// What a camera ray meets.
    pub(crate) fn first_hit(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        self.accel.nearest(origin, direction, f32::INFINITY)
    }

    /// Unit shading normal at a hit, towards where the ray came from.
    pub(crate) fn shading_normal(&self, hit: Hit, direction: Vec3) -> Vec3 {
        let face = &self.faces[hit.face as usize];
        face.shading_normal(hit.barycentric, direction, face.facing(direction))
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
        let traced = Traced { radiance: Vec3::zeros(), rays: 0 };
        let mut path = Path { world: self, rig, sampler, throughput: Vec3::repeat(1.0), surfaces: 0, traced };
        let mut next = Some((hit, direction));
        for _ in 0..limits.surfaces + MAX_PASSAGES {
            let Some((hit, direction)) = next else { break };
            let Some(leaving) = path.meet(hit, direction) else { break };
            next = path.follow(&leaving);
            if path.surfaces >= limits.surfaces {
                break;
            }
        }
        path.traced
    }

    fn finish(&self, face: &Face) -> &Finish {
        if face.part >= SET {
            return &Finish::Matt;
        }
        self.finishes.get(usize::from(face.part)).or(self.finishes.last()).unwrap_or(&Finish::Matt)
    }

    /// The surface at a hit, seen from outside or, where `inside`, from within.
    fn point<'a>(&self, hit: Hit, direction: Vec3, surface: Surface<'a>) -> Point<'a> {
        let face = &self.faces[hit.face as usize];
        let geometric = face.facing(direction);
        let frame = frame_around(face.shading_normal(hit.barycentric, direction, geometric));
        let wo = frame.map(|axis| -direction.dot(&axis)).into();
        Point { position: face.position(hit.barycentric), geometric, frame, wo, surface }
    }

    /// What light that enters at a crossing gives at a point, over the density with which probes find it.
    fn crossing_weight(&self, point: &Point<'_>, crossing: Hit, profile: &Profile) -> Vec3 {
        let face = &self.faces[crossing.face as usize];
        let offset = point.to_local(face.position(crossing.barycentric) - point.position);
        let normal = point.to_local(face.normal);
        let found = |k: usize| {
            let aside = offset[(k + 1) % 3].hypot(offset[(k + 2) % 3]);
            AXIS_ODDS[k] * profile.pdf(aside) * normal[k].abs()
        };
        let pdf: f32 = (0..3).map(found).sum();
        // Light enters where the body is bare: not through what is opaque.
        let is_bare = matches!(self.finish(face), Finish::Translucent(..));
        let is_near = is_bare && offset.norm() < profile.reach() && pdf > 0.0;
        if is_near { profile.density(offset.norm()) / pdf } else { Vec3::zeros() }
    }

    /// The surface at a crossing, seen from straight outside.
    fn outside<'a>(&self, hit: Hit, surface: Surface<'a>) -> Point<'a> {
        let face = &self.faces[hit.face as usize];
        let frame = frame_around(face.shading_normal(hit.barycentric, -face.normal, face.normal));
        Point { position: face.position(hit.barycentric), geometric: face.normal, frame, wo: Vec3::z(), surface }
    }

    fn is_inside(&self, hit: Hit, direction: Vec3) -> bool {
        direction.dot(&self.faces[hit.face as usize].normal) >= 0.0
    }

    /// The paint at a hit.
    pub(crate) fn albedo(&self, hit: Hit, direction: Vec3) -> Vec3 {
        let face = &self.faces[hit.face as usize];
        let position = face.position(hit.barycentric);
        if let Some(set) = self.set.as_ref().filter(|_| face.part >= SET) {
            return set.albedo(position, face.part, self.yaw);
        }
        let normal = face.shading_normal(hit.barycentric, direction, face.normal);
        self.paint.albedo(position, normal, face.part)
    }
}

impl Face {
    fn position(&self, [u, v]: [f32; 2]) -> Vec3 {
        self.corners[0] * (1.0 - u - v) + self.corners[1] * u + self.corners[2] * v
    }

    /// The facet's normal on the side a ray comes from.
    fn facing(&self, direction: Vec3) -> Vec3 {
        if direction.dot(&self.normal) >= 0.0 { -self.normal } else { self.normal }
    }

    /// The interpolated normal on the side of `geometric`; where it turns away from the eye, the facet's
    /// own is the honest one.
    fn shading_normal(&self, [u, v]: [f32; 2], direction: Vec3, geometric: Vec3) -> Vec3 {
        let mixed = self.normals[0] * (1.0 - u - v) + self.normals[1] * u + self.normals[2] * v;
        let sided = if mixed.dot(&geometric) < 0.0 { -mixed } else { mixed };
        sided.try_normalize(1e-6).filter(|n| n.dot(&direction) < 0.0).unwrap_or(geometric)
    }
}

impl<'a> Path<'a> {
    /// Gathers light at a surface and says where the path goes on.
    fn meet(&mut self, hit: Hit, direction: Vec3) -> Option<Leaving> {
        let world = self.world;
        let finish = world.finish(&world.faces[hit.face as usize]);
        let inside = world.is_inside(hit, direction);
        if let Finish::Glass(index) = finish {
            return self.pass(hit, direction, if inside { 1.0 / index } else { *index });
        }
        if inside {
            // The inner side of what is not glass, which no light reaches.
            return None;
        }
        let albedo = world.albedo(hit, direction);
        if let Finish::Translucent(coat, medium) = finish {
            return self.enter(hit, direction, albedo, coat, *medium);
        }
        let surface = Surface { albedo, coat: finish.coat(), lobes: Lobes::All };
        let choice = self.sampler.pair();
        self.scatter(&world.point(hit, direction, surface), choice)
    }

    /// Looks for lights, then goes on in the direction drawn by `choice`.
    fn scatter(&mut self, point: &Point<'_>, choice: [f32; 2]) -> Option<Leaving> {
        let looked_for = self.look_for_lights(point);
        self.surfaces += 1;
        self.leave(point, choice, looked_for)
    }

    fn leave(&mut self, point: &Point<'_>, choice: [f32; 2], looked_for: LookedFor) -> Option<Leaving> {
        let drawn = point.surface.sample(point.wo, choice)?;
        let direction = point.to_world(drawn.wi);
        if direction.dot(&point.geometric) <= 0.0 {
            return None;
        }
        self.throughput.component_mul_assign(&drawn.weight);
        let origin = point.origin(direction, self.world.offset);
        Some(Leaving { origin, direction, looked: Some((drawn.pdf, looked_for)) })
    }

    /// Smooth glass: reflects or refracts, by Fresnel's odds. `eta` is the index beyond over that before.
    fn pass(&mut self, hit: Hit, direction: Vec3, eta: f32) -> Option<Leaving> {
        let tint = self.world.albedo(hit, direction);
        let surface = Surface { albedo: tint, coat: None, lobes: Lobes::All };
        let point = self.world.point(hit, direction, surface);
        let [u, _] = self.sampler.pair();
        let cos = point.wo.z;
        let wi = if u < fresnel_dielectric(cos, eta) {
            reflect(point.wo, Vec3::z())
        } else {
            self.throughput.component_mul_assign(&tint);
            let cos_t = (1.0 - (1.0 - cos * cos) / (eta * eta)).max(0.0).sqrt();
            Vec3::new(-point.wo.x / eta, -point.wo.y / eta, -cos_t)
        };
        let direction = point.to_world(wi);
        // Where the smooth normal sends the ray to the wrong side of the facet, the path is lost.
        let stays = direction.dot(&point.geometric) * wi.z > 0.0;
        stays.then(|| Leaving { origin: point.origin(direction, self.world.offset), direction, looked: None })
    }

    /// A translucent part: lights are looked for in its coat and where light comes out of the body; the path
    /// goes on by one of the two.
    fn enter(&mut self, hit: Hit, direction: Vec3, paint: Vec3, coat: &Coat, medium: Medium) -> Option<Leaving> {
        let surface = Surface { albedo: paint, coat: Some(coat), lobes: Lobes::Entry };
        let point = self.world.point(hit, direction, surface);
        let (share, choice) = (surface.coat_share(point.wo), self.sampler.pair());
        let looked_for = self.look_for_lights(&point);
        let arriving = self.throughput;
        let out = self.probe(&point, paint, medium, Lobes::Exit(1.0 - share));
        let looked_for_out = out.as_ref().map(|(out, weight)| {
            self.throughput.component_mul_assign(&(weight * coat.entry_factor(point.wo)));
            self.look_for_lights(out)
        });
        self.surfaces += 1;
        if choice[0] < share {
            self.throughput = arriving;
            return self.leave(&point, choice, looked_for);
        }
        let choice = [(choice[0] - share) / (1.0 - share), choice[1]];
        self.leave(&out?.0, choice, looked_for_out?)
    }

    /// A point where light that comes out at `point` may have entered, with its weight: along a line beside
    /// the normal or one of the tangents, at a distance drawn from the profile; of all crossings one, by what
    /// it gives (resampled importance sampling, Talbot, Cline, Egbert, EGSR 2005).
    fn probe<'b>(&mut self, point: &Point<'b>, paint: Vec3, medium: Medium, lobes: Lobes) -> Option<(Point<'b>, Vec3)> {
        let (profile, world) = (medium.profile(paint), self.world);
        let ([axis, angle], radius, [pick, _]) = (self.sampler.pair(), self.sampler.pair(), self.sampler.pair());
        let radius = profile.sample(radius)?;
        let [first, second, _] = AXIS_ODDS;
        let along = usize::from(axis >= first) + usize::from(axis >= first + second);
        let [t, b, n] = [1, 2, 0].map(|k| point.frame[(along + k) % 3]);
        let (sin, cos) = (std::f32::consts::TAU * angle).sin_cos();
        let half = (profile.reach().powi(2) - radius * radius).max(0.0).sqrt();
        let mut origin = point.position + (t * cos + b * sin) * radius + n * half;
        let mut left = 2.0 * half;
        let (mut crossings, mut total) = ([None; MAX_CROSSINGS], 0.0);
        for slot in &mut crossings {
            self.traced.rays += 1;
            let Some(crossing) = world.accel.nearest(origin, -n, left) else { break };
            let step = crossing.distance + world.offset;
            (origin, left) = (origin - n * step, left - step);
            let weight = world.crossing_weight(point, crossing, &profile);
            total += weight.sum();
            *slot = Some((crossing, weight));
        }
        let mut left = pick * total;
        let (crossing, weight) = crossings.into_iter().flatten().find(|(_, weight)| {
            left -= weight.sum();
            left < 0.0
        })?;
        let surface = Surface { albedo: paint, coat: point.surface.coat, lobes };
        Some((world.outside(crossing, surface), weight * (total / weight.sum())))
    }

    /// Russian roulette by the throughput.
    fn survives(&mut self, u: f32) -> bool {
        let chance = self.throughput.max().min(SURVIVAL);
        if u >= chance {
            return false;
        }
        self.throughput /= chance;
        true
    }

    /// Follows a ray to a light, the sky or the next surface.
    fn follow(&mut self, leaving: &Leaving) -> Option<(Hit, Vec3)> {
        if self.surfaces > 1 {
            let [u, _] = self.sampler.pair();
            if !self.survives(u) {
                return None;
            }
        }
        let Leaving { origin, direction, looked } = leaving;
        self.traced.rays += 1;
        let found = self.world.accel.nearest(*origin, *direction, f32::INFINITY);
        let reach = found.map_or(f32::INFINITY, |h| h.distance);
        if let Some((light, index)) = self.rig.hit(*origin, *direction, reach) {
            let weight = looked.as_ref().map_or(1.0, |(pdf, looked_for)| {
                power_heuristic(*pdf, light.pdf * looked_for.probability(self.rig, index))
            });
            self.traced.radiance += self.throughput.component_mul(&light.radiance) * weight;
            return None;
        }
        if found.is_none() {
            self.traced.radiance += self.throughput.component_mul(&self.rig.sky.radiance(*direction));
        }
        found.map(|hit| (hit, *direction))
    }

    /// Adds what lights give directly: all of them at the first surface, then one.
    fn look_for_lights(&mut self, point: &Point<'_>) -> LookedFor {
        let (rig, [position, normal]) = (self.rig, [point.position, point.frame[2]]);
        if self.surfaces == 0 || rig.lights.len() < 2 {
            for light in &rig.lights {
                let sample = light.sample(point.position, self.sampler.pair());
                self.gather(point, sample.as_ref(), 1.0);
            }
            return LookedFor { position, normal, total_share: None };
        }
        let total = rig.lights.iter().map(|l| l.share(position, normal)).sum::<f32>();
        let [u, _] = self.sampler.pair();
        let mut left = u * total;
        let last = rig.lights.len() - 1;
        for (i, light) in rig.lights.iter().enumerate() {
            let share = light.share(position, normal);
            if left < share || i == last {
                let sample = light.sample(position, self.sampler.pair());
                self.gather(point, sample.as_ref(), share / total);
                break;
            }
            left -= share;
        }
        LookedFor { position, normal, total_share: Some(total) }
    }

    /// Adds light from a sampled point of a light that was picked with the given probability.
    fn gather(&mut self, point: &Point<'_>, light: Option<&LightSample>, probability: f32) {
        let Some(light) = light else { return };
        let wi = point.to_local(light.direction);
        let f = point.surface.evaluate(wi, point.wo);
        if light.direction.dot(&point.geometric) <= 0.0 || f.max() <= 0.0 {
            return;
        }
        self.traced.rays += 1;
        let origin = point.origin(light.direction, self.world.offset);
        if self.world.accel.is_blocked(origin, light.direction, light.distance) {
            return;
        }
        let pdf = light.pdf * probability;
        let weight = power_heuristic(pdf, point.surface.pdf(wi, point.wo));
        let light = f.component_mul(&light.radiance) * (wi.z / pdf * weight);
        self.traced.radiance += self.throughput.component_mul(&light);
    }
}

impl LookedFor {
    /// With what probability this light was looked for.
    fn probability(&self, rig: &LightRig, light: usize) -> f32 {
        self.total_share.map_or(1.0, |total| rig.lights[light].share(self.position, self.normal) / total)
    }
}

impl Point<'_> {
    fn to_local(&self, d: Vec3) -> Vec3 {
        self.frame.map(|axis| d.dot(&axis)).into()
    }

    fn to_world(&self, d: Vec3) -> Vec3 {
        let [x, y, z] = self.frame;
        x * d.x + y * d.y + z * d.z
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::{AreaLight, LightShape, Sky};
    use crate::sampler::{mix, pixel_seed};
    use crate::shape::sphere;
    use std::f64::consts::PI;

    const LIMITS: PathLimits = PathLimits { surfaces: 100 };

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
        let finishes = [
            (Finish::Matt, 1e-6),
            (Finish::glazed(0.15, 1.5), 2e-3),
            (Finish::metal(0.02), 2e-3),
            (Finish::metal(0.4), 2e-3),
            (Finish::glass(1.5), 1e-6),
            (Finish::translucent(0.15, 1.5, 0.05), 3e-3),
        ];
        for (finish, slack) in finishes {
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

    fn ball(center: Vec3, radius: f32, radiance: f32) -> AreaLight {
        AreaLight::facing(LightShape::Sphere, center, Vec3::zeros(), [radius, radius], Vec3::repeat(radiance))
    }

    #[test]
    fn plane_under_a_sphere_light() {
        // E = π L (a/D)² cos θ wherever the whole sphere is above the horizon; L = albedo E / π.
        let (a, h, albedo, l) = (0.4_f32, 1.5_f32, 0.7_f32, 5.0_f32);
        let rig = LightRig { sky: Sky::uniform(0.0), lights: vec![ball(Vec3::new(0.0, 0.0, h), a, l)] };
        let world = world(&plane(), albedo, Finish::Matt);
        for x in [0.0_f32, 1.0, 3.0] {
            // From the side, so that the eye's ray does not start inside the light.
            let direction = Vec3::new(0.0, 0.6, -0.8);
            let (mean, error) = measure(&world, Vec3::new(x, 0.0, 0.0) - direction, direction, &rig, 100_000);
            let d2 = x * x + h * h;
            let expected = f64::from(albedo * l * a * a / d2 * h / d2.sqrt());
            assert!((mean - expected).abs() < 3.0 * error, "at {x}: {mean} ± {error} against {expected}");
        }
    }

    #[test]
    fn inside_of_a_sphere_around_its_light() {
        // Each point of the wall sees the ball under F = (a/r)² of its cosine-weighted hemisphere, and the
        // wall, alike everywhere, in the rest: B = ρ (π L F + (1 − F) B).
        let (a, albedo, l) = (0.3_f64, 0.8_f64, 2.0_f64);
        let mut mesh = sphere(1.0, 200);
        mesh.faces.iter_mut().for_each(|f| f.swap(1, 2));
        let rig = LightRig { sky: Sky::uniform(0.0), lights: vec![ball(Vec3::zeros(), a as f32, l as f32)] };
        let world = world(&mesh, albedo as f32, Finish::Matt);
        let (mean, error) = measure(&world, Vec3::new(0.2, 0.5, 0.1), Vec3::x(), &rig, 100_000);
        let f = a * a;
        let expected = albedo * l * f / (1.0 - albedo * (1.0 - f));
        // 5e-4: the polyhedron lies up to 3e-5 inside the sphere, at 28 of its edges.
        assert!((mean - expected).abs() < 3.0 * error + 5e-4 * expected, "{mean} ± {error} against {expected}");
    }

    #[test]
    fn a_pane_of_glass_reflects_and_passes_as_fresnel_says() {
        // A thin slab: R = 2 r / (1 + r) of both faces with all reflections between them, r = 0.04.
        let mut b = MeshBuilder::default();
        let (low, high) = (b.rectangle([9.0, 9.0], -0.05), b.rectangle([9.0, 9.0], 0.05));
        b.cap_reversed(&low);
        b.walls(&low, &high);
        b.cap(&high);
        let world = world(&b.mesh, 1.0, Finish::glass(1.5));
        let sky = Sky { ground: Vec3::zeros(), horizon: Vec3::zeros(), zenith: Vec3::repeat(1.0) };
        let rig = LightRig { sky, lights: vec![] };
        let (mean, error) = measure(&world, Vec3::new(0.0, 0.0, 2.0), -Vec3::z(), &rig, 100_000);
        let expected = 2.0 * 0.04 / 1.04;
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
