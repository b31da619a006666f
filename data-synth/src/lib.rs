//! Pictures whose truth is known.
//!
//! [`synthesize`] films a procedural [`Scene`] on a turntable with a small path tracer and returns
//! pictures, mattes, exact cameras and the true surface; [`SynthCapture::write`] saves them as a
//! capture folder. Everything is a function of scene, options and seed, whatever the thread count.
//!
//! This crate shares no shading code with `render` and knows no appearance: truth must not lean on
//! what it judges.
//!
//! State: two scenes; sensor noise only; no depth or normal maps, no video, no BTFs yet. A feature
//! thinner than half a pixel can be missed by the matte. Paths end after
//! [`SynthOptions::surfaces`] surfaces, so deep cavities are slightly dark.

mod accel;
pub mod btf;
mod error;
mod film;
mod isosurface;
mod light;
mod material;
mod noise;
mod sampler;
mod scene;
mod shape;
mod synth;
mod texture_field;
mod trace;
mod turntable;
mod write;

pub use error::SynthError;
pub use noise::SensorNoise;
pub use scene::Scene;
pub use synth::{LightFrame, SynthCapture, SynthOptions, SynthReport, synthesize, synthesize_with};
pub use turntable::Layout;
