//! Films a scene and says what it cost: `film SCENE DIR [VIEWS WIDTH HEIGHT SAMPLES]`.

use data_synth::{Scene, SynthOptions, synthesize};
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, dir, numbers @ ..] = arguments.as_slice() else {
        return Err("film SCENE DIR [VIEWS WIDTH HEIGHT SAMPLES]".into());
    };
    let number = |i: usize, otherwise: usize| numbers.get(i).map_or(Ok(otherwise), |n| n.parse());
    let defaults = SynthOptions::default();
    let options = SynthOptions {
        views: number(0, defaults.views)?,
        width: number(1, defaults.width)?,
        height: number(2, defaults.height)?,
        samples_per_pixel: u32::try_from(number(3, defaults.samples_per_pixel as usize)?)?,
        ..defaults
    };
    let start = Instant::now();
    let capture = synthesize(scene.parse::<Scene>()?, &options)?;
    let seconds = start.elapsed().as_secs_f64();
    capture.write(dir)?;
    println!(
        "{scene}: {} triangles, {} views in {seconds:.1} s ({:.3} s each), {:.2} million rays/s, noise {:.2}/255 RMS",
        capture.mesh.faces.len(),
        options.views,
        seconds / options.views as f64,
        capture.report.rays as f64 / seconds / 1e6,
        capture.report.noise_rms.unwrap_or(f64::NAN),
    );
    Ok(())
}
