//! The nearest of many vectors by few distances: LAESA, growing.
//!
//! Each vector keeps its distance to a handful of base prototypes. By the triangle inequality
//! `g(p) = max_b |d(q, b) − d(b, p)|` never exceeds `d(q, p)`: what cannot win is not looked at. The
//! distance must be a metric: Euclidean; its square is none, and discards true neighbours.
//!
//! Source: Micó, Oncina, Vidal, "A new version of the nearest-neighbour approximating and eliminating search algorithm",
//! Pattern Recognition Letters 15, 1994. Cost of a query: `O(B d + S B)`, and `O(d)` for each vector not eliminated.

use std::marker::PhantomData;

/// Base prototypes: the first vectors inserted.
const BASES: usize = 8;

/// How far two vectors are apart.
pub(super) trait Distance {
    fn between(a: &[f32], b: &[f32]) -> f32;
}

/// A metric.
#[derive(Clone, Copy, Debug)]
pub(super) struct Euclidean;

/// Vectors of one length, and their distances to the bases.
#[derive(Clone, Debug)]
pub(super) struct Laesa<D = Euclidean> {
    distance: PhantomData<D>,
    length: usize,
    vectors: Vec<f32>,
    to_bases: Vec<[f32; BASES]>,
}

impl<D: Distance> Laesa<D> {
    pub(super) fn new(length: usize) -> Self {
        Self { distance: PhantomData, length, vectors: Vec::new(), to_bases: Vec::new() }
    }

    pub(super) fn len(&self) -> usize {
        self.to_bases.len()
    }

    pub(super) fn vector(&self, item: usize) -> &[f32] {
        &self.vectors[item * self.length..][..self.length]
    }

    /// Appends a vector and gives its position.
    pub(super) fn insert(&mut self, vector: &[f32]) -> usize {
        let item = self.len();
        self.vectors.extend(vector);
        self.to_bases.push([0.0; BASES]);
        self.to_bases[item] = self.distances(vector);
        if item < BASES {
            for other in 0..item {
                self.to_bases[other][item] = self.to_bases[item][other];
            }
        }
        item
    }

    /// The nearest vector, the first of equals, and its distance.
    pub(super) fn nearest(&self, query: &[f32]) -> Option<(usize, f32)> {
        let own = self.distances(query);
        let bound = |item: usize| {
            let gaps: [f32; BASES] = std::array::from_fn(|b| (own[b] - self.to_bases[item][b]).abs());
            gaps.into_iter().fold(0.0, |most, gap| if gap > most { gap } else { most })
        };
        let bounds: Vec<f32> = (0..self.len()).map(bound).collect();
        let first = (0..self.len()).min_by(|&a, &b| bounds[a].total_cmp(&bounds[b]))?;
        let mut best = (first, D::between(query, self.vector(first)));
        for item in 0..self.len() {
            // Bounds are rounded, as distances are: equals must not be lost.
            if bounds[item] <= best.1 * 1.000_01 + 1e-6 {
                let found = D::between(query, self.vector(item));
                if found < best.1 || (found == best.1 && item < best.0) {
                    best = (item, found);
                }
            }
        }
        Some(best)
    }

    /// Distances to the bases there are; 0 for those to come.
    fn distances(&self, query: &[f32]) -> [f32; BASES] {
        std::array::from_fn(|b| if b < self.len() { D::between(query, self.vector(b)) } else { 0.0 })
    }
}

impl Distance for Euclidean {
    fn between(a: &[f32], b: &[f32]) -> f32 {
        a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum::<f32>().sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vectors(count: usize, length: usize) -> Vec<f32> {
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        (0..count * length).map(|_| next()).collect()
    }

    fn brute<D: Distance>(all: &[f32], query: &[f32]) -> f32 {
        all.chunks(query.len()).map(|v| D::between(query, v)).fold(f32::INFINITY, f32::min)
    }

    /// No metric.
    struct Squared;

    impl Distance for Squared {
        fn between(a: &[f32], b: &[f32]) -> f32 {
            Euclidean::between(a, b).powi(2)
        }
    }

    /// Of fifty queries among 10 000 vectors, those whose nearest vector the search does not find.
    fn missed<D: Distance>() -> usize {
        let all = vectors(10_050, 11);
        let (stored, queries) = all.split_at(10_000 * 11);
        let mut laesa = Laesa::<D>::new(11);
        stored.chunks(11).for_each(|vector| {
            laesa.insert(vector);
        });
        queries.chunks(11).filter(|query| laesa.nearest(query).unwrap().1 != brute::<D>(stored, query)).count()
    }

    #[test]
    fn the_search_finds_what_looking_at_all_finds() {
        assert_eq!(missed::<Euclidean>(), 0);
    }

    #[test]
    fn by_squared_errors_true_neighbours_are_discarded() {
        assert!(missed::<Squared>() > 10, "{}", missed::<Squared>());
    }

    #[test]
    fn duplicates_answer_with_the_first() {
        let mut laesa = Laesa::<Euclidean>::new(2);
        assert!(laesa.nearest(&[0.0, 0.0]).is_none());
        for _ in 0..30 {
            laesa.insert(&[1.0, 2.0]);
        }
        assert_eq!(laesa.nearest(&[1.0, 2.0]), Some((0, 0.0)));
    }
}
