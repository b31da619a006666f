//! A tile of four reflectances in closed form, for tests of what stores and interpolates such data.
//!
//! | quadrant | what | depends on |
//! |---|---|---|
//! | top left | Lambertian | the light's elevation |
//! | top right | GGX microfacets, Schlick's Fresnel: gold | the half vector |
//! | bottom left | Lambertian 45° V-grooves along y, far below a texel, direct light only | both azimuths |
//! | bottom right | Lambertian stripes painted on a plane below the reference plane | position and view: parallax |
//!
//! A texel belongs to the quadrant its centre lies in. Sources: Walter et al., "Microfacet Models for
//! Refraction through Rough Surfaces", EGSR 2007; Schlick 1994; grooves as in Oren and Nayar 1994, by
//! lengths of shadow in the cross-section.

use capture::btf::BtfDirection;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Reflectance of the Lambertian quadrant, linear RGB.
pub const LAMBERT_ALBEDO: [f64; 3] = [0.6, 0.4, 0.2];
/// Reflectance of the microfacets at normal incidence.
pub const GGX_REFLECTANCE: [f64; 3] = [0.95, 0.64, 0.54];
/// Roughness of the microfacets.
pub const GGX_ALPHA: f64 = 0.25;
/// Reflectance of the grooves.
pub const GROOVE_ALBEDO: [f64; 3] = [0.5, 0.5, 0.5];
/// Mean reflectance of the stripes.
pub const STRIPE_MEAN: [f64; 3] = [0.4, 0.4, 0.5];
/// Amplitude of the stripes.
pub const STRIPE_AMPLITUDE: [f64; 3] = [0.3, 0.3, 0.1];
/// Stripes across the tile, running along y.
pub const STRIPE_COUNT: f64 = 4.0;
/// Depth of the stripes below the reference plane, in sides of the tile.
pub const STRIPE_DEPTH: f64 = 0.05;

/// Linear RGB of texel (x, y) of a tile of `size × size`, under unit irradiance perpendicular to `light`,
/// towards `view`; both unit vectors above the plane. Means over the texel are exact.
pub fn radiance(size: usize, x: usize, y: usize, light: Vector3<f64>, view: Vector3<f64>) -> [f64; 3] {
    let right = 2 * x + 1 > size;
    let bottom = 2 * y + 1 > size;
    match (right, bottom) {
        (false, false) => LAMBERT_ALBEDO.map(|rho| rho / PI * light.z),
        (true, false) => microfacets(light, view),
        (false, true) => GROOVE_ALBEDO.map(|rho| rho / PI * grooves(light, view)),
        (true, true) => {
            let wave = stripes(size, x, view);
            [0, 1, 2].map(|c| (STRIPE_MEAN[c] + STRIPE_AMPLITUDE[c] * wave) / PI * light.z)
        }
    }
}

/// `F D G / (4 cos_o)`: the light's cosine cancels one of the two.
fn microfacets(light: Vector3<f64>, view: Vector3<f64>) -> [f64; 3] {
    let h = (light + view).normalize();
    let a2 = GGX_ALPHA * GGX_ALPHA;
    let lambda = |w: Vector3<f64>| 0.5 * ((1.0 + a2 * (1.0 / (w.z * w.z) - 1.0)).sqrt() - 1.0);
    let slope = h.x * h.x + h.y * h.y + a2 * h.z * h.z;
    let facets = a2 / (PI * slope * slope) / (1.0 + lambda(light) + lambda(view)) / (4.0 * view.z);
    let fresnel = (1.0 - view.dot(&h)).powi(5);
    GGX_REFLECTANCE.map(|f0| (f0 + (1.0 - f0) * fresnel) * facets)
}

/// Mean over the reference plane of the irradiance seen in 45° grooves of unit width whose ridges lie in
/// the plane.
///
/// A wall whose normal is (±1, 0, 1)/√2 is seen and lit from its ridge down, to where the opposite ridge
/// hides it: of a direction of slope `t` towards the wall, `t = ± d_x / d_z`, it hides all below the depth
/// `1 / (1 + t)` where `t > 1`, nothing for `|t| ≤ 1`, and the wall turns its back for `t ≤ −1`. A length
/// `a` of the wall (measured along x) covers `a (1 + t)` of the plane.
pub fn grooves(light: Vector3<f64>, view: Vector3<f64>) -> f64 {
    let open = |t: f64| if t <= -1.0 { 0.0 } else { (1.0 / (1.0 + t)).min(0.5) };
    let wall = |side: f64| {
        let (t_light, t_view) = (side * light.x / light.z, side * view.x / view.z);
        let length = open(t_light).min(open(t_view));
        let cosine = (light.z + side * light.x) / 2.0_f64.sqrt();
        length * (1.0 + t_view).max(0.0) * cosine.max(0.0)
    };
    wall(1.0) + wall(-1.0)
}

/// Mean of the stripes' wave, −1 to 1, over what a texel shows of the lower plane.
fn stripes(size: usize, x: usize, view: Vector3<f64>) -> f64 {
    let width = 1.0 / size as f64;
    let middle = (x as f64 + 0.5) * width - STRIPE_DEPTH * view.x / view.z;
    let half = PI * STRIPE_COUNT * width;
    (TAU * STRIPE_COUNT * middle).cos() * half.sin() / half
}

/// One view, laid out (light, y, x, channel).
pub(super) fn view(size: usize, view: usize) -> Vec<f32> {
    let directions = BtfDirection::all();
    let towards = directions[view].vector();
    let image = |light: &BtfDirection| -> Vec<f32> {
        let light = light.vector();
        let texel = |i: usize| radiance(size, i % size, i / size, light, towards).map(|c| c as f32);
        (0..size * size).flat_map(texel).collect()
    };
    directions.par_iter().flat_map_iter(image).collect()
}
