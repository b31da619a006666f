//! Samples under the measured directions brought to the grid: by radial basis functions, view first, then light.
//!
//! ```text
//! f(d) = Σ_c w_c |d − d_c| + p₀ + p₁ x + p₂ y + p₃ z      (biharmonic: Carr and others, SIGGRAPH 2001)
//! W = E A⁺ (nodes × sites),   W' = W + Bᵀ (B Bᵀ + μ I)⁻¹ (I − B W)
//! ```
//!
//! The system `A` depends on directions alone, so the weights are found once, and rows of `W` sum to 1. Nodes beyond the
//! outermost measured ring take its values. `B` (sites × nodes) is how the codec interpolates; the correction `W'`, the
//! smallest that does it but for the ridge μ, makes that interpolation return what was measured: a grid filled by plain `W` smooths.
//! The pseudo-inverse answers for one light, for coplanar and for repeated directions.
//!
//! Cost: 2.1 M multiplications a texel for the views and 3.3 M for the lights (81 × 81 onto 11 × 11 × 7 × 16), as matrix products.

use super::color::Color;
use super::grid::{Between, Grid, turned};
use crate::TextureError;
use capture::btf::Btf;
use nalgebra::{DMatrix, DMatrixView, Vector3};

/// Singular values of the basis functions' system below this share of the largest are 0.
const RANK_TOLERANCE: f64 = 1e-9;
/// Columns whose cosine is below this are orthogonal, and rounds over all pairs; ten are the rule.
const ORTHOGONAL: f64 = 1e-13;
const MAX_SWEEPS: usize = 60;

/// The weights, for one set of directions.
#[derive(Clone, Debug)]
pub(super) struct Resampler {
    grid: Grid,
    color: Color,
    /// (measured views × nodes).
    views: DMatrix<f32>,
    /// Per azimuth of the view, (measured lights × cells).
    lights: Vec<DMatrix<f32>>,
}

/// One texel on the grid, as the books compare: units of [`Color::lengths`].
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Texel {
    /// (azimuth, polar angle, slice, cell), ≥ 0.
    pub(super) luma: Vec<f32>,
    /// The same, Cr and Cb after one another.
    pub(super) chroma: Vec<f32>,
}

impl Resampler {
    /// The weights of these directions.
    ///
    /// # Errors
    /// Where the system cannot be solved, which no finite directions bring about.
    pub(super) fn new(
        grid: Grid,
        ridge: f64,
        color: Color,
        views: &[Vector3<f64>],
        lights: &[Vector3<f64>],
    ) -> Result<Self, TextureError> {
        let nodes: Vec<Vector3<f64>> =
            (0..grid.nodes()).map(|n| grid.node_direction(n % grid.theta, n / grid.theta).cast()).collect();
        let view_weights = |d: &Vector3<f64>| {
            let [theta, phi] = grid.view_place(&d.cast());
            corners(phi, theta, grid.theta)
        };
        let radial = Radial::new(lights);
        let for_azimuth = |phi: usize| {
            let (sin, cos) = grid.azimuth(phi).sin_cos();
            let cell = |c: usize| turned(&grid.cell_direction(c / grid.beta, c % grid.beta), [cos, -sin]).cast();
            let cells: Vec<Vector3<f64>> = (0..grid.cells()).map(cell).collect();
            let light_weights = |d: &Vector3<f64>| {
                let [slice, cell] = grid.light_place(&turned(&d.cast(), [cos, sin]));
                corners(slice, cell, grid.beta)
            };
            weights(&radial, &cells, ridge, light_weights)
        };
        let lights = (0..grid.phi).map(for_azimuth).collect::<Result<_, _>>()?;
        Ok(Self { grid, color, views: weights(&Radial::new(views), &nodes, ridge, view_weights)?, lights })
    }

    /// How colours stand in what it gives.
    pub(super) fn color(&self) -> Color {
        self.color
    }

    /// Some texels of the data on the grid.
    pub(super) fn texels(&self, btf: &Btf, texels: &[usize]) -> Vec<Texel> {
        let (lights, values) = (btf.lights.len(), 3 * texels.len());
        let mut measured = Vec::with_capacity(btf.pairs() * values);
        for picture in btf.samples.chunks_exact(3 * btf.texels()) {
            texels.iter().for_each(|&t| measured.extend(&picture[3 * t..3 * t + 3]));
        }
        let measured = DMatrixView::from_slice(&measured, lights * values, btf.views.len());
        let by_node = measured * &self.views;
        let mut found = vec![Texel::default(); texels.len()];
        for node in 0..self.grid.nodes() {
            let by_light = DMatrixView::from_slice(by_node.column(node).data.into_slice(), values, lights);
            let by_cell = by_light * &self.lights[node / self.grid.theta];
            for cell in by_cell.column_iter() {
                let cell = cell.data.into_slice();
                found
                    .iter_mut()
                    .zip(cell.chunks_exact(3))
                    .for_each(|(texel, c)| texel.push(self.color, [c[0], c[1], c[2]]));
            }
        }
        found
    }
}

