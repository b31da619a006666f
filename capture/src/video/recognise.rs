//! Finds out what kind of board is in the pictures, by trying.

use super::detect::{
    apply, chessboard_counts, grey, guess_dictionary, homography, level, markers_in, often_seen, smallest_with,
};
use super::{BoardView, FoundMarker, detect_board, detect_markers};
use crate::board::{Board, Dictionary};
use crate::{CaptureError, Image, srgb};
use nalgebra::{Matrix3, Point2, Vector2};
use opencv::aruco::CornerRefineMethod;
use opencv::calib3d;
use rayon::prelude::*;

/// What there is to find in every frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pattern {
    /// A board of known layout. Where its size was not given, lengths are in squares (of a grid: in markers).
    Board(Board),
    /// Markers of this dictionary, each at an unknown place.
    Markers(Dictionary),
}

/// Fewest markers in a picture that tell how they are laid out.
const FEWEST: usize = 5;
/// A layout fits if the middles of markers lie this near to where it puts them, in sides of a marker.
const FIT: f64 = 0.12;
/// Sides of markers on ChArUco boards, in fortieths of a square: smaller ones are wasted paper, larger ones are not found.
const FORTIETHS: std::ops::RangeInclusive<i32> = 20..=38;
/// Places of a square that are looked at.
const PLACES: usize = 256;
/// All pairs count, as a method of [`homography`].
const LEAST_SQUARES: i32 = 0;
/// (√5 − 1) / 2: its multiples are as far from whole numbers as can be.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Finds out what is printed in the pictures: a ChArUco board, a grid of markers, markers in no order, a chessboard;
/// `None` where there is nothing of the kind. A few pictures are enough. Lengths of boards are in squares or markers.
///
/// # Errors
/// [`CaptureError::OpenCv`] where OpenCV fails.
pub fn recognise_pattern(images: &[Image<[u8; 3]>]) -> Result<Option<Pattern>, CaptureError> {
    let dictionary = guess_dictionary(images)?;
    let images: Vec<Image<u8>> = images.iter().map(grey).collect();
    let Some(dictionary) = dictionary else { return Ok(chessboard(&images)?.map(Pattern::Board)) };
    let seen = images.iter().map(|image| {
        let mut markers = markers_in(image, dictionary, CornerRefineMethod::CORNER_REFINE_SUBPIX)?;
        let ids: Vec<usize> = markers.iter().map(|m| m.id).collect();
        markers.retain(|m| ids.iter().filter(|&&id| id == m.id).count() == 1);
        Ok(markers)
    });
    let mut seen = seen.collect::<Result<Vec<Vec<FoundMarker>>, CaptureError>>()?;
    let known = often_seen(&seen.iter().flatten().map(|m| m.id).collect::<Vec<_>>());
    seen.iter_mut().for_each(|markers| markers.retain(|m| known.contains(&m.id)));
    let Some(&highest) = known.last().filter(|_| seen.iter().any(|markers| markers.len() >= FEWEST)) else {
        // A square of a chessboard, or something in the room, may be misread as a marker.
        return Ok(Some(chessboard(&images)?.map_or(Pattern::Markers(dictionary), Pattern::Board)));
    };
    let board = candidates(dictionary, highest).par_bridge().filter_map(|board| Some((misfit(&board, &seen)?, board)));
    // Ties go to the board of fewer columns, whatever thread found it.
    let best = board.min_by(|(a, x), (b, y)| a.total_cmp(b).then(x.counts().cmp(&y.counts())));
    let found = best.filter(|(misfit, _)| *misfit < FIT).and_then(|(_, board)| {
        let board = without_strays(&board, &mut seen)?;
        measured(&board, &images, &seen)
    });
    Ok(Some(found.map_or(Pattern::Markers(dictionary), Pattern::Board)))
}

