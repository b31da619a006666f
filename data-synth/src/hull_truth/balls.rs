//! The hull of balls: circular cones.

use super::{check_eyes, too_close};
use crate::SynthError;
use crate::isosurface::{Grid, extract};
use capture::Aabb;
use geometry::Mesh;
use nalgebra::{Point3, Vector3};

/// A solid sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Its centre.
    pub center: Point3<f64>,
    /// Its radius, positive.
    pub radius: f64,
}

/// The visual hull of balls.
#[derive(Clone, Debug)]
pub struct BallHull {
    /// Per eye, one cone around each ball.
    views: Vec<Vec<Cone>>,
}

/// All points seen under at most an angle `α` from the axis.
#[derive(Clone, Copy, Debug)]
struct Cone {
    eye: Point3<f64>,
    axis: Vector3<f64>,
    /// `sin α = radius / distance`.
    sin: f64,
    cos: f64,
}

impl BallHull {
    /// The hull of `balls` seen from `eyes`.
    ///
    /// # Errors
    /// [`SynthError::Option`] without eyes or balls, where a number is not finite, a radius not positive, or an
    /// eye within a ball.
    pub fn new(balls: &[Ball], eyes: &[Point3<f64>]) -> Result<Self, SynthError> {
        check_eyes(eyes)?;
        let is_ball = |b: &Ball| b.radius > 0.0 && b.radius.is_finite() && b.center.iter().all(|x| x.is_finite());
        if balls.is_empty() || !balls.iter().all(is_ball) {
            let value = format!("{balls:?}");
            return Err(SynthError::Option { option: "balls", value, allowed: "finite, of positive radius".into() });
        }
        let cone = |eye: &Point3<f64>, ball: &Ball| Cone::new(eye, ball).ok_or_else(|| too_close(eye, "outside balls"));
        let view = |eye: &Point3<f64>| balls.iter().map(|ball| cone(eye, ball)).collect();
        Ok(Self { views: eyes.iter().map(view).collect::<Result<_, _>>()? })
    }

    /// At most zero in the hull. For one ball the size of negative values is the distance from the surface,
    /// and positive ones never exceed it; near creases between cones they fall short.
    pub fn distance(&self, p: &Point3<f64>) -> f64 {
        let in_view = |cones: &Vec<Cone>| cones.iter().map(|cone| cone.distance(p)).fold(f64::INFINITY, f64::min);
        self.views.iter().map(in_view).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Whether a point is in the hull, its surface included.
    pub fn contains(&self, p: &Point3<f64>) -> bool {
        self.distance(p) <= 0.0
    }

    /// The part of the hull in `bounds` as a closed mesh of edges about `step` long. Vertices lie on the
    /// surface to single precision, but within a step of creases, which are cut off.
    ///
    /// # Errors
    /// [`SynthError::Option`] where `step` is not positive, or asks for more than 10⁹ samples.
    pub fn mesh(&self, bounds: &Aabb, step: f64) -> Result<Mesh, SynthError> {
        let samples: f64 = bounds.size().iter().map(|s| s / step + 5.0).product();
        if !(step > 0.0 && samples < 1e9) {
            let allowed = "positive, and no less than a thousandth of the box".into();
            return Err(SynthError::Option { option: "step", value: step.to_string(), allowed });
        }
        let (center, half) = (bounds.center(), bounds.size() / 2.0);
        let field = |p: Vector3<f64>| {
            let from_walls = ((p - center.coords).abs() - half).max();
            self.distance(&Point3::from(p)).max(from_walls)
        };
        Ok(extract(&Grid::around(bounds.min.coords, bounds.max.coords, step), field).mesh)
    }
}

impl Cone {
    /// `None` from within the ball.
    fn new(eye: &Point3<f64>, ball: &Ball) -> Option<Self> {
        let offset = ball.center - eye;
        let distance = offset.norm();
        let sin = ball.radius / distance;
        (sin < 1.0).then(|| Self { eye: *eye, axis: offset / distance, sin, cos: (1.0 - sin * sin).sqrt() })
    }

