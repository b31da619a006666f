//! From silhouettes to a mesh with an atlas.
//!
//! This crate knows shapes and cameras, and no colour, no appearance and no GPU.

pub mod accuracy;
pub mod atlas;
pub mod depth;
mod error;
pub mod hull;
pub mod mesh;
mod param;
mod segment;
mod simplify;

pub use accuracy::{Accuracy, AccuracyOptions, accuracy};
pub use atlas::{UnwrapOptions, UnwrapReport, Unwrapped, unwrap_mesh};
pub use depth::DepthMap;
pub use error::GeometryError;
pub use hull::{Hull, HullChoice, HullOptions, HullReport, choose_hull, visual_hull};
pub use mesh::{Mesh, MeshCheck, TexturedMesh, taubin_smooth};
pub use param::FlatteningLimits;
pub use segment::SegmentOptions;
pub use simplify::{Simplified, SimplifyOptions, simplify};