/// What an image shows of a pattern; of markers in no order, corner `4 id + k` is corner `k` of marker `id`.
///
/// # Errors
/// [`CaptureError::OpenCv`] where OpenCV fails.
pub fn detect_pattern(image: &Image<[u8; 3]>, pattern: &Pattern) -> Result<BoardView, CaptureError> {
    match pattern {
        Pattern::Board(board) => detect_board(image, board),
        Pattern::Markers(dictionary) => {
            let markers = detect_markers(image, *dictionary)?;
            let corners = markers.iter().flat_map(|m| [0, 1, 2, 3].map(|k| (4 * m.id + k, m.corners[k]))).collect();
            Ok(BoardView { corners, markers })
        }
    }
}

/// Boards with squares or pitches of 1 that have a marker of the highest id in their last row.
fn candidates(dictionary: Dictionary, highest: usize) -> impl Iterator<Item = Board> + Send {
    let fewest_rows = move |board: fn(usize, usize, Dictionary) -> Board, columns: usize| {
        let rows = (1..=60).find(|&rows| board(columns, rows, dictionary).markers().len() > highest);
        rows.map(|rows| board(columns, rows, dictionary))
    };
    let dark_first: fn(usize, usize, Dictionary) -> Board = |columns, rows, dictionary| Board::Charuco {
        columns,
        rows,
        square: 1.0,
        marker: 0.75,
        dictionary,
        light_first: false,
    };
    let light_first: fn(usize, usize, Dictionary) -> Board = |columns, rows, dictionary| Board::Charuco {
        columns,
        rows,
        square: 1.0,
        marker: 0.75,
        dictionary,
        light_first: true,
    };
    let grid: fn(usize, usize, Dictionary) -> Board =
        |columns, rows, dictionary| Board::ArucoGrid { columns, rows, marker: 0.75, gap: 0.25, dictionary };
    let boards = [dark_first, light_first, grid].into_iter();
    boards.flat_map(move |board| (2..=40).filter_map(move |columns| fewest_rows(board, columns)))
}

/// How far the middles of markers lie from where the board would have them, in sides of a marker: the median over the
/// pictures. Middles do not depend on how large the markers are in their squares. `None` where no picture tells.
fn misfit(board: &Board, seen: &[Vec<FoundMarker>]) -> Option<f64> {
    let in_picture = |markers: &Vec<FoundMarker>| {
        let (map, pairs) = middles_map(board, markers, LEAST_SQUARES, 0.0)?;
        let sides: f64 =
            markers.iter().map(|m| (m.corners[0] - m.corners[1]).norm()).sum::<f64>() / markers.len() as f64;
        let square: f64 = pairs
            .iter()
            .map(|(from, to)| apply(&map, from).map_or(f64::INFINITY, |mapped| (mapped - to).norm_squared()))
            .sum();
        Some((square / pairs.len() as f64).sqrt() / sides)
    };
    let mut misfits: Vec<f64> = seen.iter().filter_map(in_picture).collect();
    misfits.sort_by(f64::total_cmp);
    misfits.get(misfits.len() / 2).copied()
}

/// Leaves out markers that are not where the board has them: glitter is misread as one now and then, and of a high id
/// it would make the board a long one. The board then ends with the row of the highest id left, its dictionary is the
/// smallest that has it.
fn without_strays(board: &Board, seen: &mut [Vec<FoundMarker>]) -> Option<Board> {
    let known = board.markers();
    for markers in seen.iter_mut() {
        let mut sides: Vec<f64> = markers.iter().map(|m| (m.corners[0] - m.corners[1]).norm()).collect();
        sides.sort_by(f64::total_cmp);
        let side = sides.get(sides.len() / 2).copied().unwrap_or_default();
        // A picture that does not tell where the board lies tells no markers of it.
        let Some((map, _)) = middles_map(board, markers, calib3d::RANSAC, FIT * side) else {
            markers.clear();
            continue;
        };
        let off = |m: &FoundMarker| {
            let corners = known.get(m.id)?.corners;
            let expected = apply(&map, &nalgebra::center(&corners[0], &corners[2]).xy())?;
            Some((middle_of(&m.corners)? - expected).norm() / (m.corners[0] - m.corners[1]).norm())
        };
        // Beyond a marker's side no lens bends it.
        markers.retain(|m| off(m).is_some_and(|off| off < 1.0));
    }
    let highest = seen.iter().flatten().map(|m| m.id).max()?;
    let dictionary = smallest_with(board.dictionary()?, highest);
    let is_alike = |other: &Board| match (board, other) {
        (Board::Charuco { light_first: a, .. }, Board::Charuco { light_first: b, .. }) => a == b,
        (Board::ArucoGrid { .. }, Board::ArucoGrid { .. }) => true,
        _ => false,
    };
    candidates(dictionary, highest).find(|other| is_alike(other) && other.counts()[0] == board.counts()[0])
}

