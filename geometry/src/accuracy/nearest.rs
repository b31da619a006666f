//! How far a point is from a surface, and on which side.
//!
//! The side is that of the angle-weighted pseudonormal of the nearest feature (face, edge or vertex), which
//! is exact for closed manifolds: J. Bærentzen, H. Aanæs, *Signed Distance Computation Using the Angle
//! Weighted Pseudonormal*, IEEE TVCG 11(3), 2005. Where the nearest feature lies on a border, the surface
//! ends before it could tell the sides apart, and none is given.

use crate::Mesh;
use crate::mesh::half_edge::HalfEdges;
use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::{Bvh, rayon_executor};
use bvh::point_query::PointDistance;
use nalgebra::{Point3, Vector3};

/// Twice the area of a face, relative to its longest edge squared, below which it counts as none.
const LEAST_AREA: f64 = 1e-12;

/// A mesh made ready for distance queries. Faces without area take no part.
pub(super) struct Surface {
    tree: Bvh<f64, 3>,
    triangles: Vec<Triangle>,
    sides: Sides,
}

/// The nearest point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Nearest {
    /// In world units.
    pub(super) distance: f64,
    /// Positive outside; `None` where the nearest point lies on a border.
    pub(super) signed: Option<f64>,
}

impl Surface {
    /// Indices must be in range and positions finite. `None` where no face has an area.
    pub(super) fn new(mesh: &Mesh) -> Option<Self> {
        let with_area = |&face: &usize| unit_normal(mesh, face) != Vector3::zeros();
        let triangle = |face| Triangle { corners: mesh.corners(face), face, node: 0 };
        let mut triangles: Vec<Triangle> = (0..mesh.faces.len()).filter(with_area).map(triangle).collect();
        if triangles.is_empty() {
            return None;
        }
        let tree = Bvh::build_with_executor(&mut triangles, rayon_executor);
        Some(Self { tree, triangles, sides: Sides::new(mesh) })
    }

    /// The point of the surface nearest to `p`.
    pub(super) fn nearest(&self, p: &Point3<f64>) -> Nearest {
        // A tree of at least one triangle always answers.
        let Some((triangle, distance)) = self.tree.nearest_to(*p, &self.triangles) else {
            return Nearest { distance: f64::INFINITY, signed: None };
        };
        let (point, feature) = triangle.nearest(p);
        let side = |normal: Vector3<f64>| if (p - point).dot(&normal) < 0.0 { -distance } else { distance };
        Nearest { distance, signed: self.sides.normal(triangle.face, feature).map(side) }
    }
}

/// Where on a triangle a point lies.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Feature {
    Inner,
    /// From corner `k` to the next.
    Edge(usize),
    Corner(usize),
}

#[derive(Clone, Debug)]
struct Triangle {
    corners: [Point3<f64>; 3],
    face: usize,
    node: usize,
}

impl Triangle {
    /// Straight above the triangle the foot of the perpendicular, otherwise the best of the three edges:
    /// no quotient is ill-conditioned where the triangle is a sliver.
    fn nearest(&self, p: &Point3<f64>) -> (Point3<f64>, Feature) {
        let [a, b, c] = self.corners;
        let normal = (b - a).cross(&(c - a));
        let is_left_of = |q: Point3<f64>, r: Point3<f64>| normal.dot(&(r - q).cross(&(p - q))) > 0.0;
        if is_left_of(a, b) && is_left_of(b, c) && is_left_of(c, a) {
            return (p - normal * ((p - a).dot(&normal) / normal.norm_squared()), Feature::Inner);
        }
        let mut best = on_edge(p, [a, b], 0);
        for (k, ends) in [(1, [b, c]), (2, [c, a])] {
            let candidate = on_edge(p, ends, k);
            if (p - candidate.0).norm_squared() < (p - best.0).norm_squared() {
                best = candidate;
            }
        }
        best
    }
}

/// The nearest point of edge `k`.
fn on_edge(p: &Point3<f64>, [from, to]: [Point3<f64>; 2], k: usize) -> (Point3<f64>, Feature) {
    let along = to - from;
    let t = (p - from).dot(&along) / along.norm_squared();
    if t >= 1.0 {
        (to, Feature::Corner((k + 1) % 3))
    } else if t > 0.0 {
        (from + along * t, Feature::Edge(k))
    } else {
        // Also an edge without length.
        (from, Feature::Corner(k))
    }
}

