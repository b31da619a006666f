//! A Gaussian mixture with product components over place, light, eye and colour.
//!
//! ```text
//! P(ξ) = Σ_m w_m Π_v N(ξ_v; μ_mv, σ_mv)      v = x, y | α, s of the light | α, s of the eye | r, g, b less the mean
//! E[c | x, y, l, e] = mean(l, e) + Σ_m W_m μ_m,rgb      W = the components' shares of the six inputs
//! ```
//!
//! | parameter | what it does |
//! |---|---|
//! | `components` | M, of 76 bytes each (full) or 25 (compact); none: found by pairs held out ([`size`]) |
//! | `rounds`, `warm_up` | of EM; the first on a share of the samples |
//! | `try_shapes` | components start narrow in what varies fastest |
//! | `reach` | components whose log density is this far below the best at all texels of a tile are left out |
//! | `refit` | colours by least squares after EM: same bytes, smaller error |
//!
//! **How**: onion-slice directions and the mean picture of each pair, in 8 bits and subtracted as it is stored
//! ([`variables`]); EM in logarithms with a floor under each deviation, empty components put on half of those that
//! vary most ([`estimation`]). The samples are a product grid: angles enter once a picture, and each tile of
//! 16 × 8 texels knows which components can matter to it ([`mixture`]).
//!
//! **Cost**: samples × M × the share that is not left out (half of 300, less of more) × rounds, the first third of
//! which take 4 % of the samples; in memory M × (lights + views) sums for each of 32 parts and M² for the refit.
//! An answer: M densities of light and eye, once for texels asked for together, then two products and four sums a
//! component, sixteen at a time ([`prediction`]).
//!
//! **Tiles** that continue themselves are coded so: along an axis where texels differ at most 1.1 times as much across
//! the border as where they differ most within, the difference of a place from a mean is that to the nearest of the
//! mean's images, in the fit as in answers. Components wider than a third of the tile lose what would reach around it
//! ([`variables::Period`]).
//!
//! **Limits**: structures and highlights sharper than the components are wide are blurred, and of a tile whose
//! texels hardly resemble their neighbours little more than the mean picture is left. What has no variation (one texel,
//! one light, constant colour) puts deviations on their floors and changes no answer. More components than samples are
//! not made. Samples that are not finite, or far outside 0 to 1, are refused. Under a direction that is no direction,
//! the answer is that for the normal.
//!
//! Source: Filip, Grim, Haindl, "A probabilistic approach to rough texture compression and rendering", ICIP 2013
//! (equations 1–11). Signed angles, floors, the grid's structure and the refit are not theirs.

mod estimation;
mod expectation;
mod lanes;
mod maximization;
mod mixture;
mod prediction;
mod refit;
mod size;
mod storage;
#[cfg(test)]
mod tests;
mod variables;

pub use storage::{Counting, printed_bytes, ratio_as_printed};

use super::{Budget, FitReport, Frame, MixtureTables, Precision, Sampler, Tables};
use crate::TextureError;
use capture::btf::Btf;
use estimation::{Estimate, estimate};
use mixture::{Component, Packed};
use nalgebra::Vector3;
use prediction::Places;
use variables::{FLOORS, Grid, Period, onion_slice};

/// Samples beyond this were not encoded.
const LARGEST_SAMPLE: f32 = 100.0;

/// How it is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// How many, at most 4096; none: as many as held-out pairs of light and view support.
    pub components: Option<usize>,
    /// How numbers are stored.
    pub precision: Precision,
    /// Rounds of EM, unless it converges earlier.
    pub rounds: usize,
    /// The first rounds may use fewer samples.
    pub warm_up: Option<WarmUp>,
    /// Whether components start in the one of six shapes with which a short fit answers best; otherwise evenly narrow.
    pub try_shapes: bool,
    /// Components are left out of a tile where their log density is this far below the best of every texel.
    pub reach: f32,
    /// Whether colours are fitted by least squares afterwards.
    pub refit: bool,
    /// Of where components start.
    pub seed: u64,
}

/// Rounds on a share of the samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WarmUp {
    /// Of all samples; more are used where a component would have few.
    pub share: f64,
    /// How many rounds.
    pub rounds: usize,
}

