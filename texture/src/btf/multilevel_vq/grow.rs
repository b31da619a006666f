//! The books while they grow: each slice finds what stands for it, or is taken apart and inserted.
//!
//! ```text
//! 4-D: P4 ─ per azimuth ─▶ 3-D: P3 ─ per polar angle ─▶ 2-D: M ─▶ P2 ─ per slice ─▶ 1-D: P1   luminance
//!                                                            └──▶ I2 ─ per slice ─▶ I1 ─▶ C   chroma
//! ```
//!
//! Distances are to what the books decode to, under the best scale: of a slice `f` and an item `q` of luminance,
//! `|f|² − ⟨f, q̂⟩²`, `q̂ = q/|q|`; chroma is not scaled. As a 3-D or 4-D item is a list of scaled items, its
//! distance is a sum over their products, which are looked up: per texel one matrix product with P2 and one
//! with I2, then 2 numbers of each P3 item per azimuth. The winner is tested again without cancellation. All distances are
//! weighted by polar angle ([`Grid::view_weights`]).
//!
//! In its normal form a vector of luminance has mean 1; the mean goes into the scale of its parent. Black has
//! scale 0 and whatever is nearest.

use super::grid::Grid;
use super::measure::{Acceptance, Level, Patch};
use super::resample::Texel;
use super::search::Laesa;
use nalgebra::DMatrixView;
use std::collections::BTreeMap;

/// New items from which a matrix product is quicker than one product at a time.
const FEW: usize = 8;

/// An entry of a book: an item of the book below, and its factor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Link {
    pub(super) child: u32,
    pub(super) scale: f32,
}

/// Which books may grow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Growth {
    /// None: each texel becomes the nearest item of P4.
    Nothing,
    /// P4, P3 and M: new combinations of the slices there are.
    Combinations,
    /// All.
    All,
}

/// All books that materials share.
#[derive(Clone, Debug)]
pub(super) struct Growing {
    pub(super) grid: Grid,
    /// Of each polar angle of the view, mean 1.
    pub(super) weights: Vec<f32>,
    /// P1: unit vectors of `beta` cells.
    pub(super) rows: Laesa,
    /// P2: `alpha` entries an item.
    pub(super) slices: Vec<Link>,
    /// P2 decoded, unit length, and the length of its normal form.
    pub(super) units: Vec<f32>,
    pub(super) lengths: Vec<f32>,
    /// C, I1 and its decoded rows.
    pub(super) colors: Laesa,
    pub(super) color_rows: Vec<u32>,
    pub(super) color_row_values: Laesa,
    known_color_rows: BTreeMap<Vec<u32>, u32>,
    /// I2, decoded, and the squared length.
    pub(super) color_slices: Vec<u32>,
    pub(super) color_values: Vec<f32>,
    pub(super) color_energies: Vec<f32>,
    known_color_slices: BTreeMap<Vec<u32>, u32>,
    /// M: P2 and I2.
    pub(super) pairs: Vec<[u32; 2]>,
    known_pairs: BTreeMap<[u32; 2], u32>,
    /// P3: `theta` entries an item; the squared length of its luminance.
    pub(super) views: Vec<Link>,
    pub(super) view_energies: Vec<f32>,
    /// Per polar angle, what the entries of P3 stand for, gains weighted.
    view_parts: Vec<Vec<Part>>,
    /// P4: `phi` entries an item.
    pub(super) texels: Vec<Link>,
}

/// A texel to be coded, and its products with the books.
#[derive(Debug)]
pub(super) struct Query {
    texel: Texel,
    /// Per slice: squared length of the luminance.
    energies: Vec<f32>,
    /// Per slice: squared length of the chroma.
    color_energies: Vec<f32>,
    /// Per slice and item of P2: product with its unit vector.
    dots: Vec<Vec<f32>>,
    /// Per slice and item of I2: squared distance.
    gaps: Vec<Vec<f32>>,
    /// Per azimuth and item of P3: product of luminance, squared distance of chroma.
    sums: Vec<Vec<[f32; 2]>>,
}

impl Growing {
    pub(super) fn new(grid: Grid) -> Self {
        Self {
            grid,
            weights: grid.view_weights(),
            rows: Laesa::new(grid.beta),
            slices: Vec::new(),
            units: Vec::new(),
            lengths: Vec::new(),
            colors: Laesa::new(2),
            color_rows: Vec::new(),
            color_row_values: Laesa::new(2 * grid.beta),
            known_color_rows: BTreeMap::new(),
            known_color_slices: BTreeMap::new(),
            color_slices: Vec::new(),
            color_values: Vec::new(),
            color_energies: Vec::new(),
            pairs: Vec::new(),
            known_pairs: BTreeMap::new(),
            views: Vec::new(),
            view_energies: Vec::new(),
            view_parts: vec![Vec::new(); grid.theta],
            texels: Vec::new(),
        }
    }

