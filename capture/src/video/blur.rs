//! How blurred a picture is, in pixels: the edges of a printed board are steps, whatever they look like is the lens's
//! and the motion's doing (ISO 12233 measures cameras by such edges).

use super::{BoardView, Pattern};
use crate::board::Board;
use crate::saddle::edge;
use crate::{Image, srgb};
use nalgebra::{Point2, SMatrix, SVector, Vector2};

/// Edges looked at along each side of the board, evenly over it.
const MOST_EDGES: usize = 20;
/// Fewer edges along a side tell nothing.
const FEWEST_EDGES: usize = 3;
/// Pixels on either side of an edge that are looked at, at most, and that are needed.
const REACH: std::ops::RangeInclusive<f64> = 1.5..=16.0;
/// Part of an edge that is looked at: its ends meet others.
const MIDDLE: f64 = 0.6;
/// Bins a pixel, across the edge.
const BINS: f64 = 4.0;
/// Least difference of light and dark, white = 1.
const CONTRAST: f64 = 0.05;
/// What an edge may leave unexplained, in parts of its contrast; something before it leaves more.
const RESIDUAL: f64 = 0.1;
/// `tanh κ d` is nearest to a normal distribution's step of deviation 0.851 / κ (Haley 1952: a logistic of 1.702 x).
const DEVIATION: f64 = 0.851;
/// More of an edge must be seen than this many deviations of its blur.
const SEEN: f64 = 1.5;
/// How far, in deviations of the blur, what lies beyond the clear part reaches into it.
const BLURRED_IN: f64 = 2.0;
/// Where the blur is sought from, in pixels.
const SHARPEST: f64 = 0.25;
/// Rounds in which less and less is looked at.
const NARROWINGS: usize = 4;
/// Rounds of least squares.
const ROUNDS: usize = 30;

/// A straight edge in a picture.
struct Step {
    from: Point2<f64>,
    to: Point2<f64>,
    /// Pixels across the edge within which nothing else is printed.
    reach: f64,
    /// Which side of the board it is along.
    along: usize,
}

/// The standard deviation, in pixels, of the blur across the board's edges, in linear light and without that of the
/// pixels themselves: the root mean square of those along its two sides, each the middle one of all edges. Blur alike to
/// all sides counts as it is, a smear of `L` pixels along one line as `L / √24`. `None` where too few edges are seen
/// clear enough.
pub(super) fn blur_px(image: &Image<[u8; 3]>, pattern: &Pattern, view: &BoardView) -> Option<f64> {
    let steps = match pattern {
        Pattern::Board(board @ (Board::Chessboard { .. } | Board::Charuco { .. })) => squares(board, view),
        Pattern::Board(Board::ArucoGrid { dictionary, .. }) | Pattern::Markers(dictionary) => {
            markers(view, 1.0 / (dictionary.modules() + 2) as f64)
        }
    };
    let light: Vec<f64> = (0..256).map(|level| srgb::linear(f64::from(level) / 255.0)).collect();
    let middle = |along: usize| {
        let of_side: Vec<&Step> = steps.iter().filter(|step| step.along == along).collect();
        let every = of_side.len().div_ceil(MOST_EDGES).max(1);
        let mut variances: Vec<f64> =
            of_side.into_iter().step_by(every).filter_map(|step| variance(image, &light, step)).collect();
        variances.sort_by(f64::total_cmp);
        (variances.len() >= FEWEST_EDGES).then(|| variances[variances.len() / 2])
    };
    Some((0.5 * (middle(0)? + middle(1)?)).sqrt())
}

/// The left and upper edges of all squares whose four corners are seen.
fn squares(board: &Board, view: &BoardView) -> Vec<Step> {
    let columns = board.counts()[0] - 1;
    let free = match *board {
        Board::Charuco { square, marker, .. } => 0.5 * (square - marker) / square,
        _ => 0.5,
    };
    let at = |id: usize| view.corners.binary_search_by_key(&id, |c| c.0).ok().map(|n| view.corners[n].1);
    let mut steps = Vec::new();
    for &(id, corner) in view.corners.iter().filter(|(id, _)| (id + 1) % columns != 0) {
        let (Some(right), Some(below)) = (at(id + 1), at(id + columns)) else { continue };
        for (along, to, other) in [(0, right, below), (1, below, right)] {
            let reach = free * across(&corner, &to, &other).abs();
            steps.push(Step { from: corner, to, reach, along });
        }
    }
    steps
}

