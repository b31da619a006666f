//! A mesh held against the true one, where there is one.

use geometry::accuracy::{AccuracyOptions, MIDDLEBURY_TOLERANCE_M, accuracy};
use geometry::{GeometryError, Mesh};
use serde::Serialize;

/// Tolerance relative to the diagonal of the truth's box, where nobody says what a unit is.
const RELATIVE_TOLERANCE: f64 = 0.01;

/// How near a mesh comes to the truth. Lengths are in the unit of the meshes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TruthFigures {
    /// Distance within which 90 % of the mesh lies of the truth.
    pub accuracy_90: f64,
    /// Share of the truth within the tolerance of the mesh.
    pub completeness_pct: f64,
    /// Distance up to which the truth counts as covered.
    pub tolerance: f64,
    /// Mean distance of the mesh from the truth.
    pub distance_mean: f64,
    /// Its root mean square.
    pub distance_rms: f64,
    /// The largest distance either way.
    pub hausdorff: f64,
    /// Mean signed distance of the mesh from the truth, positive outside it: what a hull adds. `None` where no
    /// point has a side.
    pub signed_mean: Option<f64>,
    /// Mean signed distance of the truth from the mesh, positive outside it: what a mesh lacks.
    pub signed_mean_of_truth: Option<f64>,
    /// Share of the mesh that is not judged because it is nearest to a hole of the truth.
    pub left_out_pct: f64,
}

/// Judges `mesh` by 200 000 points on each surface; `tolerance` is in their unit.
///
/// # Errors
/// Where a mesh is broken or has no face with an area, or the tolerance is no distance.
pub fn judge(mesh: &Mesh, truth: &Mesh, tolerance: f64) -> Result<TruthFigures, GeometryError> {
    let found = accuracy(mesh, truth, &AccuracyOptions::new(tolerance))?;
    Ok(TruthFigures {
        accuracy_90: found.accuracy,
        completeness_pct: found.completeness_pct,
        tolerance,
        distance_mean: found.from_mesh.mean,
        distance_rms: found.from_mesh.rms,
        hausdorff: found.hausdorff,
        signed_mean: found.from_mesh.signed_mean,
        signed_mean_of_truth: found.from_truth.signed_mean,
        left_out_pct: found.from_mesh.left_out_pct,
    })
}

/// 1.25 mm where a unit is known to be `unit` metres, otherwise a hundredth of the truth's diagonal.
pub fn default_tolerance(truth: &Mesh, unit: Option<f64>) -> f64 {
    match unit.filter(|unit| unit.is_finite() && *unit > 0.0) {
        Some(unit) => MIDDLEBURY_TOLERANCE_M / unit,
        None => RELATIVE_TOLERANCE * truth.aabb().map_or(0.0, |aabb| aabb.diagonal()),
    }
}

impl TruthFigures {
    /// In words.
    pub fn text(&self) -> String {
        let bias = self.signed_mean.map_or_else(|| "–".to_owned(), |mean| format!("{:+.3e}", mean));
        let mut text = format!(
            "truth (lengths in the unit of the mesh): 90 % of the mesh within {:.3e} of it, {:.2} % of it within {:.3e} \
             of the mesh, mean distance {:.3e}, RMS {:.3e}, Hausdorff {:.3e}, bias {bias}",
            self.accuracy_90,
            self.completeness_pct,
            self.tolerance,
            self.distance_mean,
            self.distance_rms,
            self.hausdorff
        );
        if self.left_out_pct > 0.0 {
            text.push_str(&format!("; {:.1} % of the mesh not judged: nearest to a hole", self.left_out_pct));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    #[test]
    fn the_tolerance_is_that_of_middlebury_where_the_unit_is_known() {
        let positions = vec![Point3::origin(), Point3::new(3.0, 0.0, 0.0), Point3::new(3.0, 4.0, 0.0)];
        let truth = Mesh { positions, faces: vec![[0, 1, 2]] };
        assert_eq!(default_tolerance(&truth, Some(0.001)), 1.25);
        assert_eq!(default_tolerance(&truth, None), 0.05);
        assert_eq!(default_tolerance(&truth, Some(0.0)), 0.05);
    }
}