    /// Items of P4.
    pub(super) fn texel_count(&self) -> usize {
        self.texels.len() / self.grid.phi
    }

    fn view_count(&self) -> usize {
        self.views.len() / self.grid.theta
    }

    fn slice_count(&self) -> usize {
        self.lengths.len()
    }

    pub(super) fn unit(&self, slice: u32) -> &[f32] {
        &self.units[slice as usize * self.grid.cells()..][..self.grid.cells()]
    }

    fn color(&self, slice: u32) -> &[f32] {
        &self.color_values[slice as usize * 2 * self.grid.cells()..][..2 * self.grid.cells()]
    }

    /// The item of P4 that stands for a texel, and its scale; the books grow as they may.
    pub(super) fn encode(&mut self, query: &mut Query, accept: &Acceptance, growth: Growth) -> Link {
        query.refresh(self);
        let found = self.nearest_texel(query, accept);
        if let Some((link, error)) = found
            && accept.takes(Level::Texel, error)
        {
            return link;
        }
        let parts: Vec<Link> = (0..self.grid.phi).map(|phi| self.encode_view(query, phi, accept, growth)).collect();
        let (item, scale) = normalised(&parts);
        let built = self.decode_texel(&item, scale);
        let error = accept.error(self.grid, query.all().as_patch(&self.weights), built.as_patch(&self.weights));
        keep(found, error).unwrap_or_else(|| {
            self.texels.extend(&item);
            Link { child: self.texel_count() as u32 - 1, scale }
        })
    }

    /// The nearest item of P4 and its scale; `None` where there are none.
    pub(super) fn assign(&self, query: &mut Query, accept: &Acceptance) -> Option<Link> {
        query.refresh(self);
        self.nearest_texel(query, accept).map(|(link, _)| link)
    }

    /// The item of P3 that stands for the slices of one azimuth.
    fn encode_view(&mut self, query: &mut Query, phi: usize, accept: &Acceptance, growth: Growth) -> Link {
        query.refresh_view(self, phi);
        let found = self.nearest_view(query, phi, accept);
        if let Some((link, error)) = found
            && accept.takes(Level::View, error)
        {
            return link;
        }
        let first = phi * self.grid.theta;
        let slices = first..first + self.grid.theta;
        let parts: Vec<Link> = slices.clone().map(|slice| self.encode_pair(query, slice, accept, growth)).collect();
        let (item, scale) = normalised(&parts);
        let built = self.decode(&self.entry_parts(&item, scale).collect::<Vec<_>>());
        let error = accept.error(self.grid, self.patch(query, slices), built.as_patch(&self.weights));
        keep(found, error).unwrap_or_else(|| {
            self.push_view(&item);
            Link { child: self.view_count() as u32 - 1, scale }
        })
    }

    /// Appends an item to P3.
    fn push_view(&mut self, item: &[Link]) {
        self.view_energies.push(self.view_energy(item));
        let parts: Vec<Part> = self.entry_parts(item, 1.0).collect();
        for ((known, part), weight) in self.view_parts.iter_mut().zip(parts).zip(&self.weights) {
            known.push(Part { gain: weight * part.gain, ..part });
        }
        self.views.extend(item);
    }

    /// Works out anew what is known of the items of P3 once their entries have changed.
    pub(super) fn renew_views(&mut self) {
        let views = std::mem::take(&mut self.views);
        self.view_energies.clear();
        self.view_parts.iter_mut().for_each(Vec::clear);
        views.chunks_exact(self.grid.theta).for_each(|item| self.push_view(item));
    }

    /// The item of M that stands for the light's hemisphere under one view.
    fn encode_pair(&mut self, query: &mut Query, slice: usize, accept: &Acceptance, growth: Growth) -> Link {
        query.refresh_slice(self, slice);
        if let Some((link, error)) = self.nearest_pair(query, slice, accept)
            && accept.takes(Level::Pair, error)
        {
            return link;
        }
        let luma = self.encode_slice(query, slice, accept, growth);
        let pair = [luma.child, self.encode_color_slice(query, slice, accept, growth)];
        let next = self.pairs.len() as u32;
        let child = *self.known_pairs.entry(pair).or_insert(next);
        if child == next {
            self.pairs.push(pair);
        }
        Link { child, scale: luma.scale }
    }

