//! A board on paper: to exact scale, with a caption and a ruler that show whether the printer kept it.

use super::text::fault;
use super::{Board, BoardError, Rectangle, cover};
use crate::Image;
use std::fmt::Write;
use std::str::FromStr;

/// A size of paper, upright.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paper {
    name: &'static str,
    /// Width and height in metres.
    size: [f64; 2],
}

/// ISO 216, and what is used in North America.
const PAPERS: [Paper; 7] = [
    Paper { name: "a4", size: [0.210, 0.297] },
    Paper { name: "a3", size: [0.297, 0.420] },
    Paper { name: "a2", size: [0.420, 0.594] },
    Paper { name: "a1", size: [0.594, 0.841] },
    Paper { name: "a0", size: [0.841, 1.189] },
    Paper { name: "letter", size: [0.2159, 0.2794] },
    Paper { name: "tabloid", size: [0.2794, 0.4318] },
];

/// How a board is put on paper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SheetOptions {
    /// On which paper; turned if the board fits better so.
    pub paper: Paper,
    /// Dots per inch of a picture; vector formats have none.
    pub dpi: f64,
}

impl Default for SheetOptions {
    fn default() -> Self {
        Self { paper: PAPERS[0], dpi: 300.0 }
    }
}

/// A laid-out page. Lengths in metres, from the top left corner of the page, y down.
#[derive(Clone, Debug)]
pub struct Sheet {
    size: [f64; 2],
    /// Of the pattern and of the ruler.
    dark: Vec<Rectangle>,
    caption: [String; 2],
    /// Left end of the caption's first baseline.
    baseline: [f64; 2],
    pixels_per_metre: f64,
}

/// What most printers cannot reach.
const MARGIN: f64 = 0.005;
/// For the ruler and the caption, below the pattern.
const STRIP: f64 = 0.015;
/// Lines and ticks of the ruler.
const LINE: f64 = 0.0002;
/// One division of the ruler.
const DIVISION: f64 = 0.01;
/// Height of the caption's letters, 8 points.
const TEXT: f64 = 8.0 * 0.0254 / 72.0;

impl Paper {
    /// Its name, as [`FromStr`] reads it.
    pub fn name(&self) -> &'static str {
        self.name
    }
}

impl FromStr for Paper {
    type Err = BoardError;

    fn from_str(text: &str) -> Result<Self, BoardError> {
        let name = text.trim().to_ascii_lowercase();
        PAPERS.iter().find(|paper| paper.name == name).copied().ok_or_else(|| {
            let known: Vec<_> = PAPERS.iter().map(|paper| paper.name).collect();
            fault(text, "is no paper known here", &format!("use one of {}", known.join(", ")))
        })
    }
}

impl Sheet {
    /// Puts a board in the middle of a page.
    ///
    /// # Errors
    /// [`BoardError::Measure`] where the board cannot be ([`Board::check`]), does not fit on the paper, or the
    /// resolution is not 30 to 2400 dots per inch.
    pub fn new(board: &Board, options: &SheetOptions) -> Result<Self, BoardError> {
        board.check()?;
        if !(30.0..=2400.0).contains(&options.dpi) {
            return Err(board.wrong(&format!("{} dots per inch", options.dpi), "choose 30 to 2400"));
        }
        let pattern = board.size();
        let surround = 2.0 * board.quiet_zone();
        let needed = [pattern[0] + surround, pattern[1] + surround + STRIP].map(|side| side + 2.0 * MARGIN);
        let [short, long] = options.paper.size;
        let pages =
            if pattern[0] > pattern[1] { [[long, short], [short, long]] } else { [[short, long], [long, short]] };
        let fits = |page: &[f64; 2]| (0..2).all(|axis| needed[axis] <= page[axis] + 1e-9);
        let Some(size) = pages.into_iter().find(fits) else {
            let [width, height] = needed.map(|side| (side * 1e3 - 1e-6).ceil());
            let fault = format!("needs {width} × {height} mm with its margins, more than {} has", options.paper.name);
            return Err(board.wrong(&fault, "choose larger paper, smaller squares or fewer of them"));
        };
        let origin = [0.5 * (size[0] - pattern[0]), 0.5 * (size[1] - STRIP - pattern[1])];
        let mut dark = board.dark_rectangles();
        dark.iter_mut().for_each(|r| r.min = [r.min[0] + origin[0], r.min[1] + origin[1]]);
        let left = origin[0].max(MARGIN);
        let top = size[1] - MARGIN - STRIP;
        let divisions = ((size[0] - 2.0 * left + 1e-9) / DIVISION).floor().clamp(1.0, 10.0);
        dark.extend(ruler([left, top], divisions as usize));
        let millimetres = divisions * DIVISION * 1e3;
        let caption = [
            format!("turnlight {board}"),
            format!("Print at 100 %, not fitted to the page: the ruler must be {millimetres} mm long. Mount it flat."),
        ];
        // A whole number, as PNG holds it: then the picture's scale is exact.
        let pixels_per_metre = (options.dpi / 0.0254).round();
        Ok(Self { size, dark, caption, baseline: [left, top + 0.0075], pixels_per_metre })
    }

