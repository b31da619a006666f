//! How the command and the reports draw a model.

use render::RenderOptions;
use render::cpu::Player;
use texture::{Method, Model};

/// The four methods, in the order reports show them.
pub const METHODS: [Method; 4] = [Method::Static, Method::Vdtm, Method::Lumigraph, Method::DynTex];

/// What a method is called on the command line and in files.
pub fn method_name(method: Method) -> &'static str {
    match method {
        Method::Static => "static",
        Method::Vdtm => "vdtm",
        Method::Lumigraph => "lumigraph",
        Method::DynTex => "dyntex",
    }
}

/// Draws a model as every report does: 2 × 2 sub-samples, transparent where there is nothing.
pub fn player(model: &Model) -> Player<'_> {
    Player::new(&model.mesh, RenderOptions { supersample: 2, background: None })
}