/// The codec.
#[derive(Clone, Debug, PartialEq)]
pub struct GaussianMixture {
    frame: Frame,
    precision: Precision,
    /// (view, light, channel), 255 stands for 1.
    mean: Vec<u8>,
    components: Vec<Component>,
    /// The components, ready to be evaluated.
    packed: Box<Packed>,
    places: Places,
}

impl Options {
    /// What a budget means for this codec: the authors' 600 components, or what fits the ratio; a quality
    /// of 0 is 16 components, of 100 is 2048, by equal factors between.
    ///
    /// # Errors
    /// Where a number is out of range, or the mean picture alone is larger than the ratio allows.
    pub fn new(btf: &Btf, budget: Budget, precision: Precision, seed: u64) -> Result<Self, TextureError> {
        Ok(Self {
            components: size::allowed(btf, budget, precision)?,
            precision,
            rounds: 40,
            warm_up: Some(WarmUp { share: 0.04, rounds: 14 }),
            try_shapes: true,
            reach: 14.0,
            refit: true,
            seed,
        })
    }
}

/// Fits the codec. The objective is the mean log-likelihood of a sample before each round.
///
/// # Errors
/// Where lists and lengths of the data disagree, samples are not finite or were not encoded, or options are out of range.
pub fn fit(btf: &Btf, options: &Options) -> Result<(GaussianMixture, FitReport), TextureError> {
    check(btf, options)?;
    let (grid, frame) = (Grid::of(btf), Frame::of(btf));
    let pairs = measured_pairs(btf);
    let mut notes = Vec::new();
    let count = options.components.unwrap_or_else(|| {
        let (count, note) = size::supported(&grid, &pairs, options);
        notes.push(note);
        count
    });
    let found = estimate(&grid, &pairs, count, options);
    describe(&found, count, options, &mut notes);
    for (axis, _) in ["x", "y"].iter().zip(grid.periods).filter(|(_, period)| period.length > 0.0) {
        notes.push(format!("the tile continues itself along {axis}"));
    }
    let mut components: Vec<Component> =
        found.components.iter().map(|c| storage::rounded(c, options.precision, &frame)).collect();
    if options.refit {
        components = refit::refitted(&grid, components, &pairs);
        components.iter_mut().for_each(|c| *c = storage::rounded(c, options.precision, &frame));
    }
    let codec = GaussianMixture::new(frame, options.precision, grid.periods, grid.mean, components);
    Ok((codec, FitReport { objective: found.log_likelihood, notes }))
}

fn check(btf: &Btf, options: &Options) -> Result<(), TextureError> {
    let refuse = |fault: String, remedy: &str| Err(TextureError::Degenerate { fault, remedy: remedy.into() });
    if btf.samples.is_empty() || btf.samples.len() != 3 * btf.texels() * btf.pairs() {
        let fault = format!("{} samples for {} pairs of {} texels", btf.samples.len(), btf.pairs(), btf.texels());
        return refuse(fault, "give one picture of equal size per pair of view and light");
    }
    if let Some(sample) = btf.samples.iter().find(|s| !s.is_finite() || s.abs() > LARGEST_SAMPLE) {
        return refuse(format!("a sample is {sample}"), "fill holes by Btf::check, and encode a high range as Log");
    }
    if options.components.is_some_and(|count| !(1..=size::MOST).contains(&count)) || options.rounds == 0 {
        let fault = format!("{:?} components in {} rounds were asked for", options.components, options.rounds);
        return refuse(fault, "ask for 1 to 4096 components and at least 1 round");
    }
    if options.reach.is_nan() || options.reach <= 0.0 {
        return refuse(format!("a reach of {} was asked for", options.reach), "14 changes sums by less than 0.1 %");
    }
    Ok(())
}

/// What was measured; all where nothing was.
fn measured_pairs(btf: &Btf) -> Vec<u32> {
    let lights = btf.lights.len();
    let all = 0..btf.pairs() as u32;
    let measured = |pair: &u32| btf.is_measured(*pair as usize / lights, *pair as usize % lights);
    let pairs: Vec<u32> = all.clone().filter(measured).collect();
    if pairs.is_empty() { all.collect() } else { pairs }
}

