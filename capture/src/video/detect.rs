//! Finds markers and boards in images, to a fraction of a pixel.

use crate::board::{Board, Dictionary};
use crate::saddle::{SaddleGuess, saddle};
use crate::{CaptureError, Image};
use nalgebra::{Matrix3, Point2, Point3};
use opencv::boxed_ref::BoxedRef;
use opencv::core::{Mat, Point2f, Ptr, Size, Vector, no_array};
use opencv::prelude::{DetectorParametersTrait, MatTraitConst};
use opencv::{aruco, calib3d};

/// A marker in an image.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundMarker {
    /// Its number in the dictionary.
    pub id: usize,
    /// Outer corners of its border, in pixels: top left, top right, bottom right, bottom left of the marker, however
    /// it is turned.
    pub corners: [Point2<f64>; 4],
}

/// What an image shows of a board.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoardView {
    /// Positions in [`Board::corners`] and in the image, in pixels, by the first.
    pub corners: Vec<(usize, Point2<f64>)>,
    /// The board's markers that were read, by id.
    pub markers: Vec<FoundMarker>,
}

/// OpenCV's centres of pixels are whole numbers.
const CENTRE: f64 = 0.5;
/// OpenCV fails on images of smaller sides, which show no board.
const SMALLEST: usize = 16;
/// Reach of the corner refinement in pixels: less sees only noise, more sees the lens bend the lines.
const REACH: std::ops::RangeInclusive<f64> = 2.5..=12.0;
/// Difference of light and dark below which there is no corner, in levels.
const CONTRAST: f64 = 20.0;
/// What a corner may leave unexplained, in parts of its contrast; something before it leaves more.
const RESIDUAL: f64 = 0.15;

/// Reads the markers of a dictionary in an image, by id; a marker seen twice comes twice.
///
/// # Errors
/// [`CaptureError::OpenCv`] where OpenCV fails.
pub fn detect_markers(image: &Image<[u8; 3]>, dictionary: Dictionary) -> Result<Vec<FoundMarker>, CaptureError> {
    Ok(markers_in(&grey(image), dictionary, aruco::CornerRefineMethod::CORNER_REFINE_SUBPIX)?)
}

/// The smallest dictionary that has the markers seen in the images, of the family of which most are seen; `None`
/// where none is seen. A marker seen in few of the images only is a speck misread.
///
/// # Errors
/// [`CaptureError::OpenCv`] where OpenCV fails.
pub fn guess_dictionary(images: &[Image<[u8; 3]>]) -> Result<Option<Dictionary>, CaptureError> {
    let greys: Vec<Image<u8>> = images.iter().map(grey).collect();
    let mut best = (0, None);
    for family in families() {
        let Some(&largest) = family.last() else { continue };
        let mut ids = Vec::new();
        for grey in &greys {
            let found = markers_in(grey, largest, aruco::CornerRefineMethod::CORNER_REFINE_NONE)?;
            ids.extend(found.iter().map(|marker| marker.id));
        }
        let highest = often_seen(&ids).into_iter().max();
        let enough = highest.map(|id| smallest_with(largest, id));
        if ids.len() > best.0 {
            best = (ids.len(), enough);
        }
    }
    Ok(best.1)
}

/// Dictionaries that share their markers, the smallest first.
fn families() -> impl Iterator<Item = &'static [Dictionary]> {
    Dictionary::all().chunk_by(|a, b| a.modules() == b.modules() && a.len() < b.len())
}

/// The smallest dictionary of the same family that has a marker; the same where none has.
pub(super) fn smallest_with(dictionary: Dictionary, id: usize) -> Dictionary {
    let family = families().find(|family| family.contains(&dictionary)).unwrap_or_default();
    family.iter().find(|d| id < d.len()).copied().unwrap_or(dictionary)
}

/// The ids that occur at least a fifth as often as the most frequent one.
pub(super) fn often_seen(ids: &[usize]) -> Vec<usize> {
    let mut sorted = ids.to_vec();
    sorted.sort_unstable();
    let runs: Vec<&[usize]> = sorted.chunk_by(|a, b| a == b).collect();
    let most = runs.iter().map(|run| run.len()).max().unwrap_or(0);
    runs.iter().filter(|run| 5 * run.len() >= most).map(|run| run[0]).collect()
}

