//! Ray queries against a triangle mesh.
//!
//! The `obvhs` crate builds the tree and walks it: eight boxes a node, compressed, tested side by side
//! (Ylitie, Karras, Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs",
//! HPG 2017). The triangle test is ours, so that no ray slips between two triangles that share an edge.

use crate::material::Vec3;
use geometry::Mesh;
use glam::{Vec3A, vec3a};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::{Ray, RayHit};
use std::time::Duration;

/// Slack of the barycentric test, so that no ray slips between two triangles sharing an edge.
const EDGE_SLACK: f32 = 1e-5;

/// Where a ray meets the mesh.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    /// Along the ray, in lengths of its direction.
    pub(crate) distance: f32,
    /// Index of the face in the mesh.
    pub(crate) face: u32,
    /// Weights of the second and the third corner.
    pub(crate) barycentric: [f32; 2],
}

/// A mesh made ready for rays.
#[derive(Clone, Debug, Default)]
pub(crate) struct Accel {
    tree: CwBvh,
    /// In the order of the tree.
    triangles: Vec<Triangle>,
}

#[derive(Clone, Copy, Debug)]
struct Triangle {
    corner: Vec3A,
    edges: [Vec3A; 2],
    face: u32,
}

impl Accel {
    /// Builds the tree of all faces.
    pub(crate) fn new(mesh: &Mesh) -> Self {
        if mesh.faces.is_empty() {
            return Self::default();
        }
        let point = |p: nalgebra::Point3<f64>| vec3a(p.x as f32, p.y as f32, p.z as f32);
        let corners = |f: usize| mesh.corners(f).map(point);
        let shapes: Vec<_> = (0..mesh.faces.len())
            .map(|f| {
                let [v0, v1, v2] = corners(f);
                obvhs::triangle::Triangle { v0, v1, v2 }
            })
            .collect();
        // No splitting: every face appears once. The build is a share of a second for 400 k faces.
        let quality = BvhBuildParams { pre_split: false, ..BvhBuildParams::slow_build() };
        let tree = build_cwbvh_from_tris(&shapes, quality, &mut Duration::default());
        let triangle = |&face: &u32| {
            let [a, b, c] = corners(face as usize);
            Triangle { corner: a, edges: [b - a, c - a], face }
        };
        let triangles = tree.primitive_indices.iter().map(triangle).collect();
        Self { tree, triangles }
    }

    /// The nearest hit closer than `limit`.
    pub(crate) fn nearest(&self, origin: Vec3, direction: Vec3, limit: f32) -> Option<Hit> {
        if self.triangles.is_empty() {
            return None;
        }
        let mut best = None;
        let found = |ray: &Ray, at: usize| match self.triangles[at].hit(ray) {
            Some(hit) => {
                best = Some(hit);
                hit.distance
            }
            None => f32::INFINITY,
        };
        self.tree.ray_traverse(ray(origin, direction, limit), &mut RayHit::none(), found);
        best
    }

    /// Whether anything lies closer than `limit`.
    pub(crate) fn is_blocked(&self, origin: Vec3, direction: Vec3, limit: f32) -> bool {
        let distance = |ray: &Ray, at: usize| self.triangles[at].hit(ray).map_or(f32::INFINITY, |h| h.distance);
        !self.triangles.is_empty() && !self.tree.ray_traverse_miss(ray(origin, direction, limit), distance)
    }
}

fn ray(origin: Vec3, direction: Vec3, limit: f32) -> Ray {
    // Plus zero: the walk takes −0 for positive where it orders boxes and for negative where it divides, and
    // misses everything.
    let direction = Vec3A::from(<[f32; 3]>::from(direction)) + Vec3A::ZERO;
    Ray::new(<[f32; 3]>::from(origin).into(), direction, 0.0, limit)
}

impl Triangle {
    /// Möller and Trumbore 1997.
    #[inline]
    fn hit(&self, ray: &Ray) -> Option<Hit> {
        let [e1, e2] = self.edges;
        let p = ray.direction.cross(e2);
        let det = e1.dot(p);
        if det == 0.0 {
            return None;
        }
        let inverse = 1.0 / det;
        let s = ray.origin - self.corner;
        let u = s.dot(p) * inverse;
        if !(-EDGE_SLACK..=1.0 + EDGE_SLACK).contains(&u) {
            return None;
        }
        let q = s.cross(e1);
        let v = ray.direction.dot(q) * inverse;
        if v < -EDGE_SLACK || u + v > 1.0 + EDGE_SLACK {
            return None;
        }
        let distance = e2.dot(q) * inverse;
        (distance > 0.0 && distance < ray.tmax).then_some(Hit { distance, face: self.face, barycentric: [u, v] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::sphere;
    use nalgebra::Point3;

    #[test]
    fn rays_find_what_a_linear_search_finds() {
        let mesh = sphere(1.0, 24);
        let accel = Accel::new(&mesh);
        let all: Vec<Triangle> = accel.triangles.clone();
        assert_eq!(all.len(), mesh.faces.len());
        for i in 0..500_u32 {
            let r = |k: u32| crate::sampler::unit(crate::sampler::mix(i * 7 + k)) * 2.0 - 1.0;
            let (o, d) = (Vec3::new(r(0), r(1), r(2)) * 2.0, Vec3::new(r(3), r(4), r(5)).normalize());
            let slow =
                all.iter().filter_map(|t| t.hit(&ray(o, d, f32::INFINITY))).map(|h| h.distance).fold(9e9, f32::min);
            let fast = accel.nearest(o, d, f32::INFINITY).map_or(9e9, |h| h.distance);
            assert_eq!(slow, fast);
            assert_eq!(accel.is_blocked(o, d, f32::INFINITY), slow < 9e9);
        }
    }

    #[test]
    fn rays_along_the_axes_meet_what_is_in_their_way() {
        let accel = Accel::new(&sphere(1.0, 24));
        for axis in [Vec3::x(), Vec3::y(), Vec3::z()] {
            for d in [axis, -axis] {
                // Negated, the zeros of a direction are negative too.
                assert!(accel.nearest(Vec3::new(0.01, 0.02, 0.03) - d * 3.0, d, 9.0).is_some(), "{d}");
            }
        }
    }

    #[test]
    fn an_empty_mesh_and_a_single_triangle_are_fine() {
        assert!(Accel::new(&Mesh::default()).nearest(Vec3::zeros(), Vec3::x(), 1.0).is_none());
        let positions = vec![Point3::new(1.0, -1.0, -1.0), Point3::new(1.0, 1.0, -1.0), Point3::new(1.0, 0.0, 1.0)];
        let accel = Accel::new(&Mesh { positions, faces: vec![[0, 1, 2]] });
        assert!(accel.nearest(Vec3::zeros(), Vec3::x(), 9.0).is_some());
        assert!(accel.nearest(Vec3::zeros(), -Vec3::x(), 9.0).is_none());
    }
}
