//! Random-field models of BTFs: a range map for what is regular, random textures for the rest (Haindl and Filip,
//! "Extreme compression and modeling of bidirectional texture function", 2007, and their earlier papers on GMRF, 2-D
//! and 3-D CAR models). Shared by [`gmrf`](super::gmrf), [`car2d`](super::car2d) and [`car3d`](super::car3d), which
//! differ in the model of one band.
//!
//! ```text
//! fit          range map        range_map    photometric stereo, integrated
//!              groups           clusters     pictures that look alike, K of them
//!              gains            overlay      what light and view make of the range map, regressed on per group
//!              bands            pyramid      of what is left, finest first
//!              parameters       gmrf, …      per group and band, from autocovariances
//! synthesize   noise → parameters (blended between directions) → collapse → displace + gains · overlay
//!              → histogram's shape → mean and deviation of the direction
//! ```
//!
//! A picture of light l and view v: `Y(x) = m(l,v) + d(l,v) · shape_k(T_k(s(x)) + Σ_j g_kj F_j(x; l, v))`, where k is
//! the group of the pair (blended over the measured pairs about it), s(x) the place of the surface seen at texel x,
//! T the random texture (stationary, of the models), F eight features of the relief, m and d three numbers each.
//!
//! - *Parameters*: groups K ([`Options::groups`]), rank r of the moments.
//! - *File*: 7 bytes; `⌈log₂ K⌉` bits a pair; the range map, a byte a texel, and three for the
//!   reflectance where it is kept; `r (views + 6 lights)` bytes of moments;
//!   per group 52 bytes of gains, 52 of tones, and its model: gmrf and car2d 9 words of axes, 18 bits of neighbours
//!   and 2 bytes per coefficient and noise for each of 3 components and up to 4 bands; car3d 9 words per neighbour.
//!   Four bytes more for every step of a list. It grows with texels by the range map alone.
//! - *Cost*: fit, one pass over the pictures for moments and groups, then eight pictures a group. A picture: one pair
//!   of Fourier transforms per channel and band, two rays a texel.
//! - *Not published, added here*: gains by least squares instead of one bump mapping; separable moments between
//!   directions; the tones of the histogram; as an option
//!   ([`Options::reflectance`]) a tiled map of what each texel reflects. Published, left out: Bayesian choice of neighbours by the full
//!   posterior (its leading terms are used).
//! - *Limits*: what the range map does not show (patterns of colour) comes back as noise of the right spectrum and
//!   histogram. Judge by [`statistics`](super::statistics), not texel by texel.
//! - *Degenerate data*: constant pictures come back as they were; one texel, one light or one view have a flat range
//!   map, and noise without neighbours; fewer different pictures than groups make fewer groups; a high range is
//!   modelled as it is encoded.

pub(super) mod autoregression;
mod clusters;
pub(super) mod decorrelated;
pub(super) mod fourier;
mod moments;
mod noise;
pub(super) mod numbers;
mod overlay;
mod pyramid;
mod range_map;
mod tile;

use super::container::{Fault, Reader, Writer};
use super::frame::Blend;
use super::{Budget, FitReport, Frame, Precision};
use crate::TextureError;
use autoregression::Covariances;
use capture::btf::Btf;
use clusters::{Clusters, Description};
use fourier::{Fourier, Wave, frequency};
use moments::{Moments, TONES};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use numbers::{Numbers, Width};
use overlay::{FEATURES, Relief, Seen};
use rayon::prelude::*;
use rustfft::num_complex::Complex64;
use std::collections::BTreeMap;

/// Groups of the published models: 10 to 30.
const STANDARD_GROUPS: usize = 20;
/// More would hold pictures, not groups of them.
const MOST_GROUPS: usize = 256;
const STANDARD_RANK: usize = 6;
/// Pictures of a group its parameters are estimated from, those nearest to its middle.
const EXAMPLES: usize = 8;
/// [`Groups::Auto`] explains all but this share of the descriptions' variance.
const UNEXPLAINED: f64 = 0.05;
/// Added to the diagonal of a regression, as a share of it.
const GAIN_RIDGE: f64 = 1e-3;
/// Heights tried for the range map, over those of photometric stereo.
const HEIGHT_SCALES: [f64; 6] = [0.5, 1.0, 1.5, 2.0, 3.0, 4.0];
/// Pictures they are tried on.
const CALIBRATION_PAIRS: usize = 60;
/// Tries at a ratio.
const RATIO_ROUNDS: usize = 6;

