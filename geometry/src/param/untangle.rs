//! Single flipped triangles turned back, and outlines that cross themselves parted.
//!
//! Slivers of a hull flip now and then in an otherwise good map. A vertex may lie anywhere in the kernel
//! of its ring, the points that see the whole ring from inside; where it is not empty, its centroid
//! unflips all triangles of the vertex at once.

use super::check::{MIN_AREA_RATIO, crossings, signed_area};
use super::patch::Patch;
use nalgebra::Point2;

/// Sweeps over the flipped triangles; a cluster of them unfolds from its rim inwards.
const SWEEPS: usize = 10;

/// More flips than this share of a chart are no accident, and the chart is better split.
const MAX_SHARE: f64 = 0.1;

/// Rounds in which an outline may part.
const PARTINGS: usize = 12;

/// More crossings than this share of an outline's edges (and [`FEW_CROSSINGS`]) are no accident.
const MAX_CROSSED_SHARE: f64 = 0.2;

/// So many crossings are tried in any outline.
const FEW_CROSSINGS: usize = 8;

/// Share of its own area that a triangle keeps while the outline parts.
const KEPT_AREA: f64 = 0.3;

/// Draws the outline in where it crosses itself.
///
/// Around a border vertex of a noisy hull the chart's angles may exceed 2π: the map is as good as any,
/// but the two sides of the notch lie on each other. They part when the vertices of crossing edges go
/// inwards, at the price of a few smaller triangles.
pub(super) fn part_outline(patch: &Patch, flat: &mut [Point2<f64>]) {
    let limit = FEW_CROSSINGS.max((MAX_CROSSED_SHARE * patch.border.len() as f64) as usize);
    let mut crossed = crossings(&patch.border, flat, limit);
    if crossed.is_empty() || crossed.len() == limit {
        return;
    }
    let fans = triangles_of_vertices(patch);
    for _ in 0..PARTINGS {
        let mut vertices: Vec<u32> = crossed.iter().flatten().flat_map(|&e| patch.border[e]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        vertices.into_iter().for_each(|v| draw_in(patch, &fans[v as usize], v, flat));
        crossed = crossings(&patch.border, flat, limit);
        if crossed.is_empty() {
            break;
        }
    }
}

/// Moves `v` towards the mean of its neighbours, as far as its triangles keep [`KEPT_AREA`].
fn draw_in(patch: &Patch, fan: &[u32], v: u32, flat: &mut [Point2<f64>]) {
    let opposite = fan.iter().flat_map(|&t| opposite_edge(&patch.corners[t as usize], v));
    let sum = opposite.fold(nalgebra::Vector2::zeros(), |sum, w| sum + flat[w as usize].coords);
    let (from, target) = (flat[v as usize], Point2::from(sum / (2 * fan.len()) as f64));
    for share in [0.3, 0.15] {
        flat[v as usize] = from + (target - from) * share;
        let keeps = |&t: &u32| {
            let t = t as usize;
            signed_area(flat, &patch.corners[t]) >= KEPT_AREA * patch.shapes[t].area()
        };
        if fan.iter().all(keeps) {
            return;
        }
    }
    flat[v as usize] = from;
}

/// Moves vertices of flipped and nearly flipped triangles into the kernels of their rings.
pub(super) fn untangle(patch: &Patch, flat: &mut [Point2<f64>]) {
    let flipped = |flat: &[Point2<f64>]| -> Vec<usize> {
        (0..patch.corners.len()).filter(|&t| signed_area(flat, &patch.corners[t]) <= slack(patch, t)).collect()
    };
    let mut bad = flipped(flat);
    if bad.is_empty() || bad.len() as f64 > MAX_SHARE * patch.corners.len() as f64 {
        return;
    }
    let fans = triangles_of_vertices(patch);
    for _ in 0..SWEEPS {
        for &t in &bad {
            for v in patch.corners[t] {
                if signed_area(flat, &patch.corners[t]) <= slack(patch, t) {
                    move_into_kernel(patch, &fans[v as usize], v, flat);
                }
            }
        }
        bad = flipped(flat);
        if bad.is_empty() {
            break;
        }
    }
}

/// The flat area below which a triangle is about to flip; ten times what `check` insists on.
fn slack(patch: &Patch, triangle: usize) -> f64 {
    10.0 * MIN_AREA_RATIO * patch.shapes[triangle].area()
}

fn triangles_of_vertices(patch: &Patch) -> Vec<Vec<u32>> {
    let mut fans = vec![Vec::new(); patch.positions.len()];
    for (corners, t) in patch.corners.iter().zip(0..) {
        corners.iter().for_each(|&v| fans[v as usize].push(t));
    }
    fans
}

/// Puts `v` where all its triangles are upright, if there is such a place.
fn move_into_kernel(patch: &Patch, fan: &[u32], v: u32, flat: &mut [Point2<f64>]) {
    let opposite = fan.iter().map(|&t| opposite_edge(&patch.corners[t as usize], v).map(|w| flat[w as usize]));
    let opposite: Vec<[Point2<f64>; 2]> = opposite.collect();
    let points = || opposite.iter().flatten().copied();
    let low = points().fold(flat[v as usize], |a, p| a.inf(&p));
    let high = points().fold(flat[v as usize], |a, p| a.sup(&p));
    let mut kernel = vec![low, Point2::new(high.x, low.y), high, Point2::new(low.x, high.y)];
    for [a, b] in opposite {
        kernel = clip(&kernel, a, b);
    }
    if kernel.len() >= 3 {
        let sum = kernel.iter().fold(nalgebra::Vector2::zeros(), |sum, p| sum + p.coords);
        flat[v as usize] = Point2::from(sum / kernel.len() as f64);
    }
}

fn opposite_edge(corners: &[u32; 3], v: u32) -> [u32; 2] {
    let k = corners.iter().position(|&c| c == v).unwrap_or(0);
    [corners[(k + 1) % 3], corners[(k + 2) % 3]]
}

/// The part of a convex polygon left of a → b.
fn clip(polygon: &[Point2<f64>], a: Point2<f64>, b: Point2<f64>) -> Vec<Point2<f64>> {
    let height = |p: &Point2<f64>| (b - a).perp(&(p - a));
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, p) in polygon.iter().enumerate() {
        let q = &polygon[(i + 1) % polygon.len()];
        let (hp, hq) = (height(p), height(q));
        if hp >= 0.0 {
            kept.push(*p);
        }
        if (hp > 0.0 && hq < 0.0) || (hp < 0.0 && hq > 0.0) {
            kept.push(p + (q - p) * (hp / (hp - hq)));
        }
    }
    kept
}
