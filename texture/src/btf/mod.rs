//! BTF codecs: materials measured under every pair of view and light, kept small.
//!
//! [`fit`] takes a [`Btf`] and gives a [`Material`], which answers for any texel, light and view and is
//! one `.btfz` file. Two kinds of codec, for one trait would lie about the second:
//!
//! | [`CodecKind`] | file | reproduces |
//! |---|---|---|
//! | `gaussian-mixture` | [`gaussian_mixture`] | the samples |
//! | `multilevel-vq` | [`multilevel_vq`] | the samples; draws light directions |
//! | `pca`, `pca-view`, `local-pca` | [`pca`], [`pca_view`], [`local_pca`] | the samples |
//! | `ptm`, `lafortune` | [`ptm`], [`lafortune`] | the samples, view by view |
//! | `gmrf`, `car2d`, `car3d` | [`gmrf`], [`car2d`], [`car3d`] | the statistics, at any size |
//!
//! [`Sampler`]s are judged sample by sample, [`Synthesizer`]s by moments, spectrum and correlation.
//!
//! Samples are coded as they are encoded: sRGB for 8-bit data; a high range is brought to
//! [`Encoding::Log`] first, the same for every codec, so that a highlight a million times brighter than its
//! surroundings does not claim all bits. Directions are unit vectors in the frame of the surface.
//!
//! To add a codec: a file with its page, `Options`, `fit`, [`Sampler`] or [`Synthesizer`], and
//! [`Stored`](container::Stored); an entry in [`CodecKind`], [`Codec`] and `fit`; its decoder among the fuzz targets.

mod budget;
pub mod car2d;
pub mod car3d;
pub mod container;
#[cfg(test)]
mod fixtures;
mod frame;
pub mod gaussian_mixture;
pub mod gmrf;
pub mod lafortune;
mod linear;
pub mod local_pca;
mod lookup;
pub mod multilevel_vq;
pub mod pca;
pub mod pca_view;
mod principal;
pub mod ptm;
mod random_field;
mod rows;
mod score;
pub mod statistics;
mod tables;

pub use container::Part;
pub use frame::{Blend, DirectionSet, Frame};
pub use score::{Score, score};
pub use tables::{MixtureComponent, MixtureTables, Tables, VqTables};

use crate::TextureError;
use capture::btf::{Btf, Encoding};
use multilevel_vq::Label;
use nalgebra::Vector3;
use std::str::FromStr;

/// Reproduces the measured samples.
pub trait Sampler: Send + Sync {
    /// What the codec covers.
    fn frame(&self) -> &Frame;

    /// The encoded RGB sample of a texel (`y · width + x`) under unit vectors towards light and eye, on the
    /// surface's side; between measured directions it is interpolated. Never NaN.
    fn value(&self, texel: usize, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3];

    /// The samples of several texels under one light and view: the same as [`Sampler::value`] per texel, by a faster
    /// way where the codec has one. What either list has more than the other is left alone.
    fn values(&self, texels: &[usize], light: &Vector3<f32>, view: &Vector3<f32>, out: &mut [[f32; 3]]) {
        for (out, &texel) in out.iter_mut().zip(texels) {
            *out = self.value(texel, light, view);
        }
    }

    /// The whole tile under one light and view, (y, x, channel): the same as [`Sampler::value`] per texel, by
    /// a faster way where the codec has one.
    fn picture(&self, light: &Vector3<f32>, view: &Vector3<f32>) -> Vec<f32> {
        (0..self.frame().texels()).flat_map(|texel| self.value(texel, light, view)).collect()
    }

    /// What [`Sampler::value`] computes with; none where the codec keeps it to itself.
    fn tables(&self) -> Option<Tables> {
        None
    }
}

/// Reproduces the statistics of the measured pictures, not the samples.
pub trait Synthesizer: Send + Sync {
    /// What the codec was estimated from.
    fn frame(&self) -> &Frame;

