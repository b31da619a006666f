//! From sub-samples to a pixel: where samples lie, and how they are averaged.

use crate::filter::Channel;
use capture::Camera;
use nalgebra::Point2;

/// The pixel coordinates of sub-sample (`column`, `row`), counted over the whole frame.
#[inline]
pub(crate) fn sample_position(column: usize, row: usize, per_side: usize) -> Point2<f64> {
    let step = 1.0 / per_side as f64;
    Point2::new((column as f64 + 0.5) * step, (row as f64 + 0.5) * step)
}

/// The same on the plane of an ideal pinhole, or `None` where the lens has no inverse.
pub(crate) fn ideal_position(camera: &Camera, column: usize, row: usize, per_side: usize) -> Option<Point2<f64>> {
    camera.intrinsics.undistort_pixel(sample_position(column, row, per_side))
}

/// The covered sub-samples of one pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Accumulator {
    sum: [f32; 3],
    covered: usize,
}

impl Accumulator {
    /// Adds the colour of a covered sub-sample.
    #[inline]
    pub(crate) fn add(&mut self, colour: [f32; 3]) {
        for c in 0..3 {
            self.sum[c] += colour[c];
        }
        self.covered += 1;
    }

    /// Whether no sub-sample is covered.
    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        self.covered == 0
    }

    /// The pixel out of `samples` sub-samples; the only place where anything is clamped or rounded.
    #[inline]
    pub(crate) fn finish(&self, samples: usize, background: Option<[u8; 3]>) -> [u8; 4] {
        let Some(background) = background else {
            return self.transparent(samples);
        };
        let open = (samples - self.covered.min(samples)) as f32;
        let scale = 1.0 / samples as f32;
        let mut pixel = [255; 4];
        for c in 0..3 {
            pixel[c] = ((self.sum[c] + open * f32::from(background[c])) * scale).rounded();
        }
        pixel
    }

    fn transparent(&self, samples: usize) -> [u8; 4] {
        if self.covered == 0 {
            return [0; 4];
        }
        let scale = 1.0 / self.covered as f32;
        let [r, g, b] = self.sum;
        let alpha = 255.0 * self.covered as f32 / samples as f32;
        [(r * scale).rounded(), (g * scale).rounded(), (b * scale).rounded(), alpha.rounded()]
    }
}
