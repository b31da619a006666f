//! Multi-level vector quantisation: texels share what they have in common under all views, under the views
//! of one azimuth, under one view, in one slice of lights.
//!
//! ```text
//! P6  width × height   ─▶ P4 · c₆        a texel          F(α, β, θ_v, φ_v)
//! P4  S₄ × n_φ         ─▶ P3 · c₄        an azimuth       F(α, β, θ_v)
//! P3  S₃ × n_θ         ─▶ M  · c₃        a view           F(α, β)
//! M   S_M × 2          ─▶ P2, I2         luminance, chroma
//! P2  S₂ × n_α         ─▶ P1 · c₂        a slice          F(β)
//! P1  S₁ × n_β         numbers of mean 1
//! I2  S_I2 × n_α ─▶ I1  S_I1 × n_β ─▶ C  S_C × (Cr, Cb)
//!
//! Y = c₆ c₄ c₃ c₂ · P1[P2[M[P3[P4[P6[x]][φ_v]][θ_v]]][α]][β]                             (equation 4)
//! ```
//!
//! | file | what |
//! |---|---|
//! | `grid` | onion slices of equal solid angle, 11 × 11 × 7 × 16 |
//! | `resample` | from the measured directions to the grid |
//! | `color` | luminance and chroma |
//! | `measure`, `search` | when an item stands for a slice; the nearest one |
//! | `options` | budgets, phases, thresholds |
//! | `grow` | the nest, grown texel by texel |
//! | `books` | few bits, and the file |
//! | `evaluate`, `importance` | a sample; a direction |
//!
//! *Order*: texels of a Halton sequence; the first 1 % under the threshold, 4 % under one whose square is 2.5 times as large,
//! the rest. In the paper the rest becomes the nearest item of P4 ([`Phase::PAPER`]), which for small tiles is a poor
//! one; by default ([`Phase::COMBINING`]) it may add combinations of the slices there are to P4, P3 and M. *Rate*:
//! one threshold moves all ([`Aim`]); a ratio is reached by bisecting it. *Several materials* share all but P6 ([`fit_shared`]);
//! a BRDF is a material of one texel. *Mip-maps* are P6 of radiance averaged over 2 × 2 texels, out of the same books.
//!
//! *Cost*: per texel 5 M multiplications to resample and `112 (121 S₂ + 242 S_I2)` to compare with all books; a
//! sample is 16 chains of look-ups. *Limits*: 16 azimuths of the view cannot hold the 24 of the outermost measured ring; where parallax
//! is strong, `grid.phi = 24` halves the error of the grid itself. Between the cells, 12° to 16° wide, everything is linear; beyond the outermost measured
//! polar angle it is that of the rim; chroma is not scaled with luminance. Constant data take one item per book
//! and no P6; black has scale 0; missing or repeated directions are bridged by the resampling.
//!
//! Source: Havran, Filip, Myszkowski, "Bidirectional Texture Function Compression Based on Multi-Level Vector Quantization",
//! Computer Graphics Forum 29(1), 2010. Taken otherwise: `s = sin β` uniform, not `cos β`; distances not squared; the 2nd, not
//! 98th, percentile of SSIM; interpolation, for equation 4 is nearest.

mod books;
pub mod color;
mod evaluate;
mod grid;
mod grow;
mod importance;
mod measure;
mod options;
mod resample;
mod search;

pub use grid::{Axis, Grid};
pub use grow::Growth;
pub use measure::Measure;
pub use options::{Aim, Options, Phase};

use super::container::{Fault, Reader, Stored, Writer};
use super::{Codec, FitReport, Frame, Material, Sampler};
use crate::TextureError;
use books::{Books, Plane, settle};
use capture::btf::{Btf, Encoding};
use evaluate::Tables;
use grow::{Growing, Link, Query};
use importance::Distributions;
use measure::Acceptance;
use nalgebra::Vector3;
use options::progressive_order;
use rayon::prelude::*;
use resample::Resampler;
use std::sync::Arc;

