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
//! | `grid` | onion slices of equal solid angle, 11 × 11; views, 6 × 24 |
//! | `resample` | from the measured directions to the grid |
//! | `color` | luminance and chroma |
//! | `measure`, `search` | when an item stands for a slice; the nearest one |
//! | `options` | budgets, phases, thresholds |
//! | `size` | the threshold of a size |
//! | `grow`, `refine` | the nest, grown texel by texel; its items made means |
//! | `books` | few bits, and the file |
//! | `evaluate`, `importance` | a sample; a direction |
//!
//! *Order*: texels of a Halton sequence; the first 1 % under the threshold, 4 % under one whose square is 2.5 times as large,
//! the rest. In the paper the rest becomes the nearest item of P4 ([`Phase::PAPER`]), which for small tiles is a poor
//! one; by default ([`Phase::COMBINING`]) it may add combinations of the slices there are to P4, P3 and M. *Rate*:
//! one threshold moves all ([`Aim`]); a ratio is reached by searching it. *Refinement*: books that have grown hold what came first;
//! made means of what they stand for, they err by a sixth less, in fewer bytes. *Several materials* share all but P6 ([`fit_shared`]);
//! a BRDF is a material of one texel. *Colour* is YCrCb, or LogLuv of a high range ([`ColorSpace`]). *Mip-maps* are P6 of
//! radiance averaged over 2 × 2 texels, out of the same books.
//!
//! *Cost*: per texel 7 M multiplications to resample and `144 (121 S₂ + 242 S_I2)` to compare with all books, once while they
//! grow and once a round of refinement; a sample is 16 chains of look-ups. *Limits*: between the cells, 12° to 16° wide,
//! everything is linear; beyond the outermost measured polar angle it is that of the rim; chroma is not scaled with
//! luminance. Constant data take one item per book and no P6; black has scale 0; missing or repeated directions are
//! bridged by the resampling.
//!
//! Source: Havran, Filip, Myszkowski, "Bidirectional Texture Function Compression Based on Multi-Level Vector Quantization",
//! Computer Graphics Forum 29(1), 2010. Taken otherwise: `s = sin β` uniform, not `cos β`; azimuths
//! and polar angles as were measured, not 7 × 16 down to the horizon ([`Grid::PAPER`]); distances not squared, and weighted by polar angle; the 2nd, not
//! 98th, percentile of SSIM; interpolation, for equation 4 is nearest.

mod books;
mod color;
mod evaluate;
mod grid;
mod grow;
mod importance;
mod measure;
mod options;
mod refine;
mod resample;
mod search;
mod size;

pub use color::ColorSpace;
pub use grid::{Axis, Grid};
pub use grow::Growth;
pub use measure::Measure;
pub use options::{Aim, Options, Phase, Variant};

use super::container::{Fault, Reader, Stored, Writer, read_name, stored_name};
use super::{Codec, FitReport, Frame, Material, Sampler};
use crate::TextureError;
use books::{Books, Plane, settle};
use capture::btf::{Btf, Encoding};
use color::Color;
use evaluate::Tables;
use grow::{Growing, Link, Query};
use importance::Distributions;
use measure::Acceptance;
use nalgebra::Vector3;
use options::progressive_order;
use rayon::prelude::*;
use refine::{Revised, Sums};
use resample::{Resampler, Texel};
use size::{Search, note_miss};
use std::sync::Arc;

/// Texels resampled, or compared, as one matrix.
const BLOCK: usize = 8;
/// Texels compared at a time.
const BATCH: usize = 4 * BLOCK;
/// Resampled texels of all materials are held up to so many numbers (1.6 GB); beyond, they are resampled whenever they are
/// asked for.
const HELD: usize = 400_000_000;
/// Shares of smaller tiles count as those of so many texels: a handful of texels fills no books.
const SMALL_TILE: usize = 3200;
/// A ratio may be exceeded by this share.
const RATIO_TOLERANCE: f64 = 0.03;
/// The first threshold tried, of this ratio, and the power of other ratios by which theirs differs.
const FIRST_THRESHOLD: f64 = 16.0;
const FIRST_RATIO: f64 = 100.0;
const FIRST_POWER: f64 = 0.3;
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
    /// What each is, where there are several.
    labels: Arc<Vec<Label>>,
    shown: usize,
}

/// What a material of shared books is.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// What was measured.
    pub name: String,
    /// What its radiance was multiplied by before it was encoded.
    pub exposure: f32,
    /// Between texels, where known.
    pub texel_pitch_mm: Option<f32>,
}

