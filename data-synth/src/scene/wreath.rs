//! A wreath of straw with flowers and a bow, standing upright, genus one: thousands of stalks thinner than
//! a pixel of a 640 × 480 picture, wound on a ring, many ends sticking out. No silhouette resolves it.
//!
//! Every stalk, petal and leaf is a closed piece of its own; they run into each other. The ring lies in
//! the plane x = 0 and is seen along x.

use super::chance::Chance;
use crate::material::{Finish, Vec3};
use crate::shape::{MeshBuilder, P, across, frames};
use crate::texture_field::{blend, color, fractal, noise};
use std::f64::consts::{PI, TAU};

/// Stalks come in this many shades, each a part.
const SHADES: u8 = 6;
const CORE: u8 = SHADES;
const DAISY: u8 = CORE + 1;
const DAISY_EYE: u8 = CORE + 2;
const POPPY: u8 = CORE + 3;
const POPPY_EYE: u8 = CORE + 4;
const CORNFLOWER: u8 = CORE + 5;
const LEAF: u8 = CORE + 6;
const RIBBON: u8 = CORE + 7;

/// Of the ring, and of the bundle of straw.
const MAJOR: f64 = 0.088;
const MINOR: f64 = 0.0215;
const STALKS: usize = 6400;

/// Builds the mesh.
pub(crate) fn build() -> MeshBuilder {
    let mut b = MeshBuilder::default();
    let mut chance = Chance::new(0x57ab);
    core(&mut b);
    for _ in 0..STALKS {
        stalk(&mut b, &mut chance);
    }
    twine(&mut b);
    garland(&mut b, &mut chance);
    bow(&mut b);
    b.set_down()
}

/// What the parts are made of: straw has a sheen, ribbon is satin, petals are dull.
pub(crate) fn finishes() -> Vec<Finish> {
    let finish = |part: u8| match part {
        CORE | DAISY_EYE | POPPY_EYE | CORNFLOWER | DAISY => Finish::Matt,
        RIBBON => Finish::glazed(0.25, 1.5),
        _ => Finish::glazed(0.4, 1.45),
    };
    (0..=RIBBON).map(finish).collect()
}

/// A point off the ring's axis: `turn` around the ring from the top, `roll` around the bundle from the
/// front, at `r` from the bundle's middle. Also the outward direction there.
fn ring(turn: f64, roll: f64, r: f64) -> (P, P) {
    let radial = P::new(0.0, turn.sin(), turn.cos());
    let out = P::x() * roll.cos() + radial * roll.sin();
    (radial * MAJOR + out * r, out)
}

/// The direction in which `turn` grows.
fn onward(turn: f64) -> P {
    P::new(0.0, turn.cos(), -turn.sin())
}

/// What is seen between the stalks.
fn core(b: &mut MeshBuilder) {
    b.part = CORE;
    let (n, m) = (96, 20);
    let circle = |k: usize| {
        let turn = TAU * k as f64 / n as f64;
        (0..m).map(move |i| ring(turn, TAU * i as f64 / m as f64, 0.93 * MINOR).0.into())
    };
    let mut rings: Vec<Vec<u32>> = (0..n).map(|k| b.ring(circle(k))).collect();
    rings.push(rings[0].clone());
    // `turn` runs clockwise seen from +x, where `roll` starts: loops face backward, and so do walls.
    rings.reverse();
    b.loft(&rings);
}

/// A stalk wound around the bundle at a small angle, its far end often off on its own.
fn stalk(b: &mut MeshBuilder, chance: &mut Chance) {
    const STEPS: usize = 7;
    b.part = chance.below(SHADES);
    let (turn, roll) = (chance.between(0.0, TAU), chance.between(0.0, TAU));
    let length = chance.between(0.028, 0.075);
    let pitch = chance.between(0.1, 0.5);
    let depth = MINOR * (0.955 + 0.10 * chance.unit());
    // One in four leaves the bundle, by up to most of its radius.
    let stray = if chance.unit() < 0.25 { chance.between(0.2, 1.6) } else { chance.unit() * 0.06 };
    let (lift, bend) = (stray * 0.0105, chance.around(0.5));
    let path: Vec<P> = (0..=STEPS)
        .map(|k| {
            let t = k as f64 / STEPS as f64;
            let s = length * (t - 0.5);
            let off = lift * (2.0 * t - 1.0).max(0.0).powf(1.6) + 0.0009 * (PI * t).sin();
            let roll = roll + (pitch * s + bend * 0.004 * (TAU * t).sin()) / MINOR;
            ring(turn + s / MAJOR, roll, depth + off).0
        })
        .collect();
    let radius = chance.between(0.00010, 0.00017);
    b.tube(&path, P::x(), 3, |k, angle| {
        let r = radius * (1.0 - 0.45 * k as f64 / STEPS as f64);
        [r * angle.cos(), r * angle.sin()]
    });
}

