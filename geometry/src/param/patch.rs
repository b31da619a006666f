//! A chart with its own vertices.

use crate::mesh::Mesh;
use crate::mesh::half_edge::{HalfEdges, NO_TWIN, Sets, next};
use nalgebra::{Point2, Point3};

/// A triangle laid into the plane: corners (0, 0), (x1, 0), (x2, y2), `x1 > 0`, `y2 >= 0`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FlatTriangle {
    pub(crate) x1: f64,
    pub(crate) x2: f64,
    pub(crate) y2: f64,
}

impl FlatTriangle {
    fn new([a, b, c]: [Point3<f64>; 3]) -> Self {
        let (ab, ac) = (b - a, c - a);
        let x1 = ab.norm();
        let x = if x1 > 0.0 { ab / x1 } else { ab };
        let x2 = ac.dot(&x);
        Self { x1, x2, y2: (ac - x * x2).norm() }
    }

    pub(crate) fn area(&self) -> f64 {
        self.x1 * self.y2 / 2.0
    }

    pub(crate) fn corners(&self) -> [Point2<f64>; 3] {
        [Point2::origin(), Point2::new(self.x1, 0.0), Point2::new(self.x2, self.y2)]
    }
}

/// Faces of a chart over vertices of their own. A vertex of the mesh at which two fans of the chart
/// meet becomes two, so that the patch is always manifold.
pub(crate) struct Patch {
    /// Faces of the mesh, ascending.
    pub(crate) faces: Vec<u32>,
    /// Per face its vertices in the patch.
    pub(crate) corners: Vec<[u32; 3]>,
    /// Per vertex of the patch the vertex of the mesh.
    pub(crate) sources: Vec<u32>,
    pub(crate) positions: Vec<Point3<f64>>,
    /// Border edges (from, to), in order of their half-edges.
    pub(crate) border: Vec<[u32; 2]>,
    pub(crate) shapes: Vec<FlatTriangle>,
}

impl Patch {
    pub(crate) fn new(mesh: &Mesh, half_edges: &HalfEdges, faces: &[u32]) -> Self {
        let twins = local_twins(half_edges, faces);
        let mut fans = Sets::new(twins.len());
        for (h, &twin) in twins.iter().enumerate().filter(|&(_, &twin)| twin != NO_TWIN) {
            fans.join(h as u32, next(twin));
            fans.join(next(h as u32), twin);
        }
        let (mut number, mut sources) = (vec![0; twins.len()], Vec::new());
        for corner in 0..twins.len() as u32 {
            let first = fans.find(corner);
            if first == corner {
                number[corner as usize] = sources.len() as u32;
                sources.push(mesh.faces[faces[corner as usize / 3] as usize][corner as usize % 3]);
            }
            number[corner as usize] = number[first as usize];
        }
        let borders = (0..twins.len()).filter(|&h| twins[h] == NO_TWIN);
        Self {
            corners: number.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
            border: borders.map(|h| [number[h], number[next(h as u32) as usize]]).collect(),
            positions: sources.iter().map(|&v| mesh.positions[v as usize]).collect(),
            shapes: faces.iter().map(|&f| FlatTriangle::new(mesh.corners(f as usize))).collect(),
            faces: faces.to_vec(),
            sources,
        }
    }

    /// χ = V − E + F = 1; the patch being connected and orientable, that is a disc.
    pub(crate) fn is_disc(&self) -> bool {
        let edges = (3 * self.corners.len() + self.border.len()) / 2;
        self.sources.len() + self.corners.len() == edges + 1
    }

    pub(crate) fn border_length(&self) -> f64 {
        self.border.iter().map(|e| e.map(|v| self.positions[v as usize])).map(|[a, b]| (b - a).norm()).sum()
    }

    pub(crate) fn area(&self) -> f64 {
        self.shapes.iter().map(FlatTriangle::area).sum()
    }
}

/// Twins within the patch, by local half-edge.
fn local_twins(half_edges: &HalfEdges, faces: &[u32]) -> Vec<u32> {
    let all = faces.iter().flat_map(|&f| (0..3).map(move |k| half_edges.twins[3 * f as usize + k]));
    all.map(|twin| match faces.binary_search(&(twin / 3)) {
        Ok(local) if twin != NO_TWIN => 3 * local as u32 + twin % 3,
        _ => NO_TWIN,
    })
    .collect()
}
