//! Pictures for the report: the object cut out of the frame, and where a render differs.

use crate::Error;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use capture::Image;

/// Longest side of a picture in the report.
const MAX_SIDE: usize = 360;
/// Pixels kept around the object.
const MARGIN: usize = 8;
/// By how much differences are exaggerated.
pub(super) const DIFFERENCE_GAIN: u8 = 4;

/// A rectangle in a frame, and the whole factor by which it is reduced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Cut {
    x: [usize; 2],
    y: [usize; 2],
    factor: usize,
}

impl Cut {
    /// Around the object; the whole frame where there is none.
    pub(super) fn around(mask: &Image<u8>) -> Self {
        let mut x = [usize::MAX, 0];
        let mut y = [usize::MAX, 0];
        for row in 0..mask.height() {
            for (column, _) in mask.row(row).iter().enumerate().filter(|(_, m)| **m >= 128) {
                x = [x[0].min(column), x[1].max(column + 1)];
                y = [y[0].min(row), y[1].max(row + 1)];
            }
        }
        let grown = |[from, to]: [usize; 2], size: usize| {
            if from >= to { [0, size] } else { [from.saturating_sub(MARGIN), (to + MARGIN).min(size)] }
        };
        let (x, y) = (grown(x, mask.width()), grown(y, mask.height()));
        let factor = (x[1] - x[0]).max(y[1] - y[0]).div_ceil(MAX_SIDE).max(1);
        Self { x, y, factor }
    }

    /// The pixels inside, averaged over blocks of `factor × factor`.
    fn apply(&self, image: &Image<[u8; 3]>) -> Image<[u8; 3]> {
        let f = self.factor;
        let (width, height) = ((self.x[1] - self.x[0]) / f, (self.y[1] - self.y[0]) / f);
        let mut cut = Image::filled(width, height, [0; 3]);
        for y in 0..height {
            for x in 0..width {
                let block = (0..f * f).map(|k| image.at(self.x[0] + x * f + k % f, self.y[0] + y * f + k / f));
                let sum = block.fold([0_usize; 3], |s, p| [0, 1, 2].map(|c| s[c] + usize::from(p[c])));
                cut.set(x, y, sum.map(|s| ((s + f * f / 2) / (f * f)) as u8));
            }
        }
        cut
    }

    /// The cut-out as a `data:` URI.
    pub(super) fn data_uri(&self, image: &Image<[u8; 3]>) -> Result<String, Error> {
        Ok(format!("data:image/png;base64,{}", STANDARD.encode(png(&self.apply(image))?)))
    }
}

/// A photograph with everything outside the mask black.
pub(super) fn masked(photograph: &Image<[u8; 3]>, mask: &Image<u8>) -> Image<[u8; 3]> {
    let mut out = photograph.clone();
    out.pixels_mut().iter_mut().zip(mask.pixels()).filter(|(_, m)| **m < 128).for_each(|(p, _)| *p = [0; 3]);
    out
}

/// Absolute differences, exaggerated; black is agreement.
pub(super) fn difference(a: &Image<[u8; 3]>, b: &Image<[u8; 3]>) -> Image<[u8; 3]> {
    let mut out = a.clone();
    for (p, q) in out.pixels_mut().iter_mut().zip(b.pixels()) {
        *p = [0, 1, 2].map(|c| p[c].abs_diff(q[c]).saturating_mul(DIFFERENCE_GAIN));
    }
    out
}

fn png(image: &Image<[u8; 3]>) -> Result<Vec<u8>, Error> {
    let encode = || -> Result<Vec<u8>, Box<dyn std::error::Error>> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, u32::try_from(image.width())?, u32::try_from(image.height())?);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(image.pixels().as_flattened())?;
        writer.finish()?;
        Ok(bytes)
    };
    encode().map_err(|fault| Error::Failed(format!("a picture of the report cannot be encoded: {fault}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_keeps_the_object_and_halves_what_is_too_large() {
        let mut mask = Image::filled(1000, 500, 0);
        mask.set(100, 50, 255);
        mask.set(700, 60, 255);
        let cut = Cut::around(&mask);
        assert_eq!(cut, Cut { x: [92, 709], y: [42, 69], factor: 2 });
        let small = cut.apply(&Image::filled(1000, 500, [7; 3]));
        assert_eq!((small.width(), small.height(), small.at(3, 3)), (308, 13, [7; 3]));
        assert_eq!(Cut::around(&Image::filled(5, 4, 0)), Cut { x: [0, 5], y: [0, 4], factor: 1 });
    }
}
