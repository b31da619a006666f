//! The visual hull: the largest solid with the given silhouettes, by Marching Intersections.
//!
//! Three families of axis-parallel rays are intersected with the cones of all silhouettes, exactly and
//! with sub-pixel contours; Boolean operations on solids are Boolean operations on intervals of a
//! ray. A pass like marching cubes then joins the crossings to a mesh.
//!
//! Source: C. Rocchini, P. Cignoni, F. Ganovelli, C. Montani, P. Pingi, R. Scopigno, *Marching
//! Intersections: an efficient resampling algorithm for surface management*, SMI 2001; M. Tarini, M.
//! Callieri, C. Montani, C. Rocchini, K. Olsson, T. Persson, *Marching Intersections: an efficient approach
//! to shape-from-silhouette*, VMV 2002.
//!
//! - Input: `n` views with mattes; pixels outside the frame of an incomplete view are unknown and carve
//!   nothing; nothing behind a camera is carved.
//! - Output: a closed, oriented 2-manifold, perhaps of several parts, whose vertices lie on the cones to
//!   rounding. Features thinner than a cell that pass between rays are lost; those met are counted.
//! - Cost for `N` cells along each side: time about `3 N² n`, memory about `20 B · surface in cells` and no
//!   more than a few planes of nodes. The result does not depend on the number of threads.

mod bounds;
mod choose;
mod cone;
mod extract;
mod grid;
mod intervals;
mod rays;
mod table;

use crate::{GeometryError, Mesh};
use capture::{Aabb, BinaryMatte, View};
pub use choose::{HullChoice, HullTrial, choose_hull};
use cone::Cone;
use grid::Grid;
use rayon::prelude::*;
use rays::RaySet;
use std::time::Instant;

/// How a hull is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HullOptions {
    /// Cells along the longest side of the box; `None` for [`PIXELS_PER_CELL`] pixels a cell.
    pub resolution: Option<usize>,
    /// Views that may have a point outside their silhouette without carving it.
    pub consensus: usize,
    /// Offset of all silhouettes in pixels, positive outwards.
    pub grow_px: f64,
    /// All that can be inside. The hull is cut there and closed; see [`HullReport::wall_crossings`].
    /// `None` to find the box of the object.
    pub aabb: Option<Aabb>,
    /// How binary mattes are read.
    pub binary: BinaryMatte,
    /// Parts with less than this fraction of the volume are left out: debris where cones of inexact
    /// silhouettes graze each other. 0 keeps all.
    pub least_part: f64,
}

impl Default for HullOptions {
    /// Strict intersection of the silhouettes as they are, at automatic resolution in a box to be found,
    /// without parts below 1e-4 of the volume.
    fn default() -> Self {
        Self { resolution: None, consensus: 0, grow_px: 0.0, aabb: None, binary: BinaryMatte::Fit, least_part: 1e-4 }
    }
}

/// A visual hull.
#[derive(Clone, Debug)]
pub struct Hull {
    /// Closed and oriented; world units.
    pub mesh: Mesh,
    /// Edge of a grid cell in world units.
    pub cell: f64,
    /// The box in which it was sought.
    pub aabb: Aabb,
    /// How it went.
    pub report: HullReport,
}

/// What was counted on the way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HullReport {
    /// Views used.
    pub views: usize,
    /// Of these, views whose silhouette fills the frame and that carve nothing.
    pub unconstrained_views: usize,
    /// Views forgiven at every point.
    pub consensus: usize,
    /// Offset of the silhouettes in pixels.
    pub grow_px: f64,
    /// Grid nodes along x, y and z.
    pub nodes: [usize; 3],
    /// Crossings of the rays with the hull.
    pub crossings: usize,
    /// Edges where two ray families disagreed. More than 0.1 % of the crossings means a fault.
    pub conflicts: usize,
    /// Pairs of crossings within one edge, lost. More than 0.5 % of the crossings asks for a finer grid.
    pub lost_pairs: usize,
    /// Parts left out for being small.
    pub small_parts: usize,
    /// Crossings on the walls of the box, lower and upper along x, y, z: where not zero, the box cuts
    /// the hull or the views leave it open there.
    pub wall_crossings: [[usize; 2]; 3],
    /// Seconds to find contours and box.
    pub contour_s: f64,
    /// Seconds to intersect rays with cones.
    pub carve_s: f64,
    /// Seconds to extract the mesh.
    pub extract_s: f64,
}

