//! The cheapest border between two sides on a grid of pixels: minimum cut by maximum flow.
//!
//! With cost `c_p` of putting pixel p outside (of putting it inside where negative) and `w_pq` of a border between
//! neighbours, the labels that minimise `Σ c + Σ w` are a minimum cut. Two trees of unsaturated arcs grow from the
//! terminals until they touch; flow along the path saturates arcs, and what hung on them is adopted again
//! (Boykov and Kolmogorov, An Experimental Comparison of Min-Cut/Max-Flow Algorithms for Energy Minimization in
//! Vision, PAMI 26(9), 2004).

use crate::Image;
use std::collections::VecDeque;

/// Right, left, down, up; the opposite of a direction differs in the last bit.
const DIRECTIONS: [u8; 4] = [0, 1, 2, 3];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Free,
    Inside,
    Outside,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Parent {
    None,
    Terminal,
    Neighbour(u8),
}

/// Costs on a grid of pixels, and the flow through it.
#[derive(Debug)]
pub(super) struct Cut {
    width: usize,
    /// Per pixel what is left of the arc from the inner terminal, or (negative) to the outer one.
    terminal: Vec<i32>,
    /// Per direction and pixel what is left of the arc to the neighbour there; 0 at the border of the grid.
    arcs: [Vec<i32>; 4],
    side: Vec<Side>,
    parent: Vec<Parent>,
    active: VecDeque<usize>,
    orphans: Vec<usize>,
}

impl Cut {
    /// `inside`: what each pixel loses outside, or gains there where it is negative. `right` and `down`: the cost, at
    /// least 0, of a border towards the next pixel of the row and of the column. Values of some 10⁶ at most.
    pub(super) fn new(inside: &Image<i32>, right: &Image<i32>, down: &Image<i32>) -> Self {
        let (width, height) = (inside.width(), inside.height());
        let count = width * height;
        let mut arcs = [0, 1, 2, 3].map(|_| vec![0; count]);
        for at in 0..count {
            if !(at + 1).is_multiple_of(width) {
                arcs[0][at] = right.pixels()[at];
                arcs[1][at + 1] = right.pixels()[at];
            }
            if at + width < count {
                arcs[2][at] = down.pixels()[at];
                arcs[3][at + width] = down.pixels()[at];
            }
        }
        Self {
            width,
            terminal: inside.pixels().to_vec(),
            arcs,
            side: vec![Side::Free; count],
            parent: vec![Parent::None; count],
            active: VecDeque::new(),
            orphans: Vec::new(),
        }
    }

    /// Which pixels are inside; of several cheapest borders the innermost.
    pub(super) fn inside(mut self) -> Image<bool> {
        for at in 0..self.terminal.len() {
            if self.terminal[at] != 0 {
                self.side[at] = if self.terminal[at] > 0 { Side::Inside } else { Side::Outside };
                self.parent[at] = Parent::Terminal;
                self.active.push_back(at);
            }
        }
        while let Some(&at) = self.active.front() {
            match self.touching(at) {
                Some((from, direction)) => {
                    self.augment(from, direction);
                    self.adopt();
                }
                None => {
                    self.active.pop_front();
                }
            }
        }
        let height = self.side.len() / self.width.max(1);
        let inside = self.side.iter().map(|s| *s == Side::Inside).collect();
        Image::from_pixels(self.width, height, inside).unwrap_or_else(|| Image::filled(0, 0, false))
    }

    fn next(&self, at: usize, direction: u8) -> usize {
        match direction {
            0 => at + 1,
            1 => at - 1,
            2 => at + self.width,
            _ => at - self.width,
        }
    }

    /// The neighbour, where there is one: at the border no arc leads on.
    fn neighbour(&self, at: usize, direction: u8) -> Option<usize> {
        let is_inside = match direction {
            0 => !(at + 1).is_multiple_of(self.width),
            1 => !at.is_multiple_of(self.width),
            2 => at + self.width < self.side.len(),
            _ => at >= self.width,
        };
        is_inside.then(|| self.next(at, direction))
    }

