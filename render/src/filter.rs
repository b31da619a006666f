//! The texture filter both renderers share: mip chain by 2 × 2 boxes, bilinear, trilinear.
//!
//! Everything is linear in the texels and nothing clamps, so filtering commutes with the blend of
//! layers that made the atlas: mip-then-blend equals blend-then-mip.
//!
//! Texel (i, j) of level `l` covers `[i 2^l, (i+1) 2^l)` of level 0, for any size: an odd size is
//! rounded up and its last texel repeated. Lookups beyond the border repeat the border. The gutters
//! of the atlas are expected to be filled (push–pull), so that every level is usable.

use capture::Image;
use rayon::prelude::*;
use std::borrow::Cow;

/// Mip levels below this count as level 0. A 1:1 view then reads level 0 alone despite rounding;
/// graphics hardware quantises levels to the same 1/256.
const MIN_LEVEL: f32 = 1.0 / 256.0;

/// More levels than any image has, and few enough for the exponent of a float.
const MOST_LEVELS: usize = 30;

/// Eight numbers in a register: two texels side by side, and two numbers of the next.
pub trait Eight: Copy {
    /// From memory.
    fn load(from: &[i16; 8]) -> Self;

    /// `self` at `t = 0`, `to` at `t = 2^15`: `self + (to − self) t / 2^15`, rounded half up. Wraps where a difference
    /// leaves 16 bits.
    fn toward(self, to: Self, t: i16) -> Self;

    /// The second texel in the place of the first.
    fn second(self) -> Self;

    /// The first texel, and a number more.
    fn first(self) -> [i16; 4];

    /// What is before the decimal point of numbers that 32 bits hold.
    fn whole(numbers: &[f32; PLACES]) -> [i32; PLACES];
}

/// Places looked up side by side.
pub(crate) const PLACES: usize = 8;

impl Eight for [i16; 8] {
    #[inline(always)]
    fn load(from: &[i16; 8]) -> Self {
        *from
    }

    #[inline(always)]
    fn toward(self, to: Self, t: i16) -> Self {
        let mut out = self;
        for k in 0..8 {
            let product = i32::from(to[k].wrapping_sub(self[k])) * i32::from(t);
            out[k] = out[k].wrapping_add((((product >> 14) + 1) >> 1) as i16);
        }
        out
    }

    #[inline(always)]
    fn second(self) -> Self {
        let [.., d, e, f, g, h] = self;
        [d, e, f, g, h, 0, 0, 0]
    }

    #[inline(always)]
    fn first(self) -> [i16; 4] {
        let [a, b, c, d, ..] = self;
        [a, b, c, d]
    }

    #[inline(always)]
    fn whole(numbers: &[f32; PLACES]) -> [i32; PLACES] {
        let mut whole = [0; PLACES];
        for k in 0..PLACES {
            whole[k] = numbers[k] as i32;
        }
        whole
    }
}

/// A channel of a texel: `f32` in levels of 0..=255, or `i16` in shares of one ([`FIXED_ONE`]).
pub trait Channel: Copy + Default + Send + Sync + std::fmt::Debug + 'static {
    /// Levels of 0..=255 per unit.
    const LEVELS: f32;

    /// How far a place is on the way from one texel to the next, as [`Channel::mix`] takes it.
    type Share: Copy + Default + std::fmt::Debug;

    /// Of shares between 0 and 1.
    fn shares<E: Eight>(shares: &[f32; PLACES]) -> [Self::Share; PLACES];

    /// As it is, in its own units.
    fn widened(self) -> f32;

    /// Rounds to the nearest of 0..=255; NaN becomes 0.
    fn rounded(self) -> u8;

    /// The mean of four; whole numbers round half up.
    fn mean(four: [Self; 4]) -> Self;

    /// Two texels of two rows each, mixed: `s` across, `t` down. Of two such, `fine` and `coarse`, at `level` between
    /// them. The fourth number is none.
    fn mix<E: Eight>(fine: &Taps<'_, Self>, coarse: Option<(&Taps<'_, Self>, Self::Share)>) -> [Self; 4];
}

/// What a lookup on one level reads: of two rows two texels side by side and two numbers of the next, and how far the place
/// is on the way from the first to the second.
#[derive(Clone, Copy, Debug)]
pub struct Taps<'a, T: Channel> {
    rows: [&'a [T; 8]; 2],
    across: T::Share,
    down: T::Share,
}

