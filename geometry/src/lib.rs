//! From silhouettes to a mesh with an atlas.
//!
//! This crate knows shapes and cameras, and no colour, no appearance and no GPU.

pub mod atlas;
mod error;
pub mod mesh;
mod param;
mod segment;
mod simplify;

pub use atlas::{UnwrapOptions, UnwrapReport, Unwrapped, unwrap_mesh};
pub use error::GeometryError;
pub use mesh::{Mesh, TexturedMesh, taubin_smooth};
pub use param::FlatteningLimits;
pub use segment::SegmentOptions;
pub use simplify::{Simplified, SimplifyOptions, simplify};
