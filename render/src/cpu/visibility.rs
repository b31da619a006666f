//! The nearest face of each sub-sample of a tile, and what to look up in the texture there.

use super::samples::{Patch, Samples};
use super::setup::{EdgeFace, Linear};
use crate::face::corners;
use crate::filter::level_of_footprint;
use geometry::TexturedMesh;

/// No face.
const NONE: u32 = u32::MAX;

/// What a visible sub-sample looks up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fragment {
    /// Column in texels of level 0.
    pub(super) x: f32,
    /// Row in texels of level 0.
    pub(super) y: f32,
    /// Fractional mip level.
    pub(super) level: f32,
}

/// The visible sub-samples of a tile, pixel by pixel.
#[derive(Debug, Default)]
pub(super) struct Fragments {
    /// Visible sub-samples of each pixel of the tile, row by row; empty where the tile sees nothing.
    pub(super) counts: Vec<u16>,
    /// Those sub-samples, in the order of the pixels.
    pub(super) fragments: Vec<Fragment>,
    level: f32,
}

impl Fragments {
    /// The coarsest mip level looked up.
    pub(super) fn top_level(&self) -> usize {
        self.level.ceil() as usize
    }
}

/// The visible sub-samples of `tile`; `candidates` index `faces`.
pub(super) fn tile(
    samples: &Samples,
    tile: usize,
    candidates: &[u32],
    faces: &[EdgeFace],
    mesh: &TexturedMesh,
    atlas: [usize; 2],
) -> Fragments {
    if candidates.is_empty() {
        return Fragments::default();
    }
    let mut nearest = Nearest::new(samples.tile_patch(tile));
    for &index in candidates {
        let face = &faces[index as usize];
        let patch = nearest.patch.clone();
        samples.visit(&patch, face, |part| {
            if samples.is_regular() {
                nearest.cover_grid(&part, face, index, samples);
            } else {
                nearest.cover(&part, face, index, samples);
            }
        });
    }
    nearest.fragments(samples, tile, faces, mesh, atlas)
}

/// Depth and face buffer of a tile.
struct Nearest {
    patch: Patch,
    /// 1 / depth.
    inverse_depths: Vec<f64>,
    faces: Vec<u32>,
}

/// The smallest value of an edge function that is inside. A sub-sample exactly on an edge goes to the
/// face on one side of it: top-left rule, in signs that the two faces never share.
fn threshold(edge: &Linear) -> f64 {
    let owned = edge[0] > 0.0 || (edge[0] == 0.0 && edge[1] > 0.0);
    if owned { 0.0 } else { f64::from_bits(1) }
}

impl Nearest {
    fn new(patch: Patch) -> Self {
        let samples = patch.columns.len() * patch.rows.len();
        Self { patch, inverse_depths: vec![0.0; samples], faces: vec![NONE; samples] }
    }

    /// Start of a row of `part` in the buffers.
    fn offset(&self, part: &Patch, row: usize) -> usize {
        (row - self.patch.rows.start) * self.patch.columns.len() + part.columns.start - self.patch.columns.start
    }

    /// Tests sub-samples on a regular grid.
    fn cover_grid(&mut self, part: &Patch, face: &EdgeFace, index: u32, samples: &Samples) {
        let [e0, e1, e2] = &face.edges;
        let [t0, t1, t2] = [threshold(e0), threshold(e1), threshold(e2)];
        let step = 1.0 / samples.per_side() as f64;
        let width = part.columns.len();
        for row in part.rows.clone() {
            let y = (row as f64 + 0.5) * step;
            let [r0, r1, r2] = [e0, e1, e2].map(|e| e[1] * y + e[2]);
            let offset = self.offset(part, row);
            let depths = &mut self.inverse_depths[offset..offset + width];
            let faces = &mut self.faces[offset..offset + width];
            for ((column, depth), nearest) in part.columns.clone().zip(depths).zip(faces) {
                let x = (column as f64 + 0.5) * step;
                let (a, b, c) = (e0[0] * x + r0, e1[0] * x + r1, e2[0] * x + r2);
                let inverse_depth = (a + b + c) * face.inverse_det;
                if (a >= t0) & (b >= t1) & (c >= t2) & (inverse_depth > *depth) {
                    (*depth, *nearest) = (inverse_depth, index);
                }
            }
        }
    }

    /// Tests sub-samples that lie anywhere.
    fn cover(&mut self, part: &Patch, face: &EdgeFace, index: u32, samples: &Samples) {
        let thresholds = face.edges.map(|e| threshold(&e));
        for row in part.rows.clone() {
            let offset = self.offset(part, row);
            for (i, column) in part.columns.clone().enumerate() {
                let [x, y] = samples.ideal(column, row);
                let weights = face.edges.map(|e| e[0] * x + (e[1] * y + e[2]));
                let inverse_depth = (weights[0] + weights[1] + weights[2]) * face.inverse_det;
                let inside = (0..3).all(|k| weights[k] >= thresholds[k]);
                if inside && inverse_depth > self.inverse_depths[offset + i] {
                    self.inverse_depths[offset + i] = inverse_depth;
                    self.faces[offset + i] = index;
                }
            }
        }
    }

