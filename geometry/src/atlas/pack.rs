//! Packing of shapes made of cells, by bitmaps.
//!
//! One after the other, every shape goes where it reaches least far down, in the best of four quarter
//! turns. All positions of a row are tried at once: a 1 in `blocked` says that the shape cannot start
//! there, and a run of cells blocks what the smeared occupancy of its row says (64 positions a word).
//! Cost per shape: rows of the atlas × rows of the shape × words per row.
//!
//! What decides the fill is the order and the width. The search starts from the usual orders, largest
//! first, and goes on from the best one by moving a few shapes to other places in it, in generations of
//! parallel trials with numbers from a fixed seed; the smallest nearly square result wins, the earlier
//! of equals. So the result does not depend on threads or time.

use nalgebra::{Point2, Vector2};
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;

/// Atlas widths tried, over the square root of the cells to pack.
const WIDTHS: [f64; 8] = [1.0, 1.03, 1.06, 1.09, 1.12, 1.15, 1.18, 1.22];

/// Trials of one generation.
const GENERATION: usize = 16;

/// Generations at most; later ones gain little.
const GENERATIONS: usize = 32;

/// Word operations, by [`cost_of_trial`], that one search may cost: about a second of one core, as
/// most of them are saved by looking at gaps first and by giving up on trials that waste more.
const BUDGET: f64 = 3e10;

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

/// Places of all shapes, the width and height in cells, and how they were found.
pub(super) struct Packed {
    pub(super) places: Vec<Place>,
    pub(super) size: [usize; 2],
    pub(super) plan: Plan,
    waste: f64,
}

