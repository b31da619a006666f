//! Silhouettes found in the photographs, where a capture gives none: for an object before a dark, a
//! plain or a coloured backdrop.
//!
//! 1. *Score* every pixel by its difference from the backdrop, whose colour is the median of all frame
//!    borders: brightness before a dark one, loss of its hue before a coloured one, distance else.
//! 2. *Threshold* all views alike at Otsu's level, and let them vote on a coarse hull.
//! 3. *Learn*: the hull says which pixels are object and which backdrop; the level at which both are
//!    wrong equally often (equal error rate) is the better threshold. Vote again.
//! 4. *Decide*: object is what scores above the threshold near the hull, and what lies well inside the
//!    hull although too dark (temple columns). Clutter away from the hull goes.
//! 5. *Soften*: at the edge the score itself, relative to the threshold, is the coverage, so the contour
//!    at half level is found between pixels.
//!
//! Limits: one object; a backdrop as bright as the object's dark parts is told from it by the votes alone,
//! to about a cell of the hull. Two views or views from one side cannot vote: steps 3 and 4 fall away.

use crate::matte::{blur, components, erode, grow, signed_distance};
use crate::votes::{Votes, rough_box};
use crate::{Aabb, Camera, Image};
use rayon::prelude::*;

/// Cells along the longest side of the voting hull: two to four pixels in a 640×480 frame.
const RESOLUTION: usize = 128;

/// Views that vote; more would only take longer.
const VOTERS: usize = 64;

/// Finds the matte of the object in every image (255 = object). `cameras` are for the images' sizes.
/// An image in which nothing is found gets an empty matte. Deterministic.
pub fn find_mattes(images: &[Image<[u8; 3]>], cameras: &[Camera]) -> Vec<Image<u8>> {
    find_mattes_in_box(images, cameras, None)
}

/// As [`find_mattes`], where the object's box is known.
pub fn find_mattes_in_box(images: &[Image<[u8; 3]>], cameras: &[Camera], object_box: Option<&Aabb>) -> Vec<Image<u8>> {
    let key = Key::of_borders(images);
    let scores: Vec<Image<f32>> = images.par_iter().map(|image| key.score(image)).collect();
    let otsu = otsu_level(&histogram(scores.iter().map(|s| (s, None))));
    let first: Vec<Image<u8>> = scores.par_iter().map(|score| without_specks(&above(score, otsu))).collect();
    let Some(hull) = vote(cameras, &first, object_box) else {
        return scores.par_iter().zip(&first).map(|(score, mask)| softened(score, mask, otsu)).collect();
    };
    let level = learned_level(&scores, cameras, &hull);
    let second: Vec<Image<u8>> = scores.par_iter().map(|score| without_specks(&above(score, level))).collect();
    let hull = vote(cameras, &second, Some(&hull.tight_box)).unwrap_or(hull);
    let decide = |(score, camera): (&Image<f32>, &Camera)| {
        softened(score, &decided(score, level, key.fill_level(level), camera, &hull), level)
    };
    scores.par_iter().zip(cameras).map(decide).collect()
}

/// How a pixel differs from the backdrop, as a number from 0 (backdrop) to 255.
#[derive(Clone, Copy, Debug)]
enum Key {
    /// Dark backdrop: the brightest channel.
    Brightness,
    /// Coloured backdrop: what is missing of its hue, along this unit vector of zero sum.
    Hue([f32; 3], f32),
    /// Grey or white backdrop: the largest difference of a channel.
    Distance([f32; 3]),
}

impl Key {
    fn of_borders(images: &[Image<[u8; 3]>]) -> Self {
        let backdrop = border_median(images);
        let mean = backdrop.iter().sum::<f32>() / 3.0;
        let chroma = backdrop.map(|c| c - mean);
        let strength = chroma.iter().map(|c| c * c).sum::<f32>().sqrt();
        // Levels of 8 bits. A backdrop this dark has no hue to speak of.
        if backdrop.iter().all(|&c| c < 50.0) {
            Self::Brightness
        } else if strength > 15.0 {
            Self::Hue(chroma.map(|c| c / strength), strength)
        } else {
            Self::Distance(backdrop)
        }
    }

    /// The least score of what may be filled in because the hull says so. Before a dark backdrop an unlit part
    /// looks like it; before any other, what looks like it is an opening (between the legs of the dinosaur).
    fn fill_level(&self, level: f32) -> f32 {
        match self {
            Self::Brightness => 0.0,
            Self::Hue(..) => 0.5 * (85.0 + level),
            Self::Distance(_) => 0.5 * level,
        }
    }