/// Finds the corners of a board. Of ChArUco boards and grids of markers a part is enough; a chessboard must be seen
/// whole, and if both or neither of its counts are odd it looks the same upside down: the view is then one of two.
/// Nothing found is an empty view.
///
/// # Errors
/// [`CaptureError::OpenCv`] where OpenCV fails.
pub fn detect_board(image: &Image<[u8; 3]>, board: &Board) -> Result<BoardView, CaptureError> {
    let grey = grey(image);
    if grey.width() < SMALLEST || grey.height() < SMALLEST {
        return Ok(BoardView::default());
    }
    Ok(match board {
        Board::Chessboard { .. } => chessboard(&grey, board)?,
        Board::Charuco { dictionary, .. } => {
            let markers = board_markers(&grey, board, *dictionary, aruco::CornerRefineMethod::CORNER_REFINE_NONE)?;
            charuco(&grey, board, markers)?
        }
        Board::ArucoGrid { dictionary, .. } => {
            let markers = board_markers(&grey, board, *dictionary, aruco::CornerRefineMethod::CORNER_REFINE_SUBPIX)?;
            let corners = |m: &FoundMarker| [0, 1, 2, 3].map(|k| (4 * m.id + k, m.corners[k]));
            BoardView { corners: markers.iter().flat_map(corners).collect(), markers }
        }
    })
}

/// Rec. 601 luma, as photographs are encoded.
pub(super) fn grey(image: &Image<[u8; 3]>) -> Image<u8> {
    image.map(|[r, g, b]| ((299 * u32::from(r) + 587 * u32::from(g) + 114 * u32::from(b) + 500) / 1000) as u8)
}

fn matrix(grey: &Image<u8>) -> opencv::Result<BoxedRef<'_, Mat>> {
    Mat::new_rows_cols_with_data(grey.height() as i32, grey.width() as i32, grey.pixels())
}

fn from_opencv(p: Point2f) -> Point2<f64> {
    Point2::new(f64::from(p.x) + CENTRE, f64::from(p.y) + CENTRE)
}

/// OpenCV's own copy of a dictionary.
fn opencv_dictionary(dictionary: Dictionary) -> opencv::Result<Ptr<aruco::Dictionary>> {
    if dictionary.name() == "apriltag_36h11" {
        return aruco::get_predefined_dictionary(aruco::PREDEFINED_DICTIONARY_NAME::DICT_APRILTAG_36h11);
    }
    let position = Dictionary::all().iter().position(|known| *known == dictionary).unwrap_or_default();
    aruco::get_predefined_dictionary_i32(position as i32)
}

pub(super) fn markers_in(
    grey: &Image<u8>,
    dictionary: Dictionary,
    refinement: aruco::CornerRefineMethod,
) -> opencv::Result<Vec<FoundMarker>> {
    if grey.width() < SMALLEST || grey.height() < SMALLEST {
        return Ok(Vec::new());
    }
    let mut parameters = aruco::DetectorParameters::create()?;
    parameters.set_corner_refinement_method(refinement as i32);
    let mut corners = Vector::<Vector<Point2f>>::new();
    let mut ids = Vector::<i32>::new();
    let theirs = opencv_dictionary(dictionary)?;
    aruco::detect_markers(&matrix(grey)?, &theirs, &mut corners, &mut ids, &parameters, &mut no_array())?;
    let marker = |(id, corners): (i32, Vector<Point2f>)| {
        let corners: Vec<Point2<f64>> = corners.iter().map(from_opencv).collect();
        Some(FoundMarker { id: usize::try_from(id).ok()?, corners: corners.try_into().ok()? })
    };
    let mut found: Vec<FoundMarker> = ids.iter().zip(&corners).filter_map(marker).collect();
    // Candidates come in the order of contours found by several threads.
    found.sort_by(|a, b| a.id.cmp(&b.id).then(a.corners[0].x.total_cmp(&b.corners[0].x)));
    Ok(found)
}

