//! Sparse complex Hermitian positive definite systems, by Cholesky factorisation.
//!
//! LSCM and ARAP are both complex systems with one unknown per vertex, half as many as the real form
//! has. Order: nested dissection by coordinates (George 1973), which keeps the factor of a mesh of n
//! vertices at O(n log n) entries. Factorisation: up-looking, along the elimination tree (Davis,
//! *Direct Methods for Sparse Linear Systems*, 2006, section 4). f64; the normal equations square the
//! condition number, so a pivot below [`MIN_PIVOT`] of the largest ends the attempt, and the caller
//! splits the chart.

use nalgebra::{Complex, Point3};

/// Smallest pivot against the largest diagonal entry: some digits must be left at κ ≈ 10^13.
const MIN_PIVOT: f64 = 1e-13;

/// Below this many vertices a part is not dissected further.
const LEAF: usize = 24;

/// `A`, as the entries of its upper triangle by column, plus its diagonal.
pub(super) struct Hermitian {
    /// Per column `k` the (row, value) with row < k after ordering, rows ascending and single.
    columns: Vec<Vec<(u32, Complex<f64>)>>,
    diagonal: Vec<f64>,
}

impl Hermitian {
    /// Sums up entries `(row, column, value)`; `rank[i]` is the place of unknown `i` in the order, or
    /// `None` of one that is fixed. Only one of each mirrored pair need be given.
    pub(super) fn new(n: usize, rank: &[Option<u32>], entries: impl Iterator<Item = (u32, u32, Complex<f64>)>) -> Self {
        let mut columns = vec![Vec::new(); n];
        let mut diagonal = vec![0.0; n];
        for (row, column, value) in entries {
            let (Some(r), Some(c)) = (rank[row as usize], rank[column as usize]) else { continue };
            match r.cmp(&c) {
                std::cmp::Ordering::Equal => diagonal[r as usize] += value.re,
                std::cmp::Ordering::Less => columns[c as usize].push((r, value)),
                std::cmp::Ordering::Greater => columns[r as usize].push((c, value.conj())),
            }
        }
        columns.iter_mut().for_each(sum_duplicates);
        Self { columns, diagonal }
    }
}

/// Sorts by row, stably, and adds up what shares one: the sum's order is the order of entry.
fn sum_duplicates(column: &mut Vec<(u32, Complex<f64>)>) {
    column.sort_by_key(|e| e.0);
    column.dedup_by(|later, first| {
        let same = later.0 == first.0;
        if same {
            first.1 += later.1;
        }
        same
    });
}

/// `L` with `L Lᴴ = A`, by column; the diagonal comes first and is real.
pub(super) struct Cholesky {
    starts: Vec<usize>,
    rows: Vec<u32>,
    values: Vec<Complex<f64>>,
}

impl Cholesky {
    /// Factors `A`; `None` where it is not positive definite to working precision.
    pub(super) fn new(matrix: &Hermitian) -> Option<Self> {
        let n = matrix.diagonal.len();
        let tree = elimination_tree(matrix);
        let mut reach = Reach::new(n);
        let mut counts = vec![1_usize; n];
        for k in 0..n {
            reach.of(matrix, &tree, k).iter().for_each(|&i| counts[i as usize] += 1);
        }
        let mut starts = vec![0; n + 1];
        (0..n).for_each(|k| starts[k + 1] = starts[k] + counts[k]);
        let zero = Complex::new(0.0, 0.0);
        let mut factor = Self { rows: vec![0; starts[n]], values: vec![zero; starts[n]], starts };
        let floor = MIN_PIVOT * matrix.diagonal.iter().copied().fold(0.0, f64::max);
        let mut ends = factor.starts.clone();
        let mut x = vec![zero; n];
        let mut reach = Reach::new(n);
        for k in 0..n {
            matrix.columns[k].iter().for_each(|&(i, value)| x[i as usize] = value);
            let mut pivot = matrix.diagonal[k];
            for &i in reach.of(matrix, &tree, k) {
                pivot -= factor.eliminate(i as usize, k, &mut x, &mut ends);
            }
            if pivot.is_nan() || pivot <= floor {
                return None;
            }
            let slot = ends[k];
            (factor.rows[slot], factor.values[slot]) = (k as u32, Complex::new(pivot.sqrt(), 0.0));
            ends[k] += 1;
        }
        Some(factor)
    }

    /// Computes `L[k, i]`, appends it to column `i`, and returns its squared modulus.
    fn eliminate(&mut self, i: usize, k: usize, x: &mut [Complex<f64>], ends: &mut [usize]) -> f64 {
        let (start, end) = (self.starts[i], ends[i]);
        let entry = std::mem::replace(&mut x[i], Complex::new(0.0, 0.0)) / self.values[start].re;
        for (&row, value) in self.rows[start + 1..end].iter().zip(&self.values[start + 1..end]) {
            x[row as usize] -= value * entry;
        }
        (self.rows[end], self.values[end]) = (k as u32, entry.conj());
        ends[i] += 1;
        entry.norm_sqr()
    }

    /// Solves `A x = b` in place, in the order of the matrix.
    pub(super) fn solve(&self, x: &mut [Complex<f64>]) {
        for k in 0..x.len() {
            let column = self.starts[k]..self.starts[k + 1];
            x[k] /= self.values[column.start].re;
            for p in column.start + 1..column.end {
                let step = self.values[p] * x[k];
                x[self.rows[p] as usize] -= step;
            }
        }
        for k in (0..x.len()).rev() {
            let column = self.starts[k]..self.starts[k + 1];
            for p in column.start + 1..column.end {
                let step = self.values[p].conj() * x[self.rows[p] as usize];
                x[k] -= step;
            }
            x[k] /= self.values[column.start].re;
        }
    }
}