/// Jute that holds the bundle.
fn twine(b: &mut MeshBuilder) {
    b.part = CORE;
    const WINDS: usize = 15;
    const STEPS: usize = 36;
    for k in 0..WINDS {
        let start = TAU * (k as f64 + 0.3) / WINDS as f64;
        let at = |i: usize| {
            let t = i as f64 / STEPS as f64;
            ring(start + 0.10 * t, TAU * 1.02 * t, 1.045 * MINOR).0
        };
        let path: Vec<P> = (0..=STEPS).map(at).collect();
        b.tube(&path, P::x(), 6, |i, angle| {
            let r = 0.00055 * (1.0 + 0.25 * (3.0 * angle + 1.7 * i as f64).sin());
            [r * angle.cos(), r * angle.sin()]
        });
    }
}

/// Flowers and leaves from the lower left to the right, thinning out.
fn garland(b: &mut MeshBuilder, chance: &mut Chance) {
    // (turn in degrees from the top, roll from the front, kind, size)
    const FLOWERS: [(f64, f64, u8, f64); 17] = [
        (232.0, 10.0, POPPY, 0.021),
        (256.0, -28.0, DAISY, 0.0165),
        (252.0, 48.0, DAISY, 0.0150),
        (207.0, 40.0, DAISY, 0.0165),
        (205.0, -30.0, CORNFLOWER, 0.0115),
        (278.0, 18.0, POPPY, 0.0175),
        (272.0, 66.0, CORNFLOWER, 0.0110),
        (300.0, -20.0, DAISY, 0.0150),
        (303.0, 44.0, CORNFLOWER, 0.0110),
        (322.0, 12.0, CORNFLOWER, 0.0105),
        (338.0, 30.0, DAISY, 0.0125),
        (180.0, 5.0, POPPY, 0.0185),
        (157.0, 40.0, CORNFLOWER, 0.0110),
        (155.0, -24.0, DAISY, 0.0150),
        (132.0, 14.0, DAISY, 0.0130),
        (114.0, 32.0, CORNFLOWER, 0.0100),
        (229.0, 70.0, CORNFLOWER, 0.0110),
    ];
    for (turn, roll, kind, size) in FLOWERS {
        let (turn, roll) = (turn.to_radians(), roll.to_radians());
        let (at, out) = ring(turn, roll, MINOR * 1.06);
        for side in [-1.0, 1.0] {
            leaf(b, at, (onward(turn) * side + out * 0.25 + chance.jitter(0.5)).normalize(), out, chance);
        }
        let facing = (out + P::x() * 0.5 + chance.jitter(0.2)).normalize();
        match kind {
            DAISY => daisy(b, at + out * 0.002, facing, size, chance),
            POPPY => poppy(b, at, facing, size, chance),
            _ => cornflower(b, at + out * 0.002, facing, size, chance),
        }
    }
    for k in 0..30 {
        let turn = (108.0 + 236.0 * f64::from(k) / 29.0).to_radians();
        let (at, out) = ring(turn, chance.between(-0.9, 1.2), MINOR);
        let towards = (onward(turn) * chance.around(1.0) + out * 0.15 + chance.jitter(0.4)).normalize();
        leaf(b, at, towards, out, chance);
    }
}

/// A petal or leaf from `root` along `along`, seen from `up`: `width(t)` on either side and `height(u, t)` up.
struct Blade {
    root: P,
    along: P,
    up: P,
    length: f64,
}

impl Blade {
    fn build(
        &self,
        b: &mut MeshBuilder,
        cells: [usize; 2],
        width: impl Fn(f64) -> f64,
        height: impl Fn(f64, f64) -> f64,
    ) {
        let up = across(self.up, self.along);
        let right = self.along.cross(&up);
        b.sheet(cells, 0.00013, |u, t| {
            let side = 2.0 * u - 1.0;
            self.root
                + self.along * (self.length * t)
                + right * (side * width(t.clamp(0.0, 1.0)))
                + up * height(side, t)
        });
    }
}

