//! A carved turtle of pale green jade: light walks through its rim, feet and head. One piece, genus zero.
//! Built in a frame where it is about 1.4 long and looks along +x.

use super::clay::{chain, ellipsoid, smooth_max, smooth_min};
use crate::isosurface::{Grid, extract};
use crate::material::{Finish, Vec3};
use crate::shape::{MeshBuilder, P};
use crate::texture_field::{blend, color, fractal, step, stripe};

/// Metres per modelling unit.
const SCALE: f64 = 0.12;
/// Grid cells per modelling unit.
const CELLS: f64 = 66.0;
/// Cosine and sine of the turn on the table: three quarters from the front seen along x.
const TURN: [f64; 2] = [0.642_787_6, 0.766_044_4];

/// Builds the mesh.
pub(crate) fn build() -> MeshBuilder {
    let grid = Grid::around(P::new(-0.78, -0.62, -0.02), P::new(0.92, 0.62, 0.56), 1.0 / CELLS);
    let b = extract(&grid, surface);
    let bottom = b.mesh.positions.iter().fold(f64::INFINITY, |m, p| m.min(p.z));
    let [cos, sin] = TURN;
    b.moved(|p| {
        let q = P::new(p.x - 0.06, p.y, p.z - bottom) * SCALE;
        P::new(cos * q.x - sin * q.y, sin * q.x + cos * q.y, q.z)
    })
}

fn surface(p: P) -> f64 {
    let q = P::new(p.x, p.y.abs(), p.z);
    let at = P::new;
    let shell = carapace(q);
    let belly = ellipsoid(q, at(0.0, 0.0, 0.135), at(0.46, 0.36, 0.095));
    let fore = chain(q, &[(0.34, 0.27, 0.16, 0.10), (0.47, 0.39, 0.10, 0.078), (0.55, 0.44, 0.065, 0.066)], 0.03);
    let hind = chain(q, &[(-0.34, 0.26, 0.15, 0.10), (-0.46, 0.36, 0.085, 0.078), (-0.51, 0.39, 0.060, 0.064)], 0.03);
    let soles = ellipsoid(q, at(0.575, 0.455, 0.040), at(0.105, 0.088, 0.042)).min(ellipsoid(
        q,
        at(-0.535, 0.405, 0.038),
        at(0.100, 0.082, 0.040),
    ));
    let legs = smooth_min(smooth_min(fore, hind, 0.01), soles, 0.04);
    let tail = chain(q, &[(-0.48, 0.0, 0.13, 0.060), (-0.62, 0.0, 0.085, 0.036), (-0.71, 0.0, 0.095, 0.016)], 0.02);
    let soft = smooth_min(smooth_min(smooth_min(belly, legs, 0.03), tail, 0.03), head(q), 0.04);
    let claws = claws(q);
    let figure = smooth_min(smooth_min(soft, claws, 0.008), shell, 0.014);
    figure.max(0.012 - q.z)
}

fn head(q: P) -> f64 {
    let at = P::new;
    let neck = chain(q, &[(0.36, 0.0, 0.19, 0.120), (0.54, 0.0, 0.25, 0.092), (0.66, 0.0, 0.325, 0.088)], 0.03);
    let skull = ellipsoid(q, at(0.70, 0.0, 0.345), at(0.130, 0.100, 0.092));
    let beak = ellipsoid(q, at(0.80, 0.0, 0.325), at(0.075, 0.062, 0.056));
    let head = smooth_min(smooth_min(neck, skull, 0.04), beak, 0.04);
    // The mouth is a groove; folds around the neck.
    let mouth = ((q.z - 0.298 - 0.25 * (q.x - 0.8).powi(2)).abs() - 0.007).max(0.70 - q.x);
    let folds = 0.006 * (85.0 * (q.x + 0.6 * q.z)).sin() * (1.0 - ((q.x - 0.54).abs() / 0.10).min(1.0));
    let head = head + folds;
    // Cut no deeper than a groove.
    let head = smooth_max(head, -mouth.max(-0.014 - head), 0.01);
    // A round eye under a lid.
    let eye = ellipsoid(q, at(0.752, 0.078, 0.368), at(0.030, 0.028, 0.027));
    let lid = ellipsoid(q, at(0.740, 0.078, 0.384), at(0.044, 0.036, 0.022));
    smooth_min(smooth_min(head, lid, 0.02), eye, 0.008)
}

