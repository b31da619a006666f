//! Principal components of a matrix, on its smaller side or, where both are large, by random projection.
//!
//! Data `D` is length × count, one column an observation, already centred: `D ≈ B Bᵀ D`, `B` length × k with
//! orthonormal columns, the leading left singular vectors. The error of k components is
//! `‖D − B Bᵀ D‖² = Σ_{j>k} σ_j²` (Eckart and Young 1936), σ_j² being the energies given here.
//!
//! - *Smaller side up to [`EXACT_SIDE`]*: the Gram matrix of that side, summed in f64, and its eigenvectors. A Gram
//!   squares the condition: singular values below 1e-7 of the largest are noise, and so are f32 samples.
//! - *Else*: subspace iteration on [`EXTRA`] more random columns than asked for (Halko, Martinsson, Tropp 2011,
//!   algorithm 4.4), products in f32, bases made orthonormal in f64 by the eigenvectors of their Gram, twice,
//!   which drops directions that are not there. `2·PASSES + 3` products of length × count × k.
//!
//! Products are cut into blocks of fixed size, one task each, and no sum runs over blocks in an order that
//! threads choose: the same bytes for any number of threads.

use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Largest smaller side whose Gram matrix is decomposed as a whole.
const EXACT_SIDE: usize = 256;
/// Random columns beyond those asked for.
const EXTRA: usize = 12;
/// Power iterations; each squares the ratio of neighbouring singular values.
const PASSES: usize = 2;
/// Rows or columns of one task.
const BLOCK: usize = 256;
/// Eigenvalues of a Gram matrix below this share of the largest are rounding.
const RANK_SHARE: f64 = 1e-14;

/// Leading principal components.
#[derive(Clone, Debug)]
pub(super) struct Principal {
    vectors: Vectors,
    /// σ², descending, of the components found.
    pub(super) energy: Vec<f64>,
    /// ‖D‖².
    pub(super) total: f64,
}

#[derive(Clone, Debug)]
enum Vectors {
    /// B itself.
    Left(DMatrix<f32>),
    /// Right singular vectors; B is D V / σ.
    Right(DMatrix<f32>),
}

impl Principal {
    /// At most `most` components of `data`; fewer where its rank is smaller.
    pub(super) fn of(data: &DMatrix<f32>, most: usize, seed: u64) -> Self {
        let total: f64 = data.as_slice().par_chunks(1 << 14).map(square_sum).collect::<Vec<_>>().iter().sum();
        let side = data.nrows().min(data.ncols());
        let most = most.min(side);
        if total <= 0.0 || most == 0 {
            return Self { vectors: Vectors::Left(DMatrix::zeros(data.nrows(), 0)), energy: Vec::new(), total };
        }
        if side > EXACT_SIDE && most + EXTRA < side {
            return Self::by_projection(data, most, seed, total);
        }
        let right = data.ncols() == side;
        let gram = if right { column_gram(data) } else { row_gram(data) };
        let (vectors, energy) = leading(gram, most);
        let vectors = vectors.cast();
        Self { vectors: if right { Vectors::Right(vectors) } else { Vectors::Left(vectors) }, energy, total }
    }

    fn by_projection(data: &DMatrix<f32>, most: usize, seed: u64, total: f64) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let start = DMatrix::from_fn(data.ncols(), most + EXTRA, |_, _| random.random_range(-1.0f32..1.0));
        let mut basis = orthonormal(times(data, &start));
        for _ in 0..PASSES {
            basis = orthonormal(times(data, &orthonormal(transposed_times(&basis, data).transpose())));
        }
        let projected = transposed_times(&basis, data);
        let (turn, energy) = leading(row_gram(&projected), most);
        Self { vectors: Vectors::Left(basis * turn.cast::<f32>()), energy, total }
    }

    /// Number of components.
    pub(super) fn len(&self) -> usize {
        self.energy.len()
    }

    /// The first `count` orthonormal vectors, of the data they were found from.
    pub(super) fn basis(&self, data: &DMatrix<f32>, count: usize) -> DMatrix<f32> {
        match &self.vectors {
            Vectors::Left(vectors) => vectors.columns(0, count).into_owned(),
            Vectors::Right(vectors) => {
                let inverse = |j: usize| (1.0 / self.energy[j].sqrt()) as f32;
                let scaled = DMatrix::from_fn(vectors.nrows(), count, |i, j| vectors[(i, j)] * inverse(j));
                times(data, &scaled)
            }
        }
    }
}

fn square_sum(values: &[f32]) -> f64 {
    values.iter().map(|&v| f64::from(v) * f64::from(v)).sum()
}

/// `data · right`, length × k, in f32.
pub(super) fn times(data: &DMatrix<f32>, right: &DMatrix<f32>) -> DMatrix<f32> {
    let starts: Vec<usize> = (0..data.nrows()).step_by(BLOCK).collect();
    let block = |&start: &usize| data.rows(start, BLOCK.min(data.nrows() - start)) * right;
    let blocks: Vec<DMatrix<f32>> = starts.par_iter().map(block).collect();
    let mut out = DMatrix::zeros(data.nrows(), right.ncols());
    blocks.iter().zip(&starts).for_each(|(block, &start)| out.rows_mut(start, block.nrows()).copy_from(block));
    out
}