    /// A tile of `[width, height]` texels under one light and view, (y, x, channel); the same seed gives the
    /// same surface under every light and view. It continues itself on all sides.
    fn picture(&self, size: [usize; 2], seed: u64, light: &Vector3<f32>, view: &Vector3<f32>) -> Vec<f32>;
}

/// A synthesizer at one size and seed, asked as if it were a sampler.
#[derive(Clone, Copy)]
pub struct Synthesized<'a> {
    synthesizer: &'a dyn Synthesizer,
    size: [usize; 2],
    seed: u64,
}

impl<'a> Synthesized<'a> {
    /// Tiles of `[width, height]` texels.
    pub fn new(synthesizer: &'a dyn Synthesizer, size: [usize; 2], seed: u64) -> Self {
        Self { synthesizer, size, seed }
    }
}

impl Sampler for Synthesized<'_> {
    fn frame(&self) -> &Frame {
        self.synthesizer.frame()
    }

    fn value(&self, texel: usize, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3] {
        let picture = self.picture(light, view);
        [0, 1, 2].map(|c| picture[3 * texel + c])
    }

    fn picture(&self, light: &Vector3<f32>, view: &Vector3<f32>) -> Vec<f32> {
        self.synthesizer.picture(self.size, self.seed, light, view)
    }
}

/// How large the coded material may be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Budget {
    /// What the codec's authors used.
    #[default]
    Standard,
    /// Raw bytes over coded bytes, everything counted: at least this, by as few per cent more as the codec can.
    Ratio(f64),
    /// 0 (small) to 100 (faithful).
    Quality(f64),
    /// Components, clusters, coefficients or entries: what the codec counts.
    Components(usize),
    /// As many components as the data support, by the codec's own criterion.
    Auto,
}

/// How numbers are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// 32-bit floats: what is lost is the codec's doing alone.
    Full,
    /// 8 and 16 bits where they suffice.
    #[default]
    Compact,
}

/// Which codec, and how it is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitOptions {
    /// The codec.
    pub codec: CodecKind,
    /// How large it may be.
    pub budget: Budget,
    /// How its numbers are stored.
    pub precision: Precision,
    /// Of everything random; the same seed gives the same bytes.
    pub seed: u64,
    /// What else the books of [`CodecKind::MultilevelVq`] shall be; other codecs have none.
    pub books: multilevel_vq::Variant,
}

/// What happened during a fit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitReport {
    /// What the codec minimises or maximises, one value per round.
    pub objective: Vec<f64>,
    /// What a user should know: components at a floor, data that was constant, a budget that was missed.
    pub notes: Vec<String>,
}

macro_rules! codecs {
    ($($(#[$doc:meta])* $variant:ident($type:ty) = $code:literal $name:literal),* $(,)?) => {
        /// The codecs.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        pub enum CodecKind { $($(#[$doc])* $variant = $code),* }

        /// A coded material's codec.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Codec { $($(#[$doc])* $variant($type)),* }

        impl CodecKind {
            /// All, in the order of the table above.
            pub const ALL: &[Self] = &[$(Self::$variant),*];

            /// The name on the command line.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),* }
            }
        }

        impl Codec {
            /// Which it is.
            pub fn kind(&self) -> CodecKind {
                match self { $(Self::$variant(_) => CodecKind::$variant),* }
            }

            fn write(&self, out: &mut container::Writer) {
                match self { $(Self::$variant(codec) => container::Stored::write(codec, out)),* }
            }

            fn read(kind: CodecKind, from: &mut container::Reader<'_>, frame: Frame) -> Result<Self, container::Fault> {
                Ok(match kind { $(CodecKind::$variant => Self::$variant(container::Stored::read(from, frame)?)),* })
            }
        }
    };
}

codecs! {
    /// Filip, Grim and Haindl.
    GaussianMixture(gaussian_mixture::GaussianMixture) = 1 "gaussian-mixture",
    /// Havran, Filip and Myszkowski.
    MultilevelVq(multilevel_vq::MultilevelVq) = 2 "multilevel-vq",
    /// Principal components of the whole data.
    Pca(pca::Pca) = 3 "pca",
    /// Principal components of each view.
    PcaView(pca_view::PcaView) = 4 "pca-view",
    /// Principal components of clusters of texels.
    LocalPca(local_pca::LocalPca) = 5 "local-pca",
    /// Polynomial texture maps, one per view.
    Ptm(ptm::Ptm) = 6 "ptm",
    /// Polynomial Lafortune lobes, one per view.
    Lafortune(lafortune::Lafortune) = 7 "lafortune",
    /// Gaussian Markov random field.
    Gmrf(gmrf::Gmrf) = 8 "gmrf",
    /// Causal autoregression, channel by channel.
    Car2d(car2d::Car2d) = 9 "car2d",
    /// Causal autoregression of colour vectors.
    Car3d(car3d::Car3d) = 10 "car3d",
}

/// A material as a codec holds it.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// What was measured.
    pub name: String,
    /// How samples stand for radiance.
    pub encoding: Encoding,
    /// What radiance was multiplied by before it was encoded.
    pub exposure: f32,
    /// Whether the cosine of the light is in the samples.
    pub includes_cosine: bool,
    /// Between texels, where known.
    pub texel_pitch_mm: Option<f32>,
    /// Bytes of the samples as they were measured.
    pub raw_bytes: u64,
    /// What answers.
    pub codec: Codec,
}

