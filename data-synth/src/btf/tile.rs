//! Rays through an endlessly repeated patch.
//!
//! The tree holds what overlaps one cell of the repetition, copies of what crosses its border included.
//! A ray goes through that cell, is moved back by one period where it leaves, and goes on until it meets
//! something or leaves the slab that holds all of the surface: exact at any height and any angle, and
//! the tree is no larger than the patch.

use super::patch::Patch;
use crate::accel::{Accel, Hit};
use crate::material::{Finish, Lobes, Surface, Vec3, frame_around};
use geometry::Mesh;
use nalgebra::Vector3;

/// A ray so flat that it crosses this many cells within the slab is taken to leave it.
const MAX_CELLS: usize = 64;
/// Beyond the rounding of a hit point, in sides of the patch.
const OFFSET: f32 = 2e-5;

/// A patch made ready for rays.
#[derive(Debug)]
pub(crate) struct Tile {
    accel: Accel,
    /// By face of the tree.
    faces: Vec<Face>,
    finish: Finish,
    side: f32,
    low: f32,
    high: f32,
}

#[derive(Clone, Copy, Debug)]
struct Face {
    normal: Vec3,
    normals: [Vec3; 3],
    colors: [Vec3; 3],
}

/// A point of the surface with its shading frame.
#[derive(Clone, Debug)]
pub(crate) struct Point<'a> {
    /// In the cell.
    pub(crate) position: Vec3,
    /// Of the facet.
    pub(crate) geometric: Vec3,
    /// Tangent, bitangent and normal for shading.
    pub(crate) frame: [Vec3; 3],
    /// Towards where the ray came from, in the frame.
    pub(crate) wo: Vec3,
    /// What it is made of.
    pub(crate) surface: Surface<'a>,
}

impl Tile {
    /// Takes over a patch.
    pub(crate) fn new(patch: Patch) -> Self {
        let heights = patch.mesh.positions.iter().map(|p| p.z);
        let (low, high) = heights.fold((0.0_f64, 0.0_f64), |(low, high), z| (low.min(z), high.max(z)));
        let mut copies = Copies { mesh: Mesh::default(), faces: Vec::new() };
        (0..patch.mesh.faces.len()).for_each(|f| copies.add(&patch, f));
        let slack = 1e-3 * patch.side;
        Self {
            accel: Accel::new(&copies.mesh),
            faces: copies.faces,
            finish: patch.finish,
            side: patch.side as f32,
            low: (low - slack) as f32,
            high: (high + slack) as f32,
        }
    }

    /// Length of the period.
    pub(crate) fn side(&self) -> f32 {
        self.side
    }

