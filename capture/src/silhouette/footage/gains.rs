//! Exposure and white balance of each frame, from what looks the same in many frames: the room before a still
//! camera, the target in the hand-held one's.

use super::StageSetup;
use super::light::{bilinear, linear};
use crate::{Aabb, Camera, Image};
use nalgebra::Point3;

/// Places on the target along each side.
const TARGET_PLACES: usize = 48;

/// Places need to be seen in this many frames to say what is usual.
const LEAST_FRAMES: usize = 3;

/// Linear light below this is noise, above the other clipped.
const USABLE: std::ops::RangeInclusive<f32> = 0.004..=0.93;

/// Factors on linear light that make the frames alike, each channel's median over the frames 1. `thumbnails` in
/// encoded levels with their `cameras`. Frames that share too little with others keep 1.
pub(super) fn find(
    thumbnails: &[Image<[f32; 3]>],
    cameras: &[Camera],
    setup: &StageSetup,
    bounds: Option<&Aabb>,
) -> Vec<[f64; 3]> {
    let mut gains = vec![[1.0; 3]; thumbnails.len()];
    let segments = setup.segments.iter().flatten().copied().max().map_or(0, |last| last + 1);
    for segment in 0..segments {
        let members: Vec<usize> = (0..thumbnails.len()).filter(|&i| setup.segments[i] == Some(segment)).collect();
        let observed: Vec<Vec<Option<[f32; 3]>>> = members.iter().map(|&i| of_room(&thumbnails[i])).collect();
        let found = alike(&observed);
        members.iter().zip(found).for_each(|(&i, gain)| gains[i] = gain);
    }
    if let Some(bounds) = bounds.filter(|_| setup.has_plane) {
        across_segments(thumbnails, cameras, setup, bounds, segments, &mut gains);
    }
    normalised(gains)
}

/// Evens hand-held frames, and whole segments, by what they see of the target.
fn across_segments(
    thumbnails: &[Image<[f32; 3]>],
    cameras: &[Camera],
    setup: &StageSetup,
    bounds: &Aabb,
    segments: usize,
    gains: &mut [[f64; 3]],
) {
    let mut groups: Vec<Vec<usize>> = vec![Vec::new(); segments];
    for (i, segment) in setup.segments.iter().enumerate() {
        match segment {
            Some(s) => groups[*s].push(i),
            None => groups.push(vec![i]),
        }
    }
    groups.retain(|g| !g.is_empty());
    if groups.len() < 2 {
        return;
    }
    let observed: Vec<_> = groups
        .iter()
        .map(|group| {
            let of_each: Vec<_> =
                group.iter().map(|&i| scaled(of_target(&thumbnails[i], &cameras[i], bounds), &gains[i])).collect();
            usual(&of_each, 1)
        })
        .collect();
    for (group, gain) in groups.iter().zip(alike(&observed)) {
        group.iter().for_each(|&i| (0..3).for_each(|c| gains[i][c] *= gain[c]));
    }
}

fn usable(colour: [f32; 3]) -> Option<[f32; 3]> {
    let light = colour.map(linear);
    light.iter().all(|v| USABLE.contains(v)).then_some(light)
}

fn of_room(thumbnail: &Image<[f32; 3]>) -> Vec<Option<[f32; 3]>> {
    thumbnail.pixels().iter().map(|&p| usable(p)).collect()
}

fn of_target(thumbnail: &Image<[f32; 3]>, camera: &Camera, bounds: &Aabb) -> Vec<Option<[f32; 3]>> {
    let (size, n) = (bounds.size(), TARGET_PLACES as f64);
    let at = |i: usize| {
        let (x, y) = ((i % TARGET_PLACES) as f64 + 0.5, (i / TARGET_PLACES) as f64 + 0.5);
        let point = Point3::new(bounds.min.x + size.x * x / n, bounds.min.y + size.y * y / n, 0.0);
        let pixel = camera.project(&point)?.pixel;
        camera.in_frame(pixel).then(|| bilinear(pixel.x, pixel.y, |x, y| thumbnail.at_clamped(x, y))).and_then(usable)
    };
    (0..TARGET_PLACES * TARGET_PLACES).map(at).collect()
}

fn scaled(light: Vec<Option<[f32; 3]>>, gain: &[f64; 3]) -> Vec<Option<[f32; 3]>> {
    light.into_iter().map(|l| l.map(|l| [0, 1, 2].map(|c| l[c] * gain[c] as f32))).collect()
}