/// Texels resampled as one matrix.
const BLOCK: usize = 8;
/// Texels in memory at a time.
const BATCH: usize = 4 * BLOCK;
/// Shares of smaller tiles count as those of so many texels: a handful of texels fills no books.
const SMALL_TILE: usize = 3200;
/// Rounds of the search for a threshold.
const ROUNDS: usize = 12;
/// A ratio may be exceeded by this share.
const RATIO_TOLERANCE: f64 = 0.03;
/// Beyond any logarithm of a ratio of sizes.
const OVER_BUDGET: f64 = 1e3;
/// The first threshold tried.
const FIRST_THRESHOLD: f64 = 16.0;
/// Thresholds searched, in levels or in hundredths of `1 − SSIM`.
const THRESHOLDS: [f64; 2] = [0.02, 200.0];
/// Encoded samples go by about this root of radiance: 2.4 with a linear toe.
const SRGB_POWER: f32 = 2.2;

/// The codec. Cheap to clone: materials of one book share it.
#[derive(Clone, Debug, PartialEq)]
pub struct MultilevelVq {
    frame: Frame,
    books: Arc<Books>,
    tables: Arc<Tables>,
    distributions: Arc<Distributions>,
    /// Encoded samples to this power are about proportional to radiance.
    power: f32,
    includes_cosine: bool,
    /// P6 per material, and within it per size, the measured one first.
    materials: Arc<Vec<Vec<Plane>>>,
    shown: usize,
}

/// Fits the codec.
///
/// # Errors
/// Where an option is out of range.
pub fn fit(btf: &Btf, options: &Options) -> Result<(MultilevelVq, FitReport), TextureError> {
    fit_shared(std::slice::from_ref(btf), options)
}

/// Fits several materials to one set of books; [`MultilevelVq::with_material`] tells them apart. A ratio counts the
/// bytes of all. The directions of the codec's frame are those of the first.
///
/// # Errors
/// Where there are none, they are encoded differently, or an option is out of range.
pub fn fit_shared(btfs: &[Btf], options: &Options) -> Result<(MultilevelVq, FitReport), TextureError> {
    options.check()?;
    let Some(first) = btfs.first() else {
        return Err(degenerate("there is no material to fit", "give at least one"));
    };
    if btfs.iter().any(|b| std::mem::discriminant(&b.encoding) != std::mem::discriminant(&first.encoding)) {
        return Err(degenerate("materials of one book are encoded differently", "encode all alike"));
    }
    let inputs = btfs.iter().map(|btf| Input::new(btf, options)).collect::<Result<Vec<_>, _>>()?;
    let mut report = FitReport::default();
    let codec = match options.aim {
        Aim::Threshold(threshold) => fit_threshold(first, &inputs, options, threshold),
        Aim::Ratio(ratio) => {
            let raw: u64 = btfs.iter().map(Btf::raw_bytes).sum();
            // Searched are values that fall with the threshold.
            let bytes = |codec: &MultilevelVq| byte_count(first, codec) as f64;
            let most = raw as f64 / ratio;
            let range = [most / (1.0 + RATIO_TOLERANCE), most];
            search_threshold(range, bytes, |t| fit_threshold(first, &inputs, options, t), &mut report)
        }
        Aim::Entries(count) => {
            let entries = |codec: &MultilevelVq| codec.entries()[6].1 as f64;
            let range = [0.9 * count as f64, count as f64];
            search_threshold(range, entries, |t| fit_threshold(first, &inputs, options, t), &mut report)
        }
    };
    let sizes: Vec<String> = codec.entries().iter().map(|(book, count)| format!("{book} {count}")).collect();
    report.notes.push(format!("items: {}", sizes.join(", ")));
    Ok((codec, report))
}

/// A material, and the way to its texels.
struct Input<'a> {
    btf: &'a Btf,
    resampler: Resampler,
    /// Texels in the order in which they are coded.
    order: Vec<usize>,
    /// The same at half the size and on, one texel the last.
    smaller: Vec<Btf>,
}

