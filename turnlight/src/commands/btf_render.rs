//! `turnlight btf render`

use super::btf::read_material;
use super::check_extension;
use crate::Answer;
use crate::arguments::BtfRenderArgs;
use serde_json::json;
use turnlight::Error;
use turnlight::capture::{Camera, Image};
use turnlight::geometry::{Mesh, TexturedMesh};
use turnlight::render::film::write_png;
use turnlight::render::material::{Coat, Coats, Lit, Tile};
use turnlight::render::{RenderOptions, cpu};
use turnlight::stages::{Observer, Stages};
use turnlight::swatch;
use turnlight::texture::btf::Material;

/// Polar angle and azimuth from which shapes are seen unless said otherwise; the flat tile is seen from above.
const VIEW_DEG: [f64; 2] = [62.0, -90.0];

pub(crate) fn run(args: &BtfRenderArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    check_extension(&args.output, &["png"])?;
    let material = read_material(&args.material, args.member)?;
    let surface = args.shape.surface(args.tiles)?;
    let mut stages = Stages::new(observer);
    let tile = Tile::of(&material, args.seed);
    let picture = stages.run("render", |_| match &surface {
        None => flat(args, &material, &tile),
        Some((mesh, tile_size)) => curved(args, &material, &tile, mesh, *tile_size),
    })?;
    write_png(&args.output, &picture)?;
    let [width, height] = args.size;
    let text = format!("{}, {width} × {height} pixels\nwrote {}", material.name, args.output.display());
    let json = json!({
        "material": material.name,
        "codec": material.codec.kind().name(),
        "width": width,
        "height": height,
        "tile_size": surface.map(|(_, tile_size)| tile_size),
        "output": args.output,
        "stages": stages.finished(),
    });
    Ok(Answer { text, json })
}

fn flat(args: &BtfRenderArgs, material: &Material, tile: &Tile<'_>) -> Result<Image<[u8; 4]>, Error> {
    let view = direction(args.view.unwrap_or([0.0; 2]));
    let coat = Coat::of(material, tile, &[], 1.0);
    // Lights that go with the camera need one.
    let above = swatch::camera(&Mesh::default(), &[0.0, 0.0, 1.0].into(), args.size);
    let lighting = args.light.lamps([0.0; 3])?.seen_by(&above);
    Ok(swatch::flat(&coat, &lighting, &view.into(), args.tiles, args.size))
}

fn curved(
    args: &BtfRenderArgs,
    material: &Material,
    tile: &Tile<'_>,
    mesh: &TexturedMesh,
    tile_size: f64,
) -> Result<Image<[u8; 4]>, Error> {
    let mut charts = mesh.face_charts.clone();
    charts.sort_unstable();
    charts.dedup();
    let coats = Coats::new(mesh, &[Coat::of(material, tile, &charts, tile_size)]);
    let camera: Camera = swatch::camera(&mesh.mesh, &direction(args.view.unwrap_or(VIEW_DEG)).into(), args.size);
    let middle = mesh.mesh.aabb().map_or([0.0; 3], |aabb| aabb.center().into());
    let lighting = args.light.lamps(middle)?.seen_by(&camera);
    let options = RenderOptions { supersample: args.supersample, background: args.background };
    let nothing = Image::filled(mesh.atlas_size[0], mesh.atlas_size[1], [0.0; 3]);
    Ok(cpu::render_lit(mesh, &nothing, &Lit { coats: &coats, lighting: &lighting }, &camera, &options))
}

/// The unit vector of a polar angle from +z and an azimuth from +x, in degrees.
fn direction([polar, azimuth]: [f64; 2]) -> [f64; 3] {
    let (polar, azimuth) = (polar.to_radians(), azimuth.to_radians());
    [polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()]
}
