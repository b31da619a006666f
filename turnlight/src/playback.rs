//! How the command and the reports draw a model.

use crate::scene::{Placed, Scene};
use render::RenderOptions;
use render::cpu::{Object, Player};
use render::material::{Coat, Coats, Tile};
use texture::Model;

/// Of materials that are synthesized.
const SEED: u64 = 1;

/// Draws a model as every report does: 2 × 2 sub-samples, transparent where there is nothing.
pub fn player(model: &Model) -> Player<'_> {
    Player::new(&model.mesh, RenderOptions { supersample: 2, background: None })
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

/// What stands in a scene; `coats` are those of its models.
pub fn objects<'a>(scene: &'a Scene, coats: &'a [Option<Coats<'a>>]) -> Vec<Object<'a>> {
    let object = |placed: &Placed| Object {
        model: &scene.models[placed.model],
        pose: placed.pose,
        coats: coats.get(placed.model).and_then(Option::as_ref),
    };
    scene.objects.iter().map(object).collect()
}
