//! Books refined once they have grown: items become the means of what they stand for.
//!
//! A round looks up again, item of P4 by item, what stands for each azimuth of its texels. Over all that use an entry of P3, with
//! gains `g` and slices `f`, the mean `Σ g f / Σ g²` of luminance and the plain one of chroma are found; the entry takes the item
//! of M nearest to both, P2 and I2 become the means of what their entries of P3 stand for, P1, I1 and C those of their rows
//! and cells. All are least squares, the others held; how many items there are does not change.
//!
//! Cost of a round: that of looking at all texels once. Source: Linde, Buzo, Gray, "An Algorithm for Vector Quantizer Design", IEEE
//! Transactions on Communications 28(1), 1980.

use super::grow::{Growing, Link, Query, energy, normalised, products};
use super::measure::Acceptance;
use super::resample::Texel;
use super::search::Laesa;
use rayon::prelude::*;

/// Entries of P3 compared with all slices as one matrix.
const BLOCK: usize = 256;

/// An item of P4 whose azimuths were looked up again, and its texels' scales.
pub(super) struct Revised {
    pub(super) item: Vec<Link>,
    pub(super) scales: Vec<f32>,
    /// `Σ c f` of luminance, the sum of chroma.
    sums: Texel,
}

/// Sums over what each entry of P3 stands for.
#[derive(Debug, Default)]
pub(super) struct Sums {
    /// `Σ g f`, (entry, cell); the sum of chroma.
    luma: Vec<f32>,
    chroma: Vec<f32>,
    /// `Σ g²`, and how many slices.
    energies: Vec<f32>,
    counts: Vec<f32>,
}

impl Growing {
    /// Looks up again what stands for the azimuths of an item of P4, for the mean of its texels.
    pub(super) fn revise(&self, item: usize, texels: &[Texel], scales: &[f32], accept: &Acceptance) -> Revised {
        let (own, grid) = (energy(scales), self.grid);
        let sums = combined(texels, scales);
        let shown = |sum: f32| if own > 0.0 { sum / own } else { 0.0 };
        let mean = Texel {
            luma: sums.luma.iter().map(|&sum| shown(sum)).collect(),
            chroma: sums.chroma.iter().map(|sum| sum / texels.len() as f32).collect(),
        };
        let mut query = Query::new(mean, grid);
        query.refresh(self);
        let old = &self.texels[item * grid.phi..][..grid.phi];
        let found = |phi: usize| self.nearest_view(&query, phi, accept).map_or(old[phi], |(link, _)| link);
        let (item, _) = normalised(&(0..grid.phi).map(found).collect::<Vec<_>>());
        let decoded = self.decode_texel(&item, 1.0).luma;
        let product = |texel: &Texel| self.weighted_product(&texel.luma, &decoded);
        let length = self.weighted_product(&decoded, &decoded);
        let scale = |texel: &Texel| if length > 0.0 { product(texel) / length } else { 0.0 };
        let scales: Vec<f32> = texels.iter().map(scale).collect();
        Revised { sums: combined(texels, &scales), item, scales }
    }

    /// The product of two texels' luminance, weighted by polar angle.
    fn weighted_product(&self, a: &[f32], b: &[f32]) -> f32 {
        let cells = self.grid.cells();
        let products = a.chunks_exact(cells).zip(b.chunks_exact(cells)).map(|(a, b)| super::grow::dot(a, b));
        products.zip(self.weights.iter().cycle()).map(|(product, weight)| product * weight).sum()
    }

    /// Makes the books the means of what they stand for.
    pub(super) fn become_means(&mut self, sums: &Sums) {
        let entries = self.nearest_pairs(sums);
        let gains: Vec<f32> = entries.iter().map(|found| found.map_or(0.0, |(_, gain)| gain)).collect();
        for (link, found) in self.views.iter_mut().zip(&entries) {
            link.child = found.map_or(link.child, |(pair, _)| pair);
        }
        self.average_slices(sums, &gains);
        self.average_color_slices(sums);
        let cells = self.grid.cells();
        for entry in (0..entries.len()).filter(|&e| entries[e].is_some()) {
            let [luma, _] = self.pairs[self.views[entry].child as usize];
            let product = super::grow::dot(&sums.luma[entry * cells..][..cells], self.unit(luma));
            self.views[entry].scale = product / sums.energies[entry] / self.lengths[luma as usize];
        }
        self.renew_views();
    }

