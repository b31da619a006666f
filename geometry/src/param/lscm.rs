//! Least squares conformal maps (Lévy, Petitjean, Ray, Maillot 2002, equations 3 to 5).
//!
//! With a triangle laid into the plane as `z = x + iy` and `W_1 = z_3 - z_2` (cyclic), a map
//! `U = u + iv` is conformal on it iff `W·U = 0`. Minimised is `C = Σ_T |W·U|² / d_T`, `d_T` twice the
//! area, with two vertices pinned: `M_ff U_f = -M_fp U_p`, `M = Σ W̄ Wᵀ / d_T` Hermitian. Two pins on a
//! disc leave exactly one minimum. Vertices: n complex unknowns, f64.
//!
//! Neither flips nor overlaps are excluded: see `check`.

use super::patch::Patch;
use super::solve::{Cholesky, Hermitian, dissect};
use nalgebra::{Complex, Point2};

/// Smallest `d_T` against the mean: a sliver's weight grows as 1/d_T and would drown all others
///.
const MIN_AREA_RATIO: f64 = 1e-10;

/// A conformal map of a disc; `None` where the system has no solution to working precision.
pub(super) fn flatten(patch: &Patch) -> Option<Vec<Point2<f64>>> {
    let pins = pins(patch)?;
    let length = (patch.positions[pins[1] as usize] - patch.positions[pins[0] as usize]).norm();
    let mut flat = vec![Complex::new(0.0, 0.0); patch.positions.len()];
    flat[pins[1] as usize] = Complex::new(length, 0.0);
    let (order, rank) = free_order(patch, &pins);
    let terms = conformal_terms(patch);
    let matrix = Hermitian::new(order.len(), &rank, terms.iter().filter(|t| t.0 <= t.1).copied());
    let mut x = vec![Complex::new(0.0, 0.0); order.len()];
    for &(row, column, value) in &terms {
        if let (Some(r), None) = (rank[row as usize], rank[column as usize]) {
            x[r as usize] -= value * flat[column as usize];
        }
    }
    Cholesky::new(&matrix)?.solve(&mut x);
    order.iter().zip(&x).for_each(|(&v, &u)| flat[v as usize] = u);
    let flat: Vec<_> = flat.into_iter().map(|u| Point2::new(u.re, u.im)).collect();
    flat.iter().all(|p| p.x.is_finite() && p.y.is_finite()).then_some(flat)
}

/// Unpinned vertices in elimination order, and per vertex its place there.
pub(super) fn free_order(patch: &Patch, pins: &[u32]) -> (Vec<u32>, Vec<Option<u32>>) {
    let mut order = dissect(&patch.positions, &patch.corners);
    order.retain(|v| !pins.contains(v));
    let mut rank = vec![None; patch.positions.len()];
    order.iter().zip(0..).for_each(|(&v, place)| rank[v as usize] = Some(place));
    (order, rank)
}

/// All nine entries of `W̄ Wᵀ / d_T` of every triangle.
fn conformal_terms(patch: &Patch) -> Vec<(u32, u32, Complex<f64>)> {
    let floor = 2.0 * MIN_AREA_RATIO * patch.area() / patch.shapes.len() as f64;
    let mut terms = Vec::with_capacity(9 * patch.shapes.len());
    for (corners, shape) in patch.corners.iter().zip(&patch.shapes) {
        let z = shape.corners().map(|p| Complex::new(p.x, p.y));
        let w = [z[2] - z[1], z[0] - z[2], z[1] - z[0]];
        let weight = 1.0 / (2.0 * shape.area()).max(floor);
        for j in 0..3 {
            terms.extend((0..3).map(|k| (corners[j], corners[k], w[j].conj() * w[k] * weight)));
        }
    }
    terms
}

