//! The common form of static texture, VDTM and DynTex: layers, and weights per facet.
//!
//! `colour(texel, eye) = Σ_k w_k(facet(texel), eye) · L_k(texel)`, with
//! `w(facet, eye) = Σ_s blend_s(direction from the facet's centre to the eye) · W_facet[s, :]`.
//! A static texture has one layer of weight 1; VDTM has one layer per source view and unit rows in W;
//! DynTex has the mean (weight 1) and the basis, with modulation coefficients as rows.
//!
//! Shapes: K layers of atlas size, 8 bits with scale and offset; W is sites × rank of the facet, and a
//! facet uses layers 0..rank. Cost of one eye: `Σ_facets texels · rank` multiply-adds.

use crate::directions::DirectionComplex;
use capture::Image;
use nalgebra::Point3;
use rayon::prelude::*;

/// One layer: 8-bit texels, what they mean, and the bytes they are stored as.
#[derive(Clone, Debug)]
pub struct Layer {
    /// As decoded from `coded`.
    pub texels: Image<[u8; 3]>,
    /// The layer's value is `offset + scale · texel`, in levels of 0..=255.
    pub scale: f32,
    /// See `scale`.
    pub offset: f32,
    /// A JPEG or PNG file.
    pub coded: Vec<u8>,
}

/// What a facet needs to answer an eye.
#[derive(Clone, Debug)]
pub struct FacetWeights {
    /// Its mean surface point; eye directions are taken from here.
    pub center: Point3<f64>,
    /// The directions it has weights for.
    pub complex: DirectionComplex,
    /// Layers it uses, from the first.
    pub rank: usize,
    /// Row-major, sites × rank.
    pub table: Vec<f32>,
}

/// Layers and the weights that blend them.
#[derive(Clone, Debug)]
pub struct Layers {
    /// All of atlas size.
    pub layers: Vec<Layer>,
    /// The facet of every texel of the atlas, gutters included.
    pub facet_of_texel: Image<u16>,
    /// All facets.
    pub facets: Vec<FacetWeights>,
}

impl FacetWeights {
    /// The weights of layers 0..rank as seen from `eye`. A facet without sites shows its first layer.
    pub fn at(&self, eye: &Point3<f64>) -> Vec<f32> {
        let mut weights = vec![0.0f32; self.rank];
        let Some(blend) = self.complex.blend(&(eye - self.center)) else {
            weights.iter_mut().take(1).for_each(|w| *w = 1.0);
            return weights;
        };
        for (site, share) in blend.entries.into_iter().filter(|e| e.1 > 0.0) {
            let row = &self.table[site as usize * self.rank..][..self.rank];
            weights.iter_mut().zip(row).for_each(|(w, y)| *w += share as f32 * y);
        }
        weights
    }
}

impl Layers {
    /// The blended atlas as seen from `eye`, unclamped, in levels of 0..=255.
    pub fn blend(&self, eye: &Point3<f64>) -> Image<[f32; 3]> {
        let weights: Vec<Vec<f32>> = self.facets.par_iter().map(|f| f.at(eye)).collect();
        let (width, height) = (self.facet_of_texel.width(), self.facet_of_texel.height());
        let mut out = Image::filled(width, height, [0.0f32; 3]);
        out.pixels_mut().par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| self.blend_row(y, row, &weights));
        out
    }

    /// The first layer.
    pub(crate) fn first(&self) -> Image<[f32; 3]> {
        let size = (self.facet_of_texel.width(), self.facet_of_texel.height());
        let value = |layer: &Layer| layer.texels.map(|texel| texel.map(|t| layer.offset + layer.scale * f32::from(t)));
        self.layers.first().map_or_else(|| Image::filled(size.0, size.1, [0.0; 3]), value)
    }

    /// The mean of the layers' texels.
    pub(crate) fn mean(&self) -> Image<[f32; 3]> {
        let mut mean = Image::filled(self.facet_of_texel.width(), self.facet_of_texel.height(), [0.0f32; 3]);
        let share = 1.0 / self.layers.len().max(1) as f32;
        for layer in &self.layers {
            for (m, t) in mean.pixels_mut().iter_mut().zip(layer.texels.pixels()) {
                m.iter_mut().zip(t).for_each(|(m, &t)| *m += share * f32::from(t));
            }
        }
        mean
    }

    fn blend_row(&self, y: usize, row: &mut [[f32; 3]], weights: &[Vec<f32>]) {
        let facets = self.facet_of_texel.row(y);
        let mut x = 0;
        while x < facets.len() {
            let facet = facets[x];
            let end = x + facets[x..].iter().take_while(|&&f| f == facet).count();
            for (layer, &w) in self.layers.iter().zip(&weights[facet as usize]) {
                let (gain, base) = (w * layer.scale, w * layer.offset);
                for (out, texel) in row[x..end].iter_mut().zip(&layer.texels.row(y)[x..end]) {
                    out.iter_mut().zip(texel).for_each(|(o, &t)| *o += gain * f32::from(t) + base);
                }
            }
            x = end;
        }
    }

    /// Bytes of the layers before image coding: 3 for every texel a facet's rank reaches.
    pub fn raw_bytes(&self) -> u64 {
        let mut texels = vec![0u64; self.facets.len()];
        self.facet_of_texel.pixels().iter().for_each(|&f| texels[f as usize] += 1);
        texels.iter().zip(&self.facets).map(|(&t, f)| 3 * t * f.rank as u64).sum()
    }
}

/// Spreads labels from the texels that have one to the whole atlas, nearest (in steps) first.
/// `index` are positions `y · width + x`; deterministic.
pub fn spread_labels([width, height]: [usize; 2], index: &[u32], labels: &[u16]) -> Image<u16> {
    let mut known = vec![false; width * height];
    let mut out = Image::filled(width, height, 0u16);
    let mut front: Vec<u32> = index.to_vec();
    for (&i, &label) in index.iter().zip(labels) {
        known[i as usize] = true;
        out.pixels_mut()[i as usize] = label;
    }
    while !front.is_empty() {
        let mut next = Vec::new();
        for &i in &front {
            let (x, y) = (i as usize % width, i as usize / width);
            let label = out.pixels()[i as usize];
            let steps = [(x > 0, -1), (x + 1 < width, 1), (y > 0, -(width as isize)), (y + 1 < height, width as isize)];
            for (_, step) in steps.into_iter().filter(|s| s.0) {
                let j = (i as isize + step) as usize;
                if !std::mem::replace(&mut known[j], true) {
                    out.pixels_mut()[j] = label;
                    next.push(j as u32);
                }
            }
        }
        front = next;
    }
    out
}