impl Texel {
    fn push(&mut self, color: Color, rgb: [f32; 3]) {
        let ([y, cr, cb], lengths) = (color.of_rgb(rgb), color.lengths());
        self.luma.push(lengths[0] * y.max(0.0));
        self.chroma.extend([lengths[1] * cr, lengths[2] * cb]);
    }
}

/// The four nodes and weights of two axes, the second running faster.
fn corners(slow: Between, fast: Between, fast_count: usize) -> [(usize, f64); 4] {
    std::array::from_fn(|k| {
        let (i, j) = (k / 2, k % 2);
        let weight = slow.weights()[i] * fast.weights()[j];
        (slow.nodes()[i] * fast_count + fast.nodes()[j], f64::from(weight))
    })
}

/// `W'` transposed (sites × nodes).
fn weights(
    sites: &Radial<'_>,
    nodes: &[Vector3<f64>],
    ridge: f64,
    between: impl Fn(&Vector3<f64>) -> [(usize, f64); 4],
) -> Result<DMatrix<f32>, TextureError> {
    let (plain, count) = (sites.weights(nodes), sites.sites.len());
    let mut back = DMatrix::zeros(count, nodes.len());
    for (site, direction) in sites.sites.iter().enumerate() {
        between(direction).iter().for_each(|&(node, weight)| back[(site, node)] += weight);
    }
    let missing = DMatrix::identity(count, count) - &back * &plain;
    let normal = &back * back.transpose() + DMatrix::identity(count, count) * ridge;
    let solved = normal.cholesky().ok_or_else(unsolved)?.solve(&missing);
    Ok((plain + back.transpose() * solved).transpose().cast())
}

/// Radial basis functions about sites.
struct Radial<'a> {
    sites: &'a [Vector3<f64>],
    /// Cosine of the outermost polar angle.
    rim: f64,
    /// `A⁺`, its columns of the sites.
    inverse: DMatrix<f64>,
}

impl<'a> Radial<'a> {
    fn new(sites: &'a [Vector3<f64>]) -> Self {
        let n = sites.len();
        let rim = sites.iter().map(|d| d.z.clamp(0.0, 1.0)).fold(1.0, f64::min);
        let system = DMatrix::from_fn(n + 4, n + 4, |row, column| match (row < n, column < n) {
            (true, _) => basis(sites, &sites[row], column),
            (false, true) => basis(sites, &sites[column], row),
            (false, false) => 0.0,
        });
        Self { sites, rim, inverse: pseudo_inverse(system).columns(0, n).into() }
    }

    /// `W` (nodes × sites).
    fn weights(&self, nodes: &[Vector3<f64>]) -> DMatrix<f64> {
        let n = self.sites.len();
        let raised: Vec<Vector3<f64>> = nodes.iter().map(|d| within_rim(d, self.rim)).collect();
        let evaluated = DMatrix::from_fn(nodes.len(), n + 4, |node, k| basis(self.sites, &raised[node], k));
        let mut found = evaluated * &self.inverse;
        for mut row in found.row_iter_mut() {
            let sum = row.sum();
            let scale = if sum.abs() > 0.5 { sum.recip() } else { 0.0 };
            row.iter_mut().for_each(|w| *w = if scale > 0.0 { *w * scale } else { 1.0 / n as f64 });
        }
        found
    }
}

/// One of the functions at a direction: distances from the sites, 1, x, y, z.
fn basis(sites: &[Vector3<f64>], d: &Vector3<f64>, k: usize) -> f64 {
    match k.checked_sub(sites.len()) {
        None => (d - sites[k]).norm(),
        Some(0) => 1.0,
        Some(axis) => d[axis - 1],
    }
}

/// The pseudo-inverse of a square matrix, by turning pairs of columns until all are orthogonal (Hestenes, "Inversion of
/// Matrices by Biorthogonalization and Related Results", 1958). It ends whatever the matrix; nalgebra 0.35's decomposition
/// of the system of Bonn's directions does, at ε, with a wrong answer.
fn pseudo_inverse(mut columns: DMatrix<f64>) -> DMatrix<f64> {
    let n = columns.ncols();
    let mut turns = DMatrix::identity(n, n);
    let nothing = (RANK_TOLERANCE * columns.norm()).powi(2);
    for _ in 0..MAX_SWEEPS {
        let mut is_done = true;
        for (p, q) in (0..n).flat_map(|p| (p + 1..n).map(move |q| (p, q))) {
            let [first, second] = [p, q].map(|k| columns.column(k));
            let (pp, qq, pq) = (first.norm_squared(), second.norm_squared(), first.dot(&second));
            if pp.min(qq) > nothing && pq.abs() > ORTHOGONAL * (pp * qq).sqrt() {
                is_done = false;
                let half = (qq - pp) / (2.0 * pq);
                let tan = half.signum() / (half.abs() + half.hypot(1.0));
                let cos = tan.hypot(1.0).recip();
                [&mut columns, &mut turns].into_iter().for_each(|matrix| turn(matrix, [p, q], [cos, cos * tan]));
            }
        }
        if is_done {
            break;
        }
    }
    let mut inverse = DMatrix::zeros(n, n);
    for (column, turned) in columns.column_iter().zip(turns.column_iter()) {
        let square = column.norm_squared();
        if square > nothing {
            inverse += turned * column.transpose() / square;
        }
    }
    inverse
}