/// Features of the relief, and two of the reflectance.
const CUES: usize = FEATURES + 2;

/// A picture's channels without their means, and what is seen at its texels.
type Example = ([Vec<f64>; 3], Vec<Seen>);

/// How many groups of pictures have parameters of their own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Groups {
    /// As many; fewer where fewer pictures differ.
    Count(usize),
    /// As many as fit into raw bytes over this.
    Ratio(f64),
    /// As few as explain 95 % of the variance of the pictures' histograms.
    Auto,
}

/// How a random-field model is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Groups of pictures.
    pub groups: Groups,
    /// Singular pairs of the matrix of means and deviations, 1 to 255.
    pub moment_rank: usize,
    /// Keep beside the range map what each texel reflects, three bytes a texel: the published models do not, and
    /// lose what is colour and not relief.
    pub reflectance: bool,
    /// How numbers are stored.
    pub precision: Precision,
    /// Of the groups' starts.
    pub seed: u64,
}

/// What three white noises are multiplied by at a frequency, to be the three channels of a band.
pub(super) type BandFilter = Box<dyn Fn(&Wave) -> Matrix3<Complex64> + Send + Sync>;

/// The model of a group's texture, in all bands.
pub(super) trait FieldModel: Clone + std::fmt::Debug + PartialEq + Send + Sync + Sized {
    /// From the autocovariances of each band, finest first.
    fn estimate(bands: &[Covariances], precision: Precision) -> Self;

    /// The filter of a band; 0 where the model has no field, and never larger than 10² times the noise it was read
    /// with.
    fn filter(&self, band: usize) -> BandFilter;

    fn write(&self, out: &mut Writer);

    fn read(from: &mut Reader<'_>, bands: usize, precision: Precision) -> Result<Self, Fault>;
}

/// A material as range map and random textures.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RandomField<M> {
    frame: Frame,
    precision: Precision,
    bands: usize,
    /// Heights in texels, (y, x).
    range_map: Numbers,
    /// (channel, y, x), where it is kept.
    reflectance: Option<Numbers>,
    moments: Moments,
    /// Per pair, (view, light); empty where there is one group.
    group_of: Vec<u16>,
    looks: Vec<Look<M>>,
}

/// How the pictures of a group look.
#[derive(Clone, Debug, PartialEq)]
struct Look<M> {
    /// (channel, cue).
    gains: Numbers,
    /// (channel, level), of standardised values.
    tones: Numbers,
    field: M,
}

/// The regular part of a material, at some size.
#[derive(Clone, Debug)]
struct Surface {
    relief: Relief,
    /// (channel, y, x); empty where it is not kept.
    reflectance: Vec<f64>,
}

/// What does not depend on the number of groups.
struct Prepared {
    range_map: Numbers,
    reflectance: Option<Numbers>,
    surface: Surface,
    descriptions: Vec<Description>,
}

impl Options {
    /// Standard: 20 groups. `Components`: that many. `Ratio`: as many as fit. `Quality`: from 1 (0) to 256 (100), in
    /// geometric steps; above 50 with the reflectance. `Auto`: [`Groups::Auto`], with the reflectance. All others are
    /// without, as published.
    ///
    /// # Errors
    /// Where a number is out of range.
    pub fn new(_btf: &Btf, budget: Budget, precision: Precision, seed: u64) -> Result<Self, TextureError> {
        let groups = match budget {
            Budget::Standard => Groups::Count(STANDARD_GROUPS),
            Budget::Components(count) if (1..=MOST_GROUPS).contains(&count) => Groups::Count(count),
            Budget::Ratio(ratio) if ratio > 0.0 && ratio.is_finite() => Groups::Ratio(ratio),
            Budget::Quality(quality) if (0.0..=100.0).contains(&quality) => {
                Groups::Count((MOST_GROUPS as f64).powf(quality / 100.0).round() as usize)
            }
            Budget::Auto => Groups::Auto,
            _ => {
                let fault = format!("{budget:?} is no size of a random-field model");
                let remedy = "take 1 to 256 components, a positive ratio, or a quality from 0 to 100".into();
                return Err(TextureError::Degenerate { fault, remedy });
            }
        };
        let reflectance = matches!(budget, Budget::Auto) || matches!(budget, Budget::Quality(q) if q > 50.0);
        Ok(Self { groups, moment_rank: STANDARD_RANK, reflectance, precision, seed })
    }
}

