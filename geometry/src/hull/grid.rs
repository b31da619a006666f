//! The lattice on which rays run.

use capture::Aabb;
use nalgebra::{Point3, Vector3};

/// Nodes at whole numbers of grid units; the box from `low` to `high` is all that can be inside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    pub(super) origin: Point3<f64>,
    /// World units per cell.
    pub(super) cell: f64,
    /// Nodes along x, y, z.
    pub(super) nodes: [usize; 3],
    pub(super) low: [f64; 3],
    pub(super) high: [f64; 3],
}

/// Cells between the first node and the box: nodes on the rim are outside, so the surface closes, and
/// the walls of the box fall between nodes.
const PADDING: f64 = 1.5;

impl Grid {
    pub(super) fn new(aabb: &Aabb, cell: f64) -> Self {
        let origin = aabb.min - Vector3::repeat(PADDING * cell);
        let high = [0, 1, 2].map(|a| PADDING + (aabb.max[a] - aabb.min[a]) / cell);
        Self { origin, cell, nodes: high.map(|h| h.ceil() as usize + 2), low: [PADDING; 3], high }
    }

    #[expect(clippy::wrong_self_convention, reason = "maps a point from the world, makes no Grid")]
    pub(super) fn from_world(&self, point: &Point3<f64>) -> [f64; 3] {
        let p = (point - self.origin) / self.cell;
        [p.x, p.y, p.z]
    }

    pub(super) fn to_world(self, p: [f64; 3]) -> Point3<f64> {
        self.origin + Vector3::from(p) * self.cell
    }

    /// Whether lattice coordinate `i` lies in the box along `axis`.
    pub(super) fn spans(&self, axis: usize, i: usize) -> bool {
        self.low[axis] <= i as f64 && (i as f64) < self.high[axis]
    }
}
