//! Whether a picture of the set without the object shows the set: held against the border of the frames of a camera that
//! stands still, where the object never is.

use super::cluster;
use crate::Image;
use rayon::prelude::*;

/// Parts of the shorter side that are border.
const BORDER: usize = 25;

/// Only every so many pixels are looked at, each way.
const STEP: usize = 3;

/// Levels of 8 bits by which a plate of the same exposure may be off: noise, a codec, and what the object's own light and
/// shadow do to the room.
const TOLERANCE: f32 = 24.0;

/// Places that change in no frame, below which nothing can be said.
const LEAST_PLACES: usize = 64;

/// Whether a pixel of a picture of this size lies where the object never is.
pub(super) fn is_at_border([width, height]: [usize; 2], x: usize, y: usize) -> bool {
    let ring = (width.min(height) / BORDER).max(1);
    x < ring || y < ring || x + ring >= width || y + ring >= height
}

/// The share of what stays the same at the border of `frames` that `plate` (of their size) shows as well, 0 to 1. A table
/// may reach out of the frame below and be no part of the plate; a set shows the rest. `None` where too little stays the
/// same, or where sizes differ.
pub fn clean_plate_likeness(plate: &Image<[u8; 3]>, frames: &[Image<[u8; 3]>]) -> Option<f64> {
    let (width, height) = (plate.width(), plate.height());
    if frames.iter().any(|frame| (frame.width(), frame.height()) != (width, height)) {
        return None;
    }
    let agrees = |x: usize, y: usize| {
        let samples: Vec<[f32; 3]> = frames.iter().map(|frame| frame.at(x, y).map(f32::from)).collect();
        let usual = cluster::densest(&samples).filter(|c| 4 * usize::from(c.support) > 3 * samples.len())?.colour;
        let shown = plate.at(x, y).map(f32::from);
        Some((0..3).all(|c| (usual[c] - shown[c]).abs() <= TOLERANCE))
    };
    let row = |y: usize| {
        let found: Vec<bool> = (0..width)
            .step_by(STEP)
            .filter(|&x| is_at_border([width, height], x, y))
            .filter_map(|x| agrees(x, y))
            .collect();
        (found.iter().filter(|agrees| **agrees).count(), found.len())
    };
    let rows: Vec<(usize, usize)> = (0..height).into_par_iter().step_by(STEP).map(row).collect();
    let (alike, all) = rows.into_iter().fold((0, 0), |sum, row| (sum.0 + row.0, sum.1 + row.1));
    (all >= LEAST_PLACES).then(|| alike as f64 / all as f64)
}
