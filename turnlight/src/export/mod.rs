//! Models for programs that do not know our extension, and for those that come without any.
//!
//! - [`blender`]: an add-on with the model;
//! - [`web`]: a folder that any static server serves;
//! - [`obj`]: a mesh with one baked picture.

pub mod blender;
pub mod obj;
pub mod web;
mod zip;