/// Pixels per cell at automatic resolution. One pixel resolves all that silhouettes hold, and each
/// halving costs four times the faces.
pub const PIXELS_PER_CELL: f64 = 1.25;
/// Largest resolution; vertex numbers and node bits stay in bounds.
pub const MAX_RESOLUTION: usize = 2048;
/// Largest automatic resolution.
const MAX_AUTO_RESOLUTION: f64 = 1024.0;

/// The visual hull of `views`.
///
/// # Errors
/// An option out of range; a view with an empty silhouette or an impossible camera; no view that
/// carves; no point common to the silhouettes; all views from one direction and no box given.
pub fn visual_hull(views: &[View], options: &HullOptions) -> Result<Hull, GeometryError> {
    check_options(views, options)?;
    let start = Instant::now();
    let cones =
        views.par_iter().map(|view| Cone::new(view, options.binary, options.grow_px)).collect::<Result<Vec<_>, _>>()?;
    let unconstrained_views = cones.iter().filter(|cone| cone.is_unconstrained()).count();
    if options.consensus + unconstrained_views >= views.len() {
        return Err(nothing_carves(views.len(), unconstrained_views, options.consensus));
    }
    let allowed = options.consensus as u32;
    let aabb = match options.aabb {
        Some(aabb) => aabb,
        None => bounds::find_box(views, options.grow_px, allowed)?,
    };
    let cell = cell_size(views, &aabb, options.resolution);
    let contour_s = start.elapsed().as_secs_f64();
    let mut hull = carve(views, &cones, aabb, cell, allowed)?;
    let small_parts = hull.mesh.remove_small_parts(options.least_part);
    let report = &mut hull.report;
    *report = HullReport { unconstrained_views, small_parts, grow_px: options.grow_px, contour_s, ..*report };
    Ok(hull)
}

fn carve(views: &[View], cones: &[Cone], aabb: Aabb, cell: f64, allowed: u32) -> Result<Hull, GeometryError> {
    let start = Instant::now();
    let grid = Grid::new(&aabb, cell);
    let sets = [0, 1, 2].map(|axis| RaySet::cast(cones, axis, &grid, allowed));
    let carve_s = start.elapsed().as_secs_f64();
    let crossings = sets.iter().map(RaySet::len).sum();
    if crossings == 0 {
        return Err(no_common_point(views, cones, &grid));
    }
    // Vertex numbers are 32 bit.
    if crossings > u32::MAX as usize / 2 {
        return Err(resolution_error(format!("{crossings} crossings are too many"), "lower the resolution"));
    }
    let start = Instant::now();
    let (mesh, reconciled) = extract::extract(&sets, &grid);
    let report = HullReport {
        views: views.len(),
        consensus: allowed as usize,
        nodes: grid.nodes,
        crossings,
        conflicts: reconciled.conflicts,
        lost_pairs: reconciled.lost_pairs,
        wall_crossings: [0, 1, 2].map(|axis| sets[axis].wall_crossings(&grid)),
        carve_s,
        extract_s: start.elapsed().as_secs_f64(),
        ..HullReport::default()
    };
    if mesh.faces.is_empty() {
        return Err(resolution_error("the hull is thinner than a cell".into(), "raise the resolution"));
    }
    Ok(Hull { mesh, cell, aabb, report })
}

