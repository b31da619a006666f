//! Films every scene once and pastes the pictures onto one sheet, in the order of [`Scene::ALL`]:
//! `contact_sheet FILE [SAMPLES COLUMNS WIDTH HEIGHT [TURNS [SCENE...]]]`. With several turns each scene
//! is shown that often, evenly around, otherwise from its best side.

use data_synth::{Effort, Layout, Scene, SynthOptions, synthesize};
use std::time::Instant;

/// Behind the objects, 8-bit sRGB.
const PAPER: [u8; 3] = [44, 46, 50];
const ELEVATION_DEG: f64 = 24.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, rest @ ..] = arguments.as_slice() else {
        return Err("contact_sheet FILE [SAMPLES COLUMNS WIDTH HEIGHT [TURNS [SCENE...]]]".into());
    };
    let number = |i: usize, otherwise: usize| rest.get(i).map_or(Ok(otherwise), |n| n.parse());
    let (columns, turns) = (number(1, 4)?.max(1), number(4, 1)?);
    let options = SynthOptions {
        views: turns,
        width: number(2, 320)?,
        height: number(3, 240)?,
        effort: Effort::Samples(u32::try_from(number(0, 16)?)?),
        ..SynthOptions::default()
    };
    let named: Vec<Scene> = rest.iter().skip(5).map(|s| s.parse()).collect::<Result<_, _>>()?;
    let scenes = if named.is_empty() { Scene::ALL.to_vec() } else { named };
    let mut tiles = Vec::new();
    for scene in scenes {
        let start = Instant::now();
        let capture = synthesize(scene, &from_best_side(scene, &options))?;
        let size = (capture.aabb.max - capture.aabb.min).map(|e| (1e3 * e).round());
        let [x, y, z] = size.into();
        let seconds = start.elapsed().as_secs_f64();
        println!("{scene}: {} faces, {x} x {y} x {z} mm, {seconds:.1} s", capture.mesh.faces.len());
        tiles.extend(capture.views.into_iter().rev().take(turns).rev().map(|view| (view.image, view.matte)));
    }
    let [w, h] = [options.width, options.height];
    let rows = tiles.len().div_ceil(columns);
    let mut sheet = image::RgbImage::from_pixel((columns * w) as u32, (rows * h) as u32, image::Rgb(PAPER));
    for (i, (picture, matte)) in tiles.iter().enumerate() {
        for (x, y) in (0..h).flat_map(|y| (0..w).map(move |x| (x, y))) {
            let at = [(i % columns * w + x) as u32, (i / columns * h + y) as u32];
            let over = over_paper(picture.at(x, y), matte.at(x, y));
            sheet.put_pixel(at[0], at[1], image::Rgb(over));
        }
    }
    Ok(sheet.save(file)?)
}

/// A single turn starts where the object shows best: the last of two views along a stretch of a ring.
fn from_best_side(scene: Scene, options: &SynthOptions) -> SynthOptions {
    let azimuth_deg = match scene {
        Scene::Temple => 322.0,
        Scene::Elephant => 300.0,
        _ => 0.0,
    };
    if options.views > 1 || azimuth_deg == 0.0 {
        return SynthOptions { layout: Layout::Rings { elevations_deg: vec![ELEVATION_DEG] }, ..options.clone() };
    }
    // Of two views the second stands half the turns on.
    let turns = azimuth_deg / 180.0;
    let layout = Layout::Spiral { from_deg: ELEVATION_DEG, to_deg: ELEVATION_DEG, turns };
    SynthOptions { views: 2, layout, ..options.clone() }
}

/// The object over the paper. Pictures hold the object on black, mixed in linear light; what is behind
/// it shows through in encoded values, which differs by less than the eye sees along an outline.
fn over_paper(object: [u8; 3], coverage: u8) -> [u8; 3] {
    let behind = f32::from(255 - coverage) / 255.0;
    std::array::from_fn(|c| (f32::from(object[c]) + behind * f32::from(PAPER[c])).min(255.0).round() as u8)
}
