//! Visual hulls known without carving them.
//!
//! A point is in the hull of a solid seen from some eyes if and only if every line of sight through it meets
//! the solid (A. Laurentini, *The Visual Hull Concept for Silhouette-Based Image Understanding*, PAMI 16(2),
//! 1994). This is exact, and for three kinds of solid more can be said:
//!
//! - [`BallHull`]: each eye sees a ball as a disc, so the hull is an intersection of unions of circular cones,
//!   with a distance field;
//! - [`ConvexHull`]: each eye sees a convex polyhedron within the planes through its outline, so the hull is a
//!   polytope, with planes and an exact mesh;
//! - [`PolyhedronHull`]: of any closed mesh whether a point is in its hull, by tracing every line of sight.
//!   What a ring of cameras leaves in the inner corner of an L-shaped house, for example.
//!
//! Silhouettes are those of ideal pinholes of unlimited frame and resolution.

mod balls;
mod convex;
mod polyhedron;

pub use balls::{Ball, BallHull};
pub use convex::ConvexHull;
pub use polyhedron::PolyhedronHull;

use crate::SynthError;
use nalgebra::Point3;
use std::f64::consts::PI;

/// Volume of the hull relative to that of the object, for a ball or an upright cylinder seen from `views`
/// directions spread evenly over half a turn, from so far that rays are parallel, square to the axis of the
/// turn: `(2n/π) tan(π/2n)`. Every section of the hull is the regular 2n-gon around a circle. Infinite for
/// less than two views.
pub fn orthographic_ring_ratio(views: usize) -> f64 {
    if views < 2 {
        return f64::INFINITY;
    }
    let sides = 2.0 * views as f64;
    sides / PI * (PI / sides).tan()
}

fn check_eyes(eyes: &[Point3<f64>]) -> Result<(), SynthError> {
    if eyes.is_empty() || eyes.iter().any(|eye| !eye.iter().all(|x| x.is_finite())) {
        let value = format!("{} points", eyes.len());
        return Err(SynthError::Option { option: "eyes", value, allowed: "at least one, all finite".into() });
    }
    Ok(())
}

/// An eye within the object or too close to it sees no outline.
fn too_close(eye: &Point3<f64>, allowed: &str) -> SynthError {
    let value = format!("({}, {}, {})", eye.x, eye.y, eye.z);
    SynthError::Option { option: "eyes", value, allowed: allowed.to_owned() }
}
