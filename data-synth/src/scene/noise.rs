//! A die whose faces are printed finer than a camera resolves: checks, white noise, gratings, a zone plate
//! and a star, at 0.4 mm where a 640 × 480 picture has pixels of about that size. One piece; pips are dimples.

use crate::material::{Finish, Vec3};
use crate::sampler::{mix, unit};
use crate::shape::{MeshBuilder, P};
use crate::texture_field::{blend, color, step};
use std::collections::HashMap;

/// Half the edge, the rounding of edges, and the quads along a face.
const HALF: f64 = 0.05;
const ROUND: f64 = 0.009;
const CELLS: usize = 100;
/// Of a pip: radius, depth, and distance of the outer ones from a face's middle.
const PIP: f64 = 0.0082;
const DEEP: f64 = 0.0030;
const PITCH: f64 = 0.0255;
/// Edge of the finest printed square.
const DOT: f32 = 0.0004;
/// Cosine and sine of the turn on the table: an edge and two faces are seen along x.
const TURN: [f64; 2] = [0.866_025_4, 0.5];

/// Builds the mesh.
pub(crate) fn build() -> MeshBuilder {
    let mut b = MeshBuilder::default();
    let mut ids = HashMap::new();
    for face in 0..6 {
        b.part = face as u8;
        let corner = |i: usize, j: usize| lattice(face, i, j);
        for (i, j) in (0..CELLS).flat_map(|j| (0..CELLS).map(move |i| (i, j))) {
            let quad = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            let quad = quad.map(|c| *ids.entry(c).or_insert_with(|| b.ring([surface(c).into()])[0]));
            b.cap(&quad);
        }
    }
    let [cos, sin] = TURN;
    b.moved(|p| P::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y, p.z + HALF))
}

/// The corner `(i, j)` of a face's quads on the cube's lattice. Faces are +x, −x, +y, −y, +z, −z.
fn lattice(face: usize, i: usize, j: usize) -> [usize; 3] {
    let (axis, is_upper) = (face / 2, face.is_multiple_of(2));
    let mut c = [0; 3];
    c[axis] = if is_upper { CELLS } else { 0 };
    // The order of the other two axes turns the face outward.
    let (first, second) = ((axis + 1) % 3, (axis + 2) % 3);
    (c[first], c[second]) = if is_upper { (i, j) } else { (j, i) };
    c
}

/// A lattice corner on the rounded cube, sunk where a pip is.
fn surface(c: [usize; 3]) -> P {
    let q = P::from(c.map(|k| HALF * (2.0 * k as f64 / CELLS as f64 - 1.0)));
    let core = q.map(|c| c.clamp(ROUND - HALF, HALF - ROUND));
    let p = core + (q - core).normalize() * ROUND;
    let Some(axis) = (0..3).find(|&a| p[a].abs() > HALF - 1e-9) else { return p };
    let face = 2 * axis + usize::from(p[axis] < 0.0);
    let far = pip_distance(face, p[(axis + 1) % 3], p[(axis + 2) % 3]);
    let t = (1.0 - (far / PIP).powi(2)).max(0.0);
    let mut sunk = p;
    sunk[axis] -= p[axis].signum() * DEEP * (t * (2.0 - t)).sqrt() * t.sqrt();
    sunk
}

/// Distance to the nearest pip's middle; opposite faces sum to seven.
fn pip_distance(face: usize, u: f64, v: f64) -> f64 {
    const PIPS: [&[(f64, f64)]; 6] = [
        &[(0.0, 0.0), (1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0)],
        &[(1.0, 1.0), (-1.0, -1.0)],
        &[(0.0, 0.0), (1.0, 1.0), (-1.0, -1.0)],
        &[(1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0)],
        &[(-1.0, 1.0), (0.0, 1.0), (1.0, 1.0), (-1.0, -1.0), (0.0, -1.0), (1.0, -1.0)],
        &[(0.0, 0.0)],
    ];
    PIPS[face].iter().map(|&(a, b)| (u - a * PITCH).hypot(v - b * PITCH)).fold(f64::INFINITY, f64::min)
}

/// What it is made of: print on card.
pub(crate) fn finishes() -> Vec<Finish> {
    vec![Finish::Matt]
}

/// A pattern per face, plain red pips.
pub(crate) fn albedo(p: Vec3, part: u8) -> Vec3 {
    let [cos, sin] = TURN.map(|c| c as f32);
    let q = Vec3::new(cos * p.x + sin * p.y, cos * p.y - sin * p.x, p.z - HALF as f32);
    let face = usize::from(part);
    let axis = face / 2;
    let (u, v) = (q[(axis + 1) % 3], q[(axis + 2) % 3]);
    let pip = pip_distance(face, f64::from(u), f64::from(v)) as f32;
    let ink = |c: [u8; 3], t: f32| blend(color([244, 242, 236]), color(c), t);
    let printed = match face {
        // Five: coloured white noise.
        0 => Vec3::new(dice(u, v, 1), dice(u, v, 2), dice(u, v, 3)).map(|c| 0.04 + 0.86 * c),
        // Two: a star of 180 rays.
        1 => ink([16, 20, 28], 0.5 + 0.5 * (180.0 * v.atan2(u)).sin()),
        // Three: checks.
        2 => ink([18, 26, 60], if (cell(u) + cell(v)) & 1 == 0 { 1.0 } else { 0.0 }),
        // Four: a grating that grows finer, 3 mm to 0.5 mm a line pair.
        3 => ink([20, 20, 24], 0.5 + 0.5 * (chirp(u) * std::f32::consts::TAU).sin()),
        // Six: a zone plate, one ring per pixel at the edge.
        4 => ink([14, 40, 44], 0.5 + 0.5 * ((u * u + v * v) * 80_000.0).cos()),
        _ => color([200, 196, 188]) * (0.4 + 0.6 * dice(u, v, 4)),
    };
    let rim = PIP as f32;
    let edge = step(rim + 0.0009, 0.0003, pip);
    blend(color([196, 30, 36]), blend(color([246, 244, 238]), printed, edge), step(rim, 0.0003, pip))
}

/// Index of the printed dot along one axis.
fn cell(x: f32) -> i32 {
    (x / DOT).floor() as i32
}

/// A number per dot.
fn dice(u: f32, v: f32, seed: u32) -> f32 {
    unit(mix(mix(cell(u) as u32 ^ seed.wrapping_mul(0x9e37_79b9)) ^ cell(v) as u32))
}

/// Line pairs from the left edge, each a little narrower than the one before.
fn chirp(u: f32) -> f32 {
    let (x, wide, fine) = (u + HALF as f32, 1.0 / 0.003, 1.0 / 0.0005);
    wide * x + (fine - wide) * x * x / (4.0 * HALF as f32)
}
