//! Packing of shapes made of cells, by bitmaps.
//!
//! Largest first, every shape goes where its top is lowest, in the best of four quarter turns. All
//! positions of a row are tried at once: a 1 in `blocked` says that the shape cannot start there, and a
//! run of cells blocks what the smeared occupancy of its row says (64 positions a word). Several widths
//! are packed in parallel, and the smallest nearly square result wins. Cost per shape: rows of the
//! atlas × rows of the shape × words per row.

use nalgebra::{Point2, Vector2};
use rayon::prelude::*;
use std::ops::Range;

/// Atlas widths tried, over the square root of the cells to pack.
const WIDTHS: [f64; 6] = [1.0, 1.04, 1.08, 1.12, 1.16, 1.22];

/// Up to this ratio of its sides an atlas counts as square.
const SQUARE: f64 = 1.15;

/// Cells a chart and its share of the gutter cover.
pub(super) struct Shape {
    width: usize,
    height: usize,
    cells: usize,
    /// Per quarter turn and row the runs of covered cells.
    turns: [Vec<Vec<Range<usize>>>; 4],
}

/// Where a shape went: cells of its upper left corner, and quarter turns before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) x: usize,
    pub(super) y: usize,
    pub(super) turns: usize,
}

/// Places of all shapes, and the width and height in cells.
pub(super) struct Packed {
    pub(super) places: Vec<Place>,
    pub(super) size: [usize; 2],
}

impl Shape {
    /// The cells of a `width` × `height` grid whose square, grown by `margin`, meets a triangle.
    pub(super) fn covering(
        width: usize,
        height: usize,
        triangles: impl Iterator<Item = [Point2<f64>; 3]>,
        margin: f64,
    ) -> Self {
        let mut grid = vec![false; width * height];
        for triangle in triangles {
            mark(&mut grid, [width, height], &triangle, margin);
        }
        let cells = grid.iter().filter(|&&c| c).count();
        let quarter = turn_grid(&grid, width, height);
        let half: Vec<bool> = grid.iter().rev().copied().collect();
        let three_quarters: Vec<bool> = quarter.iter().rev().copied().collect();
        let turns = [runs(&grid, width), runs(&quarter, height), runs(&half, width), runs(&three_quarters, height)];
        Self { width, height, cells, turns }
    }

    /// A point of the shape, in cells, after quarter turns.
    pub(super) fn turned(&self, p: Vector2<f64>, turns: usize) -> Vector2<f64> {
        let (w, h) = (self.width as f64, self.height as f64);
        match turns {
            0 => p,
            1 => Vector2::new(h - p.y, p.x),
            2 => Vector2::new(w - p.x, h - p.y),
            _ => Vector2::new(p.y, w - p.x),
        }
    }

    fn size(&self, turns: usize) -> [usize; 2] {
        if turns.is_multiple_of(2) { [self.width, self.height] } else { [self.height, self.width] }
    }
}

/// Packs shapes; width and height are multiples of `unit` cells.
pub(super) fn pack(shapes: &[Shape], unit: usize) -> Packed {
    let mut order: Vec<usize> = (0..shapes.len()).collect();
    order.sort_by_key(|&i| (std::cmp::Reverse(shapes[i].cells), i));
    let side = (shapes.iter().map(|s| s.cells).sum::<usize>() as f64).sqrt();
    let narrowest = shapes.iter().map(|s| s.width.min(s.height)).max().unwrap_or(1);
    let width = |w: f64| ((side * w) as usize).max(narrowest).div_ceil(unit).max(1) * unit;
    let mut widths = WIDTHS.map(width).to_vec();
    widths.dedup();
    let packed: Vec<Packed> = widths.into_par_iter().map(|w| pack_width(shapes, &order, w, unit)).collect();
    let best = packed.into_iter().min_by(|a, b| waste(a.size).total_cmp(&waste(b.size)));
    best.unwrap_or(Packed { places: Vec::new(), size: [unit; 2] })
}

/// Area, more of it for a long atlas.
fn waste([width, height]: [usize; 2]) -> f64 {
    let (long, short) = (width.max(height) as f64, width.min(height) as f64);
    long * short * (long / short / SQUARE).max(1.0)
}

fn pack_width(shapes: &[Shape], order: &[usize], width: usize, unit: usize) -> Packed {
    let mut bin = Bin { width, words: width.div_ceil(64), rows: Vec::new(), height: 0 };
    let mut places = vec![Place::default(); shapes.len()];
    for &i in order {
        let fits = (0..4).filter(|&t| shapes[i].size(t)[0] <= width);
        let tops = fits.map(|turns| {
            let place = bin.first_fit(&shapes[i], turns);
            (place.y + shapes[i].size(turns)[1], place.y, place.x, turns)
        });
        let Some((_, y, x, turns)) = tops.min() else { continue };
        places[i] = Place { x, y, turns };
        bin.put(&shapes[i], places[i]);
    }
    Packed { places, size: [width, bin.height.div_ceil(unit).max(1) * unit] }
}

/// Occupied cells, row by row, bit `x % 64` of word `x / 64`; rows beyond the last are free.
struct Bin {
    width: usize,
    words: usize,
    rows: Vec<u64>,
    height: usize,
}