/// One of the smaller sizes, averaged over radiance; answers as the measured one does.
#[derive(Clone, Debug)]
pub struct Level<'a> {
    codec: &'a MultilevelVq,
    plane: &'a Plane,
    frame: Frame,
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
/// Where there are none, they are encoded differently, or an option is out of range or does not fit their range.
pub fn fit_shared(btfs: &[Btf], options: &Options) -> Result<(MultilevelVq, FitReport), TextureError> {
    options.check()?;
    let Some(first) = btfs.first() else {
        return Err(degenerate("there is no material to fit", "give at least one"));
    };
    if btfs.iter().any(|b| (b.encoding, b.includes_cosine) != (first.encoding, first.includes_cosine)) {
        return Err(degenerate("materials of one book are encoded differently", "encode all alike"));
    }
    if btfs.iter().any(|b| (&b.lights, &b.views) != (&first.lights, &first.views)) {
        return Err(degenerate("materials of one book were measured under different directions", "fit them apart"));
    }
    let color = Color::new(options.color, first.encoding)?;
    let numbers = 3 * options.grid.nodes() * options.grid.cells() * btfs.iter().map(Btf::texels).sum::<usize>();
    let inputs =
        btfs.iter().map(|btf| Input::new(btf, options, color, numbers <= HELD)).collect::<Result<Vec<_>, _>>()?;
    let mut report = FitReport::default();
    let refined = match options.aim {
        Aim::Threshold(threshold) => Grown::new(&inputs, options, threshold).refined(&inputs, options),
        Aim::Ratio(ratio) => {
            let most = btfs.iter().map(Btf::raw_bytes).sum::<u64>() as f64 / ratio;
            let bytes = |grown: &Grown| byte_count(first, &grown.codec(first, &inputs, options)) as f64;
            let from = FIRST_THRESHOLD * (ratio / FIRST_RATIO).powf(FIRST_POWER);
            let range = [most / (1.0 + RATIO_TOLERANCE), most].map(f64::ln);
            Search::new(&inputs, options, &bytes, from).refined(range, &mut report)
        }
        Aim::Entries(count) => {
            let entries = |grown: &Grown| grown.books.texel_count() as f64;
            let range = [0.9 * count as f64, count as f64].map(f64::ln);
            let (grown, found) = Search::new(&inputs, options, &entries, FIRST_THRESHOLD).within(range, &mut report);
            note_miss(found, range, &mut report);
            grown.refined(&inputs, options)
        }
    };
    let codec = refined.codec(first, &inputs, options);
    let sizes: Vec<String> = codec.entries().iter().map(|(book, count)| format!("{book} {count}")).collect();
    report.notes.push(format!("items: {}", sizes.join(", ")));
    Ok((codec, report))
}

/// A material, and the way to its texels.
struct Input<'a> {
    btf: &'a Btf,
    resampler: Resampler,
    /// All texels on the grid, where those of all materials are few enough to be held.
    held: Vec<Texel>,
    /// Texels in the order in which they are coded.
    order: Vec<usize>,
    /// The same at half the size and on, one texel the last.
    smaller: Vec<Btf>,
}

impl<'a> Input<'a> {
    /// `hold` where the texels of all materials may be held on the grid.
    fn new(btf: &'a Btf, options: &Options, color: Color, hold: bool) -> Result<Self, TextureError> {
        let resampler = Resampler::new(options.grid, options.ridge, color, &btf.views, &btf.lights)?;
        let halve = |btf: &Btf| (btf.texels() > 1).then(|| halved(btf));
        let smaller = match options.mip_maps {
            true => std::iter::successors(halve(btf), halve).collect(),
            false => Vec::new(),
        };
        let held = match hold {
            true => resampled(&resampler, btf, &(0..btf.texels()).collect::<Vec<_>>()),
            false => Vec::new(),
        };
        Ok(Self { btf, resampler, held, order: progressive_order(btf.width, btf.height, options.seed), smaller })
    }

    /// Some texels on the grid.
    fn texels(&self, texels: &[usize]) -> Vec<Texel> {
        match self.held.is_empty() {
            true => resampled(&self.resampler, self.btf, texels),
            false => texels.iter().map(|&t| self.held[t].clone()).collect(),
        }
    }
}

fn resampled(resampler: &Resampler, btf: &Btf, texels: &[usize]) -> Vec<Texel> {
    texels.par_chunks(BLOCK).flat_map_iter(|block| resampler.texels(btf, block)).collect()
}

/// Books, and what they say of each texel.
struct Grown {
    books: Growing,
    threshold: f64,
    /// Per material and size, the links of its texels.
    links: Vec<Vec<Vec<Link>>>,
}

