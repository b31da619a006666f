//! A model cottage: log walls with bark, a shingled roof over an L-shaped plan, a chimney of field
//! stones, moss. Its inner corner lies outside the object and inside every silhouette. All relief is
//! geometry: bark, shingles, stones and moss cushions stand out by 0.3 to 3 mm.
//!
//! Many closed pieces that run into each other, as a model maker glues them; inner faces are never seen.

use super::chance::Chance;
use crate::material::{Finish, Vec3};
use crate::shape::{MeshBuilder, P};
use crate::texture_field::{blend, color, fractal, noise, step, stripe, wrap};

const LOG: u8 = 0;
const STONE: u8 = 1;
const PLANK: u8 = 2;
const MOSS: u8 = 3;
const DOOR: u8 = 4;
const SHUTTER: u8 = 5;
const PANE: u8 = 6;
const IRON: u8 = 7;
const FRAME: u8 = 8;
const POT: u8 = 9;
const CORE: u8 = 10;
const BLOSSOM: u8 = 11;
const LEAF: u8 = 12;
/// Shingles come in this many shades, each a part.
const SHADES: u8 = 5;
const SHINGLE: u8 = 13;

/// Radius of a log, and between log axes.
const LOG_RADIUS: f64 = 0.0069;
const LOG_STEP: f64 = 0.0126;
/// Axis of the lowest logs along x; those along y lie half a step off, as notched logs do.
const LOG_Z: f64 = 0.0175;
const LOGS: usize = 6;
/// Where the two ridges meet, and how far each runs to its gable.
const CORNER: [f64; 2] = [-0.06, 0.04];
const RUN: [f64; 2] = [0.16, 0.12];
/// From ridge to wall, and how far the roof overhangs eaves and gables.
const HALF_SPAN: f64 = 0.04;
const EAVES: f64 = 0.015;
const VERGE: f64 = 0.013;
/// Height of the ridge, and the slope of the roof.
const RIDGE_Z: f64 = 0.137;
const SLOPE: f64 = 1.08;
const GABLE_Z: f64 = 0.086;
/// Cosine and sine of the turn from the plan to the table: the inner corner opens towards +x.
const TURN: [f64; 2] = [0.8, 0.6];

/// A wall of logs on the line from `a` to `b`, seen from `out`, with an opening.
struct Wall {
    a: [f64; 2],
    b: [f64; 2],
    out: [f64; 2],
    openings: Vec<Opening>,
}

/// A door or a window; lengths along the wall from `a`.
#[derive(Clone, Copy)]
struct Opening {
    middle: f64,
    half: f64,
    low: f64,
    high: f64,
    is_door: bool,
}

/// A roof slope falling along `down` from the ridge that leaves the corner along `along`; at distance `d`
/// from the ridge it starts `d · miter` from the corner.
#[derive(Clone, Copy)]
struct Slope {
    along: [f64; 2],
    down: [f64; 2],
    miter: f64,
    run: f64,
}

const SLOPES: [Slope; 4] = [
    Slope { along: [1.0, 0.0], down: [0.0, -1.0], miter: 1.0, run: RUN[0] },
    Slope { along: [0.0, -1.0], down: [1.0, 0.0], miter: 1.0, run: RUN[1] },
    Slope { along: [1.0, 0.0], down: [0.0, 1.0], miter: -1.0, run: RUN[0] },
    Slope { along: [0.0, -1.0], down: [-1.0, 0.0], miter: -1.0, run: RUN[1] },
];

impl Slope {
    /// The point `s` along the ridge, `d` down (measured level), `h` above the deck.
    fn at(&self, s: f64, d: f64, h: f64) -> P {
        let level = |a: usize| CORNER[a] + self.along[a] * s + self.down[a] * d;
        P::new(level(0), level(1), RIDGE_Z - SLOPE * d) + self.normal() * h
    }

    fn normal(&self) -> P {
        P::new(self.down[0] * SLOPE, self.down[1] * SLOPE, 1.0).normalize()
    }

    /// Whether along × down points into the roof: the slab's first side must run the other way.
    fn is_mirrored(&self) -> bool {
        self.along[0] * self.down[1] - self.along[1] * self.down[0] < 0.0
    }

    /// A slab over along × down; `place` maps `[0, 1]²` to top and bottom.
    fn slab(&self, b: &mut MeshBuilder, cells: [usize; 2], place: impl Fn(f64, f64) -> [P; 2]) {
        let mirrored = self.is_mirrored();
        b.slab(cells, |u, v| place(if mirrored { 1.0 - u } else { u }, v));
    }
}

