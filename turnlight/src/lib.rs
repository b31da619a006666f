//! Image-based modelling from turntable photographs: the whole pipeline, the comparison of methods, and
//! what the `turnlight` command shares with programs that call the library.
//!
//! - [`bench`]: how fast things go on this machine;
//! - [`btf`]: coded materials, judged and compared;
//! - [`pipeline`]: views → hull → simplified mesh → atlas → appearance;
//! - [`evaluate`]: the four methods on held-out views, as JSON, CSV and one HTML page;
//! - [`export`]: models for the browser and for programs that do not know our extension;
//! - [`colmap`]: cameras from an installed COLMAP, where there is no board;
//! - [`film`]: films of every kind this build can write;
//! - [`footage`]: from films and photographs to a capture;
//! - [`footage_report`]: what became of footage, as a page;
//! - [`inspect`]: what a mesh, a model or a capture holds;
//! - [`output`]: files and folders that appear whole or not at all;
//! - [`panorama`]: light from all around;
//! - [`projector`]: who draws a model's frames, graphics hardware or the CPU;
//! - [`scene`]: several models in one scene, as a file;
//! - [`serve`]: a model and its player on loopback;
//! - [`shading`]: how the object is lit over a turn;
//! - [`stages`]: what each stage costs;
//! - [`swatch`]: a material on show;
//! - [`truth`]: a mesh held against the true one;
//! - [`viewer`]: what a window shows, without the window; `window`: the window (feature `window`).

pub mod bench;
pub mod btf;
pub mod colmap;
mod error;
pub mod evaluate;
pub mod export;
pub mod film;
pub mod footage;
pub mod footage_report;
pub mod inspect;
pub mod output;
pub mod panorama;
pub mod pipeline;
pub mod playback;
pub mod projector;
pub mod scene;
mod selection;
pub mod serve;
pub mod shading;
pub mod stages;
pub mod swatch;
pub mod truth;
pub mod viewer;
#[cfg(feature = "window")]
pub mod window;

pub use error::Error;
pub use selection::Selection;

pub use {capture, data_synth, geometry, render, texture};
