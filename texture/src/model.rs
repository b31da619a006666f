//! A mesh and one appearance.

use crate::TextureError;
use capture::{Image, View};
use geometry::TexturedMesh;
use nalgebra::Point3;
use std::path::Path;

/// The four appearances that DynTex is compared with, itself included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// One texture for all views.
    Static,
    /// View-dependent texture mapping from a few source views.
    Vdtm,
    /// Unstructured lumigraph with a few rays per texel.
    Lumigraph,
    /// A linear basis per facet.
    DynTex,
}

/// How an appearance is fitted.
#[derive(Clone, Copy, Debug)]
pub struct FitOptions {
    /// Texture layers a texel may hold, the mean included; source views of VDTM, rays of the lumigraph.
    pub layers: usize,
    /// Pixels taken off every silhouette before its colours are used.
    pub mask_erode_px: f64,
}

/// What a fit cost and could not do.
#[derive(Clone, Debug, Default)]
pub struct FitReport {
    /// Texels that no view saw; filled from their surroundings.
    pub unseen_texels: usize,
    /// Texels of the atlas that carry surface.
    pub texels: usize,
}

/// A mesh and one appearance: what a `.glb` of ours holds.
#[derive(Clone, Debug)]
pub struct Model {
    /// The proxy and its atlas.
    pub mesh: TexturedMesh,
    /// Which appearance it carries.
    pub method: Method,
}

/// Fits `method` to `views` on `mesh`.
///
/// # Errors
/// Where no view sees the mesh.
pub fn fit(
    _views: &[View],
    _mesh: &TexturedMesh,
    _method: Method,
    _options: &FitOptions,
) -> Result<(Model, FitReport), TextureError> {
    unreachable!("written by the texture stage")
}

impl Model {
    /// The texture of the object as seen from `eye`, encoded intensities 0..=255, mean of the
    /// unseen included. Row 0 is v = 0.
    pub fn atlas(&self, _eye: &Point3<f64>) -> Image<[f32; 3]> {
        unreachable!("written by the texture stage")
    }

    /// The model as one binary glTF.
    pub fn to_glb(&self) -> Result<Vec<u8>, TextureError> {
        unreachable!("written by the texture stage")
    }

    /// Reads back what [`Model::to_glb`] wrote; `path` names the file in errors.
    pub fn from_glb(_bytes: &[u8], _path: &Path) -> Result<Self, TextureError> {
        unreachable!("written by the texture stage")
    }
}
