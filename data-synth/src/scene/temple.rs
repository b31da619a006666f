//! A peripteral temple, 6 × 4 columns, one closed manifold: three steps, fluted columns between a
//! floor and a ceiling with matching holes, a cella with a door, entablature, gable roof.
//! Proportions are Doric, loosely after the temple of Concordia at Akragas.

use crate::material::Vec3;
use crate::shape::MeshBuilder;
use crate::texture_field::{blend, color, fractal, noise, step, stripe, wrap};
use std::f64::consts::TAU;

const STEPS: u8 = 0;
const COLUMNS: u8 = 1;
const ENTABLATURE: u8 = 2;
const ROOF: u8 = 3;
const TYMPANUM: u8 = 4;
const CELLA: u8 = 5;
const DOOR: u8 = 6;

/// Columns along x and y.
const COUNT: [usize; 2] = [6, 4];
/// Between column axes.
const BAY: f64 = 0.032;
const FLOOR_Z: f64 = 0.015;
const CEILING_Z: f64 = 0.086;
/// Points around a column: three per flute, twenty flutes, as Doric columns have.
const AROUND: usize = 60;
/// Half sizes of the architrave.
const BEAM: [f64; 2] = [0.0935, 0.0615];

/// Floor or ceiling: the lattice between the columns with what it leaves open.
struct Level {
    nodes: Vec<u32>,
    outline: Vec<u32>,
    court: Vec<u32>,
}

/// Builds the mesh.
pub(crate) fn build() -> MeshBuilder {
    let mut b = MeshBuilder { part: STEPS, ..MeshBuilder::default() };
    let platform = steps(&mut b);
    let floor = level(&mut b, FLOOR_Z);
    let ceiling = level(&mut b, CEILING_Z);
    b.annulus(&platform, &floor.outline);
    b.part = ENTABLATURE;
    let beam = b.rectangle(BEAM, CEILING_Z);
    b.annulus_reversed(&beam, &ceiling.outline);
    colonnade(&mut b, &floor, &ceiling);
    cella(&mut b, &floor, &ceiling);
    let eaves = entablature(&mut b, beam);
    roof(&mut b, &eaves);
    b.without_strays()
}

fn steps(b: &mut MeshBuilder) -> Vec<u32> {
    let profile = [(0.012, 0.0), (0.012, 0.005), (0.006, 0.005), (0.006, 0.01), (0.0, 0.01), (0.0, FLOOR_Z)];
    let rings: Vec<_> = profile.iter().map(|&(out, z)| b.rectangle([0.099 + out, 0.067 + out], z)).collect();
    b.cap_reversed(&rings[0]);
    b.loft(&rings);
    rings[rings.len() - 1].clone()
}

/// Lattice nodes halfway between columns, and the loops around all and around the inner court.
fn level(b: &mut MeshBuilder, z: f64) -> Level {
    let [nx, ny] = COUNT;
    let at = |i: usize, n: usize| (i as f64 - n as f64 / 2.0) * BAY;
    let nodes = b.ring((0..=ny).flat_map(|j| (0..=nx).map(move |i| [at(i, nx), at(j, ny), z])));
    let around = |lo: usize| loop_of(&nodes, [lo, lo], [nx - lo, ny - lo]);
    Level { outline: around(0), court: around(1), nodes }
}

/// The lattice nodes around a block of cells, counter-clockwise from above.
fn loop_of(nodes: &[u32], low: [usize; 2], high: [usize; 2]) -> Vec<u32> {
    let node = |i: usize, j: usize| nodes[j * (COUNT[0] + 1) + i];
    let south = (low[0]..high[0]).map(|i| node(i, low[1]));
    let east = (low[1]..high[1]).map(|j| node(high[0], j));
    let north = (low[0] + 1..=high[0]).rev().map(|i| node(i, high[1]));
    let west = (low[1] + 1..=high[1]).rev().map(|j| node(low[0], j));
    south.chain(east).chain(north).chain(west).collect()
}

fn colonnade(b: &mut MeshBuilder, floor: &Level, ceiling: &Level) {
    let [nx, ny] = COUNT;
    for (i, j) in (0..ny).flat_map(|j| (0..nx).map(move |i| (i, j))) {
        if i > 0 && i + 1 < nx && j > 0 && j + 1 < ny {
            continue;
        }
        let center = [(i as f64 + 0.5 - nx as f64 / 2.0) * BAY, (j as f64 + 0.5 - ny as f64 / 2.0) * BAY];
        let (foot, head) = column(b, center);
        b.part = STEPS;
        b.annulus(&loop_of(&floor.nodes, [i, j], [i + 1, j + 1]), &foot);
        b.part = ENTABLATURE;
        b.annulus_reversed(&loop_of(&ceiling.nodes, [i, j], [i + 1, j + 1]), &head);
    }
}

