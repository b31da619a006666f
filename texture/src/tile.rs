//! Where on a tile a point of a chart lies, and which texels of the tile a footprint covers.
//!
//! A chart is taken to be unfolded without stretch: one scale per chart,
//! `world units per texel = √(Σ area of its faces / Σ area they cover in the atlas)`, turns texture
//! coordinates into lengths, lengths into the tile's texels. All charts share the atlas' origin, so a
//! pattern breaks off where charts part. The tile's columns run along +u; its rows along +v where the chart
//! is seen unmirrored in the atlas, against it otherwise: a material cannot be turned over.
//!
//! A footprint is a square box over texels that are constant each: of side 1 (and of no less) that is
//! bilinear interpolation. Beyond three texels the box sees cells of 2ⁿ texels, each by its middle texel, so
//! that at most 4 × 4 are looked up; a box as large as the tile sees 4 × 4 spread over it.

use geometry::TexturedMesh;
use std::collections::BTreeMap;

/// Texels that a footprint looks up at most, along a side.
const MOST_ALONG: usize = 4;

/// Coordinates beyond are nowhere; of these, a quarter texel is told apart.
const FARTHEST: f64 = (1u64 << 50) as f64;

/// World units per atlas texel of each face by that of its chart; 0 where a chart has no area.
pub fn texel_sizes(mesh: &TexturedMesh) -> Vec<f64> {
    let mut areas: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
    for (face, &chart) in mesh.face_charts.iter().enumerate().take(mesh.mesh.faces.len()) {
        let [surface, covered] = face_areas(mesh, face).unwrap_or_default();
        if surface.is_finite() && covered.is_finite() {
            let sums = areas.entry(chart).or_default();
            sums[0] += surface;
            sums[1] += covered.abs();
        }
    }
    let size = |chart: &u32| {
        let [surface, covered] = areas.get(chart).copied().unwrap_or_default();
        Some((surface / covered).sqrt()).filter(|size| size.is_finite()).unwrap_or(0.0)
    };
    mesh.face_charts.iter().map(size).collect()
}

/// Whether a face is seen mirrored in the atlas: clockwise, though its outside is shown.
pub fn is_mirrored(mesh: &TexturedMesh, face: usize) -> bool {
    face_areas(mesh, face).is_some_and(|[_, covered]| covered > 0.0)
}

/// Twice the area of a face, in world units and in texels of the atlas; the latter is positive if clockwise as
/// seen in the atlas, with v down. `None` where an index leads nowhere.
fn face_areas(mesh: &TexturedMesh, face: usize) -> Option<[f64; 2]> {
    let corners = mesh.mesh.faces.get(face)?.map(|v| v as usize);
    let [Some(a), Some(b), Some(c)] = corners.map(|v| mesh.uvs.get(v)) else { return None };
    if corners.iter().any(|&v| v >= mesh.mesh.positions.len()) {
        return None;
    }
    let [width, height] = mesh.atlas_size.map(|side| side as f64);
    Some([mesh.mesh.face_area_vector(face).norm(), (b - a).perp(&(c - a)) * width * height])
}

/// Visits the texels of a tile of `size` (columns, rows) under a box of `side` texels about (`column`, `row`),
/// outer corner of the first texel (0, 0), the tile continuing itself: texel (`y · width + x`) and weight; weights
/// are ≥ 0 and sum to 1. What is not a number is the first texel.
pub fn texels_under(column: f64, row: f64, side: f64, size: [usize; 2], mut visit: impl FnMut(usize, f32)) {
    let (columns, rows) = (Span::new(column, side, size[0]), Span::new(row, side, size[1]));
    for (y, v) in rows.entries() {
        for (x, u) in columns.entries() {
            visit(y * size[0] + x, (u * v) as f32);
        }
    }
}

/// Cells of one axis under a box.
struct Span {
    cells: [(usize, f64); MOST_ALONG],
    count: usize,
}

impl Span {
    fn new(center: f64, side: f64, size: usize) -> Self {
        let side = side.max(1.0);
        if size <= 1 || center.is_nan() || center.abs() > FARTHEST {
            return Self { cells: [(0, 1.0); MOST_ALONG], count: 1 };
        }
        if side >= size.max(MOST_ALONG) as f64 {
            return Self::whole(size);
        }
        let mut cell = 1;
        while side > (MOST_ALONG - 1) as f64 * cell as f64 {
            cell *= 2;
        }
        Self::under(center, side, cell, size)
    }

    /// The tile's average, as far as four texels tell.
    fn whole(size: usize) -> Self {
        let share = 1.0 / MOST_ALONG as f64;
        let middle = |k: usize| ((2 * k + 1) * size / (2 * MOST_ALONG), share);
        Self { cells: std::array::from_fn(middle), count: MOST_ALONG }
    }