    /// The item of M nearest to the means of each entry of P3, and its gain; none where nothing is lit.
    fn nearest_pairs(&self, sums: &Sums) -> Vec<Option<(u32, f32)>> {
        let cells = self.grid.cells();
        let count = sums.counts.len();
        let of_block = |block: usize| {
            let entries = block * BLOCK..((block + 1) * BLOCK).min(count);
            let part = |all: &'_ [f32], length: usize| all[entries.start * length..entries.end * length].to_vec();
            let dots = products(&self.units, &part(&sums.luma, cells), cells);
            let color_dots = products(&self.color_values, &part(&sums.chroma, 2 * cells), 2 * cells);
            let [dots, color_dots] = [(dots, self.lengths.len()), (color_dots, self.color_energies.len())];
            let nearest = |(i, entry): (usize, usize)| {
                let (energy, count) = (sums.energies[entry], sums.counts[entry]);
                let dots = &dots.0[i * dots.1..][..dots.1];
                let color_dots = &color_dots.0[i * color_dots.1..][..color_dots.1];
                let cost = |[luma, color]: [u32; 2]| {
                    count * self.color_energies[color as usize]
                        - 2.0 * color_dots[color as usize]
                        - dots[luma as usize].powi(2) / energy
                };
                let costs = self.pairs.iter().map(|&pair| cost(pair)).enumerate();
                let best = costs.min_by(|a, b| a.1.total_cmp(&b.1)).filter(|_| energy > 0.0)?;
                Some((best.0 as u32, dots[self.pairs[best.0][0] as usize] / energy))
            };
            entries.enumerate().map(nearest).collect::<Vec<_>>()
        };
        (0..count.div_ceil(BLOCK)).into_par_iter().flat_map_iter(of_block).collect()
    }

    /// P2 and P1: an item of P2 is the mean direction of its slices, taken apart into rows.
    fn average_slices(&mut self, sums: &Sums, gains: &[f32]) {
        let (cells, beta) = (self.grid.cells(), self.grid.beta);
        let mut targets = vec![0.0_f32; self.units.len()];
        let mut masses = vec![0.0_f32; self.lengths.len()];
        for (entry, link) in self.views.iter().enumerate() {
            let slice = self.pairs[link.child as usize][0] as usize;
            let weight = gains[entry] * self.weight(entry);
            add(&mut targets[slice * cells..][..cells], &sums.luma[entry * cells..][..cells], weight);
            masses[slice] += weight * gains[entry] * sums.energies[entry];
        }
        for (target, (unit, mass)) in targets.chunks_exact_mut(cells).zip(self.units.chunks_exact(cells).zip(&masses)) {
            let length = energy(target).sqrt();
            let lit = length > 0.0 && *mass > 0.0;
            target.iter_mut().zip(unit).for_each(|(t, u)| *t = if lit { *t / length } else { *u });
        }
        let mut rows = vec![0.0_f32; self.rows.len() * beta];
        for (i, row) in targets.chunks_exact(beta).enumerate() {
            let (item, gain) = self.row_gain(row);
            add(&mut rows[item * beta..][..beta], row, gain * masses[i / self.grid.alpha]);
        }
        let mut refined = Laesa::new(beta);
        for (item, row) in rows.chunks_exact(beta).enumerate() {
            let length = energy(row).sqrt();
            let unit: Vec<f32> = row.iter().map(|v| v / length).collect();
            refined.insert(if length > 0.0 { &unit } else { self.rows.vector(item) });
        }
        self.rows = refined;
        (self.slices, self.units, self.lengths) = Default::default();
        for target in targets.chunks_exact(cells) {
            let links: Vec<Link> = target.chunks_exact(beta).map(|row| self.row_link(row)).collect();
            self.push_slice(&normalised(&links).0);
        }
    }

    /// The nearest item of P1 and its gain.
    fn row_gain(&self, row: &[f32]) -> (usize, f32) {
        let length = energy(row).sqrt();
        let unit: Vec<f32> = row.iter().map(|v| if length > 0.0 { v / length } else { 0.0 }).collect();
        let (item, chord) = self.rows.nearest(&unit).unwrap_or_default();
        (item, length * (1.0 - 0.5 * chord * chord).max(0.0))
    }

    fn row_link(&self, row: &[f32]) -> Link {
        let (item, gain) = self.row_gain(row);
        Link { child: item as u32, scale: gain * super::grow::mean(self.rows.vector(item)) }
    }