/// Builds the mesh.
pub(crate) fn build() -> MeshBuilder {
    let mut b = MeshBuilder::default();
    let mut chance = Chance::new(0x00c0_77a6);
    core(&mut b);
    for wall in walls() {
        logs(&mut b, &wall, &mut chance);
        plinth(&mut b, &wall, &mut chance);
        for opening in &wall.openings {
            fill(&mut b, &wall, opening, &mut chance);
        }
    }
    gables(&mut b, &mut chance);
    roof(&mut b, &mut chance);
    chimney(&mut b, &mut chance);
    moss(&mut b, &mut chance);
    let [cos, sin] = TURN;
    b.moved(|p| P::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y, p.z))
}

/// What the parts are made of: panes of glass and wet iron shine a little, nothing else does.
pub(crate) fn finishes() -> Vec<Finish> {
    let finish = |part: u8| match part {
        PANE => Finish::glazed(0.06, 1.5),
        IRON => Finish::glazed(0.3, 1.5),
        DOOR | SHUTTER => Finish::glazed(0.4, 1.45),
        _ => Finish::Matt,
    };
    (0..SHINGLE + SHADES).map(finish).collect()
}

fn walls() -> Vec<Wall> {
    let window = |middle| Opening { middle, half: 0.0105, low: 0.037, high: 0.064, is_door: false };
    let door = |middle| Opening { middle, half: 0.0115, low: 0.0118, high: 0.062, is_door: true };
    let wall = |a, b, out, openings| Wall { a, b, out, openings };
    vec![
        wall([-0.02, 0.0], [0.1, 0.0], [0.0, -1.0], vec![window(0.042), window(0.088)]),
        wall([0.1, 0.0], [0.1, 0.08], [1.0, 0.0], vec![window(0.04)]),
        wall([0.1, 0.08], [-0.1, 0.08], [0.0, 1.0], vec![window(0.05), door(0.1), window(0.15)]),
        wall([-0.1, 0.08], [-0.1, -0.08], [-1.0, 0.0], vec![window(0.045), window(0.115)]),
        wall([-0.1, -0.08], [-0.02, -0.08], [0.0, -1.0], vec![window(0.04)]),
        wall([-0.02, -0.08], [-0.02, 0.0], [1.0, 0.0], vec![door(0.036)]),
    ]
}

impl Wall {
    fn along(&self) -> P {
        P::new(self.b[0] - self.a[0], self.b[1] - self.a[1], 0.0).normalize()
    }

    fn length(&self) -> f64 {
        (self.b[0] - self.a[0]).hypot(self.b[1] - self.a[1])
    }

    /// The point `s` along the wall, `out` before its logs' axes, at height `z`.
    fn at(&self, s: f64, out: f64, z: f64) -> P {
        let start = P::new(self.a[0], self.a[1], z);
        start + self.along() * s + self.outward() * out
    }

    fn outward(&self) -> P {
        P::new(self.out[0], self.out[1], 0.0)
    }

    fn runs_along_x(&self) -> bool {
        self.out[0] == 0.0
    }

    /// A box between two corners given as (along, out, z).
    fn block(&self, b: &mut MeshBuilder, low: [f64; 3], high: [f64; 3]) {
        let [c, h] = [0.5, -0.5].map(|k| [0, 1, 2].map(|a| 0.5 * high[a] + k * low[a]));
        // along, outward and up are left-handed where the plan is walked counter-clockwise.
        let frame = [self.outward(), self.along(), P::z()];
        let sign = frame[0].cross(&frame[1]).dot(&P::z());
        b.block(self.at(c[0], c[1], c[2]), [frame[0], frame[1] * sign, frame[2]], [h[1], h[0], h[2]]);
    }
}

/// What fills the house behind the logs, up to the roof.
fn core(b: &mut MeshBuilder) {
    b.part = CORE;
    const IN: f64 = 0.003;
    let frame = [P::x(), P::y(), P::z()];
    let (low, high) = (0.001, GABLE_Z);
    let (z, half) = (0.5 * (low + high), 0.5 * (high - low));
    b.block(P::new(0.0, 0.04, z), frame, [0.1 - IN, 0.04 - IN, half]);
    b.block(P::new(-0.06, -0.02, z), frame, [0.04 - IN, 0.06 - IN, half]);
}

