//! Ray queries against a triangle mesh.
//!
//! The `bvh` crate builds the tree (surface-area heuristic); we walk it ourselves, because its own
//! iterators visit every leaf a ray might meet, while a camera ray wants the nearest hit and a shadow
//! ray any. Nodes hold the boxes of both children in one cache line, leaves up to four triangles in
//! tree order.

use crate::material::Vec3;
use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::{Bvh, BvhNode};
use geometry::Mesh;
use nalgebra::Point3;

/// Triangles a leaf holds at most, unless the tree grows too deep.
const LEAF: u32 = 4;
/// Deepest node kept as a node: the walk's stack has this many places.
const MAX_DEPTH: usize = 64;
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
    nodes: Vec<Node>,
    triangles: Vec<Triangle>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    low: [Vec3; 2],
    high: [Vec3; 2],
    /// First triangle of a leaf, otherwise the node.
    child: [u32; 2],
    /// Triangles of a leaf, otherwise zero.
    count: [u32; 2],
}

#[derive(Clone, Copy, Debug)]
struct Triangle {
    corner: Vec3,
    edges: [Vec3; 2],
    face: u32,
}

struct Leaf {
    bounds: Aabb<f32, 3>,
    node: usize,
}

impl Bounded<f32, 3> for Leaf {
    fn aabb(&self) -> Aabb<f32, 3> {
        self.bounds
    }
}

impl BHShape<f32, 3> for Leaf {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

impl Accel {
    /// Builds the tree of all faces.
    pub(crate) fn new(mesh: &Mesh) -> Self {
        let corners: Vec<[Vec3; 3]> =
            (0..mesh.faces.len()).map(|f| mesh.corners(f).map(|p| p.coords.cast::<f32>())).collect();
        let mut leaves: Vec<Leaf> = corners.iter().map(|c| Leaf { bounds: bounds_of(c), node: 0 }).collect();
        let tree = Bvh::build(&mut leaves);
        let mut flat = Flatten { tree: &tree.nodes, corners: &corners, leaves: &leaves, out: Self::default() };
        if !tree.nodes.is_empty() {
            flat.root();
        }
        flat.out
    }

    /// The nearest hit closer than `limit`.
    pub(crate) fn nearest(&self, origin: Vec3, direction: Vec3, limit: f32) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        self.walk(origin, direction, limit, |triangle, reach| {
            if let Some(hit) = triangle.hit(origin, direction, *reach) {
                *reach = hit.distance;
                best = Some(hit);
            }
            false
        });
        best
    }

    /// Whether anything lies closer than `limit`.
    pub(crate) fn is_blocked(&self, origin: Vec3, direction: Vec3, limit: f32) -> bool {
        let mut blocked = false;
        self.walk(origin, direction, limit, |triangle, reach| {
            blocked |= triangle.hit(origin, direction, *reach).is_some();
            blocked
        });
        blocked
    }

    /// Visits triangles near first until `visit` returns true.
    #[inline]
    fn walk(&self, origin: Vec3, direction: Vec3, limit: f32, mut visit: impl FnMut(&Triangle, &mut f32) -> bool) {
        if self.nodes.is_empty() {
            return;
        }
        // A zero component gives ±∞, which the slab test handles; NaN comparisons count as a miss.
        let inverse = direction.map(|d| 1.0 / d);
        let mut reach = limit;
        let mut stack = [(0_u32, 0.0_f32); MAX_DEPTH + 2];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let (index, entry) = stack[top];
            if entry >= reach {
                continue;
            }
            let node = &self.nodes[index as usize];
            let entries = [0, 1].map(|side| node.entry(side, origin, inverse, reach));
            let first = usize::from(entries[1] < entries[0]);
            // Leaves are tested at once, near side first; nodes are pushed far side first.
            for side in [first, 1 - first] {
                if node.count[side] > 0 && entries[side] < reach {
                    let start = node.child[side] as usize;
                    for triangle in &self.triangles[start..start + node.count[side] as usize] {
                        if visit(triangle, &mut reach) {
                            return;
                        }
                    }
                }
            }
            for side in [1 - first, first] {
                if node.count[side] == 0 && entries[side] < reach {
                    stack[top] = (node.child[side], entries[side]);
                    top += 1;
                }
            }
        }
    }
}

