//! How far a model is from a photograph, pixel by pixel.

use super::false_colour::of_difference;
use capture::Image;

/// The difference that has the last colour, in levels of 255: a tenth.
pub const FULL: f64 = 25.5;

/// A picture of differences, and what they come to.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// In false colour, from none to [`FULL`]; background where the model is not.
    pub colours: Image<[u8; 3]>,
    /// Mean over the pixels that the model covers whole, and over channels, in % of 255.
    pub mean_pct: f64,
    /// Root of the mean square, in % of 255.
    pub rms_pct: f64,
    /// Pixels compared.
    pub pixels: usize,
}

/// Compares a picture of a model (alpha its coverage) with a photograph of the same size; `None` where sizes differ or no
/// pixel is covered whole.
pub fn difference(drawn: &Image<[u8; 4]>, photograph: &Image<[u8; 3]>, background: [u8; 3]) -> Option<Difference> {
    if (drawn.width(), drawn.height()) != (photograph.width(), photograph.height()) {
        return None;
    }
    let (mut sum, mut squares, mut pixels) = (0.0, 0.0, 0);
    let mut compare = |(drawn, taken): (&[u8; 4], &[u8; 3])| {
        if drawn[3] < 255 {
            return background;
        }
        let apart = [0, 1, 2].map(|c| f64::from(drawn[c].abs_diff(taken[c])));
        let mean = apart.iter().sum::<f64>() / 3.0;
        sum += mean;
        squares += apart.iter().map(|d| d * d).sum::<f64>() / 3.0;
        pixels += 1;
        of_difference(mean / FULL)
    };
    let colours = drawn.pixels().iter().zip(photograph.pixels()).map(&mut compare).collect();
    let colours = Image::from_pixels(drawn.width(), drawn.height(), colours)?;
    let pct = |mean: f64| 100.0 * mean / 255.0;
    let count = pixels as f64;
    (pixels > 0).then(|| Difference {
        colours,
        mean_pct: pct(sum / count),
        rms_pct: pct((squares / count).sqrt()),
        pixels,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_differences_come_to_known_figures() {
        let drawn = Image::from_pixels(3, 1, vec![[100, 100, 100, 255], [50, 60, 70, 255], [9, 9, 9, 254]]).unwrap();
        let taken = Image::from_pixels(3, 1, vec![[100, 100, 100], [50, 60, 100], [200, 0, 0]]).unwrap();
        let found = difference(&drawn, &taken, [1, 2, 3]).unwrap();
        assert_eq!(found.pixels, 2);
        assert!((found.mean_pct - 100.0 * 5.0 / 255.0).abs() < 1e-9);
        assert!((found.rms_pct - 100.0 * 150f64.sqrt() / 255.0).abs() < 1e-9);
        assert_eq!(found.colours.pixels(), [of_difference(0.0), of_difference(10.0 / FULL), [1, 2, 3]]);
        assert_eq!(difference(&drawn, &Image::filled(1, 1, [0; 3]), [0; 3]), None);
        assert_eq!(difference(&drawn.map(|_| [0; 4]), &taken, [0; 3]), None);
    }
}