fn describe(found: &Estimate, asked: usize, options: &Options, notes: &mut Vec<String>) {
    let count = found.components.len();
    if count < asked {
        notes.push(format!("{count} components were made of {asked}: samples are few or alike"));
    }
    let on_floor = |c: &&Component| c.sigma.iter().zip(&FLOORS).any(|(sigma, floor)| sigma <= floor);
    let floored = found.components.iter().filter(on_floor).count();
    notes.push(format!("{floored} of {count} components have a deviation at its floor"));
    if found.reseeded > 0 {
        notes.push(format!("components were empty {} times, and put elsewhere", found.reseeded));
    }
    notes.push(format!("components started as narrow as M to the power of minus {:.2?}", found.shape));
    let bound = count as f64 * f64::from(-options.reach).exp();
    notes.push(format!(
        "{:.2} % of densities were evaluated, which changes sums by at most {:.4} %",
        100.0 * found.evaluated,
        100.0 * bound
    ));
}

impl GaussianMixture {
    fn new(
        frame: Frame,
        precision: Precision,
        periods: [Period; 2],
        mean: Vec<u8>,
        components: Vec<Component>,
    ) -> Self {
        let packed = Box::new(Packed::new(&components, periods));
        let places = Places::of([frame.width, frame.height].map(variables::centres));
        Self { frame, precision, mean, components, packed, places }
    }

    /// M.
    pub fn components(&self) -> usize {
        self.components.len()
    }

    /// The mean picture between the measured pairs.
    fn mean_colour(&self, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3] {
        let (lights, views) = (self.frame.lights.blend(light), self.frame.views.blend(view));
        let mut colour = [0.0; 3];
        for (v, view_weight) in views.entries {
            for (l, light_weight) in lights.entries {
                let mean = &self.mean[3 * (v as usize * self.frame.lights.len() + l as usize)..][..3];
                let weight = view_weight * light_weight / 255.0;
                (0..3).for_each(|c| colour[c] += weight * f32::from(mean[c]));
            }
        }
        colour
    }
}

/// α and s of light, then eye; the normal's where a vector is none.
fn angles(light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 4] {
    let slice = |d: &Vector3<f32>| {
        let unit = d.cast::<f64>().try_normalize(1e-30).filter(|unit| unit.iter().all(|c| c.is_finite()));
        onion_slice(&unit.unwrap_or_else(Vector3::z)).map(|v| v as f32)
    };
    let ([la, ls], [va, vs]) = (slice(light), slice(view));
    [la, ls, va, vs]
}

impl Sampler for GaussianMixture {
    fn frame(&self) -> &Frame {
        &self.frame
    }

    fn value(&self, texel: usize, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3] {
        let mut out = [[0.0; 3]];
        self.values(&[texel], light, view, &mut out);
        out[0]
    }

    fn values(&self, texels: &[usize], light: &Vector3<f32>, view: &Vector3<f32>, out: &mut [[f32; 3]]) {
        let (angles, mean) = (angles(light, view), self.mean_colour(light, view));
        let width = self.frame.width;
        let place = |texel: usize| self.places.at(&self.packed, [texel % width, texel / width]);
        for (texels, out) in texels.chunks(prediction::FEW).zip(out.chunks_mut(prediction::FEW)) {
            let found = match *texels {
                [texel] => [prediction::one(&self.packed, angles, &[place(texel)])[0]; prediction::FEW],
                _ => {
                    let places = std::array::from_fn(|k| place(texels[k.min(texels.len() - 1)]));
                    prediction::few(&self.packed, angles, &places)
                }
            };
            for ((out, found), _) in out.iter_mut().zip(found).zip(texels) {
                *out = [0, 1, 2].map(|c| mean[c] + found[c]);
            }
        }
    }

    fn picture(&self, light: &Vector3<f32>, view: &Vector3<f32>) -> Vec<f32> {
        let mean = self.mean_colour(light, view);
        let mut picture = prediction::picture(&self.packed, &self.places, angles(light, view));
        picture.chunks_exact_mut(3).for_each(|texel| (0..3).for_each(|c| texel[c] += mean[c]));
        picture
    }

    fn tables(&self) -> Option<Tables> {
        let components = (0..self.packed.count).map(|m| self.packed.component(m)).collect();
        let mean = self.mean.as_chunks::<3>().0.iter().map(|m| m.map(|c| f32::from(c) / 255.0)).collect();
        let periods = self.packed.periods.map(|period| period.length);
        Some(Tables::GaussianMixture(MixtureTables { components, periods, mean }))
    }
}