/// Factors per row of `observed` (linear light, the same places in each) that make the rows alike: medians of
/// ratios to the usual colour, twice.
fn alike(observed: &[Vec<Option<[f32; 3]>>]) -> Vec<[f64; 3]> {
    let mut gains = vec![[1.0; 3]; observed.len()];
    for _ in 0..4 {
        let evened: Vec<_> = observed.iter().zip(&gains).map(|(row, gain)| scaled(row.clone(), gain)).collect();
        let usual = steady(&evened, usual(&evened, LEAST_FRAMES.min(observed.len())));
        for (row, gain) in evened.iter().zip(&mut gains) {
            for c in 0..3 {
                let pairs = row.iter().zip(&usual).filter_map(|(o, u)| Some((u.as_ref()?[c], o.as_ref()?[c])));
                // A ratio that far off is another thing.
                let pairs: Vec<(f32, f32)> = pairs.filter(|(u, o)| (0.4..2.5).contains(&(u / o))).collect();
                if pairs.len() >= 32 {
                    gain[c] *= centre(&pairs);
                }
            }
        }
    }
    gains
}

/// The quarter of the places that look most alike in all rows: more of a frame may be platter.
fn steady(rows: &[Vec<Option<[f32; 3]>>], usual: Vec<Option<[f32; 3]>>) -> Vec<Option<[f32; 3]>> {
    let deviation = |place: usize| {
        let middle = usual[place]?[1];
        let mut gaps: Vec<f32> =
            rows.iter().filter_map(|row| row[place].map(|p| (p[1] / middle - 1.0).abs())).collect();
        let half = gaps.len() / 2;
        (!gaps.is_empty()).then(|| *gaps.select_nth_unstable_by(half, f32::total_cmp).1)
    };
    let deviations: Vec<Option<f32>> = (0..usual.len()).map(deviation).collect();
    let mut sorted: Vec<f32> = deviations.iter().copied().flatten().collect();
    sorted.sort_by(f32::total_cmp);
    let Some(&limit) = sorted.get(sorted.len() / 4) else { return usual };
    let keep = |(colour, deviation): (Option<[f32; 3]>, &Option<f32>)| {
        colour.filter(|_| deviation.is_some_and(|d| d <= limit))
    };
    usual.into_iter().zip(&deviations).map(keep).collect()
}

/// Ratio of the sums of pairs whose ratio is near the median one: what has changed its light for another reason than
/// the exposure falls away, and the bright, which say more, count more.
fn centre(pairs: &[(f32, f32)]) -> f64 {
    let mut ratios: Vec<f32> = pairs.iter().map(|(u, o)| u / o).collect();
    let middle = ratios.len() / 2;
    let median = *ratios.select_nth_unstable_by(middle, f32::total_cmp).1;
    let mut gaps: Vec<f32> = ratios.iter().map(|r| (r - median).abs()).collect();
    // Two standard deviations, were they normal.
    let reach = 3.0 * *gaps.select_nth_unstable_by(middle, f32::total_cmp).1;
    let near = pairs.iter().filter(|(u, o)| (u / o - median).abs() <= reach);
    let (usual, seen) = near.fold((0.0, 0.0), |sum, &(u, o)| (sum.0 + f64::from(u), sum.1 + f64::from(o)));
    usual / seen
}

/// Per place and channel the median over the rows that see it.
fn usual(rows: &[Vec<Option<[f32; 3]>>], least: usize) -> Vec<Option<[f32; 3]>> {
    let places = rows.first().map_or(0, Vec::len);
    let mut values = Vec::with_capacity(rows.len());
    let mut median = |place: usize, c: usize| {
        values.clear();
        values.extend(rows.iter().filter_map(|row| row[place].map(|p| p[c])));
        if values.len() < least.max(1) {
            return None;
        }
        let middle = values.len() / 2;
        Some(*values.select_nth_unstable_by(middle, f32::total_cmp).1)
    };
    (0..places).map(|p| Some([median(p, 0)?, median(p, 1)?, median(p, 2)?])).collect()
}

fn normalised(mut gains: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
    for c in 0..3 {
        let mut values: Vec<f64> = gains.iter().map(|g| g[c]).collect();
        values.sort_by(f64::total_cmp);
        let median = values.get(values.len() / 2).copied().unwrap_or(1.0);
        gains.iter_mut().for_each(|g| g[c] /= median);
    }
    gains
}