/// Half width of an oval blade with ends that are not quite points.
fn oval(t: f64, half: f64, fullest: f64) -> f64 {
    let s = t.powf((0.5_f64).ln() / fullest.ln());
    half * (0.10 + 0.90 * (PI * s).sin().max(0.0).powf(0.75))
}

fn leaf(b: &mut MeshBuilder, root: P, along: P, up: P, chance: &mut Chance) {
    // Lies close to the bundle, under the flowers.
    let along = (across(along, up) + up * 0.12).normalize();
    b.part = LEAF;
    let (length, curl) = (chance.between(0.014, 0.024), chance.between(0.1, 0.5));
    let half = length * chance.between(0.15, 0.21);
    let blade = Blade { root, along, up, length };
    // Folded along the midrib, wavy at the edge, the tip bent back.
    blade.build(
        b,
        [4, 8],
        |t| oval(t, half, 0.42),
        |u, t| half * (0.55 * u.abs() * (1.0 - 0.6 * t) + 0.15 * u * (9.0 * t).sin()) - curl * length * (t - 0.3) * t,
    );
}

fn daisy(b: &mut MeshBuilder, at: P, facing: P, size: f64, chance: &mut Chance) {
    let [right, up] = frames(&[at, at + facing], P::z())[0];
    for layer in 0..2 {
        for k in 0..11 {
            b.part = DAISY;
            let angle = TAU * (f64::from(k) + 0.5 * f64::from(layer)) / 11.0 + chance.around(0.07);
            let rise = 0.10 + 0.16 * f64::from(layer) + chance.around(0.07);
            let along = (right * angle.cos() + up * angle.sin() + facing * rise).normalize();
            let length = size * chance.between(0.74, 0.86);
            let root = at + facing * 0.0008 + along * (0.14 * size);
            let half = 0.155 * size;
            Blade { root, along, up: facing, length }.build(
                b,
                [3, 6],
                |t| oval(t, half, 0.62),
                |u, t| half * (0.25 * u * u) - 0.25 * length * t * t * t + 0.00018 * (3.0 * PI * u).cos(),
            );
        }
    }
    eye(b, DAISY_EYE, at + facing * 0.0016, facing, 0.27 * size);
}

/// A domed heart of small knobs.
fn eye(b: &mut MeshBuilder, part: u8, at: P, facing: P, radius: f64) {
    b.part = part;
    b.ball(14, |d| {
        let knob = 1.0 + 0.07 * (16.0 * d.x).sin() * (16.0 * d.y).sin() * (16.0 * d.z).cos();
        let p = d * (radius * knob);
        at + p - facing * (0.45 * p.dot(&facing))
    });
}

fn poppy(b: &mut MeshBuilder, at: P, facing: P, size: f64, chance: &mut Chance) {
    let [right, up] = frames(&[at, at + facing], P::z())[0];
    for layer in 0..2 {
        for k in 0..4 {
            b.part = POPPY;
            let angle = TAU * (f64::from(k) + 0.5 * f64::from(layer)) / 4.0 + chance.around(0.1);
            let rise = 0.35 + 0.38 * f64::from(layer);
            let along = (right * angle.cos() + up * angle.sin() + facing * rise).normalize();
            let length = size * (0.95 - 0.15 * f64::from(layer));
            let (half, phase) = (0.62 * size, chance.between(0.0, 6.0));
            Blade { root: at + facing * 0.001, along, up: facing, length }.build(
                b,
                [8, 8],
                |t| oval(0.04 + 0.9 * t, half, 0.6),
                |u, t| {
                    0.30 * size * u * u * t + 0.16 * size * (t - 0.2) * t - 0.3 * size * t.powi(4)
                        + 0.035 * size * t * (5.0 * u + phase).sin() * (4.0 * t + phase).cos()
                },
            );
        }
    }
    eye(b, POPPY_EYE, at + facing * (0.22 * size), facing, 0.19 * size);
    for k in 0..16 {
        let angle = TAU * f64::from(k) / 16.0;
        let along = (right * angle.cos() + up * angle.sin()) * (0.30 * size);
        let foot = at + facing * (0.12 * size);
        let path = [foot, foot + along * 0.6 + facing * (0.16 * size), foot + along + facing * (0.28 * size)];
        b.tube(&path, facing, 3, |k, a| {
            let r = if k == 2 { 0.0006 } else { 0.00018 };
            [r * a.cos(), r * a.sin()]
        });
    }
}