/// Binary places of a texel in fixed point, which so reaches from −1024 to 1023.97 levels of 0..=255.
pub const FIXED_PLACES: u32 = 5;

/// One level of 0..=255 in a texel of fixed point.
pub const FIXED_ONE: f32 = (1 << FIXED_PLACES) as f32;

impl Channel for f32 {
    const LEVELS: Self = 1.0;

    type Share = Self;

    #[inline(always)]
    fn shares<E: Eight>(shares: &[f32; PLACES]) -> [Self; PLACES] {
        *shares
    }

    #[inline(always)]
    fn widened(self) -> f32 {
        self
    }

    #[inline(always)]
    fn rounded(self) -> u8 {
        // A cast saturates, and truncates what is positive.
        (self + 0.5) as u8
    }

    #[inline(always)]
    fn mean([a, b, c, d]: [Self; 4]) -> Self {
        0.25 * (a + b + c + d)
    }

    #[inline(always)]
    fn mix<E: Eight>(fine: &Taps<'_, Self>, coarse: Option<(&Taps<'_, Self>, Self::Share)>) -> [Self; 4] {
        let bilinear = |taps: &Taps<'_, Self>| {
            // Plain loops: `map` over an array is not always inlined.
            let (mut columns, mut out) = (*taps.rows[0], [0.0; 4]);
            for k in 0..8 {
                columns[k] += taps.down * (taps.rows[1][k] - columns[k]);
            }
            for k in 0..3 {
                out[k] = columns[k] + taps.across * (columns[k + 3] - columns[k]);
            }
            out
        };
        let mut out = bilinear(fine);
        if let Some((taps, share)) = coarse {
            let coarse = bilinear(taps);
            for k in 0..4 {
                out[k] += share * (coarse[k] - out[k]);
            }
        }
        out
    }
}

/// Whole numbers all the way, the same on every machine; each of three steps rounds by 1/64 level at most.
impl Channel for i16 {
    const LEVELS: f32 = 1.0 / FIXED_ONE;

    type Share = Self;

    #[inline(always)]
    fn shares<E: Eight>(shares: &[f32; PLACES]) -> [Self; PLACES] {
        let mut fixed = [0.0; PLACES];
        for k in 0..PLACES {
            fixed[k] = shares[k] * f32::from(Self::MAX);
        }
        let (whole, mut out) = (E::whole(&fixed), [0; PLACES]);
        for k in 0..PLACES {
            out[k] = whole[k] as Self;
        }
        out
    }

    #[inline(always)]
    fn widened(self) -> f32 {
        f32::from(self)
    }

    #[inline(always)]
    fn rounded(self) -> u8 {
        (self.saturating_add(1 << FIXED_PLACES >> 1) >> FIXED_PLACES).clamp(0, 255) as u8
    }

    #[inline(always)]
    fn mean(four: [Self; 4]) -> Self {
        let [a, b, c, d] = four.map(i32::from);
        ((a + b + c + d + 2) >> 2) as Self
    }

    #[inline(always)]
    fn mix<E: Eight>(fine: &Taps<'_, Self>, coarse: Option<(&Taps<'_, Self>, Self::Share)>) -> [Self; 4] {
        let bilinear = |taps: &Taps<'_, Self>| {
            let [above, below] = taps.rows.map(E::load);
            let columns = above.toward(below, taps.down);
            columns.toward(columns.second(), taps.across)
        };
        match coarse {
            None => bilinear(fine).first(),
            Some((taps, share)) => bilinear(fine).toward(bilinear(taps), share).first(),
        }
    }
}

/// `log2(1 + m) = m (1 + (1 − m) P(m))`: coefficients of P.
const LOG2: [f32; 4] = [0.441_917_04, -0.267_179_4, 0.148_426_6, -0.045_149_03];

/// An atlas and as many reductions of it as were asked for.
#[derive(Clone, Debug)]
pub struct MipChain<'a, T: Channel = f32> {
    base: &'a Image<[T; 3]>,
    reduced: Cow<'a, [Image<[T; 3]>]>,
}