type Pairs = Vec<(Point2<f64>, Point2<f64>)>;

/// The homography from the board to a picture by the middles of markers alone, and the pairs; `method` and `tolerance`
/// as of [`homography`].
fn middles_map(board: &Board, markers: &[FoundMarker], method: i32, tolerance: f64) -> Option<(Matrix3<f64>, Pairs)> {
    let known = board.markers();
    let middle = |m: &FoundMarker| {
        let place = known.get(m.id)?;
        Some((nalgebra::center(&place.corners[0], &place.corners[2]).xy(), middle_of(&m.corners)?))
    };
    let pairs: Pairs = markers.iter().filter_map(middle).collect();
    let spans = |axis: usize| {
        let (low, high) = pairs.iter().fold((f64::MAX, f64::MIN), |(l, h), (p, _)| (l.min(p[axis]), h.max(p[axis])));
        high - low > 0.5
    };
    if pairs.len() < FEWEST || !spans(0) || !spans(1) {
        return None;
    }
    let map = homography(&pairs, method, tolerance).ok().flatten()?;
    Some((map, pairs))
}

/// Where the diagonals meet: the picture of the middle, however the marker is tilted.
fn middle_of(corners: &[Point2<f64>; 4]) -> Option<Point2<f64>> {
    let diagonal = |a: usize, b: usize| corners[a].to_homogeneous().cross(&corners[b].to_homogeneous());
    Point2::from_homogeneous(diagonal(0, 2).cross(&diagonal(1, 3)))
}

/// The board with its markers as large as they are seen; `None` where they are turned another way or are of no size
/// that could be.
fn measured(board: &Board, images: &[Image<u8>], seen: &[Vec<FoundMarker>]) -> Option<Board> {
    let mut sides = Vec::new();
    let mut upright = 0_usize;
    for markers in seen {
        let Some(back) = middles_map(board, markers, LEAST_SQUARES, 0.0).and_then(|(map, _)| map.try_inverse()) else {
            continue;
        };
        for marker in markers {
            let Some([a, b, _, d]) = all(marker.corners.map(|corner| apply(&back, &corner))) else { continue };
            sides.push(0.5 * ((b - a).norm() + (d - a).norm()));
            // On the board x runs right and y up: from top left to top right, and up from bottom left.
            upright += usize::from((b - a).x > 0.0 && (a - d).y > 0.0);
        }
    }
    sides.sort_by(f64::total_cmp);
    let side = *sides.get(sides.len() / 2)?;
    let measured = match *board {
        Board::Charuco { .. } => likest(board, images, seen)?,
        Board::ArucoGrid { columns, rows, dictionary, .. } => {
            Board::ArucoGrid { columns, rows, marker: 1.0, gap: 1.0 / side - 1.0, dictionary }
        }
        Board::Chessboard { .. } => return None,
    };
    (2 * upright > sides.len() && measured.check().is_ok()).then_some(measured)
}

