//! What was measured, and with which camera.
//!
//! A [`Capture`] is a list of calibrated frames on disk; [`Capture::load_views`] brings the pixels of
//! some of them into memory as [`View`]s. Everything a later stage needs to know of a photograph is in
//! its `View`: image, matte, camera. This crate knows no mesh, no atlas, no GPU and no command line.
//!
//! ```no_run
//! use capture::{Capture, LoadOptions};
//!
//! let capture = Capture::read("owl".as_ref())?;
//! println!("{} frames, {}", capture.frames.len(), capture.mask_source);
//! let views = capture.load_all_views(&LoadOptions { downscale: 2 })?;
//! # Ok::<(), capture::CaptureError>(())
//! ```

pub mod board;
pub mod btf;
pub mod calibrate;
mod camera;
mod capture_set;
pub mod choose;
pub mod contour;
pub mod doctor;
mod error;
mod exif;
pub mod footage;
mod formats;
mod image;
pub mod light;
mod load;
mod masks;
mod matte;
mod outlines;
mod pixels;
#[cfg(feature = "video")]
mod saddle;
pub mod silhouette;
pub mod srgb;
pub mod turntable;
#[cfg(feature = "video")]
pub mod video;
mod votes;
mod write;

pub use board::{Board, BoardError};
pub use camera::{Camera, Distortion, Intrinsics, Projected, Ray};
pub use capture_set::{Aabb, Capture, Frame, LoadOptions, View};
pub use contour::{BinaryMatte, ContourOptions, Contours, Surround};
pub use error::CaptureError;
pub use formats::{CaptureFormat, detect_format};
pub use image::Image;
pub use load::reduced;
pub use masks::MaskSource;
pub use matte::{erode, grow, is_binary, signed_distance, smooth};
pub use pixels::{has_transparency, read_matte, read_rgb, write_matte, write_rgb};
