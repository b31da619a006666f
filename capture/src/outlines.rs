//! How far the outlines of masks lie from the edges in the pictures.

use crate::{Image, View, signed_distance};
use rayon::prelude::*;

/// Pixels on both sides of an outline that are looked at.
const REACH: i32 = 12;

/// What crosses the outline must be this many times as steep where it is steepest as it mostly is: else there is no
/// edge that all the outline follows.
const CLEAR: f64 = 1.5;

/// Sums over pixels at one distance from the outline.
#[derive(Clone, Copy, Debug, Default)]
struct Ring {
    steepness: f64,
    pixels: f64,
}

/// Pixels by which the outlines of the silhouettes lie outside of the edges in their pictures; negative: inside. To
/// whole pixels, up to 11. `None` where pictures have no edge along the outlines.
///
/// Texture has its edges anywhere, the object's border in all places at one distance from the outline: so what is
/// averaged over all outlines is how steeply the picture changes across them, by distance.
pub(crate) fn outline_offset(views: &[View]) -> Option<i32> {
    let add = |mut a: Vec<Ring>, b: Vec<Ring>| {
        for (a, b) in a.iter_mut().zip(b) {
            a.steepness += b.steepness;
            a.pixels += b.pixels;
        }
        a
    };
    let none = || vec![Ring::default(); 2 * REACH as usize];
    // Sums of whole numbers: the order does not matter.
    let rings = views.par_iter().map(|view| rings(&view.image, &view.matte)).reduce(none, add);
    let mean = |ring: &Ring| ring.steepness / ring.pixels.max(1.0);
    // An edge is as steep on both its sides.
    let steepness: Vec<f64> = rings.windows(2).map(|sides| 0.5 * (mean(&sides[0]) + mean(&sides[1]))).collect();
    let steepest = (0..steepness.len()).max_by(|&a, &b| steepness[a].total_cmp(&steepness[b]))?;
    let mut usual = steepness.clone();
    usual.sort_by(f64::total_cmp);
    let is_clear = steepness[steepest] > (CLEAR * usual[usual.len() / 2]).max(1.0);
    is_clear.then_some(steepest as i32 + 1 - REACH)
}

/// By whole pixels of depth under the outline, from [`REACH`] outside to as much inside.
fn rings(image: &Image<[u8; 3]>, matte: &Image<u8>) -> Vec<Ring> {
    let distance = signed_distance(matte);
    let mut rings = vec![Ring::default(); 2 * REACH as usize];
    for y in 1..matte.height().saturating_sub(1) {
        for x in 1..matte.width().saturating_sub(1) {
            let depth = distance.at(x, y).floor() as i32;
            if !(-REACH..REACH).contains(&depth) {
                continue;
            }
            let across = [distance.at(x + 1, y) - distance.at(x - 1, y), distance.at(x, y + 1) - distance.at(x, y - 1)];
            // Across the outline, to the nearest of eight directions.
            let [dx, dy] = across.map(|d| if d.abs() > 0.8 { d.signum() as isize } else { 0 });
            let beside = |side: isize| image.at_clamped(x as isize + side * dx, y as isize + side * dy);
            let difference: i32 = (0..3).map(|c| (i32::from(beside(1)[c]) - i32::from(beside(-1)[c])).abs()).sum();
            let ring = &mut rings[(depth + REACH) as usize];
            ring.steepness += f64::from(difference);
            ring.pixels += 1.0;
        }
    }
    rings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, Intrinsics, erode, grow};

    /// A spotted ball before a striped wall, its mask made larger by so many pixels.
    fn view(larger: f64) -> View {
        let (width, height) = (160, 120);
        let is_ball = |x: usize, y: usize| (x as f64 - 79.5).hypot(y as f64 - 59.5) < 35.0;
        let colour = |i: usize| match (is_ball(i % width, i / width), (i % width / 5 + i / width / 5) % 2) {
            (true, 0) => [190, 60, 40],
            (true, _) => [150, 50, 40],
            (false, 0) => [60, 90, 150],
            (false, _) => [50, 80, 120],
        };
        let image = Image::from_pixels(width, height, (0..width * height).map(colour).collect()).unwrap();
        let exact = image.map(|[red, ..]| if red > 100 { 255 } else { 0 });
        let matte = if larger < 0.0 { erode(&exact, -larger) } else { grow(&exact, larger) };
        let camera = Camera {
            intrinsics: Intrinsics::pinhole(150.0, [width, height]),
            rotation: nalgebra::Matrix3::identity(),
            translation: nalgebra::Vector3::zeros(),
        };
        View { index: 0, name: String::new(), image, matte, is_complete: true, camera }
    }

    #[test]
    fn masks_too_large_or_too_small_are_told_to_a_pixel() {
        for larger in [-6.0, -2.0, 0.0, 3.0, 8.0] {
            let found = outline_offset(&[view(larger)]).expect("an edge");
            assert!((f64::from(found) - larger).abs() <= 1.0, "{larger} {found}");
        }
    }

    #[test]
    fn nothing_is_told_of_pictures_without_an_edge_there() {
        let mut plain = view(3.0);
        plain.image = plain.image.map(|_| [90, 90, 90]);
        assert_eq!(outline_offset(&[plain]), None);
        // Stripes alone are as steep everywhere.
        let mut striped = view(0.0);
        striped.image =
            Image::from_pixels(160, 120, (0..160 * 120).map(|i| [(i % 160 / 3 % 2 * 90) as u8; 3]).collect()).unwrap();
        assert_eq!(outline_offset(&[striped]), None);
        assert_eq!(outline_offset(&[]), None);
    }
}
