//! Principal components of clusters of texels whose apparent BRDFs resemble one another.
//!
//! ```text
//! A_x(i, v, c) ≈ B_κ0(i, v, c) + Σ_{j ≤ k} W_xj · B_κj(i, v, c)        κ = κ(x)
//! ```
//!
//! with the apparent BRDF `A_x` of texel x as a vector of `3 n_i n_v` numbers: per cluster a mean and k components of that
//! length, per texel the cluster and k weights. Between measured directions values are interpolated.
//!
//! *Parameters*: clusters and components. Standard 7 × 5, the model of which 1:275 is printed; with
//! [`Budget::Components`] as many components in 7 clusters. A ratio tries numbers of clusters, and gives components to
//! clusters where they lower the error most. Quality and Auto choose components, for 7 clusters, by error and by the criterion of `linear`.
//! *Bytes*: `c (k+1) · 3 n_i n_v + P k` numbers and a cluster a texel ([`printed_bytes`] has the figure of the literature).
//! *Cost*: texels are first projected to the [`SKETCH`] leading components of the whole, which keep what clusters can tell
//! apart; there one round of clustering takes `P · SKETCH · c k` multiplications, [`RESTARTS`] times
//! at most [`ROUNDS`] rounds. Components are then found in the full vectors of each cluster. A value takes `27 (k+1)`
//! multiplications.
//! *Limits*: components are as long as all pairs of directions; small tiles pay for few of them.
//! *Degenerate data*: more clusters than distinct texels leave the surplus empty, and they are dropped; a cluster of
//! equal texels gets no component.
//!
//! Clustering: k-means++ (Arthur and Vassilvitskii 2007), then in turns components of each cluster and assignment of
//! each texel to the cluster that leaves it the least residual, computed as a vector, never as a
//! difference of squares; an empty cluster is seeded anew at the texel with the largest residual.
//!
//! Source: Müller, Meseth, Klein, "Compression and real-time rendering of measured BTFs using local PCA", VMV 2003,
//! after Kambhatla and Leen 1997. Values are not clamped above, and at 0 below.

use super::budget::{bytes_for, check_samples};
use super::container::{Fault, Reader, Stored, Writer};
use super::linear::{self, LinearModel, Source, Target, affine, blend_into};
use super::principal::{Principal, transposed_times};
use super::{Budget, FitReport, Frame, Precision, Sampler};
use crate::TextureError;
use capture::btf::Btf;
use nalgebra::{DMatrix, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Clusters of [`Budget::Standard`].
const STANDARD_CLUSTERS: usize = 7;
/// Components of [`Budget::Standard`].
const STANDARD_COMPONENTS: usize = 5;
/// Numbers of clusters tried where a ratio is to be met.
const TRIED: [usize; 8] = [1, 2, 3, 5, 8, 12, 20, 32];
/// Components of the whole that clustering sees.
const SKETCH: usize = 64;
/// Clusterings of which the best is kept.
const RESTARTS: u64 = 3;
/// Most rounds of one clustering.
const ROUNDS: usize = 30;
/// A round that lowers the error by less than this share is the last.
const SETTLED: f64 = 1e-4;
/// Expected bits of a number, for the choice of the number of clusters.
const TYPICAL_BITS: usize = 7;
/// Most clusters of a file.
const MOST_CLUSTERS: usize = 1 << 12;

/// How it is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// How many clusters and components.
    pub budget: Budget,
    /// How they are stored.
    pub precision: Precision,
    /// Of the clusters' starts.
    pub seed: u64,
}

/// The codec.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalPca {
    frame: Frame,
    /// Of each texel, the cluster and its position there.
    places: Vec<Place>,
    /// One a cluster; elements (view, light, channel), observations its texels in ascending order.
    models: Vec<LinearModel>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Place {
    cluster: u16,
    member: u32,
}

impl Options {
    /// What a budget means for this codec.
    ///
    /// # Errors
    /// Where a ratio or quality is out of range.
    pub fn new(_btf: &Btf, budget: Budget, precision: Precision, seed: u64) -> Result<Self, TextureError> {
        Ok(Self { budget: budget.checked()?, precision, seed })
    }
}

