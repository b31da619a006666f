//! From odds to a silhouette: near the hull of all views the odds decide, far from it the hull does, and of all borders
//! the shortest along edges of the picture is taken.

use super::Odds;
use super::cut::Cut;
use super::light::Toned;
use super::palette::Palette;
use crate::Image;
use crate::matte::{components, signed_distance};

/// Log odds gained inside the hull: enough where the picture says nothing, and no more. The hull fills what few frames
/// look through, a loop of rope or the gap behind a tusk; what these see there is to be believed.
const TRUST: f32 = 0.5;

/// Log odds that a pixel of border costs where the picture is even.
const BORDER: f32 = 7.5;

/// A hole of which more than this share is object for the other views, in colours that the object shows elsewhere, is a
/// patch of the background's colour, where the background has one.
const LARGEST_SOLID: f64 = 0.7;

/// What is behind a hole has one colour if it varies by less (standard deviation of the mean of its channels, encoded
/// levels). Print that shows through as it should is no patch.
const ONE_COLOUR: f64 = 15.0;

/// Object (255) or not, for voting where no hull is known yet: in between where the odds are even.
pub(super) fn guessed(log_odds: &Image<f32>) -> Image<u8> {
    log_odds.map(|l| (255.0 / (1.0 + (-0.7 * l).exp())) as u8)
}

/// The silhouette (255 or 0): the cheapest border (Boykov and Jolly, Interactive Graph Cuts, ICCV 2001) given the odds,
/// the hull of all views (object from 128 on), of which each pixel outside costs `distrust` of the log odds, and a price
/// per pixel of border, lower along edges of the picture. With `patches`, the colours of the object, the hull is good
/// enough to say which holes are patches of the background's colour.
pub(super) fn decided(
    picture: &Toned,
    odds: &Odds,
    hull: &Image<u8>,
    distrust: f32,
    patches: Option<&Palette>,
) -> Image<u8> {
    let distance = signed_distance(hull);
    let gain = odds.log_odds.pixels().iter().zip(distance.pixels()).map(|(&l, &d)| {
        let prior = if d > 0.0 { TRUST } else { distrust * d };
        cost(l + prior)
    });
    let gain = Image::from_pixels(hull.width(), hull.height(), gain.collect()).unwrap_or_default();
    let [right, down] = borders(picture, hull.width(), hull.height());
    let mask = Cut::new(&gain, &right, &down).inside();
    let width = hull.width();
    let is_patch =
        |at: usize| hull.pixels()[at] >= 128 && patches.is_some_and(|p| p.has(&picture.at(at % width, at / width)));
    without_specks(&mask, &odds.background, &is_patch)
}

/// Log odds as whole numbers: flow in these ends, and is the same everywhere.
fn cost(log_odds: f32) -> i32 {
    // The distance to a hull of which nothing is seen is infinite.
    (64.0 * log_odds.clamp(-1000.0, 1000.0)).round() as i32
}

/// The price of a border to the right of each pixel and below it: `p exp(−|ΔI|² / (2 ⟨|ΔI|²⟩))`, lowest where colours
/// differ more than they do in the mean (Rother, Kolmogorov and Blake, GrabCut, SIGGRAPH 2004).
fn borders(picture: &Toned, width: usize, height: usize) -> [Image<i32>; 2] {
    let difference = |x: usize, y: usize, dx: usize, dy: usize| -> f32 {
        let (a, b) = (picture.at(x, y), picture.at((x + dx).min(width - 1), (y + dy).min(height - 1)));
        (0..3).map(|c| (a[c] - b[c]).powi(2)).sum()
    };
    let squares = [(1, 0), (0, 1)].map(|(dx, dy)| {
        let pixels = (0..width * height).map(|at| difference(at % width, at / width, dx, dy));
        Image::from_pixels(width, height, pixels.collect()).unwrap_or_default()
    });
    let sum: f64 = squares.iter().flat_map(|s| s.pixels()).map(|&s| f64::from(s)).sum();
    let mean = (sum / (2 * width * height).max(1) as f64).max(1.0) as f32;
    squares.map(|s| s.map(|d| cost(BORDER * (-0.5 * d / mean).exp())))
}

/// Drops parts below a hundredth of the largest, fills holes below a two-thousandth of the object and those of which most
/// pixels are patches of it, before a background of one colour.
fn without_specks(
    mask: &Image<bool>,
    background: &Image<Option<[f32; 3]>>,
    is_patch: &dyn Fn(usize) -> bool,
) -> Image<u8> {
    let (sizes, labels) = components(mask);
    let largest = sizes.iter().max().copied().unwrap_or(0);
    let kept = labels.map(|l| l > 0 && sizes[l as usize - 1] * 100 >= largest);
    let object = kept.pixels().iter().filter(|k| **k).count();
    let (sizes, labels) = components(&kept.map(|k| !k));
    let mut holes: Vec<Hole> = sizes.iter().map(|&size| Hole { size, ..Hole::default() }).collect();
    for (at, &label) in labels.pixels().iter().enumerate().filter(|(_, l)| **l > 0) {
        holes[label as usize - 1].take(background.pixels()[at], is_patch(at));
    }
    let is_open = |hole: &Hole| hole.size > object / 2000 && !hole.is_patch();
    labels.map(|l| if l > 0 && is_open(&holes[l as usize - 1]) { 0 } else { 255 })
}

/// A hole in the object.
#[derive(Clone, Copy, Debug, Default)]
struct Hole {
    /// Pixels.
    size: usize,
    /// Of them, those that may be patches of the object.
    solid: usize,
    /// Those whose background is known; sums of its levels, and of their squares.
    known: [f64; 3],
}

impl Hole {
    fn take(&mut self, background: Option<[f32; 3]>, is_solid: bool) {
        self.solid += usize::from(is_solid);
        if let Some(colour) = background {
            let level = f64::from(colour.iter().sum::<f32>()) / 3.0;
            self.known = [self.known[0] + 1.0, self.known[1] + level, self.known[2] + level * level];
        }
    }

    fn is_patch(&self) -> bool {
        let [count, sum, squares] = self.known;
        let mean = sum / count.max(1.0);
        let variance = squares / count.max(1.0) - mean * mean;
        self.solid as f64 > LARGEST_SOLID * self.size as f64 && variance < ONE_COLOUR * ONE_COLOUR
    }
}
