//! A figurine of an elephant from smoothly joined ellipsoids and cones (distances after Quilez,
//! "Distance functions"), under a glaze. Built in a frame where the elephant is about 1.6 long and
//! looks along +x, then scaled to the desk.

use super::clay::{chain, ellipsoid, smooth_min};
use crate::isosurface::{Grid, extract};
use crate::material::{Finish, Vec3};
use crate::shape::{MeshBuilder, P};
use crate::texture_field::{blend, color, fractal, noise, step, stripe, wrap};
use nalgebra::Point3;

const BODY: u8 = 0;
const TUSK: u8 = 1;
const EYE: u8 = 2;
const EAR: u8 = 3;

/// GGX roughness of the polish, and its index of refraction.
const ROUGHNESS: f32 = 0.13;
const INDEX: f32 = 1.52;

/// Metres per modelling unit.
const SCALE: f64 = 0.13;
/// Grid cells per modelling unit.
const CELLS: f64 = 52.0;
/// Where the body's middle lies along x: put onto the turntable's axis.
const MIDDLE: f64 = 0.19;

/// Builds the mesh.
pub(crate) fn build() -> MeshBuilder {
    let grid = Grid::around(P::new(-0.72, -0.62, 0.0), P::new(1.1, 0.62, 1.12), 1.0 / CELLS);
    let mut b = extract(&grid, surface);
    let part_of = |f: usize| part_at(nalgebra::center(&b.mesh.corners(f)[0], &b.mesh.corners(f)[1]).coords);
    b.parts = (0..b.mesh.faces.len()).map(part_of).collect();
    let bottom = b.mesh.positions.iter().fold(f64::INFINITY, |m, p| m.min(p.z));
    for p in &mut b.mesh.positions {
        let q = P::new(p.x - MIDDLE, p.y, p.z - bottom) * SCALE;
        *p = Point3::from(q.map(|c| f64::from(c as f32)));
    }
    b
}

/// What the parts are made of, in their order. Body and ears are jade: light goes about a millimetre
/// between scatterers. One polish over everything, rough enough for highlights a few degrees wide that
/// move with the view.
pub(crate) fn finishes() -> Vec<Finish> {
    let (jade, opaque) = (Finish::translucent(ROUGHNESS, INDEX, 1.2e-3), Finish::glazed(ROUGHNESS, INDEX));
    vec![jade.clone(), opaque.clone(), opaque, jade]
}

/// Distance to the whole figure; tusks grow out of the cheek in a soft collar.
fn surface(p: P) -> f64 {
    let [body, tusk, eye, _] = distances(p);
    smooth_min(body, tusk, 0.03).min(eye)
}

/// Distances to body, tusks, eyes and ears, in this order of parts.
fn distances(p: P) -> [f64; 4] {
    // The figure is its own mirror image but for the tail, which lies in the plane of symmetry.
    let q = P::new(p.x, p.y.abs(), p.z);
    let tusk = chain(
        q,
        &[
            (0.60, 0.105, 0.64, 0.041),
            (0.674, 0.150, 0.546, 0.038),
            (0.757, 0.168, 0.500, 0.034),
            (0.849, 0.162, 0.490, 0.028),
            (0.95, 0.140, 0.515, 0.020),
        ],
        0.01,
    );
    let eye = (q - P::new(0.652, 0.118, 0.80)).norm() - 0.026;
    let ear = ear(q);
    let body = smooth_min(body(q), ear, 0.035);
    // Which of body and ear is nearer only matters for paint: both carry the joint surface.
    [body, tusk, eye, ear]
}

