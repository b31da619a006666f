//! Unstructured lumigraph in texture space: a few rays per texel, blended by angle.
//!
//! A texel keeps up to `layers` rays (colour and view). Seen from an eye, its four nearest rays by
//! angle are blended with `w_i = (1/pen_i)(1 − pen_i/thresh)`, pen the angle at the surface point and
//! thresh the fifth smallest: weights fall to zero as a ray leaves the set, and a ray at the eye takes
//! all. Source: Buehler, Bosse, McMillan, Gortler, Cohen 2001, equations 1–5 with α alone; the choice
//! of rays per texel as in Jagersand, Birkbeck, Cobzas, section 6 (20 rays).
//! Rays are chosen by farthest directions, best seen first. Bytes: 3 + 2 a ray and texel raw.

use crate::bake::Bake;
use crate::coding;
use crate::model::FitOptions;
use crate::observe::Observation;
use crate::surface::SurfaceTexels;
use capture::Image;
use geometry::atlas::PushPull;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// Rays blended for one texel.
const BLENDED: usize = 4;

/// In place of a view: a texel has no more rays.
pub const NO_RAY: u16 = u16::MAX;

/// Rays of all texels.
#[derive(Clone, Debug)]
pub struct Lumigraph {
    /// Camera centres of the views that rays come from.
    pub centers: Vec<Point3<f64>>,
    /// Rays a texel may have.
    pub rays: usize,
    /// Colours, texels × rays; texels as in the surface's lists.
    pub colors: Vec<[u8; 3]>,
    /// Views, texels × rays; 65535 where a texel has fewer rays.
    pub views: Vec<u16>,
    /// As stored: one PNG of colours and one of views per ray slot.
    pub coded: Vec<Vec<u8>>,
}

/// A view and the colour it gives a texel.
type Ray = (u16, [u8; 3]);

/// Fits the lumigraph; also counts texels without any ray.
pub(crate) fn fit(bake: &Bake<'_>, options: &FitOptions) -> Option<(Lumigraph, usize)> {
    let rays = options.layers.max(1);
    let count = bake.surface.len();
    let per_facet: Vec<Vec<Vec<Ray>>> =
        (0..bake.facets.texels.len()).into_par_iter().map(|f| facet_rays(bake, f, rays)).collect();
    let mut colors = vec![[0u8; 3]; count * rays];
    let mut views = vec![NO_RAY; count * rays];
    let mut unseen = 0;
    for (texels, chosen) in bake.facets.texels.iter().zip(&per_facet) {
        for (&t, list) in texels.iter().zip(chosen) {
            unseen += usize::from(list.is_empty());
            for (k, &(view, color)) in list.iter().enumerate() {
                views[t as usize * rays + k] = view;
                colors[t as usize * rays + k] = color;
            }
        }
    }
    let centers = bake.observers.iter().map(|o| o.center()).collect();
    let mut lumigraph = Lumigraph { centers, rays, colors, views, coded: Vec::new() };
    lumigraph.coded = lumigraph.encode(&bake.surface)?;
    Some((lumigraph, unseen))
}

fn facet_rays(bake: &Bake<'_>, facet: usize, rays: usize) -> Vec<Vec<Ray>> {
    let samples = bake.samples(facet);
    let directions = bake.directions(facet);
    (0..bake.facets.texels[facet].len()).map(|i| choose(samples.row(i), &directions, rays)).collect()
}

/// Up to `rays` observations: the best seen one, then always the one farthest from those chosen.
fn choose(row: &[Observation], directions: &[Vector3<f64>], rays: usize) -> Vec<Ray> {
    let mut open: Vec<(usize, f64)> =
        (0..row.len()).filter(|&j| row[j].weight > 0.0).map(|j| (j, f64::INFINITY)).collect();
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < rays && !open.is_empty() {
        let value = |&(j, far): &(usize, f64)| if far.is_infinite() { 1e3 * f64::from(row[j].weight) } else { far };
        let best = (0..open.len()).fold(0, |b, k| if value(&open[k]) > value(&open[b]) { k } else { b });
        let (j, _) = open.swap_remove(best);
        chosen.push(j);
        // Squared chords order like angles.
        open.iter_mut().for_each(|(k, far)| *far = far.min((directions[*k] - directions[j]).norm_squared()));
    }
    chosen.sort_unstable();
    chosen.into_iter().map(|j| (j as u16, row[j].color.map(|c| c.round().clamp(0.0, 255.0) as u8))).collect()
}

impl Lumigraph {
    /// The atlas as seen from `eye`, in levels of 0..=255.
    pub fn blend(&self, surface: &SurfaceTexels, eye: &Point3<f64>) -> Image<[f32; 3]> {
        let [width, height] = surface.size;
        let texels: Vec<Option<[f32; 3]>> =
            (0..surface.len()).into_par_iter().map(|t| self.texel(t, &surface.positions[t], eye)).collect();
        let mut image = Image::filled(width, height, [0.0f32; 3]);
        let mut mask = vec![false; width * height];
        for (&at, color) in surface.index.iter().zip(texels) {
            if let Some(color) = color {
                image.pixels_mut()[at as usize] = color;
                mask[at as usize] = true;
            }
        }
        PushPull::new(surface.size, &mask).apply(image.pixels_mut().as_flattened_mut(), 3);
        image
    }