/// Two border vertices far apart: the farthest from the border's centroid, and the farthest from that.
fn pins(patch: &Patch) -> Option<[u32; 2]> {
    let border = || patch.border.iter().map(|e| e[0]);
    let position = |v: u32| patch.positions[v as usize];
    let centroid = border().map(|v| position(v).coords).sum::<nalgebra::Vector3<f64>>() / patch.border.len() as f64;
    let farthest_from = |p: nalgebra::Vector3<f64>| {
        border().max_by(|&a, &b| {
            let [a_far, b_far] = [a, b].map(|v| (position(v).coords - p).norm_squared());
            a_far.total_cmp(&b_far).then(b.cmp(&a))
        })
    };
    let first = farthest_from(centroid)?;
    let second = farthest_from(position(first).coords)?;
    (position(first) != position(second)).then_some([first, second])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Mesh;
    use crate::mesh::half_edge::HalfEdges;
    use crate::param::check;
    use crate::param::rescale;
    use nalgebra::Point3;

    /// A disc of rings around a centre, put in space by `place(radius in (0, 1], angle)`.
    fn disc(rings: usize, place: impl Fn(f64, f64) -> Point3<f64>) -> Patch {
        let sectors = 6 * rings;
        let mut mesh = Mesh { positions: vec![place(0.0, 0.0)], faces: Vec::new() };
        let at = |ring: usize, j: usize| (1 + (ring - 1) * sectors + j % sectors) as u32;
        for ring in 1..=rings {
            for j in 0..sectors {
                let angle = std::f64::consts::TAU * j as f64 / sectors as f64;
                mesh.positions.push(place(ring as f64 / rings as f64, angle));
                match ring {
                    1 => mesh.faces.push([0, at(1, j), at(1, j + 1)]),
                    _ => mesh.faces.extend([
                        [at(ring - 1, j), at(ring, j), at(ring, j + 1)],
                        [at(ring - 1, j), at(ring, j + 1), at(ring - 1, j + 1)],
                    ]),
                }
            }
        }
        let half_edges = HalfEdges::new(&mesh.faces, mesh.positions.len());
        let all: Vec<u32> = (0..mesh.faces.len() as u32).collect();
        Patch::new(&mesh, &half_edges, &all)
    }

    fn quality(patch: &Patch) -> check::FlatQuality {
        let mut flat = flatten(patch).unwrap();
        rescale(patch, &mut flat);
        check::judge(patch, &flat)
    }

    /// Known map: a plane stays itself up to similarity.
    #[test]
    fn a_plane_is_reproduced() {
        let q = quality(&disc(12, |r, a| Point3::new(r * a.cos(), 2.0 * r * a.sin(), 0.3 * r * a.cos())));
        assert_eq!((q.flips, q.overlaps), (0, false));
        assert!((q.stretch_l2 - 1.0).abs() < 1e-12 && q.shear < 1.0 + 1e-7, "{q:?}");
    }

    /// Known map: a cone of half-angle 45° develops exactly where its faces do; the mesh of
    /// 72 sectors stands for it within 1 %.
    #[test]
    fn a_cone_patch_develops() {
        let cone = |r: f64, a: f64| {
            let (x, y) = (0.5 + 0.45 * r * a.cos(), 0.9 * r * a.sin());
            Point3::new(x * y.cos(), x * y.sin(), x)
        };
        let q = quality(&disc(20, cone));
        assert!((q.stretch_l2 - 1.0).abs() < 1e-3 && q.shear < 1.01, "{q:?}");
    }

    /// Known map: a hemisphere is mapped conformally, about stereographically: areas 1 to 4.
    #[test]
    fn a_hemisphere_is_conformal() {
        let half = |r: f64, a: f64| {
            let t = r * std::f64::consts::FRAC_PI_2;
            Point3::new(t.sin() * a.cos(), t.sin() * a.sin(), t.cos())
        };
        let q = quality(&disc(24, half));
        assert_eq!((q.flips, q.overlaps), (0, false));
        assert!(q.shear < 1.05 && (2.5..4.5).contains(&q.area_ratio), "{q:?}");
    }
}
