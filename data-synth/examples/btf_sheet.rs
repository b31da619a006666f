//! A contact sheet: a row per material, seen from the front under three lights, and from 60°.
//! `btf_sheet FILE.png [TEXELS SAMPLES [MATERIAL..]]`

use data_synth::btf::{BtfMaterial, BtfOptions, BtfStudio};
use std::time::Instant;

/// (view, light) of each column, numbered as the 81 directions are.
const COLUMNS: [(usize, usize); 5] = [(0, 2), (0, 19), (0, 42), (37, 42), (42, 52)];
/// Pixels between pictures.
const GAP: usize = 4;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, rest @ ..] = arguments.as_slice() else {
        return Err("btf_sheet FILE.png [TEXELS SAMPLES [MATERIAL..]]".into());
    };
    let size: usize = rest.first().map_or(Ok(96), |n| n.parse())?;
    let samples: u32 = rest.get(1).map_or(Ok(32), |n| n.parse())?;
    let named: Vec<BtfMaterial> = rest.iter().skip(2).map(|n| n.parse()).collect::<Result<_, _>>()?;
    let materials = if named.is_empty() { BtfMaterial::ALL.to_vec() } else { named };
    let pitch = size + GAP;
    let (width, height) = (pitch * COLUMNS.len() - GAP, pitch * materials.len() - GAP);
    let mut sheet = vec![255_u8; 3 * width * height];
    for (row, &material) in materials.iter().enumerate() {
        let start = Instant::now();
        let studio = BtfStudio::new(material, &BtfOptions { size, samples, ..BtfOptions::default() })?;
        let built = start.elapsed().as_secs_f64();
        let views = [0, 37, 42].map(|view| (view, studio.view(view)));
        eprintln!("{material}: built in {built:.2} s, {:.2} s a view", (start.elapsed().as_secs_f64() - built) / 3.0);
        for (column, (view, light)) in COLUMNS.into_iter().enumerate() {
            let samples = views.iter().find(|v| v.0 == view).ok_or("a view not drawn")?.1.as_ref();
            let samples = samples.map_err(ToString::to_string)?;
            let picture = &samples[light * 3 * size * size..(light + 1) * 3 * size * size];
            let level = exposure(picture);
            for (i, pixel) in picture.chunks_exact(3).enumerate() {
                let (x, y) = (column * pitch + i % size, row * pitch + i / size);
                for c in 0..3 {
                    sheet[3 * (y * width + x) + c] = encode(pixel[c] * level);
                }
            }
        }
    }
    image::save_buffer(file, &sheet, width as u32, height as u32, image::ExtendedColorType::Rgb8)?;
    Ok(())
}

/// Brings all but the brightest hundredth into range.
fn exposure(picture: &[f32]) -> f32 {
    let mut sorted = picture.to_vec();
    sorted.sort_unstable_by(f32::total_cmp);
    0.9 / sorted[sorted.len() * 99 / 100].max(0.02)
}

/// The sRGB curve, near enough for a picture to look at.
fn encode(linear: f32) -> u8 {
    (255.0 * linear.clamp(0.0, 1.0).powf(1.0 / 2.2)).round() as u8
}
