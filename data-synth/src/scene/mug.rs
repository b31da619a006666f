//! A glazed stoneware mug painted with boats: one piece with a handle, genus one, and a deep cavity whose
//! floor few views see.

use crate::material::{Finish, Vec3};
use crate::shape::{Hole, MeshBuilder, P, ear};
use crate::texture_field::{blend, color, noise, step, stripe, wrap};

const OUTSIDE: u8 = 0;
const INSIDE: u8 = 1;
const HANDLE: u8 = 2;
const FOOT: u8 = 3;

const RADIUS: f64 = 0.041;
const HEIGHT: f64 = 0.096;
const THICKNESS: f64 = 0.0036;
const AROUND: usize = 144;
/// Direction of the handle in columns: seen from +x it stands out to the right and a little forward.
const HANDLE_COLUMN: usize = 29;

/// Builds the mesh.
pub(crate) fn build() -> MeshBuilder {
    let mut b = MeshBuilder::default();
    let mut profile = vec![[0.0305, 0.0012], [0.0318, 0.0], [0.0340, 0.0], [0.0350, 0.0012], [0.0352, 0.0030]];
    let foot = profile.len();
    profile.extend([[0.0372, 0.0046], [0.0390, 0.0064]]);
    let wall = profile.len();
    const ROWS: usize = 44;
    profile.extend((1..=ROWS).map(|k| {
        let t = k as f64 / ROWS as f64;
        [0.0400 + 0.0010 * (std::f64::consts::PI * t).sin() + 0.0010 * t, 0.0064 + (HEIGHT - 0.0082) * t]
    }));
    let rim = profile[profile.len() - 1];
    let half = 0.5 * THICKNESS;
    profile.extend((1..=6).map(|k| {
        let (s, c) = (std::f64::consts::PI * f64::from(k) / 6.0).sin_cos();
        [rim[0] - half + half * c, rim[1] + half * s]
    }));
    let inner = profile.len();
    profile
        .extend((1..=36).map(|k| [rim[0] - THICKNESS - 0.0012 * f64::from(k) / 36.0, rim[1] - 0.0022 * f64::from(k)]));
    let floor = profile[profile.len() - 1];
    profile.extend((1..=10).map(|k| {
        let (s, c) = (std::f64::consts::FRAC_PI_2 * f64::from(k) / 10.0).sin_cos();
        [floor[0] - 0.009 * (1.0 - c), floor[1] - 0.0085 * s]
    }));
    let last = profile[profile.len() - 1];
    profile.extend((1..=12).map(|k| [last[0] * (1.0 - f64::from(k) / 13.0), last[1]]));
    // The underside is not glazed and slightly hollow.
    profile.splice(0..0, (1..=8).map(|k| [0.0305 * f64::from(k) / 9.0, 0.0012]));
    let (foot, wall, inner) = (foot + 8, wall + 8, inner + 8);
    let rings = b.revolve(&profile, AROUND, |_, _| 1.0);
    b.part = FOOT;
    b.loft(&rings[..foot]);
    b.part = OUTSIDE;
    let low = [wall + 7, wall + 30].map(|row| Hole { low: [row, HANDLE_COLUMN - 5], size: [6, 10] });
    let edges =
        b.loft_around(&rings[foot - 1..=inner], &low.map(|h| Hole { low: [h.low[0] - foot + 1, h.low[1]], ..h }));
    b.part = INSIDE;
    b.loft(&rings[inner..]);
    b.part = FOOT;
    let height = P::z() * profile[0][1];
    b.fan_reversed(&rings[0], height);
    b.part = INSIDE;
    b.fan(&rings[rings.len() - 1], P::z() * last[1]);
    handle(&mut b, &edges, low.map(|h| 0.5 * (profile[h.low[0]][1] + profile[h.low[0] + 6][1])));
    b.without_strays()
}

/// An ear between the two holes, flatter than wide.
fn handle(b: &mut MeshBuilder, edges: &[Vec<u32>], [low, high]: [f64; 2]) {
    b.part = HANDLE;
    let turn = std::f64::consts::TAU * HANDLE_COLUMN as f64 / AROUND as f64;
    let out = P::new(turn.cos(), turn.sin(), 0.0);
    let foot = |z: f64| out * RADIUS + P::z() * z;
    let [bottom, top] = ear(foot(low), foot(high), out * 0.030 - P::z() * 0.002, 30);
    let across = P::z().cross(&out);
    let half = |_: usize| [0.0072, 0.0043];
    let upper = b.sleeve(&edges[1], &top, across, 10, half);
    let lower = b.sleeve(&edges[0], &bottom, across, 10, half);
    b.join(&upper, &lower);
}

/// What the parts are made of: glaze, and raw stoneware where it stood in the kiln.
pub(crate) fn finishes() -> Vec<Finish> {
    vec![Finish::glazed(0.06, 1.5), Finish::glazed(0.06, 1.5), Finish::glazed(0.06, 1.5), Finish::Matt]
}

