//! A Delft plate on a wooden stand: thin and flat, what a visual hull swells and a coarse mesh loses.
//! Plate and stand are closed pieces that touch.

use crate::material::{Finish, Vec3};
use crate::shape::{MeshBuilder, P};
use crate::texture_field::{blend, color, fractal, noise, step, stripe, wrap};

const PLATE: u8 = 0;
const WOOD: u8 = 1;

const RADIUS: f64 = 0.1;
/// Cosine and sine of the plate's lean from upright.
const LEAN: [f64; 2] = [0.951_056_5, 0.309_017];
/// Where the plate's middle stands.
const MIDDLE: [f64; 3] = [0.004, 0.0, 0.1115];

/// Builds the mesh.
pub(crate) fn build() -> MeshBuilder {
    let mut b = MeshBuilder { part: PLATE, ..MeshBuilder::default() };
    // From the middle of the back over the foot ring, the rim and the well to the middle of the front.
    let shape = |r: f64| 0.0105 * smooth((r - 0.060) / 0.014) + 0.0065 * ((r - 0.072).max(0.0) / 0.028);
    let mut profile: Vec<[f64; 2]> = (1..=20).map(|k| [0.0025 * f64::from(k), -0.0030]).collect();
    profile.extend([[0.0510, -0.0056], [0.0520, -0.0062], [0.0540, -0.0062], [0.0550, -0.0056], [0.0556, -0.0028]]);
    profile.extend((0..=29).map(|k| 0.0575 + 0.0014 * f64::from(k)).map(|r| [r, shape(r) - 0.0030]));
    profile.extend([[0.0994, shape(0.0994) - 0.0022], [RADIUS, shape(RADIUS) - 0.0010], [0.0994, shape(0.0994)]]);
    profile.extend((0..=69).map(|k| 0.0985 - 0.0014 * f64::from(k)).map(|r| [r, shape(r)]));
    let rings = b.revolve(&profile, 240, |_, _| 1.0);
    b.loft(&rings);
    b.close_poles(&rings);
    let mut b = b.moved(stand_up);
    stand(&mut b);
    b
}