/// Fits a model.
pub(super) fn fit<M: FieldModel>(btf: &Btf, options: &Options) -> Result<(RandomField<M>, FitReport), TextureError> {
    if !(1..=255).contains(&options.moment_rank) {
        let fault = format!("a moment rank of {}", options.moment_rank);
        return Err(TextureError::Degenerate { fault, remedy: "take 1 to 255".into() });
    }
    let size = [btf.width, btf.height];
    let reflectance = options.reflectance.then(|| range_map::reflectance(btf));
    let reflectance = reflectance.map(|r| Numbers::new(&r, options.precision, Width::Byte));
    let measured = Surface {
        relief: Relief::new(range_map::range_map(btf), size),
        reflectance: reflectance.as_ref().map_or_else(Vec::new, Numbers::values),
    };
    let (calibrated, explained) = calibrated(btf, &measured);
    let range_map = Numbers::new(calibrated.relief.heights(), options.precision, Width::Byte);
    let surface = Surface { relief: Relief::new(range_map.values(), size), ..calibrated };
    let prepared = Prepared { range_map, reflectance, surface, descriptions: clusters::describe(&btf.samples, size) };
    let mut report = FitReport::default();
    report.notes.push(format!("the tiled maps explain {:.0} % of the pictures' variance", 100.0 * explained));
    let field = match options.groups {
        Groups::Count(count) => fit_groups(btf, &prepared, options, count.clamp(1, MOST_GROUPS), &mut report),
        Groups::Auto => {
            let explains = |&count: &usize| {
                clusters::cluster(&prepared.descriptions, count, options.seed).unexplained <= UNEXPLAINED
            };
            let count = (1..=MOST_GROUPS).step_by(3).find(explains).unwrap_or(MOST_GROUPS);
            fit_groups(btf, &prepared, options, count, &mut report)
        }
        Groups::Ratio(ratio) => fit_ratio(btf, &prepared, options, ratio, &mut report),
    };
    Ok((field, report))
}

fn fit_groups<M: FieldModel>(
    btf: &Btf,
    prepared: &Prepared,
    options: &Options,
    count: usize,
    report: &mut FitReport,
) -> RandomField<M> {
    let clusters = clusters::cluster(&prepared.descriptions, count, options.seed);
    let groups = clusters.members.len();
    report.objective.push(clusters.unexplained);
    if groups < count {
        report.notes.push(format!("only {groups} groups of pictures differ, {count} were asked for"));
    }
    let bands = pyramid::band_count([btf.width, btf.height]);
    let Clusters { of, members, .. } = clusters;
    let looks = members.par_iter().map(|m| look(btf, &prepared.surface, m, bands, options.precision)).collect();
    RandomField {
        frame: Frame::of(btf),
        precision: options.precision,
        bands,
        range_map: prepared.range_map.clone(),
        reflectance: prepared.reflectance.clone(),
        moments: Moments::of(btf, options.moment_rank, options.precision),
        group_of: if groups > 1 { of } else { Vec::new() },
        looks,
    }
}

/// The most groups that fit; fewer moments where not even one does.
fn fit_ratio<M: FieldModel>(
    btf: &Btf,
    prepared: &Prepared,
    options: &Options,
    ratio: f64,
    report: &mut FitReport,
) -> RandomField<M> {
    let budget = btf.raw_bytes() as f64 / ratio - super::container::header_bytes(btf) as f64;
    let mut best: Option<RandomField<M>> = None;
    let mut count = STANDARD_GROUPS;
    let mut tried = Vec::new();
    while tried.len() < RATIO_ROUNDS && !tried.contains(&count) {
        tried.push(count);
        let field = fit_groups::<M>(btf, prepared, options, count, &mut FitReport::default());
        let (all, looks) = field.byte_counts();
        let (all, per_look) = (all as f64, looks as f64 / field.looks.len() as f64);
        let more = ((budget - all) / per_look).floor();
        if all <= budget && best.as_ref().is_none_or(|best| best.looks.len() < field.looks.len()) {
            best = Some(field);
        }
        count = (count as f64 + more).clamp(1.0, MOST_GROUPS as f64) as usize;
    }
    let mut rank = options.moment_rank;
    while best.is_none() && rank > 1 {
        rank -= 1;
        let fewer = Options { moment_rank: rank, ..*options };
        let field = fit_groups::<M>(btf, prepared, &fewer, 1, &mut FitReport::default());
        best = Some(field).filter(|field| field.byte_counts().0 as f64 <= budget);
    }
    let field = best.unwrap_or_else(|| {
        let smallest = Options { moment_rank: 1, ..*options };
        fit_groups(btf, prepared, &smallest, 1, report)
    });
    let reached = btf.raw_bytes() as f64 / (field.byte_counts().0 + super::container::header_bytes(btf)) as f64;
    report.notes.push(format!("{} groups, {} singular pairs of moments", field.looks.len(), field.moments.rank()));
    if !(0.95..1.5).contains(&(reached / ratio)) {
        report.notes.push(format!("a ratio of {ratio} was asked for, the nearest these models have is {reached:.1}"));
    }
    field
}

