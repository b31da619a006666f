//! Which pictures look alike: k-means on their cumulative histograms, as the subspaces of Haindl and Filip.
//!
//! Beside 16 levels of each channel's cumulative histogram a picture is described by how its luminance
//! correlates with that of the texels to the right and below, since light from the left and light from the top may
//! give the same histogram.

use super::noise::even;
use rayon::prelude::*;

const LEVELS: usize = 16;
const DESCRIPTION: usize = 3 * LEVELS + 2;
/// What correlations count beside the level of a histogram.
const CORRELATION_WEIGHT: f64 = 0.5;
const ROUNDS: usize = 30;

/// What a picture is compared by.
pub(super) type Description = [f64; DESCRIPTION];

/// Pictures in groups.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Clusters {
    /// Of each picture.
    pub(super) of: Vec<u16>,
    /// Of each group: its pictures, the one nearest to the middle first.
    pub(super) members: Vec<Vec<usize>>,
    /// Share of the variance of the descriptions the groups leave unexplained.
    pub(super) unexplained: f64,
}

/// Describes each picture of `[width, height]` texels, (y, x, channel).
pub(super) fn describe(pictures: &[f32], [width, height]: [usize; 2]) -> Vec<Description> {
    pictures.par_chunks_exact(3 * width * height).map(|picture| describe_one(picture, [width, height])).collect()
}

fn describe_one(picture: &[f32], [width, height]: [usize; 2]) -> Description {
    let texels = width * height;
    let mut description = [0.0; DESCRIPTION];
    for (i, &value) in picture.iter().enumerate() {
        let level = (value * LEVELS as f32).clamp(0.0, LEVELS as f32 - 1.0) as usize;
        description[i % 3 * LEVELS + level] += 1.0 / texels as f64;
    }
    for histogram in description[..3 * LEVELS].chunks_exact_mut(LEVELS) {
        for level in 1..LEVELS {
            histogram[level] += histogram[level - 1];
        }
    }
    let luminance: Vec<f64> = picture.chunks_exact(3).map(|p| p.iter().map(|&v| f64::from(v)).sum()).collect();
    let mean = luminance.iter().sum::<f64>() / texels as f64;
    let product = |dx: usize, dy: usize| -> f64 {
        let at = |x: usize, y: usize| luminance[y % height * width + x % width] - mean;
        (0..texels).map(|i| at(i % width, i / width) * at(i % width + dx, i / width + dy)).sum()
    };
    let variance = product(0, 0);
    if variance > 1e-9 * texels as f64 {
        description[3 * LEVELS] = CORRELATION_WEIGHT * product(1, 0) / variance;
        description[3 * LEVELS + 1] = CORRELATION_WEIGHT * product(0, 1) / variance;
    }
    description
}

/// At most `count` groups: fewer where fewer pictures differ.
pub(super) fn cluster(descriptions: &[Description], count: usize, seed: u64) -> Clusters {
    let mut centers = spread_centers(descriptions, count.max(1), seed);
    let mut nearest: Vec<(usize, f64)> = Vec::new();
    for _ in 0..ROUNDS {
        let next: Vec<(usize, f64)> = descriptions.par_iter().map(|d| nearest_center(&centers, d)).collect();
        let settled = next.iter().map(|n| n.0).eq(nearest.iter().map(|n| n.0));
        nearest = next;
        if settled {
            break;
        }
        move_centers(&mut centers, descriptions, &nearest);
    }
    gather(descriptions, &nearest, centers.len())
}

/// Starts far from one another (Arthur and Vassilvitskii 2007); stops where all pictures are at a start.
fn spread_centers(descriptions: &[Description], count: usize, seed: u64) -> Vec<Description> {
    let first = (even(seed, 0) * descriptions.len() as f64) as usize;
    let mut centers: Vec<Description> = descriptions.get(first).copied().into_iter().collect();
    let mut far = vec![f64::INFINITY; descriptions.len()];
    while centers.len() < count {
        let Some(last) = centers.last().copied() else { break };
        far.iter_mut().zip(descriptions).for_each(|(f, d)| *f = f.min(distance(d, &last)));
        let total: f64 = far.iter().sum();
        let mut rest = even(seed, centers.len() as u64) * total;
        let chosen = far.iter().position(|f| {
            rest -= f;
            rest < 0.0 && *f > 1e-12
        });
        match chosen.or_else(|| far.iter().position(|&f| f > 1e-12)) {
            Some(chosen) => centers.push(descriptions[chosen]),
            None => break,
        }
    }
    centers
}

fn move_centers(centers: &mut [Description], descriptions: &[Description], nearest: &[(usize, f64)]) {
    let mut sums = vec![([0.0; DESCRIPTION], 0.0); centers.len()];
    for (d, &(center, _)) in descriptions.iter().zip(nearest) {
        sums[center].0.iter_mut().zip(d).for_each(|(s, v)| *s += v);
        sums[center].1 += 1.0;
    }
    for (center, (sum, count)) in centers.iter_mut().zip(sums) {
        if count > 0.0 {
            *center = sum.map(|s| s / count);
        }
    }
}

/// Groups that hold something, in order.
fn gather(descriptions: &[Description], nearest: &[(usize, f64)], count: usize) -> Clusters {
    let mut members = vec![Vec::new(); count];
    nearest.iter().enumerate().for_each(|(picture, n)| members[n.0].push(picture));
    members.retain(|m| !m.is_empty());
    members.iter_mut().for_each(|m| m.sort_by(|&a, &b| nearest[a].1.total_cmp(&nearest[b].1).then(a.cmp(&b))));
    let mut of = vec![0; nearest.len()];
    for (group, members) in members.iter().enumerate() {
        members.iter().for_each(|&picture| of[picture] = group as u16);
    }
    let all = descriptions.len().max(1) as f64;
    let mean: Description = std::array::from_fn(|i| descriptions.iter().map(|d| d[i]).sum::<f64>() / all);
    let total: f64 = descriptions.iter().map(|d| distance(d, &mean)).sum();
    let left: f64 = nearest.iter().map(|n| n.1).sum();
    Clusters { of, members, unexplained: if total > 1e-12 { left / total } else { 0.0 } }
}

fn nearest_center(centers: &[Description], d: &Description) -> (usize, f64) {
    let mut best = (0, f64::INFINITY);
    for (i, center) in centers.iter().enumerate() {
        let far = distance(center, d);
        if far < best.1 {
            best = (i, far);
        }
    }
    best
}

fn distance(a: &Description, b: &Description) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}
