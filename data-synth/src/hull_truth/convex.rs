//! The hull of a convex polyhedron: a polytope.

use super::{check_eyes, too_close};
use crate::SynthError;
use capture::Aabb;
use geometry::Mesh;
use nalgebra::{Point3, Vector2, Vector3};
use std::collections::{BTreeMap, BTreeSet};

/// Relative to the size of the outline: what turns by less is straight.
const STRAIGHT: f64 = 1e-12;
/// Relative to the box: what is nearer to a plane lies on it. Planes of many eyes meet in the edges of the
/// object, and must not cut slivers off each other.
const ON_PLANE: f64 = 1e-12;

/// The visual hull of a convex polyhedron, cut at a box.
#[derive(Clone, Debug)]
pub struct ConvexHull {
    planes: Vec<Plane>,
    mesh: Mesh,
}

/// The half-space `normal · x ≤ offset`.
#[derive(Clone, Copy, Debug)]
struct Plane {
    /// Of unit length, outward.
    normal: Vector3<f64>,
    offset: f64,
}

impl ConvexHull {
    /// The hull of the convex hull of `vertices` seen from `eyes`, within `bounds`.
    ///
    /// # Errors
    /// [`SynthError::Option`] without eyes, where an eye does not have all vertices in front of it or sees them
    /// in one line, where `bounds` is not a box, or where the hull lies outside it. [`SynthError::Scene`] where planes
    /// differ by so little that rounding decides where they meet.
    pub fn new(vertices: &[Point3<f64>], eyes: &[Point3<f64>], bounds: &Aabb) -> Result<Self, SynthError> {
        check_eyes(eyes)?;
        let is_box = bounds.size().min() > 0.0 && bounds.diagonal().is_finite();
        let mut polytope = is_box.then(|| Polytope::new(bounds)).ok_or_else(|| bad_bounds(bounds))?;
        let mut planes = walls(bounds);
        for eye in eyes {
            let outline = outline(vertices, eye).ok_or_else(|| too_close(eye, "outside the object"))?;
            planes.extend(outline);
        }
        let slack = ON_PLANE * bounds.diagonal();
        for plane in &planes[6..] {
            polytope.clip(plane, slack).ok_or_else(|| bad_bounds(bounds))?;
        }
        let mesh = polytope.mesh();
        if !mesh.check().is_ok_and(|check| check.closed_manifold) {
            return Err(SynthError::Scene { fault: "outlines of the polyhedron nearly coincide" });
        }
        Ok(Self { planes, mesh })
    }