/// Estimates what a group's pictures have in common.
fn look<M: FieldModel>(btf: &Btf, surface: &Surface, members: &[usize], bands: usize, precision: Precision) -> Look<M> {
    let size = [btf.width, btf.height];
    let example = |&pair: &usize| {
        let (view, light) = (pair / btf.lights.len(), pair % btf.lights.len());
        let channels: [Vec<f64>; 3] = [0, 1, 2].map(|c| centred_channel(btf.picture(view, light), c));
        (channels, surface.seen(&btf.lights[light], &btf.views[view]))
    };
    let examples: Vec<_> = members.iter().take(EXAMPLES).map(example).collect();
    let gains = Numbers::new(&regress(&examples, surface.cues()), precision, Width::Word);
    let used = gains.values();
    let split: Vec<[Vec<Vec<f64>>; 3]> =
        examples.iter().map(|e| [0, 1, 2].map(|c| pyramid::split(&residual(e, &used, c), size, bands))).collect();
    let covariances = |(band, &size): (usize, &[usize; 2])| {
        let fields: Vec<[Vec<f64>; 3]> = split.iter().map(|s| [0, 1, 2].map(|c| s[c][band].clone())).collect();
        Covariances::of(&fields, size)
    };
    let sizes = pyramid::band_sizes(size, bands);
    let covariances: Vec<Covariances> = sizes.iter().enumerate().map(covariances).collect();
    let tones: Vec<f64> = (0..3).flat_map(|c| mean_tones(examples.iter().map(|e| &e.0[c]))).collect();
    Look { gains, tones: Numbers::new(&tones, precision, Width::Byte), field: M::estimate(&covariances, precision) }
}

/// The relief at the height at which it explains most of the pictures, and the share of variance it explains:
/// photometric stereo sees fibres and interreflection as a flatter surface, parallax does not.
fn calibrated(btf: &Btf, surface: &Surface) -> (Surface, f64) {
    let explained = |surface: &Surface| -> f64 {
        let shares: Vec<f64> = (0..CALIBRATION_PAIRS)
            .into_par_iter()
            .map(|k| explained_share(btf, surface, k * btf.pairs() / CALIBRATION_PAIRS))
            .collect();
        shares.iter().sum::<f64>() / CALIBRATION_PAIRS as f64
    };
    let scaled = HEIGHT_SCALES.iter().map(|&scale| Surface { relief: surface.relief.scaled(scale), ..surface.clone() });
    let scaled = scaled.map(|surface| (explained(&surface), surface));
    let best = scaled.max_by(|a, b| a.0.total_cmp(&b.0));
    best.map_or_else(|| (surface.clone(), 0.0), |(share, surface)| (surface, share))
}

fn explained_share(btf: &Btf, surface: &Surface, pair: usize) -> f64 {
    let (view, light) = (pair / btf.lights.len(), pair % btf.lights.len());
    let channels: [Vec<f64>; 3] = [0, 1, 2].map(|c| centred_channel(btf.picture(view, light), c));
    let energy = |channels: &[Vec<f64>; 3]| channels.iter().flatten().map(|v| v * v).sum::<f64>();
    let before = energy(&channels);
    let example = (channels, surface.seen(&btf.lights[light], &btf.views[view]));
    let gains = regress(std::slice::from_ref(&example), surface.cues());
    let after = energy(&[0, 1, 2].map(|c| residual(&example, &gains, c)));
    if before > autoregression::CONSTANT { 1.0 - after / before } else { 0.0 }
}

