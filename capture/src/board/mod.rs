//! Calibration boards: their geometry, what is dark on them, and sheets to print.
//!
//! Board coordinates are metres on the printed side: x right, y up, z out of the print, the origin at the
//! lower left corner of the pattern. Squares, markers and corners count in reading order, from the top left.

mod dictionary;
mod sheet;
mod text;

pub use dictionary::Dictionary;
pub use sheet::{Paper, Sheet, SheetOptions};
pub use text::parse_length;

use crate::Image;
use nalgebra::{Point2, Point3};

/// A flat pattern of known size. Lengths are metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Board {
    /// Alternating squares, the top left one dark.
    Chessboard {
        /// Squares (not inner corners) from left to right.
        columns: usize,
        /// Squares from top to bottom.
        rows: usize,
        /// Side of a square.
        square: f64,
    },
    /// A chessboard with a marker in every light square, so that a part of it is enough to know where it is.
    Charuco {
        /// Squares from left to right.
        columns: usize,
        /// Squares from top to bottom.
        rows: usize,
        /// Side of a square.
        square: f64,
        /// Side of a marker with its dark border.
        marker: f64,
        /// Whose markers, from id 0 on.
        dictionary: Dictionary,
        /// Whether the top left square is light and has marker 0, as OpenCV before 4.6 draws boards of an even
        /// number of rows. Dark everywhere else.
        light_first: bool,
    },
    /// Markers in rows and columns with light gaps.
    ArucoGrid {
        /// Markers from left to right.
        columns: usize,
        /// Markers from top to bottom.
        rows: usize,
        /// Side of a marker with its dark border.
        marker: f64,
        /// Between two markers.
        gap: f64,
        /// Whose markers, from id 0 on.
        dictionary: Dictionary,
    },
}

/// A marker of a board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Marker {
    /// Its number in the dictionary.
    pub id: usize,
    /// Outer corners of its border in board coordinates: top left, top right, bottom right, bottom left.
    pub corners: [Point3<f64>; 4],
}

/// A dark rectangle of the pattern in sheet coordinates: metres, x right, y *down*, from the top left corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// Left and top edge.
    pub min: [f64; 2],
    /// Width and height.
    pub size: [f64; 2],
}

/// Why a board cannot be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BoardError {
    /// Its measures contradict each other, or nobody could print it.
    #[error("{board}: {fault}; {remedy}")]
    Measure {
        /// The board.
        board: String,
        /// What is wrong with it.
        fault: String,
        /// What to do.
        remedy: String,
    },
    /// A text that describes no board, length, paper or dictionary.
    #[error("'{text}' {fault}; {remedy}")]
    Text {
        /// The text.
        text: String,
        /// What is wrong with it.
        fault: String,
        /// What to do.
        remedy: String,
    },
}

/// Sides of squares and markers: from the finest print to a wall.
const LENGTHS: std::ops::RangeInclusive<f64> = 1e-4..=10.0;
/// More squares or markers along a side than any camera resolves.
const MOST: usize = 200;
/// A raster of more pixels is a mistake in its unit.
const MOST_PIXELS: f64 = 4e8;

impl Default for Board {
    /// Fills an A4 sheet, and has an odd number of rows: all versions of OpenCV draw those alike.
    fn default() -> Self {
        let dictionary = Dictionary::DICT_4X4_50;
        Self::Charuco { columns: 7, rows: 5, square: 0.03, marker: 0.0225, dictionary, light_first: false }
    }
}

impl Board {
    /// Says whether the board can be: counts, lengths, and as many markers as the dictionary has.
    ///
    /// # Errors
    /// [`BoardError::Measure`] names the measure at fault.
    pub fn check(&self) -> Result<(), BoardError> {
        let fault = |fault: &str, remedy: &str| Err(self.wrong(fault, remedy));
        let [columns, rows] = self.counts();
        let least = if matches!(self, Self::ArucoGrid { .. }) { 1 } else { 3 };
        if !(least..=MOST).contains(&columns) || !(least..=MOST).contains(&rows) {
            return fault("too few or too many columns or rows", &format!("choose {least} to {MOST} of each"));
        }
        let lengths = match *self {
            Self::Chessboard { square, .. } => [square, square],
            Self::Charuco { square, marker, .. } => [square, marker],
            Self::ArucoGrid { marker, gap, .. } => [marker, gap],
        };
        if !lengths.iter().all(|length| LENGTHS.contains(length)) {
            return fault("a length is out of reach", "choose 0.1 mm to 10 m, as in 30mm");
        }
        if matches!(self, Self::Charuco { .. }) && lengths[1] > 0.95 * lengths[0] {
            return fault("the markers leave no light rim in their squares", "make them 0.75 of a square");
        }
        match self.dictionary() {
            Some(dictionary) if self.marker_count() > dictionary.len() => {
                let remedy = "choose a larger dictionary, or fewer columns and rows";
                fault(&format!("needs {} markers of {}", self.marker_count(), dictionary.len()), remedy)
            }
            _ => Ok(()),
        }
    }