/// Logs with bark, notched over each other at the corners and sawn off at the openings.
fn logs(b: &mut MeshBuilder, wall: &Wall, chance: &mut Chance) {
    let shift = if wall.runs_along_x() { 0.0 } else { -0.5 };
    for k in 0..LOGS + usize::from(shift < 0.0) {
        let z = LOG_Z + (k as f64 + shift) * LOG_STEP;
        let mut at = -chance.between(0.0085, 0.0135);
        let cut = |o: &&Opening| z > o.low - 0.6 * LOG_RADIUS && z < o.high + 0.6 * LOG_RADIUS;
        for opening in wall.openings.iter().filter(cut) {
            log(b, wall, [at, opening.middle - opening.half], z, chance);
            at = opening.middle + opening.half;
        }
        log(b, wall, [at, wall.length() + chance.between(0.0085, 0.0135)], z, chance);
    }
}

fn log(b: &mut MeshBuilder, wall: &Wall, [from, to]: [f64; 2], z: f64, chance: &mut Chance) {
    b.part = LOG;
    let steps = ((to - from) / 0.0016).ceil().max(2.0) as usize;
    let (bend, phase, seed) = (chance.around(0.0006), chance.between(0.0, 6.0), chance.between(0.0, 40.0));
    let s = |k: usize| from + (to - from) * k as f64 / steps as f64;
    let axis = |k: usize| wall.at(s(k), bend * (28.0 * s(k) + phase).sin(), z + bend * (37.0 * s(k)).cos());
    let path: Vec<P> = (0..=steps).map(axis).collect();
    let (out, up) = (wall.outward(), P::z());
    let side = wall.along().cross(&out).dot(&up);
    b.tube(&path, out, 19, |k, turn| {
        // Points crowd on the side that is seen.
        let angle = turn - 0.5 * turn.sin();
        let (sin, cos) = angle.sin_cos();
        let p = path[k] + (out * cos + up * (sin * side)) * LOG_RADIUS;
        let knot = 0.05 * f64::from(noise((p * 90.0).cast() + Vec3::repeat(seed as f32), 3));
        let end = if k == 0 || k == steps { 0.93 } else { 1.0 };
        let r = LOG_RADIUS * end * (0.9 + 0.13 * f64::from(bark(p.cast(), wall.runs_along_x())) + knot);
        [r * cos, r * sin]
    });
}

/// Height of bark in [0, 1]: plates between cracks that run along the log.
fn bark(p: Vec3, along_x: bool) -> f32 {
    let q = if along_x { Vec3::new(p.x * 0.3, p.y, p.z) } else { Vec3::new(p.x, p.y * 0.3, p.z) };
    let ridge = (2.0 * noise(q * 420.0, 11) - 1.0).abs();
    let fine = (2.0 * noise(q * 830.0 + Vec3::repeat(0.31), 12) - 1.0).abs();
    (1.6 * ridge + 0.5 * fine).min(1.0)
}

/// A stone: a rounded block with dents.
fn stone(b: &mut MeshBuilder, center: P, frame: [P; 3], half: [f64; 3], chance: &mut Chance) {
    b.part = STONE;
    let (seed, power) = (chance.jitter(50.0), chance.between(0.5, 0.75));
    let tilt = chance.jitter(0.08);
    b.ball(6, |d| {
        // A superellipsoid (Barr 1981), between a ball and a box.
        let s = d.map(|c| c.abs().powf(power).copysign(c));
        let dent = 0.84 + 0.3 * f64::from(fractal((d * 1.3 + seed).cast(), 2, 5));
        let q = s * dent;
        let p = frame[0] * (q.x * half[0]) + frame[1] * (q.y * half[1]) + frame[2] * (q.z * half[2]);
        let p = center + p + tilt.cross(&p);
        P::new(p.x, p.y, p.z.max(0.0))
    });
}

fn plinth(b: &mut MeshBuilder, wall: &Wall, chance: &mut Chance) {
    let mut s = -0.006;
    while s < wall.length() + 0.002 {
        let half = chance.between(0.0045, 0.0085);
        let center = wall.at(s + half, 0.0035 + chance.around(0.0012), 0.0062);
        let frame = [wall.along(), P::z().cross(&wall.along()), P::z()];
        stone(b, center, frame, [half * 1.08, 0.0062, 0.0060], chance);
        s += 2.0 * half;
    }
    b.part = CORE;
    wall.block(b, [0.0, -0.004, 0.0], [wall.length(), 0.002, 0.0115]);
}

