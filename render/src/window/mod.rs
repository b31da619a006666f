//! A window that shows whatever it is handed: events in, widgets and pictures out (feature `window`).
//!
//! What is in the window is a [`Show`]'s business; here are the system's event loop, the adapter that puts things on the
//! screen, and nothing else. Pictures in egui's textures with [`egui::TextureOptions::NEAREST`], drawn at their own size in
//! whole pixels, reach the screen as they are, byte for byte: nothing is dithered, and the screen's format holds encoded
//! values wherever the system offers one.

mod error;
mod event_loop;
mod screen;

pub use error::WindowError;
pub use event_loop::{Show, WindowOptions, open};

pub use egui_winit::egui;
