//! Maps between planes: normalised linear estimate, refined, and robust against misread points.

use nalgebra::{DMatrix, Matrix3, Point2, SMatrix, SVector, SymmetricEigen, Vector2};

/// A point of the plane and where it is seen.
pub(super) type Pair = (Point2<f64>, Point2<f64>);

/// Samples of four pairs tried; with a third of the pairs wrong one of them is right but for once in 10⁶ pictures.
const SAMPLES: usize = 64;
/// Steps of the refinement.
const STEPS: usize = 5;

/// Where a homography sends a point; `None` on or beyond the horizon of its positive side.
pub(super) fn apply(map: &Matrix3<f64>, p: &Point2<f64>) -> Option<Point2<f64>> {
    let h = map * p.to_homogeneous();
    (h.z > 0.0).then(|| Point2::new(h.x / h.z, h.y / h.z))
}

/// The homography (3 × 3, positive third coordinate at the middle of the points) of least squared distances in the
/// second plane: the linear estimate in normalised coordinates (Hartley 1997), refined. `None` for fewer than four
/// pairs or points in a line.
pub(super) fn fit(pairs: &[Pair]) -> Option<Matrix3<f64>> {
    if pairs.len() < 4 {
        return None;
    }
    let (from, to) = (normalising(pairs.iter().map(|p| p.0))?, normalising(pairs.iter().map(|p| p.1))?);
    let scaled: Vec<Pair> =
        pairs.iter().map(|(a, b)| Some((apply(&from, a)?, apply(&to, b)?))).collect::<Option<_>>()?;
    let mut map = linear(&scaled)?;
    for _ in 0..STEPS {
        map = refined(&map, &scaled)?;
    }
    let map = to.try_inverse()? * map * from;
    map.iter().all(|v| v.is_finite()).then_some(map)
}

/// [`fit`] to the pairs that agree with most others (least median of squares, Rousseeuw 1984), which are told.
pub(super) fn fit_robust(pairs: &[Pair], seed: u64) -> Option<(Matrix3<f64>, Vec<bool>)> {
    let all = fit(pairs);
    if pairs.len() < 8 || all.as_ref().is_some_and(|map| agree(map, pairs)) {
        return all.map(|map| (map, vec![true; pairs.len()]));
    }
    let mut best = all.map(|map| (median(&distances(&map, pairs)), map));
    let mut state = seed ^ 0x9e37_79b9_7f4a_7c15;
    for _ in 0..SAMPLES {
        let sample: Vec<Pair> = (0..4).map(|_| pairs[draw(&mut state, pairs.len())]).collect();
        let Some(map) = fit(&sample) else { continue };
        let spread = median(&distances(&map, pairs));
        if best.as_ref().is_none_or(|(least, _)| spread < *least) {
            best = Some((spread, map));
        }
    }
    let (spread, map) = best?;
    // Four robust deviations; a little more for what a lens bends.
    let limit = 4.0 * 1.4826 * spread + 1e-3 * extent(pairs);
    let agrees: Vec<bool> = distances(&map, pairs).iter().map(|&d| d <= limit).collect();
    let kept: Vec<Pair> = pairs.iter().zip(&agrees).filter(|(_, a)| **a).map(|(p, _)| *p).collect();
    Some((fit(&kept)?, agrees))
}

/// Whether pairs lie about as far from where the map puts them as noise would.
fn agree(map: &Matrix3<f64>, pairs: &[Pair]) -> bool {
    let (distances, extent) = (distances(map, pairs), extent(pairs));
    let middle = median(&distances);
    middle < 3e-3 * extent && distances.iter().all(|&d| d <= 4.0 * middle + 1e-3 * extent)
}

/// RMS distance in the second plane.
pub(super) fn rms(map: &Matrix3<f64>, pairs: &[Pair]) -> f64 {
    (distances(map, pairs).iter().map(|d| d * d).sum::<f64>() / pairs.len() as f64).sqrt()
}

fn distances(map: &Matrix3<f64>, pairs: &[Pair]) -> Vec<f64> {
    pairs.iter().map(|(a, b)| apply(map, a).map_or(f64::MAX.sqrt(), |seen| (seen - b).norm())).collect()
}

/// The middle of the sorted values; 0 of none.
pub(super) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// SplitMix64 (Steele 2014) to a number below `limit`.
fn draw(state: &mut u64, limit: usize) -> usize {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) % limit as u64) as usize
}

fn extent(pairs: &[Pair]) -> f64 {
    let size = |axis: usize| {
        let values = pairs.iter().map(|(_, b)| b[axis]);
        values.clone().fold(f64::NEG_INFINITY, f64::max) - values.fold(f64::INFINITY, f64::min)
    };
    size(0).hypot(size(1))
}

/// Moves the mean to 0 and the RMS distance from it to √2.
fn normalising(points: impl Iterator<Item = Point2<f64>> + Clone) -> Option<Matrix3<f64>> {
    let n = points.clone().count() as f64;
    let mean = points.clone().map(|p| p.coords).sum::<Vector2<f64>>() / n;
    let spread = (points.map(|p| (p.coords - mean).norm_squared()).sum::<f64>() / n).sqrt();
    let s = std::f64::consts::SQRT_2 / spread;
    s.is_finite().then(|| Matrix3::new(s, 0.0, -s * mean.x, 0.0, s, -s * mean.y, 0.0, 0.0, 1.0))
}

