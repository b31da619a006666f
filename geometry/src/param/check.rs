//! What is wrong with a map, exactly enough to accept or split.

use super::patch::Patch;
use nalgebra::Point2;

/// A triangle counts as flipped below this share of its own area.
pub(crate) const MIN_AREA_RATIO: f64 = 1e-3;

/// Up to which distortion a chart is accepted.
#[derive(Clone, Copy, Debug)]
pub struct FlatteningLimits {
    /// Largest ratio of local area scales, between the 2 % and 98 % quantiles by area. Lévy et al. split
    /// at about 2; here most charts stay below 1.5 and 4 catches the failures.
    pub max_area_ratio: f64,
    /// Largest 98 % quantile by area of σ₁/σ₂.
    pub max_shear: f64,
}

impl Default for FlatteningLimits {
    fn default() -> Self {
        Self { max_area_ratio: 4.0, max_shear: 3.0 }
    }
}

/// Distortion of a map from the plane to the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FlatQuality {
    /// Triangles that are upside down or nearly without area in the map.
    pub(crate) flips: usize,
    /// The outline crosses itself, so something lies on something else.
    pub(crate) overlaps: bool,
    /// Area-weighted root mean square of `√((σ₁² + σ₂²) / 2)` of plane → surface; 1 for an isometry.
    pub(crate) stretch_l2: f64,
    /// 98 % over 2 % quantile (by area) of the local area scale.
    pub(crate) area_ratio: f64,
    /// 98 % quantile (by area) of σ₁/σ₂; 1 for a conformal map.
    pub(crate) shear: f64,
}

impl FlatQuality {
    /// No flip, no overlap, and distortion within the limits.
    pub(crate) fn is_valid(&self, limits: &FlatteningLimits) -> bool {
        self.flips == 0 && !self.overlaps && self.area_ratio <= limits.max_area_ratio && self.shear <= limits.max_shear
    }
}

/// Signed area of a triangle, positive counter-clockwise with y up.
pub(crate) fn signed_area(flat: &[Point2<f64>], corners: &[u32; 3]) -> f64 {
    let [a, b, c] = corners.map(|v| flat[v as usize]);
    (b - a).perp(&(c - a)) / 2.0
}

/// Judges a map that has the area of its surface.
pub(super) fn judge(patch: &Patch, flat: &[Point2<f64>]) -> FlatQuality {
    let mut scales = Vec::with_capacity(patch.corners.len());
    let mut shears = Vec::with_capacity(patch.corners.len());
    let (mut flips, mut stretch) = (0, 0.0);
    for (corners, shape) in patch.corners.iter().zip(&patch.shapes) {
        let (area, flat_area) = (shape.area(), signed_area(flat, corners));
        if flat_area.is_nan() || flat_area <= MIN_AREA_RATIO * area {
            flips += 1;
            continue;
        }
        let [large, small] = singular_values(corners, shape, flat);
        stretch += area * (large * large + small * small) / 2.0;
        scales.push((area / flat_area, area));
        shears.push((large / small, area));
    }
    // Without flips, the map covers every point once iff its outline is simple (degree of a map).
    let overlaps = flips == 0 && !crossings(&patch.border, flat, 1).is_empty();
    let ratio = quantile(&mut scales, 0.98) / quantile(&mut scales, 0.02);
    let stretch_l2 = (stretch / patch.area().max(f64::MIN_POSITIVE)).sqrt();
    FlatQuality { flips, overlaps, stretch_l2, area_ratio: ratio, shear: quantile(&mut shears, 0.98) }
}

/// σ₁ ≥ σ₂ of the linear map from the plane to the surface on one triangle.
fn singular_values(corners: &[u32; 3], shape: &super::patch::FlatTriangle, flat: &[Point2<f64>]) -> [f64; 2] {
    let [a, b, c] = corners.map(|v| flat[v as usize]);
    let surface = nalgebra::Matrix2::new(shape.x1, shape.x2, 0.0, shape.y2);
    let plane = nalgebra::Matrix2::from_columns(&[b - a, c - a]);
    let jacobian = surface * plane.try_inverse().unwrap_or_default();
    let (e, f) = ((jacobian.m11 + jacobian.m22) / 2.0, (jacobian.m11 - jacobian.m22) / 2.0);
    let (g, h) = ((jacobian.m21 + jacobian.m12) / 2.0, (jacobian.m21 - jacobian.m12) / 2.0);
    let (q, r) = (e.hypot(h), f.hypot(g));
    [q + r, (q - r).abs().max(f64::MIN_POSITIVE)]
}

/// Weighted quantile; 1 without values.
fn quantile(values: &mut [(f64, f64)], share: f64) -> f64 {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = values.iter().map(|v| v.1).sum();
    let mut left = total * share;
    let found = values.iter().find(|v| {
        left -= v.1;
        left <= 0.0
    });
    found.or(values.last()).map_or(1.0, |v| v.0)
}

/// Pairs of border edges that share no vertex and meet, by their places in `border`; at most `limit`.
/// Sweeps along x.
pub(super) fn crossings(border: &[[u32; 2]], flat: &[Point2<f64>], limit: usize) -> Vec<[usize; 2]> {
    let ends = |e: usize| border[e].map(|v| flat[v as usize]);
    let mut edges: Vec<_> = (0..border.len()).map(|e| (e, ends(e)[0].x.min(ends(e)[1].x))).collect();
    edges.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut found = Vec::new();
    for (i, &(first, _)) in edges.iter().enumerate() {
        let [a, b] = ends(first);
        let end = a.x.max(b.x);
        let later = edges[i + 1..].iter().take_while(|e| e.1 <= end).map(|e| e.0);
        found.extend(later.filter(|&e| !border[e].iter().any(|v| border[first].contains(v))).filter_map(|e| {
            let [c, d] = ends(e);
            segments_meet(a, b, c, d).then_some([first, e])
        }));
        if found.len() >= limit {
            found.truncate(limit);
            break;
        }
    }
    found
}

fn segments_meet(a: Point2<f64>, b: Point2<f64>, c: Point2<f64>, d: Point2<f64>) -> bool {
    if a.y.max(b.y) < c.y.min(d.y) || c.y.max(d.y) < a.y.min(b.y) {
        return false;
    }
    let side = |p: Point2<f64>, q: Point2<f64>, r: Point2<f64>| (q - p).perp(&(r - p));
    let (c_side, d_side) = (side(a, b, c), side(a, b, d));
    let (a_side, b_side) = (side(c, d, a), side(c, d, b));
    c_side * d_side <= 0.0 && a_side * b_side <= 0.0
}
