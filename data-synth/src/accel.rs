//! Ray queries against a triangle mesh.
//!
//! The `bvh` crate builds the tree (surface-area heuristic); we walk it ourselves, because its own
//! iterators visit every leaf a ray might meet, while a camera ray wants the nearest hit and a shadow
//! ray any. Pairs of levels are merged into nodes of four boxes that are tested side by side (Dammertz,
//! Hanika, Keller, "Shallow Bounding Volume Hierarchies", EGSR 2008); leaves hold up to four triangles
//! in tree order.

use crate::material::Vec3;
use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::{Bvh, BvhNode};
use geometry::Mesh;
use nalgebra::Point3;

/// Triangles a leaf holds at most, unless the tree grows too deep.
const LEAF: u32 = 4;
/// Deepest node kept as a node: what lies below becomes one leaf.
const MAX_DEPTH: usize = 40;
/// Boxes per node.
const WIDTH: usize = 4;
/// Places on the walk's stack: a node leaves at most three boxes waiting on each level.
const STACK: usize = MAX_DEPTH * (WIDTH - 1) + WIDTH;
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

/// Four boxes with what they hold, laid out so that one instruction tests all four.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// Lower, then upper bounds: by axis, by child.
    bounds: [[[f32; WIDTH]; 3]; 2],
    /// First triangle of a leaf, otherwise the node.
    child: [u32; WIDTH],
    /// Triangles of a leaf, otherwise zero.
    count: [u32; WIDTH],
}

/// A box still to be visited.
#[derive(Clone, Copy, Default)]
struct Pending {
    entry: f32,
    child: u32,
    count: u32,
}

/// A ray with what the box test needs of it.
struct Probe {
    origin: Vec3,
    inverse: Vec3,
    /// Per axis, whether the ray runs down it and meets the upper bound first.
    down: [usize; 3],
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

    /// Visits triangles near box first until `visit` returns true.
    #[inline]
    fn walk(&self, origin: Vec3, direction: Vec3, limit: f32, mut visit: impl FnMut(&Triangle, &mut f32) -> bool) {
        let probe = Probe::new(origin, direction);
        let mut reach = limit;
        let mut stack = [Pending::default(); STACK];
        let mut top = usize::from(!self.nodes.is_empty());
        while top > 0 {
            top -= 1;
            let at = stack[top];
            if at.entry >= reach {
                continue;
            }
            if at.count == 0 {
                self.nodes[at.child as usize].push_met(&probe, reach, &mut stack, &mut top);
                continue;
            }
            let start = at.child as usize;
            for triangle in &self.triangles[start..start + at.count as usize] {
                if visit(triangle, &mut reach) {
                    return;
                }
            }
        }
    }
}

impl Probe {
    fn new(origin: Vec3, direction: Vec3) -> Self {
        // A zero component gives ±∞. Where that makes NaN (a ray in the plane of a box's face), the
        // comparisons below are false and the axis does not count: the box is visited.
        let inverse = direction.map(|d| 1.0 / d);
        let down = [0, 1, 2].map(|axis| usize::from(inverse[axis] < 0.0));
        Self { origin, inverse, down }
    }
}

impl Node {
    /// Boxes no ray meets.
    const EMPTY: Self = Self {
        bounds: [[[f32::INFINITY; WIDTH]; 3], [[f32::NEG_INFINITY; WIDTH]; 3]],
        child: [0; WIDTH],
        count: [0; WIDTH],
    };

    /// Puts the boxes the ray meets within `reach` on the stack, the nearest on top.
    #[inline]
    fn push_met(&self, probe: &Probe, reach: f32, stack: &mut [Pending; STACK], top: &mut usize) {
        let (near, far) = self.slabs(probe, reach);
        let first = *top;
        for k in 0..WIDTH {
            if near[k] > far[k] {
                continue;
            }
            let new = Pending { entry: near[k], child: self.child[k], count: self.count[k] };
            let mut place = *top;
            while place > first && stack[place - 1].entry < new.entry {
                stack[place] = stack[place - 1];
                place -= 1;
            }
            stack[place] = new;
            *top += 1;
        }
    }

    /// Where the ray enters and leaves each box; it misses where it enters after leaving.
    #[inline]
    fn slabs(&self, probe: &Probe, reach: f32) -> ([f32; WIDTH], [f32; WIDTH]) {
        let (mut near, mut far) = ([0.0_f32; WIDTH], [reach; WIDTH]);
        for axis in 0..3 {
            let (o, inverse, down) = (probe.origin[axis], probe.inverse[axis], probe.down[axis]);
            let (first, last) = (&self.bounds[down][axis], &self.bounds[1 - down][axis]);
            for k in 0..WIDTH {
                let (a, b) = ((first[k] - o) * inverse, (last[k] - o) * inverse);
                near[k] = if a > near[k] { a } else { near[k] };
                far[k] = if b < far[k] { b } else { far[k] };
            }
        }
        (near, far)
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
        let whole = self.leaves.iter().fold(Aabb::empty(), |b, l| b.join(&l.bounds));
        self.node(&[(0, whole)], 0);
    }

    /// Appends a node over the given subtrees, opened until there are four, and all below it.
    fn node(&mut self, subtrees: &[(usize, Aabb<f32, 3>)], depth: usize) -> u32 {
        let children = self.opened(subtrees.to_vec());
        let at = self.out.nodes.len();
        self.out.nodes.push(Node::EMPTY);
        for (k, (child, bounds)) in children.into_iter().enumerate() {
            let is_leaf = depth + 1 >= MAX_DEPTH || self.faces_below(child) <= LEAF;
            let (to, count) = if is_leaf { self.leaf(child) } else { (self.node(&[(child, bounds)], depth + 1), 0) };
            let node = &mut self.out.nodes[at];
            node.child[k] = to;
            node.count[k] = count;
            for axis in 0..3 {
                node.bounds[0][axis][k] = bounds.min[axis];
                node.bounds[1][axis][k] = bounds.max[axis];
            }
        }
        at as u32
    }

    /// Replaces the subtree of the largest surface by its two children while there is room.
    fn opened(&self, mut subtrees: Vec<(usize, Aabb<f32, 3>)>) -> Vec<(usize, Aabb<f32, 3>)> {
        while subtrees.len() < WIDTH {
            let open = |s: &(usize, Aabb<f32, 3>)| self.faces_below(s.0) > LEAF;
            let candidates = subtrees.iter().enumerate().filter(|(_, s)| open(s));
            let largest = candidates.max_by(|a, b| a.1.1.surface_area().total_cmp(&b.1.1.surface_area()));
            let Some((k, &(index, _))) = largest else { break };
            let BvhNode::Node { child_l_index, child_l_aabb, child_r_index, child_r_aabb, .. } = self.tree[index]
            else {
                break;
            };
            subtrees[k] = (child_l_index, child_l_aabb);
            subtrees.push((child_r_index, child_r_aabb));
        }
        subtrees
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
