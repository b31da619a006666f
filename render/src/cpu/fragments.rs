//! What the visible sub-samples of a tile look up in the texture.

use super::samples::Samples;
use super::setup::{EdgeFace, Linear};
use super::visibility::{NONE, Nearest};
use crate::face::corners;
use crate::filter::level_of_footprint;
use crate::material::Coats;
use geometry::TexturedMesh;

/// What a visible sub-sample looks up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fragment {
    /// Column in texels of level 0.
    pub(super) x: f32,
    /// Row in texels of level 0.
    pub(super) y: f32,
    /// Fractional mip level; of what carries a material, the squared side of its footprint in texels.
    pub(super) level: f32,
}

/// The visible sub-samples of a tile, pixel by pixel.
#[derive(Clone, Debug, Default)]
pub(super) struct Fragments {
    /// Visible sub-samples of each pixel of the tile, row by row; empty where the tile sees nothing.
    pub(super) counts: Vec<u16>,
    /// Those sub-samples, in the order of the pixels.
    pub(super) fragments: Vec<Fragment>,
    /// Their faces, where anything carries a material; [`NONE`] where the face itself does not.
    pub(super) coated: Vec<u32>,
    level: f32,
}

/// What is drawn, ready to be drawn.
#[derive(Debug)]
pub(super) struct Scene<'a> {
    pub(super) samples: &'a Samples,
    pub(super) mesh: &'a TexturedMesh,
    pub(super) faces: &'a [EdgeFace],
    /// Texels across and down.
    pub(super) atlas_size: [usize; 2],
    /// What lies on the mesh.
    pub(super) coats: Option<&'a Coats<'a>>,
}

impl Fragments {
    /// The coarsest mip level looked up.
    pub(super) fn top_level(&self) -> usize {
        self.level.ceil() as usize
    }

    /// Finds the visible sub-samples of `tile`; `candidates` index the scene's faces.
    pub(super) fn find(&mut self, scene: &Scene, tile: usize, candidates: &[u32], nearest: &mut Nearest) {
        self.counts.clear();
        self.fragments.clear();
        self.coated.clear();
        self.level = 0.0;
        if candidates.is_empty() {
            return;
        }
        nearest.fill(scene.samples, tile, candidates.iter().map(|&index| &scene.faces[index as usize]));
        self.collect(scene, tile, candidates, nearest);
    }

    /// Walks pixel by pixel; a face's surface is made when it first shows.
    fn collect(&mut self, scene: &Scene, tile: usize, candidates: &[u32], nearest: &Nearest) {
        let n = scene.samples.per_side();
        let (columns, rows) = scene.samples.tile_pixels(tile);
        let mut made = vec![NONE; candidates.len()];
        let mut surfaces: Vec<Surface> = Vec::new();
        for (py, px) in rows.flat_map(|y| columns.clone().map(move |x| (y, x))) {
            let before = self.fragments.len();
            for row in n * py..n * (py + 1) {
                let columns = n * px..n * (px + 1);
                for (column, &slot) in columns.clone().zip(nearest.slots(columns, row)) {
                    if slot == NONE {
                        continue;
                    }
                    let slot = slot as usize;
                    if made[slot] == NONE {
                        let Some(surface) = scene.surface(candidates[slot]) else { continue };
                        made[slot] = surfaces.len() as u32;
                        surfaces.push(surface);
                    }
                    let surface = &surfaces[made[slot] as usize];
                    let mut fragment = surface.fragment(scene.samples.ideal(column, row));
                    if scene.coats.is_some() {
                        self.coated.push(surface.coated);
                    }
                    if surface.coated == NONE {
                        fragment.level = level_of_footprint(fragment.level);
                        self.level = self.level.max(fragment.level);
                    }
                    self.fragments.push(fragment);
                }
            }
            self.counts.push((self.fragments.len() - before) as u16);
        }
    }
}

impl Scene<'_> {
    fn surface(&self, index: u32) -> Option<Surface> {
        let face = &self.faces[index as usize];
        let [width, height] = self.atlas_size.map(|size| size as f64);
        let texels = corners(self.mesh, face.face as usize)?.uvs.map(|uv| [uv.x * width, uv.y * height]);
        let is_coated = self.coats.is_some_and(|coats| coats.cover(face.face as usize));
        let coated = if is_coated { face.face } else { NONE };
        Some(Surface { coated, ..Surface::new(face, &texels, self.samples.per_side()) })
    }
}

/// Texture coordinates over a face: `origin + [u, v](x, y) / s(x, y)` in texels, all linear.
#[derive(Clone, Copy, Debug)]
struct Surface {
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
    /// The face, if it carries a material; otherwise [`NONE`].
    coated: u32,
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
            origin: texels[0],
            u,
            v,
            s,
            dx: [dx(&u), dx(&v)],
            dy: [dy(&u), dy(&v)],
            spacing_squared: 1.0 / (per_side * per_side) as f64,
            coated: NONE,
        }
    }

    /// With the squared side of its footprint for a level.
    #[inline]
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
            level: footprint as f32,
        }
    }
}
