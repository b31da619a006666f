//! Indexed triangle meshes. Triangles are counter-clockwise seen from outside.

mod check;
pub mod half_edge;
pub mod io;
mod separate;
mod smooth;

pub use check::MeshCheck;
pub use separate::separate_sheets;
pub use smooth::{TaubinOptions, taubin_smooth};

use capture::Aabb;
use nalgebra::{Point2, Point3, Vector3};

/// Triangles over shared vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions in world units.
    pub positions: Vec<Point3<f64>>,
    /// Three vertex indices per triangle, counter-clockwise from outside.
    pub faces: Vec<[u32; 3]>,
}

/// A mesh unfolded into an atlas. Vertices are split where charts part, so that positions and UVs
/// share one index.
#[derive(Clone, Debug, PartialEq)]
pub struct TexturedMesh {
    /// Triangles; a vertex belongs to one chart only.
    pub mesh: Mesh,
    /// One per vertex, in [0, 1]², (0, 0) the top-left corner of the atlas, v down.
    pub uvs: Vec<Point2<f64>>,
    /// The chart of each face.
    pub face_charts: Vec<u32>,
    /// Width and height of the atlas in texels.
    pub atlas_size: [usize; 2],
}

impl Mesh {
    /// Corner positions of a face.
    pub fn corners(&self, face: usize) -> [Point3<f64>; 3] {
        self.faces[face].map(|v| self.positions[v as usize])
    }

    /// Twice the area of a face times its outward unit normal.
    pub fn face_area_vector(&self, face: usize) -> Vector3<f64> {
        let [a, b, c] = self.corners(face);
        (b - a).cross(&(c - a))
    }

    /// Area-weighted unit normals, one per vertex; zero where a vertex has no face with an area.
    pub fn vertex_normals(&self) -> Vec<Vector3<f64>> {
        let mut normals = vec![Vector3::zeros(); self.positions.len()];
        for (face, corners) in self.faces.iter().enumerate() {
            let n = self.face_area_vector(face);
            corners.iter().for_each(|&v| normals[v as usize] += n);
        }
        normals.into_iter().map(|n| n.try_normalize(0.0).unwrap_or_default()).collect()
    }

    /// Volume enclosed by a closed mesh, positive when faces point outward.
    pub fn signed_volume(&self) -> f64 {
        (0..self.faces.len())
            .map(|f| self.corners(f))
            .map(|[a, b, c]| a.coords.dot(&b.coords.cross(&c.coords)) / 6.0)
            .sum()
    }

    /// The box around all vertices; `None` of an empty mesh.
    pub fn aabb(&self) -> Option<Aabb> {
        Aabb::around(self.positions.iter().copied())
    }
}
