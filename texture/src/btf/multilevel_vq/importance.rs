//! Light directions drawn in proportion to what a texel reflects towards a view.
//!
//! Within an item of P2 the density is a product of the slice's and the cell's, for each row of P1 has mean 1:
//!
//! ```text
//! p(a) ∝ c₂[a]^γ μ(P1[a]) w(a),   p(b|a) ∝ P1[a][b]^γ w(b),   pdf = p(a) p(b|a) n_α n_β / 2π      (per steradian)
//! ```
//!
//! Cells have equal solid angle: no Jacobian. `γ` brings encoded samples near radiance ([`Encoding`](capture::btf::Encoding)),
//! μ is the mean of the row so raised, `w = cos α, cos β` where the data leave out the cosine of the light. A tenth of each
//! distribution is uniform, so that the density is positive wherever something might be reflected. Cumulative sums are inverted
//! by a line within each cell: equal numbers give near directions. Between nodes of the view one of four is drawn, and the density
//! is their mixture. Source: Havran, Filip, Myszkowski, section 5.2; the inverse-transform method.

use super::MultilevelVq;
use super::books::{Books, Plane};
use super::grid::{Between, Grid, turned};
use nalgebra::Vector3;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Share of each distribution that is uniform.
const UNIFORM: f32 = 0.1;

/// Cumulative distributions of all items.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Distributions {
    /// Per item of P2, `n_α` upper ends.
    slices: Vec<f32>,
    /// Per item of P1, `n_β` upper ends.
    rows: Vec<f32>,
}

impl Distributions {
    pub(super) fn of(books: &Books, power: f32, includes_cosine: bool) -> Self {
        let grid = books.grid;
        let middle = |i: usize, count: usize| (i as f32 + 0.5) / count as f32;
        let cos_alpha = |a: usize| if includes_cosine { 1.0 } else { (PI * middle(a, grid.alpha) - FRAC_PI_2).cos() };
        let cos_beta =
            |b: usize| if includes_cosine { 1.0 } else { (1.0 - (2.0 * middle(b, grid.beta) - 1.0).powi(2)).sqrt() };
        let raised = |row: &[f32]| row.iter().enumerate().map(|(b, v)| v.powf(power) * cos_beta(b)).collect::<Vec<_>>();
        let rows: Vec<Vec<f32>> = books.rows.chunks_exact(grid.beta).map(raised).collect();
        let masses: Vec<f32> = rows.iter().map(|row| row.iter().sum()).collect();
        let slice = |links: &[super::grow::Link]| {
            let largest = links.iter().map(|l| l.scale).fold(f32::MIN_POSITIVE, f32::max);
            let mass = |(a, l): (usize, &super::grow::Link)| {
                (l.scale / largest).powf(power) * masses[l.child as usize] * cos_alpha(a)
            };
            cumulative(&links.iter().enumerate().map(mass).collect::<Vec<_>>())
        };
        Self {
            slices: books.slices.links.chunks_exact(grid.alpha).flat_map(slice).collect(),
            rows: rows.iter().flat_map(|row| cumulative(row)).collect(),
        }
    }
}

/// Upper ends of the cells, the last 1; a tenth of it uniform.
fn cumulative(masses: &[f32]) -> Vec<f32> {
    let (total, count) = (masses.iter().map(|m| f64::from(*m)).sum::<f64>(), masses.len());
    let lit = total > 0.0 && total.is_finite();
    let uniform = if lit { f64::from(UNIFORM) } else { 1.0 } / count as f64;
    let share = |m: &f32| if lit { (1.0 - f64::from(UNIFORM)) * f64::from(*m) / total } else { 0.0 };
    let mut sum = 0.0;
    let mut ends: Vec<f32> = masses
        .iter()
        .map(|m| {
            sum += uniform + share(m);
            sum as f32
        })
        .collect();
    if let Some(last) = ends.last_mut() {
        *last = 1.0;
    }
    ends
}

/// The cell in which `u` falls, its share, and how far `u` is into it.
#[inline]
fn invert(ends: &[f32], u: f32) -> (usize, f32, f32) {
    let cell = ends.iter().filter(|end| **end <= u).count().min(ends.len() - 1);
    let mass = share(ends, cell);
    let start = ends[cell] - mass;
    (cell, mass, ((u - start) / mass).clamp(0.0, 1.0))
}