/// Fits the codec. The objective is the RMSE × 255 of one mean a cluster, then with components, before their coding.
///
/// # Errors
/// Where samples are not finite.
pub fn fit(btf: &Btf, options: &Options) -> Result<(LocalPca, FitReport), TextureError> {
    check_samples(btf)?;
    let (frame, texels, length) = (Frame::of(btf), btf.texels(), 3 * btf.pairs());
    let data = apparent_brdfs(btf);
    let sketch = sketch(&data, options.seed);
    let bytes = |ratio| bytes_for(ratio, btf).saturating_sub(texels * 2);
    let target = Target::of(options.budget, STANDARD_COMPONENTS, bytes);
    let candidates = match target {
        Target::Bytes(bytes) => best_clusters(&sketch, bytes, length, options.seed),
        Target::Each(components) => vec![cluster(&sketch, STANDARD_CLUSTERS, components.min(SKETCH / 2), options.seed)],
        Target::Error(_) | Target::Supported => {
            vec![cluster(&sketch, STANDARD_CLUSTERS, STANDARD_COMPONENTS, options.seed)]
        }
    };
    let coded = candidates.iter().map(|clusters| code(&data, clusters, target, options));
    let left = |coded: &Coded| coded.objective.last().copied().unwrap_or(0.0);
    let best = coded.reduce(|a, b| if left(&b) < left(&a) { b } else { a });
    let Some(Coded { members, models, objective, mut notes }) = best else {
        return Err(TextureError::Degenerate {
            fault: "there are no texels".into(),
            remedy: "give at least one".into(),
        });
    };
    notes.push(format!("{} clusters", members.len()));
    Ok((LocalPca { frame, places: places_of(&members, texels), models }, FitReport { objective, notes }))
}

/// Clusters as they are stored.
struct Coded {
    members: Vec<Vec<usize>>,
    models: Vec<LinearModel>,
    objective: Vec<f64>,
    notes: Vec<String>,
}

/// Components of each cluster, as many as the target allows.
fn code(data: &DMatrix<f32>, clusters: &Clusters, target: Target, options: &Options) -> Coded {
    let (length, texels) = data.shape();
    let members = members_of(&clusters.labels);
    let target = match target {
        Target::Bytes(bytes) => Target::Bytes((bytes + 2 * texels).saturating_sub(side_bytes(texels, members.len()))),
        other => other,
    };
    let source = |texels: &Vec<usize>| {
        let most = if matches!(target, Target::Each(_)) { target.most(0) } else { target.most(length).min(SKETCH) };
        Source::new(data.select_columns(texels), most, options.seed)
    };
    let sources: Vec<Source> = members.iter().map(source).collect();
    let mut notes = Vec::new();
    let models = linear::fit(&sources, target, options.precision, &mut notes);
    let objective = linear::objective(&sources, &models);
    Coded { members, models, objective, notes }
}

/// Bytes of c clusters of k components and a mean as the literature counts them: each number in `number_bytes`, and a
/// byte a texel for its cluster.
pub fn printed_bytes(texels: usize, pairs: usize, clusters: usize, components: usize, number_bytes: usize) -> usize {
    clusters * (components + 1) * 3 * pairs * number_bytes + texels * (components * number_bytes + 1)
}

/// Apparent BRDFs as columns: (view, light, channel) × texel.
fn apparent_brdfs(btf: &Btf) -> DMatrix<f32> {
    let length = 3 * btf.pairs();
    let mut data = DMatrix::zeros(length, btf.texels());
    let fill = |(texel, column): (usize, &mut [f32])| column.copy_from_slice(&btf.apparent_brdf(texel));
    data.as_mut_slice().par_chunks_mut(length).enumerate().for_each(fill);
    data
}

/// Texels in the leading components of the whole, component × texel. The mean is kept: all that is compared is differences.
fn sketch(data: &DMatrix<f32>, seed: u64) -> DMatrix<f32> {
    let mean = data.column_mean();
    let mut centred = data.clone();
    centred.column_iter_mut().for_each(|mut column| column -= &mean);
    let principal = Principal::of(&centred, SKETCH, seed);
    transposed_times(&principal.basis(&centred, principal.len()), &centred)
}