    /// At most zero in the hull. The size of negative values is the distance from the surface; positive ones
    /// never exceed it.
    pub fn distance(&self, p: &Point3<f64>) -> f64 {
        self.planes.iter().map(|plane| plane.distance(p)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Whether a point is in the hull, its surface included.
    pub fn contains(&self, p: &Point3<f64>) -> bool {
        self.distance(p) <= 0.0
    }

    /// Its surface, a closed manifold, to rounding.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }
}

impl Plane {
    fn distance(&self, p: &Point3<f64>) -> f64 {
        self.normal.dot(&p.coords) - self.offset
    }
}

fn bad_bounds(bounds: &Aabb) -> SynthError {
    let value = format!("{:?} to {:?}", bounds.min.coords.data.0[0], bounds.max.coords.data.0[0]);
    SynthError::Option { option: "bounds", value, allowed: "a box that the object reaches into".into() }
}

fn walls(bounds: &Aabb) -> Vec<Plane> {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let pair = |axis: Vector3<f64>| {
        let (low, high) = (axis.dot(&bounds.min.coords), axis.dot(&bounds.max.coords));
        [Plane { normal: -axis, offset: -low }, Plane { normal: axis, offset: high }]
    };
    axes.into_iter().flat_map(pair).collect()
}

/// The planes through the eye and the edges of the outline; `None` where there is no outline. Differences of
/// vertices, not of rays, keep all digits for an eye however far.
fn outline(vertices: &[Point3<f64>], eye: &Point3<f64>) -> Option<Vec<Plane>> {
    let middle = Point3::from(vertices.iter().map(|v| v.coords).sum::<Vector3<f64>>() / vertices.len() as f64);
    let axis = (middle - eye).try_normalize(0.0)?;
    // Also refuses what is not finite.
    if !vertices.iter().all(|v| (v - eye).dot(&axis) > 0.0) {
        return None;
    }
    let right = axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize();
    let up = axis.cross(&right);
    let on_image =
        |v: &Point3<f64>| Vector2::new((v - middle).dot(&right), (v - middle).dot(&up)) / (v - eye).dot(&axis);
    let image: Vec<Vector2<f64>> = vertices.iter().map(on_image).collect();
    let ring = convex_ring(&image);
    let plane = |i: usize| {
        let (p, q) = (vertices[ring[i]], vertices[ring[(i + 1) % ring.len()]]);
        // Right, up and the axis are a right-handed frame: the inside is left of the edge, outside right.
        let normal = (q - p).cross(&(p - eye)).normalize();
        Plane { normal, offset: normal.dot(&p.coords) }
    };
    (ring.len() >= 3).then(|| (0..ring.len()).map(plane).collect())
}

/// Indices of the corners of the convex hull, counter-clockwise (A. Andrew, *Another Efficient Algorithm for
/// Convex Hulls in Two Dimensions*, 1979).
fn convex_ring(points: &[Vector2<f64>]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| points[a].x.total_cmp(&points[b].x).then(points[a].y.total_cmp(&points[b].y)));
    let extent = points.iter().map(|p| p.amax()).fold(0.0, f64::max);
    let least = STRAIGHT * extent * extent;
    let half = |order: &mut dyn Iterator<Item = usize>| {
        let mut chain: Vec<usize> = Vec::new();
        for next in order {
            while let [.., a, b] = chain[..]
                && (points[b] - points[a]).perp(&(points[next] - points[a])) <= least
            {
                chain.pop();
            }
            chain.push(next);
        }
        chain.pop();
        chain
    };
    let mut ring = half(&mut order.iter().copied());
    ring.extend(half(&mut order.iter().rev().copied()));
    ring
}

/// A convex solid as polygons over shared vertices, counter-clockwise from outside.
struct Polytope {
    vertices: Vec<Point3<f64>>,
    faces: Vec<Vec<usize>>,
}

impl Polytope {
    fn new(bounds: &Aabb) -> Self {
        let (low, high) = (bounds.min, bounds.max);
        let pick = |i: usize, axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
        let vertices = (0..8).map(|i| Point3::new(pick(i, 0), pick(i, 1), pick(i, 2))).collect();
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        Self { vertices, faces: faces.map(|face| face.to_vec()).to_vec() }
    }

    /// Keeps what is behind the plane; `None` where nothing is.
    fn clip(&mut self, plane: &Plane, slack: f64) -> Option<()> {
        let heights: Vec<f64> = self.vertices.iter().map(|v| plane.distance(v)).collect();
        if self.faces.iter().flatten().all(|&v| heights[v] <= slack) {
            return Some(());
        }
        let mut cuts = BTreeMap::new();
        let faces: Vec<Vec<usize>> = self
            .faces
            .iter()
            .filter(|face| face.iter().any(|&v| heights[v] < -slack))
            .map(|face| clip_face(face, &heights, slack, &mut self.vertices, &mut cuts))
            .collect();
        self.faces = faces;
        self.close();
        (!self.faces.is_empty()).then_some(())
    }

    /// Covers the hole a cut has left. Planes that differ by little more than the slack may leave several.
    fn close(&mut self) {
        let edges = |face: &Vec<usize>| -> Vec<(usize, usize)> {
            (0..face.len()).map(|i| (face[i], face[(i + 1) % face.len()])).collect()
        };
        let all: BTreeSet<(usize, usize)> = self.faces.iter().flat_map(edges).collect();
        let open = all.iter().filter(|&&(a, b)| !all.contains(&(b, a)));
        let mut next: BTreeMap<usize, usize> = open.map(|&(a, b)| (b, a)).collect();
        while let Some((first, mut v)) = next.pop_first() {
            let mut ring = vec![first];
            while v != first {
                ring.push(v);
                let Some(after) = next.remove(&v) else { break };
                v = after;
            }
            self.faces.push(ring);
        }
    }