const ROOT: u32 = u32::MAX;

/// Parent of each column in the elimination tree.
fn elimination_tree(matrix: &Hermitian) -> Vec<u32> {
    let n = matrix.diagonal.len();
    let (mut parent, mut ancestor) = (vec![ROOT; n], vec![ROOT; n]);
    for k in 0..n {
        for &(row, _) in &matrix.columns[k] {
            let mut i = row;
            while i != ROOT && (i as usize) < k {
                let up = std::mem::replace(&mut ancestor[i as usize], k as u32);
                if up == ROOT {
                    parent[i as usize] = k as u32;
                }
                i = up;
            }
        }
    }
    parent
}

/// Which columns a row of the factor has entries in.
struct Reach {
    mark: Vec<u32>,
    path: Vec<u32>,
    stack: Vec<u32>,
}

impl Reach {
    fn new(n: usize) -> Self {
        Self { mark: vec![ROOT; n], path: Vec::new(), stack: Vec::new() }
    }

    /// The pattern of row `k`, descendants before ancestors.
    fn of(&mut self, matrix: &Hermitian, parent: &[u32], k: usize) -> &[u32] {
        self.stack.clear();
        self.mark[k] = k as u32;
        for &(row, _) in &matrix.columns[k] {
            self.path.clear();
            let mut i = row;
            while i != ROOT && self.mark[i as usize] != k as u32 {
                self.mark[i as usize] = k as u32;
                self.path.push(i);
                i = parent[i as usize];
            }
            // A later path is below the earlier ones it ends at, so it goes in front of them.
            self.stack.extend(self.path.iter().rev());
        }
        self.stack.reverse();
        &self.stack
    }
}

/// An elimination order by nested dissection: halves by the longest extent of their vertices, and last
/// those of one half that touch the other.
pub(super) fn dissect(positions: &[Point3<f64>], triangles: &[[u32; 3]]) -> Vec<u32> {
    let neighbours = Neighbours::new(positions.len(), triangles);
    let mut order = Vec::with_capacity(positions.len());
    let mut side = vec![0_u32; positions.len()];
    let mut stamp = 0;
    let all: Vec<u32> = (0..positions.len() as u32).collect();
    // Filled from the back: separators first, then both halves.
    let mut waiting = vec![all];
    while let Some(mut part) = waiting.pop() {
        if part.len() <= LEAF {
            order.extend(part.into_iter().rev());
            continue;
        }
        let axis = longest_axis(positions, &part);
        part.sort_by(|&a, &b| positions[a as usize][axis].total_cmp(&positions[b as usize][axis]).then(a.cmp(&b)));
        let upper = part.split_off(part.len() / 2);
        stamp += 1;
        upper.iter().for_each(|&v| side[v as usize] = stamp);
        let (separator, lower): (Vec<u32>, Vec<u32>) =
            part.into_iter().partition(|&v| neighbours.of(v).iter().any(|&w| side[w as usize] == stamp));
        order.extend(separator.into_iter().rev());
        waiting.push(lower);
        waiting.push(upper);
    }
    order.reverse();
    order
}

fn longest_axis(positions: &[Point3<f64>], part: &[u32]) -> usize {
    let first = positions[part[0] as usize];
    let points = part.iter().map(|&v| positions[v as usize]);
    let (low, high) = points.fold((first, first), |(low, high), p| (low.inf(&p), high.sup(&p)));
    (high - low).imax()
}

/// Vertices that share a triangle, by vertex; with repetitions.
struct Neighbours {
    starts: Vec<usize>,
    others: Vec<u32>,
}

impl Neighbours {
    fn new(n: usize, triangles: &[[u32; 3]]) -> Self {
        let mut starts = vec![0; n + 1];
        triangles.iter().flatten().for_each(|&v| starts[v as usize + 1] += 2);
        (0..n).for_each(|v| starts[v + 1] += starts[v]);
        let mut cursor = starts.clone();
        let mut others = vec![0; starts[n]];
        for t in triangles {
            for k in 0..3 {
                let slot = &mut cursor[t[k] as usize];
                (others[*slot], others[*slot + 1]) = (t[(k + 1) % 3], t[(k + 2) % 3]);
                *slot += 2;
            }
        }
        Self { starts, others }
    }

    fn of(&self, v: u32) -> &[u32] {
        &self.others[self.starts[v as usize]..self.starts[v as usize + 1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A small Hermitian system with all entries present, against its own product.
    #[test]
    fn solves_what_it_multiplied() {
        let n = 40;
        let entry = |i: u32, j: u32| Complex::new(f64::from(i * j % 7) * 0.1, f64::from((i + 3 * j) % 5) * 0.1);
        let pairs = (0..n).flat_map(|i| (0..n).filter(move |&j| j > i && (i + j) % 3 != 0).map(move |j| (i, j)));
        let mut entries: Vec<_> = pairs.map(|(i, j)| (i, j, entry(i, j))).collect();
        entries.extend((0..n).map(|i| (i, i, Complex::new(40.0, 0.0))));
        let truth: Vec<_> = (0..n).map(|i| Complex::new(f64::from(i), -0.5 * f64::from(i % 4))).collect();
        let mut x = vec![Complex::new(0.0, 0.0); n as usize];
        for &(i, j, a) in &entries {
            x[i as usize] += a * truth[j as usize];
            if i != j {
                x[j as usize] += a.conj() * truth[i as usize];
            }
        }
        let rank: Vec<_> = (0..n).map(Some).collect();
        let factor = Cholesky::new(&Hermitian::new(n as usize, &rank, entries.into_iter())).unwrap();
        factor.solve(&mut x);
        assert!(x.iter().zip(&truth).all(|(a, b)| (a - b).norm() < 1e-12));
    }
}