/// Texels in clusters, and what is left of them.
#[derive(Clone, Debug)]
struct Clusters {
    labels: Vec<usize>,
    error: f64,
}

/// A mean and orthonormal components, component-major.
struct Subspace {
    mean: Vec<f32>,
    basis: DMatrix<f32>,
}

impl Subspace {
    fn of(points: &DMatrix<f32>, members: &[usize], components: usize) -> Self {
        let mut points = points.select_columns(members);
        let mean = points.column_mean();
        points.column_iter_mut().for_each(|mut point| point -= &mean);
        let principal = Principal::of(&points, components, 0);
        Self { basis: principal.basis(&points, principal.len()), mean: mean.as_slice().to_vec() }
    }

    /// Squared length of what it leaves of a point.
    fn residual(&self, point: &[f32]) -> f64 {
        let mut rest: Vec<f32> = point.iter().zip(&self.mean).map(|(x, m)| x - m).collect();
        for vector in self.basis.as_slice().chunks_exact(rest.len().max(1)) {
            let along = linear::dot(vector, &rest);
            rest.iter_mut().zip(vector).for_each(|(r, v)| *r -= along * v);
        }
        f64::from(linear::dot(&rest, &rest))
    }
}

/// The best of some clusterings.
fn cluster(points: &DMatrix<f32>, clusters: usize, components: usize, seed: u64) -> Clusters {
    let restarts = if clusters == 1 { 1 } else { RESTARTS };
    let tried = (0..restarts).map(|k| cluster_once(points, clusters, components, seed.wrapping_add(k)));
    let best = tried.reduce(|a, b| if b.error < a.error { b } else { a });
    best.unwrap_or(Clusters { labels: vec![0; points.ncols()], error: 0.0 })
}

fn cluster_once(points: &DMatrix<f32>, clusters: usize, components: usize, seed: u64) -> Clusters {
    let mut labels = nearest_seeds(points, clusters, seed);
    let mut best = Clusters { labels: labels.clone(), error: f64::INFINITY };
    for _ in 0..ROUNDS {
        let members = members_of(&labels);
        let spaces: Vec<Subspace> = members.par_iter().map(|m| Subspace::of(points, m, components)).collect();
        let assigned: Vec<(usize, f64)> =
            (0..points.ncols()).into_par_iter().map(|t| least(&spaces, points.column(t).as_slice())).collect();
        let now: f64 = assigned.iter().map(|a| a.1).sum();
        labels = assigned.iter().map(|a| a.0).collect();
        let settled = now >= best.error * (1.0 - SETTLED);
        if now < best.error {
            best = Clusters { labels: labels.clone(), error: now };
        }
        if settled {
            break;
        }
        seed_empty(&mut labels, &assigned, clusters);
    }
    best
}

/// The subspace that leaves the least of a point.
fn least(spaces: &[Subspace], point: &[f32]) -> (usize, f64) {
    let residuals = spaces.iter().map(|space| space.residual(point)).enumerate();
    residuals.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0))
}

/// Clusters without members take the points with the largest residuals, one each, where anything is left of them.
fn seed_empty(labels: &mut [usize], assigned: &[(usize, f64)], clusters: usize) {
    let mut sizes = vec![0usize; clusters];
    labels.iter().for_each(|&label| sizes[label] += 1);
    let mut worst: Vec<usize> = (0..assigned.len()).collect();
    worst.sort_by(|&a, &b| assigned[b].1.total_cmp(&assigned[a].1).then(a.cmp(&b)));
    let mut worst = worst.into_iter().filter(|&t| assigned[t].1 > 0.0);
    for empty in (0..clusters).filter(|&c| sizes[c] == 0) {
        let Some(texel) = worst.next() else { return };
        labels[texel] = empty;
    }
}