/// What the relief leaves of a channel.
fn residual((channels, seen): &Example, gains: &[f64], channel: usize) -> Vec<f64> {
    channels[channel].iter().zip(seen).map(|(v, s)| v - product(gains, s, channel)).collect()
}

fn centred_channel(picture: &[f32], channel: usize) -> Vec<f64> {
    let values: Vec<f64> = picture.iter().skip(channel).step_by(3).map(|&v| f64::from(v)).collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|v| v - mean).collect()
}

/// Gains (channel, cue) by least squares over all examples.
fn regress(examples: &[Example], cues: usize) -> Vec<f64> {
    (0..3).flat_map(|channel| regress_channel(examples, cues, channel)).collect()
}

fn regress_channel(examples: &[Example], cues: usize, channel: usize) -> Vec<f64> {
    let mut gram = DMatrix::<f64>::zeros(cues, cues);
    let mut moment = DVector::<f64>::zeros(cues);
    for (s, value) in examples.iter().flat_map(|(channels, seen)| seen.iter().zip(&channels[channel])) {
        let f: [f64; CUES] = cues_of(s, channel);
        for i in 0..cues {
            moment[i] += f[i] * value;
            (0..cues).for_each(|j| gram[(i, j)] += f[i] * f[j]);
        }
    }
    let floor = 1e-9 * (1.0 + gram.trace());
    (0..cues).for_each(|i| gram[(i, i)] += GAIN_RIDGE * gram[(i, i)] + floor);
    let solved = gram.cholesky().map(|c| c.solve(&moment));
    solved.map_or_else(|| vec![0.0; cues], |gains| gains.iter().copied().collect())
}

fn mean_tones<'a>(channels: impl Iterator<Item = &'a Vec<f64>> + Clone) -> [f64; TONES] {
    let count = channels.clone().count().max(1) as f64;
    let mut mean = [0.0; TONES];
    for channel in channels {
        let mut values = channel.clone();
        moments::standardise(&mut values);
        mean.iter_mut().zip(moments::tones(&values)).for_each(|(m, t)| *m += t / count);
    }
    mean
}

/// What a channel regresses on: the relief's features, then reflectance, as it is and lit.
fn cues_of(seen: &Seen, channel: usize) -> [f64; CUES] {
    let mut cues = [0.0; CUES];
    cues[..FEATURES].copy_from_slice(&seen.features);
    cues[FEATURES] = seen.reflectance[channel];
    cues[FEATURES + 1] = seen.reflectance[channel] * seen.features[0];
    cues
}

/// The regular part of a texel's channel; `gains` are (channel, cue).
fn product(gains: &[f64], seen: &Seen, channel: usize) -> f64 {
    let cues = gains.len() / 3;
    gains[channel * cues..(channel + 1) * cues].iter().zip(cues_of(seen, channel)).map(|(g, f)| g * f).sum()
}

impl Surface {
    /// The relief's features, and the reflectance of what is seen.
    fn seen(&self, light: &Vector3<f64>, view: &Vector3<f64>) -> Vec<Seen> {
        let mut seen = self.relief.seen(light, view);
        let texels = seen.len();
        if !self.reflectance.is_empty() {
            seen.iter_mut().for_each(|s| s.reflectance = [0, 1, 2].map(|c| self.reflectance[c * texels + s.texel]));
        }
        seen
    }

    /// What a channel regresses on, in number.
    fn cues(&self) -> usize {
        if self.reflectance.is_empty() { FEATURES } else { CUES }
    }
}

impl<M: FieldModel> RandomField<M> {
    pub(super) fn frame(&self) -> &Frame {
        &self.frame
    }

