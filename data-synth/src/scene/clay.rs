//! Distances for figures modelled of smoothly joined lumps (after Quilez, "Distance functions").

use crate::shape::P;

/// An approximate distance with the right sign and the right slope at the surface.
pub(super) fn ellipsoid(p: P, center: P, radii: P) -> f64 {
    let r = p - center;
    let k0 = r.component_div(&radii).norm();
    let k1 = r.component_div(&radii.component_mul(&radii)).norm();
    if k1 > 1e-9 { k0 * (k0 - 1.0) / k1 } else { -radii.min() }
}

/// Cones of linearly changing radius along a polyline of (x, y, z, radius), joined with softness `k`.
pub(super) fn chain(p: P, points: &[(f64, f64, f64, f64)], k: f64) -> f64 {
    let cone = |w: &[(f64, f64, f64, f64)]| {
        let (a, b) = (P::new(w[0].0, w[0].1, w[0].2), P::new(w[1].0, w[1].1, w[1].2));
        let axis = b - a;
        let t = ((p - a).dot(&axis) / axis.norm_squared()).clamp(0.0, 1.0);
        (p - a - axis * t).norm() - (w[0].3 + (w[1].3 - w[0].3) * t)
    };
    points.windows(2).map(cone).fold(f64::INFINITY, |d, c| if d.is_finite() { smooth_min(d, c, k) } else { c })
}

/// Quilez' quadratic smooth maximum: what is in both, its edge rounded.
pub(super) fn smooth_max(a: f64, b: f64, k: f64) -> f64 {
    -smooth_min(-a, -b, k)
}

/// Quilez' quadratic smooth minimum.
pub(super) fn smooth_min(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - h * h * k * 0.25
}
