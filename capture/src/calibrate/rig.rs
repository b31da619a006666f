//! Everything that is estimated, and where it puts a corner.

use super::projection::project;
use crate::Intrinsics;
use nalgebra::{Isometry3, Point2, Point3, UnitQuaternion, Vector2, Vector3};

/// A corner in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Corner {
    /// Position among the rig's points.
    pub(super) point: usize,
    /// Where it is seen.
    pub(super) pixel: Point2<f64>,
    /// Whether it agrees with the others.
    pub(super) is_used: bool,
}

/// A sighting, cleaned.
#[derive(Clone, Debug)]
pub(super) struct Picture {
    /// What is seen; one corner for a point.
    pub(super) corners: Vec<Corner>,
    /// Which film it is of.
    pub(super) film: usize,
    /// Since the start of that film.
    pub(super) time_s: f64,
    /// Whether it takes part in the estimate.
    pub(super) is_used: bool,
}

/// The target as the estimate sees it.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    /// Held.
    Points(Vec<Point3<f64>>),
    /// Held but for how they curl.
    Curled(Curled),
    /// Squares, four points each; marker `fixed` stays where it is. While they are flat all lie in the plane z = 0.
    Squares { side: f64, places: Vec<Isometry3<f64>>, fixed: usize, is_flat: bool },
}

/// A printed board that is no longer flat.
#[derive(Clone, Debug)]
pub(super) struct Curled {
    /// The points in the plane, about their middle.
    flat: Vec<Vector2<f64>>,
    /// Plane to target.
    plane: Isometry3<f64>,
    /// Of the height `½ xᵀ K x` above the plane: the matrix `K`, upper triangle, one over lengths.
    pub(super) curvature: [f64; 3],
    /// From the middle to the farthest point.
    pub(super) reach: f64,
}

/// Where the camera was.
#[derive(Clone, Debug)]
pub(super) enum Poses {
    /// Target to camera, for each picture.
    Free(Vec<Isometry3<f64>>),
    /// `X_camera = segment · Rz(angle) · world_from_target · X`.
    Turning(Turning),
}

/// A platter before a camera that stands still for a segment at a time.
#[derive(Clone, Debug)]
pub(super) struct Turning {
    /// Target to axis: z along it.
    pub(super) world_from_target: Isometry3<f64>,
    /// World to camera at angle 0.
    pub(super) segments: Vec<Isometry3<f64>>,
    /// The picture of each segment whose angle is held, since a camera could turn with the platter.
    pub(super) references: Vec<usize>,
    /// For each picture.
    pub(super) segment_of: Vec<usize>,
    /// For each picture, in radians.
    pub(super) angles: Vec<f64>,
}

/// Lens, target, poses.
#[derive(Clone, Debug)]
pub(super) struct Rig {
    pub(super) lens: Intrinsics,
    pub(super) shape: Shape,
    pub(super) poses: Poses,
}

/// Corner `k` of a square of side 1 about its middle: top left, top right, bottom right, bottom left.
pub(super) fn unit_corner(k: usize) -> Vector3<f64> {
    [[-0.5, 0.5], [0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]].map(|[x, y]| Vector3::new(x, y, 0.0))[k % 4]
}

/// Corner `k` of a square of this side somewhere.
pub(super) fn square_corner(place: &Isometry3<f64>, side: f64, k: usize) -> Point3<f64> {
    place * Point3::from(side * unit_corner(k))
}

/// A square's place in the plane z = 0.
pub(super) fn flat_place(x: f64, y: f64, turn: f64) -> Isometry3<f64> {
    Isometry3::new(Vector3::new(x, y, 0.0), turn * Vector3::z())
}

impl Shape {
    pub(super) fn point(&self, at: usize) -> Point3<f64> {
        match self {
            Self::Points(points) => points[at],
            Self::Curled(curled) => curled.point(at),
            Self::Squares { side, places, .. } => square_corner(&places[at / 4], *side, at % 4),
        }
    }

    pub(super) fn points(&self) -> Vec<Point3<f64>> {
        match self {
            Self::Points(points) => points.clone(),
            Self::Curled(curled) => (0..curled.flat.len()).map(|at| curled.point(at)).collect(),
            Self::Squares { places, .. } => (0..4 * places.len()).map(|at| self.point(at)).collect(),
        }
    }
}

impl Curled {
    /// Without curl yet.
    pub(super) fn new(points: &[Point3<f64>], plane: Isometry3<f64>) -> Self {
        let flat: Vec<Vector2<f64>> = points.iter().map(|p| plane.inverse_transform_point(p).coords.xy()).collect();
        let reach = flat.iter().map(Vector2::norm).fold(0.0, f64::max);
        Self { flat, plane, curvature: [0.0; 3], reach }
    }

    /// Paper keeps its lengths: to the third order the arc `(sin κu, 1 − cos κu) / κ` where `K = κ n nᵀ`, `u = n · x`.
    fn point(&self, at: usize) -> Point3<f64> {
        let x = self.flat[at];
        let [xx, xy, yy] = self.curvature;
        let slope = Vector2::new(xx * x.x + xy * x.y, xy * x.x + yy * x.y);
        let along = x - slope * (slope.dot(&x) / 6.0);
        let height = 0.5 * slope.dot(&x) * (1.0 - slope.norm_squared() / 12.0);
        self.plane * Point3::new(along.x, along.y, height)
    }

    /// How a point moves with each curvature, in the first order.
    pub(super) fn by_curvature(&self, at: usize) -> [Vector3<f64>; 3] {
        let x = self.flat[at];
        let up = self.plane.rotation * Vector3::z();
        [0.5 * x.x * x.x, x.x * x.y, 0.5 * x.y * x.y].map(|height| up * height)
    }

    /// The largest height above the plane.
    pub(super) fn rise(&self) -> f64 {
        let height = |at| self.plane.inverse_transform_point(&self.point(at)).z.abs();
        (0..self.flat.len()).map(height).fold(0.0, f64::max)
    }
}

impl Turning {
    /// World to camera for a picture.
    pub(super) fn camera_from_world(&self, picture: usize) -> Isometry3<f64> {
        turned(&self.segments[self.segment_of[picture]], self.angles[picture])
    }
}

/// World to camera at an angle of the platter.
pub(super) fn turned(segment: &Isometry3<f64>, angle: f64) -> Isometry3<f64> {
    segment * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle)
}

impl Rig {
    /// Target to camera for a picture.
    pub(super) fn pose(&self, picture: usize) -> Isometry3<f64> {
        match &self.poses {
            Poses::Free(poses) => poses[picture],
            Poses::Turning(turning) => turning.camera_from_world(picture) * turning.world_from_target,
        }
    }

    /// From where the rig puts each corner to where it is seen, in pixels; `None` where it puts it out of sight.
    pub(super) fn residuals(&self, picture: usize, corners: &[Corner]) -> Vec<Option<Vector2<f64>>> {
        let pose = self.pose(picture);
        let residual = |c: &Corner| Some(c.pixel - project(&self.lens, &(pose * self.shape.point(c.point)).coords)?);
        corners.iter().map(residual).collect()
    }
}
