//! Appearance models: sampling photographs into texels, fitting, evaluation, storage.
//!
//! An appearance answers in two steps: what depends on the eye alone (weights of layers per facet), and
//! what depends on the surface point (the layers' texels). [`Model::atlas`] does both and gives the
//! texture of the whole object as seen from one eye; a renderer then draws a mesh with one texture.
//! This crate knows no GPU and no window.

pub mod appearance;
mod bake;
pub mod btf;
mod coding;
mod complete;
pub mod directions;
mod error;
mod facets;
mod glb;
mod layers;
mod material_layer;
pub mod metrics;
mod model;
mod observe;
mod surface;
pub mod tile;

pub use bake::Bake;
pub use error::TextureError;
pub use facets::Facets;
pub use glb::EXTENSION;
pub use layers::{FacetWeights, Layer, Layers, spread_labels};
pub use material_layer::{MaterialLayer, charts_of_file};
pub use model::{Appearance, FitOptions, FitReport, Method, Model, ModelBytes, fit};
pub use surface::SurfaceTexels;
