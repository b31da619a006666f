//! What graphics hardware needs to know of coats that were laid over a mesh.

use super::Coats;
use capture::btf::Encoding;
use geometry::TexturedMesh;
use nalgebra::Vector3;
use texture::btf::{Frame, Tables};

/// A coat.
#[derive(Clone, Debug)]
pub(crate) struct CoatNumbers<'a> {
    pub(crate) frame: &'a Frame,
    /// What its sampler computes with; none where that cannot be told.
    pub(crate) tables: Option<Tables>,
    pub(crate) encoding: Encoding,
    pub(crate) exposure: f32,
    pub(crate) includes_cosine: bool,
    /// z of the lowest light and view measured.
    pub(crate) lowest: [f64; 2],
}

/// A face that carries a coat.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FaceNumbers {
    /// Which coat.
    pub(crate) coat: usize,
    /// Texels of the tile per texel of the mesh's atlas.
    pub(crate) scale: f64,
    pub(crate) is_mirrored: bool,
    /// Normals and tangents at the corners.
    pub(crate) frames: [[Vector3<f64>; 3]; 2],
}

impl Coats<'_> {
    pub(crate) fn mesh(&self) -> &TexturedMesh {
        self.mesh
    }

    /// All coats, in the order in which they were laid.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = CoatNumbers<'_>> {
        self.coats.iter().map(|prepared| CoatNumbers {
            frame: prepared.coat.sampler.frame(),
            tables: prepared.coat.sampler.tables(),
            encoding: prepared.coat.encoding,
            exposure: prepared.coat.exposure,
            includes_cosine: prepared.coat.includes_cosine,
            lowest: [prepared.lowest_light, prepared.lowest_view],
        })
    }

    /// `None` of a face without a coat.
    pub(crate) fn face_numbers(&self, face: usize) -> Option<FaceNumbers> {
        let laid = self.faces.get(face).copied().flatten()?;
        let frames = self.frames.corners(self.mesh.mesh.faces.get(face)?);
        Some(FaceNumbers { coat: laid.coat, scale: laid.scale, is_mirrored: laid.is_mirrored, frames })
    }
}
