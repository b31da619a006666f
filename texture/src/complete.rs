//! Filling in what a view does not see of a facet.
//!
//! Each frame sees less than half of the object. Zeros or constants in the missing entries would make
//! the mask itself the first principal component, so a missing texel takes the colours that the
//! nearest views (in direction) give it, as unstructured view blending would. What is filled is
//! hardly ever shown: from where it would be, the texel is hidden.

use crate::directions::angle;
use crate::observe::Samples;
use nalgebra::Vector3;

/// Views that lend their colour to a missing one.
const LENDERS: usize = 3;

/// Weight from which an observation stands alone; below, it fades into what its neighbours say.
const TRUSTED: f32 = 0.25;

/// A view belongs to a facet when it sees at least this share of it. Asking for a fifth costs 0.1 points of
/// error on a ring of 24 views: the facet then has no picture for eyes near its horizon.
const SEEN_SHARE: f64 = 0.02;

/// Colours of a facet's texels in the views that see it, nothing missing.
#[derive(Debug)]
pub(crate) struct Completed {
    /// The views that see the facet, as positions among the observers.
    pub(crate) views: Vec<usize>,
    /// Row-major, texels × views.
    pub(crate) colors: Vec<[f32; 3]>,
    /// Whether any view saw the texel; rows of unseen ones hold zeros.
    pub(crate) seen: Vec<bool>,
}

/// Completes `samples`; `directions` go from the facet's centre to each view.
pub(crate) fn complete(samples: &Samples, directions: &[Vector3<f64>]) -> Completed {
    let texels = samples.rows.len() / samples.views.max(1);
    let views = views_of_facet(samples, texels);
    let lenders: Vec<Vec<(usize, f32)>> = views.iter().map(|&j| by_angle(j, directions)).collect();
    let mut done = Completed { colors: vec![[0.0; 3]; texels * views.len()], seen: vec![false; texels], views };
    let width = done.views.len();
    for i in 0..texels {
        let row = samples.row(i);
        done.seen[i] = row.iter().any(|o| o.weight > 0.0);
        if !done.seen[i] {
            continue;
        }
        for (k, &j) in done.views.iter().enumerate() {
            let own = row[j];
            let trust = (own.weight / TRUSTED).min(1.0);
            let filled = if trust < 1.0 { lent(row, &lenders[k]).unwrap_or(own.color) } else { own.color };
            done.colors[i * width + k] = std::array::from_fn(|c| trust * own.color[c] + (1.0 - trust) * filled[c]);
        }
    }
    done
}

/// Views that see enough of the facet; the best one where none does.
fn views_of_facet(samples: &Samples, texels: usize) -> Vec<usize> {
    let mut seen = vec![0.0f64; samples.views];
    for i in 0..texels {
        seen.iter_mut().zip(samples.row(i)).for_each(|(s, o)| *s += f64::from(o.weight));
    }
    let best = seen.iter().copied().fold(0.0, f64::max);
    let bound = (SEEN_SHARE * texels as f64).min(best);
    (0..samples.views).filter(|&j| seen[j] > 0.0 && seen[j] >= bound).collect()
}

/// The other views, nearest first, each with the weight its distance gives it.
fn by_angle(view: usize, directions: &[Vector3<f64>]) -> Vec<(usize, f32)> {
    let mut others: Vec<(usize, f64)> =
        (0..directions.len()).filter(|&j| j != view).map(|j| (j, angle(&directions[view], &directions[j]))).collect();
    others.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    others.into_iter().map(|(j, a)| (j, (1.0 / (a * a + 1e-4)) as f32)).collect()
}

fn lent(row: &[crate::observe::Observation], lenders: &[(usize, f32)]) -> Option<[f32; 3]> {
    let mut sum = [0.0f32; 3];
    let mut total = 0.0f32;
    for &(j, closeness) in lenders.iter().filter(|&&(j, _)| row[j].weight > 0.0).take(LENDERS) {
        let w = closeness * row[j].weight;
        total += w;
        (0..3).for_each(|c| sum[c] += w * row[j].color[c]);
    }
    (total > 0.0).then(|| sum.map(|s| s / total))
}
