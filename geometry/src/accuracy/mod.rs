//! How near a mesh comes to the true one.
//!
//! Accuracy is the distance within which a share of the mesh lies of the truth; completeness the share of
//! the truth that lies within a tolerance of the mesh. Source: S. Seitz, B. Curless, J. Diebel, D.
//! Scharstein, R. Szeliski, *A Comparison and Evaluation of Multi-View Stereo Reconstruction Algorithms*,
//! CVPR 2006. Both are taken over points spread evenly over the surfaces, not over vertices, so that a
//! coarse mesh is judged as what it looks like; distances are those from points to triangles.
//!
//! - Lengths are in the unit of the meshes, which must share one frame: nothing is aligned.
//! - Of an open truth, points of the mesh nearest to its border are not judged (see
//!   [`AccuracyOptions::holes_are_unknown`]): there the truth was not measured.
//! - Cost: `O((n + m) log n)` for `n` faces and `m` samples. The result does not depend on the number of
//!   threads.

mod nearest;
mod sample;

use crate::{GeometryError, Mesh};
use nalgebra::Point3;
use nearest::{Nearest, Surface};
use rayon::prelude::*;
use sample::sample_surface;

/// The tolerance of the Middlebury evaluation's completeness, in metres.
pub const MIDDLEBURY_TOLERANCE_M: f64 = 1.25e-3;

/// How a mesh is judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AccuracyOptions {
    /// Share of the mesh that accuracy speaks of, in %.
    pub accuracy_pct: f64,
    /// Distance up to which the truth counts as covered, in world units.
    pub tolerance: f64,
    /// Points on each of the two surfaces.
    pub samples: usize,
    /// Seed of their places.
    pub seed: u64,
    /// Whether points of the mesh nearest to a border of the truth are left out. Without it their distance
    /// to the border counts.
    pub holes_are_unknown: bool,
}

/// How near a mesh comes to the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// Distance within which [`AccuracyOptions::accuracy_pct`] of the mesh lies of the truth.
    pub accuracy: f64,
    /// Share of the truth within [`AccuracyOptions::tolerance`] of the mesh, in %.
    pub completeness_pct: f64,
    /// The largest distance either way (Hausdorff), over all samples and vertices: never more than the true
    /// one, and short of it by about the spacing of the samples at most.
    pub hausdorff: f64,
    /// Distances of points of the mesh from the truth.
    pub from_mesh: Deviation,
    /// Distances of points of the truth from the mesh.
    pub from_truth: Deviation,
}

/// Distances of points on one surface from another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// Mean distance.
    pub mean: f64,
    /// Root of the mean squared distance.
    pub rms: f64,
    /// Largest distance, over vertices too.
    pub max: f64,
    /// Mean signed distance, positive outside the other surface, over the points that have a side: those
    /// whose nearest point is not on a border. Exact where the other surface is a closed manifold with
    /// faces turned outward. `None` where no point has a side.
    pub signed_mean: Option<f64>,
    /// Points left out because they are nearest to a border, in %.
    pub left_out_pct: f64,
}

impl AccuracyOptions {
    /// 90 % of the mesh; 200 000 points on each surface; holes in the truth are unknown, as in the
    /// Middlebury evaluation. The tolerance is [`MIDDLEBURY_TOLERANCE_M`] there.
    pub fn new(tolerance: f64) -> Self {
        Self { accuracy_pct: 90.0, tolerance, samples: 200_000, seed: 1, holes_are_unknown: true }
    }
}

/// Judges `mesh` against `truth`.
///
/// # Errors
/// [`GeometryError::Options`] where an option is out of its range. [`GeometryError::Mesh`] where a mesh has an
/// index out of range or a coordinate that is not finite. [`GeometryError::Degenerate`] where a mesh has no
/// face with an area, or all of `mesh` is nearest to holes of the truth.
pub fn accuracy(mesh: &Mesh, truth: &Mesh, options: &AccuracyOptions) -> Result<Accuracy, GeometryError> {
    check_options(options)?;
    let mesh_surface = surface(mesh, "mesh")?;
    let truth_surface = surface(truth, "true mesh")?;
    let mut from_mesh = Distances::measure(mesh, &truth_surface, options, options.holes_are_unknown);
    let from_truth = Distances::measure(truth, &mesh_surface, options, false);
    if from_mesh.sampled.is_empty() {
        let fault = "every point of the mesh is nearest to a border of the true mesh";
        return Err(GeometryError::degenerate(fault, "check that both are in one frame, or count holes as surface"));
    }
    let covered = from_truth.sampled.iter().filter(|n| n.distance <= options.tolerance).count();
    let (of_mesh, of_truth) = (from_mesh.deviation(), from_truth.deviation());
    Ok(Accuracy {
        accuracy: from_mesh.quantile(options.accuracy_pct / 100.0),
        completeness_pct: 100.0 * covered as f64 / from_truth.sampled.len() as f64,
        hausdorff: of_mesh.max.max(of_truth.max),
        from_mesh: of_mesh,
        from_truth: of_truth,
    })
}

