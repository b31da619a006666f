//! Boards as text: `charuco:7x5:30mm:22.5mm:4x4_50`, as captions print it and the command line takes it.

use super::{Board, BoardError, Dictionary};
use std::fmt;
use std::str::FromStr;

const FORMS: &str = "write charuco:COLUMNSxROWS:SQUARE:MARKER:DICTIONARY[:light-first], chessboard:COLUMNSxROWS:SQUARE \
    (counting squares) or aruco:COLUMNSxROWS:MARKER:GAP:DICTIONARY, as in charuco:7x5:30mm:22.5mm:4x4_50";

impl fmt::Display for Board {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // To a nanometre: what a decimal fraction of a millimetre loses in metres comes back.
        let mm = |metres: f64| (metres * 1e9).round() / 1e6;
        match *self {
            Self::Chessboard { columns, rows, square } => write!(f, "chessboard:{columns}x{rows}:{}mm", mm(square)),
            Self::Charuco { columns, rows, square, marker, dictionary, light_first } => {
                write!(f, "charuco:{columns}x{rows}:{}mm:{}mm:{dictionary}", mm(square), mm(marker))?;
                f.write_str(if light_first { ":light-first" } else { "" })
            }
            Self::ArucoGrid { columns, rows, marker, gap, dictionary } => {
                write!(f, "aruco:{columns}x{rows}:{}mm:{}mm:{dictionary}", mm(marker), mm(gap))
            }
        }
    }
}

impl FromStr for Board {
    type Err = BoardError;

    /// Reads a board and checks it.
    fn from_str(text: &str) -> Result<Self, BoardError> {
        let parts: Vec<&str> = text.trim().split(':').collect();
        let board = match parts[..] {
            ["chessboard", counts, square] => {
                let [columns, rows] = parse_counts(counts)?;
                Self::Chessboard { columns, rows, square: parse_length(square)? }
            }
            ["charuco", counts, square, marker, dictionary, ref rest @ ..] if matches!(rest, [] | ["light-first"]) => {
                let [columns, rows] = parse_counts(counts)?;
                let (square, marker) = (parse_length(square)?, parse_length(marker)?);
                let (dictionary, light_first) = (dictionary.parse::<Dictionary>()?, !rest.is_empty());
                Self::Charuco { columns, rows, square, marker, dictionary, light_first }
            }
            ["aruco", counts, marker, gap, dictionary] => {
                let [columns, rows] = parse_counts(counts)?;
                let (marker, gap) = (parse_length(marker)?, parse_length(gap)?);
                Self::ArucoGrid { columns, rows, marker, gap, dictionary: dictionary.parse()? }
            }
            _ => return Err(fault(text, "is no board", FORMS)),
        };
        board.check().map(|()| board)
    }
}

/// Reads a length with its unit (`30mm`, `3cm`, `0.03m`, `1.5in`) as metres.
///
/// # Errors
/// [`BoardError::Text`] without a unit, without a number, or where it is not a positive length.
pub fn parse_length(text: &str) -> Result<f64, BoardError> {
    let trimmed = text.trim();
    let units = [("mm", 1e3), ("cm", 1e2), ("in", 1.0 / 0.0254), ("m", 1.0)];
    let (number, per_metre) = units
        .iter()
        .find_map(|&(unit, per_metre)| Some((trimmed.strip_suffix(unit)?, per_metre)))
        .ok_or_else(|| fault(text, "has no unit", "write it with mm, cm, m or in, as in 30mm"))?;
    match number.trim().parse::<f64>() {
        Ok(number) if number > 0.0 && number.is_finite() => Ok(number / per_metre),
        _ => Err(fault(text, "is no length", "write a positive number and a unit, as in 30mm")),
    }
}

fn parse_counts(text: &str) -> Result<[usize; 2], BoardError> {
    let wrong = || fault(text, "is no pair of counts", "write COLUMNSxROWS, as in 7x5");
    let (columns, rows) = text.split_once(['x', '×']).ok_or_else(wrong)?;
    match (columns.parse(), rows.parse()) {
        (Ok(columns), Ok(rows)) => Ok([columns, rows]),
        _ => Err(wrong()),
    }
}

pub(super) fn fault(text: &str, fault: &str, remedy: &str) -> BoardError {
    BoardError::Text { text: text.to_owned(), fault: fault.to_owned(), remedy: remedy.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_comes_back_from_its_text() {
        for text in [
            "charuco:7x5:30mm:22.5mm:4x4_50",
            "charuco:8x6:12.3mm:9.1mm:apriltag_36h11:light-first",
            "chessboard:10x7:25mm",
            "aruco:5x4:40mm:10mm:aruco_original",
        ] {
            assert_eq!(text.parse::<Board>().map(|board| board.to_string()).as_deref(), Ok(text));
        }
        assert_eq!("charuco:7x5:3cm:0.0225m:DICT_4X4_50".parse(), Ok(Board::default()));
    }

    #[test]
    fn what_is_no_board_is_refused_with_what_to_write() {
        for (text, word) in [
            ("", "charuco:7x5"),
            ("charuco:7x5:30mm:22.5mm:4x4_50:upside-down", "light-first"),
            ("chessboard:9:25mm", "COLUMNSxROWS"),
            ("chessboard:-9x6:25mm", "COLUMNSxROWS"),
            ("chessboard:9x6:25", "unit"),
            ("chessboard:9x6:-25mm", "positive"),
            ("chessboard:9x6:nanmm", "positive"),
            ("chessboard:9x6:1e9m", "10 m"),
            ("aruco:5x4:40mm:10mm:4x4", "4x4_50"),
        ] {
            let fault = text.parse::<Board>().unwrap_err().to_string();
            assert!(fault.contains(word), "{text}: {fault}");
        }
    }
}