    /// Width and height of the page in metres.
    pub fn size(&self) -> [f64; 2] {
        self.size
    }

    /// The page as vectors, for a browser. Lengths are millimetres.
    pub fn to_svg(&self) -> String {
        let [width, height] = self.size.map(millimetres);
        let mut path = String::new();
        for r in &self.dark {
            let [x, y, w, h] = [r.min[0], r.min[1], r.size[0], r.size[1]].map(millimetres);
            path.push_str(&format!("M{x} {y}h{w}v{h}h-{w}z"));
        }
        let text = millimetres(TEXT);
        let line = |(i, line): (usize, &String)| {
            let [x, y] = [self.baseline[0], self.baseline[1] + 1.3 * TEXT * i as f64].map(millimetres);
            format!(
                "<text x=\"{x}\" y=\"{y}\" font-size=\"{text}\" font-family=\"Helvetica, sans-serif\">{line}</text>\n"
            )
        };
        let caption: String = self.caption.iter().enumerate().map(line).collect();
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}mm\" height=\"{height}mm\" \
             viewBox=\"0 0 {width} {height}\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
             <path d=\"{path}\"/>\n{caption}</svg>\n"
        )
    }

    /// The page as vectors, for a printer (ISO 32000-1). The pattern is one path, so that viewers draw no
    /// hairlines between modules; the viewer is asked not to scale.
    pub fn to_pdf(&self) -> Vec<u8> {
        // One unit of PDF is 1/72 inch, y up from the lower left corner.
        let point = 72.0 / 0.0254;
        let [width, height] = self.size.map(|side| side * point);
        let mut content = format!("q {0:.9} 0 0 -{0:.9} 0 {height:.6} cm\n", point / 1e3);
        for r in &self.dark {
            let [x, y, w, h] = [r.min[0], r.min[1], r.size[0], r.size[1]].map(millimetres);
            content.push_str(&format!("{x} {y} {w} {h} re\n"));
        }
        content.push_str("f Q\n");
        let (x, y) = (self.baseline[0] * point, height - self.baseline[1] * point);
        let size = TEXT * point;
        let [first, second] = &self.caption;
        content.push_str(&format!(
            "BT /F {size:.3} Tf {:.3} TL {x:.3} {y:.3} Td ({first}) Tj T* ({second}) Tj ET\n",
            1.3 * size
        ));
        let objects = [
            "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>".to_owned(),
            "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_owned(),
            format!(
                "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.6} {height:.6}] /Contents 4 0 R \
                 /Resources << /Font << /F 5 0 R >> >> >>"
            ),
            format!("<< /Length {} >>\nstream\n{content}endstream", content.len()),
            "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>".to_owned(),
        ];
        pdf_file(&objects).into_bytes()
    }

    /// The page as a grey picture with its scale in it (`pHYs`), without the caption.
    ///
    /// # Errors
    /// [`BoardError::Measure`] where the page has too many pixels.
    pub fn to_png(&self) -> Result<Vec<u8>, BoardError> {
        let raster = self.raster()?;
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, raster.width() as u32, raster.height() as u32);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Eight);
        let scale = self.pixels_per_metre as u32;
        encoder.set_pixel_dims(Some(png::PixelDimensions { xppu: scale, yppu: scale, unit: png::Unit::Meter }));
        let write = |encoder: png::Encoder<'_, &mut Vec<u8>>| -> Result<(), png::EncodingError> {
            let mut writer = encoder.write_header()?;
            writer.write_image_data(raster.pixels())?;
            writer.finish()
        };
        write(encoder).map_err(|error| self.fault(&error.to_string(), "report this as a bug"))?;
        Ok(bytes)
    }

    /// The page at its resolution: the exact coverage of every pixel, 0 = dark.
    ///
    /// # Errors
    /// [`BoardError::Measure`] where the page has too many pixels.
    pub fn raster(&self) -> Result<Image<u8>, BoardError> {
        let [width, height] = self.size.map(|side| (side * self.pixels_per_metre).ceil());
        if width * height > super::MOST_PIXELS {
            return Err(self.fault(&format!("{width} × {height} pixels cannot be drawn"), "choose fewer dots per inch"));
        }
        let mut dark = Image::filled(width as usize, height as usize, 0.0_f32);
        for r in &self.dark {
            cover(&mut dark, r.min.map(|v| v * self.pixels_per_metre), r.size.map(|v| v * self.pixels_per_metre));
        }
        Ok(dark.map(|coverage| (255.0 * (1.0 - coverage.min(1.0))).round() as u8))
    }

    fn fault(&self, fault: &str, remedy: &str) -> BoardError {
        let board = self.caption[0].clone();
        BoardError::Measure { board, fault: fault.to_owned(), remedy: remedy.to_owned() }
    }
}