    fn wrong(&self, fault: &str, remedy: &str) -> BoardError {
        BoardError::Measure { board: self.to_string(), fault: fault.to_owned(), remedy: remedy.to_owned() }
    }

    /// Columns and rows, of squares or of markers.
    pub fn counts(&self) -> [usize; 2] {
        match *self {
            Self::Chessboard { columns, rows, .. }
            | Self::Charuco { columns, rows, .. }
            | Self::ArucoGrid { columns, rows, .. } => [columns, rows],
        }
    }

    /// Whose markers it has, if any.
    pub fn dictionary(&self) -> Option<Dictionary> {
        match *self {
            Self::Chessboard { .. } => None,
            Self::Charuco { dictionary, .. } | Self::ArucoGrid { dictionary, .. } => Some(dictionary),
        }
    }

    /// Width and height of the pattern, without light surround.
    pub fn size(&self) -> [f64; 2] {
        let counts = self.counts().map(|n| n as f64);
        match *self {
            Self::Chessboard { square, .. } | Self::Charuco { square, .. } => counts.map(|n| n * square),
            Self::ArucoGrid { marker, gap, .. } => counts.map(|n| n * marker + (n - 1.0) * gap),
        }
    }

    /// The light surround that detection needs: half a square, or a module and a half of a marker.
    pub fn quiet_zone(&self) -> f64 {
        match *self {
            Self::Chessboard { square, .. } => 0.5 * square,
            // The outermost squares are their own surround.
            Self::Charuco { square, .. } => 0.25 * square,
            Self::ArucoGrid { marker, dictionary, .. } => 1.5 * marker / (dictionary.modules() + 2) as f64,
        }
    }

    /// Points that are found to a fraction of a pixel, `z = 0`, in reading order: where four squares meet, or on
    /// a grid of markers the corners of each.
    pub fn corners(&self) -> Vec<Point3<f64>> {
        match *self {
            Self::Chessboard { columns, rows, square } | Self::Charuco { columns, rows, square, .. } => {
                let places = (1..rows).flat_map(|row| (1..columns).map(move |column| [column, row]));
                places.map(|place| self.on_board(place.map(|n| n as f64 * square))).collect()
            }
            Self::ArucoGrid { .. } => self.markers().iter().flat_map(|marker| marker.corners).collect(),
        }
    }

    /// The markers by id; none on a chessboard.
    pub fn markers(&self) -> Vec<Marker> {
        let marker = |(id, ([x, y], side)): (usize, ([f64; 2], f64))| {
            let corners = [[x, y], [x + side, y], [x + side, y + side], [x, y + side]];
            Marker { id, corners: corners.map(|corner| self.on_board(corner)) }
        };
        self.marker_places().into_iter().enumerate().map(marker).collect()
    }

    /// Whether the board is dark at a point in board coordinates; everything around the pattern is light.
    pub fn is_dark(&self, point: Point2<f64>) -> bool {
        let [width, height] = self.size();
        let (x, y) = (point.x, height - point.y);
        // Written so that NaN is outside.
        if !(x >= 0.0 && x < width && y >= 0.0 && y < height) {
            return false;
        }
        let pitch = self.pitch();
        let cell = [x, y].map(|v| (v / pitch) as usize);
        if self.is_dark_square(cell) {
            return true;
        }
        let (Some(dictionary), Some(id)) = (self.dictionary(), self.marker_at(cell)) else { return false };
        let (inset, side) = self.marker_in_cell();
        let modules = (dictionary.modules() + 2) as f64;
        let place = [x - cell[0] as f64 * pitch - inset, y - cell[1] as f64 * pitch - inset];
        let is_inside = place.iter().all(|&v| v >= 0.0 && v < side);
        let [column, row] = place.map(|v| (v / side * modules) as usize);
        is_inside && dictionary.code(id).is_some_and(|code| dictionary.is_dark(code, column, row))
    }