    /// See [`Synthesizer::picture`](super::Synthesizer::picture). A direction that is none is the surface's normal;
    /// what lies below the horizon is raised to it.
    pub(super) fn picture(&self, size: [usize; 2], seed: u64, light: &Vector3<f32>, view: &Vector3<f32>) -> Vec<f32> {
        if size.contains(&0) {
            return Vec::new();
        }
        let [light, view] = [above(light), above(view)];
        let blends = [self.frame.views.blend(&view.cast()), self.frame.lights.blend(&light.cast())];
        let looks = self.looks_about(&blends[0], &blends[1]);
        let moments = self.moments.at(&blends[0], &blends[1]);
        let seen = self.surface(size).seen(&light, &view);
        let textures = self.textures(size, seed, &looks);
        let gains = blended(&looks, |look| look.gains.values());
        let tones = blended(&looks, |look| look.tones.values());
        let mut picture = vec![0.0; 3 * size[0] * size[1]];
        for c in 0..3 {
            let mut values: Vec<f64> = seen.iter().map(|s| textures[c][s.texel] + product(&gains, s, c)).collect();
            moments::shape(&mut values, &std::array::from_fn(|i| tones[c * TONES + i]));
            let (mean, deviation) = (moments[c], moments[3 + c].max(0.0));
            let places = picture.iter_mut().skip(c).step_by(3);
            places.zip(values).for_each(|(p, v)| *p = (mean + deviation * v).max(0.0) as f32);
        }
        picture
    }

    /// The regular part at a size.
    fn surface(&self, size: [usize; 2]) -> Surface {
        let heights = self.range_map.values();
        let texels = tile::tiled(&heights, [self.frame.width, self.frame.height], size);
        let reflectance = self.reflectance.as_ref().map_or_else(Vec::new, Numbers::values);
        let channels = reflectance.chunks_exact(heights.len());
        Surface {
            reflectance: channels.flat_map(|channel| texels.iter().map(|&t| channel[t])).collect(),
            relief: Relief::new(texels.iter().map(|&t| heights[t]).collect(), size),
        }
    }

    /// The groups of the measured pairs about a pair, with their weights.
    fn looks_about(&self, view: &Blend, light: &Blend) -> Vec<(&Look<M>, f64)> {
        let mut weights = BTreeMap::new();
        for (v, l) in view.entries.iter().flat_map(|v| light.entries.iter().map(move |l| (v, l))) {
            let pair = v.0 as usize * self.frame.lights.len() + l.0 as usize;
            let group = self.group_of.get(pair).map_or(0, |&group| usize::from(group));
            *weights.entry(group).or_insert(0.0) += f64::from(v.1 * l.1);
        }
        weights.into_iter().filter(|w| w.1 > 0.0).map(|(group, weight)| (&self.looks[group], weight)).collect()
    }

    /// The three channels of the random texture, (y, x). Noise depends on the seed alone, so the surface stays
    /// the same under all lights and views.
    fn textures(&self, size: [usize; 2], seed: u64, looks: &[(&Look<M>, f64)]) -> [Vec<f64>; 3] {
        let mut bands: [Vec<Vec<f64>>; 3] = Default::default();
        for (band, band_size) in pyramid::band_sizes(size, self.bands).into_iter().enumerate() {
            let filters: Vec<_> = looks.iter().map(|(look, weight)| (look.field.filter(band), *weight)).collect();
            let filter = |wave: &Wave| -> Matrix3<Complex64> {
                filters.iter().map(|(f, w)| f(wave) * Complex64::new(*w, 0.0)).sum()
            };
            let channels = filtered_noise(band_size, seed, 3 * band as u64, filter);
            bands.iter_mut().zip(channels).for_each(|(bands, channel)| bands.push(channel));
        }
        bands.map(|bands| pyramid::collapse(&bands, size))
    }

    /// Bytes of the codec's part of the file, and of the looks among them.
    fn byte_counts(&self) -> (usize, usize) {
        let mut out = Writer::default();
        self.write(&mut out);
        let parts = out.parts();
        let bytes = |name: Option<&str>| {
            parts.iter().filter(|p| name.is_none_or(|n| n == p.name)).map(|p| p.bytes as usize).sum()
        };
        (bytes(None), bytes(Some("looks")))
    }

    pub(super) fn write(&self, out: &mut Writer) {
        out.part("groups");
        out.u8(u8::from(self.precision == Precision::Compact));
        out.u8(u8::from(self.reflectance.is_some()));
        out.u8(self.bands as u8);
        out.u8(self.moments.rank() as u8);
        out.u16(self.looks.len() as u16);
        self.group_of.iter().for_each(|&group| out.bits(u32::from(group), group_bits(self.looks.len())));
        out.align();
        out.part("range map");
        self.range_map.write(out);
        if let Some(reflectance) = &self.reflectance {
            out.part("reflectance");
            reflectance.write(out);
        }
        out.part("moments");
        self.moments.write(out);
        out.part("looks");
        for look in &self.looks {
            look.gains.write(out);
            look.tones.write(out);
            look.field.write(out);
        }
    }