/// Frame and leaf of an opening, a hand's depth behind the logs.
fn fill(b: &mut MeshBuilder, wall: &Wall, o: &Opening, chance: &mut Chance) {
    let (l, r, bar) = (o.middle - o.half, o.middle + o.half, 0.0022);
    b.part = FRAME;
    wall.block(b, [l - 0.001, -0.004, o.low], [l + bar, 0.0072, o.high]);
    wall.block(b, [r - bar, -0.004, o.low], [r + 0.001, 0.0072, o.high]);
    wall.block(b, [l - 0.003, -0.004, o.high - 0.0005], [r + 0.003, 0.0085, o.high + 0.0030]);
    if o.is_door {
        door(b, wall, o, chance);
        return;
    }
    wall.block(b, [l - 0.003, -0.004, o.low - 0.0026], [r + 0.003, 0.0100, o.low + 0.0004]);
    let cross = 0.0007;
    let (mz, back) = (0.5 * (o.low + o.high), -0.0018);
    wall.block(b, [o.middle - cross, back, o.low], [o.middle + cross, back + 0.0022, o.high]);
    wall.block(b, [l, back, mz - cross], [r, back + 0.0022, mz + cross]);
    b.part = PANE;
    wall.block(b, [l, -0.0040, o.low], [r, -0.0012, o.high]);
    for (edge, sign) in [(l, -1.0), (r, 1.0)] {
        shutter(b, wall, o, edge, sign);
    }
    window_box(b, wall, o, chance);
}

fn door(b: &mut MeshBuilder, wall: &Wall, o: &Opening, chance: &mut Chance) {
    let planks = 5;
    let width = 2.0 * o.half / f64::from(planks);
    b.part = DOOR;
    for i in 0..planks {
        let s = o.middle - o.half + width * f64::from(i);
        let depth = 0.0002 + chance.around(0.0003);
        wall.block(b, [s + 0.0002, -0.004, o.low + 0.0004], [s + width - 0.0002, depth, o.high]);
    }
    b.part = IRON;
    for z in [o.low + 0.010, o.high - 0.009] {
        wall.block(b, [o.middle - o.half, 0.0, z - 0.0011], [o.middle + 0.5 * o.half, 0.0011, z + 0.0011]);
    }
    let knob = wall.at(o.middle + 0.62 * o.half, 0.0022, 0.5 * (o.low + o.high) - 0.002);
    b.ball(6, |d| knob + d * 0.0015);
    for (k, rise) in [0.0, 0.0058].into_iter().enumerate() {
        let half = 0.015 - 0.002 * k as f64;
        b.part = STONE;
        let center = wall.at(o.middle, 0.0105 - 0.003 * k as f64, 0.003 + rise);
        stone(b, center, [wall.along(), P::z().cross(&wall.along()), P::z()], [half, 0.0085, 0.003], chance);
    }
}

/// A boarded shutter with two ledges and a heart-shaped stud.
fn shutter(b: &mut MeshBuilder, wall: &Wall, o: &Opening, edge: f64, sign: f64) {
    const WIDTH: f64 = 0.0095;
    b.part = SHUTTER;
    let span = |from: f64, to: f64| {
        let (p, q) = (edge + sign * (0.0012 + from), edge + sign * (0.0012 + to));
        (p.min(q), p.max(q))
    };
    for i in 0..3 {
        let w = WIDTH / 3.0;
        let (p, q) = span(w * f64::from(i) + 0.00012, w * f64::from(i + 1) - 0.00012);
        wall.block(b, [p, 0.0062, o.low], [q, 0.0078 - 0.0002 * f64::from(i % 2), o.high]);
    }
    let (p, q) = span(0.0004, WIDTH - 0.0004);
    for z in [o.low + 0.005, o.high - 0.005] {
        wall.block(b, [p, 0.0070, z - 0.0012], [q, 0.0088, z + 0.0012]);
    }
}

/// Geraniums under the window.
fn window_box(b: &mut MeshBuilder, wall: &Wall, o: &Opening, chance: &mut Chance) {
    b.part = PLANK;
    let (l, r) = (o.middle - o.half, o.middle + o.half);
    wall.block(b, [l, 0.0068, o.low - 0.0070], [r, 0.0135, o.low - 0.0020]);
    for i in 0..26 {
        let bloom = i % 2 == 0;
        b.part = if bloom { BLOSSOM } else { LEAF };
        let up = if bloom { chance.between(0.001, 0.0042) } else { chance.between(-0.001, 0.0022) };
        let middle = wall.at(chance.between(l + 0.001, r - 0.001), chance.between(0.0075, 0.0140), o.low - 0.0015 + up);
        let size = chance.between(0.0010, 0.0017);
        let lumps = chance.direction() * 3.0;
        b.ball(5, |d| middle + d * (size * (1.0 + 0.25 * (7.0 * d.dot(&lumps)).sin())));
    }
}

