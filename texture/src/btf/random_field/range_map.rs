//! The heights of the surface, from how its brightness follows the light (over-determined photometric
//! stereo, Woodham 1980): `Y_l = b·l` by least squares over the lights of the most frontal view, without
//! the darkest and the brightest tenth of them at each texel (shadows, highlights); `n = b/|b|`. Slopes
//! `∂h/∂x = −n_x/n_z` are integrated in the Fourier domain (Frankot and Chellappa 1988):
//! `Ĥ = −i (ω_x P + ω_y Q) / (ω_x² + ω_y²)`, `Ĥ(0) = 0`: exact for tiles that continue themselves.

use super::fourier::{Fourier, frequency};
use capture::btf::Btf;
use nalgebra::{Matrix3, Vector3};
use rustfft::num_complex::Complex64;

/// Share of the lights left out at either end.
const LEFT_OUT: f64 = 0.1;
/// A normal needs as many.
const FEWEST_LIGHTS: usize = 4;
/// Lights lower than this say more of shadows than of slopes.
const LOWEST_LIGHT: f64 = 0.2;
/// Steeper than a picture from the front can tell.
const STEEPEST: f64 = 3.0;

/// Heights in texels, mean 0, (y, x); all 0 where fewer than four lights were measured.
pub(super) fn range_map(btf: &Btf) -> Vec<f64> {
    integrate([btf.width, btf.height], &slopes(btf))
}

/// Height whose slopes along x and along rows (downward) are nearest to the given ones, mean 0.
pub(super) fn integrate(size: [usize; 2], slopes: &[[f64; 2]]) -> Vec<f64> {
    let fourier = Fourier::new(size);
    let [p, q] = [0, 1].map(|axis| fourier.forward(&slopes.iter().map(|s| s[axis]).collect::<Vec<_>>()));
    let height = |i: usize| {
        let [wx, wy] = [derivative(i % size[0], size[0]), derivative(i / size[0], size[1])];
        let square = wx * wx + wy * wy;
        let zero = Complex64::new(0.0, 0.0);
        if square > 0.0 { Complex64::new(0.0, -1.0) * (p[i] * wx + q[i] * wy) / square } else { zero }
    };
    fourier.inverse((0..p.len()).map(height).collect())
}

/// Slopes along x and down the rows: the inverse of [`integrate`].
pub(super) fn gradient(heights: &[f64], size: [usize; 2]) -> Vec<[f64; 2]> {
    let fourier = Fourier::new(size);
    let spectrum = fourier.forward(heights);
    let along = |axis: usize| {
        let place = |i: usize| [i % size[0], i / size[0]][axis];
        let slope = |(i, h): (usize, &Complex64)| h * Complex64::new(0.0, derivative(place(i), size[axis]));
        fourier.inverse(spectrum.iter().enumerate().map(slope).collect())
    };
    along(0).into_iter().zip(along(1)).map(|(x, y)| [x, y]).collect()
}

/// What each texel reflects: its frontal pictures' mean over the lights, (channel, y, x), each without its mean.
pub(super) fn reflectance(btf: &Btf) -> Vec<f64> {
    let view = frontal_view(btf);
    let (texels, lights) = (btf.texels(), btf.lights.len());
    let at = |i: usize| -> f64 {
        let (channel, texel) = (i / texels, i % texels);
        (0..lights).map(|l| f64::from(btf.picture(view, l)[3 * texel + channel])).sum::<f64>() / lights as f64
    };
    let mut reflectance: Vec<f64> = (0..3 * texels).map(at).collect();
    for channel in reflectance.chunks_exact_mut(texels) {
        let mean = channel.iter().sum::<f64>() / texels as f64;
        channel.iter_mut().for_each(|v| *v -= mean);
    }
    reflectance
}

/// The view nearest to the normal.
fn frontal_view(btf: &Btf) -> usize {
    let by_height = |&a: &usize, &b: &usize| btf.views[a].z.total_cmp(&btf.views[b].z).then(b.cmp(&a));
    (0..btf.views.len()).max_by(by_height).unwrap_or(0)
}

/// The angular frequency, 0 where its sign is not known: at half the sampling rate.
fn derivative(k: usize, n: usize) -> f64 {
    if 2 * k == n { 0.0 } else { frequency(k, n) }
}

/// Slopes of each texel along x and down the rows.
fn slopes(btf: &Btf) -> Vec<[f64; 2]> {
    let view = frontal_view(btf);
    let lights: Vec<usize> = (0..btf.lights.len()).filter(|&l| btf.lights[l].z > LOWEST_LIGHT).collect();
    let slope = |texel: usize| {
        let mut seen: Vec<(f64, Vector3<f64>)> =
            lights.iter().map(|&l| (brightness(btf, view, l, texel), btf.lights[l])).collect();
        let n = normal(&mut seen);
        [-n.x / n.z, n.y / n.z].map(|s| s.clamp(-STEEPEST, STEEPEST))
    };
    (0..btf.texels()).map(slope).collect()
}

/// Reflected light, the cosine of the light in it.
fn brightness(btf: &Btf, view: usize, light: usize, texel: usize) -> f64 {
    let rgb = &btf.picture(view, light)[3 * texel..3 * texel + 3];
    let sum: f64 = rgb.iter().map(|&s| f64::from(btf.encoding.decode(s))).sum();
    if btf.includes_cosine { sum } else { sum * btf.lights[light].z }
}

/// The normal of a Lambertian surface of that brightness under those lights; z where it cannot be told.
fn normal(seen: &mut [(f64, Vector3<f64>)]) -> Vector3<f64> {
    seen.sort_by(|a, b| a.0.total_cmp(&b.0));
    let cut = (LEFT_OUT * seen.len() as f64) as usize;
    let kept = &seen[cut..seen.len() - cut];
    if kept.len() < FEWEST_LIGHTS {
        return Vector3::z();
    }
    let mut gram = Matrix3::zeros();
    let mut moment = Vector3::zeros();
    for (value, light) in kept {
        gram += light * light.transpose();
        moment += light * *value;
    }
    let ridge = 1e-6 * gram.trace();
    let solved = (gram + Matrix3::identity() * ridge).cholesky().map(|c| c.solve(&moment));
    let n = solved.and_then(|b| b.try_normalize(1e-12)).filter(|n| n.iter().all(|v| v.is_finite()));
    n.map_or_else(Vector3::z, |n| Vector3::new(n.x, n.y, n.z.max(1.0 / (1.0 + STEEPEST))))
}