impl Bounded<f64, 3> for Triangle {
    fn aabb(&self) -> Aabb<f64, 3> {
        self.corners.iter().fold(Aabb::empty(), |bounds, corner| bounds.grow(corner))
    }
}

impl BHShape<f64, 3> for Triangle {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

impl PointDistance<f64, 3> for Triangle {
    fn distance_squared(&self, query_point: Point3<f64>) -> f64 {
        (query_point - self.nearest(&query_point).0).norm_squared()
    }
}

/// Pseudonormals of faces, edges and vertices. Their lengths do not matter.
struct Sides {
    faces: Vec<Vector3<f64>>,
    /// Edge `k` of face `f` at `3 f + k`; `None` on a border.
    edges: Vec<Option<Vector3<f64>>>,
    /// Corner `k` of face `f` at `3 f + k`; `None` on a border.
    corners: Vec<Option<Vector3<f64>>>,
}

impl Sides {
    fn new(mesh: &Mesh) -> Self {
        let ids = vertex_ids(mesh);
        let ids_of = |face: usize| mesh.faces[face].map(|v| ids[v as usize]);
        let faces: Vec<Vector3<f64>> = (0..mesh.faces.len()).map(|f| unit_normal(mesh, f)).collect();
        let mut half_edges: Vec<(u32, u32, usize)> = (0..3 * faces.len())
            .map(|h| (ids_of(h / 3)[h % 3], ids_of(h / 3)[(h % 3 + 1) % 3], h))
            // A face fallen into a line has an edge from a vertex to itself, which is no border.
            .filter(|(a, b, _)| a != b)
            .map(|(a, b, h)| (a.min(b), a.max(b), h))
            .collect();
        half_edges.sort_unstable();
        let mut edges = vec![None; 3 * faces.len()];
        let mut vertices = vec![Some(Vector3::zeros()); mesh.positions.len()];
        for edge in half_edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            if let [(a, b, _)] = *edge {
                vertices[a as usize] = None;
                vertices[b as usize] = None;
            } else {
                let normal: Vector3<f64> = edge.iter().map(|&(.., h)| faces[h / 3]).sum();
                edge.iter().for_each(|&(.., h)| edges[h] = Some(normal));
            }
        }
        for (face, normal) in faces.iter().enumerate() {
            for (k, v) in ids_of(face).into_iter().enumerate() {
                if let Some(sum) = &mut vertices[v as usize] {
                    *sum += normal * angle(mesh, face, k);
                }
            }
        }
        let corners = (0..3 * faces.len()).map(|h| vertices[ids_of(h / 3)[h % 3] as usize]).collect();
        Self { faces, edges, corners }
    }

    fn normal(&self, face: usize, feature: Feature) -> Option<Vector3<f64>> {
        match feature {
            Feature::Inner => Some(self.faces[face]),
            Feature::Edge(k) => self.edges[3 * face + k],
            Feature::Corner(k) => self.corners[3 * face + k],
        }
    }
}

/// Zero of a face without area.
fn unit_normal(mesh: &Mesh, face: usize) -> Vector3<f64> {
    let [a, b, c] = mesh.corners(face);
    let longest = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
    mesh.face_area_vector(face).try_normalize(LEAST_AREA * longest).unwrap_or_default()
}

/// The angle at corner `k`, zero at an edge without length.
fn angle(mesh: &Mesh, face: usize, k: usize) -> f64 {
    let corners = mesh.corners(face);
    let (u, v) = (corners[(k + 1) % 3] - corners[k], corners[(k + 2) % 3] - corners[k]);
    u.cross(&v).norm().atan2(u.dot(&v))
}

