//! A first guess of where square markers lie in their plane, from pictures of some of them at a time.

use super::homography::{Pair, apply, fit_robust, median};
use super::rig::{Corner, Picture, flat_place, square_corner, unit_corner};
use nalgebra::{Isometry3, Matrix3, Point2, Vector2, Vector3};

/// A marker in a picture, all four corners of it.
type Square = (usize, [Point2<f64>; 4]);
/// From the markers' plane to a picture, and how many known markers it is from.
type Map = Option<(Matrix3<f64>, usize)>;

/// Rounds in which known markers improve one another.
const ROUNDS: usize = 3;

/// Places of `count` markers by way of the pictures that show two of them, beginning with the one seen most, which is
/// told too and lies at the origin. `None` for those no chain leads to.
pub(super) fn learn(pictures: &[Picture], count: usize, side: f64) -> (Vec<Option<Isometry3<f64>>>, usize) {
    let squares: Vec<Vec<Square>> = pictures.iter().map(whole_markers).collect();
    let times = |marker: usize| squares.iter().flatten().filter(|(m, _)| *m == marker).count();
    let first = (0..count).max_by_key(|&m| (times(m), count - m)).unwrap_or(0);
    let mut places = vec![None; count];
    if count == 0 {
        return (places, first);
    }
    places[first] = Some(Isometry3::identity());
    loop {
        let maps = maps(&squares, &places, side);
        // How often a marker is seen beside known ones.
        let company = |m: usize| -> usize {
            let with = |(list, map): (&Vec<Square>, &Map)| {
                let known = map.as_ref().map_or(0, |(_, known)| *known);
                if list.iter().any(|(other, _)| *other == m) { known } else { 0 }
            };
            squares.iter().zip(&maps).map(with).sum()
        };
        let open: Vec<(usize, usize)> = (0..count).filter(|&m| places[m].is_none()).map(|m| (m, company(m))).collect();
        let most = open.iter().map(|(_, times)| *times).max().unwrap_or(0);
        if most == 0 {
            return (places, first);
        }
        for &(marker, _) in open.iter().filter(|(_, times)| 2 * times >= most) {
            places[marker] = placed(&squares, &maps, marker, side);
        }
        for _ in 0..ROUNDS {
            let maps = self::maps(&squares, &places, side);
            let known: Vec<usize> = (0..count).filter(|&m| m != first && places[m].is_some()).collect();
            known.into_iter().for_each(|m| places[m] = placed(&squares, &maps, m, side).or(places[m]));
        }
        if open.iter().all(|(m, times)| 2 * times < most || places[*m].is_none()) {
            return (places, first);
        }
    }
}

/// Markers of which all four corners are seen.
fn whole_markers(picture: &Picture) -> Vec<Square> {
    let chunks = picture.corners.chunk_by(|a, b| a.point / 4 == b.point / 4);
    let whole = |chunk: &[Corner]| {
        let corners: Vec<Point2<f64>> = chunk.iter().map(|c| c.pixel).collect();
        Some((chunk.first()?.point / 4, corners.try_into().ok()?))
    };
    chunks.filter_map(whole).collect()
}

/// For each picture the map from the markers' plane to it, and how many known markers it is from.
fn maps(squares: &[Vec<Square>], places: &[Option<Isometry3<f64>>], side: f64) -> Vec<Map> {
    let map = |(k, list): (usize, &Vec<Square>)| {
        let mut pairs: Vec<Pair> = Vec::new();
        for (marker, seen) in list {
            let Some(place) = places[*marker] else { continue };
            pairs.extend((0..4).map(|c| (square_corner(&place, side, c).xy(), seen[c])));
        }
        fit_robust(&pairs, k as u64).map(|(map, _)| (map, pairs.len() / 4))
    };
    squares.iter().enumerate().map(map).collect()
}

/// Where a marker lies by the pictures that show it with many known ones: medians.
fn placed(squares: &[Vec<Square>], maps: &[Map], marker: usize, side: f64) -> Option<Isometry3<f64>> {
    let mut votes = Vec::new();
    for (list, map) in squares.iter().zip(maps) {
        let Some((map, known)) = map else { continue };
        let Some(back) = map.try_inverse() else { continue };
        // The inverse keeps the sign of the third coordinate on the visible side only up to its own.
        let back = if (back * list.first().map_or(Point2::origin(), |l| l.1[0]).to_homogeneous()).z < 0.0 {
            -back
        } else {
            back
        };
        for (_, seen) in list.iter().filter(|(m, _)| *m == marker) {
            let corners = seen.map(|pixel| apply(&back, &pixel));
            votes.extend(square_at(corners, side).map(|place| (place, *known)));
        }
    }
    let most = votes.iter().map(|(_, known)| *known).max()?;
    votes.retain(|(_, known)| 2 * known >= most);
    let of = |value: fn(&Isometry3<f64>) -> f64| median(&votes.iter().map(|(p, _)| value(p)).collect::<Vec<_>>());
    // The side's direction rather than its angle, which jumps at half a turn.
    let [c, s] = [of(|p| (p.rotation * Vector3::x()).x), of(|p| (p.rotation * Vector3::x()).y)];
    Some(flat_place(of(|p| p.translation.x), of(|p| p.translation.y), s.atan2(c)))
}

/// The square nearest to four points, if they are about its size.
fn square_at(corners: [Option<Point2<f64>>; 4], side: f64) -> Option<Isometry3<f64>> {
    let [a, b, c, d] = corners;
    let corners = [a?, b?, c?, d?];
    let middle = corners.iter().map(|p| p.coords).sum::<Vector2<f64>>() / 4.0;
    let (mut dot, mut cross) = (0.0, 0.0);
    for (k, p) in corners.iter().enumerate() {
        let (unit, arm) = (unit_corner(k).xy(), p.coords - middle);
        dot += unit.dot(&arm);
        cross += unit.perp(&arm);
    }
    let found = 0.5 * dot.hypot(cross);
    (found > 0.3 * side && found < 3.0 * side).then(|| flat_place(middle.x, middle.y, cross.atan2(dot)))
}
