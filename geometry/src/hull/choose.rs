//! How strict an intersection suits the silhouettes at hand.
//!
//! One silhouette that is too small anywhere removes real surface for good, so a strict intersection of
//! many real silhouettes is too thin; forgiving views and growing silhouettes make it fatter again.
//! Both are chosen by how well a coarse hull fills the given silhouettes, never by the object's name:
//! the union in the denominator of the IoU punishes fat as the intersection punishes thin.

use super::bounds::find_box;
use super::cone::Cone;
use super::{HullOptions, cell_size, check_options};
use crate::GeometryError;
use crate::depth::mean_silhouette_iou;
use capture::{Aabb, View};
use rayon::prelude::*;

/// One pair that was tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HullTrial {
    /// Views forgiven.
    pub consensus: usize,
    /// Offset of the silhouettes in pixels.
    pub grow_px: f64,
    /// Mean silhouette IoU of the coarse hull over the scored views.
    pub mean_iou: f64,
    /// Volume of the coarse hull, in world units.
    pub volume: f64,
}

/// The options chosen, and everything that was tried.
#[derive(Clone, Debug, PartialEq)]
pub struct HullChoice {
    /// `base` with the best `consensus` and `grow_px`.
    pub options: HullOptions,
    /// In the order tried.
    pub trials: Vec<HullTrial>,
}

/// Cells along the longest side of the coarse hulls.
const RESOLUTION: usize = 192;
/// Views scored, evenly spread over the given ones.
const SCORED_VIEWS: usize = 32;
/// Growths tried, in pixels: a threshold on a blurred edge is off by up to a pixel.
const GROWTHS: [f64; 4] = [0.0, 0.25, 0.5, 0.75];
/// IoU within which two hulls are as good as each other. The tighter one is then taken: surface
/// further out than the true one slides under its texture from view to view, and costs more there
/// than what a thin place loses.
const TIE: f64 = 0.001;
/// Where the search starts among [`GROWTHS`].
const FIRST_GROWTH: usize = 2;

/// Chooses `consensus` and `grow_px` by the mean silhouette IoU over `views`, which should be training
/// views only: from half a pixel and no vote, by steps to the best neighbour as long as that is better.
/// Of the pairs tried that are as good as the best, the one with the least volume is chosen.
///
/// # Errors
/// As [`visual_hull`](super::visual_hull), where no candidate gives a hull.
pub fn choose_hull(views: &[View], base: &HullOptions) -> Result<HullChoice, GeometryError> {
    check_options(views, base)?;
    let votes = candidate_votes(views.len());
    let most = votes.iter().fold(0, |a, &b| a.max(b));
    let aabb = match base.aabb {
        Some(aabb) => aabb,
        None => find_box(views, GROWTHS[FIRST_GROWTH], 0)
            .or_else(|_| find_box(views, GROWTHS[FIRST_GROWTH], most as u32))?,
    };
    let resolution = base.resolution.map_or(RESOLUTION, |n| n.min(RESOLUTION));
    let cell = cell_size(views, &aabb, Some(resolution));
    let scored = views.iter().step_by(views.len().div_ceil(SCORED_VIEWS)).cloned().collect();
    let mut search = Search { views, scored, aabb, cell, base, votes, trials: Vec::new(), failure: None };
    let best = search.climb()?;
    let as_good = search.trials.iter().filter(|t| t.mean_iou >= best.mean_iou - TIE);
    let best = as_good.min_by(|a, b| a.volume.total_cmp(&b.volume)).copied().unwrap_or(best);
    match (best.mean_iou > 0.0, search.failure) {
        (false, Some(error)) => Err(error),
        _ => {
            let options = HullOptions { consensus: best.consensus, grow_px: best.grow_px, ..*base };
            Ok(HullChoice { options, trials: search.trials })
        }
    }
}

/// Hill climbing over growths and votes.
struct Search<'a> {
    views: &'a [View],
    scored: Vec<View>,
    aabb: Aabb,
    cell: f64,
    base: &'a HullOptions,
    votes: Vec<usize>,
    trials: Vec<HullTrial>,
    failure: Option<GeometryError>,
}

impl Search<'_> {
    fn climb(&mut self) -> Result<HullTrial, GeometryError> {
        let mut at = [FIRST_GROWTH, 0];
        let mut best = self.attempt(at)?;
        loop {
            let [grow, vote] = at;
            let around =
                [[grow, vote + 1], [grow, vote.wrapping_sub(1)], [grow + 1, vote], [grow.wrapping_sub(1), vote]];
            let before = at;
            let limits = [GROWTHS.len(), self.votes.len()];
            for next in around.into_iter().filter(|n| n[0] < limits[0] && n[1] < limits[1]) {
                let trial = self.attempt(next)?;
                if trial.mean_iou > best.mean_iou {
                    (at, best) = (next, trial);
                }
            }
            // Where nothing gives a hull, more votes are the way out.
            if best.mean_iou == 0.0 && vote + 1 < self.votes.len() {
                at = [grow, vote + 1];
            }
            if at == before {
                return Ok(best);
            }
        }
    }

    /// The score of one pair, computed once.
    fn attempt(&mut self, [grow, vote]: [usize; 2]) -> Result<HullTrial, GeometryError> {
        let (grow_px, consensus) = (GROWTHS[grow], self.votes[vote]);
        if let Some(known) = self.trials.iter().find(|t| t.grow_px == grow_px && t.consensus == consensus) {
            return Ok(*known);
        }
        let cone = |view| Cone::new(view, self.base.binary, grow_px);
        let cones = self.views.par_iter().map(cone).collect::<Result<Vec<_>, _>>()?;
        let (mean_iou, volume) = match super::carve(self.views, &cones, self.aabb, self.cell, consensus as u32) {
            Ok(hull) => (mean_silhouette_iou(&hull.mesh, &self.scored), hull.mesh.signed_volume()),
            Err(error) => {
                self.failure = Some(error);
                (0.0, 0.0)
            }
        };
        let trial = HullTrial { consensus, grow_px, mean_iou, volume };
        self.trials.push(trial);
        Ok(trial)
    }
}

/// 0, 1, 2, 4, 8 and 3 % of the views, ascending, as long as they are fewer than a quarter of them.
fn candidate_votes(views: usize) -> Vec<usize> {
    let mut votes = vec![0, 1, 2, 4, 8, (0.03 * views as f64).round() as usize];
    votes.retain(|&k| k == 0 || 4 * k < views);
    votes.sort_unstable();
    votes.dedup();
    votes
}

#[cfg(test)]
mod tests {
    use super::candidate_votes;

    #[test]
    fn votes_depend_on_the_number_of_views() {
        assert_eq!(candidate_votes(3), [0]);
        assert_eq!(candidate_votes(24), [0, 1, 2, 4]);
        assert_eq!(candidate_votes(156), [0, 1, 2, 4, 5, 8]);
        assert_eq!(candidate_votes(400), [0, 1, 2, 4, 8, 12]);
    }
}