    /// Fans of triangles over the vertices still in use.
    fn mesh(&self) -> Mesh {
        let mut mesh = Mesh::default();
        let mut ids = BTreeMap::new();
        for face in &self.faces {
            let corners: Vec<u32> = face
                .iter()
                .map(|&v| {
                    *ids.entry(v).or_insert_with(|| {
                        mesh.positions.push(self.vertices[v]);
                        mesh.positions.len() as u32 - 1
                    })
                })
                .collect();
            mesh.faces.extend(corners[1..].windows(2).map(|pair| [corners[0], pair[0], pair[1]]));
        }
        mesh
    }
}

/// The part of a convex polygon behind the plane. Edges that cross it get a vertex there, shared by both faces.
fn clip_face(
    face: &[usize],
    heights: &[f64],
    slack: f64,
    vertices: &mut Vec<Point3<f64>>,
    cuts: &mut BTreeMap<(usize, usize), usize>,
) -> Vec<usize> {
    let mut kept = Vec::with_capacity(face.len() + 1);
    for (i, &v) in face.iter().enumerate() {
        let next = face[(i + 1) % face.len()];
        if heights[v] <= slack {
            kept.push(v);
        }
        let (low, high) = if heights[v] < heights[next] { (v, next) } else { (next, v) };
        // An end on the plane is itself the vertex there.
        if heights[low] < -slack && heights[high] > slack {
            kept.push(*cuts.entry((low, high)).or_insert_with(|| {
                let t = heights[low] / (heights[low] - heights[high]);
                vertices.push(vertices[low] + (vertices[high] - vertices[low]) * t);
                vertices.len() - 1
            }));
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::super::{PolyhedronHull, orthographic_ring_ratio};
    use super::*;
    use crate::sampler::splitmix;
    use std::f64::consts::{PI, TAU};

    fn bounds(low: [f64; 3], high: [f64; 3]) -> Aabb {
        Aabb { min: low.into(), max: high.into() }
    }

    fn cube() -> Vec<Point3<f64>> {
        let sign = |i: usize, axis: usize| if i >> axis & 1 == 0 { -1.0 } else { 1.0 };
        (0..8).map(|i| Point3::new(sign(i, 0), sign(i, 1), sign(i, 2))).collect()
    }

    fn closed_volume(hull: &ConvexHull) -> f64 {
        let check = hull.mesh().check().unwrap();
        assert!(check.closed_manifold && check.euler == 2, "{check:?}");
        check.volume
    }

    #[test]
    fn one_eye_sees_a_frustum() {
        let walls = bounds([-9.0, -9.0, -3.0], [9.0, 9.0, 1.0]);
        let hull = ConvexHull::new(&cube(), &[Point3::new(0.0, 0.0, 4.0)], &walls).unwrap();
        // Half as wide as (4 − z) / 3: ∫ 4 u² / 9 du from 3 to 7.
        assert!((closed_volume(&hull) - 4.0 / 27.0 * (343.0 - 27.0)).abs() < 1e-9);
        assert!(hull.contains(&Point3::new(2.3, -2.3, -3.0)) && !hull.contains(&Point3::new(2.4, 0.0, -3.0)));
        assert!((hull.distance(&Point3::new(0.0, 0.0, 1.5)) - 0.5).abs() < 1e-12, "beyond the box");
    }

    #[test]
    fn three_far_eyes_on_the_axes_see_a_cube_as_it_is() {
        let eyes = [Point3::new(1e9, 0.0, 0.0), Point3::new(0.0, -1e9, 0.0), Point3::new(0.0, 0.0, 1e9)];
        let hull = ConvexHull::new(&cube(), &eyes, &bounds([-2.0; 3], [2.0; 3])).unwrap();
        assert!((closed_volume(&hull) - 8.0).abs() < 1e-6);
    }

    #[test]
    fn a_far_ring_leaves_the_regular_polygon_of_a_cylinder() {
        for views in [2, 3, 4, 6, 12] {
            // As many corners as make every tangent plane touch one.
            let circle = |i: usize| (TAU * i as f64 / 720.0).sin_cos();
            let corners = (0..720).map(circle).flat_map(|(s, c)| [Point3::new(c, s, -1.0), Point3::new(c, s, 1.0)]);
            let eye = |i: usize| (PI * i as f64 / views as f64).sin_cos();
            let eyes: Vec<_> = (0..views).map(eye).map(|(s, c)| Point3::new(c, s, 0.0) * 1e7).collect();
            let hull = ConvexHull::new(&corners.collect::<Vec<_>>(), &eyes, &bounds([-3.0; 3], [3.0; 3])).unwrap();
            let ratio = closed_volume(&hull) / TAU;
            assert!((ratio / orthographic_ring_ratio(views) - 1.0).abs() < 1e-6, "{views}: {ratio}");
        }
        assert!((orthographic_ring_ratio(3) - 1.10266).abs() < 1e-5);
        assert_eq!(orthographic_ring_ratio(1), f64::INFINITY);
    }

    #[test]
    fn many_eyes_leave_little_more_than_the_object() {
        let eye = |i: usize| {
            // A spiral over the sphere by the golden angle.
            let z: f64 = 1.0 - (2.0 * i as f64 + 1.0) / 400.0;
            let (s, c) = (i as f64 * PI * (3.0 - 5.0_f64.sqrt())).sin_cos();
            Point3::new(c * (1.0 - z * z).sqrt(), s * (1.0 - z * z).sqrt(), z) * 5.0
        };
        let eyes: Vec<_> = (0..400).map(eye).collect();
        let hull = ConvexHull::new(&cube(), &eyes, &bounds([-2.0; 3], [2.0; 3])).unwrap();
        let volume = closed_volume(&hull);
        assert!(volume > 8.0 && volume < 8.3, "{volume}");
        assert!(cube().iter().all(|v| hull.distance(v) < 1e-12), "the hull holds the object");
    }

    /// Points in [−1, 1]³.
    fn scattered(count: u64, seed: u64) -> Vec<Point3<f64>> {
        let uniform = |i: u64| (splitmix(seed ^ splitmix(i)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0;
        (0..count).map(|i| Point3::new(uniform(3 * i), uniform(3 * i + 1), uniform(3 * i + 2))).collect()
    }

    #[test]
    fn any_polyhedron_from_anywhere_has_a_closed_hull_that_holds_it() {
        for seed in 0..40 {
            let vertices = scattered(4 + seed, seed);
            let eyes: Vec<_> = scattered(12, !seed).iter().map(|p| Point3::from(p.coords.normalize() * 4.0)).collect();
            let hull = ConvexHull::new(&vertices, &eyes, &bounds([-2.0; 3], [2.0; 3])).unwrap();
            assert!(closed_volume(&hull) > 0.0);
            assert!(vertices.iter().all(|v| hull.distance(v) < 1e-12), "{seed}");
        }
    }

    #[test]
    fn planes_and_lines_of_sight_agree() {
        let faces = [[0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4]];
        let others = [[2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5]];
        let mesh = Mesh { positions: cube(), faces: [faces, others].concat() };
        let eyes = [Point3::new(4.0, 0.5, 0.7), Point3::new(-0.3, 5.0, 2.0), Point3::new(-3.0, -3.0, 1.0)];
        let planes = ConvexHull::new(&cube(), &eyes, &bounds([-9.0; 3], [9.0; 3])).unwrap();
        let lines = PolyhedronHull::new(&mesh, &eyes).unwrap();
        let inside: Vec<bool> = scattered(2000, 5).iter().map(|p| lines.contains(&(p * 1.6))).collect();
        let expected: Vec<bool> = scattered(2000, 5).iter().map(|p| planes.contains(&(p * 1.6))).collect();
        assert!(inside == expected && inside.contains(&true) && inside.contains(&false));
    }

    #[test]
    fn what_has_no_outline_is_refused() {
        let near = bounds([-2.0; 3], [2.0; 3]);
        let far = bounds([7.0; 3], [8.0; 3]);
        let eye = Point3::new(5.0, 1.0, 1.0);
        assert!(ConvexHull::new(&cube(), &[eye], &far).unwrap_err().to_string().contains("bounds"));
        assert!(ConvexHull::new(&cube(), &[eye], &bounds([0.0; 3], [0.0; 3])).is_err());
        assert!(ConvexHull::new(&cube(), &[Point3::origin()], &near).unwrap_err().to_string().contains("eyes"));
        assert!(ConvexHull::new(&cube()[..2], &[eye], &near).is_err());
        assert!(ConvexHull::new(&cube(), &[], &near).is_err());
    }
}