#[inline]
fn share(ends: &[f32], cell: usize) -> f32 {
    ends[cell] - if cell == 0 { 0.0 } else { ends[cell - 1] }
}

impl MultilevelVq {
    /// Draws a unit vector towards the light out of three uniform numbers of 0..1, and its density per steradian;
    /// `pdf` of that direction is the same number.
    pub fn sample(&self, texel: usize, view: &Vector3<f32>, u: [f32; 3]) -> (Vector3<f32>, f32) {
        let grid = self.books.grid;
        let [theta, phi] = grid.view_place(view);
        let ([p, t], _) = drawn(phi, theta, u[2]);
        let ends = self.slice_ends(texel, [phi.nodes()[p], theta.nodes()[t]]);
        let (slice, _, into_slice) = invert(ends.0, u[0]);
        let (cell, _, into_cell) = invert(self.row_ends(ends.1 + slice), u[1]);
        let alpha = PI * (slice as f32 + into_slice) / grid.alpha as f32 - FRAC_PI_2;
        let s = 2.0 * (cell as f32 + into_cell) / grid.beta as f32 - 1.0;
        let [cos, sin] = self.tables.turn(phi.nodes()[p]);
        let light = turned(&grid.direction(alpha, s), [cos, -sin]);
        (light, self.density(texel, &light, theta, phi))
    }

    /// The density per steradian with which [`MultilevelVq::sample`] draws a direction above the surface.
    pub fn pdf(&self, texel: usize, view: &Vector3<f32>, light: &Vector3<f32>) -> f32 {
        let [theta, phi] = self.books.grid.view_place(view);
        self.density(texel, light, theta, phi)
    }

    #[inline]
    fn density(&self, texel: usize, light: &Vector3<f32>, theta: Between, phi: Between) -> f32 {
        let grid = self.books.grid;
        let mut sum = 0.0;
        for p in 0..2 {
            let node = phi.nodes()[p];
            let [slice, cell] = cell_of(grid, &turned(light, self.tables.turn(node)));
            for t in 0..2 {
                let weight = phi.weights()[p] * theta.weights()[t];
                let (slices, first) = self.slice_ends(texel, [node, theta.nodes()[t]]);
                sum += weight * share(slices, slice) * share(self.row_ends(first + slice), cell);
            }
        }
        sum * grid.cells() as f32 / TAU
    }

    /// The upper ends of a texel's slices at a node of the view, and where they start.
    #[inline]
    fn slice_ends(&self, texel: usize, node: [usize; 2]) -> (&[f32], usize) {
        let (view, _) = self.tables.view(&self.books, self.plane().link(texel), node);
        let first = view.slices as usize;
        (&self.distributions.slices[first..first + self.books.grid.alpha], first)
    }

    /// The upper ends of the cells of an entry of P2.
    #[inline]
    fn row_ends(&self, entry: usize) -> &[f32] {
        let first = self.tables.slices[entry].child as usize;
        &self.distributions.rows[first..first + self.books.grid.beta]
    }

    /// The texels of what is shown.
    pub(super) fn plane(&self) -> &Plane {
        &self.materials[self.shown][0]
    }
}

/// One of the four corners between two nodes of two axes, by its weight.
#[inline]
fn drawn(slow: Between, fast: Between, u: f32) -> ([usize; 2], f32) {
    let i = usize::from(u < slow.t);
    let rest = if i == 1 { u / slow.t } else { (u - slow.t) / (1.0 - slow.t) };
    ([i, usize::from(rest < fast.t)], rest)
}

/// The cell of a light as seen from azimuth 0.
#[inline]
fn cell_of(grid: Grid, light: &Vector3<f32>) -> [usize; 2] {
    let [alpha, s] = grid.onion(light);
    let at = |x: f32, count: usize| ((x * count as f32).max(0.0) as usize).min(count - 1);
    [at(alpha / PI + 0.5, grid.alpha), at(0.5 * (s + 1.0), grid.beta)]
}
