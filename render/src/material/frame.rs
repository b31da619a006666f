//! Tangent frames: x along growing u, z the normal, y = z × x, so that every frame is right-handed.
//!
//! The tangent of a face is `∂P/∂u = (e₁ Δv₂ − e₂ Δv₁) / (Δu₁ Δv₂ − Δu₂ Δv₁)` with its edges e and what they
//! cover in the atlas; a vertex has the mean of its faces', weighted by their area. Vertices part where charts do, so a
//! seam leaves tangents alone, while normals are those of the welded surface. Both are interpolated over a face and
//! made orthonormal there (Gram and Schmidt), the normal first.

use geometry::TexturedMesh;
use geometry::atlas::welded_vertex_normals;
use nalgebra::Vector3;

/// An orthonormal, right-handed frame of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TangentFrame {
    /// x: along growing u.
    pub tangent: Vector3<f64>,
    /// y: z × x.
    pub bitangent: Vector3<f64>,
    /// z: out of the surface.
    pub normal: Vector3<f64>,
}

/// What frames are interpolated from: one of each per vertex, zero where there is none.
#[derive(Clone, Debug)]
pub(super) struct Frames {
    normals: Vec<Vector3<f64>>,
    tangents: Vec<Vector3<f64>>,
}

impl TangentFrame {
    /// The frame about a normal whose x is nearest to `tangent`; any, where the two are parallel or the tangent is zero.
    /// `None` without a normal.
    pub fn new(normal: &Vector3<f64>, tangent: &Vector3<f64>) -> Option<Self> {
        let normal = normal.try_normalize(1e-12).filter(|n| n.iter().all(|c| c.is_finite()))?;
        let across = |v: &Vector3<f64>| (v - normal * normal.dot(v)).try_normalize(1e-9 * v.norm());
        let least = Vector3::ith(normal.iamin(), 1.0);
        let tangent = across(tangent).filter(|t| t.iter().all(|c| c.is_finite())).or_else(|| across(&least))?;
        Some(Self { tangent, bitangent: normal.cross(&tangent), normal })
    }

    /// The other side's frame: the same tangent.
    pub(super) fn turned_over(&self) -> Self {
        Self { tangent: self.tangent, bitangent: -self.bitangent, normal: -self.normal }
    }

    /// A direction in this frame, at unit length; zero of none.
    pub(super) fn local(&self, v: &Vector3<f64>) -> Vector3<f64> {
        let v = Vector3::new(self.tangent.dot(v), self.bitangent.dot(v), self.normal.dot(v));
        v.try_normalize(0.0).unwrap_or_default()
    }

    /// As [`TangentFrame::local`], carried up to the horizon from below; the normal where that leaves nothing.
    pub(super) fn above(&self, v: &Vector3<f64>) -> Vector3<f64> {
        let v = self.local(v);
        Vector3::new(v.x, v.y, v.z.max(0.0)).try_normalize(1e-9).unwrap_or_else(Vector3::z)
    }
}

impl Frames {
    pub(super) fn new(mesh: &TexturedMesh) -> Self {
        let is_sound = |face: &[u32; 3]| face.iter().all(|&v| (v as usize) < mesh.mesh.positions.len());
        if !mesh.mesh.faces.iter().all(is_sound) {
            return Self { normals: Vec::new(), tangents: Vec::new() };
        }
        let mut tangents = vec![Vector3::zeros(); mesh.mesh.positions.len()];
        for (face, corners) in mesh.mesh.faces.iter().enumerate() {
            let tangent = face_tangent(mesh, face).unwrap_or_default();
            corners.iter().for_each(|&v| tangents[v as usize] += tangent);
        }
        Self { normals: welded_vertex_normals(&mesh.mesh), tangents }
    }

    /// Normals and tangents at the corners of a face; zero where the mesh is broken.
    #[cfg(feature = "gpu")]
    pub(super) fn corners(&self, face: &[u32; 3]) -> [[Vector3<f64>; 3]; 2] {
        [&self.normals, &self.tangents].map(|of| face.map(|v| of.get(v as usize).copied().unwrap_or_default()))
    }

    /// The frame at a point of a face; `None` where the mesh is broken or flat.
    pub(super) fn at(&self, mesh: &TexturedMesh, face: usize, weights: &[f64; 3]) -> Option<TangentFrame> {
        let corners = mesh.mesh.faces.get(face)?.map(|v| v as usize);
        let interpolated = |of: &[Vector3<f64>]| -> Option<Vector3<f64>> {
            Some(of.get(corners[0])? * weights[0] + of.get(corners[1])? * weights[1] + of.get(corners[2])? * weights[2])
        };
        TangentFrame::new(&interpolated(&self.normals)?, &interpolated(&self.tangents)?)
    }
}

/// The tangent of a face, as long as twice its area; `None` where it has no area in the atlas.
fn face_tangent(mesh: &TexturedMesh, face: usize) -> Option<Vector3<f64>> {
    let [a, b, c] = mesh.mesh.corners(face);
    let [Some(ta), Some(tb), Some(tc)] = mesh.mesh.faces[face].map(|v| mesh.uvs.get(v as usize)) else { return None };
    let (first, second) = (tb - ta, tc - ta);
    let covered = first.perp(&second);
    let along = ((b - a) * second.y - (c - a) * first.y) * covered.signum();
    let weight = mesh.mesh.face_area_vector(face).norm();
    (covered != 0.0 && weight.is_finite()).then(|| along.try_normalize(0.0))?.map(|t| t * weight)
}