/// The board of squares of 1 whose markers are as large as is most like what is seen: all that is printed in a marker
/// says so, while corners of small ones are drawn towards the squares beside them.
fn likest(board: &Board, images: &[Image<u8>], seen: &[Vec<FoundMarker>]) -> Option<Board> {
    let Board::Charuco { columns, rows, dictionary, light_first, .. } = *board else { return None };
    let boards: Vec<Board> = FORTIETHS
        .map(|share| f64::from(share) / 40.0)
        .map(|marker| Board::Charuco { columns, rows, square: 1.0, marker, dictionary, light_first })
        .collect();
    let looked: Vec<Looked> =
        images.iter().zip(seen).flat_map(|(image, markers)| around(board, image, markers)).collect();
    let likeness: Vec<f64> =
        boards.par_iter().map(|board| looked.iter().map(|places| correlation(board, places)).sum()).collect();
    let best = (0..boards.len()).max_by(|&a, &b| likeness[a].total_cmp(&likeness[b]))?;
    Some(boards[best])
}

/// Places of a board and the light seen there, white = 1.
type Looked = Vec<(Point2<f64>, f64)>;

/// The square of every marker that is seen: what is in it but for the size of the marker.
fn around(board: &Board, image: &Image<u8>, markers: &[FoundMarker]) -> Vec<Looked> {
    let Some((map, _)) = middles_map(board, markers, LEAST_SQUARES, 0.0) else { return Vec::new() };
    let known = board.markers();
    let of_marker = |marker: &FoundMarker| {
        let corners = known.get(marker.id)?.corners;
        let middle = nalgebra::center(&corners[0], &corners[2]).xy();
        // Next to it the lens bends nothing.
        let shift = middle_of(&marker.corners)? - apply(&map, &middle)?;
        // A column and a row for every place: none lies along with what is printed.
        let offset = |k: f64| Vector2::new(k / PLACES as f64, (k * GOLDEN).fract()).add_scalar(-0.5);
        let places = (0..PLACES).map(|k| middle + offset(k as f64 + 0.5));
        let look =
            |place: Point2<f64>| Some((place, srgb::linear(level(image, apply(&map, &place)? + shift)? / 255.0)));
        Some(places.filter_map(look).collect())
    };
    markers.iter().filter_map(of_marker).collect()
}

/// Pearson's, of what is printed and of what is seen; 0 where one of the two is the same everywhere.
fn correlation(board: &Board, places: &Looked) -> f64 {
    let pairs: Vec<[f64; 2]> =
        places.iter().map(|&(place, light)| [f64::from(u8::from(!board.is_dark(place))), light]).collect();
    let share = 1.0 / pairs.len().max(1) as f64;
    let mean = |axis: usize| pairs.iter().map(|p| p[axis]).sum::<f64>() * share;
    let means = [mean(0), mean(1)];
    let product = |a: usize, b: usize| pairs.iter().map(|p| (p[a] - means[a]) * (p[b] - means[b])).sum::<f64>();
    let variances = product(0, 0) * product(1, 1);
    if variances > 0.0 { product(0, 1) / variances.sqrt() } else { 0.0 }
}

fn all<T: Copy>(found: [Option<T>; 4]) -> Option<[T; 4]> {
    Some([found[0]?, found[1]?, found[2]?, found[3]?])
}

/// The chessboard most pictures show whole.
fn chessboard(images: &[Image<u8>]) -> Result<Option<Board>, CaptureError> {
    let counts: Vec<Option<[usize; 2]>> =
        images.iter().map(|image| Ok(chessboard_counts(image)?)).collect::<Result<_, CaptureError>>()?;
    let mut counts: Vec<[usize; 2]> = counts.into_iter().flatten().map(|[a, b]| [a.max(b), a.min(b)]).collect();
    counts.sort_unstable();
    let most = counts.chunk_by(|a, b| a == b).max_by_key(|same| same.len());
    Ok(most.map(|same| Board::Chessboard { columns: same[0][0] + 1, rows: same[0][1] + 1, square: 1.0 }))
}

#[cfg(test)]
mod tests;