/// A Doric column; returns the loops where it meets floor and ceiling.
fn column(b: &mut MeshBuilder, center: [f64; 2]) -> (Vec<u32>, Vec<u32>) {
    b.part = COLUMNS;
    let mut rings = vec![b.ring(circle(center, 0.0088, 0.0, FLOOR_Z))];
    // Shaft with entasis: it thins to 0.78, faster towards the top.
    for k in 0..=8 {
        let t = f64::from(k) / 8.0;
        let radius = 0.0087 * (1.0 - 0.12 * t - 0.10 * t * t);
        rings.push(b.ring(circle(center, radius, 0.075, FLOOR_Z + 0.0006 + 0.0594 * t)));
    }
    // Neck and echinus.
    for (radius, z) in [(0.0068, 0.0758), (0.0072, 0.0764), (0.0088, 0.0786), (0.0098, 0.0802), (0.0099, 0.0812)] {
        rings.push(b.ring(circle(center, radius, 0.0, z)));
    }
    b.loft(&rings);
    // Abacus.
    let [x, y] = center;
    let h = 0.0106;
    let square = |z: f64| [[x - h, y - h, z], [x + h, y - h, z], [x + h, y + h, z], [x - h, y + h, z]];
    let (under, head) = (b.ring(square(0.0812)), b.ring(square(CEILING_Z)));
    b.annulus_reversed(&under, &rings[rings.len() - 1]);
    b.walls(&under, &head);
    (rings.swap_remove(0), head)
}

/// A circle with flutes as deep as `flute` of its radius.
fn circle(center: [f64; 2], radius: f64, flute: f64, z: f64) -> impl Iterator<Item = [f64; 3]> {
    (0..AROUND).map(move |i| {
        let r = if i % 3 == 0 { radius } else { radius * (1.0 - flute) };
        let (s, c) = (TAU * i as f64 / AROUND as f64).sin_cos();
        [center[0] + r * c, center[1] + r * s, z]
    })
}

/// The inner house with a door at either end.
fn cella(b: &mut MeshBuilder, floor: &Level, ceiling: &Level) {
    let half = [0.053, 0.024];
    let (low, high) = (b.rectangle(half, FLOOR_Z), b.rectangle(half, CEILING_Z));
    b.part = STEPS;
    b.annulus(&floor.court, &low);
    b.part = ENTABLATURE;
    b.annulus_reversed(&ceiling.court, &high);
    for side in 0..4 {
        let next = (side + 1) % 4;
        let wall = [low[side], low[next], high[next], high[side]];
        b.part = CELLA;
        if side % 2 == 0 {
            b.cap(&wall);
        } else {
            let sign = if side == 1 { 1.0 } else { -1.0 };
            door(b, &wall, sign * half[0], sign);
        }
    }
}

fn door(b: &mut MeshBuilder, wall: &[u32], x: f64, sign: f64) {
    let frame = |x: f64| {
        let (w, z0, z1) = (0.0085 * sign, FLOOR_Z + 0.0015, FLOOR_Z + 0.044);
        [[x, -w, z0], [x, w, z0], [x, w, z1], [x, -w, z1]]
    };
    let (opening, leaf) = (b.ring(frame(x)), b.ring(frame(x - 0.01 * sign)));
    b.annulus(wall, &opening);
    b.walls(&opening, &leaf);
    b.part = DOOR;
    b.cap(&leaf);
}

/// Architrave, frieze and cornice; returns the edge of the eaves.
fn entablature(b: &mut MeshBuilder, beam: Vec<u32>) -> Vec<u32> {
    b.part = ENTABLATURE;
    let profile = [
        (0.0, 0.0945),
        (0.0012, 0.0945),
        (0.0012, 0.0962),
        (-0.0003, 0.0962),
        (-0.0003, 0.1055),
        (0.0068, 0.1062),
        (0.0068, 0.1092),
        (0.0080, 0.1098),
        (0.0080, 0.1112),
    ];
    let mut rings = vec![beam];
    rings.extend(profile.map(|(out, z)| b.rectangle([BEAM[0] + out, BEAM[1] + out], z)));
    b.loft(&rings);
    rings.swap_remove(rings.len() - 1)
}

/// Tiled slopes and gables with a recessed tympanum.
fn roof(b: &mut MeshBuilder, eaves: &[u32]) {
    let (half_x, half_y, z) = (BEAM[0] + 0.008, BEAM[1] + 0.008, 0.1112);
    let rise = 0.0265;
    b.part = ROOF;
    let ridge = b.ring([[-half_x, 0.0, z + rise], [half_x, 0.0, z + rise]]);
    b.cap(&[eaves[0], eaves[1], ridge[1], ridge[0]]);
    b.cap(&[eaves[2], eaves[3], ridge[0], ridge[1]]);
    for (corners, sign) in [([eaves[1], eaves[2], ridge[1]], 1.0), ([eaves[3], eaves[0], ridge[0]], -1.0)] {
        b.part = ENTABLATURE;
        let inner = |x: f64| {
            let (w, low) = (half_y * 0.78 * sign, z + 0.0022);
            [[x, -w, low], [x, w, low], [x, 0.0, low + rise * 0.78]]
        };
        let (opening, back) = (b.ring(inner(half_x * sign)), b.ring(inner((half_x - 0.006) * sign)));
        b.annulus(&corners, &opening);
        b.walls(&opening, &back);
        b.part = TYMPANUM;
        b.cap(&back);
    }
}

