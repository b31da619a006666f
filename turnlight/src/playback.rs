//! How the command and the reports draw a model.

use render::RenderOptions;
use render::cpu::Player;
use render::material::{Coat, Coats, Tile};
use texture::Model;

/// Of materials that are synthesized.
const SEED: u64 = 1;

/// How every report draws: 2 × 2 sub-samples, transparent where there is nothing.
pub const OPTIONS: RenderOptions = RenderOptions { supersample: 2, background: None };

/// Draws a model as every report does.
pub fn player(model: &Model) -> Player<'_> {
    Player::new(&model.mesh, OPTIONS)
}

/// What answers for the texels of a model's materials, one each.
pub fn tiles(model: &Model) -> Vec<Tile<'_>> {
    model.materials.iter().map(|layer| Tile::of(&layer.material, SEED)).collect()
}

/// A model's materials laid over it; `None` where there are none.
pub fn coats<'a>(model: &'a Model, tiles: &'a [Tile<'a>]) -> Option<Coats<'a>> {
    let layers = model.materials.iter().zip(tiles);
    let coats: Vec<Coat<'a>> =
        layers.map(|(layer, tile)| Coat::of(&layer.material, tile, &layer.charts, layer.tile_size)).collect();
    (!coats.is_empty()).then(|| Coats::new(&model.mesh, &coats))
}