    /// I2, I1 and C.
    fn average_color_slices(&mut self, sums: &Sums) {
        let (values, beta) = (2 * self.grid.cells(), self.grid.beta);
        let mut targets = vec![0.0_f32; self.color_values.len()];
        let mut masses = vec![0.0_f32; self.color_energies.len()];
        for (entry, link) in self.views.iter().enumerate() {
            let color = self.pairs[link.child as usize][1] as usize;
            let weight = self.weight(entry);
            add(&mut targets[color * values..][..values], &sums.chroma[entry * values..][..values], weight);
            masses[color] += weight * sums.counts[entry];
        }
        means(&mut targets, &masses, &self.color_values);
        let rows = &self.color_row_values;
        let nearest_row = |rows: &Laesa, row: &[f32]| rows.nearest(row).map_or(0, |(item, _)| item);
        let mut row_targets: Vec<f32> = vec![0.0; rows.len() * 2 * beta];
        let mut row_masses = vec![0.0_f32; rows.len()];
        for (i, row) in targets.chunks_exact(2 * beta).enumerate() {
            let (item, mass) = (nearest_row(rows, row), masses[i / self.grid.alpha]);
            add(&mut row_targets[item * 2 * beta..][..2 * beta], row, mass);
            row_masses[item] += mass;
        }
        let old: Vec<f32> = (0..rows.len()).flat_map(|item| rows.vector(item)).copied().collect();
        means(&mut row_targets, &row_masses, &old);
        let mut colors = vec![0.0_f32; 2 * self.colors.len()];
        let mut color_masses = vec![0.0_f32; self.colors.len()];
        for (i, cell) in row_targets.chunks_exact(2).enumerate() {
            let (item, mass) = (nearest_row(&self.colors, cell), row_masses[i / beta]);
            add(&mut colors[2 * item..][..2], cell, mass);
            color_masses[item] += mass;
        }
        let old: Vec<f32> = (0..self.colors.len()).flat_map(|item| self.colors.vector(item)).copied().collect();
        means(&mut colors, &color_masses, &old);
        self.colors = Laesa::new(2);
        colors.chunks_exact(2).for_each(|color| {
            self.colors.insert(color);
        });
        self.color_rows = row_targets.chunks_exact(2).map(|cell| nearest_row(&self.colors, cell) as u32).collect();
        self.color_row_values = Laesa::new(2 * beta);
        for row in self.color_rows.chunks_exact(beta) {
            let decoded: Vec<f32> = row.iter().flat_map(|&color| self.colors.vector(color as usize)).copied().collect();
            self.color_row_values.insert(&decoded);
        }
        let rows = &self.color_row_values;
        self.color_slices = targets.chunks_exact(2 * beta).map(|row| nearest_row(rows, row) as u32).collect();
        self.color_values = self.color_slices.iter().flat_map(|&row| rows.vector(row as usize)).copied().collect();
        self.color_energies = self.color_values.chunks_exact(values).map(energy).collect();
    }
}

impl Sums {
    /// Nothing yet, for the books as they are.
    pub(super) fn new(books: &Growing) -> Self {
        let (entries, cells) = (books.views.len(), books.grid.cells());
        Self {
            luma: vec![0.0; entries * cells],
            chroma: vec![0.0; entries * 2 * cells],
            energies: vec![0.0; entries],
            counts: vec![0.0; entries],
        }
    }

    /// Adds the slices of an item of P4.
    pub(super) fn add(&mut self, books: &Growing, revised: &Revised) {
        let (theta, cells) = (books.grid.theta, books.grid.cells());
        let own = energy(&revised.scales);
        for (phi, link) in revised.item.iter().enumerate() {
            for k in 0..theta {
                let (from, entry) = (phi * theta + k, link.child as usize * theta + k);
                let slice = &revised.sums.luma[from * cells..][..cells];
                add(&mut self.luma[entry * cells..][..cells], slice, link.scale);
                let slice = &revised.sums.chroma[from * 2 * cells..][..2 * cells];
                add(&mut self.chroma[entry * 2 * cells..][..2 * cells], slice, 1.0);
                self.energies[entry] += link.scale * link.scale * own;
                self.counts[entry] += revised.scales.len() as f32;
            }
        }
    }
}

/// `Σ c f` of luminance, the sum of chroma.
fn combined(texels: &[Texel], scales: &[f32]) -> Texel {
    let mut sums = Texel { luma: vec![0.0; texels[0].luma.len()], chroma: vec![0.0; texels[0].chroma.len()] };
    for (texel, &scale) in texels.iter().zip(scales) {
        add(&mut sums.luma, &texel.luma, scale);
        add(&mut sums.chroma, &texel.chroma, 1.0);
    }
    sums
}

fn add(to: &mut [f32], values: &[f32], weight: f32) {
    to.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
}

/// Sums over masses; what was before where there is no mass.
fn means(sums: &mut [f32], masses: &[f32], before: &[f32]) {
    let length = sums.len() / masses.len().max(1);
    for (i, (sum, before)) in sums.iter_mut().zip(before).enumerate() {
        let mass = masses[i / length];
        *sum = if mass > 0.0 { *sum / mass } else { *before };
    }
}
