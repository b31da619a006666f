//! What a tile sees: stretches of sub-samples, and how texture coordinates lie over each face that shows.

use super::Part;
use super::samples::{Patch, Samples};
use super::setup::{EdgeFace, Faces, Linear};
use super::visibility::{NONE, Nearest};
use crate::face::corners;
use crate::filter::{PLACES, level_of_footprint};
use crate::simd::{Lanes, Work};

/// Sub-samples looked up side by side.
pub(super) const SPAN: usize = PLACES;

/// Sub-samples of one row that see the same face.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    /// Row over the frame.
    pub(super) row: u32,
    /// First column over the frame.
    pub(super) column: u32,
    /// At most a tile's side.
    pub(super) length: u16,
    /// Which of the tile's surfaces.
    pub(super) surface: u32,
}

/// What the sub-samples of a tile see, row by row; nothing where there is nothing.
#[derive(Clone, Debug, Default)]
pub(super) struct Seen {
    pub(super) runs: Vec<Run>,
    pub(super) surfaces: Vec<Surface>,
    /// Of each candidate, its surface; kept for its memory alone.
    made: Vec<u32>,
}

/// What is drawn, ready to be drawn.
#[derive(Debug)]
pub(super) struct Geometry<'a> {
    pub(super) samples: &'a Samples,
    pub(super) parts: &'a [Part<'a>],
    pub(super) faces: &'a Faces,
}

/// Finding what a tile sees; `candidates` index the faces.
pub(super) struct Find<'a> {
    pub(super) geometry: &'a Geometry<'a>,
    pub(super) tile: usize,
    pub(super) candidates: &'a [u32],
    pub(super) nearest: &'a mut Nearest,
    pub(super) seen: &'a mut Seen,
}

impl Work for Find<'_> {
    #[inline(always)]
    fn run<E: Lanes>(self) {
        self.seen.runs.clear();
        self.seen.surfaces.clear();
        if self.candidates.is_empty() {
            return;
        }
        let faces = self.candidates.iter().map(|&index| self.geometry.faces.at(index));
        self.nearest.fill::<E>(self.geometry.samples, self.tile, faces);
        self.seen.collect(self.geometry, self.tile, self.candidates, self.nearest);
    }
}

impl Seen {
    /// Cuts the rows into runs; a face's surface is made when it first shows.
    #[inline(always)]
    fn collect(&mut self, geometry: &Geometry, tile: usize, candidates: &[u32], nearest: &Nearest) {
        let patch = geometry.samples.tile_patch(tile);
        self.made.clear();
        self.made.resize(candidates.len(), NONE);
        for row in patch.rows.clone() {
            let slots = nearest.slots(row);
            stretches(slots, |start, end| {
                let slot = slots[start];
                if slot != NONE
                    && let Some(surface) = self.surface(geometry, &patch, slot as usize, candidates[slot as usize])
                {
                    let column = (patch.columns.start + start) as u32;
                    self.runs.push(Run { row: row as u32, column, length: (end - start) as u16, surface });
                }
            });
        }
    }

    #[inline(always)]
    fn surface(&mut self, geometry: &Geometry, patch: &Patch, slot: usize, face: u32) -> Option<u32> {
        if self.made[slot] == NONE {
            self.surfaces.push(geometry.surface(face, patch)?);
            self.made[slot] = self.surfaces.len() as u32 - 1;
        }
        Some(self.made[slot])
    }
}

/// Visits the stretches of equal `slots`, each with its start and its end.
#[inline(always)]
fn stretches(slots: &[u32], mut visit: impl FnMut(usize, usize)) {
    let mut start = 0;
    for (first, here) in (0..).step_by(BITS).zip(slots.chunks(BITS)) {
        // Bit k says that another slot follows on the kth: found many at a time, and gone through without guesses.
        let mut ends = 0_u32;
        for (k, (a, b)) in here.iter().zip(&slots[first + 1..]).enumerate() {
            ends |= u32::from(a != b) << k;
        }
        while ends != 0 {
            let end = first + ends.trailing_zeros() as usize + 1;
            visit(start, end);
            start = end;
            ends &= ends - 1;
        }
    }
    if start < slots.len() {
        visit(start, slots.len());
    }
}

/// Slots whose ends are found together.
const BITS: usize = u32::BITS as usize;

impl Geometry<'_> {
    /// Also marks what a face needs of its part's texture.
    fn surface(&self, index: u32, patch: &Patch) -> Option<Surface> {
        let face = self.faces.at(index);
        let part = &self.parts[face.part as usize];
        let [width, height] = part.atlas_size.map(|size| size as f64);
        let texels = corners(part.mesh, face.face as usize)?.uvs.map(|uv| [uv.x * width, uv.y * height]);
        let is_coated = part.coats.is_some_and(|coats| coats.cover(face.face as usize));
        let surface = Surface { is_coated, ..Surface::new(face, &texels, self.samples.per_side()) };
        if !is_coated {
            let bound = |pick: fn(f64, f64) -> f64, k: usize| pick(pick(texels[0][k], texels[1][k]), texels[2][k]);
            let low = [bound(f64::min, 0), bound(f64::min, 1)];
            let high = [bound(f64::max, 0), bound(f64::max, 1)];
            part.wanted.mark(low, high, surface.coarsest(face, self.samples, patch).ceil() as usize);
        }
        Some(surface)
    }
}