    /// The dark parts as rectangles that share no area.
    pub fn dark_rectangles(&self) -> Vec<Rectangle> {
        let [columns, rows] = self.counts();
        let pitch = self.pitch();
        let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| [column, row]));
        let squares = cells.filter(|&cell| self.is_dark_square(cell));
        let mut dark: Vec<Rectangle> =
            squares.map(|cell| Rectangle { min: cell.map(|n| n as f64 * pitch), size: [pitch; 2] }).collect();
        let Some(dictionary) = self.dictionary() else { return dark };
        for (id, (place, side)) in self.marker_places().into_iter().enumerate() {
            dark.extend(dictionary.code(id).into_iter().flat_map(|code| runs(dictionary, code, place, side)));
        }
        dark
    }

    /// A picture of the board with `surround` metres of light around it: the exact coverage of every pixel, 0 =
    /// dark. The outer corner of pixel (0, 0) lies `surround` left of and above the pattern.
    ///
    /// # Errors
    /// [`BoardError::Measure`] where the picture would have more than 400 million pixels, or none.
    pub fn raster(&self, pixels_per_metre: f64, surround: f64) -> Result<Image<u8>, BoardError> {
        let size = self.size().map(|side| ((side + 2.0 * surround) * pixels_per_metre - 1e-6).ceil());
        if !(size[0] >= 1.0 && size[1] >= 1.0 && size[0] * size[1] <= MOST_PIXELS) {
            let fault = format!("{} × {} pixels cannot be drawn", size[0], size[1]);
            return Err(self.wrong(&fault, "choose another resolution"));
        }
        let mut dark = Image::filled(size[0] as usize, size[1] as usize, 0.0_f32);
        for rectangle in self.dark_rectangles() {
            let from = rectangle.min.map(|v| (v + surround) * pixels_per_metre);
            cover(&mut dark, from, rectangle.size.map(|v| v * pixels_per_metre));
        }
        Ok(dark.map(|coverage| (255.0 * (1.0 - coverage.min(1.0))).round() as u8))
    }

    fn on_board(&self, [x, y]: [f64; 2]) -> Point3<f64> {
        Point3::new(x, self.size()[1] - y, 0.0)
    }

    /// From one square or marker to the next.
    pub(crate) fn pitch(&self) -> f64 {
        match *self {
            Self::Chessboard { square, .. } | Self::Charuco { square, .. } => square,
            Self::ArucoGrid { marker, gap, .. } => marker + gap,
        }
    }

    /// How far a marker lies in its cell, and its side.
    fn marker_in_cell(&self) -> (f64, f64) {
        match *self {
            Self::Chessboard { .. } => (0.0, 0.0),
            Self::Charuco { square, marker, .. } => (0.5 * (square - marker), marker),
            Self::ArucoGrid { marker, .. } => (0.0, marker),
        }
    }

    fn is_dark_square(&self, [column, row]: [usize; 2]) -> bool {
        match *self {
            Self::Chessboard { .. } => (column + row).is_multiple_of(2),
            Self::Charuco { light_first, .. } => (column + row) % 2 == usize::from(light_first),
            Self::ArucoGrid { .. } => false,
        }
    }

    fn marker_count(&self) -> usize {
        let [columns, rows] = self.counts();
        match *self {
            Self::Chessboard { .. } => 0,
            Self::Charuco { light_first, .. } => (columns * rows + usize::from(light_first)) / 2,
            Self::ArucoGrid { .. } => columns * rows,
        }
    }

    /// The id of the marker in a cell that is light.
    fn marker_at(&self, [column, row]: [usize; 2]) -> Option<usize> {
        let columns = self.counts()[0];
        match *self {
            Self::Chessboard { .. } => None,
            // Light squares before this one: every other, whichever colour came first.
            Self::Charuco { light_first, .. } => {
                let before = |row: usize, count: usize| (count + usize::from((row % 2 == 1) != light_first)) / 2;
                Some((0..row).map(|above| before(above, columns)).sum::<usize>() + before(row, column))
            }
            Self::ArucoGrid { .. } => Some(row * columns + column),
        }
    }

    /// Top left corner, in sheet coordinates, and side of every marker by id.
    fn marker_places(&self) -> Vec<([f64; 2], f64)> {
        if self.dictionary().is_none() {
            return Vec::new();
        }
        let [columns, rows] = self.counts();
        let (inset, side) = self.marker_in_cell();
        let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| [column, row]));
        let light = cells.filter(|&cell| !self.is_dark_square(cell));
        light.map(|cell| (cell.map(|n| n as f64 * self.pitch() + inset), side)).collect()
    }
}

/// The dark modules of a marker, neighbours in a row joined.
fn runs(dictionary: Dictionary, code: u64, [x, y]: [f64; 2], side: f64) -> Vec<Rectangle> {
    let n = dictionary.modules() + 2;
    let module = side / n as f64;
    let mut found = Vec::new();
    for row in 0..n {
        let mut column = 0;
        while column < n {
            let length = (column..n).take_while(|&c| dictionary.is_dark(code, c, row)).count();
            if length > 0 {
                let min = [x + column as f64 * module, y + row as f64 * module];
                found.push(Rectangle { min, size: [length as f64 * module, module] });
            }
            column += length.max(1);
        }
    }
    found
}

