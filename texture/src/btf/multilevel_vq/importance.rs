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
    /// The same as shares.
    slice_shares: Vec<f32>,
    row_shares: Vec<f32>,
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
        let slices: Vec<f32> = books.slices.links.chunks_exact(grid.alpha).flat_map(slice).collect();
        let rows: Vec<f32> = rows.iter().flat_map(|row| cumulative(row)).collect();
        Self { slice_shares: shares(&slices, grid.alpha), row_shares: shares(&rows, grid.beta), slices, rows }
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

/// What falls into each cell of items of so many upper ends.
fn shares(ends: &[f32], width: usize) -> Vec<f32> {
    let of_item = |ends: &[f32]| -> Vec<f32> {
        let starts = std::iter::once(&0.0).chain(ends);
        ends.iter().zip(starts).map(|(end, start)| end - start).collect()
    };
    ends.chunks_exact(width).flat_map(of_item).collect()
}

/// The cell in which `u` falls, and how far it is into it.
#[inline]
fn invert(ends: &[f32], u: f32) -> (usize, f32) {
    let cell = ends.iter().map(|end| u32::from(*end <= u)).sum::<u32>() as usize;
    let cell = cell.min(ends.len() - 1);
    let start = if cell == 0 { 0.0 } else { ends[cell - 1] };
    (cell, ((u - start) / (ends[cell] - start)).clamp(0.0, 1.0))
}

impl MultilevelVq {
    /// Draws a unit vector towards the light out of three uniform numbers of 0..1, and its density per steradian;
    /// `pdf` of that direction is the same number.
    pub fn sample(&self, texel: usize, view: &Vector3<f32>, u: [f32; 3]) -> (Vector3<f32>, f32) {
        let grid = self.books.grid;
        let [theta, phi] = grid.view_place(view);
        let starts = self.starts(texel, theta, phi);
        let [p, t] = drawn(phi, theta, u[2]);
        let (slice, into_slice) = invert(&self.distributions.slices[starts[p][t]..][..grid.alpha], u[0]);
        let row = self.tables.slices[starts[p][t] + slice].child as usize;
        let (cell, into_cell) = invert(&self.distributions.rows[row..][..grid.beta], u[1]);
        let alpha = PI * (slice as f32 + into_slice) / grid.alpha as f32 - FRAC_PI_2;
        let s = 2.0 * (cell as f32 + into_cell) / grid.beta as f32 - 1.0;
        let [cos, sin] = self.tables.turn(phi.nodes()[p]);
        let light = turned(&grid.direction(alpha, s), [cos, -sin]);
        (light, self.density(starts, &light, theta, phi))
    }

    /// The density per steradian with which [`MultilevelVq::sample`] draws a direction above the surface.
    pub fn pdf(&self, texel: usize, view: &Vector3<f32>, light: &Vector3<f32>) -> f32 {
        let [theta, phi] = self.books.grid.view_place(view);
        self.density(self.starts(texel, theta, phi), light, theta, phi)
    }

    /// Where a texel's slices start at the four nodes about a view, (azimuth, polar angle).
    #[inline]
    fn starts(&self, texel: usize, theta: Between, phi: Between) -> [[usize; 2]; 2] {
        let link = self.plane().link(texel);
        let start = |phi, theta| self.tables.view(&self.books, link, [phi, theta]).0.slices as usize;
        let ([from, to], [low, high]) = (phi.nodes(), theta.nodes());
        [[start(from, low), start(from, high)], [start(to, low), start(to, high)]]
    }

    #[inline]
    fn density(&self, starts: [[usize; 2]; 2], light: &Vector3<f32>, theta: Between, phi: Between) -> f32 {
        let grid = self.books.grid;
        let mut sum = 0.0;
        for (p, node) in phi.nodes().into_iter().enumerate() {
            let [slice, cell] = cell_of(grid, &turned(light, self.tables.turn(node)));
            for t in 0..2 {
                let entry = starts[p][t] + slice;
                let row = self.tables.slices[entry].child as usize;
                let shares = self.distributions.slice_shares[entry] * self.distributions.row_shares[row + cell];
                sum += phi.weights()[p] * theta.weights()[t] * shares;
            }
        }
        sum * grid.cells() as f32 / TAU
    }

    /// The texels of what is shown.
    pub(super) fn plane(&self) -> &Plane {
        &self.materials[self.shown][0]
    }
}

/// One of the four corners between two nodes of two axes, by its weight.
#[inline]
fn drawn(slow: Between, fast: Between, u: f32) -> [usize; 2] {
    let [start, width] = if u < slow.t { [0.0, slow.t] } else { [slow.t, 1.0 - slow.t] };
    [usize::from(u < slow.t), usize::from(u - start < fast.t * width)]
}

/// The cell of a light as seen from azimuth 0.
#[inline]
fn cell_of(grid: Grid, light: &Vector3<f32>) -> [usize; 2] {
    let [alpha, s] = grid.onion(light);
    let at = |x: f32, count: usize| ((x * count as f32).max(0.0) as usize).min(count - 1);
    [at(alpha / PI + 0.5, grid.alpha), at(0.5 * (s + 1.0), grid.beta)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The largest number of 0..1 in 32 bits.
    const LAST: f32 = 1.0 - f32::EPSILON / 2.0;

    fn drawn_cells(masses: &[f32]) {
        let ends = cumulative(masses);
        assert!(ends.is_sorted_by(|a, b| a < b) && ends[0] > 0.0 && ends.last() == Some(&1.0), "{ends:?}");
        for u in [0.0, f32::MIN_POSITIVE, 1e-7, 0.1, 0.5, 0.999_999, LAST] {
            let (cell, into) = invert(&ends, u);
            assert!(cell < masses.len() && (0.0..=1.0).contains(&into), "{u}: {cell} {into}");
        }
        assert_eq!((invert(&ends, 0.0), invert(&ends, LAST).0), ((0, 0.0), masses.len() - 1));
        assert!(shares(&ends, masses.len()).iter().all(|share| *share > 0.0));
    }

    #[test]
    fn a_slice_of_nothing_is_drawn_evenly() {
        drawn_cells(&[0.0; 11]);
        assert!(shares(&cumulative(&[0.0; 11]), 11).iter().all(|share| (share - 1.0 / 11.0).abs() < 1e-6));
    }

    /// Nine tenths are drawn of the one cell, the rest evenly of all.
    #[test]
    fn a_slice_with_one_lit_cell_is_drawn_there_and_still_everywhere() {
        for lit in [0, 4, 10] {
            for mass in [1e-30, 1.0, 1e30] {
                let mut masses = [0.0; 11];
                masses[lit] = mass;
                drawn_cells(&masses);
                let found = shares(&cumulative(&masses), 11);
                assert!((found[lit] - (0.9 + 0.1 / 11.0)).abs() < 1e-6, "{found:?}");
            }
        }
    }

    #[test]
    fn masses_beyond_all_numbers_are_drawn_evenly() {
        drawn_cells(&[f32::INFINITY, 1.0, 0.0]);
        drawn_cells(&[f32::NAN, 1.0, 0.0]);
    }
}
