//! Small materials for tests.

use capture::btf::{Btf, Encoding};
use nalgebra::Vector3;

/// sRGB samples, (view, light, y, x, channel), of `[width, height]` texels under directions that are views and lights alike.
pub(super) fn btf([width, height]: [usize; 2], directions: &[Vector3<f64>], samples: Vec<f32>) -> Btf {
    Btf {
        name: "made".into(),
        views: directions.to_vec(),
        lights: directions.to_vec(),
        width,
        height,
        encoding: Encoding::Srgb,
        exposure: 1.0,
        includes_cosine: true,
        texel_pitch_mm: None,
        samples,
        measured: Vec::new(),
    }
}