/// Weathered limestone; joints between blocks, painted triglyphs, terracotta tiles.
pub(crate) fn albedo(p: Vec3, normal: Vec3, part: u8) -> Vec3 {
    let base = match part {
        COLUMNS => blend(stone(p), color([196, 178, 148]), 0.2 * stripe(wrap(p.z - 0.015, 0.0198), 0.0002, 0.0003)),
        ENTABLATURE => frieze(p, normal),
        ROOF => tiles(p),
        TYMPANUM => blend(color([150, 62, 48]), stone(p), 0.25 + 0.5 * fractal(p * 160.0, 4, 31)),
        DOOR => blend(
            color([58, 42, 32]),
            color([92, 66, 44]),
            fractal(p.component_mul(&Vec3::new(900.0, 900.0, 60.0)), 3, 3),
        ),
        CELLA => blocks(p, normal, [0.022, 0.0105]),
        _ => blocks(p, normal, [0.026, 0.005]),
    };
    // Soot and rain: darker patches low down and in streaks.
    let grime = fractal(p.component_mul(&Vec3::new(140.0, 140.0, 45.0)), 3, 71);
    base * (1.0 - 0.28 * step(0.60, 0.30, grime))
}

/// Cream limestone: slow hue changes, veins, fine grain and pits.
fn stone(p: Vec3) -> Vec3 {
    let slow = fractal(p * 55.0, 3, 1);
    let grain = noise(p * 700.0, 7) * 0.6 + noise(p * 1400.0, 8) * 0.4;
    let vein = 1.0 - (2.0 * fractal(p * 90.0, 3, 17) - 1.0).abs();
    let tone = blend(color([206, 186, 150]), color([240, 230, 208]), slow);
    let tone = blend(tone, color([176, 148, 108]), 0.5 * step(0.94, 0.08, vein));
    let pits = step(0.82, 0.08, noise(p * 420.0, 23));
    tone * (0.82 + 0.24 * grain).min(1.0) * (1.0 - 0.3 * pits)
}

/// Stone cut into courses of blocks of the given length and height, each of its own shade.
fn blocks(p: Vec3, normal: Vec3, size: [f32; 2]) -> Vec3 {
    if normal.z.abs() > 0.7 {
        let joint = stripe(wrap(p.x, 0.032), 0.0002, 0.0003).max(stripe(wrap(p.y, 0.032), 0.0002, 0.0003));
        return stone(p) * (1.0 - 0.4 * joint);
    }
    let along = if normal.x.abs() > normal.y.abs() { p.y } else { p.x };
    let course = ((p.z - 0.015) / size[1]).floor();
    let shifted = along + 0.5 * size[0] * course.rem_euclid(2.0);
    let block = (shifted / size[0]).floor();
    let shade = 0.86 + 0.14 * noise(Vec3::new(block * 7.3, course * 5.1, 0.5), 41);
    let joint = stripe(wrap(shifted, size[0]), 0.0002, 0.0003).max(stripe(wrap(p.z - 0.015, size[1]), 0.0002, 0.0003));
    stone(p) * shade * (1.0 - 0.45 * joint)
}

/// The entablature; on the frieze faded blue triglyphs between plain metopes.
fn frieze(p: Vec3, normal: Vec3) -> Vec3 {
    let plain = stone(p);
    if !(0.0962..0.1056).contains(&p.z) || normal.z.abs() > 0.5 {
        return plain;
    }
    let along = if normal.x.abs() > normal.y.abs() { p.y } else { p.x };
    let x = wrap(along, 0.016);
    let block = stripe(x, 0.0031, 0.0003);
    let groove = stripe(wrap(x - 0.00105, 0.0021), 0.0003, 0.0003);
    let worn = 0.55 + 0.4 * fractal(p * 300.0, 3, 5);
    let painted = blend(plain, color([70, 96, 128]), worn) * (1.0 - 0.6 * groove);
    blend(plain, painted, block)
}

/// Rows of terracotta tiles with round joints down the slope.
fn tiles(p: Vec3) -> Vec3 {
    let row = ((p.y.abs()) / 0.0085).floor();
    let column = (p.x / 0.0068).floor();
    let shade = noise(Vec3::new(column * 3.7, row * 5.3, p.y.signum() * 9.0), 11);
    let clay = blend(color([158, 84, 54]), color([206, 130, 86]), shade);
    let joint = stripe(wrap(p.x, 0.0068), 0.0006, 0.0008);
    let lap = stripe(wrap(p.y, 0.0085), 0.0004, 0.0006);
    let lichen = step(0.62, 0.1, fractal(p * 210.0, 4, 13));
    let clay = blend(clay, color([168, 160, 120]), 0.6 * lichen) * (0.8 + 0.2 * noise(p * 1800.0, 2));
    clay * (1.0 - 0.55 * joint) * (1.0 - 0.5 * lap)
}