    /// Collects what is visible, pixel by pixel.
    fn fragments(
        &self,
        samples: &Samples,
        tile: usize,
        faces: &[EdgeFace],
        mesh: &TexturedMesh,
        atlas: [usize; 2],
    ) -> Fragments {
        let n = samples.per_side();
        let (columns, rows) = samples.tile_pixels(tile);
        let mut out = Fragments {
            counts: Vec::with_capacity(columns.len() * rows.len()),
            fragments: Vec::with_capacity(self.faces.len()),
            level: 0.0,
        };
        let mut surface = Surface::none();
        for (py, px) in rows.flat_map(|y| columns.clone().map(move |x| (y, x))) {
            let before = out.fragments.len();
            for row in n * py..n * (py + 1) {
                let offset = (row - self.patch.rows.start) * self.patch.columns.len();
                for column in n * px..n * (px + 1) {
                    let index = self.faces[offset + column - self.patch.columns.start];
                    if index == NONE {
                        continue;
                    }
                    if surface.index != index {
                        surface = Surface::new(index, &faces[index as usize], mesh, atlas, n);
                    }
                    let fragment = surface.fragment(samples.ideal(column, row));
                    out.level = out.level.max(fragment.level);
                    out.fragments.push(fragment);
                }
            }
            out.counts.push((out.fragments.len() - before) as u16);
        }
        out
    }
}

/// Texture coordinates over a face: `origin + [u, v](x, y) / s(x, y)` in texels, all linear.
struct Surface {
    index: u32,
    origin: [f64; 2],
    u: Linear,
    v: Linear,
    s: Linear,
    /// Numerators of ∂u/∂x and ∂v/∂x over s², as slope and offset in y: the quotient rule leaves no x.
    dx: [[f64; 2]; 2],
    /// Numerators of ∂u/∂y and ∂v/∂y over s², as slope and offset in x.
    dy: [[f64; 2]; 2],
    /// Squared distance of sub-samples in pixels.
    spacing_squared: f64,
}

impl Surface {
    fn none() -> Self {
        let (zero, pair) = ([0.0; 3], [[0.0; 2]; 2]);
        Self { index: NONE, origin: [0.0; 2], u: zero, v: zero, s: zero, dx: pair, dy: pair, spacing_squared: 0.0 }
    }

    fn new(index: u32, face: &EdgeFace, mesh: &TexturedMesh, atlas: [usize; 2], per_side: usize) -> Self {
        let Some(corners) = corners(mesh, face.face as usize) else { return Self::none() };
        let texels = corners.uvs.map(|uv| [uv.x * atlas[0] as f64, uv.y * atlas[1] as f64]);
        let [e0, e1, e2] = &face.edges;
        let s = [0, 1, 2].map(|k| e0[k] + e1[k] + e2[k]);
        // Relative to the first corner: small numbers lose less.
        let along = |axis: usize| {
            let (p, q) = (texels[1][axis] - texels[0][axis], texels[2][axis] - texels[0][axis]);
            [0, 1, 2].map(|k| p * e1[k] + q * e2[k])
        };
        let (u, v) = (along(0), along(1));
        let dx = [u, v].map(|l: Linear| [l[0] * s[1] - s[0] * l[1], l[0] * s[2] - s[0] * l[2]]);
        let dy = [u, v].map(|l: Linear| [l[1] * s[0] - s[1] * l[0], l[1] * s[2] - s[1] * l[2]]);
        let spacing_squared = 1.0 / (per_side * per_side) as f64;
        Self { index, origin: texels[0], u, v, s, dx, dy, spacing_squared }
    }

    fn fragment(&self, [x, y]: [f64; 2]) -> Fragment {
        let at = |l: &Linear| l[0] * x + (l[1] * y + l[2]);
        let inverse = 1.0 / at(&self.s);
        let squared = |[a, b]: &[[f64; 2]; 2], t: f64| {
            let (a, b) = (a[0] * t + a[1], b[0] * t + b[1]);
            a * a + b * b
        };
        let longest = squared(&self.dx, y).max(squared(&self.dy, x));
        let inverse_squared = inverse * inverse;
        let footprint = longest * inverse_squared * inverse_squared * self.spacing_squared;
        Fragment {
            x: (self.origin[0] + at(&self.u) * inverse) as f32,
            y: (self.origin[1] + at(&self.v) * inverse) as f32,
            level: level_of_footprint(footprint as f32),
        }
    }
}