impl<'a> Input<'a> {
    fn new(btf: &'a Btf, options: &Options) -> Result<Self, TextureError> {
        let resampler = Resampler::new(options.grid, &btf.views, &btf.lights)?;
        let halve = |btf: &Btf| (btf.texels() > 1).then(|| halved(btf));
        let smaller = match options.mip_maps {
            true => std::iter::successors(halve(btf), halve).collect(),
            false => Vec::new(),
        };
        Ok(Self { btf, resampler, order: progressive_order(btf.width, btf.height, options.seed), smaller })
    }
}

/// One threshold from the first texel to the file's numbers.
fn fit_threshold(first: &Btf, inputs: &[Input<'_>], options: &Options, threshold: f64) -> MultilevelVq {
    let mut books = Growing::new(options.grid);
    let mut links: Vec<Vec<Link>> = inputs.iter().map(|i| vec![Link::default(); i.order.len()]).collect();
    let mut before = 0.0;
    for phase in options.phases {
        let accept = options.acceptance(threshold * phase.slack.sqrt());
        for (input, links) in inputs.iter().zip(&mut links) {
            let count = input.order.len();
            let place = |share: f64| ((share * count.max(SMALL_TILE) as f64).ceil() as usize).min(count);
            let texels = &input.order[place(before)..place(before + phase.share)];
            encode(&mut books, input, texels, &accept, phase.growth, links);
        }
        before += phase.share;
    }
    let nearest = options.acceptance(threshold);
    let mut planes = Vec::new();
    for (input, links) in inputs.iter().zip(links) {
        planes.push((input.btf.width, input.btf.height, links));
        for btf in &input.smaller {
            let mut links = vec![Link::default(); btf.texels()];
            let texels: Vec<usize> = (0..btf.texels()).collect();
            let small = Input { btf, resampler: input.resampler.clone(), order: Vec::new(), smaller: Vec::new() };
            encode(&mut books, &small, &texels, &nearest, Growth::Nothing, &mut links);
            planes.push((btf.width, btf.height, links));
        }
    }
    let (books, planes) = settle(&books, &planes, options.precision);
    let mut planes = planes.into_iter();
    let materials = inputs.iter().map(|input| planes.by_ref().take(1 + input.smaller.len()).collect()).collect();
    let power = match first.encoding {
        Encoding::Srgb => SRGB_POWER,
        Encoding::Linear => 1.0,
        Encoding::Log { floor, peak } => log_power(peak / floor),
    };
    MultilevelVq::new(Frame::of(first), books, power, first.includes_cosine, materials)
}

/// The power that agrees with `exp` at the floor and at the peak: `x = 1` for the peak, `ln 2 / ln(1 + R)` for the floor.
fn log_power(range: f32) -> f32 {
    let at_floor = std::f32::consts::LN_2 / range.ln_1p();
    if at_floor < 0.5 { range.ln() / -at_floor.ln() } else { 1.0 }
}

/// Codes some texels, whole blocks at a time.
fn encode(
    books: &mut Growing,
    input: &Input<'_>,
    texels: &[usize],
    accept: &Acceptance,
    growth: Growth,
    links: &mut [Link],
) {
    let grid = books.grid;
    for batch in texels.chunks(BATCH) {
        let prepared = batch.par_chunks(BLOCK).flat_map_iter(|block| input.resampler.texels(input.btf, block));
        let mut queries: Vec<Query> = prepared.map(|texel| Query::new(texel, grid)).collect();
        if growth == Growth::Nothing {
            let found: Vec<Link> =
                queries.par_iter_mut().map(|q| books.assign(q, accept).unwrap_or_default()).collect();
            batch.iter().zip(found).for_each(|(&texel, link)| links[texel] = link);
            continue;
        }
        queries.par_iter_mut().for_each(|query| query.refresh(books));
        for (&texel, query) in batch.iter().zip(&mut queries) {
            links[texel] = books.encode(query, accept, growth);
        }
    }
}

/// The threshold under which a size falls into a range: doubled or halved until it is enclosed, then bisected on its
/// logarithm. What comes nearest, with a note, where none does.
fn search_threshold(
    [low, high]: [f64; 2],
    size: impl Fn(&MultilevelVq) -> f64,
    fit: impl Fn(f64) -> MultilevelVq,
    report: &mut FitReport,
) -> MultilevelVq {
    // Too small is allowed, too large only where nothing is small enough.
    let distance =
        |found: f64| if found > high { OVER_BUDGET + (found / high).ln() } else { (low / found).ln().max(0.0) };
    let mut best = fit(FIRST_THRESHOLD);
    let mut nearest = size(&best);
    report.objective.push(nearest);
    let (mut at, mut found) = (FIRST_THRESHOLD, nearest);
    let mut enclosed = THRESHOLDS;
    while report.objective.len() < ROUNDS && distance(nearest) > 0.0 && enclosed[1] / enclosed[0] > 1.001 {
        let next = if found > high { 2.0 * at } else { 0.5 * at };
        enclosed = if found > high { [at, enclosed[1]] } else { [enclosed[0], at] };
        let inside = next > enclosed[0] && next < enclosed[1];
        at = if inside { next } else { (enclosed[0] * enclosed[1]).sqrt() };
        let codec = fit(at);
        found = size(&codec);
        report.objective.push(found);
        if distance(found) < distance(nearest) {
            (best, nearest) = (codec, found);
        }
    }
    if distance(nearest) > 0.0 {
        report.notes.push(format!("{nearest:.0} came nearest to {low:.0}..{high:.0}"));
    }
    best
}

/// Bytes of the file.
fn byte_count(btf: &Btf, codec: &MultilevelVq) -> u64 {
    let material = Material {
        name: btf.name.clone(),
        encoding: btf.encoding,
        exposure: btf.exposure,
        includes_cosine: btf.includes_cosine,
        texel_pitch_mm: None,
        raw_bytes: 0,
        codec: Codec::MultilevelVq(codec.clone()),
    };
    material.byte_count()
}

/// Radiance averaged over 2 × 2 texels; of an odd side the last is left out, of a side of one it is kept.
fn halved(btf: &Btf) -> Btf {
    let (width, height) = ((btf.width / 2).max(1), (btf.height / 2).max(1));
    let average = |picture: &[f32], x: usize, y: usize, c: usize| {
        let near = [(2 * x, 2 * y), (2 * x + 1, 2 * y), (2 * x, 2 * y + 1), (2 * x + 1, 2 * y + 1)];
        let at = |(x, y): (usize, usize)| picture[3 * (y.min(btf.height - 1) * btf.width + x.min(btf.width - 1)) + c];
        btf.encoding.encode(near.map(|xy| 0.25 * btf.encoding.decode(at(xy))).iter().sum())
    };
    let picture = |picture: &[f32]| -> Vec<f32> {
        (0..3 * width * height).map(|i| average(picture, i / 3 % width, i / 3 / width, i % 3)).collect()
    };
    let pictures: Vec<Vec<f32>> = btf.samples.par_chunks(3 * btf.texels()).map(picture).collect();
    Btf {
        name: btf.name.clone(),
        views: btf.views.clone(),
        lights: btf.lights.clone(),
        measured: Vec::new(),
        samples: pictures.concat(),
        width,
        height,
        ..*btf
    }
}

fn degenerate(fault: &str, remedy: &str) -> TextureError {
    TextureError::Degenerate { fault: fault.into(), remedy: remedy.into() }
}

impl MultilevelVq {
    fn new(frame: Frame, books: Books, power: f32, includes_cosine: bool, materials: Vec<Vec<Plane>>) -> Self {
        Self {
            frame,
            tables: Arc::new(Tables::of(&books)),
            distributions: Arc::new(Distributions::of(&books, power, includes_cosine)),
            books: Arc::new(books),
            power,
            includes_cosine,
            materials: Arc::new(materials),
            shown: 0,
        }
    }

    /// How many materials share the books.
    pub fn materials(&self) -> usize {
        self.materials.len()
    }

    /// The same books, answering for another material; `None` where there are not so many.
    pub fn with_material(&self, material: usize) -> Option<Self> {
        let plane = self.materials.get(material)?.first()?;
        let frame = Frame { width: plane.width, height: plane.height, ..self.frame.clone() };
        Some(Self { frame, shown: material, ..self.clone() })
    }

    /// Width and height of each size the material is held at, the measured one first.
    pub fn sizes(&self) -> Vec<[usize; 2]> {
        self.materials[self.shown].iter().map(|plane| [plane.width, plane.height]).collect()
    }

    /// The sample of a texel of the mip-map's level; [`Sampler::value`] is level 0. A level or texel out of range is taken
    /// as the last.
    pub fn value_at(&self, level: usize, texel: usize, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3] {
        let planes = &self.materials[self.shown];
        let plane = &planes[level.min(planes.len() - 1)];
        let texel = texel.min(plane.width * plane.height - 1);
        self.tables.value(&self.books, plane, texel, &self.tables.place(&self.books, light, view))
    }

    /// Items of C, I1, I2, P1, P2, M, P4 and P3.
    fn entries(&self) -> [(&'static str, usize); 8] {
        let (books, grid) = (&self.books, self.books.grid);
        [
            ("C", books.colors.len()),
            ("I1", books.color_rows.len() / grid.beta),
            ("I2", books.color_slices.len() / grid.alpha),
            ("P1", books.rows.len() / grid.beta),
            ("P2", books.slices.links.len() / grid.alpha),
            ("M", books.pairs.len()),
            ("P4", books.texels.links.len() / grid.phi),
            ("P3", books.views.links.len() / grid.theta),
        ]
    }
}

impl Sampler for MultilevelVq {
    fn frame(&self) -> &Frame {
        &self.frame
    }

    fn value(&self, texel: usize, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3] {
        self.tables.value(&self.books, self.plane(), texel, &self.tables.place(&self.books, light, view))
    }

    fn picture(&self, light: &Vector3<f32>, view: &Vector3<f32>) -> Vec<f32> {
        let place = self.tables.place(&self.books, light, view);
        (0..self.frame.texels()).flat_map(|t| self.tables.value(&self.books, self.plane(), t, &place)).collect()
    }

    fn tables(&self) -> Option<super::Tables> {
        Some(super::Tables::MultilevelVq(self.tables.exported(&self.books, self.plane())))
    }
}

impl Stored for MultilevelVq {
    fn write(&self, out: &mut Writer) {
        self.books.write(out);
        out.part("P6");
        out.f32(self.power);
        out.u8(u8::from(self.includes_cosine));
        out.u16(self.materials.len() as u16);
        out.u16(self.shown as u16);
        for planes in self.materials.iter() {
            out.u8(planes.len() as u8);
            planes.iter().for_each(|plane| plane.write(&self.books, out));
        }
    }

    fn read(from: &mut Reader<'_>, frame: Frame) -> Result<Self, Fault> {
        let books = Books::read(from)?;
        let power = from.f32()?;
        if !(0.1..=20.0).contains(&power) {
            return Err(Fault(format!("radiance to the power of {power}")));
        }
        let includes_cosine = from.u8()? != 0;
        let (materials, shown) = (from.u16()?, usize::from(from.u16()?));
        let planes = |from: &mut Reader<'_>| (0..from.u8()?).map(|_| Plane::read(&books, from)).collect();
        let materials = (0..materials).map(|_| planes(from)).collect::<Result<Vec<Vec<Plane>>, Fault>>()?;
        let first = materials.get(shown).and_then(|planes| planes.first());
        if materials.iter().any(Vec::is_empty)
            || first.is_none_or(|plane| [plane.width, plane.height] != [frame.width, frame.height])
        {
            return Err(Fault("the planes of its materials do not fit the tile".into()));
        }
        Ok(Self { shown, ..Self::new(frame, books, power, includes_cosine, materials) })
    }
}

#[cfg(test)]
mod tests;
