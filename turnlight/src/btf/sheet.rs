//! Original beside decoded, and their difference, as one picture.

use capture::Image;
use capture::btf::Btf;
use texture::btf::{Answer, Material, Synthesized};

/// What differences are multiplied by.
pub const DIFFERENCE_GAIN: f32 = 10.0;
/// Between tiles.
const GAP_PX: usize = 4;
const GAP: [u8; 3] = [255; 3];
/// Tiles are enlarged to at least this side.
const TILE_PX: usize = 128;
/// Pairs that are shown: view, then light, as polar angle and azimuth in degrees; the nearest measured are taken.
const SHOWN: [[f64; 4]; 5] = [
    [0.0, 0.0, 30.0, 0.0],
    [0.0, 0.0, 60.0, 90.0],
    [60.0, 0.0, 30.0, 180.0],
    [60.0, 90.0, 60.0, 270.0],
    [75.0, 180.0, 75.0, 0.0],
];

/// Three rows, original, decoded, and ten times their difference, over columns of views and lights from the
/// front to grazing. `btf` is encoded as the codec saw it.
pub fn sheet(material: &Material, btf: &Btf, seed: u64) -> Image<[u8; 3]> {
    let gain = TILE_PX.div_ceil(btf.width.max(btf.height)).max(1);
    let step = [btf.width * gain + GAP_PX, btf.height * gain + GAP_PX];
    let mut out = Image::filled(SHOWN.len() * step[0] + GAP_PX, 3 * step[1] + GAP_PX, GAP);
    let decode = |view: usize, light: usize| {
        let (light, view) = (btf.lights[light].cast(), btf.views[view].cast());
        match material.codec.answer() {
            Answer::Sampler(sampler) => sampler.picture(&light, &view),
            Answer::Synthesizer(s) => {
                texture::btf::Sampler::picture(&Synthesized::new(s, [btf.width, btf.height], seed), &light, &view)
            }
        }
    };
    for (column, [tv, pv, tl, pl]) in SHOWN.into_iter().enumerate() {
        let (view, light) = (nearest(&btf.views, tv, pv), nearest(&btf.lights, tl, pl));
        let (original, decoded) = (btf.picture(view, light), decode(view, light));
        let difference: Vec<f32> =
            original.iter().zip(&decoded).map(|(a, b)| (a - b).abs() * DIFFERENCE_GAIN).collect();
        // A high range is shown as it is coded: as logarithms.
        let shown = [original, &decoded, &difference];
        for (row, picture) in shown.into_iter().enumerate() {
            let corner = [GAP_PX + column * step[0], GAP_PX + row * step[1]];
            paint(&mut out, picture, btf.width, gain, corner);
        }
    }
    out
}

fn nearest(all: &[nalgebra::Vector3<f64>], theta_deg: f64, phi_deg: f64) -> usize {
    let (theta, phi) = (theta_deg.to_radians(), phi_deg.to_radians());
    let wanted = nalgebra::Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
    (0..all.len()).max_by(|&a, &b| all[a].dot(&wanted).total_cmp(&all[b].dot(&wanted)).then(b.cmp(&a))).unwrap_or(0)
}

fn paint(out: &mut Image<[u8; 3]>, picture: &[f32], width: usize, gain: usize, corner: [usize; 2]) {
    let stride = out.width();
    for (texel, rgb) in picture.chunks_exact(3).enumerate() {
        let level = |s: f32| (s.clamp(0.0, 1.0) * 255.0).round() as u8;
        let colour = [level(rgb[0]), level(rgb[1]), level(rgb[2])];
        let (left, top) = (corner[0] + texel % width * gain, corner[1] + texel / width * gain);
        for y in top..top + gain {
            out.pixels_mut()[y * stride + left..][..gain].fill(colour);
        }
    }
}