/// `leftᵀ · data`, k × count, in f32.
pub(super) fn transposed_times(left: &DMatrix<f32>, data: &DMatrix<f32>) -> DMatrix<f32> {
    let left = left.transpose();
    let mut out = DMatrix::zeros(left.nrows(), data.ncols());
    if left.nrows() == 0 {
        return out;
    }
    let fill = |(k, block): (usize, &mut [f32])| {
        let columns = block.len() / left.nrows();
        block.copy_from_slice((&left * data.columns(k * BLOCK, columns)).as_slice());
    };
    let size = BLOCK * left.nrows();
    out.as_mut_slice().par_chunks_mut(size).enumerate().for_each(fill);
    out
}

/// `DᵀD` in f64, by blocks of rows summed in order.
fn column_gram(data: &DMatrix<f32>) -> DMatrix<f64> {
    let starts: Vec<usize> = (0..data.nrows()).step_by(4 * BLOCK).collect();
    let block = |&start: &usize| {
        let rows = data.rows(start, (4 * BLOCK).min(data.nrows() - start)).map(f64::from);
        rows.transpose() * rows
    };
    starts
        .par_iter()
        .map(block)
        .collect::<Vec<_>>()
        .iter()
        .fold(DMatrix::zeros(data.ncols(), data.ncols()), |a, b| a + b)
}

/// `DDᵀ` in f64, by blocks of columns summed in order.
fn row_gram(data: &DMatrix<f32>) -> DMatrix<f64> {
    let starts: Vec<usize> = (0..data.ncols()).step_by(4 * BLOCK).collect();
    let block = |&start: &usize| {
        let columns = data.columns(start, (4 * BLOCK).min(data.ncols() - start)).map(f64::from);
        let transposed = columns.transpose();
        columns * transposed
    };
    starts
        .par_iter()
        .map(block)
        .collect::<Vec<_>>()
        .iter()
        .fold(DMatrix::zeros(data.nrows(), data.nrows()), |a, b| a + b)
}

/// Eigenvectors of the largest eigenvalues of a symmetric matrix, as columns, and these; none that are rounding.
fn leading(gram: DMatrix<f64>, most: usize) -> (DMatrix<f64>, Vec<f64>) {
    let side = gram.nrows();
    let scale = gram.amax();
    let none = (DMatrix::zeros(side, 0), Vec::new());
    if !(scale > 0.0 && scale.is_finite()) {
        return none;
    }
    let Some(eigen) = (gram / scale).try_symmetric_eigen(1e-15, 100 * side + 1000) else { return none };
    let mut order: Vec<usize> = (0..side).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]).then(a.cmp(&b)));
    let floor = eigen.eigenvalues[order[0]] * RANK_SHARE;
    order.truncate(most);
    order.retain(|&j| eigen.eigenvalues[j] > floor);
    let energy = order.iter().map(|&j| eigen.eigenvalues[j] * scale).collect();
    (eigen.eigenvectors.select_columns(&order), energy)
}

/// Orthonormal columns that span those of `columns`.
fn orthonormal(columns: DMatrix<f32>) -> DMatrix<f32> {
    let mut basis = columns.map(f64::from);
    for _ in 0..2 {
        let (vectors, energy) = leading(basis.transpose() * &basis, basis.ncols());
        let scaled = DMatrix::from_fn(vectors.nrows(), energy.len(), |i, j| vectors[(i, j)] / energy[j].sqrt());
        basis *= scaled;
    }
    basis.cast()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Singular values 2^−j with smooth vectors.
    fn decaying(rows: usize, columns: usize, rank: usize) -> DMatrix<f32> {
        let wave = |side: usize, i: usize, j: usize| {
            (std::f64::consts::PI * (i as f64 + 0.5) * (j as f64 + 1.0) / side as f64).cos()
                * (2.0 / side as f64).sqrt()
        };
        DMatrix::from_fn(rows, columns, |i, k| {
            (0..rank).map(|j| 0.5f64.powi(j as i32) * wave(rows, i, j) * wave(columns, k, j)).sum::<f64>() as f32
        })
    }

    fn residual(data: &DMatrix<f32>, principal: &Principal, k: usize) -> f64 {
        let basis = principal.basis(data, k).map(f64::from);
        let exact = data.map(f64::from);
        (&exact - &basis * (basis.transpose() * &exact)).norm_squared()
    }

    #[test]
    fn the_error_is_the_energy_left_out_on_either_side_and_by_projection() {
        for (rows, columns) in [(60, 41), (41, 60), (300, 290)] {
            let data = decaying(rows, columns, 12);
            let found = Principal::of(&data, 8, 1);
            for k in [1, 3, 8] {
                let truth: f64 = (k..12).map(|j| 0.25f64.powi(j as i32)).sum();
                let told = found.total - found.energy[..k].iter().sum::<f64>();
                assert!((told / truth - 1.0).abs() < 1e-2, "{told} for {truth}, {rows} × {columns}");
                assert!((told - truth).abs() < 1e-6 && (residual(&data, &found, k) - truth).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn rank_is_found_not_invented() {
        let data = decaying(300, 280, 3);
        assert!(Principal::of(&data, 20, 0).energy.iter().filter(|e| **e > 1e-9).count() == 3);
        assert_eq!(Principal::of(&DMatrix::zeros(30, 40), 5, 0).len(), 0);
        assert_eq!(Principal::of(&DMatrix::zeros(0, 0), 5, 0).len(), 0);
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let data = decaying(700, 500, 30);
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| Principal::of(&data, 10, 3).basis(&data, 10))
        };
        assert_eq!(run(1), run(3));
    }
}