impl<'a, T: Channel> MipChain<'a, T> {
    /// The atlas with levels 1 ..= `top`, or up to the level of one texel where that is lower.
    pub fn build(base: &'a Image<[T; 3]>, top: usize) -> Self {
        let top = top.min(top_level(base.width(), base.height()));
        let mut reduced: Vec<Image<[T; 3]>> = Vec::with_capacity(top);
        for _ in 0..top {
            let next = halved(reduced.last().unwrap_or(base));
            reduced.push(next);
        }
        Self { base, reduced: reduced.into() }
    }

    /// Levels made elsewhere: level 0, and those from 1 on.
    pub(crate) fn of(base: &'a Image<[T; 3]>, reduced: &'a [Image<[T; 3]>]) -> Self {
        Self { base, reduced: reduced.into() }
    }

    /// The texels of `level`, 0 being the atlas; the coarsest built where `level` lies beyond.
    #[inline]
    pub fn level(&self, level: usize) -> &Image<[T; 3]> {
        match level.min(self.reduced.len()) {
            0 => self.base,
            l => &self.reduced[l - 1],
        }
    }

    /// The texture at (`x`, `y`) in texels of level 0, outer corner of the first texel (0, 0),
    /// filtered trilinearly for a fractional `level`; in levels of 0..=255. Zero of an empty atlas.
    pub fn sample(&self, x: f32, y: f32, level: f32) -> [f32; 3] {
        let [[r, g, b, _], ..] = self.look_up::<[i16; 8]>([&[x; PLACES], &[y; PLACES], &[level; PLACES]], 1);
        [r, g, b].map(|v| v.widened() * T::LEVELS)
    }

    /// The same in the texels' units, at the first `count` of places side by side; fourth numbers are none.
    // Loops are plain ones: `map` over an array is not always inlined.
    #[inline(always)]
    pub(crate) fn look_up<E: Eight>(&self, [xs, ys, levels]: [&[f32; PLACES]; 3], count: usize) -> [[T; 4]; PLACES] {
        let mut out = [[T::default(); 4]; PLACES];
        if !levels.iter().any(|&level| level >= MIN_LEVEL) {
            // On the one level that nearby objects show.
            let places: Places<T> = Places::new::<E>(self.base, [xs, ys], &[0; PLACES]);
            for (k, out) in out.iter_mut().enumerate().take(count) {
                let place = places.at(k);
                *out = match place.taps(self.base) {
                    Some(taps) => T::mix::<E>(&taps, None),
                    None => mix_bordering::<T, E>([self.base; 2], [place; 2], T::Share::default()),
                };
            }
            return out;
        }
        let top = self.reduced.len().min(MOST_LEVELS) as i32 as f32;
        let mut clamped = [0.0; PLACES];
        for k in 0..PLACES {
            // A comparison that NaN fails.
            clamped[k] = if levels[k] >= MIN_LEVEL { levels[k].min(top) } else { 0.0 };
        }
        let fine = E::whole(&clamped);
        let (mut coarse, mut shares) = ([0; PLACES], [0.0; PLACES]);
        for k in 0..PLACES {
            coarse[k] = fine[k] + 1;
            shares[k] = clamped[k] - fine[k] as f32;
        }
        let shares = T::shares::<E>(&shares);
        let near: Places<T> = Places::new::<E>(self.base, [xs, ys], &fine);
        let far: Places<T> = Places::new::<E>(self.base, [xs, ys], &coarse);
        for (k, out) in out.iter_mut().enumerate().take(count) {
            let images = [self.level(fine[k] as usize), self.level(coarse[k] as usize)];
            let places = [near.at(k), far.at(k)];
            *out = match (places[0].taps(images[0]), places[1].taps(images[1])) {
                (Some(a), Some(b)) => T::mix::<E>(&a, Some((&b, shares[k]))),
                _ => mix_bordering::<T, E>(images, places, shares[k]),
            };
        }
        out
    }
}

/// The level of one single texel.
pub fn top_level(width: usize, height: usize) -> usize {
    let longest = width.max(height).max(1);
    longest.next_power_of_two().trailing_zeros() as usize
}

/// The mip level for a footprint whose longer side is the root of `footprint_squared`, in texels;
/// 0 under magnification. As OpenGL defines it (4.6 core, eq. 8.7), for the distance between
/// sub-samples.
#[inline]
pub fn level_of_footprint(footprint_squared: f32) -> f32 {
    if footprint_squared > 1.0 { 0.5 * footprint_squared.log2() } else { 0.0 }
}