fn cornflower(b: &mut MeshBuilder, at: P, facing: P, size: f64, chance: &mut Chance) {
    let [right, up] = frames(&[at, at + facing], P::z())[0];
    for layer in 0..3 {
        let count = 9 - 2 * layer;
        for k in 0..count {
            b.part = CORNFLOWER;
            let angle = TAU * (f64::from(k) + 0.4 * f64::from(layer)) / f64::from(count) + chance.around(0.12);
            let rise = 0.12 + 0.55 * f64::from(layer) + chance.around(0.1);
            let along = (right * angle.cos() + up * angle.sin() + facing * rise).normalize();
            let length = size * (1.0 - 0.18 * f64::from(layer)) * chance.between(0.9, 1.1);
            Blade { root: at, along, up: facing, length }.build(
                b,
                [3, 5],
                // Widens into a toothed fan.
                |t| size * (0.04 + 0.20 * t.powf(1.4)),
                |u, t| 0.10 * size * t * (1.5 * PI * u).cos(),
            );
        }
    }
}

/// A satin bow above, with two tails.
fn bow(b: &mut MeshBuilder) {
    b.part = RIBBON;
    let (knot, _) = ring(0.35, 0.25, MINOR * 1.16);
    let tilt = 0.35_f64;
    let level = P::new(0.0, tilt.cos(), -tilt.sin());
    let up = P::x().cross(&level);
    for side in [-1.0, 1.0] {
        b.sheet([4, 30], 0.00018, |u, t| {
            let angle = TAU * t;
            let (reach, open) = (0.5 - 0.5 * angle.cos(), angle.sin());
            let width = 0.0098 * (0.30 + 0.65 * reach);
            let middle = level * (side * 0.036 * reach)
                + P::x() * (0.0115 * open + 0.004 * reach)
                + up * (0.015 * reach + 0.0030 * open);
            knot + middle + up * ((2.0 * u - 1.0) * width) + P::x() * (0.0008 * (9.0 * u + 5.0 * t).sin() * reach)
        });
        b.sheet([4, 26], 0.00018, |u, t| {
            let fall = up * -1.0 + level * (side * 0.42);
            let wave = 0.0042 * (7.5 * t + side).sin() * t;
            // The end is cut to a swallow's tail.
            let cut = 0.010 * t * (2.0 * u - 1.0).abs();
            let middle = fall * (0.058 * t + cut) + P::x() * (0.0045 * (PI * t).sin() + wave + 0.002);
            knot + middle + level.lerp(&up, 0.2 * side * t).normalize() * ((2.0 * u - 1.0) * (0.0045 + 0.004 * t))
        });
    }
    b.ball(10, |d| {
        let fold = 1.0 + 0.08 * (9.0 * d.y).sin();
        knot + P::x() * (0.003 + 0.0048 * d.x) + level * (0.0062 * d.y * fold) + up * (0.0068 * d.z * fold)
    });
    // The band around the bundle under the knot.
    b.sheet([4, 36], 0.0002, |u, t| {
        let turn = 0.35 + (2.0 * u - 1.0) * 0.055;
        ring(turn, 0.25 - TAU * t, 1.10 * MINOR).0
    });
}

/// Straw in shades by part, petals veined along themselves as far as noise can.
pub(crate) fn albedo(p: Vec3, part: u8) -> Vec3 {
    const STRAW: [[u8; 3]; SHADES as usize] =
        [[222, 190, 118], [206, 168, 92], [236, 212, 150], [188, 148, 82], [214, 184, 104], [170, 136, 84]];
    match part {
        CORE => blend(color([128, 92, 50]), color([176, 138, 82]), noise(p * 900.0, 3)),
        DAISY => blend(color([250, 246, 236]), color([228, 222, 206]), noise(p * 600.0, 5)),
        DAISY_EYE => blend(color([248, 190, 30]), color([206, 132, 14]), noise(p * 1500.0, 7)),
        POPPY => blend(color([206, 28, 22]), color([236, 66, 38]), fractal(p * 260.0, 2, 9)),
        POPPY_EYE => color([34, 28, 36]),
        CORNFLOWER => blend(color([48, 62, 190]), color([104, 118, 232]), noise(p * 420.0, 11)),
        LEAF => blend(color([52, 92, 38]), color([112, 146, 66]), fractal(p * 230.0, 2, 13)),
        RIBBON => color([158, 26, 44]) * (0.92 + 0.08 * noise(p * 1600.0, 15)),
        _ => color(STRAW[usize::from(part.min(SHADES - 1))]) * (0.86 + 0.14 * noise(p * 420.0, 17)),
    }
}
