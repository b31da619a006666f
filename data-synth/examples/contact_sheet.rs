//! Films every scene once and pastes the pictures onto one sheet, in the order of [`Scene::ALL`]:
//! `contact_sheet FILE [SAMPLES COLUMNS WIDTH HEIGHT [TURNS [SCENE...]]]`. With several turns each scene
//! is shown that often, evenly around, otherwise from its best side.

use data_synth::{Layout, Scene, SynthOptions, synthesize};
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
        samples_per_pixel: u32::try_from(number(0, 16)?)?,
        surfaces: 8,
        layout: Layout::Rings { elevations_deg: vec![ELEVATION_DEG] },
        ..SynthOptions::default()
    };
    let named: Vec<Scene> = rest.iter().skip(5).map(|s| s.parse()).collect::<Result<_, _>>()?;
    let scenes = if named.is_empty() { Scene::ALL.to_vec() } else { named };
    let mut tiles = Vec::new();
    for scene in scenes {
        let start = Instant::now();
        let capture = synthesize(scene, &options)?;
        println!("{scene}: {} faces, {:.1} s", capture.mesh.faces.len(), start.elapsed().as_secs_f64());
        tiles.extend(capture.views.into_iter().map(|view| (view.image, view.matte)));
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

/// The object over the paper. Pictures hold the object on black, mixed in linear light; what is behind
/// it shows through in encoded values, which differs by less than the eye sees along an outline.
fn over_paper(object: [u8; 3], coverage: u8) -> [u8; 3] {
    let behind = f32::from(255 - coverage) / 255.0;
    std::array::from_fn(|c| (f32::from(object[c]) + behind * f32::from(PAPER[c])).min(255.0).round() as u8)
}