/// One number per vertex. A closed mesh keeps its own: sheets that touch stay apart. In any other mesh
/// vertices at one place are one, for an atlas or a list of loose triangles splits them.
fn vertex_ids(mesh: &Mesh) -> Vec<u32> {
    let mut ids: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    if HalfEdges::new(&mesh.faces, mesh.positions.len()).is_closed() {
        return ids;
    }
    // Adding zero makes −0 the same place as 0.
    let place = |v: u32| mesh.positions[v as usize].coords.map(|x| (x + 0.0).to_bits()).data.0[0];
    let mut order = ids.clone();
    order.sort_unstable_by_key(|&v| (place(v), v));
    for pair in order.windows(2).filter(|pair| place(pair[0]) == place(pair[1])) {
        ids[pair[1] as usize] = ids[pair[0] as usize];
    }
    ids
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn tetrahedron() -> Mesh {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Point3::from);
        Mesh { positions: positions.to_vec(), faces: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]] }
    }

    /// By the inequalities of the solid, with no notion of nearest features.
    fn is_in_tetrahedron(p: &Point3<f64>) -> bool {
        p.iter().all(|&x| x > 0.0) && p.coords.sum() < 1.0
    }

    #[test]
    fn a_split_mesh_has_the_sides_of_the_whole_one() {
        let whole = tetrahedron();
        let corners = (0..4).flat_map(|f| whole.corners(f)).collect();
        let soup = Mesh { positions: corners, faces: (0..4).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect() };
        let p = Point3::new(-0.3, -0.2, -0.1);
        let [whole, soup] = [whole, soup].map(|mesh| Surface::new(&mesh).unwrap().nearest(&p));
        assert_eq!(whole, soup);
        assert!((whole.signed.unwrap() - 0.14_f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn a_face_fallen_into_a_line_is_no_hole() {
        let mut mesh = tetrahedron();
        let p = Point3::new(-1.0, -1.0, -1.0);
        let whole = Surface::new(&mesh).unwrap().nearest(&p);
        mesh.faces.push([0, 0, 1]);
        assert_eq!(Surface::new(&mesh).unwrap().nearest(&p), whole);
        assert!(whole.signed.is_some());
    }

    #[test]
    fn beyond_a_border_there_is_no_side() {
        let mut open = tetrahedron();
        open.faces.pop();
        let surface = Surface::new(&open).unwrap();
        assert_eq!(surface.nearest(&Point3::new(-1.0, -1.0, 0.5)).signed, None);
        assert_eq!(surface.nearest(&Point3::new(0.2, 0.2, -1.0)).signed, Some(1.0));
    }

    #[test]
    fn a_mesh_of_points_and_lines_has_no_surface() {
        let mut flat = tetrahedron();
        flat.positions.iter_mut().for_each(|p| (p.y, p.z) = (2.0 * p.x, 3.0 * p.x));
        assert!(Surface::new(&flat).is_none());
    }

    proptest! {
        #[test]
        fn sides_of_a_solid_with_sharp_edges_are_right(xyz in prop::array::uniform3(-1.0..2.0_f64)) {
            let p = Point3::from(xyz);
            let signed = Surface::new(&tetrahedron()).unwrap().nearest(&p).signed.unwrap();
            prop_assert_eq!(signed < 0.0, is_in_tetrahedron(&p));
        }

        #[test]
        fn the_tree_finds_what_trying_every_triangle_finds(
            positions in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 3..30),
            indices in prop::collection::vec(prop::array::uniform3(0_u32..1000), 1..60),
            query in prop::array::uniform3(-3.0..3.0_f64),
        ) {
            let n = positions.len() as u32;
            let faces = indices.iter().map(|face| face.map(|v| v % n)).collect();
            let mesh = Mesh { positions: positions.into_iter().map(Point3::from).collect(), faces };
            let p = Point3::from(query);
            let Some(surface) = Surface::new(&mesh) else { return Ok(()) };
            let all = surface.triangles.iter().map(|t| t.distance_squared(p).sqrt());
            let least = all.fold(f64::INFINITY, f64::min);
            prop_assert!((surface.nearest(&p).distance - least).abs() <= 1e-12);
        }

        /// Against barycentric samples of the triangle, slivers included.
        #[test]
        fn no_point_of_a_triangle_is_nearer_than_the_nearest(
            corners in prop::array::uniform3(prop::array::uniform3(-1.0..1.0_f64)),
            thin in 0.0..1.0_f64,
            query in prop::array::uniform3(-2.0..2.0_f64),
        ) {
            let [a, b, c] = corners.map(Point3::from);
            let triangle = Triangle { corners: [a, b, a + (b - a) * 0.4 + (c - a) * thin.powi(12)], face: 0, node: 0 };
            let p = Point3::from(query);
            let found = triangle.distance_squared(p).sqrt();
            let [a, b, c] = triangle.corners;
            let steps = 40;
            let mut least = f64::INFINITY;
            for i in 0..=steps {
                for j in 0..=steps - i {
                    let (u, v) = (f64::from(i) / f64::from(steps), f64::from(j) / f64::from(steps));
                    least = least.min((a + (b - a) * u + (c - a) * v - p).norm());
                }
            }
            let spacing = (b - a).norm().max((c - a).norm()) / f64::from(steps);
            prop_assert!(found <= least + 1e-9 && found >= least - spacing, "{} {}", found, least);
        }
    }
}