/// Boarded gables with battens, barge boards, and a small window under the ridge.
fn gables(b: &mut MeshBuilder, chance: &mut Chance) {
    for slope in [SLOPES[0], SLOPES[1]] {
        let gable = Wall {
            a: [CORNER[0] + slope.along[0] * slope.run, CORNER[1] + slope.along[1] * slope.run],
            b: [
                CORNER[0] + slope.along[0] * slope.run + slope.down[0],
                CORNER[1] + slope.along[1] * slope.run + slope.down[1],
            ],
            out: slope.along,
            openings: Vec::new(),
        };
        boards(b, &gable, chance);
        let (low, high) = (GABLE_Z + 0.013, GABLE_Z + 0.029);
        b.part = FRAME;
        gable.block(b, [-0.0075, 0.0, low], [0.0075, 0.0062, high]);
        b.part = PANE;
        gable.block(b, [-0.0056, 0.0, low + 0.0019], [0.0056, 0.0064, high - 0.0019]);
        b.part = FRAME;
        gable.block(b, [-0.0006, 0.0, low], [0.0006, 0.0070, high]);
        gable.block(b, [-0.007, 0.0, 0.5 * (low + high) - 0.0006], [0.007, 0.0070, 0.5 * (low + high) + 0.0006]);
        gable.block(b, [-0.0095, 0.0, low - 0.0018], [0.0095, 0.0090, low + 0.0002]);
    }
    for slope in SLOPES {
        barge_board(b, &slope);
        rafters(b, &slope);
    }
}

fn boards(b: &mut MeshBuilder, gable: &Wall, chance: &mut Chance) {
    const BOARDS: usize = 13;
    b.part = PLANK;
    let width = 2.0 * (HALF_SPAN + 0.004) / BOARDS as f64;
    for i in 0..BOARDS {
        let left = -HALF_SPAN - 0.004 + width * i as f64;
        let (bottom, proud) = (GABLE_Z - 0.0035 - chance.unit() * 0.002, 0.0035 + chance.around(0.0004));
        let mirrored = gable.along().cross(&P::z()).dot(&gable.outward()) < 0.0;
        b.slab([3, 14], |u, v| {
            let u = if mirrored { 1.0 - u } else { u };
            let s = left + width * (0.03 + 0.94 * u);
            let top = RIDGE_Z - SLOPE * s.abs() - 0.001;
            let p = gable.at(s, 0.0, bottom + (top - bottom).max(0.001) * v);
            let grain = 0.0005 * f64::from(noise((p.component_mul(&P::new(900.0, 900.0, 60.0))).cast(), 19));
            [p + gable.outward() * (proud + grain), p - gable.outward() * 0.004]
        });
        let top = RIDGE_Z - SLOPE * left.abs() - 0.003;
        if i > 0 && top > bottom {
            gable.block(b, [left - 0.0009, 0.0, bottom + 0.001], [left + 0.0009, 0.0052, top]);
        }
    }
}

/// The board under the edge of the roof over a gable.
fn barge_board(b: &mut MeshBuilder, slope: &Slope) {
    b.part = FRAME;
    let end = slope.run + VERGE;
    slope.slab(b, [1, 12], |u, v| {
        let (s, d) = (end - 0.0028 * (1.0 - u), (HALF_SPAN + EAVES) * v);
        [slope.at(s, d, 0.0), slope.at(s, d, -0.0062 - 0.0012 * (v * 19.0).sin().abs())]
    });
}

/// Rafter ends under the eaves.
fn rafters(b: &mut MeshBuilder, slope: &Slope) {
    b.part = PLANK;
    // Clear of the slope across the valley, or of the one across the hip.
    let mut s = if slope.miter > 0.0 { HALF_SPAN + EAVES + 0.008 } else { 0.014 - HALF_SPAN };
    while s < slope.run + 0.002 {
        slope.slab(b, [1, 1], |u, v| {
            let (s, d) = (s + 0.004 * (u - 0.5), HALF_SPAN - 0.012 + (EAVES + 0.0105) * v);
            [slope.at(s, d, 0.0005), slope.at(s, d, -0.0048)]
        });
        s += 0.0145;
    }
}