/// How a material answers.
#[derive(Clone, Copy)]
pub enum Answer<'a> {
    /// Sample by sample.
    Sampler(&'a dyn Sampler),
    /// By statistics.
    Synthesizer(&'a dyn Synthesizer),
}

impl Codec {
    /// What it covers.
    pub fn frame(&self) -> &Frame {
        match self.answer() {
            Answer::Sampler(sampler) => sampler.frame(),
            Answer::Synthesizer(synthesizer) => synthesizer.frame(),
        }
    }

    /// Bytes as the papers that compare these codecs count them, headers and often more left out; where they say.
    pub fn bytes_as_printed(&self) -> Option<u64> {
        let frame = self.frame();
        let (texels, pairs) = (frame.texels(), frame.pairs());
        let (views, lights) = (frame.views.len(), frame.lights.len());
        let bytes = match self {
            Self::Pca(c) => pca::printed_bytes(texels, pairs, c.components()),
            Self::PcaView(c) => c.components().iter().map(|&k| pca_view::printed_bytes(texels, lights, k, 1)).sum(),
            Self::LocalPca(c) => c.printed_bytes(),
            Self::Ptm(_) => views * texels * ptm::printed_bytes(),
            Self::Lafortune(_) => views * lafortune::printed_bytes(texels, lights),
            Self::GaussianMixture(c) => gaussian_mixture::printed_bytes(c.components(), pairs),
            // These are counted in print as we count them, or are not described well enough.
            Self::MultilevelVq(_) | Self::Gmrf(_) | Self::Car2d(_) | Self::Car3d(_) => return None,
        };
        Some(bytes as u64)
    }

    /// How this codec answers.
    pub fn answer(&self) -> Answer<'_> {
        match self {
            Self::GaussianMixture(c) => Answer::Sampler(c),
            Self::MultilevelVq(c) => Answer::Sampler(c),
            Self::Pca(c) => Answer::Sampler(c),
            Self::PcaView(c) => Answer::Sampler(c),
            Self::LocalPca(c) => Answer::Sampler(c),
            Self::Ptm(c) => Answer::Sampler(c),
            Self::Lafortune(c) => Answer::Sampler(c),
            Self::Gmrf(c) => Answer::Synthesizer(c),
            Self::Car2d(c) => Answer::Synthesizer(c),
            Self::Car3d(c) => Answer::Synthesizer(c),
        }
    }
}

/// Fits a codec. Data of a high range are brought to [`Encoding::Log`] first.
///
/// # Errors
/// Where the data cannot carry the codec, or an option is out of range.
pub fn fit(btf: Btf, options: &FitOptions) -> Result<(Material, FitReport), TextureError> {
    fit_shared(vec![btf], options)
}

