//! Everything that is estimated, and where it puts a corner.

use super::projection::project;
use crate::Intrinsics;
use nalgebra::{Isometry3, Point2, Point3, UnitQuaternion, Vector3};

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
    /// Squares, four points each; marker `fixed` stays where it is. While they are flat all lie in the plane z = 0.
    Squares { side: f64, places: Vec<Isometry3<f64>>, fixed: usize, is_flat: bool },
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
            Self::Squares { side, places, .. } => square_corner(&places[at / 4], *side, at % 4),
        }
    }

    pub(super) fn points(&self) -> Vec<Point3<f64>> {
        match self {
            Self::Points(points) => points.clone(),
            Self::Squares { places, .. } => (0..4 * places.len()).map(|at| self.point(at)).collect(),
        }
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
    pub(super) fn residuals(&self, picture: usize, corners: &[Corner]) -> Vec<Option<nalgebra::Vector2<f64>>> {
        let pose = self.pose(picture);
        let residual = |c: &Corner| Some(c.pixel - project(&self.lens, &(pose * self.shape.point(c.point)).coords)?);
        corners.iter().map(residual).collect()
    }
}
