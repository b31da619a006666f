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
use capture::View;
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
const RESOLUTION: usize = 128;
/// Views scored, evenly spread over the given ones.
const SCORED_VIEWS: usize = 32;
/// Growths tried, in pixels: half a pixel is what a threshold on a blurred edge is off.
const GROWTHS: [f64; 2] = [0.0, 0.5];
/// When the IoU has fallen this far below the best of its growth, more forgiving is not tried.
const GIVE_UP: f64 = 0.002;

/// Chooses `consensus` and `grow_px` by the mean silhouette IoU over `views`, which should be training
/// views only. Ties go to the stricter hull.
///
/// # Errors
/// As [`visual_hull`](super::visual_hull), where no candidate gives a hull.
pub fn choose_hull(views: &[View], base: &HullOptions) -> Result<HullChoice, GeometryError> {
    check_options(views, base)?;
    let votes = candidate_votes(views.len());
    let most = votes.iter().fold(0, |a, &b| a.max(b));
    let aabb = match base.aabb {
        Some(aabb) => aabb,
        None => find_box(views, GROWTHS[1], 0).or_else(|_| find_box(views, GROWTHS[1], most as u32))?,
    };
    let resolution = base.resolution.map_or(RESOLUTION, |n| n.min(RESOLUTION));
    let cell = cell_size(views, &aabb, Some(resolution));
    let stride = views.len().div_ceil(SCORED_VIEWS);
    let scored: Vec<View> = views.iter().step_by(stride).cloned().collect();
    let mut trials = Vec::new();
    let mut failure = None;
    for grow_px in GROWTHS {
        let cones =
            views.par_iter().map(|view| Cone::new(view, base.binary, grow_px)).collect::<Result<Vec<_>, _>>()?;
        let mut best = 0.0;
        for &consensus in &votes {
            let mean_iou = match super::carve(views, &cones, aabb, cell, consensus as u32) {
                Ok(hull) => mean_silhouette_iou(&hull.mesh, &scored),
                Err(error) => {
                    failure = Some(error);
                    0.0
                }
            };
            trials.push(HullTrial { consensus, grow_px, mean_iou });
            if mean_iou < best - GIVE_UP {
                break;
            }
            best = f64::max(best, mean_iou);
        }
    }
    let best = trials.iter().copied().reduce(|best, trial| if trial.mean_iou > best.mean_iou { trial } else { best });
    match (best.filter(|best| best.mean_iou > 0.0), failure) {
        (Some(best), _) => {
            let options = HullOptions { consensus: best.consensus, grow_px: best.grow_px, ..*base };
            Ok(HullChoice { options, trials })
        }
        (None, Some(error)) => Err(error),
        (None, None) => Ok(HullChoice { options: *base, trials }),
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