/// [`level_of_footprint`] to 1e-5 of a level, in a form that compilers vectorise: the exponent of the float, and a
/// polynomial of its mantissa, the minimax one for log2 on 1..=2 among those that are exact at both ends.
#[inline(always)]
pub(crate) fn quick_level_of_footprint(footprint_squared: f32) -> f32 {
    // A comparison that NaN fails, and no branch.
    let bits = (if footprint_squared > 1.0 { footprint_squared } else { 1.0 }).to_bits();
    let exponent = (bits >> 23) as i32 - 127;
    let m = f32::from_bits((bits & 0x007f_ffff) | 0x3f80_0000) - 1.0;
    let log2 = m * (1.0 + (1.0 - m) * (LOG2[0] + m * (LOG2[1] + m * (LOG2[2] + m * LOG2[3]))));
    0.5 * (exponent as f32 + log2)
}

/// Half the size, each texel the mean of 2 × 2.
fn halved<T: Channel>(fine: &Image<[T; 3]>) -> Image<[T; 3]> {
    let (width, height) = (fine.width().div_ceil(2), fine.height().div_ceil(2));
    let mut coarse = Image::filled(width, height, [T::default(); 3]);
    // An image without texels has no chunks.
    let width = width.max(1);
    coarse.pixels_mut().par_chunks_mut(width).with_min_len(16).enumerate().for_each(|(y, row)| {
        halve_row(fine.row(2 * y), fine.row((2 * y + 1).min(fine.height() - 1)), row);
    });
    coarse
}

/// Half of two rows; an odd last texel is repeated.
#[inline(always)]
pub(crate) fn halve_row<T: Channel>(above: &[[T; 3]], below: &[[T; 3]], out: &mut [[T; 3]]) {
    for ((texel, a), b) in out.iter_mut().zip(above.chunks(2)).zip(below.chunks(2)) {
        let ([a0, .., a1] | [a0 @ a1]) = a else { continue };
        let ([b0, .., b1] | [b0 @ b1]) = b else { continue };
        for c in 0..3 {
            texel[c] = T::mean([a0[c], a1[c], b0[c], b1[c]]);
        }
    }
}

/// Places side by side, each on a level of its own.
struct Places<T: Channel> {
    columns: [i32; PLACES],
    rows: [i32; PLACES],
    across: [T::Share; PLACES],
    down: [T::Share; PLACES],
}

impl<T: Channel> Places<T> {
    /// Places in texels of level 0, which `base` is; borders are repeated.
    #[inline(always)]
    fn new<E: Eight>(base: &Image<[T; 3]>, [xs, ys]: [&[f32; PLACES]; 2], levels: &[i32; PLACES]) -> Self {
        let (columns, across) = before::<E>(xs, base.width(), levels);
        let (rows, down) = before::<E>(ys, base.height(), levels);
        Self { columns, rows, across: T::shares::<E>(&across), down: T::shares::<E>(&down) }
    }

    #[inline(always)]
    fn at(&self, k: usize) -> Place<T> {
        let (column, row) = (self.columns[k] as usize, self.rows[k] as usize);
        Place { column, row, across: self.across[k], down: self.down[k] }
    }
}

/// A place on one level: the texel whose centre lies before it, and how far it is on the way to the next.
#[derive(Clone, Copy)]
struct Place<T: Channel> {
    column: usize,
    row: usize,
    across: T::Share,
    down: T::Share,
}

impl<T: Channel> Place<T> {
    /// `None` where there are no two texels and two numbers more in both rows: at the end of an image, in one that is one
    /// texel wide, in one without texels.
    #[inline(always)]
    fn taps<'a>(&self, image: &'a Image<[T; 3]>) -> Option<Taps<'a, T>> {
        let (width, texels) = (image.width(), image.pixels().as_flattened());
        let above = 3 * (self.row * width + self.column);
        let below = if image.height() > 1 { above + 3 * width } else { above };
        // Two texels side by side are six numbers in a row, eight fill a register: one check and one load for both.
        let lanes = |start: usize| texels.get(start..start + 8).and_then(|lanes| lanes.first_chunk::<8>());
        let rows = [lanes(above)?, lanes(below)?];
        (width > 1).then_some(Taps { rows, across: self.across, down: self.down })
    }

    /// The same texel by texel.
    fn gathered(&self, image: &Image<[T; 3]>) -> [[T; 8]; 2] {
        let row = |y: usize| {
            let mut lanes = [T::default(); 8];
            for (k, x) in [self.column, self.column + 1].into_iter().enumerate() {
                let (x, y) = (x.min(image.width().saturating_sub(1)), y.min(image.height().saturating_sub(1)));
                let texel = image.pixels().get(y * image.width() + x).copied().unwrap_or_default();
                lanes[3 * k..3 * k + 3].copy_from_slice(&texel);
            }
            lanes
        };
        [row(self.row), row(self.row + 1)]
    }
}