/// k-means++: each seed is drawn with probability proportional to the squared distance to the nearest before it; each
/// point belongs to the nearest seed.
fn nearest_seeds(points: &DMatrix<f32>, clusters: usize, seed: u64) -> Vec<usize> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let distance = |a: usize, b: usize| f64::from((points.column(a) - points.column(b)).norm_squared());
    let first = random.random_range(0..points.ncols().max(1));
    let mut labels = vec![0; points.ncols()];
    let mut nearest: Vec<f64> = (0..points.ncols()).map(|t| distance(t, first)).collect();
    for label in 1..clusters {
        let total: f64 = nearest.iter().sum();
        if total <= 0.0 {
            break;
        }
        let mut left = random.random_range(0.0..total);
        let crossed = nearest.iter().position(|d| {
            left -= d;
            left < 0.0 && *d > 0.0
        });
        let Some(chosen) = crossed else { continue };
        for t in 0..points.ncols() {
            let d = distance(t, chosen);
            if d < nearest[t] {
                (nearest[t], labels[t]) = (d, label);
            }
        }
    }
    labels
}

/// The numbers of clusters, of those tried, that leave the least for as many bytes: the two best, for their bytes are
/// estimated here.
fn best_clusters(points: &DMatrix<f32>, bytes: usize, length: usize, seed: u64) -> Vec<Clusters> {
    let texels = points.ncols();
    let mut found = Vec::new();
    for clusters in TRIED.into_iter().filter(|&c| c <= texels) {
        let per_component = (clusters * length + texels) * TYPICAL_BITS / 8;
        let components = (bytes / per_component.max(1)).saturating_sub(1).min(SKETCH / 2);
        if clusters > 1 && bytes < per_component {
            break;
        }
        found.push(cluster(points, clusters, components, seed));
    }
    found.sort_by(|a, b| a.error.total_cmp(&b.error));
    found.truncate(2);
    found
}

/// Members of each cluster that has some, ascending.
fn members_of(labels: &[usize]) -> Vec<Vec<usize>> {
    let count = labels.iter().max().map_or(0, |&label| label + 1);
    let mut members = vec![Vec::new(); count];
    labels.iter().enumerate().for_each(|(texel, &label)| members[label].push(texel));
    members.retain(|m| !m.is_empty());
    members
}

fn places_of(members: &[Vec<usize>], texels: usize) -> Vec<Place> {
    let mut places = vec![Place { cluster: 0, member: 0 }; texels];
    for (cluster, texels) in members.iter().enumerate() {
        for (member, &texel) in texels.iter().enumerate() {
            places[texel] = Place { cluster: cluster as u16, member: member as u32 };
        }
    }
    places
}

/// Bits of a cluster's number, at least one.
fn label_bits(clusters: usize) -> u32 {
    (usize::BITS - clusters.saturating_sub(1).leading_zeros()).max(1)
}

/// Bytes of the numbers of clusters and components, and of the texels' clusters.
fn side_bytes(texels: usize, clusters: usize) -> usize {
    2 + 2 * clusters + (texels * label_bits(clusters) as usize).div_ceil(8)
}

impl LocalPca {
    /// Bytes as the literature counts them, in 32-bit floats.
    pub fn printed_bytes(&self) -> usize {
        let components = self.components();
        let shared: usize = components.iter().map(|&k| printed_bytes(0, self.frame.pairs(), 1, k, 4)).sum();
        let own = self.places.iter().map(|place| components[usize::from(place.cluster)]);
        shared + own.map(|k| printed_bytes(1, 0, 0, k, 4)).sum::<usize>()
    }

    /// Number of components of each cluster.
    pub fn components(&self) -> Vec<usize> {
        self.models.iter().map(LinearModel::components).collect()
    }
}

impl Sampler for LocalPca {
    fn frame(&self) -> &Frame {
        &self.frame
    }

    fn value(&self, texel: usize, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3] {
        let place = self.places[texel];
        let model = &self.models[usize::from(place.cluster)];
        let weights = model.weights.element(place.member as usize);
        let mut value = [0.0; 3];
        for (pair, share) in self.frame.blend(light, view).into_iter().filter(|(_, w)| *w > 0.0) {
            let images = model.images.elements(3 * pair, 3).chunks_exact(model.images.count());
            value.iter_mut().zip(images).for_each(|(v, image)| *v += share * affine(image, weights));
        }
        value.map(|v| v.max(0.0))
    }

