//! As-rigid-as-possible relaxation (Liu, Zhang, Xu, Gotsman, Gortler 2008).
//!
//! A conformal map shrinks what bulges; texels are then spent unevenly. A few rounds of the local step
//! (the best rotation `r_T` of every triangle) and the global step (`L u = Σ cot (r_T (z_i - z_j))`, one
//! factorisation for all rounds) trade a little angle for nearly even areas. Cotangents are clamped to
//! [`MIN_COTANGENT`], so that the system stays positive definite on obtuse triangles.

use super::lscm::free_order;
use super::patch::Patch;
use super::rescale;
use super::solve::{Cholesky, Hermitian};
use nalgebra::{Complex, Point2};

/// Rounds; the energy is within a few percent of its limit after this many from a conformal start.
const ROUNDS: usize = 6;

/// Obtuse corners would weigh less than nothing.
const MIN_COTANGENT: f64 = 0.02;

/// Slivers would weigh more than all others together.
const MAX_COTANGENT: f64 = 50.0;

/// A map with smaller area distortion than `start`, which must be of the same patch. `None` where the
/// system has no solution.
pub(super) fn relax(patch: &Patch, start: &[Point2<f64>]) -> Option<Vec<Point2<f64>>> {
    let mut flat = start.to_vec();
    rescale(patch, &mut flat);
    let mut flat: Vec<_> = flat.iter().map(|p| Complex::new(p.x, p.y)).collect();
    let edges = weighted_edges(patch);
    let pin = patch.border.first()?[0];
    let (order, rank) = free_order(patch, &[pin]);
    let factor = Cholesky::new(&Hermitian::new(order.len(), &rank, laplacian(patch, &edges)))?;
    for _ in 0..ROUNDS {
        let mut sums = vec![Complex::new(0.0, 0.0); flat.len()];
        for (corners, edges) in patch.corners.iter().zip(&edges) {
            let rotation = best_rotation(corners, edges, &flat);
            for k in 0..3 {
                let pull = rotation * edges[k].0 * edges[k].1;
                sums[corners[(k + 1) % 3] as usize] += pull;
                sums[corners[k] as usize] -= pull;
            }
        }
        let origin = flat[pin as usize];
        let mut x: Vec<_> = order.iter().map(|&v| sums[v as usize]).collect();
        factor.solve(&mut x);
        order.iter().zip(&x).for_each(|(&v, &u)| flat[v as usize] = u + origin);
    }
    let flat: Vec<_> = flat.into_iter().map(|u| Point2::new(u.re, u.im)).collect();
    flat.iter().all(|p| p.x.is_finite() && p.y.is_finite()).then_some(flat)
}

/// Per triangle and edge k → k+1 its flat vector and cotangent weight.
fn weighted_edges(patch: &Patch) -> Vec<[(Complex<f64>, f64); 3]> {
    let of_triangle = |shape: &super::patch::FlatTriangle| {
        let z = shape.corners();
        [0, 1, 2].map(|k| {
            let (from, to, apex) = (z[k], z[(k + 1) % 3], z[(k + 2) % 3]);
            let cotangent = (from - apex).dot(&(to - apex)) / (2.0 * shape.area()).max(f64::MIN_POSITIVE);
            let edge = to - from;
            (Complex::new(edge.x, edge.y), cotangent.clamp(MIN_COTANGENT, MAX_COTANGENT))
        })
    };
    patch.shapes.iter().map(of_triangle).collect()
}

fn laplacian<'a>(
    patch: &'a Patch,
    edges: &'a [[(Complex<f64>, f64); 3]],
) -> impl Iterator<Item = (u32, u32, Complex<f64>)> + 'a {
    patch.corners.iter().zip(edges).flat_map(|(corners, edges)| {
        (0..3).flat_map(move |k| {
            let (a, b, weight) = (corners[k], corners[(k + 1) % 3], Complex::new(edges[k].1, 0.0));
            [(a, a, weight), (b, b, weight), (a, b, -weight)]
        })
    })
}

/// The rotation that takes a triangle's edges closest to their place in the map.
fn best_rotation(corners: &[u32; 3], edges: &[(Complex<f64>, f64); 3], flat: &[Complex<f64>]) -> Complex<f64> {
    let covariance: Complex<f64> = (0..3)
        .map(|k| (flat[corners[(k + 1) % 3] as usize] - flat[corners[k] as usize]) * edges[k].0.conj() * edges[k].1)
        .sum();
    let norm = covariance.norm();
    if norm > 0.0 { covariance / norm } else { Complex::new(1.0, 0.0) }
}
