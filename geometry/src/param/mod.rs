//! From charts to flat charts: every triangle upright, none on another, areas kept.
//!
//! `patch` gives a chart its own vertices, `lscm` flattens it conformally, `relax` evens out its areas,
//! `untangle` turns single flipped triangles back and parts an outline that crosses itself, `check`
//! judges the result; a chart that fails is split in two and both halves start over. A single triangle
//! is always valid, so this ends. `merge` then joins what is small to a neighbour, under the same judge.

mod check;
mod lscm;
mod merge;
mod patch;
mod relax;
mod solve;
mod untangle;

pub(crate) use check::FlatQuality;
pub use check::FlatteningLimits;
use check::signed_area;
pub(crate) use merge::merge_small;
pub(crate) use patch::Patch;

use crate::mesh::Mesh;
use crate::mesh::half_edge::HalfEdges;
use crate::segment::split_in_two;
use nalgebra::Point2;

/// A chart in the plane, in the units of the mesh.
pub(crate) struct FlatChart {
    pub(crate) patch: Patch,
    /// One per vertex of the patch; triangles are counter-clockwise with y up.
    pub(crate) flat: Vec<Point2<f64>>,
    pub(crate) quality: FlatQuality,
}

/// Flattens one chart, in as many parts as it takes. The second value counts the splits.
pub(crate) fn flatten_chart(
    mesh: &Mesh,
    half_edges: &HalfEdges,
    chart: Vec<u32>,
    limits: &FlatteningLimits,
) -> (Vec<FlatChart>, usize) {
    let mut waiting = vec![chart];
    let (mut done, mut splits) = (Vec::new(), 0);
    while let Some(faces) = waiting.pop() {
        match flatten_whole(&Patch::new(mesh, half_edges, &faces), limits) {
            Some((flat, quality)) => {
                done.push(FlatChart { patch: Patch::new(mesh, half_edges, &faces), flat, quality });
            }
            None => {
                splits += 1;
                waiting.extend(split_in_two(mesh, half_edges, &faces));
            }
        }
    }
    (done, splits)
}

/// A valid map of the whole patch; the relaxed one if it is valid, else the conformal one. `None` if
/// neither is, or the patch is not a disc.
fn flatten_whole(patch: &Patch, limits: &FlatteningLimits) -> Option<(Vec<Point2<f64>>, FlatQuality)> {
    if patch.corners.len() == 1 {
        let flat = patch.shapes[0].corners().to_vec();
        let quality = check::judge(patch, &flat);
        return Some((flat, quality));
    }
    if !patch.is_disc() {
        return None;
    }
    let conformal = lscm::flatten(patch)?;
    let accept = |mut flat: Vec<Point2<f64>>| {
        untangle::untangle(patch, &mut flat);
        rescale(patch, &mut flat);
        untangle::part_outline(patch, &mut flat);
        rescale(patch, &mut flat);
        let quality = check::judge(patch, &flat);
        quality.is_valid(limits).then_some((flat, quality))
    };
    let relaxed = relax::relax(patch, &conformal).and_then(accept);
    relaxed.or_else(|| accept(conformal))
}

/// Scales a map to the area of its surface.
fn rescale(patch: &Patch, flat: &mut [Point2<f64>]) {
    let area: f64 = patch.corners.iter().map(|t| signed_area(flat, t)).sum();
    let scale = (patch.area() / area.max(f64::MIN_POSITIVE)).sqrt();
    flat.iter_mut().for_each(|p| *p *= scale);
}