/// Fits several materials at once, to books that all share; the first is shown, [`Material::member`] gives the others. Data of
/// a high range are brought to one logarithm.
///
/// # Errors
/// As [`fit`], and where there are none, or several and the codec has no books.
pub fn fit_shared(btfs: Vec<Btf>, options: &FitOptions) -> Result<(Material, FitReport), TextureError> {
    let unstorable = |b: &Btf| container::unstorable(b.width, b.height, b.views.len(), b.lights.len());
    if let Some(fault) = btfs.iter().find_map(unstorable) {
        let remedy = "cut out a smaller part, 2048 × 2048 texels and 1024 × 1024 directions at most".to_owned();
        return Err(TextureError::Degenerate { fault: format!("no file holds {fault}"), remedy });
    }
    if let Some(sample) = btfs.iter().flat_map(|btf| &btf.samples).find(|sample| !sample.is_finite()) {
        let remedy = "fill what is no number by Btf::check".to_owned();
        return Err(TextureError::Degenerate { fault: format!("a sample is {sample}"), remedy });
    }
    let raw_bytes = btfs.iter().map(Btf::raw_bytes).sum();
    let encoding = coded_range(&btfs);
    let in_range = |btf: Btf| match encoding {
        Some(range) => btf.encoded(range),
        None => btf,
    };
    let btfs: Vec<Btf> = btfs.into_iter().map(in_range).collect();
    let (codec, report) = fit_codec(&btfs, options)?;
    let first = &btfs[0];
    let material = Material {
        name: first.name.clone(),
        encoding: first.encoding,
        exposure: first.exposure,
        includes_cosine: first.includes_cosine,
        texel_pitch_mm: first.texel_pitch_mm.map(|pitch| pitch as f32),
        raw_bytes,
        codec,
    };
    Ok((material, report))
}

impl Material {
    /// The materials that share this one's books, in the order in which they were fitted; alone, its own name.
    pub fn members(&self) -> Vec<&str> {
        match &self.codec {
            Codec::MultilevelVq(books) if books.materials() > 1 => books.labels().iter().map(|l| &*l.name).collect(),
            _ => vec![&self.name],
        }
    }

    /// One of them, counted from 0, by itself: as large a file, for the books stay whole. `None` where there are not so many.
    pub fn member(&self, member: usize) -> Option<Self> {
        let Codec::MultilevelVq(books) = &self.codec else { return (member == 0).then(|| self.clone()) };
        let codec = Codec::MultilevelVq(books.with_material(member)?);
        Some(match books.labels().get(member).cloned() {
            Some(Label { name, exposure, texel_pitch_mm }) => {
                Self { name, exposure, texel_pitch_mm, codec, ..self.clone() }
            }
            None => Self { codec, ..self.clone() },
        })
    }
}

/// The data as codecs see them: linear radiance becomes [`Encoding::Log`], with the median of what is not
/// black as its floor and the largest sample as its peak.
pub fn to_coded_range(btf: Btf) -> Btf {
    match coded_range(std::slice::from_ref(&btf)) {
        Some(range) => btf.encoded(range),
        None => btf,
    }
}

/// The logarithm for linear radiance; none where something else is among the data.
fn coded_range(btfs: &[Btf]) -> Option<Encoding> {
    if btfs.iter().any(|btf| btf.encoding != Encoding::Linear) {
        return None;
    }
    let mut lit: Vec<f32> = btfs.iter().flat_map(|btf| &btf.samples).copied().filter(|&s| s > 0.0).collect();
    let middle = lit.len() / 2;
    let peak = lit.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
    let floor = if lit.is_empty() { peak } else { *lit.select_nth_unstable_by(middle, f32::total_cmp).1 };
    Some(Encoding::Log { floor: floor.max(peak * 1e-7), peak })
}

