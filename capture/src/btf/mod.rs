//! Bidirectional texture functions (BTFs) as measured: how a flat sample looks from many directions under
//! light from many directions.
//!
//! A [`Btf`] is a full grid: one picture per pair of view and light. What a measurement lacks is filled
//! when it is read, from the light nearest to it, and marked ([`Btf::is_measured`]); what is not a
//! number is filled likewise. So no codec ever meets a hole, and no evaluation counts one.
//!
//! - Directions are unit vectors from the surface: x right, y up, z along the normal, towards light and eye.
//! - Row 0 of a picture is at the largest y. The tile is taken to continue itself on all sides.
//! - Samples are laid out (view, light, y, x, channel), RGB, encoded as [`Encoding`] says.

mod directions;
mod factored;
mod folder;
mod lights;
mod merl;
mod pictures;

pub use directions::{BtfDirection, DIRECTIONS, bonn_directions};
pub use factored::read_factored;
pub use folder::read_folder;
pub use lights::read_light_stack;
pub use merl::{half_difference, read_merl};

use crate::CaptureError;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// How a sample stands for radiance `L · exposure`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Encoding {
    /// sRGB, nominally 0 to 1: measured in 8 bits.
    Srgb,
    /// The radiance itself, not bounded above: measured in 12 bits or more.
    Linear,
    /// `ln(1 + L/floor) / ln(1 + peak/floor)`, nominally 0 to 1: how radiance of a high range is coded.
    Log {
        /// Radiance below which steps are even.
        floor: f32,
        /// Radiance that becomes 1.
        peak: f32,
    },
}

/// A bidirectional texture function in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Btf {
    /// What was measured.
    pub name: String,
    /// Unit vectors towards the eye.
    pub views: Vec<Vector3<f64>>,
    /// Unit vectors towards the light.
    pub lights: Vec<Vector3<f64>>,
    /// Texels across.
    pub width: usize,
    /// Texels down.
    pub height: usize,
    /// How samples stand for radiance.
    pub encoding: Encoding,
    /// What radiance was multiplied by before it was encoded.
    pub exposure: f32,
    /// Whether the cosine of the light is in the samples.
    pub includes_cosine: bool,
    /// Between texels, where known.
    pub texel_pitch_mm: Option<f64>,
    /// Laid out (view, light, y, x, channel).
    pub samples: Vec<f32>,
    /// Per pair, (view, light): false where the picture was filled in. Empty where all were measured.
    pub measured: Vec<bool>,
}

/// Reads measured data by its kind: a folder of pictures named by angles, or with one `.lp` list of lights in it;
/// such a list; a `.btf` file; a `.binary` table. Tiles are cut to their middle `crop` × `crop` texels.
///
/// # Errors
/// Names the file that cannot be read.
pub fn read(path: &Path, crop: Option<usize>) -> Result<Btf, CaptureError> {
    let extension = path.extension().map_or_else(String::new, |e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_str() {
        _ if path.is_dir() => match lists_of_lights(path)?.as_slice() {
            [list] => read_light_stack(list, crop),
            _ => read_folder(path, crop),
        },
        "lp" => read_light_stack(path, crop),
        "btf" => read_factored(path, crop),
        "binary" => read_merl(path),
        _ if !path.exists() => Err(CaptureError::io(path, std::io::ErrorKind::NotFound.into())),
        _ => {
            let remedy = "give a folder of pictures named like `00008 tl000 pl000 tv030 pv030.png`, an .lp, .btf or .binary file";
            Err(CaptureError::invalid(path, "it is no measured material of a known kind", remedy))
        }
    }
}

fn lists_of_lights(folder: &Path) -> Result<Vec<PathBuf>, CaptureError> {
    let entries = std::fs::read_dir(folder).map_err(|e| CaptureError::io(folder, e))?;
    let mut lists: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    lists.retain(|path| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("lp")));
    Ok(lists)
}

/// Steps of the table of linear light: straight lines between them are off by less than 1e-7 of white.
const STEPS: usize = 4096;

/// Linear light of an encoded value: between black and white by a table, for powers take most of the time of a picture.
fn linear(encoded: f32) -> f32 {
    static TABLE: LazyLock<Vec<f32>> =
        LazyLock::new(|| (0..=STEPS).map(|k| crate::srgb::linear(k as f64 / STEPS as f64) as f32).collect());
    let place = encoded * STEPS as f32;
    let k = place as usize;
    // The straight part ends within a step, with a bend.
    if encoded <= 0.041 || k >= STEPS {
        return crate::srgb::linear(f64::from(encoded)) as f32;
    }
    TABLE[k] + (place - k as f32) * (TABLE[k + 1] - TABLE[k])
}

impl Encoding {
    /// Radiance times exposure of a sample. Negative samples, which codecs may answer with, are 0.
    pub fn decode(self, sample: f32) -> f32 {
        let sample = sample.max(0.0);
        match self {
            Self::Srgb => linear(sample),
            Self::Linear => sample,
            Self::Log { floor, peak } => floor * (sample * (peak / floor).ln_1p()).exp_m1(),
        }
    }

    /// The sample of a radiance times exposure, not clamped above.
    pub fn encode(self, radiance: f32) -> f32 {
        let radiance = radiance.max(0.0);
        match self {
            Self::Srgb if radiance <= 0.003_130_8 => radiance * 12.92,
            Self::Srgb => 1.055 * radiance.powf(1.0 / 2.4) - 0.055,
            Self::Linear => radiance,
            Self::Log { floor, peak } => (radiance / floor).ln_1p() / (peak / floor).ln_1p(),
        }
    }

