//! Two pictures beside each other, of one frame.

use capture::{Camera, Image};
use std::ops::Range;

/// The column where the right picture begins, for a divider at this share of the width; each keeps a column where there are
/// two.
pub fn column(divider: f64, width: usize) -> usize {
    let share = if divider.is_finite() { divider.clamp(0.0, 1.0) } else { 0.5 };
    ((share * width as f64).round() as usize).clamp(width.min(1), width.saturating_sub(1).max(width.min(1)))
}

/// The camera of these columns of a frame: every pixel sees what it saw.
pub fn cropped(camera: &Camera, columns: &Range<usize>) -> Camera {
    let mut cropped = *camera;
    cropped.intrinsics.cx -= columns.start as f64;
    cropped.intrinsics.width = columns.len();
    cropped
}

/// Pictures of one height beside each other.
pub fn joined(left: &Image<[u8; 4]>, right: &Image<[u8; 4]>) -> Image<[u8; 4]> {
    let (width, height) = (left.width() + right.width(), left.height().min(right.height()));
    let mut pixels = Vec::with_capacity(width * height);
    for y in 0..height {
        pixels.extend_from_slice(left.row(y));
        pixels.extend_from_slice(right.row(y));
    }
    Image::from_pixels(width, height, pixels).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_sides_keep_a_column() {
        assert_eq!([0.0, 0.25, 1.0, -3.0, f64::NAN].map(|at| column(at, 100)), [1, 25, 99, 1, 50]);
        assert_eq!([0, 1, 2].map(|width| column(0.9, width)), [0, 1, 1]);
    }

    #[test]
    fn rows_stay_rows() {
        let left = Image::from_pixels(1, 2, vec![[1; 4], [2; 4]]).unwrap();
        let right = Image::from_pixels(2, 2, vec![[3; 4], [4; 4], [5; 4], [6; 4]]).unwrap();
        let joined = joined(&left, &right);
        assert_eq!(joined.pixels(), [[1; 4], [3; 4], [4; 4], [2; 4], [5; 4], [6; 4]]);
    }
}
