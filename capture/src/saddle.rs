//! Finds the point where four squares of a chessboard meet, to a hundredth of a pixel.

use crate::Image;
use nalgebra::{Point2, SMatrix, SVector, Vector2};

/// Where a corner is thought to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SaddleGuess {
    /// In pixels, to a pixel or two.
    pub(crate) pixel: Point2<f64>,
    /// Along the two edges, any length. Between the first and the second it is dark, if `is_dark`.
    pub(crate) edges: [Vector2<f64>; 2],
    /// Whether the squares between the edges, and between their opposites, are the dark ones.
    pub(crate) is_dark: bool,
    /// Pixels farther away than this show something else.
    pub(crate) reach: f64,
}

/// A corner as it was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Saddle {
    /// In pixels.
    pub(crate) pixel: Point2<f64>,
    /// Difference of light and dark, in levels.
    pub(crate) contrast: f64,
    /// RMS of what the model leaves unexplained, in parts of the contrast.
    pub(crate) residual: f64,
}

/// Mean, half contrast, x, y, the angles of the edges, sharpness in 1/px.
type Parameters = SVector<f64, 7>;

/// Rounds of least squares; they settle in about eight.
const ROUNDS: usize = 30;

/// Fits `a + b s(d₁) s(d₂)` to the pixels around the guess, with `d` the distances to two lines through the corner
/// and `s` the edge as a pixel sees it ([`edge`]), by Levenberg–Marquardt. A fit to the levels themselves is not drawn
/// to the pixel grid, as gradients are. `None` where the window leaves the image or nothing like a corner is there.
pub(crate) fn saddle(image: &Image<u8>, guess: &SaddleGuess) -> Option<Saddle> {
    let pixels = window(image, guess)?;
    let n = pixels.len() as f64;
    let mean = pixels.iter().map(|(_, v)| v).sum::<f64>() / n;
    let deviation = (pixels.iter().map(|(_, v)| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    let angles = guess.edges.map(|edge| edge.y.atan2(edge.x));
    // Between the edges the distances have opposite signs.
    let half = if guess.is_dark { deviation } else { -deviation };
    let mut best = Parameters::from([mean, half, guess.pixel.x, guess.pixel.y, angles[0], angles[1], 3.0]);
    let (mut normal, mut gradient, mut cost) = equations(&pixels, &best);
    let mut damping = 1e-3;
    for _ in 0..ROUNDS {
        let mut damped = normal;
        (0..7).for_each(|i| damped[(i, i)] += damping * normal[(i, i)] + 1e-12);
        let step = damped.cholesky()?.solve(&gradient);
        let mut next = best + step;
        // A hundredth of a pixel is as sharp as any; one softer than the window is no edge.
        next[6] = next[6].clamp(0.15, 100.0);
        let tried = equations(&pixels, &next);
        if tried.2 < cost {
            let moved = (next - best).fixed_rows::<2>(2).norm();
            best = next;
            (normal, gradient, cost) = tried;
            damping *= 0.3;
            if moved < 1e-5 {
                break;
            }
        } else {
            damping *= 10.0;
            if damping > 1e8 {
                break;
            }
        }
    }
    let pixel = Point2::new(best[2], best[3]);
    let contrast = 2.0 * best[1].abs();
    let is_kept = best[1] * half > 0.0 && (pixel - guess.pixel).norm() <= guess.reach.max(1.5);
    is_kept.then(|| Saddle { pixel, contrast, residual: (cost / n).sqrt() / contrast.max(1e-9) })
}

/// Centres and levels of the pixels within reach.
fn window(image: &Image<u8>, guess: &SaddleGuess) -> Option<Vec<(Point2<f64>, f64)>> {
    let range = |at: f64, size: usize| {
        let (from, to) = ((at - guess.reach).floor(), (at + guess.reach).ceil());
        (from >= 0.0 && to <= size as f64 && guess.reach >= 1.0).then_some(from as usize..to as usize)
    };
    let (columns, rows) = (range(guess.pixel.x, image.width())?, range(guess.pixel.y, image.height())?);
    let all = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
    let with_level = all.map(|(x, y)| (Point2::new(x as f64 + 0.5, y as f64 + 0.5), f64::from(image.at(x, y))));
    let near: Vec<_> = with_level.filter(|(p, _)| (p - guess.pixel).norm() <= guess.reach).collect();
    (near.len() > 7).then_some(near)
}

/// Normal matrix (7 × 7), gradient (7) and sum of squares of the residuals.
fn equations(pixels: &[(Point2<f64>, f64)], p: &Parameters) -> (SMatrix<f64, 7, 7>, Parameters, f64) {
    let [a, b, x, y, first, second, sharp] = [p[0], p[1], p[2], p[3], p[4], p[5], p[6]];
    let lines =
        [first, second].map(|angle| (Vector2::new(angle.cos(), angle.sin()), Vector2::new(-angle.sin(), angle.cos())));
    let (mut normal, mut gradient, mut cost) = (SMatrix::zeros(), Parameters::zeros(), 0.0);
    for (at, level) in pixels {
        let offset = at - Point2::new(x, y);
        // Distance from each line and along it.
        let [(d1, l1), (d2, l2)] = lines.map(|(along, across)| (across.dot(&offset), along.dot(&offset)));
        let [first, second] = [d1, d2].map(|d| edge(d, sharp));
        let [s1, s2] = [first.level, second.level];
        let (g1, g2) = (b * first.slope * s2, b * second.slope * s1);
        let shift = -(lines[0].1 * g1 + lines[1].1 * g2);
        let soften = b * (first.by_sharpness * s2 + second.by_sharpness * s1);
        let row = Parameters::from([1.0, s1 * s2, shift.x, shift.y, -g1 * l1, -g2 * l2, soften]);
        let residual = level - (a + b * s1 * s2);
        normal += row * row.transpose();
        gradient += row * residual;
        cost += residual * residual;
    }
    (normal, gradient, cost)
}

/// A blurred step from −1 to 1 and its derivatives.
pub(crate) struct Edge {
    pub(crate) level: f64,
    pub(crate) slope: f64,
    pub(crate) by_sharpness: f64,
}

/// The mean of `tanh(κ d)` over a pixel, `(ln cosh κ(d + ½) − ln cosh κ(d − ½)) / κ`, at the distance `d` of its centre
/// from the line. It becomes the ramp of exact coverage as `κ` grows.
pub(crate) fn edge(d: f64, sharp: f64) -> Edge {
    let log_cosh = |x: f64| x.abs() + (-2.0 * x.abs()).exp().ln_1p();
    let (near, far) = (d - 0.5, d + 0.5);
    let (from, to) = ((sharp * near).tanh(), (sharp * far).tanh());
    let level = (log_cosh(sharp * far) - log_cosh(sharp * near)) / sharp;
    Edge { level, slope: to - from, by_sharpness: (far * to - near * from - level) / sharp }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four squares that meet at `at`, 16 × 16 rays a pixel.
    fn squares(at: Point2<f64>, edges: [Vector2<f64>; 2]) -> Image<u8> {
        let mut image = Image::filled(40, 40, 0);
        for y in 0..40 {
            for x in 0..40 {
                let is_dark = |i: u32| {
                    let ray = Vector2::new(f64::from(i % 16) + 0.5, f64::from(i / 16) + 0.5) / 16.0;
                    let offset = Point2::new(x as f64, y as f64) + ray - at;
                    let sides = edges.map(|edge| edge.perp(&offset) > 0.0);
                    sides[0] != sides[1]
                };
                let dark = (0..256).filter(|&i| is_dark(i)).count();
                image.set(x, y, (210.0 - 170.0 * dark as f64 / 256.0).round() as u8);
            }
        }
        image
    }

    #[test]
    fn corners_are_found_wherever_they_lie_in_a_pixel() {
        for (first, second) in [(0.0, 1.571), (0.3, 2.1), (-0.8, 0.4), (2.0, 3.3)] {
            let edges = [first, second].map(|angle: f64| Vector2::new(angle.cos(), angle.sin()));
            let mut sum = Vector2::zeros();
            for i in 0..25 {
                // Where the rays tell the truth for edges along the grid too.
                let at = Point2::new(20.0 + f64::from(3 * (i % 5)) / 16.0, 20.0 + f64::from(3 * (i / 5)) / 16.0);
                let image = squares(at, edges);
                let guess = SaddleGuess { pixel: Point2::new(20.9, 20.1), edges, is_dark: true, reach: 6.0 };
                let found = saddle(&image, &guess).unwrap();
                // No lens is as sharp as these squares.
                assert!((found.pixel - at).norm() < 0.05, "{first} {second}: {} for {at}", found.pixel);
                assert!((found.contrast - 170.0).abs() < 10.0 && found.residual < 0.05, "{found:?}");
                assert_eq!(saddle(&image, &SaddleGuess { is_dark: false, ..guess }), None);
                sum += (found.pixel - at) / 25.0;
            }
            assert!(sum.norm() < 0.002, "{first} {second}: {sum}");
        }
    }

    #[test]
    fn where_no_corner_is_none_is_made_up() {
        let edges = [Vector2::x(), Vector2::y()];
        let guess = SaddleGuess { pixel: Point2::new(20.0, 20.0), edges, is_dark: true, reach: 6.0 };
        let flat = saddle(&Image::filled(40, 40, 90), &guess);
        assert!(flat.is_none_or(|found| found.contrast < 1.0), "{flat:?}");
        let mut edge = Image::filled(40, 40, 30);
        (0..40).for_each(|y| (20..40).for_each(|x| edge.set(x, y, 200)));
        let found = saddle(&edge, &guess);
        assert!(found.is_none_or(|found| found.residual > 0.15 || found.contrast < 20.0), "{found:?}");
        for pixel in [[2.0, 20.0], [20.0, 39.0], [f64::NAN, 20.0]] {
            assert_eq!(saddle(&edge, &SaddleGuess { pixel: pixel.into(), ..guess }), None);
        }
    }
}