/// The markers of a board, without those that something else in the image looks like.
fn board_markers(
    grey: &Image<u8>,
    board: &Board,
    dictionary: Dictionary,
    refinement: aruco::CornerRefineMethod,
) -> opencv::Result<Vec<FoundMarker>> {
    let known = board.markers();
    let mut found = markers_in(grey, dictionary, refinement)?;
    found.retain(|marker| marker.id < known.len());
    let is_single = |id: usize| found.iter().filter(|marker| marker.id == id).count() == 1;
    let singles: Vec<FoundMarker> = found.iter().filter(|marker| is_single(marker.id)).cloned().collect();
    // Three misread ones could agree by chance; four fix a homography without a rest.
    if singles.len() < 5 {
        return Ok(singles);
    }
    let pairs = pairs_of(&singles, &known);
    let mut sides: Vec<f64> = singles.iter().map(|m| (m.corners[0] - m.corners[2]).norm()).collect();
    sides.sort_by(f64::total_cmp);
    // Wide enough for what a lens bends, narrow enough for what lies in another place.
    let tolerance = 0.25 * sides[sides.len() / 2];
    let Some(map) = homography(&pairs, calib3d::RANSAC, tolerance)? else { return Ok(singles) };
    let is_near = |(from, to): &(Point2<f64>, Point2<f64>)| {
        apply(&map, from).is_some_and(|mapped| (mapped - to).norm() < 2.0 * tolerance)
    };
    let kept = singles.into_iter().zip(pairs.chunks(4)).filter(|(_, corners)| corners.iter().all(is_near));
    Ok(kept.map(|(marker, _)| marker).collect())
}

/// Corners of markers on the board and in the image, four for each.
fn pairs_of(found: &[FoundMarker], known: &[crate::board::Marker]) -> Vec<(Point2<f64>, Point2<f64>)> {
    found.iter().flat_map(|m| (0..4).map(|k| (known[m.id].corners[k].xy(), m.corners[k]))).collect()
}

/// From the board's plane (metres) to the image (pixels): 3 × 3, by least squares or robustly.
pub(super) fn homography(
    pairs: &[(Point2<f64>, Point2<f64>)],
    method: i32,
    tolerance: f64,
) -> opencv::Result<Option<Matrix3<f64>>> {
    let float = |p: &Point2<f64>| Point2f::new(p.x as f32, p.y as f32);
    let from: Vector<Point2f> = pairs.iter().map(|(from, _)| float(from)).collect();
    let to: Vector<Point2f> = pairs.iter().map(|(_, to)| float(to)).collect();
    let found = calib3d::find_homography(&from, &to, &mut no_array(), method, tolerance)?;
    if found.rows() != 3 || found.cols() != 3 {
        return Ok(None);
    }
    let mut map = Matrix3::zeros();
    for row in 0..3 {
        for column in 0..3 {
            map[(row, column)] = *found.at_2d::<f64>(row as i32, column as i32)?;
        }
    }
    Ok(Some(map))
}

pub(super) fn apply(map: &Matrix3<f64>, p: &Point2<f64>) -> Option<Point2<f64>> {
    Point2::from_homogeneous(map * p.to_homogeneous())
}

/// Each corner is predicted from the markers next to it, so that no lens model is needed, then refined.
fn charuco(grey: &Image<u8>, board: &Board, markers: Vec<FoundMarker>) -> opencv::Result<BoardView> {
    let Board::Charuco { square, marker, .. } = *board else { return Ok(BoardView::default()) };
    let known = board.markers();
    let mut corners = Vec::new();
    for (id, corner) in board.corners().iter().enumerate() {
        let is_next = |m: &&FoundMarker| {
            (nalgebra::center(&known[m.id].corners[0], &known[m.id].corners[2]) - corner).norm() < square
        };
        let next: Vec<FoundMarker> = markers.iter().filter(is_next).cloned().collect();
        if next.is_empty() {
            continue;
        }
        let Some(map) = homography(&pairs_of(&next, &known), 0, 0.0)? else { continue };
        // Between the corner and the markers lies nothing but the edges that meet.
        let free = 0.5 * (square - marker);
        corners.extend(refined(grey, board, corner, &map, free).map(|pixel| (id, pixel)));
    }
    Ok(BoardView { corners: grown(grey, board, corners, 0.5 * (square - marker))?, markers })
}