    fn encode_slice(&mut self, query: &Query, slice: usize, accept: &Acceptance, growth: Growth) -> Link {
        let weight = [self.weight(slice)];
        let patch = query.patch(self.grid, slice..slice + 1, &weight).luma_only();
        let costs = query.dots[slice].iter().map(|dot| query.energies[slice] - dot * dot);
        let candidates = accept.shortlist(costs).into_iter().map(|item| {
            let gain = query.dots[slice][item];
            let decoded: Vec<f32> = self.unit(item as u32).iter().map(|u| gain * u).collect();
            let link = Link { child: item as u32, scale: gain / self.lengths[item] };
            (link, accept.error(self.grid, patch, Patch { luma: &decoded, ..patch }))
        });
        let found = best(candidates);
        if let Some((link, error)) = found
            && (growth < Growth::All || accept.takes(Level::Slice, error))
        {
            return link;
        }
        let rows: Vec<Link> =
            patch.luma.chunks_exact(self.grid.beta).map(|row| self.encode_row(row, &weight, accept)).collect();
        let (item, scale) = normalised(&rows);
        let decoded: Vec<f32> = item.iter().flat_map(|link| self.normal_row(*link)).collect();
        let built: Vec<f32> = decoded.iter().map(|v| scale * v).collect();
        let error = accept.error(self.grid, patch, Patch { luma: &built, ..patch });
        if let Some(link) = keep(found, error) {
            return link;
        }
        self.push_slice(&item);
        Link { child: self.slice_count() as u32 - 1, scale }
    }

    /// Appends an item to P2.
    pub(super) fn push_slice(&mut self, item: &[Link]) {
        let decoded: Vec<f32> = item.iter().flat_map(|link| self.normal_row(*link)).collect();
        let length = norm(&decoded);
        self.slices.extend(item);
        self.units.extend(decoded.iter().map(|v| v / length));
        self.lengths.push(length);
    }

    /// The item of P1 that stands for the cells of one slice.
    fn encode_row(&mut self, row: &[f32], weight: &[f32], accept: &Acceptance) -> Link {
        let length = norm(row);
        if length == 0.0 && self.rows.len() > 0 {
            return Link::default();
        }
        let unit: Vec<f32> = match length {
            0.0 => vec![(row.len() as f32).sqrt().recip(); row.len()],
            _ => row.iter().map(|v| v / length).collect(),
        };
        let nearest = self.rows.nearest(&unit).map(|(item, chord)| (item, length * (1.0 - 0.5 * chord * chord)));
        let candidate = nearest.map(|(item, gain)| {
            let decoded: Vec<f32> = self.rows.vector(item).iter().map(|u| gain * u).collect();
            let patch = Patch { luma: row, chroma: &[], weights: weight };
            let error = accept.error(self.grid, patch, Patch { luma: &decoded, ..patch });
            (item, gain, error)
        });
        let (item, gain) = match candidate {
            Some((item, gain, error)) if accept.takes(Level::Row, error) => (item, gain),
            _ => (self.rows.insert(&unit), length),
        };
        Link { child: item as u32, scale: gain * mean(self.rows.vector(item)) }
    }