/// A deck under overlapping shingles, logs along ridges and hip.
fn roof(b: &mut MeshBuilder, chance: &mut Chance) {
    let edge = HALF_SPAN + EAVES;
    for slope in SLOPES {
        b.part = PLANK;
        slope.slab(b, [1, 1], |u, v| {
            let d = edge * v;
            let from = slope.miter * d;
            let s = from + (slope.run + VERGE - 0.001 - from) * u;
            [slope.at(s, d, 0.0012), slope.at(s, d, -0.0012)]
        });
        shingles(b, &slope, chance);
    }
    let top = P::new(0.0, 0.0, 0.0022);
    let corner = SLOPES[0].at(0.0, 0.0, 0.0) + top;
    let hip = SLOPES[2].at(-edge, edge, 0.001) + top;
    let ends = [0, 1].map(|k| SLOPES[k].at(SLOPES[k].run + VERGE + 0.003, 0.0, 0.0) + top);
    for end in [ends[0], ends[1], hip] {
        ridge_log(b, corner, end);
    }
}

fn ridge_log(b: &mut MeshBuilder, from: P, to: P) {
    b.part = LOG;
    let steps = ((to - from).norm() / 0.0016) as usize;
    let path: Vec<P> = (0..=steps).map(|k| from.lerp(&to, k as f64 / steps as f64)).collect();
    let along_x = (to - from).x.abs() > (to - from).y.abs();
    b.tube(&path, P::z(), 14, |k, turn| {
        let q = path[k] + P::new(turn.cos(), turn.sin(), turn.sin()) * 0.003;
        let r = 0.0030 + 0.0006 * f64::from(bark(q.cast(), along_x));
        [r * turn.cos(), r * turn.sin()]
    });
}

fn shingles(b: &mut MeshBuilder, slope: &Slope, chance: &mut Chance) {
    const ROW: f64 = 0.0060;
    let edge = HALF_SPAN + EAVES + 0.0015;
    let rows = (edge / ROW).ceil() as usize;
    for row in 0..rows {
        let low = edge - ROW * row as f64;
        let mut s = slope.miter * low - 0.003 - chance.unit() * 0.006;
        let end = slope.run + VERGE + 0.001;
        while s < end {
            let width = chance.between(0.0058, 0.0105).min(end - s + 0.002);
            let reach = low + chance.around(0.0008);
            shingle(b, slope, [s, s + width - 0.0003], [(reach - 1.75 * ROW).max(0.0), reach], chance);
            s += width;
        }
    }
}

/// A split shingle: thicker below, ribbed along the grain, a little warped.
fn shingle(b: &mut MeshBuilder, slope: &Slope, along: [f64; 2], down: [f64; 2], chance: &mut Chance) {
    b.part = SHINGLE + chance.below(SHADES);
    let (lift, skew, warp) = (chance.between(0.0, 0.0006), chance.around(0.05), chance.around(0.0005));
    let (seed, thick) = (chance.between(0.0, 90.0), chance.between(0.0013, 0.0019));
    slope.slab(b, [5, 3], |u, v| {
        let d = down[0] + (down[1] - down[0]) * v + 0.0006 * (9.0 * u + seed).sin() * v * v;
        let s = along[0] + (along[1] - along[0]) * u + skew * (d - down[1]);
        // Trimmed along the hip.
        let s = if slope.miter < 0.0 { s.max(-d - 0.0008 + 0.0004 * u) } else { s };
        let rib = 0.0005 * f64::from(noise(Vec3::new((s * 1100.0) as f32, (v * 1.5) as f32, seed as f32), 17));
        let base = 0.0008 + (0.0018 + lift) * v + warp * (2.0 * u - 1.0).powi(2) * v;
        [slope.at(s, d, base + thick * (0.4 + 0.6 * v) + rib), slope.at(s, d, base - 0.0008 + 0.0006 * v)]
    });
}

