//! Playback: a textured mesh and a camera in, an RGBA picture out.
//!
//! An appearance depends on the eye alone once per frame (`texture::Model::atlas`); what is left is
//! to draw a mesh with one texture. Three renderers do that by one definition:
//!
//! - [`reference`](mod@reference) casts a ray per sub-sample and is the arbiter;
//! - [`cpu`] rasterises the same sub-samples in tiles and is what one plays with, models straight from
//!   their 8-bit layers ([`blend`]);
//! - `gpu` has graphics hardware do it (feature `gpu`).
//!
//! The definition. A pixel has `n × n` sub-samples at the centres of a regular grid. Each sees the
//! nearest surface (either side of a face, any depth above zero), looks up the texture with
//! perspective-exact coordinates, and filters it trilinearly over the footprint of *one sub-sample*,
//! the longer of the two derivatives deciding the mip level. A pixel's colour is the mean over the
//! covered sub-samples, clamped and rounded once; its alpha is their share. Charts that carry a
//! [`material`] are lit instead of looked up: `render_lit` of either renderer.
//!
//! State: the lens enters exactly where a ray goes, but its local magnification is left out of the
//! mip level; filtering is isotropic, so surfaces at grazing angles blur along the far direction;
//! frames beyond [`MAX_PIXELS`] come back empty; of two faces at the very same depth either may show.

pub mod backdrop;
pub mod blend;
pub mod blender;
pub mod cpu;
mod error;
mod face;
pub mod film;
pub mod filter;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod material;
pub mod orbit;
pub mod path;
mod pose;
pub mod reference;
mod resolve;
mod simd;
pub mod web;
#[cfg(feature = "window")]
pub mod window;

pub use error::RenderError;
pub use pose::Pose;

use capture::Camera;

/// Largest frame drawn, in pixels; a larger one comes back as an image of size zero.
pub const MAX_PIXELS: usize = 1 << 28;

/// Largest number of sub-samples along a pixel's side; more is treated as this many.
pub const MAX_SUPERSAMPLE: usize = 16;

/// How a frame is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RenderOptions {
    /// Sub-samples along a pixel's side, so `n²` per pixel; clamped to 1..=[`MAX_SUPERSAMPLE`].
    pub supersample: usize,
    /// What stands behind the object, encoded 8 bit; `None` leaves it transparent.
    pub background: Option<[u8; 3]>,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self { supersample: 2, background: None }
    }
}

impl RenderOptions {
    fn per_side(&self) -> usize {
        self.supersample.clamp(1, MAX_SUPERSAMPLE)
    }
}

/// Width and height of the frame, zero where it would be too large to draw.
fn frame_size(camera: &Camera) -> (usize, usize) {
    let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
    match width.checked_mul(height) {
        Some(pixels) if pixels <= MAX_PIXELS => (width, height),
        _ => (0, 0),
    }
}

/// Whether a camera can see anything: finite throughout, with a focal length.
fn is_usable(camera: &Camera) -> bool {
    let i = &camera.intrinsics;
    let d = &i.distortion;
    let numbers = [i.fx, i.fy, i.skew, i.cx, i.cy, d.k1, d.k2, d.k3, d.p1, d.p2];
    let finite = numbers.iter().chain(camera.rotation.iter()).chain(camera.translation.iter()).all(|x| x.is_finite());
    finite && i.fx != 0.0 && i.fy != 0.0
}
