//! Silhouettes in footage: a still camera before a turning platter, or a hand-held one around a still object.
//!
//! 1. *Gains*: what looks the same in many frames evens out exposure and white balance.
//! 2. *Plates*: the room behind, per pixel of a still camera, and the target plane, from above: the colour most
//!    frames agree on. Light stays in the room while the target turns, so shade is smooth in each frame.
//! 3. *Odds*: what the plates explain, in light or in shadow, is background; what has the object's colours, or those it
//!    has near by, is object. The cheapest border near the hull so far is the silhouette's.
//! 4. *Hull*: the views vote; the hull decides where the odds do not, says which frames see a place of the plates
//!    uncovered, which colours the object has, and which frame contradicts the others.
//! 5. *Rim*: coverage at the edge from the colours on both sides of it.
//!
//! Steps 2 to 4 run three times on thumbnails, then twice at full size.

mod clean_plate;
mod cloth;
mod cluster;
mod consensus;
mod contact;
mod cut;
mod decision;
mod gains;
mod judgement;
mod light;
mod moving;
mod nearby;
mod odds;
mod optics;
mod palette;
mod plates;
mod rim;
mod rounds;
mod shade;
mod stage;
#[cfg(test)]
mod tests;

pub use clean_plate::clean_plate_likeness;
pub use judgement::check_silhouettes;
pub use moving::{Moving, find_moving};
pub use stage::{FetchFrame, Print, StageSetup};

use super::photographs::find_mattes_in_box;
use crate::{Aabb, CaptureError, Image};
use odds::Odds;
use rayon::prelude::*;

/// How silhouettes are looked for.
#[derive(Clone, Copy, Debug)]
pub struct SilhouetteOptions {
    /// Frames that make the plates, spread evenly; all of them are in memory at once.
    pub plate_frames: usize,
}

impl Default for SilhouetteOptions {
    fn default() -> Self {
        Self { plate_frames: 24 }
    }
}

/// What told object from background.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Evidence {
    /// The target plane and, before a still camera, the room behind it.
    Plates,
    /// The colour of the backdrop alone, as in photographs.
    Backdrop,
    /// The alpha channel of the photographs.
    Alpha,
    /// Silhouettes from elsewhere.
    Given,
}

/// The silhouettes of all frames.
#[derive(Clone, Debug)]
pub struct Silhouettes {
    /// Per frame the coverage by the object, 255 = all, of the frame's size.
    pub mattes: Vec<Image<u8>>,
    /// Per frame the IoU with the hull of the others, 0 to 1.
    pub agreement: Vec<f64>,
    /// Frames whose silhouette is empty or contradicts the others, ascending.
    pub contradicting: Vec<usize>,
    /// Per frame the factors on linear red, green and blue that even out exposure and white balance; median 1.
    pub gains: Vec<[f64; 3]>,
    /// A box around the object; `None` where nothing was found.
    pub aabb: Option<Aabb>,
    /// What told object from background.
    pub evidence: Evidence,
    /// What the user should know, each a sentence; empty when all is well.
    pub findings: Vec<String>,
}

/// Finds the matte of the object in every frame. Deterministic for any number of threads.
///
/// # Errors
/// What `fetch` fails with, and [`CaptureError::Stage`] where `setup` contradicts itself.
pub fn find_silhouettes(
    fetch: &FetchFrame,
    setup: &StageSetup,
    options: &SilhouetteOptions,
) -> Result<Silhouettes, CaptureError> {
    setup.check()?;
    let factor = stage::thumbnail_factor(&setup.cameras);
    let thumbnails = fetched(fetch, setup.cameras.len(), |image| light::thumbnail(&image, factor))?;
    let small = setup.reduced(factor);
    let search = stage::search_box(setup);
    let gains = gains::find(&thumbnails, &small.cameras, setup, search.as_ref());
    let Some(search) = search.filter(|_| setup.has_plates()) else {
        return by_backdrop(fetch, setup, gains);
    };
    let thumbnails: Vec<Image<[u8; 3]>> =
        thumbnails.iter().map(|t| t.map(|p| p.map(|v| v.round().clamp(0.0, 255.0) as u8))).collect();
    let of_thumbnails = |i: usize| Ok(thumbnails[i].clone());
    let cloths = rounds::cloths(&thumbnails, &small, &gains);
    let coarse = rounds::Scene { fetch: &of_thumbnails, setup: &small, gains: &gains, cloths: &cloths, options };
    let fine = rounds::Scene { fetch, setup, gains: &gains, cloths: &cloths, options };
    let mut belief = rounds::Belief::none(search);
    for round in [rounds::GUESS, rounds::GUESS, rounds::COARSE] {
        let Some(better) = coarse.round(&belief, &round)?.belief else {
            return Ok(judgement::nothing_found(gains, setup));
        };
        belief = better;
    }
    let first = fine.round(&belief, &rounds::FINE)?;
    let found = match &first.belief {
        Some(better) => fine.round(better, &rounds::LAST)?,
        None => first,
    };
    let camouflage = judgement::camouflage(&found, cloths.iter().flatten());
    let mut silhouettes = judgement::summed_up(found, gains, setup, Evidence::Plates);
    silhouettes.findings.extend(camouflage);
    Ok(silhouettes)
}

/// `f` of all frames, each in memory only while it is worked on.
fn fetched<T: Send>(
    fetch: &FetchFrame,
    count: usize,
    f: impl Fn(Image<[u8; 3]>) -> T + Sync,
) -> Result<Vec<T>, CaptureError> {
    // Collected before the errors are looked at, so that the first in order is reported, always the same.
    let all: Vec<_> = (0..count).into_par_iter().map(|i| fetch(i).map(&f)).collect();
    all.into_iter().collect()
}

/// Without target and without a still camera there is the colour of the backdrop only.
fn by_backdrop(fetch: &FetchFrame, setup: &StageSetup, gains: Vec<[f64; 3]>) -> Result<Silhouettes, CaptureError> {
    let images = fetched(fetch, setup.cameras.len(), |image| image)?;
    let mattes = find_mattes_in_box(&images, &setup.cameras, setup.aabb.as_ref());
    let judged = check_silhouettes(&mattes, setup)?;
    Ok(Silhouettes { gains, evidence: Evidence::Backdrop, ..judged })
}