/// The eigenvector of the least eigenvalue of `AᵀA` (9 × 9), two rows of `A` a pair, as a map that keeps its middle in
/// front.
fn linear(pairs: &[Pair]) -> Option<Matrix3<f64>> {
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    for (a, b) in pairs {
        let rows = [
            [a.x, a.y, 1.0, 0.0, 0.0, 0.0, -b.x * a.x, -b.x * a.y, -b.x],
            [0.0, 0.0, 0.0, a.x, a.y, 1.0, -b.y * a.x, -b.y * a.y, -b.y],
        ];
        for row in rows.map(SVector::<f64, 9>::from) {
            normal += row * row.transpose();
        }
    }
    let eigen = SymmetricEigen::try_new(normal, 1e-15, 1000)?;
    let mut order: Vec<usize> = (0..9).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    // Points in a line leave a second map that fits.
    if eigen.eigenvalues[order[1]] < 1e-12 * eigen.eigenvalues[order[8]] {
        return None;
    }
    let h = eigen.eigenvectors.column(order[0]);
    let map = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], h[8]);
    // The middle of the points is the origin; it is seen, so its third coordinate is not zero.
    (h[8].abs() > 1e-9).then(|| map / h[8])
}

/// One Gauss–Newton step on the distances; the map as it was where that makes them longer.
fn refined(map: &Matrix3<f64>, pairs: &[Pair]) -> Option<Matrix3<f64>> {
    let mut normal = SMatrix::<f64, 8, 8>::zeros();
    let mut gradient = SVector::<f64, 8>::zeros();
    for (a, b) in pairs {
        let h = map * a.to_homogeneous();
        if h.z <= 0.0 {
            return Some(*map);
        }
        let (u, v, w) = (h.x / h.z, h.y / h.z, 1.0 / h.z);
        let rows = [
            ([a.x * w, a.y * w, w, 0.0, 0.0, 0.0, -u * a.x * w, -u * a.y * w], b.x - u),
            ([0.0, 0.0, 0.0, a.x * w, a.y * w, w, -v * a.x * w, -v * a.y * w], b.y - v),
        ];
        for (row, residual) in rows {
            let row = SVector::<f64, 8>::from(row);
            normal += row * row.transpose();
            gradient += row * residual;
        }
    }
    let Some(factor) = normal.cholesky() else { return Some(*map) };
    let d = factor.solve(&gradient);
    let next = map + Matrix3::new(d[0], d[1], d[2], d[3], d[4], d[5], d[6], d[7], 0.0);
    Some(if rms(&next, pairs) < rms(map, pairs) { next } else { *map })
}

/// Fifth over first singular value of the constraints `h₁ᵀωh₂ = 0`, `h₁ᵀωh₁ = h₂ᵀωh₂` that views of a plane put on the
/// image of the absolute conic (Zhang 2000), rows of unit length, in image coordinates of about one. Four and fewer
/// independent ones do not determine a lens.
pub(super) fn constraint_ratio(maps: &[Matrix3<f64>], [width, height]: [usize; 2]) -> f64 {
    let (w, h) = (width as f64, height as f64);
    let scale = 2.0 / w.max(h);
    let normalise = Matrix3::new(scale, 0.0, -0.5 * scale * w, 0.0, scale, -0.5 * scale * h, 0.0, 0.0, 1.0);
    let mut rows = DMatrix::zeros(2 * maps.len(), 6);
    for (k, map) in maps.iter().enumerate() {
        let map = normalise * map;
        let v = |i: usize, j: usize| {
            let (a, b) = (map.column(i), map.column(j));
            SVector::<f64, 6>::from([
                a[0] * b[0],
                a[0] * b[1] + a[1] * b[0],
                a[1] * b[1],
                a[2] * b[0] + a[0] * b[2],
                a[2] * b[1] + a[1] * b[2],
                a[2] * b[2],
            ])
        };
        // In one unit, so that a scale of the plane weighs nothing.
        let size = v(0, 0).norm() + v(1, 1).norm();
        rows.set_row(2 * k, &(v(0, 1) / size).transpose());
        rows.set_row(2 * k + 1, &((v(0, 0) - v(1, 1)) / size).transpose());
    }
    let Some(eigen) = SymmetricEigen::try_new(rows.tr_mul(&rows), 1e-15, 1000) else { return 0.0 };
    let mut values: Vec<f64> = eigen.eigenvalues.iter().map(|v| v.max(0.0).sqrt()).collect();
    values.sort_by(|a, b| b.total_cmp(a));
    if values[0] > 0.0 { values[4] / values[0] } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(map: &Matrix3<f64>) -> Vec<Pair> {
        let at = |k: usize| Point2::new(0.03 * (k % 6) as f64, 0.03 * (k / 6) as f64);
        (0..30).map(|k| (at(k), apply(map, &at(k)).unwrap())).collect()
    }

    #[test]
    fn an_exact_map_comes_back_and_misread_points_are_told() {
        let map = Matrix3::new(1800.0, 300.0, 200.0, -150.0, 1500.0, 100.0, 0.4, -0.8, 1.0);
        let mut pairs = grid(&map);
        assert!(rms(&fit(&pairs).unwrap(), &pairs) < 1e-9);
        for wrong in [3, 11, 12, 20, 26, 27] {
            pairs[wrong].1 += Vector2::new(40.0 + wrong as f64, -35.0);
        }
        let (found, agrees) = fit_robust(&pairs, 1).unwrap();
        assert_eq!(agrees.iter().filter(|a| !**a).count(), 6);
        assert!(rms(&found, &grid(&map)) < 1e-6);
    }

    #[test]
    fn points_in_a_line_fix_no_map() {
        let pairs: Vec<Pair> =
            (0..9).map(|k| (Point2::new(f64::from(k), 0.0), Point2::new(f64::from(2 * k), 3.0))).collect();
        assert_eq!(fit(&pairs), None);
        assert_eq!(fit(&pairs[..3]), None);
        assert_eq!(fit(&[pairs[0]; 5]), None);
    }
}