    /// What the eye in direction `towards` sees at the point (x, y) of the reference plane.
    pub(crate) fn seen(&self, x: f32, y: f32, towards: Vec3) -> Option<Point<'_>> {
        let origin = Vec3::new(x, y, 0.0) + towards * (self.high / towards.z);
        self.nearest(origin, -towards)
    }

    /// The next surface along a ray; `None` into the open, and on an inner side, which no light reaches.
    pub(crate) fn nearest(&self, origin: Vec3, direction: Vec3) -> Option<Point<'_>> {
        let found = self.walk(origin, direction, |o, limit| {
            self.accel.nearest(o, direction, limit).map(|hit| (o + direction * hit.distance, hit))
        });
        found.and_then(|(position, hit)| self.point(position, hit, direction))
    }

    /// Whether light from a direction reaches a point.
    pub(crate) fn is_lit(&self, point: &Point<'_>, light: Vec3) -> bool {
        let blocked = |o, limit| self.accel.is_blocked(o, light, limit).then_some(());
        self.walk(self.start(point, light), light, blocked).is_none()
    }

    /// Where a ray leaving a point starts.
    pub(crate) fn start(&self, point: &Point<'_>, towards: Vec3) -> Vec3 {
        let offset = OFFSET * self.side;
        point.position + point.geometric * offset.copysign(towards.dot(&point.geometric))
    }

    /// Asks `visit` in each cell along the ray, with the origin moved into the tree's cell and how far the
    /// ray goes there, until it has an answer or the ray leaves the slab.
    fn walk<T>(&self, origin: Vec3, direction: Vec3, mut visit: impl FnMut(Vec3, f32) -> Option<T>) -> Option<T> {
        let wrapped = |c: f32| c - (c / self.side).floor() * self.side;
        let mut o = Vec3::new(wrapped(origin.x), wrapped(origin.y), origin.z);
        let mut reach = exit(o.z, direction.z, self.low, self.high);
        let slack = OFFSET * self.side;
        for _ in 0..MAX_CELLS {
            let ends = [0, 1].map(|axis| exit(o[axis], direction[axis], 0.0, self.side));
            let cell = ends[0].min(ends[1]);
            if let Some(answer) = visit(o, cell.min(reach) + slack) {
                return Some(answer);
            }
            if cell >= reach {
                return None;
            }
            o += direction * cell;
            reach -= cell;
            let axis = usize::from(ends[1] < ends[0]);
            o[axis] = if direction[axis] > 0.0 { 0.0 } else { self.side };
        }
        None
    }

    fn point(&self, position: Vec3, hit: Hit, direction: Vec3) -> Option<Point<'_>> {
        let face = &self.faces[hit.face as usize];
        if direction.dot(&face.normal) >= 0.0 {
            return None;
        }
        let [u, v] = hit.barycentric;
        let mixed = |c: &[Vec3; 3]| c[0] * (1.0 - u - v) + c[1] * u + c[2] * v;
        // Where the interpolated normal turns away from the eye, the facet's own is the honest one.
        let smooth = mixed(&face.normals).try_normalize(1e-6).filter(|n| n.dot(&direction) < 0.0);
        let frame = frame_around(smooth.unwrap_or(face.normal));
        let wo = frame.map(|axis| -direction.dot(&axis)).into();
        let surface = Surface { albedo: mixed(&face.colors), coat: self.finish.coat(), lobes: Lobes::All };
        Some(Point { position, geometric: face.normal, frame, wo, surface })
    }
}

impl Point<'_> {
    /// A world direction in the frame.
    pub(crate) fn to_local(&self, d: Vec3) -> Vec3 {
        self.frame.map(|axis| d.dot(&axis)).into()
    }

    /// A direction of the frame in the world.
    pub(crate) fn to_world(&self, d: Vec3) -> Vec3 {
        self.frame[0] * d.x + self.frame[1] * d.y + self.frame[2] * d.z
    }
}

/// The triangles that overlap the cell.
struct Copies {
    mesh: Mesh,
    faces: Vec<Face>,
}

impl Copies {
    /// Adds a face as often as it or a copy of it overlaps the cell.
    fn add(&mut self, patch: &Patch, f: usize) {
        let corners = patch.mesh.corners(f);
        let Some(normal) = patch.mesh.face_area_vector(f).try_normalize(0.0) else { return };
        let slack = 1e-4 * patch.side;
        let shifts = |axis: usize| {
            let values = corners.map(|c| c[axis]);
            let (low, high) =
                (values.into_iter().fold(f64::MAX, f64::min), values.into_iter().fold(f64::MIN, f64::max));
            let first = ((-slack - high) / patch.side).ceil() as i64;
            let last = ((patch.side + slack - low) / patch.side).floor() as i64;
            first..=last
        };
        let face = patch.mesh.faces[f].map(|v| v as usize);
        let attributes = Face {
            normal: normal.cast(),
            normals: face.map(|v| patch.normals[v]),
            colors: face.map(|v| patch.colors[v]),
        };
        for i in shifts(0) {
            for j in shifts(1) {
                let shift = Vector3::new(i as f64, j as f64, 0.0) * patch.side;
                let first = self.mesh.positions.len() as u32;
                self.mesh.positions.extend(corners.map(|c| c + shift));
                self.mesh.faces.push([first, first + 1, first + 2]);
                self.faces.push(attributes);
            }
        }
    }
}

/// How far a coordinate can go before it leaves [low, high].
fn exit(at: f32, direction: f32, low: f32, high: f32) -> f32 {
    let border = if direction > 0.0 { high } else { low };
    if direction == 0.0 { f32::INFINITY } else { ((border - at) / direction).max(0.0) }
}