    /// What is left from a pixel to its neighbour `next`, in the direction of the flow of the tree of `side`.
    fn left(&self, side: Side, at: usize, next: usize, direction: u8) -> i32 {
        match side {
            Side::Inside => self.arcs[usize::from(direction)][at],
            _ => self.arcs[usize::from(direction ^ 1)][next],
        }
    }

    /// Lets a tree grow from `at`; the arc from the inner to the outer tree where they touch.
    fn touching(&mut self, at: usize) -> Option<(usize, u8)> {
        let side = self.side[at];
        if side == Side::Free {
            return None;
        }
        for direction in DIRECTIONS {
            let Some(next) = self.neighbour(at, direction) else { continue };
            if self.left(side, at, next, direction) == 0 {
                continue;
            }
            if self.side[next] == Side::Free {
                self.side[next] = side;
                self.parent[next] = Parent::Neighbour(direction ^ 1);
                self.active.push_back(next);
            } else if self.side[next] != side {
                return Some(if side == Side::Inside { (at, direction) } else { (next, direction ^ 1) });
            }
        }
        None
    }

    /// Sends what it can along the path through an arc from the inner to the outer tree.
    fn augment(&mut self, from: usize, direction: u8) {
        let to = self.next(from, direction);
        let arc = self.arcs[usize::from(direction)][from];
        let amount = arc.min(self.room(from, Side::Inside)).min(self.room(to, Side::Outside));
        self.arcs[usize::from(direction)][from] -= amount;
        self.arcs[usize::from(direction ^ 1)][to] += amount;
        self.send(from, Side::Inside, amount);
        self.send(to, Side::Outside, amount);
    }

    /// The narrowest place of the path from a pixel to its terminal.
    fn room(&self, mut at: usize, side: Side) -> i32 {
        let mut room = i32::MAX;
        while let Parent::Neighbour(direction) = self.parent[at] {
            let parent = self.next(at, direction);
            room = room.min(self.left(side, parent, at, direction ^ 1));
            at = parent;
        }
        room.min(self.terminal[at].abs())
    }

    fn send(&mut self, mut at: usize, side: Side, amount: i32) {
        while let Parent::Neighbour(direction) = self.parent[at] {
            let parent = self.next(at, direction);
            let (ahead, back) = match side {
                Side::Inside => ((direction ^ 1, parent), (direction, at)),
                _ => ((direction, at), (direction ^ 1, parent)),
            };
            self.arcs[usize::from(ahead.0)][ahead.1] -= amount;
            self.arcs[usize::from(back.0)][back.1] += amount;
            if self.arcs[usize::from(ahead.0)][ahead.1] == 0 {
                self.orphan(at);
            }
            at = parent;
        }
        self.terminal[at] -= amount * if side == Side::Inside { 1 } else { -1 };
        if self.terminal[at] == 0 {
            self.orphan(at);
        }
    }

    fn orphan(&mut self, at: usize) {
        self.parent[at] = Parent::None;
        self.orphans.push(at);
    }

    /// Finds parents for orphans in their own tree, or sets them free.
    fn adopt(&mut self) {
        while let Some(at) = self.orphans.pop() {
            let side = self.side[at];
            let is_parent = |&direction: &u8| {
                self.neighbour(at, direction).is_some_and(|next| {
                    self.side[next] == side && self.left(side, next, at, direction ^ 1) > 0 && self.is_rooted(next)
                })
            };
            if let Some(direction) = DIRECTIONS.into_iter().find(is_parent) {
                self.parent[at] = Parent::Neighbour(direction);
                continue;
            }
            for direction in DIRECTIONS {
                let Some(next) = self.neighbour(at, direction).filter(|n| self.side[*n] == side) else { continue };
                if self.left(side, next, at, direction ^ 1) > 0 {
                    self.active.push_back(next);
                }
                if self.parent[next] == Parent::Neighbour(direction ^ 1) {
                    self.orphan(next);
                }
            }
            self.side[at] = Side::Free;
        }
    }

    fn is_rooted(&self, mut at: usize) -> bool {
        while let Parent::Neighbour(direction) = self.parent[at] {
            at = self.next(at, direction);
        }
        self.parent[at] == Parent::Terminal
    }
}