/// Cream glaze with iron specks; sea, boats and gulls around the outside.
pub(crate) fn albedo(p: Vec3, part: u8) -> Vec3 {
    let speck = step(0.9, 0.06, noise(p * 780.0, 3)) * 0.55;
    let cream = blend(color([242, 232, 210]), color([150, 112, 74]), speck);
    match part {
        FOOT => blend(color([190, 148, 108]), color([160, 120, 84]), noise(p * 700.0, 5)),
        HANDLE => blend(color([34, 84, 130]), color([22, 60, 104]), noise(p * 160.0, 7)) * (1.0 - 0.3 * speck),
        INSIDE => cream,
        _ => seascape(p, cream),
    }
}

/// The picture around the wall, in metres along the wall and up.
fn seascape(p: Vec3, cream: Vec3) -> Vec3 {
    let around = p.y.atan2(p.x) * RADIUS as f32;
    let z = p.z;
    let sky = blend(color([190, 220, 226]), cream, step(0.066, 0.05, z));
    let mut c = blend(sky, cream, 0.35);
    // Sun to the right of the first boat, with rays.
    let (dx, dz) = (wrap(around - 0.023, 0.2576), z - 0.071);
    let far = dx.hypot(dz);
    let rays =
        stripe(wrap(dz.atan2(dx), std::f32::consts::FRAC_PI_6), 0.10, 0.05) * stripe(far - 0.0105, 0.0018, 0.0005);
    c = blend(c, color([240, 168, 40]), (1.0 - step(0.0072, 0.0005, far)).max(rays));
    c = gulls(c, around, z);
    // Three boats of two kinds around the mug.
    let which = ((around + 0.0215) / 0.08587).floor();
    let sails = if which.rem_euclid(3.0) == 0.0 { [206, 58, 42] } else { [250, 246, 236] };
    c = boat(c, wrap(around + 0.0215 - 0.0215, 0.08587), z - 0.0335, color(sails));
    waves(c, around, z)
}

fn gulls(under: Vec3, around: f32, z: f32) -> Vec3 {
    let mut c = under;
    for (at, height, size) in
        [(-0.019, 0.075, 0.0050), (-0.030, 0.066, 0.0038), (0.045, 0.078, 0.0042), (0.062, 0.070, 0.0034)]
    {
        let x = (around - at) / size;
        let wing = 0.55 * x.abs().min(1.0).sqrt() - 0.35 * x * x;
        let line = stripe((z - height) / size - wing, 0.085, 0.05) * stripe(x, 1.0, 0.1);
        c = blend(c, color([44, 56, 72]), line);
    }
    c
}

/// A cutter: hull, mast, main sail and jib; `x` and `z` from the middle of its waterline.
fn boat(under: Vec3, x: f32, z: f32, sail: Vec3) -> Vec3 {
    let soft = 0.0004;
    let hull = stripe(x + 0.001, 0.0135 + 0.45 * z, soft) * step(-0.004, soft, z) * (1.0 - step(0.0052, soft, z));
    let mast = stripe(x, 0.00045, 0.0003) * step(0.004, soft, z) * (1.0 - step(0.041, soft, z));
    let rise = (z - 0.0085) / 0.030;
    let within = step(0.0, 0.015, rise) * (1.0 - step(1.0, 0.015, rise));
    let main = step(0.0009, soft, x) * (1.0 - step(0.0015 + 0.0125 * (1.0 - rise), soft, x)) * within;
    let rise = (z - 0.0085) / 0.025;
    let within = step(0.0, 0.015, rise) * (1.0 - step(1.0, 0.015, rise));
    let jib = step(0.0009, soft, -x) * (1.0 - step(0.0012 + 0.0115 * (1.0 - rise), soft, -x)) * within;
    let seams = 1.0 - 0.22 * stripe(wrap(z, 0.0052), 0.00018, 0.0002);
    let mut c = blend(under, sail * seams, main.max(jib));
    c = blend(c, color([92, 62, 40]), mast);
    c = blend(c, color([122, 40, 34]), hull);
    let trim = stripe(z - 0.0040, 0.0006, 0.0003) * hull;
    blend(c, color([244, 232, 206]), trim)
}

/// Four rows of crests, darker towards the foot.
fn waves(under: Vec3, around: f32, z: f32) -> Vec3 {
    const BLUES: [[u8; 3]; 4] = [[120, 182, 196], [66, 136, 174], [34, 92, 148], [22, 58, 110]];
    // A whole number of waves around.
    let length = 2.0 * std::f32::consts::PI * RADIUS as f32 / 18.0;
    let mut c = under;
    for (k, blue) in BLUES.into_iter().enumerate() {
        let phase = wrap(around + 0.37 * length * k as f32, length) / length;
        // Scallops: round troughs, sharp crests.
        let crest = 0.0335 - 0.0078 * k as f32 + 0.0030 * (4.0 * phase * phase);
        c = blend(c, color(blue), 1.0 - step(crest, 0.0003, z));
        c = blend(c, color([236, 240, 232]), stripe(z - crest + 0.0008, 0.00038, 0.0003));
    }
    c
}