fn smooth(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// From the plate's own frame (facing z, x down) to the table: facing x, leaning back.
fn stand_up(p: P) -> P {
    let [c, s] = LEAN;
    P::new(c * p.z + s * p.x, p.y, s * p.z - c * p.x) + P::from(MIDDLE)
}

/// Two feet with pegs before the plate, struts behind it, and a rail.
fn stand(b: &mut MeshBuilder) {
    b.part = WOOD;
    let [c, s] = LEAN;
    for side in [-1.0, 1.0] {
        let y = 0.034 * side;
        // Rounded feet from front to back.
        beam(b, P::new(0.052, y, 0.0055), P::new(-0.060, y, 0.0055), [0.0052, 0.0055]);
        // A peg that holds the rim.
        beam(b, P::new(0.047, y, 0.006), P::new(0.0495, y, 0.027), [0.0046, 0.0042]);
        b.ball(10, |d| P::new(0.0497, y, 0.0285) + d * 0.0056);
        // The strut along the back.
        let back = |down: f64| P::new(s * down - c * 0.0112, y, -c * down) + P::from(MIDDLE) - P::x() * 0.004;
        beam(b, back(0.106), back(-0.045), [0.0044, 0.0046]);
        beam(b, P::new(-0.052, y, 0.006), back(-0.010), [0.0042, 0.0042]);
    }
    for (x, z) in [(-0.046, 0.0058), (0.020, 0.0058)] {
        beam(b, P::new(x, -0.036, z), P::new(x, 0.036, z), [0.0042, 0.0042]);
    }
}

/// A bar of rounded square section.
fn beam(b: &mut MeshBuilder, from: P, to: P, half: [f64; 2]) {
    let reach = (to - from).normalize();
    // Ends are rounded over two rings.
    let path = [from, from + reach * 0.0008, from + reach * 0.002, to - reach * 0.002, to - reach * 0.0008, to];
    b.tube(&path, P::z(), 28, |k, angle| {
        let shrink = [0.75, 0.92, 1.0, 1.0, 0.92, 0.75][k];
        let (sin, cos) = angle.sin_cos();
        let square = |c: f64| c.abs().powf(0.45).copysign(c) * shrink;
        [half[1] * square(cos), half[0] * square(sin)]
    });
}

/// What the parts are made of: tin glaze and waxed beech.
pub(crate) fn finishes() -> Vec<Finish> {
    vec![Finish::glazed(0.07, 1.52), Finish::glazed(0.35, 1.5)]
}

/// Cobalt on white.
pub(crate) fn albedo(p: Vec3, normal: Vec3, part: u8) -> Vec3 {
    if part == WOOD {
        let ring = fractal(p.component_mul(&Vec3::new(90.0, 700.0, 420.0)), 2, 3);
        return blend(color([142, 92, 52]), color([86, 50, 28]), ring);
    }
    let [c, s] = LEAN.map(|c| c as f32);
    let q = p - Vec3::from(MIDDLE.map(|c| c as f32));
    // In the plate's plane: y to the right, up against the frame's x.
    let (x, y) = (q.y, c * q.z - s * q.x);
    let white = blend(color([238, 240, 238]), color([214, 222, 230]), 0.6 * fractal(p * 60.0, 2, 5));
    if c * normal.x + s * normal.z < 0.0 {
        return white;
    }
    let ink = painting(x, y);
    // The brush pools: dark where it is full, lighter inside strokes.
    let wash = 0.75 + 0.25 * noise(p * 330.0, 7);
    blend(white, blend(color([96, 128, 196]), color([20, 40, 124]), ink * wash), (1.6 * ink).min(1.0))
}

/// How much ink lies at a point of the plate: rim, then the picture in its well.
fn painting(x: f32, y: f32) -> f32 {
    let r = x.hypot(y);
    let angle = y.atan2(x);
    let line = |at: f32, half: f32| stripe(r - at, half, 0.0005);
    let mut ink = line(0.0975, 0.0013).max(line(0.0738, 0.0006)).max(line(0.0716, 0.0004)).max(line(0.0575, 0.0005));
    if r > 0.075 && r < 0.096 {
        ink = ink.max(rim(r, angle));
    } else if r > 0.0580 && r < 0.0712 {
        // Lappets: a row of points.
        let t = wrap(angle, std::f32::consts::TAU / 48.0) / (std::f32::consts::TAU / 96.0);
        ink = ink.max(0.65 * (1.0 - step(0.0690 - 0.0085 * t * t, 0.0006, r)) * step(0.0615, 0.0006, r));
    } else if r < 0.0572 {
        ink = ink.max(mill(x, y));
    }
    ink
}

/// Eight flowers between tendrils.
fn rim(r: f32, angle: f32) -> f32 {
    let period = std::f32::consts::TAU / 8.0;
    let (u, v) = (wrap(angle, period) * 0.0855, r - 0.0855);
    let far = u.hypot(v);
    let petals = far - 0.0068 - 0.0017 * (6.0 * v.atan2(u)).cos();
    let flower = (1.0 - step(0.0, 0.0006, petals)) * (0.45 + 0.55 * stripe(petals + 0.0007, 0.0006, 0.0006));
    let heart = stripe(far, 0.0020, 0.0005);
    // A wave with leaves between two flowers.
    let w = wrap(angle + 0.5 * period, period) * 0.0855;
    let vine = stripe(v - 0.0042 * (w * 215.0).sin(), 0.00045, 0.0005) * stripe(w, 0.0225, 0.002);
    let leaf = |at: f32, side: f32| {
        let (a, b) = ((w - at) / 0.0030, (v - side) / 0.0016);
        1.0 - step(1.0, 0.35, a * a + b * b)
    };
    let leaves =
        [(-0.0140, 0.0042), (-0.0060, -0.0046), (0.0065, 0.0046), (0.0140, -0.0042), (0.0, 0.0060), (0.0, -0.0060)];
    let leaves = leaves.into_iter().map(|(at, side)| leaf(at, side)).fold(0.0, f32::max);
    flower.max(heart).max(0.8 * vine).max(0.7 * leaves)
}

/// A windmill on a dyke, water before it, birds above.
fn mill(x: f32, y: f32) -> f32 {
    let soft = 0.0005;
    let mut ink = 0.0_f32;
    // Tower with a gallery, a cap, a door and windows.
    let rise = y + 0.022;
    let half = 0.0125 - 0.145 * rise;
    let tower = stripe(x, half, soft) * step(0.0, soft, rise) * (1.0 - step(0.036, soft, rise));
    let courses = 0.30 + 0.25 * stripe(wrap(rise, 0.0030), 0.0005, 0.0006);
    let shade = courses + 0.35 * step(0.002, 0.008, x);
    ink = ink
        .max(tower * shade)
        .max(stripe(x.abs() - half, 0.0006, soft) * step(0.0, soft, rise) * (1.0 - step(0.036, soft, rise)));
    ink = ink.max(stripe(rise - 0.0150, 0.0010, soft) * stripe(x, 0.0165, soft));
    let cap = (x / 0.0085).powi(2) + ((y - 0.0140) / 0.0075).powi(2);
    ink = ink.max((1.0 - step(1.0, 0.12, cap)) * step(0.0135, soft, y) * 0.85);
    ink = ink.max(stripe(x, 0.0030, soft) * step(0.0, soft, rise) * (1.0 - step(0.0085, soft, rise)));
    ink = ink.max(stripe(x, 0.0016, soft) * stripe(rise - 0.0235, 0.0022, soft));
    // Four sails of lattice, turned a little.
    let (sx, sy) = (x, y - 0.0165);
    let (c, s) = (0.906_f32, 0.423_f32);
    for k in 0..4 {
        let (a, b) = match k {
            0 => (c * sx + s * sy, c * sy - s * sx),
            1 => (c * sy - s * sx, -c * sx - s * sy),
            2 => (-c * sx - s * sy, s * sx - c * sy),
            _ => (s * sx - c * sy, c * sx + s * sy),
        };
        let along = step(0.0, soft, a) * (1.0 - step(0.0360, soft, a));
        ink = ink.max(stripe(b, 0.0006, soft) * along);
        let cloth = along * step(0.0070, soft, a) * step(0.0, soft, b) * (1.0 - step(0.0066, soft, b));
        let bars = stripe(wrap(a, 0.0034), 0.0004, soft).max(stripe(b - 0.0033, 0.0003, soft)).max(stripe(
            b - 0.0064,
            0.0005,
            soft,
        ));
        ink = ink.max(cloth * (0.22 + 0.78 * bars));
    }
    // Dyke, reeds, water.
    let bank = -0.0225 + 0.0022 * (x * 70.0).sin() - 5.0 * x * x;
    ink = ink.max(stripe(y - bank, 0.0008, soft));
    let below = 1.0 - step(bank, 0.0006, y);
    let grass = below * step(-0.0335, 0.002, y) * stripe(wrap(x + 0.3 * y, 0.0026), 0.0005, 0.0006);
    let wave = wrap(y + 0.0012 * (x * 240.0).sin(), 0.0052);
    let water =
        (1.0 - step(-0.0345, 0.001, y)) * stripe(wave, 0.0006, 0.0006) * (0.55 + 0.45 * (x * 95.0 + y * 400.0).sin());
    ink = ink.max(0.6 * grass).max(0.75 * water.max(0.0));
    // A cottage on either side and birds.
    for (at, size) in [(-0.0330, 1.0), (0.0345, 0.85)] {
        let (u, v) = ((x - at) / size, (y + 0.0270) / size);
        let wall = stripe(u, 0.0070, soft) * stripe(v - 0.0035, 0.0035, soft);
        let roof = stripe(u, 0.0088 - 1.25 * (v - 0.0070), soft) * step(0.0070, soft, v);
        ink = ink.max(0.35 * wall).max(roof * (1.0 - step(0.0140, soft, v)));
        ink = ink.max(stripe(u, 0.0013, soft) * stripe(v - 0.0022, 0.0022, soft));
    }
    for (at, height, size) in
        [(-0.0300, 0.0235, 0.0046), (-0.0215, 0.0330, 0.0036), (0.0340, 0.0130, 0.0042), (-0.0405, 0.0130, 0.0034)]
    {
        let t = (x - at) / size;
        let wing = 0.5 * t.abs().min(1.0).sqrt() - 0.3 * t * t;
        ink = ink.max(stripe((y - height) / size - wing, 0.10, 0.08) * stripe(t, 1.0, 0.1));
    }
    ink.clamp(0.0, 1.0)
}