fn check_options(views: &[View], options: &HullOptions) -> Result<(), GeometryError> {
    if views.is_empty() {
        return Err(GeometryError::Views { fault: "there are no views".into(), remedy: "give at least one".into() });
    }
    if let Some(n) = options.resolution.filter(|n| !(2..=MAX_RESOLUTION).contains(n)) {
        return Err(resolution_error(format!("{n} is not from 2 to {MAX_RESOLUTION}"), "choose one between"));
    }
    if !options.grow_px.is_finite() || options.grow_px.abs() > 64.0 {
        let fault = format!("{} is not from -64 to 64", options.grow_px);
        return Err(GeometryError::Options { option: "grow_px", fault, remedy: "half a pixel is usual" });
    }
    if !(0.0..0.5).contains(&options.least_part) {
        let fault = format!("{} is not from 0 to 0.5", options.least_part);
        return Err(GeometryError::Options { option: "least_part", fault, remedy: "1e-4 drops debris only" });
    }
    let is_box = |b: &Aabb| b.min.iter().chain(b.max.iter()).all(|v| v.is_finite()) && b.size().min() > 0.0;
    if options.aabb.is_some_and(|b| !is_box(&b)) {
        let fault = "the box is empty or not finite".into();
        return Err(GeometryError::Options { option: "aabb", fault, remedy: "give two opposite corners" });
    }
    Ok(())
}

fn resolution_error(fault: String, remedy: &'static str) -> GeometryError {
    GeometryError::Options { option: "resolution", fault, remedy }
}

fn cell_size(views: &[View], aabb: &Aabb, resolution: Option<usize>) -> f64 {
    let longest = aabb.size().max();
    match resolution {
        Some(n) => longest / n as f64,
        None => (PIXELS_PER_CELL * bounds::pixel_size(views, &aabb.center())).max(longest / MAX_AUTO_RESOLUTION),
    }
}

fn nothing_carves(views: usize, unconstrained: usize, consensus: usize) -> GeometryError {
    GeometryError::Views {
        fault: format!(
            "of {views} views {unconstrained} have a silhouette that fills the frame and {consensus} are forgiven: \
             nothing carves"
        ),
        remedy: "check the masks, or forgive fewer views".into(),
    }
}

/// The error for silhouettes without a common point, naming the view that dissents most.
fn no_common_point(views: &[View], cones: &[Cone], grid: &Grid) -> GeometryError {
    let remedy = "check that view's mask and camera, or forgive dissenting views (consensus); \
                  if a box is given, that it holds the object";
    let fault = match worst_view(cones, grid) {
        Some((worst, needed)) => format!(
            "the silhouettes exclude each other: no point of the box is in all of them; forgiving {needed} leaves a \
             solid, and view {} ({}) dissents most",
            views[worst].index, views[worst].name
        ),
        None => "the silhouettes exclude each other: no point of the box is in even two of them".into(),
    };
    GeometryError::Views { fault, remedy: remedy.into() }
}

/// The cone that misses most of the smallest consensus hull that is not empty, and how many that forgives.
fn worst_view(cones: &[Cone], grid: &Grid) -> Option<(usize, usize)> {
    let longest = (0..3).map(|a| grid.high[a] - grid.low[a]).fold(0.0, f64::max);
    let aabb = Aabb { min: grid.to_world(grid.low), max: grid.to_world(grid.high) };
    let coarse = Grid::new(&aabb, grid.cell * longest / 48.0);
    let mut needed = 1;
    let set = loop {
        if needed + 2 > cones.len() {
            return None;
        }
        let set = RaySet::cast(cones, 0, &coarse, needed as u32);
        if set.len() > 0 {
            break set;
        }
        needed *= 2;
    };
    let misses = |cone: &Cone| {
        let pencil = cone::Pencil::new(cone, 0, &coarse);
        let outside = |(b, c, crossings): (usize, usize, &[f64])| {
            let (mut toggles, mut inside) = (Vec::new(), Vec::new());
            pencil.intervals(b as f64, c as f64, &mut toggles, &mut inside);
            let middle = 0.5 * (crossings[0] + crossings[1]);
            !inside.chunks_exact(2).any(|pair| pair[0] <= middle && middle < pair[1])
        };
        set.occupied().filter(|ray| outside(*ray)).count()
    };
    let counts: Vec<usize> = cones.iter().map(misses).collect();
    (0..cones.len()).rev().max_by_key(|&i| counts[i]).map(|worst| (worst, needed))
}
