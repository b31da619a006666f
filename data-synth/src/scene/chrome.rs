//! A silvered teapot with ebony handle and knob: a mirror that shows the room, its own spout and its own
//! handle. One piece, genus one: the spout is stopped a little below its lip.

use crate::material::{Finish, Vec3};
use crate::shape::{Hole, MeshBuilder, P, curve, ear};
use crate::texture_field::{blend, color, fractal};

const METAL: u8 = 0;
const EBONY: u8 = 1;

const AROUND: usize = 192;

/// Builds the mesh.
pub(crate) fn build() -> MeshBuilder {
    let mut b = MeshBuilder { part: METAL, ..MeshBuilder::default() };
    // Foot, belly, shoulder, the groove of the lid, the lid, the knob: (radius, height).
    let body = [
        [0.008, 0.0018],
        [0.020, 0.0018],
        [0.0285, 0.0012],
        [0.0300, 0.0],
        [0.0322, 0.0],
        [0.0326, 0.0022],
        [0.0312, 0.0050],
        [0.0330, 0.0078],
        [0.0405, 0.0125],
        [0.0490, 0.0210],
        [0.0545, 0.0330],
        [0.0555, 0.0440],
        [0.0525, 0.0545],
        [0.0455, 0.0632],
        [0.0370, 0.0690],
        [0.0322, 0.0712],
        [0.0312, 0.0732],
        [0.0304, 0.0736],
        [0.0298, 0.0724],
        [0.0292, 0.0734],
        [0.0270, 0.0762],
        [0.0215, 0.0806],
        [0.0130, 0.0842],
        [0.0062, 0.0856],
        [0.0048, 0.0868],
    ];
    let knob = [
        [0.0048, 0.0868],
        [0.0042, 0.0885],
        [0.0062, 0.0915],
        [0.0085, 0.0955],
        [0.0078, 0.0995],
        [0.0045, 0.1020],
        [0.0012, 0.1026],
    ];
    const STEPS: usize = 6;
    let smooth = |points: &[[f64; 2]]| -> Vec<[f64; 2]> {
        let places: Vec<P> = points.iter().map(|&[r, z]| P::new(r, 0.0, z)).collect();
        curve(&places, STEPS).iter().map(|p| [p.x, p.z]).collect()
    };
    let (body, knob) = (smooth(&body), smooth(&knob));
    let mut rings = b.revolve(&body, AROUND, |_, _| 1.0);
    let middle = |row: usize, rows: usize| 0.5 * (body[row][1] + body[row + rows][1]);
    // The handle's feet on the −y side and the spout's on the +y side.
    let (left, right) = (3 * AROUND / 4, AROUND / 4);
    let holes = [
        Hole { low: [54, left - 7], size: [5, 14] },
        Hole { low: [77, left - 7], size: [5, 14] },
        Hole { low: [55, right - 13], size: [12, 26] },
    ];
    let edges = b.loft_around(&rings, &holes);
    spout(&mut b, &edges[2]);
    b.part = EBONY;
    handle(&mut b, &edges[..2], [middle(54, 5), middle(77, 5)]);
    let above = b.revolve(&knob[1..], AROUND, |_, _| 1.0);
    rings.extend(above);
    b.loft(&rings[body.len() - 1..]);
    let top = P::z() * knob[knob.len() - 1][1];
    b.fan(&rings[rings.len() - 1], top);
    b.part = METAL;
    b.fan_reversed(&rings[0], P::z() * body[0][1]);
    b.without_strays().set_down()
}

fn spout(b: &mut MeshBuilder, edge: &[u32]) {
    let at = |y: f64, z: f64| P::new(0.0, y, z);
    let points = [
        at(0.0543, 0.0340),
        at(0.0640, 0.0378),
        at(0.0740, 0.0458),
        at(0.0816, 0.0566),
        at(0.0885, 0.0676),
        at(0.0970, 0.0752),
    ];
    let path = curve(&points, 14);
    let last = path.len() - 1;
    let half = |k: usize| {
        let t = k as f64 / last as f64;
        let flare = 0.0016 * ((t - 0.86).max(0.0) / 0.14).powi(2);
        [0.0135 * (1.0 - t).powf(1.6) + 0.0062 + flare, 0.0062 * (1.0 - t).powf(1.3) + 0.0058 + flare]
    };
    let lip = b.sleeve(edge, &path, P::x(), 30, half);
    // Over the lip and a little way in.
    let tangent = (path[last] - path[last - 1]).normalize();
    let place = |b: &MeshBuilder, shrink: f64, up: f64| -> Vec<[f64; 3]> {
        let inward = |&v: &u32| {
            let p = b.mesh.positions[v as usize].coords;
            (path[last] + (p - path[last]) * shrink + tangent * up).into()
        };
        lip.iter().map(inward).collect()
    };
    let mut rings = vec![lip.clone()];
    for (shrink, up) in
        [(0.985, 0.0006), (0.93, 0.0009), (0.86, 0.0006), (0.82, -0.0004), (0.76, -0.004), (0.70, -0.009)]
    {
        let points = place(b, shrink, up);
        rings.push(b.ring(points));
    }
    b.loft(&rings);
    b.fan(&rings[rings.len() - 1], path[last] - tangent * 0.009);
}

fn handle(b: &mut MeshBuilder, edges: &[Vec<u32>], [low, high]: [f64; 2]) {
    let foot = |y: f64, z: f64| P::new(0.0, -y, z);
    let [bottom, top] = ear(foot(0.0535, low), foot(0.0462, high), P::new(0.0, -0.043, 0.006), 36);
    let half = |k: usize| [0.0046 + 0.0010 * (k as f64 / 36.0), 0.0038];
    let lower = b.sleeve(&edges[0], &bottom, P::x(), 9, half);
    let upper = b.sleeve(&edges[1], &top, P::x(), 9, half);
    b.join(&upper, &lower);
}

/// What the parts are made of.
pub(crate) fn finishes() -> Vec<Finish> {
    vec![Finish::metal(0.02), Finish::glazed(0.12, 1.5)]
}

/// Silver (Rakić et al. 1998, rounded) and dark wood.
pub(crate) fn albedo(p: Vec3, part: u8) -> Vec3 {
    if part == METAL {
        return Vec3::new(0.95, 0.93, 0.88);
    }
    let grain = fractal(p.component_mul(&Vec3::new(900.0, 500.0, 120.0)), 2, 3);
    blend(color([34, 22, 18]), color([74, 44, 30]), grain)
}