/// Field stones in mortar, a slab and two pots on top.
fn chimney(b: &mut MeshBuilder, chance: &mut Chance) {
    const HALF: f64 = 0.0115;
    let (center, top) = (P::new(0.052, 0.051, 0.0), 0.158);
    b.part = CORE;
    let axes = [P::x(), P::y(), P::z()];
    b.block(center + P::z() * (0.5 * (0.1 + top)), axes, [HALF - 0.001, HALF - 0.001, 0.5 * (top - 0.1)]);
    let course = 0.0062;
    for k in 0..8 {
        let z = top - 0.003 - course * f64::from(k);
        for side in 0..4 {
            let turn = std::f64::consts::FRAC_PI_2 * f64::from(side);
            let out = P::new(turn.cos().round(), turn.sin().round(), 0.0);
            let along = P::z().cross(&out);
            let mut s = -HALF - if k % 2 == 0 { 0.0016 } else { 0.0 };
            while s < HALF - 0.001 {
                let half = chance.between(0.0028, 0.0052);
                let at = center + out * (HALF - 0.0012) + along * (s + half) + P::z() * (z + chance.around(0.0003));
                stone(b, at, [out, along, P::z()], [0.0027, half * 1.05, 0.0033], chance);
                s += 2.0 * half;
            }
        }
    }
    stone(b, center + P::z() * (top + 0.0012), axes, [HALF + 0.0032, HALF + 0.0032, 0.0022], chance);
    b.part = POT;
    for (x, height) in [(-0.005, 0.012), (0.005, 0.010)] {
        let foot = center + P::new(x, 0.0, top + 0.0015);
        let profile = [(0.0, 0.0042), (0.82, 0.0035), (0.84, 0.0041), (1.0, 0.0041), (1.0, 0.0030), (0.5, 0.0028)];
        let rings: Vec<Vec<u32>> = profile
            .iter()
            .map(|&(h, r)| {
                let turn = |i: usize| (std::f64::consts::TAU * i as f64 / 20.0).sin_cos();
                b.ring((0..20).map(|i| (foot + P::new(r * turn(i).1, r * turn(i).0, h * height)).into()))
            })
            .collect();
        b.loft(&rings);
        b.fan_reversed(&rings[0], foot);
        b.fan(&rings[rings.len() - 1], foot + P::z() * (0.5 * height));
    }
}

/// Cushions of moss: in the valley, along hip and eaves, on the shaded sides of plinth and logs.
fn moss(b: &mut MeshBuilder, chance: &mut Chance) {
    b.part = MOSS;
    for _ in 0..64 {
        let slope = SLOPES[usize::from(chance.below(4))];
        // Down where the roof stays wet.
        let d = (HALF_SPAN + EAVES) * chance.unit().sqrt();
        let near = chance.unit().powi(2) * (slope.run + 0.008 - slope.miter * d);
        cushion(b, slope.at(slope.miter * d + near, d, 0.0042), slope.normal(), chance.between(0.0022, 0.0056), chance);
    }
    let walls = walls();
    for _ in 0..22 {
        let wall = &walls[usize::from(chance.below(6))];
        let s = chance.between(0.0, wall.length());
        let at = wall.at(s, 0.0075, chance.between(0.001, 0.012));
        cushion(b, at, (wall.outward() + P::z()).normalize(), chance.between(0.002, 0.004), chance);
    }
}

/// A cushion of lumps, highest in the middle.
fn cushion(b: &mut MeshBuilder, center: P, up: P, radius: f64, chance: &mut Chance) {
    let lumps = 3 + (radius * 1300.0) as usize;
    for _ in 0..lumps {
        let spread = chance.direction();
        let level = spread - up * spread.dot(&up);
        let far = level.norm() * chance.unit();
        let at = center + level.try_normalize(0.0).unwrap_or_default() * (far * radius);
        let size = radius * chance.between(0.22, 0.42) * (1.15 - 0.5 * far);
        let seed = chance.jitter(20.0);
        b.ball(4, |d| {
            let r = size * (0.75 + 0.5 * f64::from(noise((d * 2.3 + seed).cast(), 29)));
            let p = d * r;
            // Flattened onto what it grows on; never below the table.
            let q = at + p - up * (0.35 * p.dot(&up));
            P::new(q.x, q.y, q.z.max(0.0))
        });
    }
}

/// Weathered wood, lichen, field stone, painted joinery.
pub(crate) fn albedo(p: Vec3, normal: Vec3, part: u8) -> Vec3 {
    let [cos, sin] = TURN.map(|c| c as f32);
    let [p, normal] = [p, normal].map(|v| Vec3::new(cos * v.x + sin * v.y, cos * v.y - sin * v.x, v.z));
    match part {
        LOG => log_color(p, normal),
        STONE => stone_color(p),
        PLANK => planks(p, [120, 88, 58], [78, 56, 38]),
        FRAME => planks(p, [214, 200, 170], [176, 158, 126]),
        MOSS => blend(color([44, 68, 18]), color([98, 118, 40]), fractal(p * 700.0, 2, 31)),
        DOOR => planks(p, [150, 52, 34], [104, 32, 24]),
        SHUTTER => planks(p, [52, 118, 120], [30, 78, 86]),
        PANE => color([38, 44, 52]),
        IRON => color([40, 38, 38]),
        POT => blend(color([168, 84, 52]), color([120, 62, 44]), noise(p * 300.0, 5)),
        BLOSSOM => blend(color([214, 34, 40]), color([240, 96, 110]), noise(p * 500.0, 6)),
        LEAF => color([62, 110, 46]),
        CORE => color([120, 108, 94]) * (0.8 + 0.2 * noise(p * 600.0, 7)),
        _ => shingle_color(p, normal, part - SHINGLE),
    }
}