    /// A row of P1 in its normal form, scaled.
    fn normal_row(&self, link: Link) -> impl Iterator<Item = f32> + '_ {
        let unit = self.rows.vector(link.child as usize);
        let factor = link.scale / mean(unit);
        unit.iter().map(move |u| factor * u)
    }

    fn encode_color_slice(&mut self, query: &Query, slice: usize, accept: &Acceptance, growth: Growth) -> u32 {
        let weight = [self.weight(slice)];
        let patch = query.patch(self.grid, slice..slice + 1, &weight).chroma_only();
        let candidates = accept.shortlist(query.gaps[slice].iter().copied()).into_iter().map(|item| {
            let link = Link { child: item as u32, scale: 1.0 };
            (link, accept.error(self.grid, patch, Patch { chroma: self.color(link.child), ..patch }))
        });
        if let Some((link, error)) = best(candidates)
            && (growth < Growth::All || accept.takes(Level::ColorSlice, error))
        {
            return link.child;
        }
        let rows = patch.chroma.chunks_exact(2 * self.grid.beta);
        let item: Vec<u32> = rows.map(|row| self.encode_color_row(row, weight[0], accept)).collect();
        if let Some(&known) = self.known_color_slices.get(&item) {
            return known;
        }
        self.known_color_slices.insert(item.clone(), self.color_energies.len() as u32);
        let decoded = item.iter().flat_map(|&row| self.color_row_values.vector(row as usize));
        let start = self.color_values.len();
        self.color_values.extend(decoded);
        self.color_energies.push(energy(&self.color_values[start..]));
        self.color_slices.extend(item);
        self.color_energies.len() as u32 - 1
    }

    fn encode_color_row(&mut self, row: &[f32], weight: f32, accept: &Acceptance) -> u32 {
        if let Some((item, distance)) = self.color_row_values.nearest(row)
            && accept.takes(Level::ColorRow, accept.rmse(f64::from(weight * distance.powi(2)), self.grid.beta))
        {
            return item as u32;
        }
        let item: Vec<u32> = row.chunks_exact(2).map(|color| self.encode_color(color, weight, accept)).collect();
        if let Some(&known) = self.known_color_rows.get(&item) {
            return known;
        }
        self.known_color_rows.insert(item.clone(), self.color_row_values.len() as u32);
        let decoded: Vec<f32> = item.iter().flat_map(|&c| self.colors.vector(c as usize)).copied().collect();
        self.color_rows.extend(item);
        self.color_row_values.insert(&decoded) as u32
    }

    fn encode_color(&mut self, color: &[f32], weight: f32, accept: &Acceptance) -> u32 {
        match self.colors.nearest(color) {
            Some((item, d)) if accept.takes(Level::Color, accept.rmse(f64::from(weight * d * d), 1)) => item as u32,
            _ => self.colors.insert(color) as u32,
        }
    }

    fn nearest_texel(&self, query: &Query, accept: &Acceptance) -> Option<(Link, f64)> {
        let sums = |item: usize| {
            let links = &self.texels[item * self.grid.phi..][..self.grid.phi];
            let [mut product, mut own, mut chroma] = [0.0_f32; 3];
            for (link, sums) in links.iter().zip(&query.sums) {
                let [dot, gap] = sums[link.child as usize];
                product += link.scale * dot;
                own += link.scale * link.scale * self.view_energies[link.child as usize];
                chroma += gap;
            }
            [product, own, chroma]
        };
        let all = self.weighted(&query.energies);
        let costs = (0..self.texel_count()).map(|item| {
            let [product, own, chroma] = sums(item);
            all - product * product / own + chroma
        });
        best(accept.shortlist(costs).into_iter().map(|item| {
            let [product, own, _] = sums(item);
            let link = Link { child: item as u32, scale: product / own };
            let decoded = self.decode_texel(&self.texels[item * self.grid.phi..][..self.grid.phi], link.scale);
            let original = query.all();
            (link, accept.error(self.grid, original.as_patch(&self.weights), decoded.as_patch(&self.weights)))
        }))
    }

    pub(super) fn nearest_view(&self, query: &Query, phi: usize, accept: &Acceptance) -> Option<(Link, f64)> {
        let slices = phi * self.grid.theta..(phi + 1) * self.grid.theta;
        let all = self.weighted(&query.energies[slices.clone()]);
        let of_item = query.sums[phi].iter().zip(&self.view_energies);
        let costs = of_item.map(|([dot, gap], own)| all - dot * dot / own + gap);
        best(accept.shortlist(costs).into_iter().map(|item| {
            let link = Link { child: item as u32, scale: query.sums[phi][item][0] / self.view_energies[item] };
            let links = &self.views[item * self.grid.theta..][..self.grid.theta];
            let decoded = self.decode(&self.entry_parts(links, link.scale).collect::<Vec<_>>());
            let patch = self.patch(query, slices.clone());
            (link, accept.error(self.grid, patch, decoded.as_patch(&self.weights)))
        }))
    }

    fn nearest_pair(&self, query: &Query, slice: usize, accept: &Acceptance) -> Option<(Link, f64)> {
        let (dots, gaps, own) = (&query.dots[slice], &query.gaps[slice], query.energies[slice]);
        let costs = self.pairs.iter().map(|&[luma, color]| own - dots[luma as usize].powi(2) + gaps[color as usize]);
        best(accept.shortlist(costs).into_iter().map(|item| {
            let [luma, color] = self.pairs[item];
            let gain = dots[luma as usize];
            let decoded = self.decode(&[Part { luma, color, gain }]);
            let link = Link { child: item as u32, scale: gain / self.lengths[luma as usize] };
            let weight = [self.weight(slice)];
            let patch = query.patch(self.grid, slice..slice + 1, &weight);
            (link, accept.error(self.grid, patch, decoded.as_patch(&weight)))
        }))
    }

    /// The squared length of an item of P3.
    pub(super) fn view_energy(&self, links: &[Link]) -> f32 {
        self.entry_parts(links, 1.0).zip(&self.weights).map(|(part, weight)| weight * part.gain * part.gain).sum()
    }

    /// How much a slice counts.
    pub(super) fn weight(&self, slice: usize) -> f32 {
        self.weights[slice % self.grid.theta]
    }

    /// A sum over slices, from a first polar angle on.
    fn weighted(&self, values: &[f32]) -> f32 {
        values.iter().zip(self.weights.iter().cycle()).map(|(value, weight)| value * weight).sum()
    }

    /// Some slices of a texel, from a first polar angle on.
    fn patch<'a>(&'a self, query: &'a Query, slices: std::ops::Range<usize>) -> Patch<'a> {
        query.patch(self.grid, slices, &self.weights)
    }

    /// What the entries of an item of P3 stand for.
    fn entry_parts<'a>(&'a self, links: &'a [Link], scale: f32) -> impl Iterator<Item = Part> + 'a {
        links.iter().map(move |link| {
            let [luma, color] = self.pairs[link.child as usize];
            Part { luma, color, gain: scale * link.scale * self.lengths[luma as usize] }
        })
    }

    /// What the entries of an item of P4 stand for.
    pub(super) fn decode_texel(&self, links: &[Link], scale: f32) -> Texel {
        let views = |link: &Link| {
            let item = &self.views[link.child as usize * self.grid.theta..][..self.grid.theta];
            self.entry_parts(item, scale * link.scale).collect::<Vec<_>>()
        };
        self.decode(&links.iter().flat_map(views).collect::<Vec<_>>())
    }

    fn decode(&self, parts: &[Part]) -> Texel {
        Texel {
            luma: parts.iter().flat_map(|p| self.unit(p.luma).iter().map(|u| p.gain * u)).collect(),
            chroma: parts.iter().flat_map(|p| self.color(p.color)).copied().collect(),
        }
    }
}

