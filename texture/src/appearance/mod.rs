//! The appearances. One file each; all but the lumigraph are [`crate::Layers`] found in different ways.

pub(crate) mod dyntex;
pub(crate) mod lumigraph;
pub(crate) mod static_texture;
pub(crate) mod vdtm;

pub use lumigraph::{Lumigraph, NO_RAY};
