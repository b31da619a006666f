//! From camera axes to a pixel, with derivatives (Brown 1966).

use super::LensParameter;
use crate::Intrinsics;
use nalgebra::{Matrix2, Matrix2x3, Point2, Vector2, Vector3};

/// A pixel and how it moves.
pub(super) struct Linearised {
    /// Where the point lands.
    pub(super) pixel: Point2<f64>,
    /// By the point in camera axes, 2 × 3.
    pub(super) by_point: Matrix2x3<f64>,
    /// The point on the normalised image plane, before the lens bends it and after.
    plane: Vector2<f64>,
    bent: Vector2<f64>,
}

/// The pixel of a point in camera axes; `None` behind the camera and where the lens model folds.
pub(super) fn project(lens: &Intrinsics, point: &Vector3<f64>) -> Option<Point2<f64>> {
    if point.z.is_nan() || point.z <= 0.0 {
        return None;
    }
    let plane = point.xy() / point.z;
    let bent = if lens.distortion.is_none() { plane } else { lens.distortion.distort(plane)? };
    Some(lens.pixel_from_plane(bent))
}

/// [`project`] with its derivatives.
pub(super) fn linearise(lens: &Intrinsics, point: &Vector3<f64>) -> Option<Linearised> {
    if point.z.is_nan() || point.z <= 0.0 {
        return None;
    }
    let plane = point.xy() / point.z;
    let bent = lens.distortion.distort(plane)?;
    let pixel = lens.pixel_from_plane(bent);
    let to_pixel = Matrix2::new(lens.fx, lens.skew, 0.0, lens.fy) * by_plane(lens, plane);
    let to_plane = Matrix2x3::new(1.0, 0.0, -plane.x, 0.0, 1.0, -plane.y) / point.z;
    Some(Linearised { pixel, by_point: to_pixel * to_plane, plane, bent })
}

/// Derivative of the bent by the straight point on the image plane, 2 × 2.
fn by_plane(lens: &Intrinsics, p: Vector2<f64>) -> Matrix2<f64> {
    let d = &lens.distortion;
    let (x, y, r2) = (p.x, p.y, p.norm_squared());
    let radial = 1.0 + r2 * (d.k1 + r2 * (d.k2 + r2 * d.k3));
    let slope = d.k1 + r2 * (2.0 * d.k2 + r2 * 3.0 * d.k3);
    let across = 2.0 * (x * y * slope + d.p1 * x + d.p2 * y);
    Matrix2::new(
        radial + 2.0 * x * x * slope + 2.0 * d.p1 * y + 6.0 * d.p2 * x,
        across,
        across,
        radial + 2.0 * y * y * slope + 2.0 * d.p2 * x + 6.0 * d.p1 * y,
    )
}

impl Linearised {
    /// By a number of the lens; by the logarithm of focal length and aspect.
    pub(super) fn by_lens(&self, lens: &Intrinsics, parameter: LensParameter) -> Vector2<f64> {
        let r2 = self.plane.norm_squared();
        let (x, y) = (self.plane.x, self.plane.y);
        let bend = |offset: Vector2<f64>| Vector2::new(lens.fx * offset.x + lens.skew * offset.y, lens.fy * offset.y);
        match parameter {
            LensParameter::Focal => Vector2::new(lens.fx * self.bent.x, lens.fy * self.bent.y),
            LensParameter::Aspect => Vector2::new(0.0, lens.fy * self.bent.y),
            LensParameter::Cx => Vector2::x(),
            LensParameter::Cy => Vector2::y(),
            LensParameter::K1 => bend(self.plane * r2),
            LensParameter::K2 => bend(self.plane * (r2 * r2)),
            LensParameter::K3 => bend(self.plane * (r2 * r2 * r2)),
            LensParameter::P1 => bend(Vector2::new(2.0 * x * y, r2 + 2.0 * y * y)),
            LensParameter::P2 => bend(Vector2::new(r2 + 2.0 * x * x, 2.0 * x * y)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::lens::step;
    use super::*;
    use crate::Distortion;

    #[test]
    fn derivatives_are_those_of_the_projection() {
        let distortion = Distortion { k1: -0.2, k2: 0.06, k3: 0.02, p1: 0.003, p2: -0.002 };
        let lens =
            Intrinsics { fx: 900.0, fy: 880.0, skew: 0.0, cx: 330.0, cy: 250.0, distortion, width: 640, height: 480 };
        let point = Vector3::new(0.12, -0.2, 0.7);
        let exact = linearise(&lens, &point).unwrap();
        assert!((exact.pixel - project(&lens, &point).unwrap()).norm() < 1e-12);
        let h = 1e-6;
        for axis in 0..3 {
            let at = |s: f64| project(&lens, &(point + Vector3::ith(axis, s))).unwrap();
            let difference = (at(h) - at(-h)) / (2.0 * h);
            assert!((difference - exact.by_point.column(axis)).norm() < 1e-4, "axis {axis}");
        }
        for parameter in LensParameter::ALL {
            let at = |s: f64| project(&step(&lens, &[parameter], &[s]), &point).unwrap();
            let difference = (at(h) - at(-h)) / (2.0 * h);
            assert!((difference - exact.by_lens(&lens, parameter)).norm() < 1e-5, "{parameter:?}");
        }
    }
}
