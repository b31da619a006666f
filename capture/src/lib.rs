//! What was measured, and with which camera.
//!
//! A [`Capture`] is a list of calibrated frames on disk; [`Capture::load_views`] brings the pixels of
//! some of them into memory as [`View`]s. Everything a later stage needs to know of a photograph is in
//! its `View`: image, matte, camera. This crate knows no mesh, no atlas, no GPU and no command line.

mod camera;
mod capture_set;
pub mod contour;
mod error;
mod image;

pub use camera::{Camera, Distortion, Intrinsics, Projected, Ray};
pub use capture_set::{Aabb, Capture, Frame, LoadOptions, View};
pub use contour::{BinaryMatte, ContourOptions, Contours, Surround};
pub use error::CaptureError;
pub use image::Image;