fn check_options(options: &AccuracyOptions) -> Result<(), GeometryError> {
    let refuse = |option, fault, remedy| Err(GeometryError::Options { option, fault, remedy });
    let AccuracyOptions { accuracy_pct, tolerance, samples, .. } = *options;
    if !(accuracy_pct > 0.0 && accuracy_pct <= 100.0) {
        return refuse("accuracy_pct", format!("{accuracy_pct} is not above 0 and up to 100"), "90 is usual");
    }
    if !(tolerance >= 0.0 && tolerance.is_finite()) {
        return refuse("tolerance", format!("{tolerance} is no distance"), "1.25 mm is usual, in the mesh's unit");
    }
    if samples == 0 {
        return refuse("samples", "there are none".into(), "use 100 000 or more");
    }
    Ok(())
}

fn surface(mesh: &Mesh, name: &str) -> Result<Surface, GeometryError> {
    mesh.check_input()?;
    // Squares of areas must be numbers.
    if mesh.aabb().is_some_and(|aabb| !aabb.diagonal().powi(4).is_finite()) {
        let fault = format!("coordinates of the {name} are too far apart to compute with");
        return Err(GeometryError::Mesh { fault, remedy: "scale it to a sensible unit" });
    }
    let nothing = || {
        let fault = format!("the {name} has no face with an area");
        GeometryError::degenerate(fault, "check that the mesh is the one meant")
    };
    Surface::new(mesh).ok_or_else(nothing)
}

/// Distances from one surface to another.
struct Distances {
    /// Of the samples judged.
    sampled: Vec<Nearest>,
    samples: usize,
    max: f64,
}

impl Distances {
    fn measure(from: &Mesh, to: &Surface, options: &AccuracyOptions, skip_borders: bool) -> Self {
        let is_judged = |nearest: &Nearest| !skip_borders || nearest.signed.is_some();
        let points = sample_surface(from, options.samples, options.seed);
        let mut sampled: Vec<Nearest> = points.par_iter().map(|p| to.nearest(p)).collect();
        sampled.retain(is_judged);
        // Spikes end at vertices.
        let vertices = used_vertices(from).into_par_iter().map(|p| to.nearest(&p));
        let at_vertices = vertices.filter(is_judged).map(|n| n.distance).reduce(|| 0.0, f64::max);
        let max = sampled.iter().map(|n| n.distance).fold(at_vertices, f64::max);
        Self { sampled, samples: points.len(), max }
    }

    fn deviation(&self) -> Deviation {
        let judged = self.sampled.len() as f64;
        let signed: Vec<f64> = self.sampled.iter().filter_map(|n| n.signed).collect();
        Deviation {
            mean: self.sampled.iter().map(|n| n.distance).sum::<f64>() / judged,
            rms: (self.sampled.iter().map(|n| n.distance.powi(2)).sum::<f64>() / judged).sqrt(),
            max: self.max,
            signed_mean: (!signed.is_empty()).then(|| signed.iter().sum::<f64>() / signed.len() as f64),
            left_out_pct: 100.0 * (1.0 - judged / self.samples as f64),
        }
    }

    /// The least distance within which a `share` of the samples lies. There must be one.
    fn quantile(&mut self, share: f64) -> f64 {
        let rank = ((share * self.sampled.len() as f64).ceil() as usize).clamp(1, self.sampled.len());
        self.sampled.select_nth_unstable_by(rank - 1, |a, b| a.distance.total_cmp(&b.distance)).1.distance
    }
}

/// The vertices that some face has, each once.
fn used_vertices(mesh: &Mesh) -> Vec<Point3<f64>> {
    let mut is_used = vec![false; mesh.positions.len()];
    mesh.faces.as_flattened().iter().for_each(|&v| is_used[v as usize] = true);
    mesh.positions.iter().zip(is_used).filter_map(|(p, used)| used.then_some(*p)).collect()
}