    /// Blends the rays of one texel; `None` without rays.
    fn texel(&self, t: usize, point: &Point3<f64>, eye: &Point3<f64>) -> Option<[f32; 3]> {
        let row = t * self.rays..(t + 1) * self.rays;
        let to_eye = (eye - point).try_normalize(1e-300)?;
        // Nearest first, one more than is blended: the last one is the threshold.
        let mut nearest: [(f64, usize); BLENDED + 1] = [(f64::INFINITY, usize::MAX); BLENDED + 1];
        for k in row.filter(|&k| self.views[k] != NO_RAY) {
            let ray = self.centers[usize::from(self.views[k])] - point;
            let penalty = (2.0 - 2.0 * ray.dot(&to_eye) / ray.norm()).max(0.0).sqrt();
            if penalty < nearest[BLENDED].0 {
                nearest[BLENDED] = (penalty, k);
                (0..BLENDED).rev().for_each(|i| {
                    if nearest[i + 1].0 < nearest[i].0 {
                        nearest.swap(i, i + 1);
                    }
                });
            }
        }
        self.mix(&nearest)
    }

    fn mix(&self, nearest: &[(f64, usize); BLENDED + 1]) -> Option<[f32; 3]> {
        let rays = nearest.iter().filter(|n| n.1 != usize::MAX).count();
        let last = nearest.get(rays.checked_sub(1)?)?.0;
        let threshold = if rays > BLENDED { last } else { 1.01 * last } + 1e-12;
        let mut sum = [0.0f64; 3];
        let mut total = 0.0;
        for &(penalty, k) in nearest.iter().take(rays.min(BLENDED)) {
            let w = (1.0 - penalty / threshold).max(0.0) / penalty.max(1e-6) + 1e-9;
            total += w;
            sum.iter_mut().zip(self.colors[k]).for_each(|(s, c)| *s += w * f64::from(c));
        }
        Some(sum.map(|s| (s / total) as f32))
    }

    /// Mean colour of each texel's rays, for viewers that know no layers.
    pub(crate) fn mean(&self, surface: &SurfaceTexels) -> Image<[f32; 3]> {
        let mut image = Image::filled(surface.size[0], surface.size[1], [0.0f32; 3]);
        let mut mask = vec![false; surface.size[0] * surface.size[1]];
        for (t, &at) in surface.index.iter().enumerate() {
            let rays: Vec<[u8; 3]> = (t * self.rays..(t + 1) * self.rays)
                .filter(|&k| self.views[k] != NO_RAY)
                .map(|k| self.colors[k])
                .collect();
            if rays.is_empty() {
                continue;
            }
            let mean = |c: usize| rays.iter().map(|p| f32::from(p[c])).sum::<f32>() / rays.len() as f32;
            image.pixels_mut()[at as usize] = std::array::from_fn(mean);
            mask[at as usize] = true;
        }
        PushPull::new(surface.size, &mask).apply(image.pixels_mut().as_flattened_mut(), 3);
        image
    }

    /// Colour and view images of every slot, in that order.
    fn encode(&self, surface: &SurfaceTexels) -> Option<Vec<Vec<u8>>> {
        let slots: Vec<Option<[Vec<u8>; 2]>> =
            (0..self.rays).into_par_iter().map(|k| self.encode_slot(surface, k)).collect();
        Some(slots.into_iter().collect::<Option<Vec<_>>>()?.into_iter().flatten().collect())
    }

    fn encode_slot(&self, surface: &SurfaceTexels, slot: usize) -> Option<[Vec<u8>; 2]> {
        let [width, height] = surface.size;
        let mut colors = Image::filled(width, height, [0u8; 3]);
        // A reader's surface may reach a texel further than ours: there is no ray there.
        let mut views = Image::filled(width, height, [0xff, 0xff, 0]);
        for (t, &at) in surface.index.iter().enumerate() {
            let k = t * self.rays + slot;
            let [low, high] = self.views[k].to_le_bytes();
            colors.pixels_mut()[at as usize] = self.colors[k];
            views.pixels_mut()[at as usize] = [low, high, 0];
        }
        Some([coding::encode_png(&colors)?, coding::encode_png(&views)?])
    }

    /// Rebuilds the lumigraph from its slots as stored; `Err` says what is wrong.
    pub(crate) fn decode(
        centers: Vec<Point3<f64>>,
        coded: Vec<Vec<u8>>,
        surface: &SurfaceTexels,
    ) -> Result<Self, String> {
        let rays = coded.len() / 2;
        let mut colors = vec![[0u8; 3]; surface.len() * rays];
        let mut views = vec![NO_RAY; surface.len() * rays];
        for (slot, pair) in coded.chunks_exact(2).enumerate() {
            let (color, view) = (coding::decode(&pair[0], surface.size)?, coding::decode(&pair[1], surface.size)?);
            for (t, &at) in surface.index.iter().enumerate() {
                let [low, high, _] = view.pixels()[at as usize];
                let index = u16::from_le_bytes([low, high]);
                if index != NO_RAY && usize::from(index) >= centers.len() {
                    return Err(format!("a ray names view {index} of {}", centers.len()));
                }
                colors[t * rays + slot] = color.pixels()[at as usize];
                views[t * rays + slot] = index;
            }
        }
        Ok(Self { centers, rays, colors, views, coded })
    }
}