/// Adds the part of every pixel that a rectangle covers.
fn cover(dark: &mut Image<f32>, from: [f64; 2], size: [f64; 2]) {
    let limits = [dark.width(), dark.height()];
    let overlaps = [0, 1].map(|axis| {
        let (start, end) = (from[axis].max(0.0), (from[axis] + size[axis]).max(0.0));
        let pixels = (start as usize)..(end.ceil() as usize).min(limits[axis]);
        let part = |pixel: usize| (end.min(pixel as f64 + 1.0) - start.max(pixel as f64)).max(0.0) as f32;
        pixels.map(|pixel| (pixel, part(pixel))).collect::<Vec<_>>()
    });
    for &(y, height) in &overlaps[1] {
        for &(x, width) in &overlaps[0] {
            dark.set(x, y, dark.at(x, y) + width * height);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boards() -> Vec<Board> {
        let dictionary: Dictionary = "5x5_100".parse().unwrap();
        let charuco = |columns, rows, light_first| Board::Charuco {
            columns,
            rows,
            square: 0.03,
            marker: 0.021,
            dictionary,
            light_first,
        };
        vec![
            Board::default(),
            charuco(4, 6, true),
            charuco(5, 4, false),
            Board::Chessboard { columns: 10, rows: 7, square: 0.025 },
            Board::ArucoGrid { columns: 3, rows: 4, marker: 0.04, gap: 0.01, dictionary },
        ]
    }

    #[test]
    fn a_point_is_dark_exactly_where_a_rectangle_covers_it() {
        for board in boards() {
            let rectangles = board.dark_rectangles();
            let [width, height] = board.size();
            // An irrational step meets no edge.
            for i in 0..4000 {
                let at = |step: f64, side: f64| ((f64::from(i) * step).fract() * 1.2 - 0.1) * side;
                let (x, y) = (at(0.618_033_988_7, width), at(0.754_877_666_2, height));
                let covers = |r: &&Rectangle| {
                    (0..2).all(|axis| (r.min[axis]..r.min[axis] + r.size[axis]).contains(&[x, height - y][axis]))
                };
                let count = rectangles.iter().filter(covers).count();
                assert_eq!(usize::from(board.is_dark(Point2::new(x, y))), count, "{board} at {x} {y}");
            }
        }
    }

    #[test]
    fn a_raster_keeps_the_dark_area_at_any_resolution() {
        for board in boards() {
            let dark: f64 = board.dark_rectangles().iter().map(|r| r.size[0] * r.size[1]).sum();
            for pixels_per_metre in [317.0, 1000.0, 2345.6] {
                let raster = board.raster(pixels_per_metre, 0.011).unwrap();
                let levels: f64 = raster.pixels().iter().map(|&v| 1.0 - f64::from(v) / 255.0).sum();
                let area = levels / (pixels_per_metre * pixels_per_metre);
                assert!((area / dark - 1.0).abs() < 1e-3, "{board} at {pixels_per_metre}: {area} for {dark}");
            }
        }
    }

    #[test]
    fn reading_order_starts_at_the_top_left() {
        let board = Board::default();
        let corners = board.corners();
        assert_eq!(corners.len(), 6 * 4);
        assert!((corners[0] - Point3::new(0.03, 0.12, 0.0)).norm() < 1e-12);
        assert!((corners[23] - Point3::new(0.18, 0.03, 0.0)).norm() < 1e-12);
        let markers = board.markers();
        assert_eq!(markers.len(), 17);
        // The top left square is dark: marker 0 is in the second one.
        assert!((markers[0].corners[0] - Point3::new(0.033_75, 0.146_25, 0.0)).norm() < 1e-12);
        assert!(markers[0].corners[2].y < markers[0].corners[1].y);
    }

    #[test]
    fn boards_that_cannot_be_are_refused_with_the_remedy() {
        let Board::Charuco { columns, rows, square, marker, dictionary, light_first } = Board::default() else {
            unreachable!("the default is a ChArUco board")
        };
        let charuco =
            |columns, rows, square, marker| Board::Charuco { columns, rows, square, marker, dictionary, light_first };
        for (board, word) in [
            (charuco(2, rows, square, marker), "columns"),
            (charuco(columns, 1000, square, marker), "rows"),
            (charuco(columns, rows, f64::NAN, marker), "length"),
            (charuco(columns, rows, square, square), "rim"),
            (charuco(20, 20, square, marker), "dictionary"),
        ] {
            let fault = board.check().unwrap_err().to_string();
            assert!(fault.contains(word), "{fault}");
        }
        assert!(Board::default().raster(1e9, 0.0).is_err());
        assert!(Board::default().raster(f64::NAN, 0.0).is_err());
    }
}
