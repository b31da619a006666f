//! From a mesh to a mesh with an atlas, and what an atlas needs to be painted.
//!
//! `clean` refuses or drops what cannot be unfolded, [`crate::segment`] makes charts,
//! [`crate::param`] flattens them, `place` packs them with one texel density, `assemble` splits the
//! vertices. `texels` says what lies under every texel, `gutter` fills the rest of an atlas image.
//!
//! The same mesh and options give the same atlas on any number of threads: charts are independent,
//! and gathered in order.

mod assemble;
mod clean;
mod gutter;
mod pack;
mod place;
mod texels;

pub use gutter::PushPull;
pub(crate) use texels::overlapping_texels;
pub use texels::{AtlasTexel, AtlasTexels, rasterize, welded_vertex_normals};

use crate::error::GeometryError;
use crate::mesh::half_edge::HalfEdges;
use crate::mesh::{Mesh, TexturedMesh};
use crate::param::{FlatChart, FlatteningLimits, flatten_chart, merge_small};
use crate::segment::{SegmentOptions, segment};
use rayon::prelude::*;

/// How a mesh is unfolded.
#[derive(Clone, Copy, Debug)]
pub struct UnwrapOptions {
    /// World units per texel.
    pub texel_size: f64,
    /// Least number of free texels between two charts, at least 2: what bilinear sampling needs. One
    /// usable mip level more doubles it.
    pub gutter_px: usize,
    /// Largest atlas width and height in texels; density is lowered to fit.
    pub max_atlas_px: usize,
    /// How charts are made.
    pub segment: SegmentOptions,
    /// Which charts are split.
    pub limits: FlatteningLimits,
}

impl UnwrapOptions {
    /// The usual options for a texel of `texel_size` world units: 4 texels of gutter (three mip
    /// levels), at most 4096 texels a side.
    pub fn new(texel_size: f64) -> Self {
        Self {
            texel_size,
            gutter_px: 4,
            max_atlas_px: 4096,
            segment: SegmentOptions::default(),
            limits: FlatteningLimits::default(),
        }
    }
}

/// A mesh with its atlas.
#[derive(Clone, Debug)]
pub struct Unwrapped {
    /// Faces in the order of the input, less the dropped ones. Seen in the picture, every face is
    /// counter-clockwise: no chart is mirrored.
    pub mesh: TexturedMesh,
    /// Per vertex the vertex of the input it was.
    pub sources: Vec<u32>,
    /// What was found, done and lost.
    pub report: UnwrapReport,
}

/// What unfolding found, did and lost.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UnwrapReport {
    /// Charts in the atlas.
    pub charts: usize,
    /// Charts that could not be flattened whole and were cut in two.
    pub splits: usize,
    /// Faces without area, dropped.
    pub dropped_degenerate: usize,
    /// Faces that repeat another, dropped.
    pub dropped_duplicates: usize,
    /// Edges of three faces or more; charts part there.
    pub crowded_edges: usize,
    /// Edges whose two faces disagree about the outside; charts part there.
    pub miswound_edges: usize,
    /// World units per texel in the atlas; more than asked for if `max_atlas_px` was too small.
    pub texel_size: f64,
    /// Area of all charts over area of the atlas.
    pub fill_ratio: f64,
    /// Area-weighted root mean square stretch, 1 for an isometry.
    pub stretch_l2: f64,
    /// Largest `area_ratio` of a chart.
    pub area_ratio: f64,
    /// Length of all chart borders over the square root of the surface area; a cut counts twice.
    pub seam_length: f64,
}

/// Unfolds a mesh into an atlas.
///
/// Borders, edges of many faces and inconsistent winding become chart borders; faces without area and
/// repeated faces are dropped and counted.
///
/// # Errors
/// [`GeometryError::Degenerate`] if the mesh has no face with an area, an index out of range or a
/// coordinate that is not finite, if an option is out of range, or if its charts do not fit
/// `max_atlas_px` at any density.
pub fn unwrap_mesh(mesh: &Mesh, options: &UnwrapOptions) -> Result<Unwrapped, GeometryError> {
    check_options(options)?;
    let clean = clean::clean(mesh)?;
    let half_edges = HalfEdges::new(&clean.unit.faces, clean.unit.positions.len());
    let (charts, splits) = flatten_all(&clean.unit, &half_edges, options);
    let placed = place::place(&charts, clean.scale / options.texel_size, options)?;
    let report = UnwrapReport {
        charts: charts.len(),
        splits,
        dropped_degenerate: clean.degenerate,
        dropped_duplicates: clean.duplicates,
        crowded_edges: half_edges.crowded_edges,
        miswound_edges: half_edges.miswound_edges,
        texel_size: clean.scale / placed.density,
        fill_ratio: placed.fill_ratio,
        ..quality_of(&charts)
    };
    let (mesh, sources) = assemble::assemble(mesh, &clean, &charts, &placed);
    Ok(Unwrapped { mesh, sources, report })
}

fn check_options(options: &UnwrapOptions) -> Result<(), GeometryError> {
    let refuse = |fault: String, remedy: &str| Err(GeometryError::degenerate(fault, remedy));
    if !(options.texel_size.is_finite() && options.texel_size > 0.0) {
        return refuse(format!("a texel cannot measure {} world units", options.texel_size), "choose more than 0");
    }
    if !(16..=1 << 15).contains(&options.max_atlas_px) {
        let fault = format!("the atlas may have at most {} texels a side", options.max_atlas_px);
        return refuse(fault, "choose 16 to 32768");
    }
    if !(2..=256).contains(&options.gutter_px) {
        return refuse(format!("a gutter of {} texels is out of range", options.gutter_px), "choose 2 to 256");
    }
    Ok(())
}

/// Segments and flattens; charts come largest first, equals by their first face.
fn flatten_all(mesh: &Mesh, half_edges: &HalfEdges, options: &UnwrapOptions) -> (Vec<FlatChart>, usize) {
    let parts = segment(mesh, half_edges, &options.segment);
    let flatten = |part: Vec<u32>| flatten_chart(mesh, half_edges, part, &options.limits);
    let flat: Vec<_> = parts.into_par_iter().map(flatten).collect();
    let splits = flat.iter().map(|f| f.1).sum();
    let charts = flat.into_iter().flat_map(|f| f.0).collect();
    let mut charts = merge_small(mesh, half_edges, charts, &options.limits);
    // Rounded, so that equal charts keep their order in any unit.
    charts.sort_by_cached_key(|c| (std::cmp::Reverse((c.patch.area() * 1e12).round() as u64), c.patch.faces[0]));
    (charts, splits)
}

fn quality_of(charts: &[FlatChart]) -> UnwrapReport {
    let total: f64 = charts.iter().map(|c| c.patch.area()).sum();
    let squares: f64 = charts.iter().map(|c| c.patch.area() * c.quality.stretch_l2.powi(2)).sum();
    let borders: f64 = charts.iter().map(|c| c.patch.border_length()).sum();
    UnwrapReport {
        stretch_l2: (squares / total).sqrt(),
        area_ratio: charts.iter().map(|c| c.quality.area_ratio).fold(1.0, f64::max),
        seam_length: borders / total.sqrt(),
        ..UnwrapReport::default()
    }
}
