//! Materials that take the place of photographed texture, as asked for on the command line.

use super::read_file;
use crate::arguments::MaterialArg;
use turnlight::Error;
use turnlight::stages::Observer;
use turnlight::texture::btf::container::Fault;
use turnlight::texture::{MaterialLayer, Model, TextureError};

/// Repetitions along the model's longest side where nothing tells the size of a tile.
const TILES: f64 = 10.0;

/// Lays the materials asked for over a model; `unit` is metres per world unit, where known.
pub(crate) fn lay(
    model: &mut Model,
    wanted: &[MaterialArg],
    unit: Option<f64>,
    observer: &dyn Observer,
) -> Result<(), Error> {
    if wanted.is_empty() {
        return Ok(());
    }
    let count = model.number_charts();
    let layers = wanted.iter().map(|arg| layer(model, arg, count, unit, observer)).collect::<Result<_, Error>>()?;
    Ok(model.lay(layers)?)
}

fn layer(
    model: &Model,
    arg: &MaterialArg,
    count: usize,
    unit: Option<f64>,
    observer: &dyn Observer,
) -> Result<MaterialLayer, Error> {
    let charts = arg.charts.positions(count).map_err(|fault| {
        let last = count.saturating_sub(1);
        Error::Arguments(format!("--material: the model has charts 0 to {last}; of the list of charts: {fault}"))
    })?;
    let charts = charts.into_iter().map(|chart| chart as u32).collect();
    let coded = read_file(&arg.file)?;
    let invalid = |fault: Fault| TextureError::Invalid {
        path: arg.file.clone(),
        fault: fault.to_string(),
        remedy: "fit it again with `turnlight btf fit`".to_owned(),
    };
    let mut layer = MaterialLayer::new(charts, arg.tile_size.unwrap_or(1.0), coded).map_err(invalid)?;
    if arg.tile_size.is_none() {
        layer.tile_size = measured_size(&layer, unit).unwrap_or_else(|| {
            let longest = model.mesh.mesh.aabb().map(|aabb| aabb.size().max()).filter(|side| *side > 0.0);
            let side = longest.unwrap_or(1.0) / TILES;
            let path = arg.file.display();
            observer.noted(&format!("{path}: a tile measures {side:.4} world units, for nothing tells; say @SIZE"));
            side
        });
    }
    Ok(layer)
}

/// World units across the tile, where both the material and the capture know their scale.
fn measured_size(layer: &MaterialLayer, unit: Option<f64>) -> Option<f64> {
    let texels = layer.material.codec.frame().width as f64;
    let metres = 1e-3 * f64::from(layer.material.texel_pitch_mm?) * texels;
    Some(metres / unit?).filter(|size| *size > 0.0 && size.is_finite())
}