/// A line with a tick for every centimetre, the first and the last longer; it measures from middle to middle.
fn ruler([left, top]: [f64; 2], divisions: usize) -> Vec<Rectangle> {
    let length = divisions as f64 * DIVISION;
    let tick = |i: usize| {
        let height = if i == 0 || i == divisions { 0.004 } else { 0.002 };
        Rectangle { min: [left + i as f64 * DIVISION - 0.5 * LINE, top], size: [LINE, height] }
    };
    // Between the ticks, so that nothing is covered twice.
    let line = |i: usize| {
        let min = [left + i as f64 * DIVISION + 0.5 * LINE, top];
        Rectangle { min, size: [length / divisions as f64 - LINE, LINE] }
    };
    (0..=divisions).map(tick).chain((0..divisions).map(line)).collect()
}

/// To a nanometre.
fn millimetres(metres: f64) -> f64 {
    (metres * 1e9).round() / 1e6
}

/// A PDF of these objects, numbered from 1; the first is the catalogue.
fn pdf_file(objects: &[String]) -> String {
    let mut file = "%PDF-1.7\n".to_owned();
    let mut table = String::new();
    for (i, object) in objects.iter().enumerate() {
        table.push_str(&format!("{:010} 00000 n \n", file.len()));
        // Writing to a string cannot fail.
        let _ = write!(file, "{} 0 obj\n{object}\nendobj\n", i + 1);
    }
    let start = file.len();
    let count = objects.len() + 1;
    let _ = write!(file, "xref\n0 {count}\n0000000000 65535 f \n{table}");
    let _ = write!(file, "trailer << /Size {count} /Root 1 0 R >>\nstartxref\n{start}\n%%EOF\n");
    file
}

#[cfg(test)]
mod tests {
    use super::*;

    fn default_sheet() -> Sheet {
        Sheet::new(&Board::default(), &SheetOptions::default()).unwrap()
    }