fn body(q: P) -> f64 {
    let trunk_ellipsoid = ellipsoid(q, P::new(-0.05, 0.0, 0.60), P::new(0.47, 0.29, 0.30));
    let shoulders = ellipsoid(q, P::new(0.20, 0.0, 0.66), P::new(0.25, 0.245, 0.27));
    let rump = ellipsoid(q, P::new(-0.31, 0.0, 0.60), P::new(0.24, 0.255, 0.28));
    let torso = smooth_min(smooth_min(trunk_ellipsoid, shoulders, 0.08), rump, 0.08);
    let skull = ellipsoid(q, P::new(0.52, 0.0, 0.77), P::new(0.19, 0.165, 0.21));
    let dome = (q - P::new(0.51, 0.065, 0.90)).norm() - 0.095;
    let head = smooth_min(skull, dome, 0.06);
    let trunk = chain(
        q,
        &[
            (0.62, 0.0, 0.74, 0.115),
            (0.73, 0.0, 0.60, 0.088),
            (0.775, 0.0, 0.44, 0.070),
            (0.785, 0.0, 0.28, 0.058),
            (0.825, 0.0, 0.165, 0.050),
            (0.905, 0.0, 0.125, 0.045),
            (0.975, 0.0, 0.175, 0.041),
            (0.99, 0.0, 0.26, 0.037),
        ],
        0.03,
    );
    let fore = leg(q, P::new(0.25, 0.155, 0.0));
    let hind = leg(q, P::new(-0.33, 0.155, 0.0));
    let tail = chain(
        q,
        &[(-0.52, 0.0, 0.70, 0.035), (-0.60, 0.0, 0.58, 0.026), (-0.625, 0.0, 0.44, 0.022), (-0.62, 0.0, 0.36, 0.022)],
        0.02,
    );
    let tuft = ellipsoid(q, P::new(-0.62, 0.0, 0.31), P::new(0.034, 0.034, 0.065));
    let all = [(head, 0.09), (trunk, 0.06), (fore, 0.07), (hind, 0.07), (smooth_min(tail, tuft, 0.02), 0.03)];
    let joined = all.into_iter().fold(torso, |d, (part, k)| smooth_min(d, part, k));
    // Standing on the table: cut flat a little above the lowest point of the feet.
    joined.max(0.02 - q.z)
}

fn leg(q: P, foot: P) -> f64 {
    let shaft = chain(
        q,
        &[
            (foot.x, foot.y * 0.9, 0.52, 0.145),
            (foot.x + 0.005, foot.y, 0.26, 0.108),
            (foot.x + 0.01, foot.y, 0.08, 0.112),
        ],
        0.03,
    );
    let sole = ellipsoid(q, P::new(foot.x + 0.02, foot.y, 0.05), P::new(0.132, 0.124, 0.07));
    smooth_min(shaft, sole, 0.04)
}

/// A fan of cartilage: a flat, slightly cupped ellipsoid, hinged behind the cheek.
fn ear(q: P) -> f64 {
    let (out, back) = (0.74_f64, -0.673_f64);
    let along = P::new(back, out, 0.0);
    let across = P::new(out, -back, 0.0);
    let hinge = P::new(0.47, 0.135, 0.80);
    let r = q - hinge;
    let (s, t, z) = (r.dot(&along), r.dot(&across), r.z);
    // Cupped forward, and wider above than below, as of an African elephant.
    let cup = t - 1.1 * (s - 0.16).powi(2) - 0.25 * z * z;
    let outline = ellipsoid(P::new(s - 0.165, 0.0, z), P::zeros(), P::new((0.17 + 0.10 * z).max(0.1), 1.0, 0.23));
    // A slab with a round rim, thicker than the cells of the mesh (Quilez' extrusion).
    let side = cup.abs() - 0.006;
    outline.max(side).min(0.0) + outline.max(0.0).hypot(side.max(0.0)) - 0.022
}

fn part_at(p: P) -> u8 {
    let [body, tusk, eye, ear] = distances(p);
    if eye < body && eye < tusk {
        EYE
    } else if tusk < body {
        TUSK
    } else if ear < 0.006 {
        EAR
    } else {
        BODY
    }
}

/// Celadon glaze with painted cloth, brow ornament, anklets and toenails.
pub(crate) fn albedo(p: Vec3, part: u8) -> Vec3 {
    let s = SCALE as f32;
    let q = Vec3::new(p.x / s + MIDDLE as f32, p.y / s, p.z / s + 0.02);
    match part {
        TUSK => blend(color([246, 238, 216]), color([214, 190, 140]), 0.6 * fractal(q * 14.0, 3, 4)),
        EYE => color([16, 13, 12]),
        EAR => blend(jade(q), color([226, 150, 134]), 0.35 * stripe(ear_rim(q), 0.10, 0.12)),
        _ => painted_body(q),
    }
}

/// How far a point of the ear lies from its middle.
fn ear_rim(q: Vec3) -> f32 {
    let r = Vec3::new(q.x - 0.34, q.y.abs() - 0.235, (q.z - 0.76) * 0.8);
    r.norm()
}

