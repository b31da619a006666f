//! Finds the simplex of a direction without looking at all of them.
//!
//! The upper hemisphere is laid out by stereographic projection, `(x, y) / (1 + z)`, which maps it to the unit disk and
//! circles to circles, and cut into squares. Each square lies in a cap about its centre; it lists the
//! triangles that meet the cap, and the sites and edges of which some could be the nearest to a point of it. The lists
//! hold at least what the search over everything would find, in the same order, so the answer is the same to the bit.

use crate::directions::{Blend, Candidates, DirectionComplex, angle};
use nalgebra::Vector3;

/// Squares along each side of the disk's bounding square.
const SIDE: usize = 48;
/// Sets larger than this are searched as a whole: lists would take longer than they save.
const MOST_SITES: usize = 2000;
/// Added to every angle, against rounding.
const SLACK: f64 = 1e-6;

/// Squares and their lists.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Lookup {
    /// Empty where the set is too large.
    cells: Vec<Candidates>,
}

impl Lookup {
    /// The lists for a complex.
    pub(super) fn new(complex: &DirectionComplex) -> Self {
        if complex.sites().len() > MOST_SITES {
            return Self { cells: Vec::new() };
        }
        let cell = |i: usize| candidates(complex, i % SIDE, i / SIDE);
        Self { cells: (0..SIDE * SIDE).map(cell).collect() }
    }

    /// The same as [`DirectionComplex::blend`].
    pub(super) fn blend(&self, complex: &DirectionComplex, direction: &Vector3<f64>) -> Option<Blend> {
        let unit = direction.try_normalize(1e-300).filter(|d| d.z >= 0.0 && !self.cells.is_empty());
        let Some(unit) = unit else { return complex.blend(direction) };
        let scale = 0.5 * SIDE as f64;
        let place = |v: f64| (((v / (1.0 + unit.z) + 1.0) * scale) as usize).min(SIDE - 1);
        complex.blend_among(&unit, &self.cells[place(unit.y) * SIDE + place(unit.x)])
    }
}

/// The upper direction that a point of the disk stands for; points beyond it stand for lower ones.
fn direction(x: f64, y: f64) -> Vector3<f64> {
    let square = x * x + y * y;
    Vector3::new(2.0 * x, 2.0 * y, 1.0 - square) / (1.0 + square)
}

fn candidates(complex: &DirectionComplex, column: usize, row: usize) -> Candidates {
    let at = |column: f64, row: f64| direction(column * 2.0 / SIDE as f64 - 1.0, row * 2.0 / SIDE as f64 - 1.0);
    let (x, y) = (column as f64, row as f64);
    let centre = at(x + 0.5, y + 0.5);
    let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
    // A cap maps to a disk, which holds a square if it holds its corners.
    let radius = corners.map(|(a, b)| angle(&at(x + a, y + b), &centre)).into_iter().fold(0.0, f64::max);
    complex.candidates(&centre, radius + SLACK)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::directions::Layout;
    use capture::btf::bonn_directions;

    fn hemisphere(count: usize) -> impl Iterator<Item = Vector3<f64>> {
        let golden = std::f64::consts::PI * (3.0 - 5.0f64.sqrt());
        (0..count).map(move |k| {
            let z = (k as f64 + 0.5) / count as f64;
            let (r, phi) = ((1.0 - z * z).sqrt(), golden * k as f64);
            Vector3::new(r * phi.cos(), r * phi.sin(), z)
        })
    }

    #[test]
    fn the_answer_is_that_of_the_search_over_all() {
        let few = vec![Vector3::new(0.1, 0.2, 0.97).normalize(), Vector3::new(-0.5, 0.3, 0.8).normalize()];
        let arc: Vec<_> = bonn_directions().into_iter().filter(|d| d.y.abs() < 1e-9).collect();
        let mut doubled = bonn_directions();
        doubled.extend(bonn_directions());
        for sites in [bonn_directions(), few, arc, doubled, hemisphere(240).collect(), vec![Vector3::z()]] {
            let complex = DirectionComplex::build(&sites, Layout::General);
            let lookup = Lookup::new(&complex);
            let edges = (0..400).map(|k| Vector3::new((k as f64).cos(), (k as f64).sin(), 0.0));
            for d in hemisphere(5000).chain(sites.iter().copied()).chain(edges) {
                assert_eq!(lookup.blend(&complex, &d), complex.blend(&d), "{d} among {}", sites.len());
            }
        }
    }

    #[test]
    fn no_direction_and_directions_below_are_answered_as_before() {
        let complex = DirectionComplex::build(&bonn_directions(), Layout::General);
        let lookup = Lookup::new(&complex);
        for d in [Vector3::zeros(), Vector3::new(f64::NAN, 0.0, 1.0), Vector3::new(0.3, 0.1, -0.9)] {
            assert_eq!(lookup.blend(&complex, &d), complex.blend(&d));
        }
        let none = DirectionComplex::build(&[], Layout::General);
        assert_eq!(Lookup::new(&none).blend(&none, &Vector3::z()), None);
    }
}
