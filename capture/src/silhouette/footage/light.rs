//! Encoded sRGB to linear light and back.

use crate::Image;

/// Linear light of an encoded level 0 to 255, white = 1 (IEC 61966-2-1).
pub(super) fn linear(level: f32) -> f32 {
    let v = level / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// Encoded level of linear light, not clamped above.
pub(super) fn encoded(light: f32) -> f32 {
    let v = light.max(0.0);
    255.0 * if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// A frame as if taken with the exposure of the others: 8 bits and how to read them.
#[derive(Clone, Debug)]
pub(super) struct Toned {
    image: Image<[u8; 3]>,
    table: [Vec<f32>; 3],
}

impl Toned {
    pub(super) fn new(image: Image<[u8; 3]>, gains: &[f64; 3]) -> Self {
        let level = |v: usize, gain: f64| encoded(linear(v as f32) * gain as f32);
        let table = gains.map(|gain| (0..256).map(|v| level(v, gain)).collect());
        Self { image, table }
    }

    /// Encoded levels of a pixel.
    pub(super) fn at(&self, x: usize, y: usize) -> [f32; 3] {
        let p = self.image.at(x, y);
        [0, 1, 2].map(|c| self.table[c][usize::from(p[c])])
    }

    /// A place between pixel centres, in half-integer coordinates, the border repeated outside.
    pub(super) fn between(&self, x: f64, y: f64) -> [f32; 3] {
        let (w, h) = (self.image.width() as isize - 1, self.image.height() as isize - 1);
        bilinear(x, y, |x, y| self.at(x.clamp(0, w) as usize, y.clamp(0, h) as usize))
    }
}

/// Area average over whole blocks, in linear light, encoded again; a rest at the right and bottom is dropped.
pub(super) fn thumbnail(image: &Image<[u8; 3]>, factor: usize) -> Image<[f32; 3]> {
    let table: Vec<f32> = (0..256).map(|v| linear(v as f32)).collect();
    let (width, height) = (image.width() / factor, image.height() / factor);
    let mut small = Image::filled(width, height, [0.0; 3]);
    let share = 1.0 / (factor * factor) as f32;
    for y in 0..height {
        for x in 0..width {
            let mut sum = [0.0_f32; 3];
            for row in y * factor..(y + 1) * factor {
                for p in &image.row(row)[x * factor..(x + 1) * factor] {
                    (0..3).for_each(|c| sum[c] += table[usize::from(p[c])]);
                }
            }
            small.set(x, y, sum.map(|s| encoded(s * share)));
        }
    }
    small
}

/// A place between pixel centres, in half-integer coordinates, of the pixels that `at` gives.
pub(super) fn bilinear(x: f64, y: f64, at: impl Fn(isize, isize) -> [f32; 3]) -> [f32; 3] {
    let (x, y) = (x - 0.5, y - 0.5);
    let (x0, y0) = (x.floor(), y.floor());
    let (fx, fy) = ((x - x0) as f32, (y - y0) as f32);
    let (x0, y0) = (x0 as isize, y0 as isize);
    let [a, b, c, d] = [at(x0, y0), at(x0 + 1, y0), at(x0, y0 + 1), at(x0 + 1, y0 + 1)];
    [0, 1, 2].map(|i| {
        let top = a[i] + (b[i] - a[i]) * fx;
        let bottom = c[i] + (d[i] - c[i]) * fx;
        top + (bottom - top) * fy
    })
}
