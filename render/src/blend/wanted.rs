//! Which parts of an atlas a frame looks at.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Texels along the side of a block, the unit of what is blended or not.
pub(super) const BLOCK: usize = 1 << BLOCK_LEVEL;

/// The mip level at which a block is one texel.
pub(super) const BLOCK_LEVEL: usize = 4;

/// The blocks of an atlas that are looked at, and the coarsest mip level. Marked from many threads; the order does not
/// matter.
#[derive(Debug)]
pub struct Wanted {
    size: [usize; 2],
    /// Lookups on coarser levels than this reach no blocks: these levels are made without them.
    coarsest: usize,
    blocks: Vec<AtomicBool>,
    top: AtomicUsize,
}

impl Wanted {
    /// Nothing, of an atlas of this width and height of which every level is made from its texels.
    pub fn none(size: [usize; 2]) -> Self {
        Self::up_to(usize::MAX, size)
    }

    /// Nothing, of an atlas of which the texels make the levels up to `coarsest`.
    pub(super) fn up_to(coarsest: usize, [width, height]: [usize; 2]) -> Self {
        let count = width.div_ceil(BLOCK) * height.div_ceil(BLOCK);
        let blocks = std::iter::repeat_with(|| AtomicBool::new(false)).take(count).collect();
        Self { size: [width, height], coarsest, blocks, top: AtomicUsize::new(0) }
    }

    /// Everything, up to mip level `top`.
    pub fn all(size: [usize; 2], top: usize) -> Self {
        let wanted = Self::none(size);
        let [width, height] = size.map(|side| side as f64);
        wanted.mark([0.0, 0.0], [width, height], top);
        wanted
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.blocks.iter_mut().for_each(|block| *block.get_mut() = false);
        *self.top.get_mut() = 0;
    }

    /// Marks what trilinear lookups between `low` and `high` (in texels of level 0) reach on levels 0..=`level`: at level
    /// l, centres are 2^l apart and a lookup reaches to the next one, so texels reach 1.5 · 2^l far. NaN marks all.
    pub fn mark(&self, low: [f64; 2], high: [f64; 2], level: usize) {
        self.top.fetch_max(level, Ordering::Relaxed);
        let reach = 1.5 * (1u64 << level.min(self.coarsest).min(40)) as f64;
        let blocks = |k: usize| {
            let count = self.size[k].div_ceil(BLOCK);
            // Lookups beyond the border repeat it; casts saturate and take NaN to 0.
            let last = count.saturating_sub(1);
            let first = (((low[k] - reach) / BLOCK as f64) as usize).min(last);
            let end = if high[k].is_nan() { last } else { (((high[k] + reach) / BLOCK as f64) as usize).min(last) };
            first.min(end)..(end + 1).min(count)
        };
        let across = self.size[0].div_ceil(BLOCK);
        for row in blocks(1) {
            for block in &self.blocks[row * across..][blocks(0)] {
                // Most are marked already: a load shares the line of cache, a store would take it.
                if !block.load(Ordering::Relaxed) {
                    block.store(true, Ordering::Relaxed);
                }
            }
        }
    }

    /// The coarsest mip level asked for.
    pub fn top(&self) -> usize {
        self.top.load(Ordering::Relaxed)
    }

    /// Whether a block, counted row by row, is looked at.
    pub(super) fn holds(&self, block: usize) -> bool {
        self.blocks[block].load(Ordering::Relaxed)
    }

    /// Blocks looked at, as a share of all; 0 without any.
    pub fn share(&self) -> f64 {
        let marked = (0..self.blocks.len()).filter(|&block| self.holds(block)).count();
        marked as f64 / self.blocks.len().max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn marked(wanted: &Wanted) -> Vec<usize> {
        (0..wanted.blocks.len()).filter(|&b| wanted.holds(b)).collect()
    }

    #[test]
    fn lookups_reach_into_neighbouring_blocks() {
        let mut wanted = Wanted::none([64, 40]);
        wanted.mark([20.0, 20.0], [28.0, 21.0], 0);
        assert_eq!(marked(&wanted), [5]);
        wanted.clear();
        wanted.mark([20.0, 20.0], [31.0, 21.0], 0);
        assert_eq!(marked(&wanted), [5, 6]);
        wanted.clear();
        wanted.mark([20.0, 20.0], [21.0, 21.0], 2);
        assert_eq!((marked(&wanted), wanted.top()), (vec![0, 1, 4, 5], 2));
    }

    #[test]
    fn nowhere_and_everywhere_are_inside() {
        for (low, high) in [(f64::NAN, f64::NAN), (f64::NEG_INFINITY, f64::INFINITY), (-9.0, 1e9)] {
            let wanted = Wanted::none([50, 33]);
            wanted.mark([low; 2], [high; 2], 70);
            assert_eq!(wanted.share(), 1.0);
        }
        let beyond = Wanted::none([50, 33]);
        beyond.mark([1e9; 2], [1e9; 2], 0);
        assert_eq!(marked(&beyond), [11]);
        assert_eq!(Wanted::all([0, 0], 3).share(), 0.0);
    }
}