    /// Signed distance from the cone, negative inside. In the plane through axis and point the cone is a line
    /// from the eye; behind its end the eye itself is nearest.
    fn distance(&self, p: &Point3<f64>) -> f64 {
        let offset = p - self.eye;
        let along = offset.dot(&self.axis);
        let across = (offset - self.axis * along).norm();
        if along * self.cos + across * self.sin > 0.0 { across * self.cos - along * self.sin } else { offset.norm() }
    }
}

#[cfg(test)]
mod tests {
    use super::super::orthographic_ring_ratio;
    use super::*;
    use std::f64::consts::PI;

    const UNIT: Ball = Ball { center: Point3::new(0.0, 0.0, 0.0), radius: 1.0 };

    fn bounds(half: f64) -> Aabb {
        Aabb { min: Point3::new(-half, -half, -half), max: Point3::new(half, half, half) }
    }

    #[test]
    fn a_cone_is_as_far_as_geometry_says() {
        // Half-angle 30°, apex at z = 2, opening downward.
        let hull = BallHull::new(&[UNIT], &[Point3::new(0.0, 0.0, 2.0)]).unwrap();
        for (p, expected) in [
            ([0.0, 0.0, 0.0], -1.0),
            ([0.0, 0.0, 3.0], 1.0),
            ([2.0, 0.0, 2.0], 2.0 * 30_f64.to_radians().cos()),
            // Behind the eye the cone does not go on.
            ([0.1, 0.0, 4.0], 2.0_f64.hypot(0.1)),
        ] {
            assert!((hull.distance(&Point3::from(p)) - expected).abs() < 1e-14, "{p:?}");
        }
    }

    #[test]
    fn a_far_ring_leaves_the_regular_polygon() {
        for views in [2, 3, 6] {
            let eye = |i: usize| (PI * i as f64 / views as f64).sin_cos();
            let eyes: Vec<_> = (0..views).map(eye).map(|(s, c)| Point3::new(c, s, 0.0) * 1e6).collect();
            let mesh = BallHull::new(&[UNIT], &eyes).unwrap().mesh(&bounds(1.6), 0.05).unwrap();
            let ratio = mesh.signed_volume() / (4.0 / 3.0 * PI);
            let expected = orthographic_ring_ratio(views);
            assert!((ratio / expected - 1.0).abs() < 4e-3, "{views}: {ratio} against {expected}");
        }
    }

    /// Where the discs overlap in both views, there may be something for all the silhouettes say.
    #[test]
    fn two_balls_leave_ghosts() {
        let ball = |x: f64, y: f64| Ball { center: Point3::new(x, y, 0.0), radius: 0.5 };
        let eyes = [Point3::new(1e6, 0.0, 0.0), Point3::new(0.0, 1e6, 0.0)];
        let hull = BallHull::new(&[ball(1.0, 1.0), ball(-1.0, -1.0)], &eyes).unwrap();
        assert!(hull.contains(&Point3::new(1.0, 1.0, 0.0)) && hull.contains(&Point3::new(-1.0, 1.0, 0.0)));
        assert!(!hull.contains(&Point3::origin()));
    }

    #[test]
    fn an_eye_in_the_ball_is_refused() {
        let error = BallHull::new(&[UNIT], &[Point3::new(0.5, 0.0, 0.0)]).unwrap_err().to_string();
        assert!(error.contains("eyes") && error.contains("0.5"), "{error}");
        assert!(BallHull::new(&[UNIT], &[]).is_err() && BallHull::new(&[], &[Point3::origin()]).is_err());
        let hull = BallHull::new(&[UNIT], &[Point3::new(3.0, 0.0, 0.0)]).unwrap();
        assert!(hull.mesh(&bounds(1.0), 0.0).is_err() && hull.mesh(&bounds(1.0), 1e-9).is_err());
    }
}
