//! Yarn: plies twisted around each other, each a core with fibres wound around it, and loose ends.

use super::cells::random;
use crate::btf::patch::{Patch, Section, across, sections};
use crate::material::Vec3;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// How a yarn is spun.
#[derive(Clone, Copy, Debug)]
pub(super) struct Yarn {
    /// Half the width, across and along the plane's normal.
    pub(super) radius: [f64; 2],
    /// Plies.
    pub(super) plies: usize,
    /// Turns of the plies over the length of a path; whole, so that the ends meet.
    pub(super) turns: f64,
    /// Fibres wound around each ply.
    pub(super) fibres: usize,
    /// Loose ends over the length of a path.
    pub(super) loose: usize,
    /// Reflectance of the fibres.
    pub(super) color: Vec3,
    /// Of everything random.
    pub(super) seed: u64,
}

/// Sides of a ply's core, and of a fibre.
const CORE_SIDES: usize = 8;
const FIBRE_SIDES: usize = 3;
/// Turns of the fibres in a ply for each turn of the plies, the other way.
const FIBRE_TURNS: f64 = 2.0;

impl Yarn {
    /// Adds the yarn along the points of `path`, whose last is a copy of the first one period on.
    pub(super) fn spin(&self, patch: &mut Patch, path: &[Vector3<f64>]) {
        // A single ply fills the yarn; several lie around its middle, touching.
        let share = if self.plies > 1 { 0.55 } else { 0.0 };
        for ply in 0..self.plies {
            let phase = TAU * ply as f64 / self.plies as f64;
            let middle = self.wound(path, share, self.turns, phase);
            let size = 1.0 - share;
            let core: Vec<Section> = self
                .frames(path)
                .zip(&middle)
                .map(|((u, v), &c)| ellipse(c, u * (0.85 * size), v * (0.85 * size)))
                .collect();
            patch.tube(&core, CORE_SIDES, |_| self.color * 0.8);
            for fibre in 0..self.fibres {
                self.fibre(patch, path, &middle, size, ply, fibre);
            }
        }
        (0..self.loose).for_each(|end| self.loose_end(patch, path, end));
    }

    /// A helix around a ply, at a depth that wanders a little.
    fn fibre(
        &self,
        patch: &mut Patch,
        path: &[Vector3<f64>],
        ply_path: &[Vector3<f64>],
        size: f64,
        ply: usize,
        fibre: usize,
    ) {
        let own = |k: i64| random(self.seed, [ply as i64, fibre as i64, k]);
        let phase = TAU * (fibre as f64 + 0.6 * own(0)) / self.fibres as f64;
        let thick = 0.9 * size * std::f64::consts::PI / self.fibres as f64;
        let last = (path.len() - 1) as f64;
        let wander = |t: f64| 1.0 + 0.07 * (TAU * (t * 2.0 + own(1))).sin();
        let winding = self.frames(path).zip(ply_path).enumerate().map(|(k, ((u, v), &middle))| {
            let t = k as f64 / last;
            let (sin, cos) = (phase - TAU * FIBRE_TURNS * self.turns * t).sin_cos();
            let center = middle + (u * cos + v * sin) * (0.88 * size * wander(t));
            ellipse(center, u * thick, v * thick)
        });
        let tube: Vec<Section> = winding.collect();
        let color = self.color * (0.8 + 0.4 * own(2) as f32);
        patch.tube(&tube, FIBRE_SIDES, |_| color);
    }

    /// A thin fibre that leaves the yarn in an arc.
    fn loose_end(&self, patch: &mut Patch, path: &[Vector3<f64>], end: usize) {
        const POINTS: usize = 7;
        let own = |k: i64| random(self.seed ^ 0x0f1b_4e5d, [end as i64, 0, k]);
        let start = (own(0) * (path.len() - 1) as f64) as usize;
        let length = self.radius[0] * (1.0 + 1.5 * own(1));
        let along = (path[(start + 1).min(path.len() - 1)] - path[start]).normalize();
        let [u, v] = across(along);
        let (sin, cos) = (TAU * own(2)).sin_cos();
        let out = u * cos + v * sin;
        let surface = u * (cos * self.radius[0]) + v * (sin * self.radius[1]);
        let lean = along * (2.0 * own(3) - 1.0) + u * (own(4) - 0.5);
        let bend = Vector3::new(own(5) - 0.5, own(6) - 0.5, own(7) - 0.6) * 1.4;
        let point = |k: usize| {
            let t = k as f64 / (POINTS - 1) as f64;
            path[start] + surface * 0.9 + ((out * 0.7 + lean) * t + bend * (t * t)) * length
        };
        let points: Vec<_> = (0..POINTS).map(point).collect();
        let thick = 0.035 * self.radius[0];
        patch.tube(&sections(&points, |t| thick * (1.0 - 0.6 * t)), FIBRE_SIDES, |_| self.color * 1.1);
    }

    /// A helix around the path, at `share` of the yarn's half widths.
    fn wound(&self, path: &[Vector3<f64>], share: f64, turns: f64, phase: f64) -> Vec<Vector3<f64>> {
        let last = (path.len() - 1) as f64;
        let places = self.frames(path).zip(path).enumerate();
        let helix = places.map(|(k, ((u, v), p))| {
            let (sin, cos) = (phase + TAU * turns * k as f64 / last).sin_cos();
            p + (u * cos + v * sin) * share
        });
        helix.collect()
    }

    /// The half axes across the path at each point; the same at both ends of a period.
    fn frames<'a>(&'a self, path: &'a [Vector3<f64>]) -> impl Iterator<Item = (Vector3<f64>, Vector3<f64>)> + 'a {
        let n = path.len() - 1;
        let period = path[n] - path[0];
        (0..=n).map(move |k| {
            let before = if k == 0 { path[n - 1] - period } else { path[k - 1] };
            let after = if k == n { path[1] + period } else { path[k + 1] };
            let [u, v] = across(after - before);
            (u * self.radius[0], v * self.radius[1])
        })
    }
}

fn ellipse(center: Vector3<f64>, u: Vector3<f64>, v: Vector3<f64>) -> Section {
    Section { center, axes: [u, v] }
}
