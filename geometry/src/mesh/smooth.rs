//! Smoothing that does not shrink (Taubin 1995).
//!
//! Steps `x += λ L x` and `x += μ L x` alternate, `L` the umbrella operator with eigenvalues in [0, 2]:
//! a frequency `k` is scaled by `(1 - λk)(1 - μk)`, which is near 1 below the pass band
//! `1/λ + 1/μ`. Creases of a visual hull are shape, not noise: a few iterations are enough there.

use super::Mesh;
use super::half_edge::{HalfEdges, NO_TWIN, end, start};
use nalgebra::Vector3;

/// How strongly a mesh is smoothed.
#[derive(Clone, Copy, Debug)]
pub struct TaubinOptions {
    /// Pairs of steps.
    pub iterations: usize,
    /// The shrinking step, in (0, 0.7).
    pub lambda: f64,
    /// The growing step, below `-lambda`.
    pub mu: f64,
}

impl Default for TaubinOptions {
    /// Ten iterations; pass band 0.089. Taubin's (0.6307, -0.6732) smooths faster and swells what lies
    /// inside the band by 5 % in 50 iterations, these by 1 %.
    fn default() -> Self {
        Self { iterations: 10, lambda: 0.33, mu: -0.34 }
    }
}

/// Smooths vertex positions; faces stay. Vertices on a border or without faces stay where they are, and
/// faces with an index out of range are ignored.
pub fn taubin_smooth(mesh: &Mesh, options: &TaubinOptions) -> Mesh {
    let n = mesh.positions.len();
    let faces: Vec<[u32; 3]> = mesh.faces.iter().copied().filter(|f| f.iter().all(|&v| (v as usize) < n)).collect();
    let half_edges = HalfEdges::new(&faces, n);
    let mut fixed = vec![false; n];
    for h in (0..half_edges.twins.len() as u32).filter(|&h| half_edges.twins[h as usize] == NO_TWIN) {
        fixed[start(&faces, h) as usize] = true;
        fixed[end(&faces, h) as usize] = true;
    }
    let mut smoothed = mesh.clone();
    for step in [options.lambda, options.mu].repeat(options.iterations) {
        umbrella_step(&mut smoothed, &faces, &fixed, step);
    }
    smoothed
}

/// Moves every vertex by `step` towards the mean of its neighbours.
fn umbrella_step(mesh: &mut Mesh, faces: &[[u32; 3]], fixed: &[bool], step: f64) {
    let mut sums = vec![(Vector3::zeros(), 0.0); fixed.len()];
    for h in 0..3 * faces.len() as u32 {
        // Around an inner vertex every neighbour is the end of exactly one half-edge.
        let (from, to) = (start(faces, h) as usize, end(faces, h) as usize);
        sums[from].0 += mesh.positions[to] - mesh.positions[from];
        sums[from].1 += 1.0;
    }
    for (v, (sum, count)) in sums.into_iter().enumerate() {
        if count > 0.0 && !fixed[v] {
            mesh.positions[v] += sum * (step / count);
        }
    }
}