/// Grey-brown bark with pale plates and dark cracks; sawn ends show rings.
fn log_color(p: Vec3, normal: Vec3) -> Vec3 {
    if let Some(radius) = sawn(p, normal) {
        let wobble = 0.0008 * noise(p * 260.0, 43);
        let rings = 0.5 + 0.5 * ((radius + wobble) * 6500.0).sin();
        return blend(color([206, 164, 108]), color([150, 106, 64]), rings * 0.8);
    }
    let along_x = normal.x.abs() < normal.y.abs();
    let height = bark(p, along_x);
    let tone = blend(color([92, 66, 46]), color([166, 132, 98]), noise(p * 130.0, 41));
    let plate = blend(color([44, 31, 23]), tone, step(0.28, 0.5, height));
    let lichen = step(0.68, 0.12, noise(p * 210.0, 42)) * 0.55;
    blend(plate, color([150, 154, 122]), lichen) * (0.8 + 0.2 * noise(p * 1900.0, 44))
}

/// Distance from the log's axis, on the sawn ends that stand out beyond the corners. Logs along x lie at
/// whole steps above the lowest, logs along y at half steps.
fn sawn(p: Vec3, normal: Vec3) -> Option<f32> {
    let height = (p.z - LOG_Z as f32) / LOG_STEP as f32;
    let nearest = |c: f32, walls: [f32; 3]| walls.map(|w| (c - w).abs()).into_iter().fold(f32::INFINITY, f32::min);
    if p.z > RIDGE_Z as f32 - 0.04 {
        return None;
    }
    let beyond_x = p.x.abs() > 0.1074 || (p.y < -0.07 && (-0.0126..-0.004).contains(&p.x));
    let beyond_y = p.y.abs() > 0.0874 || (p.x > 0.09 && (-0.016..-0.0074).contains(&p.y));
    if normal.x.abs() > 0.85 && beyond_x {
        Some(nearest(p.y, [-0.08, 0.0, 0.08]).hypot(wrap(height, 1.0) * LOG_STEP as f32))
    } else if normal.y.abs() > 0.85 && beyond_y {
        Some(nearest(p.x, [-0.1, -0.02, 0.1]).hypot(wrap(height - 0.5, 1.0) * LOG_STEP as f32))
    } else {
        None
    }
}

fn stone_color(p: Vec3) -> Vec3 {
    let tone = blend(color([128, 122, 116]), color([184, 168, 144]), noise(p * 110.0, 51));
    let tone = blend(tone, color([96, 104, 112]), step(0.6, 0.2, noise(p * 90.0, 52)));
    let speck = noise(p * 1500.0, 53);
    let damp = step(0.62, 0.2, noise(p * 260.0, 54)) * 0.6;
    blend(tone * (0.72 + 0.36 * speck).min(1.0), color([106, 116, 62]), damp)
}

/// Grain along whichever way boards run: up.
fn planks(p: Vec3, light: [u8; 3], dark: [u8; 3]) -> Vec3 {
    let q = p.component_mul(&Vec3::new(900.0, 900.0, 55.0));
    let grain = noise(q, 61);
    let streak = step(0.7, 0.2, noise(p.component_mul(&Vec3::new(1700.0, 1700.0, 130.0)), 62));
    blend(color(light), color(dark), 0.75 * grain) * (1.0 - 0.3 * streak)
}

fn shingle_color(p: Vec3, normal: Vec3, shade: u8) -> Vec3 {
    const TONES: [[u8; 3]; SHADES as usize] =
        [[126, 106, 86], [142, 116, 90], [112, 97, 83], [136, 104, 78], [122, 112, 100]];
    let base = color(TONES[usize::from(shade)]);
    // Ribs run down the slope; which way that is, the normal tells.
    let across = if normal.x.abs() > normal.y.abs() { p.y } else { p.x };
    let grain = noise(Vec3::new(across * 1300.0, p.z * 90.0, 0.5), 71);
    let lichen = step(0.66, 0.12, fractal(p * 190.0, 2, 72));
    let moss = step(0.66, 0.16, fractal(p * 62.0, 2, 74));
    let tone = base * (0.55 + 0.5 * grain);
    let tone = blend(tone, color([150, 152, 124]), 0.35 * lichen);
    blend(tone, color([78, 94, 34]), 0.75 * moss) * (1.0 - 0.25 * stripe(wrap(across, 0.0021), 0.0001, 0.0004))
}