    /// The rectangles of a PDF as a reader finds them: numbers before `re`, through the matrix before `cm`.
    fn pdf_rectangles(pdf: &str) -> Vec<[f64; 4]> {
        let words: Vec<&str> = pdf.split_ascii_whitespace().collect();
        let before =
            |at: usize, n: usize| -> Vec<f64> { words[at - n..at].iter().map(|w| w.parse().unwrap()).collect() };
        let matrix = before(words.iter().position(|w| *w == "cm").unwrap(), 6);
        let rectangle = |at: usize| {
            let [x, y, w, h] = before(at, 4)[..] else { unreachable!("four numbers") };
            [x * matrix[0] + matrix[4], y * matrix[3] + matrix[5], w * matrix[0], h * matrix[3]]
        };
        (0..words.len()).filter(|&at| words[at] == "re").map(rectangle).collect()
    }

    #[test]
    fn a_pdf_square_measures_what_was_asked() {
        let pdf = String::from_utf8(default_sheet().to_pdf()).unwrap();
        let millimetre = 72.0 / 25.4;
        let rectangles = pdf_rectangles(&pdf);
        let [x, y, w, h] = rectangles[0];
        assert!((w - 30.0 * millimetre).abs() < 1e-5 && (h + 30.0 * millimetre).abs() < 1e-5, "{w} {h}");
        // The page is A4 across, the pattern in its middle.
        assert!(pdf.contains("/MediaBox [0 0 841.889764 595.275591]"), "{pdf}");
        assert!((x - (297.0 - 210.0) / 2.0 * millimetre).abs() < 1e-5, "{x}");
        assert!((y - (210.0 - (210.0 - 15.0 - 150.0) / 2.0) * millimetre).abs() < 1e-5, "{y}");
        // The ruler's outer ticks are 100 mm apart.
        let ticks: Vec<f64> =
            rectangles.iter().filter(|r| (r[3] + 4.0 * millimetre).abs() < 1e-5).map(|r| r[0]).collect();
        assert!((ticks[1] - ticks[0] - 100.0 * millimetre).abs() < 1e-5, "{ticks:?}");
    }

    #[test]
    fn a_pdf_points_at_its_objects() {
        let pdf = String::from_utf8(default_sheet().to_pdf()).unwrap();
        let start: usize = pdf.lines().rev().nth(1).unwrap().parse().unwrap();
        let table: Vec<&str> = pdf[start..].lines().collect();
        assert_eq!(table[..2], ["xref", "0 6"]);
        for i in 1..6 {
            let offset: usize = table[2 + i][..10].parse().unwrap();
            assert!(pdf[offset..].starts_with(&format!("{i} 0 obj")), "object {i}");
            // Readers that trust the table want lines of 20 bytes.
            assert_eq!(table[2 + i].len() + 1, 20);
        }
        let stream = pdf.split("stream\n").nth(1).unwrap().strip_suffix("end").unwrap();
        assert!(pdf.contains(&format!("/Length {} ", stream.len())));
    }

    #[test]
    fn vectors_and_pictures_show_the_same() {
        let sheet = default_sheet();
        let svg = sheet.to_svg();
        assert!(svg.contains("width=\"297mm\" height=\"210mm\" viewBox=\"0 0 297 210\""));
        assert_eq!(svg.matches('M').count() - svg.matches("Mount").count(), sheet.dark.len());
        let png = sheet.to_png().unwrap();
        let reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
        let info = reader.info();
        assert_eq!(info.pixel_dims.unwrap().xppu, 11811);
        assert_eq!((info.width, info.height), (3508, 2481));
    }

    #[test]
    fn a_board_too_large_for_the_paper_says_what_it_needs() {
        let board: Board = "charuco:9x7:30mm:22mm:4x4_50".parse().unwrap();
        let fault = Sheet::new(&board, &SheetOptions::default()).unwrap_err().to_string();
        assert!(fault.contains("295 × 250 mm") && fault.contains("a4"), "{fault}");
        let options = SheetOptions { paper: "A3".parse().unwrap(), ..SheetOptions::default() };
        assert!(Sheet::new(&board, &options).is_ok());
        // A tall board stands upright.
        let tall: Board = "charuco:5x7:30mm:22mm:4x4_50".parse().unwrap();
        assert_eq!(Sheet::new(&tall, &SheetOptions::default()).unwrap().size(), [0.21, 0.297]);
    }
}
