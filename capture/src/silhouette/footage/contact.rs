//! Shadow that turns with the target: light that the object keeps from the plane under it, in every frame.

use super::cluster::Cluster;
use super::light::bilinear;
use crate::Image;
use crate::matte::blur;

/// Texels along the edge of a block.
const BLOCK: usize = 4;

/// How far places speak for each other, in blocks (standard deviations), coarse to fine.
const REACHES: [f64; 3] = [16.0, 4.0, 1.0];

/// What the coarser answer weighs, in blocks of paper.
const PRIOR: f32 = 0.005;

/// Of the (encoded) light, what may fall on the plane in the mean of all frames.
const RANGE: std::ops::RangeInclusive<f32> = 0.1..=1.15;

/// Difference of hue (encoded levels, and as a share of the brightest channel) that is light, too.
const LEAST_TINT: f32 = 5.0;
const LARGEST_TINT: f32 = 0.05;

/// The factor on encoded levels by which a place is darker than print in the open.
#[derive(Debug)]
pub(super) struct Contact {
    factors: Image<f32>,
}

impl Contact {
    /// Of what is `seen` and what is `printed` there: least squares per block, `Σ s·p / Σ p·p`, of colours `s` that may
    /// be print `p` in some light. Places that say nothing take the light around them; 1 where there is none.
    pub(super) fn of(seen: &Image<Cluster>, printed: &[Option<[f32; 3]>]) -> Self {
        let (width, height) = (seen.width(), seen.height());
        let (columns, rows) = (width.div_ceil(BLOCK), height.div_ceil(BLOCK));
        let mut products = Image::filled(columns, rows, 0.0_f32);
        let mut squares = products.clone();
        let mut brightest = 1.0_f32;
        for (at, (s, p)) in seen.pixels().iter().zip(printed).enumerate() {
            let Some(p) = p.filter(|p| s.support > 0 && !s.is_covered() && is_print_in(&s.colour, p, &RANGE)) else {
                continue;
            };
            let block = at / width / BLOCK * columns + at % width / BLOCK;
            products.pixels_mut()[block] += dot(&s.colour, &p);
            squares.pixels_mut()[block] += dot(&p, &p);
            brightest = brightest.max(dot(&p, &p));
        }
        let prior = PRIOR * brightest * (BLOCK * BLOCK) as f32;
        let mut factors = Image::filled(columns, rows, 1.0_f32);
        for reach in REACHES {
            let (products, squares) = (blur(&products, reach), blur(&squares, reach));
            let known = products.pixels().iter().zip(squares.pixels());
            for (factor, (product, square)) in factors.pixels_mut().iter_mut().zip(known) {
                *factor = (product + prior * *factor) / (square + prior);
            }
        }
        Self { factors }
    }

    /// At a texel.
    pub(super) fn at(&self, column: usize, row: usize) -> f32 {
        let [x, y] = [column, row].map(|v| (v as f64 + 0.5) / BLOCK as f64);
        bilinear(x, y, |x, y| [self.factors.at_clamped(x, y); 3])[0]
    }
}

/// Whether a colour is that of the print in light of some `range`.
pub(super) fn is_print_in(colour: &[f32; 3], print: &[f32; 3], range: &std::ops::RangeInclusive<f32>) -> bool {
    let light = dot(colour, print) / dot(print, print).max(1.0);
    let brightest = print[0].max(print[1]).max(print[2]);
    let is_same_hue = (0..3).all(|c| (colour[c] - light * print[c]).abs() < LEAST_TINT + LARGEST_TINT * brightest);
    is_same_hue && range.contains(&light)
}

fn dot(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    (0..3).map(|c| a[c] * b[c]).sum()
}
