//! A mesh and one appearance: what a `.glb` of ours holds.

use crate::TextureError;
use crate::appearance::{Lumigraph, dyntex, lumigraph, static_texture, vdtm};
use crate::bake::Bake;
use crate::glb;
use crate::layers::Layers;
use crate::material_layer::{self, MaterialLayer, charts_of_file};
use crate::surface::SurfaceTexels;
use capture::Image;
use geometry::TexturedMesh;
use nalgebra::Point3;
use std::path::Path;
use std::str::FromStr;

/// The four appearances that are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitOptions {
    /// Texture layers a texel may hold, the mean included; source views of VDTM, rays of the lumigraph.
    pub layers: usize,
    /// Pixels taken off every silhouette before its colours are used.
    pub mask_erode_px: f64,
    /// Basis layers that move a facet's texels by less than this are left out; levels of 0..=255, RMS.
    pub tolerance: f64,
    /// Coarseness of layer coding in units of the JPEG annex K table: 1 is quality 50, 0.2 quality 90.
    pub quantiser: f64,
    /// Texels a facet should have.
    pub facet_texels: usize,
}

/// What a fit found and could not do.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct FitReport {
    /// Texels of the atlas that carry surface.
    pub texels: usize,
    /// Those that no view saw; filled from their surroundings.
    pub unseen_texels: usize,
    /// Layers each facet uses, the first included; empty for a lumigraph.
    pub ranks: Vec<usize>,
}

/// How the surface looks from a given eye.
#[derive(Clone, Debug)]
pub enum Appearance {
    /// Static texture, VDTM, DynTex: layers and weights per facet.
    Layers(Layers),
    /// Rays per texel, and the surface they start from.
    Lumigraph(Lumigraph, SurfaceTexels),
}

/// A mesh and one appearance.
#[derive(Clone, Debug)]
pub struct Model {
    /// The proxy and its atlas.
    pub mesh: TexturedMesh,
    /// Which method made the appearance.
    pub method: Method,
    /// The appearance.
    pub appearance: Appearance,
    /// What lies on charts in its place; no chart has two ([`Model::lay`]).
    pub materials: Vec<MaterialLayer>,
}

/// Bytes of a model, as stored in its file and raw.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct ModelBytes {
    /// The whole file.
    pub file: u64,
    /// Layers, weights, directions and facet map as stored; without mesh and preview.
    pub appearance: u64,
    /// Layers as 8-bit raw texels, without weights.
    pub appearance_raw: u64,
    /// Materials as stored.
    pub materials: u64,
}

impl Method {
    /// All four, in the order in which they are reported.
    pub const ALL: [Self; 4] = [Self::Static, Self::Vdtm, Self::Lumigraph, Self::DynTex];

    /// The name used in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Static => "static",
            Self::Vdtm => "vdtm",
            Self::Lumigraph => "lumigraph",
            Self::DynTex => "dyntex",
        }
    }
}

impl FromStr for Method {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|m| m.name() == name)
            .ok_or_else(|| format!("no method '{name}'; there are static, vdtm, lumigraph, dyntex"))
    }
}

impl Default for FitOptions {
    fn default() -> Self {
        Self { layers: 20, mask_erode_px: 0.25, tolerance: 0.5, quantiser: 0.05, facet_texels: 1024 }
    }
}

/// Fits `method` to what `bake` prepared.
///
/// # Errors
/// Where the atlas is too large for the image coder (65535 texels a side).
pub fn fit(bake: &Bake<'_>, method: Method, options: &FitOptions) -> Result<(Model, FitReport), TextureError> {
    let fitted = match method {
        Method::Static => static_texture::fit(bake, options).map(layered),
        Method::Vdtm => vdtm::fit(bake, options).map(layered),
        Method::DynTex => dyntex::fit(bake, options).map(layered),
        Method::Lumigraph => lumigraph::fit(bake, options)
            .map(|(rays, unseen)| (Appearance::Lumigraph(rays, bake.surface.clone()), unseen)),
    };
    let (appearance, unseen_texels) = fitted.ok_or_else(|| TextureError::Degenerate {
        fault: format!("an atlas of {:?} texels cannot be coded", bake.surface.size),
        remedy: "use coarser texels".to_owned(),
    })?;
    let ranks = match &appearance {
        Appearance::Layers(layers) => layers.facets.iter().map(|f| f.rank).collect(),
        Appearance::Lumigraph(..) => Vec::new(),
    };
    let report = FitReport { texels: bake.surface.len(), unseen_texels, ranks };
    Ok((Model { mesh: bake.mesh.clone(), method, appearance, materials: Vec::new() }, report))
}