/// One slice as the books decode it.
#[derive(Clone, Copy, Debug)]
struct Part {
    luma: u32,
    color: u32,
    /// Of the unit vector.
    gain: f32,
}

impl Query {
    /// Nothing is looked up yet.
    pub(super) fn new(texel: Texel, grid: Grid) -> Self {
        let nodes = grid.nodes();
        Self {
            energies: texel.luma.chunks_exact(grid.cells()).map(energy).collect(),
            color_energies: texel.chroma.chunks_exact(2 * grid.cells()).map(energy).collect(),
            texel,
            dots: vec![Vec::new(); nodes],
            gaps: vec![Vec::new(); nodes],
            sums: vec![Vec::new(); grid.phi],
        }
    }

    pub(super) fn all(&self) -> &Texel {
        &self.texel
    }

    /// Some slices.
    fn patch<'a>(&'a self, grid: Grid, slices: std::ops::Range<usize>, weights: &'a [f32]) -> Patch<'a> {
        let cells = grid.cells();
        Patch {
            luma: &self.texel.luma[slices.start * cells..slices.end * cells],
            chroma: &self.texel.chroma[2 * slices.start * cells..2 * slices.end * cells],
            weights,
        }
    }

    /// Looks up what the books have gained since the last time.
    pub(super) fn refresh(&mut self, books: &Growing) {
        Self::refresh_all(std::slice::from_mut(self), books);
    }