    /// Bits of one sample as measured: what a compression ratio is counted against.
    pub fn raw_bits(self) -> u32 {
        match self {
            Self::Srgb => 8,
            Self::Linear | Self::Log { .. } => 12,
        }
    }
}

impl Btf {
    /// Texels of the tile.
    pub fn texels(&self) -> usize {
        self.width * self.height
    }

    /// Pairs of view and light.
    pub fn pairs(&self) -> usize {
        self.views.len() * self.lights.len()
    }

    /// One picture, (y, x, channel).
    ///
    /// # Panics
    /// Where view or light is out of range.
    pub fn picture(&self, view: usize, light: usize) -> &[f32] {
        let length = 3 * self.texels();
        &self.samples[(view * self.lights.len() + light) * length..][..length]
    }

    /// One texel (`y · width + x`) under all pairs: (view, light, channel).
    pub fn apparent_brdf(&self, texel: usize) -> Vec<f32> {
        self.samples.chunks_exact(3 * self.texels()).flat_map(|p| p[3 * texel..3 * texel + 3].iter().copied()).collect()
    }

    /// Whether a picture was measured, not filled in.
    pub fn is_measured(&self, view: usize, light: usize) -> bool {
        self.measured.get(view * self.lights.len() + light).copied().unwrap_or(true)
    }

    /// Bytes of the samples as measured: 8 bits each, 12 for a high range.
    pub fn raw_bytes(&self) -> u64 {
        3 * self.texels() as u64 * self.pairs() as u64 * u64::from(self.encoding.raw_bits()) / 8
    }

    /// The same samples, encoded otherwise.
    #[must_use]
    pub fn encoded(mut self, encoding: Encoding) -> Self {
        let from = self.encoding;
        if from != encoding {
            self.samples.par_iter_mut().for_each(|s| *s = encoding.encode(from.decode(*s)));
            self.encoding = encoding;
        }
        self
    }

    /// Checks that the numbers fit one another, and fills what is not finite from the nearest light under
    /// which the texel is, or by 0 where there is none. Pictures with nothing finite count as not measured.
    /// Tells how many samples were filled.
    ///
    /// # Errors
    /// Where lists are empty, lengths disagree or a direction is not a unit vector.
    pub fn check(&mut self) -> Result<usize, CaptureError> {
        let fault = |fault: String| {
            Err(CaptureError::Stage {
                fault,
                remedy: "give one picture of equal size per pair of view and light".into(),
            })
        };
        let expected = self.pairs() * 3 * self.texels();
        if expected == 0 || self.samples.len() != expected {
            return fault(format!(
                "a BTF of {} views, {} lights and {} × {} texels needs {expected} samples, {} are there",
                self.views.len(),
                self.lights.len(),
                self.width,
                self.height,
                self.samples.len()
            ));
        }
        if !self.measured.is_empty() && self.measured.len() != self.pairs() {
            return fault(format!("{} pairs are marked as measured or not, of {}", self.measured.len(), self.pairs()));
        }
        let bent = |d: &Vector3<f64>| !((d.norm() - 1.0).abs() < 1e-3 && d.z > -1e-6);
        if let Some(d) = self.views.iter().chain(&self.lights).find(|d| bent(d)) {
            return fault(format!("({}, {}, {}) is no unit vector above the surface", d.x, d.y, d.z));
        }
        Ok(self.fill())
    }

    /// Pictures without a finite sample were not measured.
    fn mark_empty(&mut self) {
        let length = 3 * self.texels();
        let empty: Vec<bool> = self.samples.par_chunks(length).map(|p| p.iter().all(|s| !s.is_finite())).collect();
        if empty.contains(&true) {
            self.measured =
                (0..empty.len()).map(|p| !empty[p] && self.measured.get(p).copied().unwrap_or(true)).collect();
        }
    }

    fn fill(&mut self) -> usize {
        if self.samples.par_iter().all(|s| s.is_finite()) {
            return 0;
        }
        self.mark_empty();
        let (lights, length) = (self.lights.len(), 3 * self.width * self.height);
        let order: Vec<Vec<usize>> = self.lights.iter().map(|l| nearest_first(l, &self.lights)).collect();
        let fill_view = |view: &mut [f32]| {
            let holes: Vec<usize> = (0..view.len()).filter(|&i| !view[i].is_finite()).collect();
            let known: Vec<f32> = holes.iter().map(|&i| nearest_known(view, i, length, &order)).collect();
            holes.iter().zip(&known).for_each(|(&i, &value)| view[i] = value);
            holes.len()
        };
        self.samples.par_chunks_mut(lights * length).map(fill_view).sum()
    }
}

/// Positions in `all`, the nearest direction to `from` first.
fn nearest_first(from: &Vector3<f64>, all: &[Vector3<f64>]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by(|&a, &b| from.dot(&all[b]).total_cmp(&from.dot(&all[a])).then(a.cmp(&b)));
    order
}

/// The value of a sample of one view under the nearest light that has one.
fn nearest_known(view: &[f32], sample: usize, length: usize, order: &[Vec<usize>]) -> f32 {
    let (light, place) = (sample / length, sample % length);
    order[light].iter().map(|l| view[l * length + place]).find(|v| v.is_finite()).unwrap_or(0.0)
}

#[cfg(test)]
mod tests;
