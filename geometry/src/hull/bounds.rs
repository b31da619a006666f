//! Where the object is, when nobody says.
//!
//! The rays through the silhouettes' middles meet near its middle, the silhouettes' radii bound its size.
//! A coarse hull of silhouettes grown by a coarse cell then holds the true hull between its rays: no part
//! of it, however thin, can slip through. Twice as fine once more gives the box.

use super::cone::Cone;
use super::grid::Grid;
use super::rays::RaySet;
use crate::GeometryError;
use capture::{Aabb, BinaryMatte, View};
use nalgebra::{Matrix3, Point2, Point3, Vector3};
use rayon::prelude::*;

/// Cells along the cube of the first and the second coarse hull.
const COARSE: [f64; 2] = [48.0, 96.0];
/// How often the first cube is enlarged before an open hull is accepted as such.
const ENLARGEMENTS: usize = 6;

/// A silhouette seen as a round one.
struct Sight {
    center: Point3<f64>,
    direction: Vector3<f64>,
    /// Tangent of its angular radius.
    radius: f64,
    /// Pixels per unit on the plane at distance one.
    focal: f64,
}

/// A box that holds the hull of silhouettes grown by `grow_px`, with a margin of a few pixels.
///
/// # Errors
/// The views do not determine one: all look along one direction, or no point is in all silhouettes.
pub(super) fn find_box(views: &[View], grow_px: f64, allowed: u32) -> Result<Aabb, GeometryError> {
    let sights: Vec<Sight> = views.par_iter().filter_map(sight).collect();
    let middle = nearest_point(&sights)?;
    let mut half = half_size(&sights, &middle);
    let mut found = Aabb { min: middle - Vector3::repeat(half), max: middle + Vector3::repeat(half) };
    for _ in 0..ENLARGEMENTS {
        let coarse = coarse_bounds(views, &sights, grow_px, allowed, &found, COARSE[0])?;
        if !coarse.touches {
            found = coarse.aabb;
            break;
        }
        half *= 1.6;
        found = Aabb { min: middle - Vector3::repeat(half), max: middle + Vector3::repeat(half) };
    }
    Ok(coarse_bounds(views, &sights, grow_px, allowed, &found, COARSE[1])?.aabb)
}

/// Median over views of the world size of a pixel at `point`.
pub(super) fn pixel_size(views: &[View], point: &Point3<f64>) -> f64 {
    let size = |view: &View| {
        let focal = (view.camera.intrinsics.fx * view.camera.intrinsics.fy).sqrt();
        view.camera.to_camera(point).z.abs() / focal
    };
    median(views.iter().map(size).collect())
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

fn sight(view: &View) -> Option<Sight> {
    let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
    for y in 0..view.matte.height() {
        let row = view.matte.row(y);
        let (Some(first), Some(last)) = (row.iter().position(|&m| m >= 128), row.iter().rposition(|&m| m >= 128))
        else {
            continue;
        };
        low = [low[0].min(first), low[1].min(y)];
        high = [high[0].max(last), high[1].max(y)];
    }
    if low[0] > high[0] {
        return None;
    }
    let middle = Point2::new((low[0] + high[0] + 1) as f64 * 0.5, (low[1] + high[1] + 1) as f64 * 0.5);
    let intrinsics = &view.camera.intrinsics;
    let focal = (intrinsics.fx * intrinsics.fy).sqrt();
    let ray = view.camera.ray(middle)?;
    let radius = 0.5 * ((high[0] - low[0] + 1) as f64).hypot((high[1] - low[1] + 1) as f64) / focal;
    Some(Sight { center: ray.origin, direction: ray.direction, radius, focal })
}

/// The point with the least sum of distances to all rays, by reweighted least squares: a few wrong
/// silhouettes do not move it far.
fn nearest_point(sights: &[Sight]) -> Result<Point3<f64>, GeometryError> {
    let mut weights = vec![1.0; sights.len()];
    let mut point = Point3::origin();
    for _ in 0..20 {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (sight, weight) in sights.iter().zip(&weights) {
            let across = (Matrix3::identity() - sight.direction * sight.direction.transpose()) * *weight;
            normal += across;
            right += across * sight.center.coords;
        }
        let scale = normal.trace();
        // Two views 0.2° apart have a smallest eigenvalue of about 3e-6 of the trace.
        let solvable = normal.symmetric_eigenvalues().min() > 1e-6 * scale;
        let inverse = normal.try_inverse().filter(|_| solvable);
        point = Point3::from(inverse.ok_or_else(one_direction)? * right);
        let distance = |s: &Sight| (point - s.center).cross(&s.direction).norm();
        let floor = 1e-3 * median(sights.iter().map(distance).collect()) + 1e-9 * (point - sights[0].center).norm();
        weights = sights.iter().map(|s| 1.0 / distance(s).max(floor).max(1e-300)).collect();
    }
    Ok(point)
}

fn one_direction() -> GeometryError {
    GeometryError::Views {
        fault: "all views look along one direction, so the silhouettes leave the depth open".into(),
        remedy: "add views from the sides, or give the object's box (aabb)".into(),
    }
}

/// Half the edge of a cube around `middle` that most silhouettes fit in.
fn half_size(sights: &[Sight], middle: &Point3<f64>) -> f64 {
    let mut radii: Vec<f64> = sights.iter().map(|s| s.radius * (middle - s.center).norm()).collect();
    radii.sort_by(f64::total_cmp);
    1.3 * radii[(radii.len() - 1) * 9 / 10]
}

struct CoarseBounds {
    aabb: Aabb,
    touches: bool,
}

/// The box around the coarse hull of grown silhouettes in `aabb`.
fn coarse_bounds(
    views: &[View],
    sights: &[Sight],
    grow_px: f64,
    allowed: u32,
    aabb: &Aabb,
    cells: f64,
) -> Result<CoarseBounds, GeometryError> {
    let cell = aabb.size().max() / cells;
    let middle = aabb.center();
    let pixels = median(sights.iter().map(|s| cell * s.focal / (middle - s.center).norm()).collect());
    // The farthest a point can be from its ray is half a diagonal of a cell's face; 10 % for perspective.
    let grow_px = grow_px + 1.1 * std::f64::consts::FRAC_1_SQRT_2 * pixels;
    // Grown by pixels, a matte needs no sub-pixel reading.
    let binary = BinaryMatte::Midpoints;
    let cones = views.par_iter().map(|view| Cone::new(view, binary, grow_px)).collect::<Result<Vec<_>, _>>()?;
    let grid = Grid::new(aabb, cell);
    let sets = [0, 1, 2].map(|axis| RaySet::cast(&cones, axis, &grid, allowed));
    let touches = sets.iter().any(|set| set.wall_crossings(&grid) != [0, 0]);
    let bounds = sets
        .iter()
        .filter_map(RaySet::bounds)
        .reduce(|x, y| [[0, 1, 2].map(|a| x[0][a].min(y[0][a])), [0, 1, 2].map(|a| x[1][a].max(y[1][a]))]);
    let [low, high] = bounds.ok_or_else(|| super::no_common_point(views, &cones, &grid))?;
    Ok(CoarseBounds { aabb: Aabb { min: grid.to_world(low), max: grid.to_world(high) }, touches })
}