/// Texture coordinates over a face: `origin + [u, v](x, y) / s(x, y)` in texels, all linear.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface {
    /// Which part it belongs to, and its face there.
    pub(super) part: u32,
    pub(super) face: u32,
    /// Whether it carries a material.
    pub(super) is_coated: bool,
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

/// What sub-samples side by side look up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    /// Columns in texels of level 0.
    pub(super) x: [f32; SPAN],
    /// Rows in texels of level 0.
    pub(super) y: [f32; SPAN],
    /// Squared sides of their footprints, in texels.
    pub(super) footprint: [f32; SPAN],
}

/// Squared length of two numerators at `t`.
#[inline(always)]
fn squared([a, b]: &[[f64; 2]; 2], t: f64) -> f64 {
    let (a, b) = (a[0] * t + a[1], b[0] * t + b[1]);
    a * a + b * b
}

impl Surface {
    /// Of a face whose corners have the given texture coordinates, in texels.
    fn new(face: &EdgeFace, texels: &[[f64; 2]; 3], per_side: usize) -> Self {
        let [e0, e1, e2] = &face.edges;
        let (mut u, mut v, mut s) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        for k in 0..3 {
            // Relative to the first corner: small numbers lose less.
            u[k] = (texels[1][0] - texels[0][0]) * e1[k] + (texels[2][0] - texels[0][0]) * e2[k];
            v[k] = (texels[1][1] - texels[0][1]) * e1[k] + (texels[2][1] - texels[0][1]) * e2[k];
            s[k] = e0[k] + e1[k] + e2[k];
        }
        let dx = |l: &Linear| [l[0] * s[1] - s[0] * l[1], l[0] * s[2] - s[0] * l[2]];
        let dy = |l: &Linear| [l[1] * s[0] - s[1] * l[0], l[1] * s[2] - s[1] * l[2]];
        Self {
            part: face.part,
            face: face.face,
            is_coated: false,
            origin: texels[0],
            u,
            v,
            s,
            dx: [dx(&u), dx(&v)],
            dy: [dy(&u), dy(&v)],
            spacing_squared: 1.0 / (per_side * per_side) as f64,
        }
    }

    /// No sub-sample of `patch` that sees the face has a coarser mip level. The footprint is a quotient: its numerator, the
    /// square of something linear, is largest at an end; its denominator `s = 1 / (depth · inverse_det)` smallest where the
    /// face is farthest. Infinite for a face that reaches behind the camera, under a lens too if it is out of sight.
    fn coarsest(&self, face: &EdgeFace, samples: &Samples, patch: &Patch) -> f32 {
        let n = samples.per_side() as f64;
        let ends = |k: usize, range: &std::ops::Range<usize>| match samples.is_regular() {
            true => [face.low[k].max(range.start as f64 / n), face.high[k].min(range.end as f64 / n)],
            false => [face.low[k], face.high[k]],
        };
        let largest =
            |numerators: &[[f64; 2]; 2], ends: [f64; 2]| squared(numerators, ends[0]).max(squared(numerators, ends[1]));
        let longest = largest(&self.dx, ends(1, &patch.rows)).max(largest(&self.dy, ends(0, &patch.columns)));
        let smallest = (face.farthest / face.inverse_det).powi(2);
        let bound = longest / (smallest * smallest) * self.spacing_squared * (1.0 + 1e-6);
        // What is not a number may be anything.
        if bound.is_nan() { f32::INFINITY } else { level_of_footprint(bound as f32) }
    }

    /// What the sub-samples at ideal pixels (`xs`, `ys`) look up.
    #[inline(always)]
    pub(super) fn look_up(&self, xs: &[f64; SPAN], ys: &[f64; SPAN]) -> Span {
        let mut span = Span { x: [0.0; SPAN], y: [0.0; SPAN], footprint: [0.0; SPAN] };
        for k in 0..SPAN {
            let (x, y) = (xs[k], ys[k]);
            let at = |l: &Linear| l[0] * x + (l[1] * y + l[2]);
            let inverse = 1.0 / at(&self.s);
            let (dx, dy) = (squared(&self.dx, y), squared(&self.dy, x));
            let longest = if dx > dy { dx } else { dy };
            let inverse_squared = inverse * inverse;
            span.footprint[k] = (longest * inverse_squared * inverse_squared * self.spacing_squared) as f32;
            span.x[k] = (self.origin[0] + at(&self.u) * inverse) as f32;
            span.y[k] = (self.origin[1] + at(&self.v) * inverse) as f32;
        }
        span
    }
}