/// Goes on from corners found to their neighbours: corners are still seen where markers are too small or too blurred to
/// be read. Each is predicted from those around it, so that again no lens model is needed.
fn grown(
    grey: &Image<u8>,
    board: &Board,
    mut found: Vec<(usize, Point2<f64>)>,
    free: f64,
) -> opencv::Result<Vec<(usize, Point2<f64>)>> {
    let places = board.corners();
    let square = board.pitch();
    let mut is_open: Vec<bool> = (0..places.len()).map(|id| found.iter().all(|(known, _)| *known != id)).collect();
    loop {
        let known = found.len();
        for (id, place) in places.iter().enumerate().filter(|(id, _)| is_open[*id]) {
            let around: Vec<_> = found[..known]
                .iter()
                .map(|(other, pixel)| (places[*other].xy(), *pixel))
                .filter(|(other, _)| (other - place.xy()).norm() < 3.0 * square)
                .collect();
            let is_next = around.iter().any(|(other, _)| (other - place.xy()).norm() < 1.1 * square);
            if !is_next || !spans_a_plane(&around, square) {
                continue;
            }
            let Some(map) = homography(&around, 0, 0.0)? else { continue };
            found.extend(refined(grey, board, place, &map, free).map(|pixel| (id, pixel)));
        }
        if found.len() == known {
            found.sort_by_key(|(id, _)| *id);
            return Ok(found);
        }
        found[known..].iter().for_each(|(id, _)| is_open[*id] = false);
    }
}

/// Whether four of the points are corners of a quadrilateral: a homography needs no less.
fn spans_a_plane(points: &[(Point2<f64>, Point2<f64>)], square: f64) -> bool {
    let places: Vec<[i64; 2]> = points.iter().map(|(p, _)| [p.x, p.y].map(|v| (v / square).round() as i64)).collect();
    let two_of = |row: i64| places.iter().filter(|place| place[1] == row).count() >= 2;
    let rows: std::collections::BTreeSet<i64> =
        places.iter().map(|place| place[1]).filter(|&row| two_of(row)).collect();
    rows.len() >= 2
}

/// A corner where four squares meet, near where `map` (board to pixels) puts it; `None` where the image shows none
/// there. `free` metres around it nothing else is printed.
fn refined(
    grey: &Image<u8>,
    board: &Board,
    corner: &Point3<f64>,
    map: &Matrix3<f64>,
    free: f64,
) -> Option<Point2<f64>> {
    let at = |x: f64, y: f64| apply(map, &Point2::new(corner.x + x * free, corner.y + y * free));
    let pixel = at(0.0, 0.0)?;
    // The nearest thing that is no edge: diagonally of the corner, or where a square ends.
    let rim = [at(1.0, 1.0)?, at(-1.0, 1.0)?, at(1.0, -1.0)?, at(-1.0, -1.0)?];
    let distance = rim.iter().map(|p| (p - pixel).norm()).fold(f64::INFINITY, f64::min);
    let guess = SaddleGuess {
        pixel,
        edges: [at(1.0, 0.0)? - pixel, at(0.0, 1.0)? - pixel],
        is_dark: board.is_dark(Point2::new(corner.x + 0.5 * free, corner.y + 0.5 * free)),
        // Half a pixel less: pixels are blurred.
        reach: (distance - 0.5).clamp(*REACH.start(), *REACH.end()),
    };
    saddle(grey, &guess).filter(|s| s.contrast > CONTRAST && s.residual < RESIDUAL).map(|s| s.pixel)
}

/// Between pixel centres, bilinear; `None` outside the frame.
pub(super) fn level(grey: &Image<u8>, pixel: Point2<f64>) -> Option<f64> {
    let is_inside = |v: f64, size: usize| v >= 0.0 && v < size as f64;
    if !(is_inside(pixel.x, grey.width()) && is_inside(pixel.y, grey.height())) {
        return None;
    }
    let (x, y) = (pixel.x - 0.5, pixel.y - 0.5);
    let (fx, fy) = (x - x.floor(), y - y.floor());
    let at = |dx: isize, dy: isize| f64::from(grey.at_clamped(x.floor() as isize + dx, y.floor() as isize + dy));
    let row = |dy: isize| at(0, dy) * (1.0 - fx) + at(1, dy) * fx;
    Some(row(0) * (1.0 - fy) + row(1) * fy)
}