    /// The same for several texels, as one matrix.
    pub(super) fn refresh_all(queries: &mut [Self], books: &Growing) {
        let cells = books.grid.cells();
        let columns = queries.len() * books.grid.nodes();
        let together = |length: fn(&Self) -> &[Vec<f32>]| {
            let mut lengths = queries.iter().flat_map(length).map(Vec::len);
            let first = lengths.next().unwrap_or_default();
            lengths.all(|length| length == first).then_some(first)
        };
        let [known_slices, known_colors] = [together(|q| &q.dots), together(|q| &q.gaps)];
        if let Some(known) = known_slices.filter(|known| books.slice_count() >= known + FEW) {
            let slices: Vec<f32> = queries.iter().flat_map(|q| &q.texel.luma).copied().collect();
            let found = products(&books.units[known * cells..], &slices, cells);
            let new = found.chunks_exact(found.len() / columns);
            queries.iter_mut().flat_map(|q| &mut q.dots).zip(new).for_each(|(dots, new)| dots.extend(new));
        }
        if let Some(known) = known_colors.filter(|known| books.color_energies.len() >= known + FEW) {
            let slices: Vec<f32> = queries.iter().flat_map(|q| &q.texel.chroma).copied().collect();
            let found = products(&books.color_values[known * 2 * cells..], &slices, 2 * cells);
            let new = found.chunks_exact(found.len() / columns);
            let gaps = queries.iter_mut().flat_map(|q| q.gaps.iter_mut().zip(&q.color_energies));
            for ((gaps, own), new) in gaps.zip(new) {
                let items = new.iter().zip(&books.color_energies[known..]);
                gaps.extend(items.map(|(dot, e)| (own + e - 2.0 * dot).max(0.0)));
            }
        }
        for query in queries {
            (0..books.grid.phi).for_each(|phi| query.refresh_view(books, phi));
        }
    }

    fn refresh_view(&mut self, books: &Growing, phi: usize) {
        let theta = books.grid.theta;
        (phi * theta..(phi + 1) * theta).for_each(|slice| self.refresh_slice(books, slice));
        let known = self.sums[phi].len();
        self.sums[phi].resize(books.view_count(), [0.0; 2]);
        for (k, (parts, weight)) in books.view_parts.iter().zip(&books.weights).enumerate() {
            let (dots, gaps) = (&self.dots[phi * theta + k], &self.gaps[phi * theta + k]);
            for (sums, part) in self.sums[phi][known..].iter_mut().zip(&parts[known..]) {
                sums[0] += part.gain * dots[part.luma as usize];
                sums[1] += weight * gaps[part.color as usize];
            }
        }
    }

    fn refresh_slice(&mut self, books: &Growing, slice: usize) {
        let cells = books.grid.cells();
        let luma = &self.texel.luma[slice * cells..][..cells];
        let chroma = &self.texel.chroma[slice * 2 * cells..][..2 * cells];
        for item in self.dots[slice].len()..books.slice_count() {
            self.dots[slice].push(dot(books.unit(item as u32), luma));
        }
        for item in self.gaps[slice].len()..books.color_energies.len() {
            let gap = books.color(item as u32).iter().zip(chroma).map(|(a, b)| (a - b) * (a - b)).sum();
            self.gaps[slice].push(gap);
        }
    }
}

/// Products of items and slices of one length, (slice, item).
pub(super) fn products(items: &[f32], slices: &[f32], length: usize) -> Vec<f32> {
    let columns = |all: &[f32]| all.len() / length;
    let items_view = DMatrixView::from_slice(items, length, columns(items));
    let slices_view = DMatrixView::from_slice(slices, length, columns(slices));
    // Transposed in place of a view with strides: of few rows nalgebra 0.35 reads those beyond their end.
    (items_view.transpose() * slices_view).data.into()
}

/// What is there, where what was built from scaled items is no better.
fn keep(there: Option<(Link, f64)>, built: f64) -> Option<Link> {
    there.filter(|(_, error)| *error <= built).map(|(link, _)| link)
}

/// The candidate of least error, the first of equals.
fn best(candidates: impl Iterator<Item = (Link, f64)>) -> Option<(Link, f64)> {
    candidates.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// An item whose scales have mean 1, and the mean; black has scale 0.
pub(super) fn normalised(parts: &[Link]) -> (Vec<Link>, f32) {
    let mean = parts.iter().map(|link| link.scale).sum::<f32>() / parts.len() as f32;
    let scaled = |link: &Link| Link { child: link.child, scale: if mean > 0.0 { link.scale / mean } else { 1.0 } };
    (parts.iter().map(scaled).collect(), mean)
}

pub(super) fn mean(values: &[f32]) -> f32 {
    values.iter().sum::<f32>() / values.len() as f32
}

pub(super) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut lanes = [0.0_f32; 8];
    let (a_blocks, b_blocks) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f32 = a_blocks.remainder().iter().zip(b_blocks.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a_blocks.zip(b_blocks) {
        (0..8).for_each(|k| lanes[k] += x[k] * y[k]);
    }
    lanes.iter().sum::<f32>() + rest
}

pub(super) fn energy(values: &[f32]) -> f32 {
    dot(values, values)
}

fn norm(values: &[f32]) -> f32 {
    energy(values).sqrt()
}
