//! How the command and the reports draw a model.

use render::RenderOptions;
use render::cpu::Player;
use texture::Model;

/// Draws a model as every report does: 2 × 2 sub-samples, transparent where there is nothing.
pub fn player(model: &Model) -> Player<'_> {
    Player::new(&model.mesh, RenderOptions { supersample: 2, background: None })
}