/// Turns two columns in their plane.
fn turn(matrix: &mut DMatrix<f64>, [p, q]: [usize; 2], [cos, sin]: [f64; 2]) {
    for row in 0..matrix.nrows() {
        let (x, y) = (matrix[(row, p)], matrix[(row, q)]);
        matrix[(row, p)] = cos * x - sin * y;
        matrix[(row, q)] = sin * x + cos * y;
    }
}

/// The direction, raised to the polar angle whose cosine is `rim` where it is below.
fn within_rim(d: &Vector3<f64>, rim: f64) -> Vector3<f64> {
    let radius = d.x.hypot(d.y);
    if d.z >= rim || radius == 0.0 {
        return *d;
    }
    let scale = (1.0 - rim * rim).sqrt() / radius;
    Vector3::new(d.x * scale, d.y * scale, rim)
}

fn unsolved() -> TextureError {
    TextureError::Degenerate {
        fault: "the weights between the measured directions cannot be found".into(),
        remedy: "give directions that are finite unit vectors".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use capture::btf::bonn_directions;

    /// Directions between those of Bonn, down to 75°.
    fn between() -> Vec<Vector3<f64>> {
        let at = |i: usize| (f64::from(i as u32 % 37).mul_add(2.0, 0.5).to_radians(), 0.31 * i as f64);
        (0..200).map(at).map(|(t, p)| Vector3::new(t.sin() * p.cos(), t.sin() * p.sin(), t.cos())).collect()
    }

    fn resampled(sites: &[Vector3<f64>], nodes: &[Vector3<f64>], of: impl Fn(&Vector3<f64>) -> f64) -> Vec<f64> {
        let weights = Radial::new(sites).weights(nodes);
        let values: Vec<f64> = sites.iter().map(of).collect();
        weights.row_iter().map(|row| row.iter().zip(&values).map(|(w, v)| w * v).sum()).collect()
    }

    #[test]
    fn constants_and_linear_functions_are_exact() {
        let (sites, nodes) = (bonn_directions(), between());
        assert!(resampled(&sites, &nodes, |_| 0.7).iter().all(|v| (v - 0.7).abs() < 1e-12));
        let plane = |d: &Vector3<f64>| 0.5 + 0.3 * d.x - 0.2 * d.y;
        let found = resampled(&sites, &nodes, plane);
        let worst = found.iter().zip(&nodes).map(|(v, d)| (v - plane(d)).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{worst}");
    }

    #[test]
    fn what_was_measured_is_returned_and_a_lobe_is_met_within_two_percent() {
        let sites = bonn_directions();
        let lobe = |d: &Vector3<f64>| d.dot(&Vector3::new(0.5, 0.2, 0.71_f64.sqrt())).max(0.0).powi(10);
        let at_sites = resampled(&sites, &sites, lobe);
        let worst = at_sites.iter().zip(&sites).map(|(v, d)| (v - lobe(d)).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{worst}");
        let nodes = between();
        let squares =
            resampled(&sites, &nodes, lobe).iter().zip(&nodes).map(|(v, d)| (v - lobe(d)).powi(2)).sum::<f64>();
        assert!((squares / nodes.len() as f64).sqrt() < 0.02, "{}", (squares / nodes.len() as f64).sqrt());
    }

    #[test]
    fn nothing_jumps_where_azimuths_begin_again() {
        let at = |phi: f64| Vector3::new(0.8 * phi.cos(), 0.8 * phi.sin(), 0.6);
        let found = resampled(&bonn_directions(), &[at(-1e-9), at(1e-9), at(std::f64::consts::TAU - 1e-9)], |d| {
            d.x * d.y + d.z
        });
        assert!((found[0] - found[1]).abs() < 1e-7 && (found[0] - found[2]).abs() < 1e-12, "{found:?}");
    }

    /// Two sites at one place make the system singular; each then counts half.
    #[test]
    fn repeated_directions_are_one() {
        let sites = bonn_directions();
        let mut twice = sites.clone();
        twice.push(sites[5]);
        let nodes = between();
        let (single, double) = (Radial::new(&sites).weights(&nodes), Radial::new(&twice).weights(&nodes));
        for node in 0..nodes.len() {
            let [first, second] = [double[(node, 5)], double[(node, 81)]];
            assert!((first - second).abs() < 1e-9, "{node}: {first} {second}");
            assert!((double[(node, 5)] + double[(node, 81)] - single[(node, 5)]).abs() < 1e-6, "{node}");
        }
    }

    /// A lobe that overshoots below 0 leaves no negative luminance.
    #[test]
    fn overshoot_is_cut() {
        let mut texel = Texel::default();
        texel.push(Color::YCrCb, [-0.2, -0.1, -0.3]);
        texel.push(Color::LogLuv { range: 1e6 }, [-0.2, -0.1, -0.3]);
        assert_eq!(texel.luma, [0.0, 0.0]);
    }
}
