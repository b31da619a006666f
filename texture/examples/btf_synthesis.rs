//! Originals beside what the random-field models make of them: per material (a folder, see `docs/btf-data.md`) three
//! rows of light and view; original, then `gmrf`, `car2d`, `car3d`, each twice as large as the tile. Prints the
//! statistics by which they are judged, means over 48 pairs.
//! `btf_synthesis FILE.png GROUPS|1:RATIO|auto DATA[@TEXELS]..`

use capture::btf::{Btf, read_folder};
use nalgebra::Vector3;
use std::path::Path;
use texture::btf::multilevel_vq::Variant;
use texture::btf::statistics::{TextureStatistics, compare};
use texture::btf::{Answer, Budget, CodecKind, FitOptions, Material, Precision, fit};

/// (view, light), numbered as the 81 directions are.
const PAIRS: [(usize, usize); 3] = [(0, 19), (8, 60), (42, 50)];
const KINDS: [CodecKind; 3] = [CodecKind::Gmrf, CodecKind::Car2d, CodecKind::Car3d];
/// Texels of a row: of the originals, twice over, and of the syntheses.
const SIDE: usize = 128;
const GAP: usize = 4;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, groups, data @ ..] = arguments.as_slice() else {
        return Err("btf_synthesis FILE.png GROUPS|1:RATIO|auto DATA[@TEXELS]..".into());
    };
    let pitch = SIDE + GAP;
    let (width, height) = (pitch * (1 + KINDS.len()) - GAP, pitch * PAIRS.len() * data.len() - GAP);
    let mut sheet = image::RgbImage::from_pixel(width as u32, height as u32, image::Rgb([255; 3]));
    let budget = match (groups.parse(), groups.strip_prefix("1:")) {
        (Ok(groups), _) => Budget::Components(groups),
        (_, Some(ratio)) => Budget::Ratio(ratio.parse()?),
        _ => Budget::Auto,
    };
    println!("material codec groups bytes ratio fit_cpu_s mean dev_ratio emd autocorr spectrum_db band_db");
    for (block, folder) in data.iter().enumerate() {
        let (folder, crop) = folder.split_once('@').map_or((folder.as_str(), None), |(f, n)| (f, n.parse().ok()));
        let btf = texture::btf::to_coded_range(read_folder(Path::new(folder), crop)?);
        for (row, (view, light)) in PAIRS.into_iter().enumerate() {
            let y = (block * PAIRS.len() + row) * pitch;
            paste(&mut sheet, btf.picture(view, light), [btf.width, btf.height], [0, y]);
        }
        for (column, codec) in KINDS.into_iter().enumerate() {
            let options =
                FitOptions { codec, budget, precision: Precision::Compact, seed: 1, books: Variant::default() };
            let start = cpu_seconds();
            let (material, report) = fit(btf.clone(), &options)?;
            let seconds = cpu_seconds() - start;
            report.notes.iter().for_each(|note| println!("{note}"));
            for (row, (view, light)) in PAIRS.into_iter().enumerate() {
                let picture = synthesize(&material, &btf, view, light, [SIDE; 2])?;
                paste(&mut sheet, &picture, [SIDE; 2], [(column + 1) * pitch, (block * PAIRS.len() + row) * pitch]);
            }
            let bytes = material.byte_count();
            let ratio = material.raw_bytes as f64 / bytes as f64;
            let figures = judge(&material, &btf)?;
            println!("{} {codec} {groups} {bytes} {ratio:.1} {seconds:.1} {figures}", btf.name);
        }
    }
    sheet.save(file)?;
    Ok(())
}

/// Seconds this process has kept processors busy.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let ticks = stat.rsplit(')').next().unwrap_or("").split_whitespace().skip(11).take(2);
    ticks.filter_map(|t| t.parse::<f64>().ok()).sum::<f64>() / 100.0
}

fn synthesize(
    material: &Material,
    btf: &Btf,
    view: usize,
    light: usize,
    size: [usize; 2],
) -> Result<Vec<f32>, Box<dyn std::error::Error>> {
    let [light, view]: [Vector3<f32>; 2] = [btf.lights[light].cast(), btf.views[view].cast()];
    match material.codec.answer() {
        Answer::Synthesizer(synthesizer) => Ok(synthesizer.picture(size, 7, &light, &view)),
        Answer::Sampler(_) => Err("no synthesizer".into()),
    }
}

/// Mean figures over pairs spread over the grid, at twice the tile's size and a bit.
fn judge(material: &Material, btf: &Btf) -> Result<String, Box<dyn std::error::Error>> {
    let (pairs, stride) = (48, 137);
    let mut all: Vec<TextureStatistics> = Vec::new();
    for k in 0..pairs {
        let pair = k * stride % btf.pairs();
        let (view, light) = (pair / btf.lights.len(), pair % btf.lights.len());
        let size = [2 * btf.width, 2 * btf.height];
        let made = synthesize(material, btf, view, light, size)?;
        all.push(compare(btf.picture(view, light), [btf.width, btf.height], &made, size));
    }
    let mean = |f: &dyn Fn(&TextureStatistics) -> f64| all.iter().map(f).sum::<f64>() / all.len() as f64;
    let bands: Vec<String> = (0..4).map(|b| format!("{:+.1}", mean(&|s| s.band_db[b]))).collect();
    Ok(format!(
        "{:.2} {:.3} {:.2} {:.3} {:.2} {}",
        mean(&|s| s.mean_difference),
        mean(&|s| s.deviation_ratio),
        mean(&|s| s.earth_mover),
        mean(&|s| s.autocorrelation),
        mean(&|s| s.spectrum_db),
        bands.join("/")
    ))
}

/// Repeats a picture over a square of [`SIDE`], in sRGB as it is.
fn paste(sheet: &mut image::RgbImage, picture: &[f32], [width, height]: [usize; 2], [x0, y0]: [usize; 2]) {
    for (x, y) in (0..SIDE * SIDE).map(|i| (i % SIDE, i / SIDE)) {
        let texel = 3 * (y % height * width + x % width);
        let pixel = [0, 1, 2].map(|c| (255.0 * picture[texel + c]).round().clamp(0.0, 255.0) as u8);
        sheet.put_pixel((x0 + x) as u32, (y0 + y) as u32, image::Rgb(pixel));
    }
}