fn claws(q: P) -> f64 {
    let claw = |x: f64, y: f64, turn: f64, reach: f64| {
        let (s, c) = turn.sin_cos();
        chain(q, &[(x, y, 0.040, 0.028), (x + c * reach, y + s * reach, 0.024, 0.016)], 0.01)
    };
    let fore = (0..4)
        .map(|k| 0.05 + 0.38 * f64::from(k))
        .map(|t| claw(0.585 + 0.085 * t.cos(), 0.455 + 0.075 * t.sin(), t, 0.055));
    let hind = (0..4)
        .map(|k| 1.75 + 0.38 * f64::from(k))
        .map(|t| claw(-0.54 + 0.085 * t.cos(), 0.405 + 0.07 * t.sin(), t, 0.05));
    fore.chain(hind).fold(f64::INFINITY, f64::min)
}

/// A dome of scutes with growth rings over a scalloped rim.
fn carapace(q: P) -> f64 {
    let dome = ellipsoid(q, P::new(0.0, 0.0, 0.185), P::new(0.50, 0.405, 0.300));
    let (first, second) = nearest_scutes(q);
    let groove = (1.0 - (second - first) / 0.026).max(0.0);
    let rings = 0.006 * (first * 120.0).cos() * (first / 0.06).min(1.0);
    let dome = dome + 0.034 * groove * groove - rings - 0.016 * (1.0 - first / 0.13).max(0.0);
    let dome = smooth_max(dome, 0.17 - q.z, 0.02);
    let angle = (q.y / 0.46).atan2(q.x / 0.57);
    let scallop = 1.0 + 0.022 * (22.0 * angle).cos().abs();
    let rim = ellipsoid(q, P::new(0.0, 0.0, 0.175), P::new(0.565 * scallop, 0.462 * scallop, 0.062));
    let seam = (0.5 - (11.0 * angle).sin().abs() * 4.0).max(0.0) * 0.018;
    smooth_min(dome, rim + seam, 0.02)
}

/// Distances to the nearest and the second nearest scute's middle, seen from above.
fn nearest_scutes(q: P) -> (f64, f64) {
    const SCUTES: [(f64, f64); 9] = [
        (0.37, 0.0),
        (0.19, 0.0),
        (0.0, 0.0),
        (-0.19, 0.0),
        (-0.37, 0.0),
        (0.285, 0.215),
        (0.097, 0.265),
        (-0.097, 0.265),
        (-0.285, 0.215),
    ];
    SCUTES
        .iter()
        .map(|&(x, y)| (q.x - x).hypot(q.y - y))
        .fold((f64::INFINITY, f64::INFINITY), |(a, b), d| (a.min(d), b.min(d.max(a))))
}

/// What it is made of: polished stone that light enters.
pub(crate) fn finishes() -> Vec<Finish> {
    vec![Finish::translucent(0.10, 1.61, 0.0007)]
}

/// Pale green with darker clouds and a russet skin on the back of the shell; wax darkens the grooves.
pub(crate) fn albedo(p: Vec3) -> Vec3 {
    let cloud = fractal(p * 36.0, 3, 9);
    let tone = blend(color([112, 166, 124]), color([196, 222, 186]), step(0.5, 0.5, cloud));
    let skin = step(0.60, 0.16, fractal(p * 24.0 + Vec3::repeat(3.1), 3, 21)) * step(0.035, 0.02, p.z);
    let tone = blend(tone, color([176, 122, 62]), 0.7 * skin);
    if p.z < 0.19 * SCALE as f32 {
        return tone;
    }
    let [cos, sin] = TURN;
    let q = p.cast::<f64>() / SCALE;
    let q = P::new(cos * q.x + sin * q.y + 0.06, (cos * q.y - sin * q.x).abs(), q.z);
    let (first, second) = nearest_scutes(q);
    let groove = stripe((second - first) as f32, 0.010, 0.02) * step(0.0, 0.1, 0.6 - q.x as f32);
    blend(tone, color([40, 70, 46]), 0.75 * groove)
}
