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

use super::color::{LENGTHS, ycrcb};
use super::grid::{Between, Grid, turned};
use crate::TextureError;
use capture::btf::Btf;
use nalgebra::{DMatrix, DMatrixView, Vector3};

/// Singular values of the basis functions' system below this share of the largest are 0.
const RANK_TOLERANCE: f64 = 1e-9;
/// Rounds within which singular values are found.
const MAX_ROUNDS: usize = 10_000;

/// The weights, for one set of directions.
#[derive(Clone, Debug)]
pub(super) struct Resampler {
    grid: Grid,
    /// (measured views × nodes).
    views: DMatrix<f32>,
    /// Per azimuth of the view, (measured lights × cells).
    lights: Vec<DMatrix<f32>>,
}

/// One texel on the grid, as the books compare: units of [`LENGTHS`].
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
        views: &[Vector3<f64>],
        lights: &[Vector3<f64>],
    ) -> Result<Self, TextureError> {
        let nodes: Vec<Vector3<f64>> =
            (0..grid.nodes()).map(|n| grid.node_direction(n % grid.theta, n / grid.theta).cast()).collect();
        let view_weights = |d: &Vector3<f64>| {
            let [theta, phi] = grid.view_place(&d.cast());
            corners(phi, theta, grid.theta)
        };
        let for_azimuth = |phi: usize| {
            let (sin, cos) = grid.azimuth(phi).sin_cos();
            let cell = |c: usize| turned(&grid.cell_direction(c / grid.beta, c % grid.beta), [cos, -sin]).cast();
            let cells: Vec<Vector3<f64>> = (0..grid.cells()).map(cell).collect();
            let light_weights = |d: &Vector3<f64>| {
                let [slice, cell] = grid.light_place(&turned(&d.cast(), [cos, sin]));
                corners(slice, cell, grid.beta)
            };
            weights(lights, &cells, ridge, light_weights)
        };
        let lights = (0..grid.phi).map(for_azimuth).collect::<Result<_, _>>()?;
        Ok(Self { grid, views: weights(views, &nodes, ridge, view_weights)?, lights })
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
                found.iter_mut().zip(cell.chunks_exact(3)).for_each(|(texel, c)| texel.push([c[0], c[1], c[2]]));
            }
        }
        found
    }
}

impl Texel {
    fn push(&mut self, rgb: [f32; 3]) {
        let [y, cr, cb] = ycrcb(rgb);
        self.luma.push(LENGTHS[0] * y.max(0.0));
        self.chroma.extend([LENGTHS[1] * cr, LENGTHS[2] * cb]);
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
    sites: &[Vector3<f64>],
    nodes: &[Vector3<f64>],
    ridge: f64,
    between: impl Fn(&Vector3<f64>) -> [(usize, f64); 4],
) -> Result<DMatrix<f32>, TextureError> {
    let plain = radial_weights(sites, nodes)?;
    let mut back = DMatrix::zeros(sites.len(), nodes.len());
    for (site, direction) in sites.iter().enumerate() {
        between(direction).iter().for_each(|&(node, weight)| back[(site, node)] += weight);
    }
    let missing = DMatrix::identity(sites.len(), sites.len()) - &back * &plain;
    let normal = &back * back.transpose() + DMatrix::identity(sites.len(), sites.len()) * ridge;
    let solved = normal.cholesky().ok_or_else(unsolved)?.solve(&missing);
    Ok((plain + back.transpose() * solved).transpose().cast())
}

/// `W` (nodes × sites).
fn radial_weights(sites: &[Vector3<f64>], nodes: &[Vector3<f64>]) -> Result<DMatrix<f64>, TextureError> {
    let n = sites.len();
    let rim = sites.iter().map(|d| d.z.clamp(0.0, 1.0)).fold(1.0, f64::min);
    let basis = |d: &Vector3<f64>, k: usize| match k.checked_sub(n) {
        None => (d - sites[k]).norm(),
        Some(0) => 1.0,
        Some(axis) => d[axis - 1],
    };
    let system = DMatrix::from_fn(n + 4, n + 4, |row, column| match (row < n, column < n) {
        (true, _) => basis(&sites[row], column),
        (false, true) => basis(&sites[column], row),
        (false, false) => 0.0,
    });
    let decomposed = system.try_svd(true, true, f64::EPSILON, MAX_ROUNDS).ok_or_else(unsolved)?;
    let tolerance = RANK_TOLERANCE * decomposed.singular_values.max();
    let inverse = decomposed.pseudo_inverse(tolerance).ok().ok_or_else(unsolved)?;
    let raised: Vec<Vector3<f64>> = nodes.iter().map(|d| within_rim(d, rim)).collect();
    let evaluated = DMatrix::from_fn(nodes.len(), n + 4, |node, k| basis(&raised[node], k));
    let mut found = evaluated * inverse.columns(0, n);
    for mut row in found.row_iter_mut() {
        let sum = row.sum();
        let scale = if sum.abs() > 0.5 { sum.recip() } else { 0.0 };
        row.iter_mut().for_each(|w| *w = if scale > 0.0 { *w * scale } else { 1.0 / n as f64 });
    }
    Ok(found)
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