    fn score(&self, image: &Image<[u8; 3]>) -> Image<f32> {
        let score = image.map(|p| {
            let p = p.map(f32::from);
            match *self {
                Self::Brightness => p[0].max(p[1]).max(p[2]),
                // Backing scores about 85, twice the backing's hue 0: shades and lights of it keep apart.
                Self::Hue(axis, strength) => {
                    let hue = p[0] * axis[0] + p[1] * axis[1] + p[2] * axis[2];
                    (85.0 * (2.0 - hue / strength)).clamp(0.0, 255.0)
                }
                Self::Distance(backdrop) => (0..3).map(|c| (p[c] - backdrop[c]).abs()).fold(0.0, f32::max),
            }
        });
        // Noise and JPEG blocks; sub-pixel contours ask for no more than 0.7.
        blur(&score, 0.6)
    }
}

fn border_median(images: &[Image<[u8; 3]>]) -> [f32; 3] {
    let mut counts = [[0_u64; 256]; 3];
    for image in images.iter().filter(|i| !i.pixels().is_empty()) {
        let (w, h) = (image.width(), image.height());
        let ring = (w.min(h) / 50).max(1);
        for y in 0..h {
            for x in 0..w {
                let is_border = x < ring || y < ring || x + ring >= w || y + ring >= h;
                if is_border {
                    image.at(x, y).iter().zip(&mut counts).for_each(|(&v, count)| count[usize::from(v)] += 1);
                }
            }
        }
    }
    counts.map(|count| percentile(&count, 0.5) as f32)
}

/// Scores in whole levels, of the pixels where the selection (if any) is true.
fn histogram<'a>(scores: impl Iterator<Item = (&'a Image<f32>, Option<Image<bool>>)>) -> [u64; 256] {
    let mut counts = [0; 256];
    for (score, selection) in scores {
        for (i, &value) in score.pixels().iter().enumerate() {
            if selection.as_ref().is_none_or(|s| s.pixels()[i]) {
                counts[value.clamp(0.0, 255.0) as usize] += 1;
            }
        }
    }
    counts
}

fn percentile(counts: &[u64; 256], fraction: f64) -> usize {
    let wanted = fraction * counts.iter().sum::<u64>() as f64;
    let mut sum = 0;
    counts
        .iter()
        .position(|&c| {
            sum += c;
            sum as f64 >= wanted
        })
        .unwrap_or(255)
}

/// The level that splits the scores into the two most compact classes (Otsu, 1979).
fn otsu_level(counts: &[u64; 256]) -> f32 {
    let total: f64 = counts.iter().sum::<u64>() as f64;
    let weighted: f64 = counts.iter().enumerate().map(|(i, &c)| i as f64 * c as f64).sum();
    let (mut below, mut sum) = (0.0, 0.0);
    let mut best = (0.0, 128);
    for (level, &count) in counts.iter().enumerate() {
        below += count as f64;
        sum += level as f64 * count as f64;
        let spread = (weighted * below / total - sum).powi(2) / (below * (total - below)).max(1e-9);
        if spread > best.0 {
            best = (spread, level);
        }
    }
    best.1 as f32 + 1.0
}

fn above(score: &Image<f32>, level: f32) -> Image<u8> {
    score.map(|v| if v >= level { 255 } else { 0 })
}

/// Keeps the largest part and those of at least a hundredth of it that lie within the frame: what reaches
/// in from the border is the room, or the black margin of a digitised frame.
fn without_specks(mask: &Image<u8>) -> Image<u8> {
    let (sizes, labels) = components(&mask.map(|v| v >= 128));
    let largest = sizes.iter().max().copied().unwrap_or(0);
    let mut keep: Vec<bool> = sizes.iter().map(|&size| size * 100 >= largest).collect();
    let (w, h) = (labels.width(), labels.height());
    let border = (0..w).flat_map(|x| [(x, 0), (x, h - 1)]).chain((0..h).flat_map(|y| [(0, y), (w - 1, y)]));
    for (x, y) in border {
        let label = labels.at(x, y) as usize;
        if label > 0 && sizes[label - 1] < largest {
            keep[label - 1] = false;
        }
    }
    labels.map(|l| if l > 0 && keep[l as usize - 1] { 255 } else { 0 })
}

/// What most views agree on.
struct Hull {
    votes: Votes,
    /// Cells that most views call object.
    likely: Vec<bool>,
    /// Cells that nearly all views call object.
    sure: Vec<bool>,
    tight_box: Aabb,
}

