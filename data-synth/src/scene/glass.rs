//! A wine glass of clear crystal with a cut bowl: what is seen lies behind two or four bent surfaces.
//! One closed piece, genus zero: wall, stem and foot are solid.

use crate::material::{Finish, Vec3};
use crate::shape::{MeshBuilder, P, curve};
use crate::texture_field::color;

const AROUND: usize = 240;
/// Flutes cut around the lower bowl, and their depth as a share of the radius.
const FLUTES: f64 = 12.0;
const CUT: f64 = 0.045;
/// Wall at the rim and where the flutes are cut.
const WALL: [f64; 2] = [0.0014, 0.0036];

/// Builds the mesh.
pub(crate) fn build() -> MeshBuilder {
    let mut b = MeshBuilder::default();
    let outside = smooth(&[
        [0.0040, 0.0026],
        [0.0200, 0.0010],
        [0.0330, 0.0],
        [0.0360, 0.0005],
        [0.0364, 0.0014],
        [0.0340, 0.0026],
        [0.0220, 0.0046],
        [0.0100, 0.0092],
        [0.0058, 0.0180],
        [0.0046, 0.0340],
        [0.0046, 0.0480],
        [0.0060, 0.0580],
        [0.0085, 0.0615],
        [0.0076, 0.0655],
        [0.0130, 0.0710],
        [0.0250, 0.0800],
        [0.0330, 0.0930],
        [0.0362, 0.1080],
        [0.0352, 0.1260],
        [0.0322, 0.1440],
        [0.0304, 0.1540],
    ]);
    // The inside follows the outside of the bowl at the wall's thickness, down to its floor.
    let bowl: Vec<[f64; 2]> = outside.iter().copied().filter(|q| q[1] > 0.076).collect();
    let wall = |z: f64| WALL[0] + (WALL[1] - WALL[0]) * ((0.112 - z) / 0.03).clamp(0.0, 1.0);
    let mut profile = outside.clone();
    let rim = outside[outside.len() - 1];
    let half = 0.5 * WALL[0];
    profile.extend((1..=7).map(|k| {
        let (s, c) = (std::f64::consts::PI * f64::from(k) / 8.0).sin_cos();
        [rim[0] - half + half * c, rim[1] + half * s]
    }));
    let inside: Vec<[f64; 2]> = bowl
        .windows(2)
        .rev()
        .map(|w| {
            let [dr, dz] = [w[1][0] - w[0][0], w[1][1] - w[0][1]];
            let t = wall(w[1][1]) / dr.hypot(dz);
            [w[1][0] - dz * t, w[1][1] + dr * t]
        })
        .filter(|q| q[0] > 0.011)
        .collect();
    let floor = inside[inside.len() - 1];
    profile.extend(inside);
    profile.extend((1..=14).map(|k| {
        let t = 1.0 - f64::from(k) / 15.0;
        [floor[0] * t, floor[1] - 0.0034 * (1.0 - t * t)]
    }));
    let last = outside.len();
    let cut = |k: usize, turn: f64| {
        let z = profile[k][1];
        if k >= last || z < 0.0690 {
            return 1.0;
        }
        // Hollow between ridges, running out in round tops.
        let t = FLUTES * turn / std::f64::consts::TAU;
        let x = 2.0 * (t - t.floor()) - 1.0;
        let top = 0.108 - 0.010 * x * x;
        let depth = ((z - 0.0690) / 0.006).clamp(0.0, 1.0) * ((top - z) / 0.006).clamp(0.0, 1.0);
        1.0 - CUT * depth * (1.0 - x * x)
    };
    let rings = b.revolve(&profile, AROUND, cut);
    b.loft(&rings);
    b.close_poles(&rings);
    b
}

fn smooth(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let places: Vec<P> = points.iter().map(|&[r, z]| P::new(r, 0.0, z)).collect();
    curve(&places, 6).iter().map(|p| [p.x, p.z]).collect()
}

/// What it is made of: lead crystal.
pub(crate) fn finishes() -> Vec<Finish> {
    vec![Finish::glass(1.54)]
}

/// Clear.
pub(crate) fn albedo() -> Vec3 {
    color([250, 252, 252])
}
