//! Appearance models: sampling photographs into texels, fitting, evaluation, storage.
//!
//! An appearance answers in two steps: what depends on the eye alone (weights of layers per facet), and
//! what depends on the surface point (the layers' texels). [`Model::atlas`] does both and gives the
//! texture of the whole object as seen from one eye; a renderer then draws a mesh with one texture.
//! This crate knows no GPU and no window.

mod error;
pub mod metrics;
mod model;

pub use error::TextureError;
pub use model::{FitOptions, FitReport, Method, Model, fit};