/// Which shape comes when, and whether its centre or its far edge shall be low.
#[derive(Clone, Debug, Default)]
pub(super) struct Plan {
    order: Vec<usize>,
    by_center: bool,
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

/// Packs shapes in the best order found; width and height are multiples of `unit` cells.
pub(super) fn pack(shapes: &[Shape], unit: usize) -> Packed {
    let trials = (BUDGET / cost_of_trial(shapes)) as usize;
    let first = |i: usize| {
        let plan = Plan { order: order_of(shapes, i % 2 == 1), by_center: i / 2 % 2 == 1 };
        pack_width(shapes, plan, width_of(shapes, WIDTHS[i / 4 * 2 % WIDTHS.len()], unit), unit, f64::INFINITY)
    };
    let mut best = smallest((0..trials.clamp(1, GENERATION)).into_par_iter().map(first).collect(), unit);
    for generation in 1..(trials / GENERATION).min(GENERATIONS) {
        let next = |i: usize| {
            let seed = generation * GENERATION + i;
            let width = width_of(shapes, WIDTHS[hash(seed) % WIDTHS.len()], unit);
            pack_width(shapes, best.plan.varied(seed), width, unit, best.waste)
        };
        let mut found: Vec<Packed> = (0..GENERATION).into_par_iter().map(next).collect();
        found.insert(0, best);
        best = smallest(found, unit);
    }
    best
}

fn smallest(packed: Vec<Packed>, unit: usize) -> Packed {
    let best = packed.into_iter().min_by(|a, b| a.waste.total_cmp(&b.waste));
    best.unwrap_or(Packed { places: Vec::new(), size: [unit; 2], waste: 0.0, plan: Plan::default() })
}

/// Shapes × half the rows of the atlas × rows of a shape × words of a row × smears × turns.
fn cost_of_trial(shapes: &[Shape]) -> f64 {
    let side = side_of(shapes);
    let rows: usize = shapes.iter().map(|s| s.height).sum();
    0.5 * side * rows as f64 * (side / 64.0).ceil() * 24.0 + 1.0
}

fn side_of(shapes: &[Shape]) -> f64 {
    (shapes.iter().map(|s| s.cells).sum::<usize>() as f64).sqrt()
}

fn width_of(shapes: &[Shape], factor: f64, unit: usize) -> usize {
    let narrowest = shapes.iter().map(|s| s.width.min(s.height)).max().unwrap_or(1);
    ((side_of(shapes) * factor) as usize).max(narrowest).div_ceil(unit).max(1) * unit
}

/// Largest first, by cells or by the longer side.
fn order_of(shapes: &[Shape], by_side: bool) -> Vec<usize> {
    let key = |i: usize| if by_side { shapes[i].width.max(shapes[i].height) } else { shapes[i].cells };
    let mut order: Vec<usize> = (0..shapes.len()).collect();
    order.sort_by_key(|&i| (std::cmp::Reverse(key(i)), i));
    order
}

impl Plan {
    /// The plan with one to four shapes moved to other places in the order.
    fn varied(&self, seed: usize) -> Self {
        let mut varied = self.clone();
        let n = varied.order.len();
        for i in 0..1 + hash(2 * seed) % 4 {
            let [from, to] = [0, 1].map(|k| hash(seed * 64 + 2 * i + k) % n.max(1));
            if n > 1 {
                let shape = varied.order.remove(from);
                varied.order.insert(to, shape);
            }
        }
        varied
    }
}

/// Some bits that look random (the finaliser of MurmurHash3).
fn hash(i: usize) -> usize {
    let mut h = i as u64 + 0x9E37_79B9_7F4A_7C15;
    h = (h ^ (h >> 33)).wrapping_mul(0xFF51_AFD7_ED55_8CCD);
    h = (h ^ (h >> 33)).wrapping_mul(0xC4CE_B9FE_1A85_EC53);
    ((h ^ (h >> 33)) >> 32) as usize
}

/// Area, more of it for a long atlas.
fn waste([width, height]: [usize; 2]) -> f64 {
    let (long, short) = (width.max(height) as f64, width.min(height) as f64);
    long * short * (long / short / SQUARE).max(1.0)
}

/// Packs by a plan; gives up, with infinite waste, as soon as it wastes more than `most`.
fn pack_width(shapes: &[Shape], plan: Plan, width: usize, unit: usize, most: f64) -> Packed {
    let mut bin = Bin { width, words: width.div_ceil(64), rows: Vec::new(), height: 0, gaps: Vec::new() };
    let mut places = vec![Place::default(); shapes.len()];
    // Equal shapes never fit lower than the one before.
    let mut lowest: HashMap<&[Vec<Range<usize>>], usize> = HashMap::new();
    for &i in &plan.order {
        let mut best = (usize::MAX, Place::default());
        for turns in (0..4).filter(|&t| shapes[i].size(t)[0] <= width) {
            let size = shapes[i].size(turns)[1];
            let reach = |y: usize| if plan.by_center { 2 * y + size } else { y + size };
            let first = lowest.entry(&shapes[i].turns[turns]).or_insert(0);
            let place = bin.first_fit(&shapes[i], turns, *first, |y| reach(y) < best.0);
            if let Some(place) = place {
                *first = place.y;
                best = (reach(place.y), place);
            }
        }
        places[i] = best.1;
        bin.put(&shapes[i], places[i]);
        if waste([width, bin.height]) > most {
            return Packed { places, size: [width, usize::MAX], waste: f64::INFINITY, plan };
        }
    }
    // Judged by the rows in use: the rounded height would hide small gains.
    let waste = waste([width, bin.height]);
    Packed { places, size: [width, bin.height.div_ceil(unit).max(1) * unit], waste, plan }
}

/// Occupied cells, row by row, bit `x % 64` of word `x / 64`; rows beyond the last are free.
struct Bin {
    width: usize,
    words: usize,
    rows: Vec<u64>,
    height: usize,
    /// Per row its longest run of free cells.
    gaps: Vec<usize>,
}

impl Bin {
    /// The lowest row from `first` on, and in it the leftmost column, where a shape fits; `None` if no
    /// row is `worth` it.
    fn first_fit(&self, shape: &Shape, turns: usize, first: usize, worth: impl Fn(usize) -> bool) -> Option<Place> {
        let rows = &shape.turns[turns];
        let last = self.width - shape.size(turns)[0];
        // Rows with the longest runs block the most: tried first, they end most attempts.
        let mut hardest: Vec<usize> = (0..rows.len()).collect();
        hardest.sort_by_key(|&r| (std::cmp::Reverse(rows[r].iter().map(Range::len).max()), r));
        let longest: Vec<usize> = rows.iter().map(|row| row.iter().map(Range::len).max().unwrap_or(0)).collect();
        let (mut blocked, mut scratch) = (vec![0; self.words], vec![0; self.words]);
        for y in (first..self.height).take_while(|&y| worth(y)) {
            // Most rows have no gap as long as the shape's runs; that is seen without any bitmap.
            if hardest.iter().any(|&r| self.gaps.get(y + r).is_some_and(|&gap| gap < longest[r])) {
                continue;
            }
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
                return Some(Place { x: 64 * word + blocked[word].trailing_ones() as usize, y, turns });
            }
        }
        worth(self.height).then_some(Place { x: 0, y: self.height, turns })
    }

    fn longest_gap(&self, y: usize) -> usize {
        let row = &self.rows[y * self.words..][..self.words];
        let (mut longest, mut gap) = (0, 0);
        for x in 0..self.width {
            gap = if row[x / 64] >> (x % 64) & 1 == 0 { gap + 1 } else { 0 };
            longest = longest.max(gap);
        }
        longest
    }

    fn put(&mut self, shape: &Shape, place: Place) {
        self.height = self.height.max(place.y + shape.size(place.turns)[1]);
        self.rows.resize(self.height * self.words, 0);
        self.gaps.resize(self.height, self.width);
        for (row, y) in shape.turns[place.turns].iter().zip(place.y..) {
            for x in row.iter().flat_map(|run| run.clone()) {
                self.rows[y * self.words + (place.x + x) / 64] |= 1 << ((place.x + x) % 64);
            }
            self.gaps[y] = self.longest_gap(y);
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