fn layered((layers, unseen): (Layers, usize)) -> (Appearance, usize) {
    (Appearance::Layers(layers), unseen)
}

impl Model {
    /// The texture of the object as seen from `eye`, unclamped, in levels of 0..=255. Row 0 is v = 0.
    pub fn atlas(&self, eye: &Point3<f64>) -> Image<[f32; 3]> {
        match &self.appearance {
            Appearance::Layers(layers) => layers.blend(eye),
            Appearance::Lumigraph(rays, surface) => rays.blend(surface, eye),
        }
    }

    /// The texture that viewers without our extension show, in levels of 0..=255: the first layer of a static texture and
    /// of DynTex, the mean of the layers of VDTM, of the rays of a lumigraph; under the materials.
    pub fn still(&self) -> Image<[f32; 3]> {
        let mut still = match &self.appearance {
            Appearance::Layers(layers) if self.method == Method::Vdtm => layers.mean(),
            Appearance::Layers(layers) => layers.first(),
            Appearance::Lumigraph(rays, surface) => rays.mean(surface),
        };
        material_layer::paint(&mut still, &glb::as_stored(&self.mesh), &self.materials);
        still
    }

    /// Numbers the charts as the model's file does ([`charts_of_file`]). Tells how many there are.
    pub fn number_charts(&mut self) -> usize {
        self.mesh.face_charts = charts_of_file(&self.mesh.mesh.faces, self.mesh.mesh.positions.len());
        self.mesh.face_charts.iter().max().map_or(0, |&chart| chart as usize + 1)
    }

    /// Lays materials over charts in place of the appearance, and of materials laid before; the charts are those of
    /// [`Model::number_charts`], which is done first.
    ///
    /// # Errors
    /// Where a chart is not there, or gets two.
    pub fn lay(&mut self, materials: Vec<MaterialLayer>) -> Result<(), TextureError> {
        self.number_charts();
        material_layer::check(&materials, &self.mesh.face_charts).map_err(material_layer::refused)?;
        self.materials = materials;
        Ok(())
    }

    /// The model as one binary glTF (`docs/model-format.md`).
    ///
    /// # Errors
    /// Where the model is too large for the container (4 GiB).
    pub fn to_glb(&self) -> Result<Vec<u8>, TextureError> {
        glb::write(self)
    }

    /// Reads what [`Model::to_glb`] wrote; `path` names the file in errors.
    ///
    /// # Errors
    /// Says what is wrong with a file that is truncated, inconsistent, or no model of ours.
    pub fn from_glb(bytes: &[u8], path: &Path) -> Result<Self, TextureError> {
        glb::read(bytes).map_err(|fault| TextureError::Invalid {
            path: path.to_owned(),
            fault,
            remedy: "make the model again with `turnlight model`".to_owned(),
        })
    }

    /// What the model costs.
    ///
    /// # Errors
    /// As [`Model::to_glb`].
    pub fn bytes(&self) -> Result<ModelBytes, TextureError> {
        let (file, appearance) = glb::sizes(self)?;
        let appearance_raw = match &self.appearance {
            Appearance::Layers(layers) => layers.raw_bytes(),
            Appearance::Lumigraph(rays, _) => 5 * rays.views.len() as u64,
        };
        let materials = self.materials.iter().map(|layer| layer.coded.len() as u64).sum();
        Ok(ModelBytes { file, appearance, appearance_raw, materials })
    }
}