    pub(super) fn read(from: &mut Reader<'_>, frame: Frame) -> Result<Self, Fault> {
        let precision = if from.u8()? == 0 { Precision::Full } else { Precision::Compact };
        let with_reflectance = from.u8()? != 0;
        let bands = usize::from(from.u8()?);
        if bands != pyramid::band_count([frame.width, frame.height]) {
            return Err(Fault(format!("{bands} bands for a tile of {} × {}", frame.width, frame.height)));
        }
        let rank = usize::from(from.u8()?);
        let groups = usize::from(from.u16()?);
        if !(1..=MOST_GROUPS).contains(&groups) {
            return Err(Fault(format!("{groups} groups of pictures")));
        }
        let group_of = read_groups(from, frame.pairs(), groups)?;
        let range_map = Numbers::read(from, frame.texels(), precision, Width::Byte)?;
        let read = |from: &mut Reader<'_>| Numbers::read(from, 3 * frame.texels(), precision, Width::Byte);
        let reflectance = if with_reflectance { Some(read(from)?) } else { None };
        let cues = if with_reflectance { CUES } else { FEATURES };
        let moments = Moments::read(from, rank, &frame, precision)?;
        let mut looks = Vec::new();
        for _ in 0..groups {
            let gains = Numbers::read(from, 3 * cues, precision, Width::Word)?;
            let tones = Numbers::read(from, 3 * TONES, precision, Width::Byte)?;
            looks.push(Look { gains, tones, field: M::read(from, bands, precision)? });
        }
        Ok(Self { frame, precision, bands, range_map, reflectance, moments, group_of, looks })
    }
}

/// The group of each pair; none are stored where there is one group.
fn read_groups(from: &mut Reader<'_>, pairs: usize, groups: usize) -> Result<Vec<u16>, Fault> {
    let width = group_bits(groups);
    if width == 0 {
        return Ok(Vec::new());
    }
    from.expect(pairs / 8, width as usize)?;
    let group = |_| match from.bits(width)? as usize {
        group if group < groups => Ok(group as u16),
        group => Err(Fault(format!("group {group} of {groups}"))),
    };
    let read = (0..pairs).map(group).collect();
    from.align();
    read
}

/// Bits of a group's number.
fn group_bits(groups: usize) -> u32 {
    usize::BITS - (groups - 1).leading_zeros()
}

/// Three white noises (streams `stream` to `stream + 2`), filtered frequency by frequency, without means.
fn filtered_noise(
    size: [usize; 2],
    seed: u64,
    stream: u64,
    filter: impl Fn(&Wave) -> Matrix3<Complex64> + Sync,
) -> [Vec<f64>; 3] {
    let (fourier, texels) = (Fourier::new(size), size[0] * size[1]);
    let noise = [0, 1, 2].map(|c| fourier.forward(&noise::gaussian_field(seed, stream + c, texels)));
    let filtered = |k: usize| {
        let wave = Wave::new([frequency(k % size[0], size[0]), frequency(k / size[0], size[1])]);
        filter(&wave) * Vector3::new(noise[0][k], noise[1][k], noise[2][k])
    };
    let mut spectrum: Vec<Vector3<Complex64>> = (0..texels).into_par_iter().map(filtered).collect();
    spectrum[0] = Vector3::from_element(Complex64::new(0.0, 0.0));
    [0, 1, 2].map(|c| fourier.inverse(spectrum.iter().map(|v| v[c]).collect()))
}

/// A unit vector on the surface's side.
fn above(direction: &Vector3<f32>) -> Vector3<f64> {
    let d: Vector3<f64> = direction.cast();
    let raised = Vector3::new(d.x, d.y, d.z.max(0.0));
    raised.try_normalize(1e-9).filter(|d| d.iter().all(|v| v.is_finite())).unwrap_or_else(Vector3::z)
}

fn blended<M>(looks: &[(&Look<M>, f64)], values: impl Fn(&Look<M>) -> Vec<f64>) -> Vec<f64> {
    let mut sum: Vec<f64> = Vec::new();
    for (look, weight) in looks {
        let values = values(look);
        sum.resize(values.len(), 0.0);
        sum.iter_mut().zip(values).for_each(|(s, v)| *s += weight * v);
    }
    sum
}

#[cfg(test)]
mod tests;
