//! The hull of any closed mesh: lines of sight.

use super::check_eyes;
use crate::SynthError;
use geometry::Mesh;
use nalgebra::{Point3, Vector3};

/// The visual hull of a closed mesh, point by point. Every line of sight tries every face, which suits solids
/// of up to some hundred.
#[derive(Clone, Debug)]
pub struct PolyhedronHull {
    faces: Vec<[Point3<f64>; 3]>,
    eyes: Vec<Point3<f64>>,
}

impl PolyhedronHull {
    /// The hull of `mesh` seen from `eyes`.
    ///
    /// # Errors
    /// [`SynthError::Option`] without eyes or faces, or where the mesh has a coordinate that is not finite or an
    /// index out of range.
    pub fn new(mesh: &Mesh, eyes: &[Point3<f64>]) -> Result<Self, SynthError> {
        check_eyes(eyes)?;
        let fault = match mesh.check_input() {
            Err(fault) => Some(fault.to_string()),
            Ok(()) => mesh.faces.is_empty().then(|| "without faces".to_owned()),
        };
        if let Some(value) = fault {
            return Err(SynthError::Option { option: "mesh", value, allowed: "a closed mesh".into() });
        }
        let faces = (0..mesh.faces.len()).map(|face| mesh.corners(face)).collect();
        Ok(Self { faces, eyes: eyes.to_vec() })
    }

    /// Whether a point is in the hull: whether every eye's ray through it meets the object. Rays that only
    /// touch it count.
    pub fn contains(&self, p: &Point3<f64>) -> bool {
        let sees = |eye: &Point3<f64>| self.faces.iter().any(|corners| meets(eye, p - eye, corners));
        self.eyes.iter().all(sees)
    }
}

/// Whether a ray meets a triangle. Volumes of the tetrahedra of the ray and each edge have one sign; two faces
/// compute that of their common edge from the same numbers, so no ray slips between them.
fn meets(eye: &Point3<f64>, direction: Vector3<f64>, corners: &[Point3<f64>; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| corner - eye);
    let [u, v, w] = [b.cross(&c), c.cross(&a), a.cross(&b)].map(|normal| normal.dot(&direction));
    let is_inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    // a · (b × c) over the sum is where along the ray; edge-on faces have neighbours that are not.
    is_inside && a.dot(&b.cross(&c)) * (u + v + w) > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{PI, TAU};

    const HEIGHT: f64 = 1.0;

    /// An upright house of plan [−1, 1]² without the quarter x, y > 0: z from 0 to [`HEIGHT`].
    fn house() -> Mesh {
        let plan = [[0.0, 0.0], [0.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [1.0, 0.0]];
        let level = |z: f64| plan.map(|[x, y]| Point3::new(x, y, z));
        let mut faces: Vec<[u32; 3]> = Vec::new();
        // The plan is star-shaped about its first corner.
        for i in 1..5 {
            faces.extend([[0, i + 1, i], [6, 6 + i, 7 + i]]);
        }
        for i in 0..6 {
            let j = (i + 1) % 6;
            faces.extend([[i, j, j + 6], [i, j + 6, i + 6]]);
        }
        Mesh { positions: [level(0.0), level(HEIGHT)].concat(), faces }
    }

    fn ring(views: usize, elevation: f64, first: f64) -> Vec<Point3<f64>> {
        let (s, c) = elevation.sin_cos();
        let at = |i: usize| first + TAU * i as f64 / views as f64;
        (0..views).map(|i| Point3::new(c * at(i).cos(), c * at(i).sin(), s) * 1e6).collect()
    }

    #[test]
    fn the_house_is_a_closed_solid() {
        let check = house().check().unwrap();
        assert!(check.closed_manifold && (check.volume - 3.0 * HEIGHT).abs() < 1e-12, "{check:?}");
    }

    /// From parallel rays at elevation e a point (a, a, z) of the inner corner is carved by the two views along
    /// the diagonal of the plan alone: what comes from outside dives below the floor before the wall, at
    /// `√2 a tan e`, where z is less; what comes over the roof has passed where z is more than that below it.
    #[test]
    fn the_inner_corner_is_filled_as_far_as_the_elevation_says() {
        for elevation_deg in [10.0_f64, 25.0, 35.0] {
            let elevation = elevation_deg.to_radians();
            let hull = PolyhedronHull::new(&house(), &ring(48, elevation, PI / 4.0)).unwrap();
            for a in [0.05, 0.2, 0.35, 0.45] {
                let reach = 2.0_f64.sqrt() * a * elevation.tan();
                for z in [0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98] {
                    let expected = z >= reach && z <= HEIGHT - reach;
                    assert_eq!(hull.contains(&Point3::new(a, a, z)), expected, "{elevation_deg}° {a} {z}");
                }
            }
        }
    }

    /// A ring in the plane sees every plan as its convex hull: here without the triangle beyond x + y = 1.
    #[test]
    fn a_level_ring_fills_the_corner_up_to_the_convex_hull() {
        let hull = PolyhedronHull::new(&house(), &ring(48, 0.0, PI / 4.0)).unwrap();
        for (x, y) in [(0.1, 0.1), (0.45, 0.5), (0.9, 0.05)] {
            assert!(hull.contains(&Point3::new(x, y, 0.5)));
        }
        for (x, y) in [(0.55, 0.5), (0.9, 0.15), (1.05, 0.0), (-0.5, 1.01)] {
            assert!(!hull.contains(&Point3::new(x, y, 0.5)), "{x} {y}");
        }
    }

    #[test]
    fn the_hull_holds_the_object_and_nothing_behind_the_eye() {
        let eyes = [Point3::new(4.0, 0.5, 0.7), Point3::new(-0.3, 5.0, 2.0), Point3::new(-3.0, -3.0, 1.0)];
        let hull = PolyhedronHull::new(&house(), &eyes).unwrap();
        for i in 0..1000 {
            let p = Point3::new(
                f64::from(i % 10) / 5.0 - 0.9,
                f64::from(i / 10 % 10) / 5.0 - 0.9,
                f64::from(i / 100) / 10.0,
            );
            assert!((p.x > 0.0 && p.y > 0.0) || hull.contains(&(p + Vector3::new(0.0, 0.0, 0.05))), "{p}");
        }
        let alone = PolyhedronHull::new(&house(), &eyes[..1]).unwrap();
        assert!(alone.contains(&Point3::new(-6.0, 0.0, 0.3)) && !alone.contains(&Point3::new(8.0, 1.0, 1.0)));
        assert!(PolyhedronHull::new(&Mesh::default(), &eyes).is_err());
    }
}