    /// A box over cells of `cell` texels, of which it meets at most four.
    fn under(center: f64, side: f64, cell: usize, size: usize) -> Self {
        let width = cell as f64;
        let (low, high) = ((center - 0.5 * side) / width, (center + 0.5 * side) / width);
        let first = low.floor();
        let mut span = Self { cells: [(0, 0.0); MOST_ALONG], count: 0 };
        while span.count < MOST_ALONG {
            let start = first + span.count as f64;
            let share = ((high.min(start + 1.0) - low.max(start)) / (high - low)).max(0.0);
            if share == 0.0 && span.count > 0 {
                break;
            }
            let texel = (start as i64 * cell as i64 + cell as i64 / 2).rem_euclid(size as i64);
            span.cells[span.count] = (texel as usize, share);
            span.count += 1;
        }
        span
    }

    fn entries(&self) -> impl Iterator<Item = (usize, f64)> {
        self.cells.iter().copied().take(self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Mesh;
    use nalgebra::{Point2, Point3};

    fn weights(column: f64, row: f64, side: f64, size: [usize; 2]) -> Vec<f64> {
        let mut sums = vec![0.0; size[0] * size[1]];
        texels_under(column, row, side, size, |texel, weight| sums[texel] += f64::from(weight));
        sums
    }

    #[test]
    fn a_box_of_one_texel_is_bilinear() {
        let found = weights(2.25, 1.5, 0.1, [4, 3]);
        // Three quarters of the way from the centre at 1.5 to that at 2.5.
        assert!((found[4 + 1] - 0.25).abs() < 1e-6 && (found[4 + 2] - 0.75).abs() < 1e-6, "{found:?}");
        assert_eq!(found.iter().filter(|w| **w > 0.0).count(), 2);
    }

    #[test]
    fn weights_sum_to_one_and_are_few_at_any_place_and_size() {
        for (i, size) in [[1, 1], [2, 2], [3, 5], [32, 32], [64, 7]].into_iter().enumerate() {
            for k in 0..200 {
                let (column, row) = (k as f64 * 0.713 - 70.0, i as f64 - k as f64 * 1.31);
                let side = 1.04_f64.powi(k);
                let (mut sum, mut count) = (0.0, 0);
                texels_under(column, row, side, size, |texel, weight| {
                    assert!(texel < size[0] * size[1] && weight >= 0.0);
                    sum += weight;
                    count += 1;
                });
                assert!((sum - 1.0).abs() < 1e-5 && count <= 16, "{sum} {count} side {side} of {size:?}");
            }
        }
    }

    #[test]
    fn the_tile_continues_itself() {
        for (side, k) in [(1.0, 3.0), (2.4, -2.0), (9.0, 5.0), (100.0, 1.0)] {
            // A tile of 32: cells of 2ⁿ continue as well.
            let (here, there) =
                (weights(1.3, 30.9, side, [32, 32]), weights(1.3 + 32.0 * k, 30.9 - 32.0, side, [32, 32]));
            assert!(here.iter().zip(&there).all(|(a, b)| (a - b).abs() < 1e-5), "{side}");
        }
        let edge = weights(0.0, 0.5, 1.0, [8, 1]);
        assert_eq!((edge[0], edge[7]), (0.5, 0.5));
    }

    #[test]
    fn nothing_panics_where_there_is_no_place() {
        for center in [f64::NAN, f64::INFINITY, -1e300, 1e17] {
            for side in [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e300] {
                assert!((weights(center, center, side, [5, 6]).iter().sum::<f64>() - 1.0).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn lengths_come_from_the_surface_whatever_the_charts_density() {
        let square = |size: f64, uv: f64, mirrored: bool| {
            let corner = |x: f64, y: f64| Point3::new(size * x, size * y, 0.0);
            let positions = vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
            let flip = if mirrored { 1.0 } else { -1.0 };
            let uvs = positions.iter().map(|p| Point2::new(uv * p.x / size, 0.5 + 0.5 * flip * uv * p.y / size));
            TexturedMesh {
                uvs: uvs.collect(),
                mesh: Mesh { positions, faces: vec![[0, 1, 2], [0, 2, 3]] },
                face_charts: vec![0, 0],
                atlas_size: [100, 200],
            }
        };
        let mesh = square(3.0, 0.5, false);
        assert!((texel_sizes(&mesh)[1] - 3.0 / 50.0).abs() < 1e-12);
        assert!(!is_mirrored(&mesh, 0) && is_mirrored(&square(1.0, 0.3, true), 1));
        let flat = square(1.0, 0.0, false);
        assert_eq!(texel_sizes(&flat), [0.0, 0.0]);
    }
}
