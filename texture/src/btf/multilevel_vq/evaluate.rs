//! A sample out of the books: the 16 corners between nodes, each a chain of look-ups.
//!
//! ```text
//! (j, c₆) = P6[x]; (k, c₄) = P4[j][φ]; (m, c₃) = P3[k][θ]; (p, i) = M[m]; (r, c₂) = P2[p][α]; Y = c₆ c₄ c₃ c₂ P1[r][β]
//! (Cr, Cb) or (u', v') = C[I1[I2[i][α]][β]]                                                     (equation 4)
//! ```
//!
//! M is folded into P3 and C into I1, so a corner is three dependent loads for each of both. All tables of
//! a 64 × 64 tile take hundreds of kilobytes and stay in the second-level cache.

use super::books::{Books, Plane};
use super::grid::{Place, turned};
use super::grow::Link;
use crate::btf::VqTables;
use nalgebra::Vector3;

/// The books, laid out for look-ups.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tables {
    /// Cosine and sine of each azimuth of the view.
    turns: Vec<[f32; 2]>,
    /// P4; children count entries of `views`.
    texels: Vec<Link>,
    pub(super) views: Vec<View>,
    /// P2; children count values of `rows`.
    pub(super) slices: Vec<Link>,
    rows: Vec<f32>,
    /// I2; counts values of `color_rows`.
    color_slices: Vec<u32>,
    color_rows: Vec<[f32; 2]>,
}

/// An entry of P3: where its items of P2 and I2 start, and its scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct View {
    pub(super) slices: u32,
    pub(super) color_slices: u32,
    pub(super) scale: f32,
}

impl Tables {
    pub(super) fn of(books: &Books) -> Self {
        let grid = books.grid;
        let started = |link: &Link, width: usize| Link { child: link.child * width as u32, scale: link.scale };
        let view = |link: &Link| {
            let [slice, color] = books.pairs[link.child as usize];
            View { slices: slice * grid.alpha as u32, color_slices: color * grid.alpha as u32, scale: link.scale }
        };
        Self {
            turns: (0..grid.phi).map(|phi| grid.azimuth(phi).sin_cos()).map(|(sin, cos)| [cos, sin]).collect(),
            texels: books.texels.links.iter().map(|l| started(l, grid.theta)).collect(),
            views: books.views.links.iter().map(view).collect(),
            slices: books.slices.links.iter().map(|l| started(l, grid.beta)).collect(),
            rows: books.rows.clone(),
            color_slices: books.color_slices.iter().map(|row| row * grid.beta as u32).collect(),
            color_rows: books.color_rows.iter().map(|&c| books.colors[c as usize]).collect(),
        }
    }

    /// The same for programs that compute elsewhere, with the texels of `plane`.
    pub(super) fn exported(&self, books: &Books, plane: &Plane) -> VqTables {
        let links = |links: &[Link]| links.iter().map(|link| (link.child, link.scale)).collect();
        VqTables {
            grid: books.grid,
            turns: self.turns.clone(),
            plane: links(&plane.book.links),
            texels: links(&self.texels),
            views: self.views.iter().map(|view| (view.slices, view.color_slices, view.scale)).collect(),
            slices: links(&self.slices),
            rows: self.rows.clone(),
            color_slices: self.color_slices.clone(),
            color_rows: self.color_rows.clone(),
        }
    }

    /// Cosine and sine of an azimuth of the view.
    #[inline]
    pub(super) fn turn(&self, phi: usize) -> [f32; 2] {
        self.turns[phi]
    }

    /// Where light and view fall.
    #[inline]
    pub(super) fn place(&self, books: &Books, light: &Vector3<f32>, view: &Vector3<f32>) -> Place {
        let [theta, phi] = books.grid.view_place(view);
        let seen = |phi: usize| books.grid.light_place(&turned(light, self.turns[phi]));
        let [from, to] = phi.nodes();
        Place { theta, phi, light: [seen(from), seen(to)] }
    }

    /// The entry of P3 of a texel's item at a node of the view, and the product of its scales.
    #[inline]
    pub(super) fn view(&self, books: &Books, texel: Link, [phi, theta]: [usize; 2]) -> (View, f32) {
        let link = self.texels[texel.child as usize * books.grid.phi + phi];
        let view = self.views[link.child as usize + theta];
        (view, texel.scale * link.scale * view.scale)
    }

    /// The sample of a texel at a place, not below 0.
    #[inline]
    pub(super) fn value(&self, books: &Books, plane: &Plane, texel: usize, place: &Place) -> [f32; 3] {
        let link = plane.link(texel);
        let mut sum = [0.0; 3];
        for (p, phi) in place.phi.nodes().into_iter().enumerate() {
            for (t, theta) in place.theta.nodes().into_iter().enumerate() {
                let weight = place.phi.weights()[p] * place.theta.weights()[t];
                let (view, scale) = self.view(books, link, [phi, theta]);
                self.add_corners(view, [weight * scale, weight], &place.light[p], &mut sum);
            }
        }
        books.color.rgb(sum).map(|c| c.max(0.0))
    }

    /// Adds the four cells about a light, luminance and chroma weighted.
    #[inline]
    fn add_corners(
        &self,
        view: View,
        [luma, chroma]: [f32; 2],
        [slice, cell]: &[super::grid::Between; 2],
        sum: &mut [f32; 3],
    ) {
        let [low, high] = cell.nodes();
        for (a, alpha) in slice.nodes().into_iter().enumerate() {
            let weight = slice.weights()[a];
            let link = self.slices[view.slices as usize + alpha];
            let row = &self.rows[link.child as usize..];
            sum[0] += luma * weight * link.scale * (row[low] + cell.t * (row[high] - row[low]));
            let row = &self.color_rows[self.color_slices[view.color_slices as usize + alpha] as usize..];
            let (from, to) = (row[low], row[high]);
            sum[1] += chroma * weight * (from[0] + cell.t * (to[0] - from[0]));
            sum[2] += chroma * weight * (from[1] + cell.t * (to[1] - from[1]));
        }
    }
}
