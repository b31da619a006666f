//! One material against the data it was fitted to.

use super::speed::{Speed, draws, speed};
use crate::Error;
use crate::stages::peak_bytes;
use capture::btf::Btf;
use serde::Serialize;
use texture::btf::multilevel_vq::halved;
use texture::btf::statistics::{TextureStatistics, compare};
use texture::btf::{Answer, Codec, Material, Part, Sampler, Score, Synthesized, score, to_coded_range};

/// Pictures whose statistics are compared.
const JUDGED: usize = 64;

/// What is known of a coded material.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// The codec's name.
    pub codec: &'static str,
    /// Of the file.
    pub bytes: u64,
    /// Of its parts.
    pub parts: Vec<Part>,
    /// Raw bytes, 8 bits a sample or 12, over all bytes of the file.
    pub ratio: f64,
    /// As the codec's authors counted, where that is known.
    pub ratio_as_printed: Option<f64>,
    /// Sample by sample.
    #[serde(flatten)]
    pub score: Score,
    /// Of each smaller size, where they are kept: against the data averaged over radiance.
    pub levels: Option<Vec<Level>>,
    /// Of codecs that keep the statistics alone: the mean over 64 pictures.
    pub statistics: Option<TextureStatistics>,
    /// Answers per second; of codecs that are asked sample by sample.
    #[serde(flatten)]
    pub speed: Option<Speed>,
    /// Directions of light drawn per second on one core, where the codec draws them.
    pub samples_per_s_core: Option<f64>,
    /// Of the fit, where its record is beside the file ([`FitRecord`](super::FitRecord)).
    pub fit_s: Option<f64>,
    /// The most memory that the process that fitted has held up to the end of the fit.
    pub fit_peak_bytes: Option<u64>,
    /// The most memory this process has held.
    pub peak_bytes: Option<u64>,
}

/// A smaller size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Level {
    /// Texels across and down.
    pub size: [usize; 2],
    /// Root mean squared error, levels of 0..=255.
    pub rmse: f64,
}

/// Judges `material` by `btf`, the data as read; `seed` draws what is asked for timing, and synthesizes.
///
/// # Errors
/// Where the material was fitted to data of another size or other directions.
pub fn evaluate(material: &Material, btf: Btf, seed: u64) -> Result<Evaluation, Error> {
    let frame = material.codec.frame();
    let asked = (btf.width, btf.height, btf.views.len(), btf.lights.len());
    let held = (frame.width, frame.height, frame.views.len(), frame.lights.len());
    if asked != held {
        let say = |(w, h, v, l): (usize, usize, usize, usize)| format!("{w} × {h} texels, {v} views, {l} lights");
        let fault = format!("the material was fitted to {}, the data have {}", say(held), say(asked));
        return Err(Error::Arguments(format!("{fault}; give the data and --crop it was fitted with")));
    }
    let btf = as_coded(material, btf);
    Ok(judge(material, &btf, seed))
}

/// The data encoded as the material is.
pub fn as_coded(material: &Material, btf: Btf) -> Btf {
    if matches!(material.encoding, capture::btf::Encoding::Log { .. }) {
        return btf.encoded(material.encoding);
    }
    to_coded_range(btf)
}

/// As [`evaluate`], of data known to fit and encoded as the codec saw them.
pub(super) fn judge(material: &Material, btf: &Btf, seed: u64) -> Evaluation {
    let (bytes, parts) = material.to_bytes();
    let ratio = |bytes: u64| material.raw_bytes as f64 / bytes as f64;
    let (score, statistics, speed) = match material.codec.answer() {
        Answer::Sampler(sampler) => (score(btf, sampler), None, Some(speed(sampler, seed))),
        Answer::Synthesizer(synthesizer) => {
            let drawn = Synthesized::new(synthesizer, [btf.width, btf.height], seed);
            (score(btf, &drawn), Some(statistics(btf, &drawn)), None)
        }
    };
    Evaluation {
        codec: material.codec.kind().name(),
        bytes: bytes.len() as u64,
        parts,
        ratio: ratio(bytes.len() as u64),
        ratio_as_printed: material.codec.bytes_as_printed().map(ratio),
        score,
        levels: levels(material, btf),
        statistics,
        speed,
        samples_per_s_core: match &material.codec {
            Codec::MultilevelVq(codec) => Some(draws(codec, seed)),
            _ => None,
        },
        fit_s: None,
        fit_peak_bytes: None,
        peak_bytes: peak_bytes(),
    }
}

/// The smaller sizes of a material, each against what the larger data become.
fn levels(material: &Material, btf: &Btf) -> Option<Vec<Level>> {
    let Codec::MultilevelVq(codec) = &material.codec else { return None };
    let mut levels = Vec::new();
    let mut averaged = None;
    for at in (1..codec.sizes().len()).filter_map(|level| codec.level(level)) {
        let smaller = halved(averaged.as_ref().unwrap_or(btf));
        levels.push(Level { size: [smaller.width, smaller.height], rmse: score(&smaller, &at).rmse });
        averaged = Some(smaller);
    }
    (!levels.is_empty()).then_some(levels)
}

/// How alike pictures are that need not agree texel by texel, over pairs spread evenly.
fn statistics(btf: &Btf, drawn: &Synthesized<'_>) -> TextureStatistics {
    let (lights, size) = (btf.lights.len(), [btf.width, btf.height]);
    let pairs = (0..btf.pairs()).map(|pair| (pair / lights, pair % lights));
    let measured: Vec<(usize, usize)> = pairs.filter(|&(view, light)| btf.is_measured(view, light)).collect();
    let count = JUDGED.min(measured.len());
    let of = |i: usize| {
        let (view, light) = measured[i * measured.len() / count];
        let picture = drawn.picture(&btf.lights[light].cast(), &btf.views[view].cast());
        compare(btf.picture(view, light), size, &picture, size)
    };
    TextureStatistics::mean(&(0..count).map(of).collect::<Vec<_>>())
}