impl Bin {
    /// The lowest row, and in it the leftmost column, where a shape fits.
    fn first_fit(&self, shape: &Shape, turns: usize) -> Place {
        let rows = &shape.turns[turns];
        let last = self.width - shape.size(turns)[0];
        // Rows with the longest runs block the most: tried first, they end most attempts.
        let mut hardest: Vec<usize> = (0..rows.len()).collect();
        hardest.sort_by_key(|&r| (std::cmp::Reverse(rows[r].iter().map(Range::len).max()), r));
        let mut blocked = vec![0; self.words];
        let mut scratch = vec![0; self.words];
        for y in 0..self.height {
            blocked.fill(0);
            block_beyond(&mut blocked, last);
            let mut free = true;
            for &r in hardest.iter().filter(|&&r| y + r < self.height) {
                let row = &self.rows[(y + r) * self.words..][..self.words];
                rows[r].iter().for_each(|run| block(row, run, &mut scratch, &mut blocked));
                free = blocked.iter().any(|&w| w != u64::MAX);
                if !free {
                    break;
                }
            }
            if let (true, Some(word)) = (free, blocked.iter().position(|&w| w != u64::MAX)) {
                return Place { x: 64 * word + blocked[word].trailing_ones() as usize, y, turns };
            }
        }
        Place { x: 0, y: self.height, turns }
    }

    fn put(&mut self, shape: &Shape, place: Place) {
        self.height = self.height.max(place.y + shape.size(place.turns)[1]);
        self.rows.resize(self.height * self.words, 0);
        for (row, y) in shape.turns[place.turns].iter().zip(place.y..) {
            for x in row.iter().flat_map(|run| run.clone()) {
                self.rows[y * self.words + (place.x + x) / 64] |= 1 << ((place.x + x) % 64);
            }
        }
    }
}

/// Marks all positions after `last`.
fn block_beyond(blocked: &mut [u64], last: usize) {
    for (i, word) in blocked.iter_mut().enumerate() {
        let first = (last + 1).saturating_sub(64 * i);
        if first < 64 {
            *word |= u64::MAX << first;
        }
    }
}

/// Marks the positions `p` at which a cell `p + c`, `c` in `run`, is occupied.
fn block(row: &[u64], run: &Range<usize>, scratch: &mut [u64], blocked: &mut [u64]) {
    if row.iter().all(|&w| w == 0) {
        return;
    }
    scratch.copy_from_slice(row);
    shift_down(scratch, run.start, false);
    // Smear over the run's length by doubling.
    let mut reach = 1;
    while reach < run.len() {
        let step = reach.min(run.len() - reach);
        shift_down(scratch, step, true);
        reach += step;
    }
    blocked.iter_mut().zip(scratch).for_each(|(b, s)| *b |= *s);
}

/// `bits >> by`, or `bits | bits >> by`, in place; lower words first, so no source is overwritten.
fn shift_down(bits: &mut [u64], by: usize, keep: bool) {
    let (words, shift) = (by / 64, by % 64);
    for i in 0..bits.len() {
        let low = bits.get(i + words).copied().unwrap_or(0);
        let high = bits.get(i + words + 1).copied().unwrap_or(0);
        let moved = if shift == 0 { low } else { (low >> shift) | (high << (64 - shift)) };
        bits[i] = if keep { bits[i] | moved } else { moved };
    }
}

/// Separating axes: the grid's own by the loop's bounds, the triangle's edges by a linear function's
/// extreme over the cell.
fn mark(grid: &mut [bool], [width, height]: [usize; 2], t: &[Point2<f64>; 3], margin: f64) {
    let range = |axis: usize, cells: usize| {
        let [low, high] = [f64::min, f64::max].map(|pick| pick(pick(t[0][axis], t[1][axis]), t[2][axis]));
        let first = (low - margin).floor().max(0.0) as usize;
        first..((high + margin).ceil().max(0.0) as usize).min(cells)
    };
    let edges = [0, 1, 2].map(|k| inward(t, k));
    for y in range(1, height) {
        for x in range(0, width) {
            let center = Vector2::new(x as f64 + 0.5, y as f64 + 0.5);
            let reach = 0.5 + margin;
            let outside = |(n, d): &(Vector2<f64>, f64)| n.dot(&center) - d + reach * (n.x.abs() + n.y.abs()) < 0.0;
            if !edges.iter().any(outside) {
                grid[y * width + x] = true;
            }
        }
    }
}

/// The half-plane `n·p >= d` in which the triangle lies that has edge `k` on its border.
fn inward(t: &[Point2<f64>; 3], k: usize) -> (Vector2<f64>, f64) {
    let (a, b, c) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
    let n = Vector2::new(a.y - b.y, b.x - a.x);
    let n = if n.dot(&(c - a)) < 0.0 { -n } else { n };
    (n, n.dot(&a.coords))
}

/// A quarter turn: (x, y) goes to (height - 1 - y, x).
fn turn_grid(grid: &[bool], width: usize, height: usize) -> Vec<bool> {
    (0..width * height).map(|i| grid[(height - 1 - i % height) * width + i / height]).collect()
}

fn runs(grid: &[bool], width: usize) -> Vec<Vec<Range<usize>>> {
    grid.chunks_exact(width)
        .map(|row| {
            let mut runs: Vec<Range<usize>> = Vec::new();
            for x in (0..width).filter(|&x| row[x]) {
                match runs.last_mut() {
                    Some(run) if run.end == x => run.end = x + 1,
                    _ => runs.push(x..x + 1),
                }
            }
            runs
        })
        .collect()
}
