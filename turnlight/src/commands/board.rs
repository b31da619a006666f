//! `turnlight board`

use crate::Answer;
use crate::arguments::{BoardArgs, BoardKind};
use serde_json::json;
use turnlight::Error;
use turnlight::capture::board::{Sheet, SheetOptions};
use turnlight::capture::{Board, BoardError};
use turnlight::output::write_file;

pub(crate) fn run(args: &BoardArgs) -> Result<Answer, Error> {
    super::check_extension(&args.output, &["pdf", "svg", "png"])?;
    let wrong = |fault: BoardError| Error::Arguments(fault.to_string());
    let board = board(args);
    let sheet = Sheet::new(&board, &SheetOptions { paper: args.paper, dpi: args.dpi }).map_err(wrong)?;
    let extension = args.output.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let bytes = match extension.as_str() {
        "svg" => sheet.to_svg().into_bytes(),
        "png" => sheet.to_png().map_err(wrong)?,
        _ => sheet.to_pdf(),
    };
    write_file(&args.output, &bytes)?;
    let [width, height] = board.size().map(millimetres);
    let page = sheet.size().map(millimetres);
    let corners = board.corners().len();
    let text = format!(
        "{board}: {corners} corners on {width} × {height} mm, on {} paper\n\
         print at 100 %, not fitted to the page, and measure the ruler\nwrote {}",
        args.paper.name(),
        args.output.display()
    );
    let json = json!({
        "board": board.to_string(),
        "corners": corners,
        "markers": board.markers().len(),
        "size_mm": [width, height],
        "page_mm": page,
        "output": args.output,
    });
    Ok(Answer { text, json })
}

fn board(args: &BoardArgs) -> Board {
    let BoardArgs { columns, rows, square, dictionary, .. } = *args;
    let marker = args.marker.unwrap_or(0.75 * square);
    match args.kind {
        BoardKind::Charuco => Board::Charuco { columns, rows, square, marker, dictionary, light_first: false },
        BoardKind::Chessboard => Board::Chessboard { columns, rows, square },
        BoardKind::Aruco => Board::ArucoGrid { columns, rows, marker, gap: square - marker, dictionary },
    }
}

/// To a thousandth.
fn millimetres(metres: f64) -> f64 {
    (metres * 1e6).round() / 1e3
}