/// The outer edges of markers, whose border is one of `module` sides wide.
fn markers(view: &BoardView, module: f64) -> Vec<Step> {
    let side = |marker: &super::FoundMarker, k: usize| {
        let [from, to, other] = [0, 1, 2].map(|n| marker.corners[(k + n) % 4]);
        let reach = module * across(&from, &to, &other).abs();
        Step { from, to, reach, along: k % 2 }
    };
    view.markers.iter().flat_map(|marker| (0..4).map(move |k| side(marker, k))).collect()
}

/// Distance of a point from the line through two others, with a sign.
fn across(from: &Point2<f64>, to: &Point2<f64>, point: &Point2<f64>) -> f64 {
    (to - from).try_normalize(1e-9).map_or(0.0, |along| along.perp(&(point - from)))
}

/// Of the blur across an edge, in square pixels. What lies beyond the clear part is blurred into it: as the blur is found,
/// less is looked at.
fn variance(image: &Image<[u8; 3]>, light: &[f64], step: &Step) -> Option<f64> {
    let mut deviation = SHARPEST;
    for _ in 0..NARROWINGS {
        let reach = (step.reach - BLURRED_IN * deviation).min(*REACH.end());
        if reach < REACH.start().max(SEEN * deviation) {
            return None;
        }
        deviation = DEVIATION / sharpness(&profile(image, light, step, reach)?)?;
    }
    Some(deviation * deviation)
}

/// Distance from the edge, light, and how many pixels it is the mean of.
type Sample = (f64, f64, f64);

/// Light across the middle of an edge, of its pixels by their distance from it.
fn profile(image: &Image<[u8; 3]>, light: &[f64], step: &Step, reach: f64) -> Option<Vec<Sample>> {
    let length = (step.to - step.from).norm();
    let along = (step.to - step.from).try_normalize(1e-9)?;
    let sides = Vector2::new(-along.y, along.x);
    let corners = [step.from, step.to].map(|end| [end + sides * reach, end - sides * reach]).concat();
    let range = |axis: usize, size: usize| {
        let values = || corners.iter().map(|p| p[axis]);
        let (from, to) = (values().fold(f64::INFINITY, f64::min), values().fold(0.0, f64::max));
        (from >= 0.0 && to <= size as f64).then_some(from as usize..to.ceil() as usize)
    };
    let (columns, rows) = (range(0, image.width())?, range(1, image.height())?);
    let mut bins = vec![(0.0, 0.0, 0.0); (BINS * 2.0 * reach).ceil() as usize + 1];
    for y in rows {
        for x in columns.clone() {
            let offset = Point2::new(x as f64 + 0.5, y as f64 + 0.5) - step.from;
            let (place, distance) = (along.dot(&offset) / length - 0.5, along.perp(&offset));
            if 2.0 * place.abs() > MIDDLE || distance.abs() > reach {
                continue;
            }
            let [r, g, b] = image.at(x, y).map(|level| light[usize::from(level)]);
            let bin = &mut bins[(BINS * (distance + reach)) as usize];
            *bin = (bin.0 + distance, bin.1 + (r + g + b) / 3.0, bin.2 + 1.0);
        }
    }
    bins.retain(|bin| bin.2 > 0.0);
    Some(bins.into_iter().map(|(distance, light, count)| (distance / count, light / count, count)).collect())
}

/// `κ` of the step `a + b s(d − d₀, κ)` that is nearest to a profile, by Levenberg–Marquardt; `s` is `tanh κ d` as pixels
/// see it. `None` where there is no such step.
fn sharpness(profile: &[Sample]) -> Option<f64> {
    let (first, last) = (profile.first()?, profile.last()?);
    let half = 0.5 * (last.1 - first.1);
    let mut best = SVector::from([0.5 * (first.1 + last.1), half, 0.0, 1.0]);
    let mut now = equations(profile, &best);
    let mut damping = 1e-3;
    for _ in 0..ROUNDS {
        let mut damped = now.normal;
        (0..4).for_each(|i| damped[(i, i)] += damping * now.normal[(i, i)] + 1e-12);
        let mut next = best + damped.cholesky()?.solve(&now.gradient);
        next[3] = next[3].clamp(0.05, 100.0);
        let tried = equations(profile, &next);
        let is_settled = (now.cost - tried.cost).abs() < 1e-6 * now.cost;
        if tried.cost <= now.cost {
            (best, now) = (next, tried);
            damping *= 0.3;
        } else {
            damping *= 10.0;
        }
        if is_settled || damping > 1e8 {
            break;
        }
    }
    let contrast = 2.0 * best[1].abs();
    let residual = (now.cost / profile.iter().map(|sample| sample.2).sum::<f64>()).sqrt();
    (contrast > CONTRAST && residual < RESIDUAL * contrast).then_some(best[3])
}

