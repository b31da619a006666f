//! An image is a size and one contiguous row-major buffer of a named sample type.

/// Row-major pixels. `Image<[u8; 3]>` is 8-bit sRGB, `Image<u8>` a matte (255 = object),
/// `Image<[f32; 3]>` intensities in 0..=255 on the same encoded scale.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image<P> {
    width: usize,
    height: usize,
    pixels: Vec<P>,
}

impl<P: Copy> Image<P> {
    /// An image of `width × height` copies of `value`.
    pub fn filled(width: usize, height: usize, value: P) -> Self {
        Self { width, height, pixels: vec![value; width * height] }
    }

    /// Wraps `pixels`, or `None` where their number is not `width × height`.
    pub fn from_pixels(width: usize, height: usize, pixels: Vec<P>) -> Option<Self> {
        (pixels.len() == width * height).then_some(Self { width, height, pixels })
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The pixel in column `x`, row `y`. Panics outside the image.
    pub fn at(&self, x: usize, y: usize) -> P {
        debug_assert!(x < self.width, "column {x} of {}", self.width);
        self.pixels[y * self.width + x]
    }

    /// The pixel nearest to (`x`, `y`) inside the image.
    pub fn at_clamped(&self, x: isize, y: isize) -> P {
        let x = x.clamp(0, self.width as isize - 1) as usize;
        let y = y.clamp(0, self.height as isize - 1) as usize;
        self.at(x, y)
    }

    /// Overwrites the pixel in column `x`, row `y`. Panics outside the image.
    pub fn set(&mut self, x: usize, y: usize, value: P) {
        debug_assert!(x < self.width, "column {x} of {}", self.width);
        self.pixels[y * self.width + x] = value;
    }

    /// Row `y`, left to right.
    pub fn row(&self, y: usize) -> &[P] {
        &self.pixels[y * self.width..(y + 1) * self.width]
    }

    /// All pixels, row by row.
    pub fn pixels(&self) -> &[P] {
        &self.pixels
    }

    /// All pixels, row by row, to overwrite.
    pub fn pixels_mut(&mut self) -> &mut [P] {
        &mut self.pixels
    }

    /// The same size with every pixel replaced by `f` of it.
    pub fn map<Q>(&self, f: impl FnMut(P) -> Q) -> Image<Q> {
        Image { width: self.width, height: self.height, pixels: self.pixels.iter().copied().map(f).collect() }
    }
}
