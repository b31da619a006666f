//! Pictures whose truth is known.
//!
//! [`synthesize`] films a procedural [`Scene`] on a turntable with a small path tracer and returns
//! pictures, mattes, exact cameras and the true surface; [`SynthCapture::write`] saves them as a
//! capture folder. Everything is a function of scene, options and seed, whatever the thread count.
//!
//! [`btf`] measures materials under 81 × 81 directions of view and light.
//!
//! [`footage`] films the same scenes as someone with a phone would: board, backdrop, lens, unsteady platter.
//!
//! [`hull_truth`] knows the visual hulls of simple solids without carving them.
//!
//! This crate shares no shading code with `render` and knows no appearance: truth must not lean on
//! what it judges.
//!
//! Limits: light is sampled at three wavelengths, without polarisation or dispersion; a matte misses what is
//! thinner than half a pixel and shorter than one.

mod accel;
pub mod btf;
mod error;
mod faults;
mod film;
pub mod footage;
pub mod hull_truth;
mod isosurface;
mod light;
mod material;
mod medium;
mod sampler;
mod scene;
mod shape;
mod synth;
mod texture_field;
mod trace;
mod turntable;
mod write;

pub use error::SynthError;
pub use faults::{Faults, SensorNoise};
pub use film::Effort;
pub use scene::Scene;
pub use synth::{
    LightFrame, SynthCapture, SynthOptions, SynthReport, TruthMaps, ViewTruth, synthesize, synthesize_with,
};
pub use turntable::Layout;
