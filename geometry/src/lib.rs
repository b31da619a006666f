//! From silhouettes to a mesh with an atlas.
//!
//! This crate knows shapes and cameras, and no colour, no appearance and no GPU.

pub mod mesh;

pub use mesh::{Mesh, TexturedMesh};