fn chessboard(grey: &Image<u8>, board: &Board) -> opencv::Result<BoardView> {
    let Board::Chessboard { columns, rows, square } = *board else { return Ok(BoardView::default()) };
    let (across, down) = (columns - 1, rows - 1);
    let mut corners = Vector::<Point2f>::new();
    let size = Size::new(across as i32, down as i32);
    let flags = calib3d::CALIB_CB_ADAPTIVE_THRESH | calib3d::CALIB_CB_NORMALIZE_IMAGE;
    if !calib3d::find_chessboard_corners(&matrix(grey)?, size, &mut corners, flags)? || corners.len() != across * down {
        return Ok(BoardView::default());
    }
    let rough: Vec<Point2<f64>> = corners.iter().map(from_opencv).collect();
    let Some((order, map)) = reading_order(grey, board, &rough)? else { return Ok(BoardView::default()) };
    let places = board.corners();
    let mut view = BoardView::default();
    for (id, (&at, place)) in order.iter().zip(&places).enumerate() {
        // The homography of the whole board, moved to where the corner was seen: lenses bend.
        let Some(expected) = apply(&map, &place.xy()) else { continue };
        let shift = nalgebra::Translation2::from(rough[at] - expected).to_homogeneous();
        let found = refined(grey, board, place, &(shift * map), 0.5 * square);
        view.corners.extend(found.map(|pixel| (id, pixel)));
    }
    Ok(view)
}

/// Inner corners across and down of a chessboard of any size that is seen whole; `None` without one.
pub(super) fn chessboard_counts(grey: &Image<u8>) -> opencv::Result<Option<[usize; 2]>> {
    if grey.width() < SMALLEST || grey.height() < SMALLEST {
        return Ok(None);
    }
    let (mut corners, mut found) = (Vector::<Point2f>::new(), Mat::default());
    let flags = calib3d::CALIB_CB_LARGER | calib3d::CALIB_CB_NORMALIZE_IMAGE;
    let is_found = calib3d::find_chessboard_corners_sb_with_meta(
        &matrix(grey)?,
        Size::new(3, 3),
        &mut corners,
        flags,
        &mut found,
    )?;
    Ok((is_found && found.cols() > 2 && found.rows() > 2).then(|| [found.cols() as usize, found.rows() as usize]))
}

/// OpenCV may start at any end of the pattern. Of the orders in which the grid can be read, the one in which the
/// board is seen from its front and its squares are dark where they should be: `order[id]` is the position in
/// `found`, with the homography from board to image.
fn reading_order(
    grey: &Image<u8>,
    board: &Board,
    found: &[Point2<f64>],
) -> opencv::Result<Option<(Vec<usize>, Matrix3<f64>)>> {
    let Board::Chessboard { columns, rows, square } = *board else { return Ok(None) };
    let (across, down) = (columns - 1, rows - 1);
    let places = board.corners();
    let centres: Vec<Point2<f64>> = (0..rows)
        .flat_map(|row| (0..columns).map(move |column| [column, row]))
        .map(|place| place.map(|n| (n as f64 + 0.5) * square).into())
        .collect();
    let mut best: Option<(f64, Vec<usize>, Matrix3<f64>)> = None;
    for turn in 0..8 {
        let (flip_x, flip_y, swap) = (turn & 1 == 1, turn & 2 == 2, turn & 4 == 4);
        if swap && across != down {
            continue;
        }
        let position = |id: usize| {
            let (x, y) = (id % across, id / across);
            let x = if flip_x { across - 1 - x } else { x };
            let y = if flip_y { down - 1 - y } else { y };
            if swap { x * across + y } else { y * across + x }
        };
        let order: Vec<usize> = (0..across * down).map(position).collect();
        let pairs: Vec<_> = order.iter().zip(&places).map(|(&at, place)| (place.xy(), found[at])).collect();
        let Some(map) = homography(&pairs, 0, 0.0)? else { continue };
        if !is_from_front(&map, &places[0].xy()) {
            continue;
        }
        let score: f64 = centres
            .iter()
            .filter_map(|centre| Some((level(grey, apply(&map, centre)?)?, board.is_dark(*centre))))
            .map(|(level, is_dark)| if is_dark { -level } else { level })
            .sum();
        if best.as_ref().is_none_or(|(most, ..)| score > *most) {
            best = Some((score, order, map));
        }
    }
    Ok(best.map(|(_, order, map)| (order, map)))
}

/// On the board y is up, in the image down: seen from the front, the map turns the plane over. Its sign is that of
/// the determinant where the third coordinate is positive.
fn is_from_front(map: &Matrix3<f64>, at: &Point2<f64>) -> bool {
    let depth = (map * at.to_homogeneous()).z;
    map.determinant() * depth < 0.0
}

#[cfg(test)]
pub(super) mod tests;