fn fit_codec(btfs: &[Btf], options: &FitOptions) -> Result<(Codec, FitReport), TextureError> {
    let FitOptions { codec, budget, precision, seed, books } = *options;
    let refuse = |fault: String, remedy: &str| Err(TextureError::Degenerate { fault, remedy: remedy.into() });
    let btf = match btfs {
        [] => return refuse("there is no material to fit".into(), "give at least one"),
        [_, _, ..] if codec != CodecKind::MultilevelVq => {
            return refuse(format!("materials cannot share what {codec} keeps"), "fit one, or choose multilevel-vq");
        }
        _ if codec != CodecKind::MultilevelVq && books != multilevel_vq::Variant::default() => {
            return refuse(format!("{codec} has no books"), "choose multilevel-vq, or leave out what it alone has");
        }
        [first, ..] => first,
    };
    Ok(match codec {
        CodecKind::GaussianMixture => {
            let (codec, report) =
                gaussian_mixture::fit(btf, &gaussian_mixture::Options::new(btf, budget, precision, seed)?)?;
            (Codec::GaussianMixture(codec), report)
        }
        CodecKind::MultilevelVq => {
            let usual = multilevel_vq::Options::new(btf, budget, precision, seed)?;
            let multilevel_vq::Variant { measure, color, mip_maps } = books;
            let options = multilevel_vq::Options { measure, color, mip_maps, ..usual };
            let (codec, report) = multilevel_vq::fit_shared(btfs, &options)?;
            (Codec::MultilevelVq(codec), report)
        }
        CodecKind::Pca => {
            let (codec, report) = pca::fit(btf, &pca::Options::new(btf, budget, precision, seed)?)?;
            (Codec::Pca(codec), report)
        }
        CodecKind::PcaView => {
            let (codec, report) = pca_view::fit(btf, &pca_view::Options::new(btf, budget, precision, seed)?)?;
            (Codec::PcaView(codec), report)
        }
        CodecKind::LocalPca => {
            let (codec, report) = local_pca::fit(btf, &local_pca::Options::new(btf, budget, precision, seed)?)?;
            (Codec::LocalPca(codec), report)
        }
        CodecKind::Ptm => {
            let (codec, report) = ptm::fit(btf, &ptm::Options::new(btf, budget, precision, seed)?)?;
            (Codec::Ptm(codec), report)
        }
        CodecKind::Lafortune => {
            let (codec, report) = lafortune::fit(btf, &lafortune::Options::new(btf, budget, precision, seed)?)?;
            (Codec::Lafortune(codec), report)
        }
        CodecKind::Gmrf => {
            let (codec, report) = gmrf::fit(btf, &gmrf::Options::new(btf, budget, precision, seed)?)?;
            (Codec::Gmrf(codec), report)
        }
        CodecKind::Car2d => {
            let (codec, report) = car2d::fit(btf, &car2d::Options::new(btf, budget, precision, seed)?)?;
            (Codec::Car2d(codec), report)
        }
        CodecKind::Car3d => {
            let (codec, report) = car3d::fit(btf, &car3d::Options::new(btf, budget, precision, seed)?)?;
            (Codec::Car3d(codec), report)
        }
    })
}

impl CodecKind {
    /// Whether it is compared at several sizes; the others have one that matters, the authors'.
    pub fn has_sizes(self) -> bool {
        !matches!(self, Self::Ptm | Self::Lafortune | Self::Gmrf | Self::Car2d | Self::Car3d)
    }
}

impl std::fmt::Display for CodecKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for CodecKind {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let known = || Self::ALL.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(", ");
        let found = Self::ALL.iter().copied().find(|kind| kind.name() == name);
        found.ok_or_else(|| format!("no codec is called {name}; there are {}", known()))
    }
}

impl std::fmt::Debug for Synthesized<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Synthesized").field("size", &self.size).field("seed", &self.seed).finish_non_exhaustive()
    }
}

impl std::fmt::Debug for Answer<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Sampler(_) => "Sampler",
            Self::Synthesizer(_) => "Synthesizer",
        })
    }
}