impl Node {
    /// Where the ray enters the child's box, or infinity.
    #[inline]
    fn entry(&self, side: usize, origin: Vec3, inverse: Vec3, reach: f32) -> f32 {
        let (low, high) = (&self.low[side], &self.high[side]);
        let (mut near, mut far) = (0.0_f32, reach);
        for axis in 0..3 {
            let a = (low[axis] - origin[axis]) * inverse[axis];
            let b = (high[axis] - origin[axis]) * inverse[axis];
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        if near <= far { near } else { f32::INFINITY }
    }
}

impl Triangle {
    /// Möller and Trumbore 1997.
    #[inline]
    fn hit(&self, origin: Vec3, direction: Vec3, reach: f32) -> Option<Hit> {
        let [e1, e2] = self.edges;
        let p = direction.cross(&e2);
        let det = e1.dot(&p);
        if det == 0.0 {
            return None;
        }
        let inverse = 1.0 / det;
        let s = origin - self.corner;
        let u = s.dot(&p) * inverse;
        if !(-EDGE_SLACK..=1.0 + EDGE_SLACK).contains(&u) {
            return None;
        }
        let q = s.cross(&e1);
        let v = direction.dot(&q) * inverse;
        if v < -EDGE_SLACK || u + v > 1.0 + EDGE_SLACK {
            return None;
        }
        let distance = e2.dot(&q) * inverse;
        (distance > 0.0 && distance < reach).then_some(Hit { distance, face: self.face, barycentric: [u, v] })
    }
}

/// Turns the crate's tree into ours.
struct Flatten<'a> {
    tree: &'a [BvhNode<f32, 3>],
    corners: &'a [[Vec3; 3]],
    leaves: &'a [Leaf],
    out: Accel,
}

impl Flatten<'_> {
    fn root(&mut self) {
        if self.faces_below(0) <= LEAF {
            // A tree of one leaf has no node: give it one with an empty second child.
            let bounds = self.leaves.iter().fold(Aabb::empty(), |b, l| b.join(&l.bounds));
            let (child, count) = self.leaf(0);
            let (low, high) = (bounds.min.coords, bounds.max.coords);
            let nothing = Vec3::repeat(f32::INFINITY);
            self.out.nodes.push(Node {
                low: [low, nothing],
                high: [high, nothing],
                child: [child, 0],
                count: [count, 0],
            });
            return;
        }
        self.node(0, 0);
    }

    /// Appends an inner node and all below it; returns its index.
    fn node(&mut self, index: usize, depth: usize) -> u32 {
        let BvhNode::Node { child_l_index, child_l_aabb, child_r_index, child_r_aabb, .. } = self.tree[index] else {
            return 0;
        };
        let at = self.out.nodes.len();
        let boxes = [child_l_aabb, child_r_aabb];
        let low = boxes.map(|b| b.min.coords);
        let high = boxes.map(|b| b.max.coords);
        self.out.nodes.push(Node { low, high, child: [0; 2], count: [0; 2] });
        for (side, child) in [child_l_index, child_r_index].into_iter().enumerate() {
            let is_leaf = depth + 1 >= MAX_DEPTH || self.faces_below(child) <= LEAF;
            let (to, count) = if is_leaf { self.leaf(child) } else { (self.node(child, depth + 1), 0) };
            self.out.nodes[at].child[side] = to;
            self.out.nodes[at].count[side] = count;
        }
        at as u32
    }

    /// Counts faces, giving up beyond [`LEAF`].
    fn faces_below(&self, index: usize) -> u32 {
        let (mut pending, mut count) = (vec![index], 0);
        while let Some(i) = pending.pop() {
            match self.tree[i] {
                BvhNode::Leaf { .. } => count += 1,
                BvhNode::Node { child_l_index, child_r_index, .. } => pending.extend([child_l_index, child_r_index]),
            }
            if count + pending.len() as u32 > LEAF {
                return LEAF + 1;
            }
        }
        count
    }

    /// Appends all triangles of a subtree; returns first and number.
    fn leaf(&mut self, index: usize) -> (u32, u32) {
        let first = self.out.triangles.len() as u32;
        let mut pending = vec![index];
        while let Some(i) = pending.pop() {
            match self.tree[i] {
                BvhNode::Leaf { shape_index, .. } => {
                    let [a, b, c] = self.corners[shape_index];
                    let face = shape_index as u32;
                    self.out.triangles.push(Triangle { corner: a, edges: [b - a, c - a], face });
                }
                BvhNode::Node { child_l_index, child_r_index, .. } => pending.extend([child_l_index, child_r_index]),
            }
        }
        (first, self.out.triangles.len() as u32 - first)
    }
}

fn bounds_of(corners: &[Vec3; 3]) -> Aabb<f32, 3> {
    let low = corners[0].inf(&corners[1]).inf(&corners[2]);
    let high = corners[0].sup(&corners[1]).sup(&corners[2]);
    Aabb::with_bounds(Point3::from(low), Point3::from(high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::sphere;

    #[test]
    fn rays_find_what_a_linear_search_finds() {
        let mesh = sphere(1.0, 24);
        let accel = Accel::new(&mesh);
        let all: Vec<Triangle> = accel.triangles.clone();
        assert_eq!(all.len(), mesh.faces.len());
        for i in 0..500_u32 {
            let r = |k: u32| crate::sampler::unit(crate::sampler::mix(i * 7 + k)) * 2.0 - 1.0;
            let (o, d) = (Vec3::new(r(0), r(1), r(2)) * 2.0, Vec3::new(r(3), r(4), r(5)).normalize());
            let slow = all.iter().filter_map(|t| t.hit(o, d, f32::INFINITY)).map(|h| h.distance).fold(9e9, f32::min);
            let fast = accel.nearest(o, d, f32::INFINITY).map_or(9e9, |h| h.distance);
            assert_eq!(slow, fast);
            assert_eq!(accel.is_blocked(o, d, f32::INFINITY), slow < 9e9);
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
