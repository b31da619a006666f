//! A trefoil knot of three-stranded rope that hides itself from every side. After each lap a strand
//! continues as the next, so the rope is one strand laid three times around: one closed piece, genus one,
//! that touches itself nowhere.

use crate::material::{Finish, Vec3};
use crate::shape::{MeshBuilder, P, across};
use crate::texture_field::{blend, color, noise};
use std::f64::consts::TAU;

/// Yarns of a strand, each a part; two of them are coloured.
const YARNS: usize = 8;
/// Points across a yarn, and around a strand.
const ACROSS: usize = 5;
const AROUND: usize = YARNS * ACROSS;
const LAPS: usize = 3;
/// Rings of the strand per lap.
const RINGS: usize = 860;
/// Metres per unit of the curve, and its thickness along the axis of symmetry in units.
const SCALE: f64 = 0.0265;
const DEPTH: f64 = 1.0;
/// From the rope's axis to a strand's, and the strand's radii outward and across.
const OFFSET: f64 = 0.0084;
const RADII: [f64; 2] = [0.0067, 0.0057];
/// Turns of the lay in one lap, a third beyond a whole number.
const LAY: f64 = 9.0 + 1.0 / 3.0;
/// Turns of the yarns in a strand per lap, against the lay; whole over all laps.
const TWIST: f64 = -31.0;

/// Builds the mesh.
pub(crate) fn build() -> MeshBuilder {
    let mut b = MeshBuilder::default();
    let count = LAPS * RINGS;
    let time = |k: usize| TAU * k as f64 / RINGS as f64;
    let mut rings: Vec<Vec<u32>> = (0..count)
        .map(|k| {
            let t = time(k);
            let [u, v] = section(t);
            let center = strand(t);
            b.ring((0..AROUND).map(|i| {
                let (angle, bulge) = (TAU * i as f64 / AROUND as f64, yarn(i));
                // Yarns run along the columns; turning the section turns them around the strand.
                let (s, c) = (angle + TWIST * t).sin_cos();
                (center + u * (RADII[0] * bulge * c) + v * (RADII[1] * bulge * s)).into()
            }))
        })
        .collect();
    // The laps close after a whole number of turns of lay and twist: the seam meets column for column.
    rings.push(rings[0].clone());
    for pair in rings.windows(2) {
        for i in 0..AROUND {
            let j = (i + 1) % AROUND;
            b.part = (i / ACROSS) as u8;
            b.face([pair[0][i], pair[0][j], pair[1][j]]);
            b.face([pair[0][i], pair[1][j], pair[1][i]]);
        }
    }
    b.set_down()
}

/// The rope's axis at `t`, standing upright on two of its three loops.
fn axis(t: f64) -> P {
    let (x, y) = (t.sin() + 2.0 * (2.0 * t).sin(), t.cos() - 2.0 * (2.0 * t).cos());
    P::new(-DEPTH * (3.0 * t).sin(), x, y) * SCALE
}

/// The strand's axis: off the rope's, turning with the lay.
fn strand(t: f64) -> P {
    const H: f64 = 1e-4;
    let tangent = (axis(t + H) - axis(t - H)).normalize();
    // The curve nowhere runs along x, so this frame closes.
    let normal = across(P::x(), tangent);
    let (s, c) = (LAY * t).sin_cos();
    axis(t) + (normal * c + tangent.cross(&normal) * s) * OFFSET
}

/// Two normals of the strand: away from the rope's axis, and across.
fn section(t: f64) -> [P; 2] {
    const H: f64 = 1e-4;
    let tangent = (strand(t + H) - strand(t - H)).normalize();
    let out = across(strand(t) - axis(t), tangent);
    [out, tangent.cross(&out)]
}

/// Relative radius: each yarn bulges.
fn yarn(i: usize) -> f64 {
    let t = (i % ACROSS) as f64 / ACROSS as f64;
    0.93 + 0.09 * (0.5 * TAU * t).sin()
}

/// What it is made of: waxed hemp.
pub(crate) fn finishes() -> Vec<Finish> {
    vec![Finish::glazed(0.45, 1.4)]
}

/// Hemp with one red and one blue yarn; fibres as far as noise can.
pub(crate) fn albedo(p: Vec3, part: u8) -> Vec3 {
    let fibre = noise(p * 1100.0, 3);
    let (light, dark) = match usize::from(part) {
        2 => ([188, 44, 40], [132, 22, 26]),
        6 => ([48, 84, 148], [26, 50, 104]),
        _ => ([226, 202, 158], [176, 142, 98]),
    };
    blend(color(light), color(dark), fibre * fibre) * (0.9 + 0.1 * noise(p * 240.0, 5))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rope_passes_itself_without_touching() {
        let points: Vec<P> = (0..720).map(|k| axis(TAU * f64::from(k) / 720.0)).collect();
        let (mut nearest, apart) = (f64::INFINITY, 90);
        for (i, p) in points.iter().enumerate() {
            for (j, q) in points.iter().enumerate() {
                let laps = i.abs_diff(j).min(720 - i.abs_diff(j));
                if laps > apart {
                    nearest = nearest.min((p - q).norm());
                }
            }
        }
        assert!(nearest > 2.0 * (OFFSET + RADII[0] * 1.02), "{nearest}");
    }

    #[test]
    fn no_strand_runs_into_its_neighbours() {
        for k in (0..LAPS * RINGS).step_by(61) {
            let t = TAU * k as f64 / RINGS as f64;
            let [u, v] = section(t);
            for i in 0..24 {
                let (s, c) = (TAU * f64::from(i) / 24.0).sin_cos();
                let p = strand(t) + (u * (RADII[0] * c) + v * (RADII[1] * s)) * 1.02;
                for lap in [TAU, 2.0 * TAU] {
                    let near = (-60..=60).map(|j| t + lap + f64::from(j) * 0.002);
                    let near = near.min_by(|a, b| (strand(*a) - p).norm().total_cmp(&(strand(*b) - p).norm())).unwrap();
                    let ([a, b], r) = (section(near), p - strand(near));
                    let inside = (a.dot(&r) / RADII[0]).hypot(b.dot(&r) / RADII[1]);
                    assert!(inside > 1.02, "{inside} at {t}");
                }
            }
        }
    }
}