    fn picture(&self, light: &Vector3<f32>, view: &Vector3<f32>) -> Vec<f32> {
        let pairs = self.frame.blend(light, view);
        let blended = |model: &LinearModel| {
            let mut images = vec![0.0; 3 * model.images.count()];
            blend_into(pairs.iter().map(|&(pair, w)| (model.images.elements(3 * pair, 3), w)), &mut images);
            images
        };
        let images: Vec<Vec<f32>> = self.models.iter().map(blended).collect();
        let texel = |place: &Place| {
            let (images, model) = (&images[usize::from(place.cluster)], &self.models[usize::from(place.cluster)]);
            let weights = model.weights.element(place.member as usize);
            let rows = model.images.count();
            [0, 1, 2].map(|c| affine(&images[c * rows..][..rows], weights).max(0.0))
        };
        self.places.iter().flat_map(texel).collect()
    }
}

impl Stored for LocalPca {
    fn write(&self, out: &mut Writer) {
        out.part("clusters");
        out.u16(self.models.len() as u16);
        self.models.iter().for_each(|model| out.u16(model.components() as u16));
        let bits = label_bits(self.models.len());
        self.places.iter().for_each(|place| out.bits(u32::from(place.cluster), bits));
        out.part("components");
        self.models.iter().for_each(|model| model.images.write(out));
        out.part("weights");
        self.models.iter().for_each(|model| model.weights.write(out));
    }

    fn read(from: &mut Reader<'_>, frame: Frame) -> Result<Self, Fault> {
        let clusters = usize::from(from.u16()?);
        if !(1..=MOST_CLUSTERS).contains(&clusters) {
            return Err(Fault(format!("{clusters} clusters of texels")));
        }
        let counts = from.u16s(clusters)?;
        let (bits, texels) = (label_bits(clusters), frame.texels());
        from.expect((texels * bits as usize).div_ceil(8), 1)?;
        let labels = (0..texels).map(|_| from.bits(bits).map(|label| label as usize)).collect::<Result<Vec<_>, _>>()?;
        from.align();
        if labels.iter().any(|&label| label >= clusters) {
            return Err(Fault(format!("a texel of a cluster beyond {clusters}")));
        }
        let members = members_of(&labels);
        if members.len() != clusters {
            return Err(Fault(format!("{clusters} clusters, {} with texels", members.len())));
        }
        let sizes = members.iter().zip(&counts).map(|(m, &k)| (3 * frame.pairs(), m.len(), k));
        let models = LinearModel::read_all(from, sizes)?;
        Ok(Self { places: places_of(&members, texels), models, frame })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_printed_ratios_are_reproduced() {
        let raw = 65_536.0 * 6561.0 * 3.0;
        assert_eq!(printed_bytes(65_536, 6561, 7, 5, 4), 4_683_000);
        assert_eq!(format!("{:.2}", raw / f64::from(4_683_000)), "275.45");
        assert_eq!(format!("{:.0}", raw / printed_bytes(65_536, 6561, 7, 5, 1) as f64), "1057");
    }

    #[test]
    fn a_residual_near_zero_is_small_and_never_negative() {
        let points = DMatrix::from_fn(20, 9, |i, t| 1000.0 + (t as f32) * (i as f32 * 0.7).sin() * 1e-2);
        let space = Subspace::of(&points, &[0, 1, 2, 3, 4, 5, 6, 7, 8], 1);
        for t in 0..9 {
            let residual = space.residual(points.column(t).as_slice());
            assert!((0.0..1e-6).contains(&residual), "{residual}");
        }
    }

    #[test]
    fn texels_of_two_kinds_fall_into_two_clusters() {
        // Two lines in different directions through different points.
        let points = DMatrix::from_fn(6, 40, |i, t| {
            let along = (t / 2) as f32 * 0.1;
            if t % 2 == 0 { along * (i as f32).cos() } else { 2.0 + along * (i as f32 * 2.0).sin() }
        });
        let found = cluster(&points, 2, 1, 5);
        assert!((0..40).all(|t| found.labels[t] == found.labels[t % 2]) && found.labels[0] != found.labels[1]);
        assert!(found.error < 1e-8);
    }

    #[test]
    fn more_clusters_than_distinct_texels_leave_none_empty() {
        let points = DMatrix::from_fn(4, 30, |i, t| (t % 3) as f32 * (i + 1) as f32);
        let found = cluster(&points, 8, 2, 1);
        assert!(members_of(&found.labels).len() <= 8 && found.error < 1e-9);
    }
}