fn vote(cameras: &[Camera], masks: &[Image<u8>], object_box: Option<&Aabb>) -> Option<Hull> {
    if masks.len() < 3 {
        return None;
    }
    let step = masks.len().div_ceil(VOTERS);
    let voters: Vec<_> = cameras.iter().zip(masks).step_by(step).collect();
    let mut search = match object_box {
        Some(known) => *known,
        None => rough_box(&voters)?,
    };
    // From a rough box to a tight one with coarse cells first.
    if object_box.is_none() {
        let coarse = Votes::count(&search, RESOLUTION / 2, &voters);
        search = coarse.box_of(&coarse.object(0.8))?;
    }
    let votes = Votes::count(&search, RESOLUTION, &voters);
    let likely = votes.object(0.8);
    let sure = votes.object(0.93);
    let tight_box = votes.box_of(&likely)?;
    Some(Hull { votes, likely, sure, tight_box })
}

/// The score at which as large a part of the object lies below as of the backdrop above.
fn learned_level(scores: &[Image<f32>], cameras: &[Camera], hull: &Hull) -> f32 {
    let step = scores.len().div_ceil(VOTERS);
    let pairs: Vec<_> = scores.iter().zip(cameras).step_by(step).collect();
    let distances: Vec<(Image<f32>, f32)> = pairs
        .par_iter()
        .map(|(_, camera)| {
            let (shape, cell) = hull.votes.project(&hull.likely, camera);
            (signed_distance(&shape), cell as f32)
        })
        .collect();
    let select = |keep: fn(f32, f32) -> bool| {
        let images =
            pairs.iter().zip(&distances).map(|((score, _), (d, cell))| (*score, Some(d.map(|d| keep(d, *cell)))));
        histogram(images)
    };
    let object = select(|d, cell| d > 2.0 * cell + 1.0);
    let backdrop = select(|d, cell| d < -cell - 2.0);
    equal_error_level(&object, &backdrop)
}

fn equal_error_level(object: &[u64; 256], backdrop: &[u64; 256]) -> f32 {
    let share = |counts: &[u64; 256], range: std::ops::Range<usize>| {
        counts[range].iter().sum::<u64>() as f64 / counts.iter().sum::<u64>().max(1) as f64
    };
    let error = |level: usize| (share(object, 0..level), share(backdrop, level..256));
    // Where the classes are apart a whole range has no errors: its middle.
    let from = (0..256).find(|&l| error(l).0 >= error(l).1).unwrap_or(128);
    let to = (from..256).take_while(|&l| error(l).0 <= 1e-4).last().unwrap_or(from);
    0.5 * (from + to) as f32
}

fn decided(score: &Image<f32>, level: f32, fill_level: f32, camera: &Camera, hull: &Hull) -> Image<u8> {
    let (likely, cell) = hull.votes.project(&hull.likely, camera);
    let (sure, _) = hull.votes.project(&hull.sure, camera);
    let near = grow(&likely, 1.0 + 0.5 * cell);
    let inner = erode(&sure, 1.0 + 1.5 * cell);
    let object = score.pixels().iter().zip(near.pixels()).zip(inner.pixels());
    let object = object.map(
        |((&s, &near), &inner)| if near >= 128 && (s >= level || (inner >= 128 && s >= fill_level)) { 255 } else { 0 },
    );
    let mask = Image::from_pixels(score.width(), score.height(), object.collect()).unwrap_or_default();
    without_pinholes(&without_specks(&mask))
}

/// Fills holes smaller than a two-thousandth of the object; real openings are larger.
fn without_pinholes(mask: &Image<u8>) -> Image<u8> {
    let object = mask.pixels().iter().filter(|v| **v >= 128).count();
    let (sizes, labels) = components(&mask.map(|v| v < 128));
    labels.map(|l| if l > 0 && sizes[l as usize - 1] > object / 2000 { 0 } else { 255 })
}

/// The coverage at the edge of `mask`: half where the score passes `level`.
fn softened(score: &Image<f32>, mask: &Image<u8>, level: f32) -> Image<u8> {
    let distance = signed_distance(mask);
    let pixels = score.pixels().iter().zip(distance.pixels()).map(|(&s, &d)| {
        // Beyond this the score speaks of shading, not of coverage.
        if d.abs() > 1.5 {
            return if d > 0.0 { 255 } else { 0 };
        }
        let coverage = (0.5 * s / level.max(1.0) * 255.0).clamp(0.0, 255.0) as u8;
        if d > 0.0 { coverage.max(128) } else { coverage.min(127) }
    });
    Image::from_pixels(score.width(), score.height(), pixels.collect()).unwrap_or_default()
}