/// Pale green, pooling darker in clouds, with fine crackle.
fn jade(q: Vec3) -> Vec3 {
    let cloud = fractal(q * 3.2, 5, 9);
    let tone = blend(color([82, 142, 112]), color([164, 204, 168]), step(0.5, 0.55, cloud));
    let crackle = 1.0 - (2.0 * fractal(q * 16.0, 4, 21) - 1.0).abs();
    let tone = blend(tone, color([58, 104, 84]), 0.55 * step(0.955, 0.04, crackle));
    tone * (0.93 + 0.07 * noise(q * 120.0, 33))
}

fn painted_body(q: Vec3) -> Vec3 {
    let mut c = jade(q);
    let gold = gilt(q);
    // Toenails on the front of each foot, anklets above.
    if q.z < 0.30 && q.x < 0.55 {
        c = blend(c, gold, stripe(q.z - 0.20, 0.022, 0.006));
        c = blend(c, color([150, 36, 44]), stripe(q.z - 0.20, 0.009, 0.004));
        let foot = if q.x > 0.0 { 0.27 } else { -0.31 };
        let angle = (q.y.abs() - 0.155).atan2(q.x - foot);
        let nail = (wrap(angle, 0.62) / 0.21).powi(2) + ((q.z - 0.055) / 0.036).powi(2);
        c = blend(c, color([240, 226, 196]), stripe(angle, 1.3, 0.05) * (1.0 - step(1.0, 0.25, nail)));
    }
    // Brow: a red drop in gold.
    if q.x > 0.55 && q.z > 0.72 {
        let drop = (q.y.powi(2) + ((q.z - 0.86) * 0.62).powi(2)).sqrt();
        c = blend(c, gold, 1.0 - step(0.062, 0.008, drop));
        c = blend(c, color([168, 32, 44]), 1.0 - step(0.046, 0.008, drop));
        c = blend(c, gold, 1.0 - step(0.016, 0.006, drop));
    }
    cloth(q, c, gold)
}

fn gilt(q: Vec3) -> Vec3 {
    blend(color([176, 124, 40]), color([230, 184, 84]), noise(q * 60.0, 51))
}

/// The saddle cloth: crimson with lozenges of flowers, blue border between gold cords, a fringe.
fn cloth(q: Vec3, under: Vec3, gold: Vec3) -> Vec3 {
    // Coordinates on the cloth: along the back, and around the belly by arc length.
    let u = q.x + 0.06;
    let v = q.y.atan2(q.z - 0.58) * 0.30;
    let (half_u, half_v) = (0.225, 0.47);
    let edge = (u.abs() - half_u).max(v.abs() - half_v);
    let fringe = stripe(v.abs() - half_v - 0.02, 0.022, 0.004)
        * stripe(u, half_u, 0.004)
        * stripe(wrap(u, 0.018), 0.0055, 0.003);
    let mut c = blend(under, gold, fringe);
    if edge > 0.01 {
        return c;
    }
    let (du, dv) = (wrap(u, 0.115), wrap(v, 0.115));
    let flower = (du * du + dv * dv).sqrt() + 0.010 * (6.0 * dv.atan2(du)).cos();
    let lattice = stripe(wrap(u + v, 0.115), 0.0, 0.004).max(stripe((du.abs() + dv.abs()) - 0.0575, 0.004, 0.004));
    let mut field = blend(color([142, 20, 34]), color([172, 34, 44]), noise(q * 40.0, 61));
    field = blend(field, gold, lattice);
    field = blend(field, color([238, 222, 190]), 1.0 - step(0.030, 0.005, flower));
    field = blend(field, color([28, 58, 120]), 1.0 - step(0.014, 0.005, flower));
    let border = blend(color([24, 46, 104]), color([236, 220, 186]), {
        let (bu, bv) = (wrap(u, 0.045), wrap(v, 0.047));
        1.0 - step(
            0.011,
            0.004,
            if u.abs() - half_u > v.abs() - half_v {
                bv.hypot(u.abs() - half_u + 0.034)
            } else {
                bu.hypot(v.abs() - half_v + 0.034)
            },
        )
    });
    let inside = blend(field, border, step(-0.058, 0.003, edge));
    let cord = stripe(edge + 0.006, 0.006, 0.003).max(stripe(edge + 0.060, 0.005, 0.003));
    c = blend(c, blend(inside, gold, cord), 1.0 - step(0.0, 0.004, edge));
    c
}