/// Normal matrix, gradient, and sum of squares.
struct Equations {
    normal: SMatrix<f64, 4, 4>,
    gradient: SVector<f64, 4>,
    cost: f64,
}

fn equations(profile: &[Sample], p: &SVector<f64, 4>) -> Equations {
    let mut sum = Equations { normal: SMatrix::zeros(), gradient: SVector::zeros(), cost: 0.0 };
    for &(distance, light, count) in profile {
        let step = edge(distance - p[2], p[3]);
        let row = SVector::from([1.0, step.level, -p[1] * step.slope, p[1] * step.by_sharpness]);
        let residual = light - (p[0] + p[1] * step.level);
        sum.normal += count * row * row.transpose();
        sum.gradient += count * residual * row;
        sum.cost += count * residual * residual;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::video::detect::tests::{camera, photograph};
    use crate::video::detect_pattern;

    /// The photograph in linear light, blurred by a normal distribution of these deviations along rows and columns, and
    /// encoded.
    fn blurred(image: &Image<[u8; 3]>, deviations: [f64; 2]) -> Image<[u8; 3]> {
        let mut light = image.map(|p| f64::from(p[0]) / 255.0);
        for (axis, deviation) in deviations.into_iter().enumerate().filter(|(_, deviation)| *deviation > 0.0) {
            let reach = (4.0 * deviation).ceil() as isize;
            let weight = |k: isize| (-0.5 * (k as f64 / deviation).powi(2)).exp();
            let total: f64 = (-reach..=reach).map(weight).sum();
            let before = light.clone();
            for y in 0..image.height() {
                for x in 0..image.width() {
                    let at = |k: isize| match axis {
                        0 => before.at_clamped(x as isize + k, y as isize),
                        _ => before.at_clamped(x as isize, y as isize + k),
                    };
                    light.set(x, y, (-reach..=reach).map(|k| weight(k) * at(k)).sum::<f64>() / total);
                }
            }
        }
        light.map(|v| [(255.0 * srgb::encoded(v)).round() as u8; 3])
    }

    /// What is told of a board's photograph under each blur.
    fn told<const N: usize>(board: &str, tilt: f64, deviations: [[f64; 2]; N]) -> [f64; N] {
        let board: Board = board.parse().unwrap();
        let pattern = Pattern::Board(board);
        let sharp = photograph(&board, &camera(tilt, 0.1, 0.42));
        deviations.map(|deviations| {
            let image = blurred(&sharp, deviations);
            let view = detect_pattern(&image, &pattern).unwrap();
            blur_px(&image, &pattern, &view).unwrap()
        })
    }

    #[test]
    fn blur_of_known_deviation_is_told_on_every_kind_of_board() {
        for board in ["charuco:7x5:30mm:21mm:4x4_50", "chessboard:7x5:30mm", "aruco:5x4:30mm:10mm:4x4_50"] {
            let [sharp, slight, strong] = told(board, 0.3, [[0.0; 2], [1.0; 2], [2.0; 2]]);
            println!("{board}: {sharp:.2}, {slight:.2}, {strong:.2}");
            assert!(sharp < 0.2, "{board}: {sharp}");
            assert!((slight - 1.0).abs() < 0.06 && (strong - 2.0).abs() < 0.2, "{board}: {slight} {strong}");
        }
    }

    #[test]
    fn blur_along_one_line_counts_half_its_square() {
        let [found] = told("chessboard:7x5:30mm", 0.0, [[2.0, 0.0]]);
        assert!((found - 2.0_f64.sqrt()).abs() < 0.1, "{found}");
    }

    #[test]
    fn without_a_board_nothing_is_told() {
        let pattern = Pattern::Board("chessboard:7x5:30mm".parse().unwrap());
        assert_eq!(blur_px(&Image::filled(64, 48, [90; 3]), &pattern, &BoardView::default()), None);
    }
}