impl Grown {
    /// The books of one threshold, from the first texel to the last.
    fn new(inputs: &[Input<'_>], options: &Options, threshold: f64) -> Self {
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
        let mut grown = Self { books, threshold, links: links.into_iter().map(|links| vec![links]).collect() };
        grown.assign_smaller(inputs, options);
        grown
    }

    /// Finds what stands for the texels of the smaller sizes.
    fn assign_smaller(&mut self, inputs: &[Input<'_>], options: &Options) {
        let nearest = options.acceptance(self.threshold);
        for (input, links) in inputs.iter().zip(&mut self.links) {
            links.truncate(1);
            for btf in &input.smaller {
                let mut found = vec![Link::default(); btf.texels()];
                let texels: Vec<usize> = (0..btf.texels()).collect();
                let resampler = input.resampler.clone();
                let small = Input { btf, resampler, held: Vec::new(), order: Vec::new(), smaller: Vec::new() };
                encode(&mut self.books, &small, &texels, &nearest, Growth::Nothing, &mut found);
                links.push(found);
            }
        }
    }

    /// Makes the books the means of what they stand for, and looks up everything once more.
    fn refined(mut self, inputs: &[Input<'_>], options: &Options) -> Self {
        let accept = options.acceptance(self.threshold);
        for round in 0..=options.refinements {
            let mut sums = Sums::new(&self.books);
            self.revise(inputs, &accept, &mut sums);
            if round < options.refinements {
                self.books.become_means(&sums);
            }
        }
        self.assign_smaller(inputs, options);
        self
    }

    /// Looks up again what stands for all items of P4.
    fn revise(&mut self, inputs: &[Input<'_>], accept: &Acceptance, sums: &mut Sums) {
        let mut members: Vec<Vec<[usize; 2]>> = vec![Vec::new(); self.books.texel_count()];
        for (material, links) in self.links.iter().enumerate() {
            links[0].iter().enumerate().for_each(|(t, link)| members[link.child as usize].push([material, t]));
        }
        let used: Vec<usize> = (0..members.len()).filter(|&item| !members[item].is_empty()).collect();
        for batch in used.chunks(BATCH) {
            let revise = |&item: &usize| {
                let of_material =
                    |run: &[[usize; 2]]| inputs[run[0][0]].texels(&run.iter().map(|&[_, t]| t).collect::<Vec<_>>());
                let texels: Vec<Texel> = members[item].chunk_by(|a, b| a[0] == b[0]).flat_map(of_material).collect();
                let scales: Vec<f32> = members[item].iter().map(|&[m, t]| self.links[m][0][t].scale).collect();
                self.books.revise(item, &texels, &scales, accept)
            };
            let revised: Vec<Revised> = batch.par_iter().map(revise).collect();
            for (&item, revised) in batch.iter().zip(&revised) {
                sums.add(&self.books, revised);
                self.books.texels[item * self.books.grid.phi..][..self.books.grid.phi].copy_from_slice(&revised.item);
                let scaled = members[item].iter().zip(&revised.scales);
                scaled.for_each(|(&[m, t], &scale)| self.links[m][0][t].scale = scale);
            }
        }
    }

    /// The codec, its numbers brought to what the file holds.
    fn codec(&self, first: &Btf, inputs: &[Input<'_>], options: &Options) -> MultilevelVq {
        let of_input = |(input, links): (&Input<'_>, &Vec<Vec<Link>>)| {
            let sizes = std::iter::once(input.btf).chain(&input.smaller).map(|btf| (btf.width, btf.height));
            sizes.zip(links).map(|((width, height), links)| (width, height, links.clone())).collect::<Vec<_>>()
        };
        let planes: Vec<_> = inputs.iter().zip(&self.links).flat_map(of_input).collect();
        let color = inputs.first().map_or_else(Color::default, |input| input.resampler.color());
        let (books, planes) = settle(&self.books, &planes, color, options.precision);
        let mut planes = planes.into_iter();
        let materials = inputs.iter().map(|input| planes.by_ref().take(1 + input.smaller.len()).collect()).collect();
        let power = match first.encoding {
            Encoding::Srgb => SRGB_POWER,
            Encoding::Linear => 1.0,
            Encoding::Log { floor, peak } => log_power(peak / floor),
        };
        let labels =
            if inputs.len() > 1 { inputs.iter().map(|input| Label::of(input.btf)).collect() } else { Vec::new() };
        MultilevelVq::new(Frame::of(first), books, (power, first.includes_cosine), materials, labels)
    }
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
        let mut queries: Vec<Query> =
            input.texels(batch).into_par_iter().map(|texel| Query::new(texel, grid)).collect();
        if growth == Growth::Nothing {
            let found: Vec<Link> =
                queries.par_iter_mut().map(|q| books.assign(q, accept).unwrap_or_default()).collect();
            batch.iter().zip(found).for_each(|(&texel, link)| links[texel] = link);
            continue;
        }
        queries.par_chunks_mut(BLOCK).for_each(|queries| Query::refresh_all(queries, books));
        for (&texel, query) in batch.iter().zip(&mut queries) {
            links[texel] = books.encode(query, accept, growth);
        }
    }
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
pub fn halved(btf: &Btf) -> Btf {
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
        measured: btf.measured.clone(),
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
    fn new(
        frame: Frame,
        books: Books,
        (power, includes_cosine): (f32, bool),
        materials: Vec<Vec<Plane>>,
        labels: Vec<Label>,
    ) -> Self {
        Self {
            frame,
            tables: Arc::new(Tables::of(&books)),
            distributions: Arc::new(Distributions::of(&books, power, includes_cosine)),
            books: Arc::new(books),
            power,
            includes_cosine,
            materials: Arc::new(materials),
            labels: Arc::new(labels),
            shown: 0,
        }
    }

    /// How many materials share the books.
    pub fn materials(&self) -> usize {
        self.materials.len()
    }

    /// What each is; empty where there is one.
    pub fn labels(&self) -> &[Label] {
        &self.labels
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

    /// One of the sizes, the measured one being 0; `None` where there are not so many.
    pub fn level(&self, level: usize) -> Option<Level<'_>> {
        let plane = self.materials[self.shown].get(level)?;
        let frame = Frame { width: plane.width, height: plane.height, ..self.frame.clone() };
        Some(Level { codec: self, plane, frame })
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

impl Label {
    fn of(btf: &Btf) -> Self {
        let texel_pitch_mm = btf.texel_pitch_mm.map(|pitch| pitch as f32);
        Self { name: stored_name(&btf.name).to_owned(), exposure: btf.exposure, texel_pitch_mm }
    }

    fn write(&self, out: &mut Writer) {
        out.u8(self.name.len() as u8);
        out.bytes(self.name.as_bytes());
        out.f32s(&[self.exposure, self.texel_pitch_mm.unwrap_or(0.0)]);
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, Fault> {
        let name = read_name(from)?;
        let [exposure, pitch] = [from.f32()?, from.f32()?];
        if exposure <= 0.0 {
            return Err(Fault(format!("the exposure of {name} is {exposure}")));
        }
        Ok(Self { name, exposure, texel_pitch_mm: Some(pitch).filter(|pitch| *pitch > 0.0) })
    }
}

impl Sampler for Level<'_> {
    fn frame(&self) -> &Frame {
        &self.frame
    }

    fn value(&self, texel: usize, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3] {
        let (tables, books) = (&self.codec.tables, &self.codec.books);
        tables.value(books, self.plane, texel, &tables.place(books, light, view))
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
        // Elsewhere nothing but YCrCb is known.
        (self.books.color == Color::YCrCb)
            .then(|| super::Tables::MultilevelVq(self.tables.exported(&self.books, self.plane())))
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
        self.labels.iter().for_each(|label| label.write(out));
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
        let labelled = if materials > 1 { materials } else { 0 };
        let labels = (0..labelled).map(|_| Label::read(from)).collect::<Result<_, _>>()?;
        let planes = |from: &mut Reader<'_>| (0..from.u8()?).map(|_| Plane::read(&books, from)).collect();
        let materials = (0..materials).map(|_| planes(from)).collect::<Result<Vec<Vec<Plane>>, Fault>>()?;
        let first = materials.get(shown).and_then(|planes| planes.first());
        if materials.iter().any(Vec::is_empty)
            || first.is_none_or(|plane| [plane.width, plane.height] != [frame.width, frame.height])
        {
            return Err(Fault("the planes of its materials do not fit the tile".into()));
        }
        let is_half = |pair: &[Plane]| {
            [pair[1].width, pair[1].height] == [pair[0].width, pair[0].height].map(|side| (side / 2).max(1))
        };
        if !materials.iter().all(|planes| planes.windows(2).all(is_half)) {
            return Err(Fault("a mip level is not half of the one before".into()));
        }
        Ok(Self { shown, ..Self::new(frame, books, (power, includes_cosine), materials, labels) })
    }
}

#[cfg(test)]
mod tests;
