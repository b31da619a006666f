//! A rabbit of plain white plaster, without any texture: what shading and outline alone must carry.
//! One piece, genus zero. Built in units of its height without ears, looking along +x.

use super::clay::{chain, ellipsoid, smooth_max, smooth_min};
use crate::isosurface::{Grid, extract};
use crate::material::{Finish, Vec3};
use crate::shape::{MeshBuilder, P};

/// Metres per modelling unit.
const SCALE: f64 = 0.115;
/// Grid cells per modelling unit.
const CELLS: f64 = 58.0;
/// Cosine and sine of the turn on the table: three quarters from the front seen along x.
const TURN: [f64; 2] = [0.573_576_4, 0.819_152];
/// Reflectance: as white as the key light leaves room for below the sensor's white.
const WHITE: f32 = 0.62;

/// Builds the mesh.
pub(crate) fn build() -> MeshBuilder {
    let grid = Grid::around(P::new(-0.75, -0.36, -0.02), P::new(0.64, 0.36, 1.48), 1.0 / CELLS);
    let b = extract(&grid, surface);
    let bottom = b.mesh.positions.iter().fold(f64::INFINITY, |m, p| m.min(p.z));
    let [cos, sin] = TURN;
    b.moved(|p| {
        let q = P::new(p.x + 0.06, p.y, p.z - bottom) * SCALE;
        P::new(cos * q.x - sin * q.y, sin * q.x + cos * q.y, q.z)
    })
}

fn surface(p: P) -> f64 {
    let q = P::new(p.x, p.y.abs(), p.z);
    let at = P::new;
    let body = smooth_min(
        ellipsoid(q, at(-0.16, 0.0, 0.36), at(0.36, 0.26, 0.33)),
        ellipsoid(q, at(-0.30, 0.0, 0.31), at(0.28, 0.285, 0.30)),
        0.08,
    );
    let chest = ellipsoid(q, at(0.13, 0.0, 0.42), at(0.20, 0.18, 0.28));
    let neck = chain(q, &[(0.08, 0.0, 0.52, 0.17), (0.24, 0.0, 0.72, 0.14)], 0.03);
    let torso = smooth_min(smooth_min(body, chest, 0.12), neck, 0.10);
    let trunk = smooth_min(torso, head(q), 0.06);
    let haunch = ellipsoid(q, at(-0.23, 0.20, 0.25), at(0.235, 0.105, 0.225));
    let limbs = [
        (haunch, 0.035),
        (ellipsoid(q, at(-0.02, 0.205, 0.055), at(0.215, 0.072, 0.062)), 0.03),
        (chain(q, &[(0.17, 0.105, 0.42, 0.085), (0.235, 0.105, 0.18, 0.060), (0.26, 0.105, 0.07, 0.056)], 0.03), 0.06),
        (ellipsoid(q, at(0.305, 0.108, 0.048), at(0.105, 0.060, 0.052)), 0.03),
        (tail(q), 0.03),
        (ear(q), 0.045),
    ];
    let figure = limbs.into_iter().fold(trunk, |d, (part, k)| smooth_min(d, part, k));
    figure.max(0.012 - q.z)
}

fn head(q: P) -> f64 {
    let at = P::new;
    let skull = ellipsoid(q, at(0.31, 0.0, 0.80), at(0.205, 0.155, 0.175));
    let muzzle = ellipsoid(q, at(0.455, 0.0, 0.735), at(0.115, 0.092, 0.085));
    let cheek = ellipsoid(q, at(0.40, 0.075, 0.725), at(0.11, 0.075, 0.082));
    let head = smooth_min(smooth_min(skull, muzzle, 0.07), cheek, 0.05);
    // A socket with the eye in it; a nose with its groove.
    let socket = ellipsoid(q, at(0.405, 0.152, 0.828), at(0.062, 0.03, 0.048));
    let head = smooth_max(head, -socket, 0.03);
    let eye = ellipsoid(q, at(0.402, 0.128, 0.828), at(0.040, 0.028, 0.036));
    let nose = ellipsoid(q, at(0.556, 0.0, 0.768), at(0.028, 0.034, 0.024));
    let groove = ellipsoid(q, at(0.578, 0.0, 0.722), at(0.05, 0.010, 0.036));
    smooth_min(smooth_max(head, -groove, 0.02), eye.min(nose), 0.012)
}

/// A spoon: hollow in front.
fn ear(q: P) -> f64 {
    let along = P::new(-0.36, 0.20, 0.91).normalize();
    let front = (P::new(0.80, 0.55, 0.0) - along * along.dot(&P::new(0.80, 0.55, 0.0))).normalize();
    let side = along.cross(&front);
    let r = q - P::new(0.155, 0.125, 1.16);
    // Curled back towards the tip.
    let s = r.dot(&along);
    let bent = P::new(s, r.dot(&side), r.dot(&front) + 0.35 * s * s);
    let shell = ellipsoid(bent, P::zeros(), P::new(0.285, 0.088, 0.050));
    let hollow = ellipsoid(bent, P::new(0.015, 0.0, 0.052), P::new(0.225, 0.060, 0.050));
    smooth_max(shell, -hollow, 0.018)
}

/// A tuft of lumps.
fn tail(q: P) -> f64 {
    let r = q - P::new(-0.575, 0.0, 0.245);
    let lumps = (23.0 * r.x).sin() * (23.0 * r.y).cos() * (23.0 * r.z).sin();
    r.norm() - 0.105 - 0.008 * lumps
}

/// What it is made of: plaster.
pub(crate) fn finishes() -> Vec<Finish> {
    vec![Finish::Matt]
}

/// The same everywhere.
pub(crate) fn albedo() -> Vec3 {
    Vec3::repeat(WHITE)
}