/// A lookup that touches the end of an image.
#[cold]
fn mix_bordering<T: Channel, E: Eight>(images: [&Image<[T; 3]>; 2], places: [Place<T>; 2], share: T::Share) -> [T; 4] {
    let rows = [places[0].gathered(images[0]), places[1].gathered(images[1])];
    let taps = |k: usize| {
        let [above, below] = &rows[k];
        Taps { rows: [above, below], across: places[k].across, down: places[k].down }
    };
    T::mix::<E>(&taps(0), Some((&taps(1), share)))
}

/// Of places in texels of level 0, where there are `size`, on levels of their own: the texels whose centres lie before
/// them, and how far they are on the way to the next. The last texel is reached as the next of the one before it.
#[inline(always)]
fn before<E: Eight>(at: &[f32; PLACES], size: usize, levels: &[i32; PLACES]) -> ([i32; PLACES], [f32; PLACES]) {
    // In 32 bits, which no image's side leaves: conversions from and to 64 are slow.
    let last = size as i32 - 1;
    let (mut clamped, mut shares) = ([0.0; PLACES], [0.0; PLACES]);
    for k in 0..PLACES {
        // 2^−level, by its exponent.
        let scale = f32::from_bits(((127 - levels[k]) as u32) << 23);
        clamped[k] = (at[k] * scale - 0.5).max(0.0).min((last >> levels[k]).max(0) as f32);
    }
    let mut firsts = E::whole(&clamped);
    for k in 0..PLACES {
        firsts[k] = firsts[k].min(((last >> levels[k]) - 1).max(0));
        shares[k] = clamped[k] - firsts[k] as f32;
    }
    (firsts, shares)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Lanes, Level, Work};

    fn pattern(width: usize, height: usize, seed: f32) -> Image<[f32; 3]> {
        let mut image = Image::filled(width, height, [0.0; 3]);
        for (i, p) in image.pixels_mut().iter_mut().enumerate() {
            *p = [0.0, 1.0, 2.0].map(|c| 127.0 * (1.0 + (i as f32 * 0.37 + seed + c).sin()));
        }
        image
    }

    #[test]
    fn texel_centres_are_kept() {
        let image = pattern(7, 5, 0.0);
        let chain = MipChain::build(&image, 3);
        for y in 0..5 {
            for x in 0..7 {
                let (found, texel) = (chain.sample(x as f32 + 0.5, y as f32 + 0.5, 0.0), image.at(x, y));
                // The last column and row are reached as `a + 1 (b - a)`, which rounds.
                assert!((0..3).all(|c| (found[c] - texel[c]).abs() < 1e-4), "{found:?} {texel:?}");
            }
        }
    }

    #[test]
    fn mip_then_blend_is_blend_then_mip() {
        let (a, b) = (pattern(37, 22, 0.0), pattern(37, 22, 5.0));
        let mut blend = a.clone();
        for (p, (a, b)) in blend.pixels_mut().iter_mut().zip(a.pixels().iter().zip(b.pixels())) {
            // Weights of both signs: bases are not convex.
            *p = [0, 1, 2].map(|c| 1.3 * a[c] - 0.4 * b[c]);
        }
        let [a, b, blend] = [&a, &b, &blend].map(|image| MipChain::build(image, usize::MAX));
        for i in 0..400 {
            let (x, y, level) = (i as f32 * 0.093, i as f32 * 0.055, i as f32 * 0.02);
            let (p, q, r) = (a.sample(x, y, level), b.sample(x, y, level), blend.sample(x, y, level));
            for c in 0..3 {
                let apart = (1.3 * p[c] - 0.4 * q[c] - r[c]).abs();
                assert!(apart < 1e-4, "{apart} at level {level}");
            }
        }
    }

    #[test]
    fn constant_stays_constant_on_every_level() {
        let image = Image::filled(5, 9, [7.0, 8.0, 9.0]);
        let chain = MipChain::build(&image, usize::MAX);
        assert_eq!(chain.level(99).pixels().len(), 1);
        for level in [0.0, 0.7, 2.5, 99.0, f32::INFINITY, f32::NAN] {
            assert_eq!(chain.sample(3.3, -2.0, level), [7.0, 8.0, 9.0]);
        }
    }

    #[test]
    fn quick_levels_are_levels() {
        for i in 0..20_000 {
            let footprint = 1.0005f32.powi(i) * 0.9;
            let (quick, exact) = (quick_level_of_footprint(footprint), level_of_footprint(footprint));
            assert!((quick - exact).abs() < 2e-5, "{quick} for {exact}");
        }
        for nothing in [f32::NAN, f32::NEG_INFINITY, -3.0, 0.0, 1.0] {
            assert_eq!(quick_level_of_footprint(nothing), 0.0);
        }
    }

    #[test]
    fn fixed_point_is_as_near_as_it_says() {
        let exact = pattern(37, 22, 0.0);
        let fixed = exact.map(|p| p.map(|v| (v * FIXED_ONE).round() as i16));
        let (a, b) = (MipChain::build(&exact, usize::MAX), MipChain::build(&fixed, usize::MAX));
        for i in 0..400 {
            let (x, y, level) = (i as f32 * 0.093, i as f32 * 0.055, i as f32 * 0.014);
            let (p, q) = (a.sample(x, y, level), b.sample(x, y, level));
            // Half a unit for the texels, for each reduction, and for each of three mixes.
            let bound = 0.5 * (4.0 + level.ceil()) / FIXED_ONE + 1e-4;
            assert!((0..3).all(|c| (p[c] - q[c]).abs() < bound), "{p:?} {q:?} at level {level}");
        }
    }

    struct LookUp<'a> {
        chain: &'a MipChain<'a, i16>,
        at: [&'a [f32; PLACES]; 3],
        out: &'a mut [[i16; 4]; PLACES],
    }

    impl Work for LookUp<'_> {
        #[inline(always)]
        fn run<E: Lanes>(self) {
            *self.out = self.chain.look_up::<E>(self.at, PLACES);
        }
    }

    #[test]
    fn places_side_by_side_are_places_alone_on_every_vector_unit() {
        let fixed = pattern(37, 22, 0.0).map(|p| p.map(|v| (v * FIXED_ONE).round() as i16));
        let chain = MipChain::build(&fixed, usize::MAX);
        for i in 0..300 {
            let wave = |k: usize, scale: f32| ((i * PLACES + k) as f32 * scale).sin();
            let xs: [f32; PLACES] = std::array::from_fn(|k| 18.0 + 25.0 * wave(k, 0.7));
            let ys: [f32; PLACES] = std::array::from_fn(|k| 11.0 + 15.0 * wave(k, 1.3));
            // All on the finest level, then on levels of their own, NaN and infinity among them.
            let levels: [f32; PLACES] = std::array::from_fn(|k| {
                [0.0, 4.0 * wave(k, 2.1), [f32::NAN, f32::INFINITY][k % 2]][(i + k % 3) % 3 * (i % 2)]
            });
            for level in Level::available() {
                let mut out = [[0; 4]; PLACES];
                level.run(LookUp { chain: &chain, at: [&xs, &ys, &levels], out: &mut out });
                for k in 0..PLACES {
                    let alone = chain.sample(xs[k], ys[k], levels[k]);
                    let here = [0, 1, 2].map(|c| f32::from(out[k][c]) / FIXED_ONE);
                    assert_eq!(here, alone, "{level:?}: {} {} {}", xs[k], ys[k], levels[k]);
                }
            }
        }
    }

    #[test]
    fn nothing_panics_without_texels() {
        let empty: Image<[f32; 3]> = Image::filled(0, 0, [0.0; 3]);
        assert_eq!(MipChain::build(&empty, 4).sample(0.0, f32::NAN, 3.0), [0.0; 3]);
        let chain = Image::filled(1, 1, [1.0; 3]);
        assert_eq!(MipChain::build(&chain, 4).sample(f32::NAN, f32::INFINITY, 3.0).len(), 3);
    }
}
