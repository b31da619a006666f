//! One round: plates from some frames, odds and silhouettes of all, and the hull they make.

use super::cloth::Cloth;
use super::cluster::{self, Cluster};
use super::consensus::{Consensus, Dissent};
use super::light::Toned;
use super::optics::Cutout;
use super::palette::Palette;
use super::plates::{self, PlateFrame, TargetPlate};
use super::shade::Shade;
use super::{FetchFrame, SilhouetteOptions, StageSetup, decision, judgement, odds, rim};
use crate::matte::{erode, grow, signed_distance};
use crate::{Aabb, Camera, CaptureError, Image};
use rayon::prelude::*;

/// Pixels around the object's box that are looked at, at least.
const MARGIN: f64 = 12.0;

/// Colours a frame adds to the palette, at most.
const PALETTE_SAMPLES: usize = 2000;

/// Frames at one size, and what is known of them.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub(super) fetch: &'a FetchFrame<'a>,
    pub(super) setup: &'a StageSetup,
    pub(super) gains: &'a [[f64; 3]],
    /// Per segment.
    pub(super) cloths: &'a [Option<Cloth>],
    pub(super) options: &'a SilhouetteOptions,
}

/// How a round decides.
#[derive(Clone, Copy, Debug)]
pub(super) struct Round {
    /// Cells along the longest side of the hull.
    resolution: usize,
    /// Views that may contradict.
    dissent: Dissent,
    /// Whether coverage at the edge is asked for.
    is_refined: bool,
}

/// With no hull yet: clutter and holes are many.
pub(super) const GUESS: Round = Round { resolution: 80, dissent: Dissent { share: 0.2, least: 1 }, is_refined: false };
/// On thumbnails, with a hull.
pub(super) const COARSE: Round = Round { resolution: 96, dissent: Dissent { share: 0.1, least: 1 }, is_refined: false };
/// At full size.
pub(super) const FINE: Round = Round { resolution: 128, dissent: Dissent { share: 0.05, least: 1 }, is_refined: true };
/// At full size, for good.
pub(super) const LAST: Round = Round { resolution: 160, dissent: Dissent { share: 0.03, least: 1 }, is_refined: true };

/// What is known of the object.
#[derive(Clone, Debug)]
pub(super) struct Belief {
    /// Nothing of it is outside, as it seems.
    pub(super) bounds: Aabb,
    /// Nothing of it can be outside.
    pub(super) limits: Aabb,
    pub(super) hull: Option<Consensus>,
    pub(super) palette: Palette,
}

impl Belief {
    pub(super) fn none(limits: Aabb) -> Self {
        Self { bounds: limits, limits, hull: None, palette: Palette::anything() }
    }

    /// The part of a box that is possible.
    pub(super) fn within(&self, bounds: &Aabb) -> Aabb {
        Aabb { min: bounds.min.sup(&self.limits.min), max: bounds.max.inf(&self.limits.max) }
    }
}

/// What a round found.
#[derive(Debug)]
pub(super) struct Found {
    /// `None` where there is nothing that the views agree on.
    pub(super) belief: Option<Belief>,
    /// Per frame.
    pub(super) parts: Vec<Part>,
    /// Per frame: agreement with the hull.
    pub(super) agreement: Vec<f64>,
    pub(super) contradicting: Vec<usize>,
}

/// The matte of the part of a frame where the object may be.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) cutout: Cutout,
    pub(super) camera: Camera,
    pub(super) matte: Image<u8>,
    /// Share of the object, well inside, that is explained as background.
    pub(super) unseparated: f64,
    colours: Vec<[f32; 3]>,
}

impl Part {
    /// A silhouette from elsewhere.
    pub(super) fn given(camera: &Camera, matte: &Image<u8>) -> Self {
        let cutout = Cutout::whole(camera);
        Self { cutout, camera: *camera, matte: matte.clone(), unseparated: 0.0, colours: Vec::new() }
    }
}

/// Room and target.
struct Plates {
    rooms: Vec<Option<Image<Cluster>>>,
    target: Option<TargetPlate>,
}

impl Scene<'_> {
    /// One round from what is known to what is known then.
    pub(super) fn round(&self, belief: &Belief, round: &Round) -> Result<Found, CaptureError> {
        let count = self.setup.cameras.len();
        let cutouts: Vec<Cutout> =
            self.setup.cameras.iter().map(|c| Cutout::around(&belief.bounds, c, MARGIN)).collect();
        let plates = self.plates(belief, &cutouts)?;
        let parts: Vec<_> = (0..count)
            .into_par_iter()
            .map(|i| (self.fetch)(i).map(|image| self.part(i, &image, belief, &plates, cutouts[i], round)))
            .collect();
        let parts: Vec<Part> = parts.into_iter().collect::<Result<_, _>>()?;
        let palette = Palette::learned(parts.iter().flat_map(|p| p.colours.iter().copied()));
        Ok(judgement::agreed(parts, belief, palette, round.resolution, round.dissent))
    }

    /// The hull's silhouette in the cut-out of a frame.
    fn hull_in(&self, frame: usize, belief: &Belief, cutout: Cutout) -> Option<Image<u8>> {
        belief.hull.as_ref().map(|h| h.silhouette(&cutout.camera(&self.setup.cameras[frame])))
    }

    fn plates(&self, belief: &Belief, cutouts: &[Cutout]) -> Result<Plates, CaptureError> {
        let count = self.setup.cameras.len();
        let wanted = self.options.plate_frames.clamp(3, count.max(3)).min(count);
        let chosen: Vec<usize> = (0..wanted).map(|i| i * count / wanted).collect();
        let frames: Vec<_> = chosen.par_iter().map(|&i| self.plate_frame(i, belief, cutouts[i])).collect();
        let frames: Vec<PlateFrame> = frames.into_iter().collect::<Result<_, _>>()?;
        let target = if self.setup.has_plane { TargetPlate::of(&frames, &belief.bounds) } else { None };
        let room = |segment: usize| {
            let members: Vec<&PlateFrame> = frames.iter().filter(|f| f.segment == Some(segment)).collect();
            let seen = (0..count).filter(|&i| self.setup.segments[i] == Some(segment)).map(|i| cutouts[i]);
            let area = seen.reduce(|a, b| a.and(&b))?;
            let clean = self.setup.clean_plates.get(segment).and_then(Option::as_ref);
            let cloth = self.cloths[segment].as_ref();
            (self.setup.is_still(segment) && !members.is_empty()).then(|| plates::room(&members, &area, cloth, clean))
        };
        Ok(Plates { rooms: (0..self.setup.segment_count()).map(room).collect(), target })
    }

    fn plate_frame(&self, i: usize, belief: &Belief, cutout: Cutout) -> Result<PlateFrame, CaptureError> {
        let image = (self.fetch)(i)?;
        let camera = self.setup.cameras[i];
        let hidden = self.hull_in(i, belief, cutout).map(|h| cutout.back(&grow(&h, 2.0), &camera, 0));
        let picture = Toned::new(image, &self.gains[i]);
        Ok(PlateFrame { picture, camera, segment: self.setup.segments[i], hidden })
    }

    fn part(
        &self,
        i: usize,
        image: &Image<[u8; 3]>,
        belief: &Belief,
        plates: &Plates,
        cutout: Cutout,
        round: &Round,
    ) -> Part {
        let camera = cutout.camera(&self.setup.cameras[i]);
        let picture = Toned::new(cutout.of(image), &self.gains[i]);
        let hull = self.hull_in(i, belief, cutout);
        let target = plates.target.as_ref().map(|t| {
            let seen = t.predicted(&camera);
            let hidden = hull.as_ref().map(|h| grow(h, 2.0));
            let shade = Shade::of(&picture, &seen, hidden.as_ref());
            (seen, shade)
        });
        let room = self.setup.segments[i].and_then(|s| plates.rooms[s].as_ref()).map(|r| cutout.of(r));
        let target = target.as_ref().map(|(seen, shade)| (seen, shade));
        let odds = odds::of(&picture, room.as_ref(), target, &belief.palette, (cutout.width, cutout.height));
        let Some(hull) = hull else {
            let matte = decision::guessed(&odds);
            let colours = colours(&picture, &odds.log_odds, &matte);
            return Part { cutout, camera, matte, unseparated: 0.0, colours };
        };
        let mask = decision::decided(&odds, &hull);
        let matte = if round.is_refined {
            let once = rim::refined(&picture, &odds.background, &mask);
            rim::refined(&picture, &odds.background, &once)
        } else {
            mask
        };
        let colours = colours(&picture, &odds.log_odds, &matte);
        Part { cutout, camera, matte, unseparated: unseparated(&odds.log_odds, &hull), colours }
    }
}

/// Of pixels that are object by themselves, not at its edge.
fn colours(picture: &Toned, log_odds: &Image<f32>, matte: &Image<u8>) -> Vec<[f32; 3]> {
    let inner = erode(matte, 1.5);
    let width = matte.width();
    let sure: Vec<usize> =
        (0..width * matte.height()).filter(|&i| inner.pixels()[i] == 255 && log_odds.pixels()[i] > 1.0).collect();
    let step = sure.len().div_ceil(PALETTE_SAMPLES).max(1);
    sure.iter().step_by(step).map(|&i| picture.at(i % width, i / width)).collect()
}

/// Share of what is well inside the hull that is likelier background.
fn unseparated(log_odds: &Image<f32>, hull: &Image<u8>) -> f64 {
    let distance = signed_distance(hull);
    let inner = || log_odds.pixels().iter().zip(distance.pixels()).filter(|(_, d)| **d > 4.0);
    inner().filter(|(l, _)| **l < 0.0).count() as f64 / inner().count().max(1) as f64
}

/// The backdrop of each segment, from thumbnails.
pub(super) fn cloths(thumbnails: &[Image<[u8; 3]>], setup: &StageSetup, gains: &[[f64; 3]]) -> Vec<Option<Cloth>> {
    let of_segment = |segment: usize| {
        let members: Vec<usize> = (0..thumbnails.len()).filter(|&i| setup.segments[i] == Some(segment)).collect();
        let step = members.len().div_ceil(24).max(1);
        let frames: Vec<Toned> =
            members.iter().step_by(step).map(|&i| Toned::new(thumbnails[i].clone(), &gains[i])).collect();
        let first = &thumbnails[*members.first()?];
        let (width, height) = (first.width(), first.height());
        let usual = |at: usize| {
            let samples: Vec<[f32; 3]> = frames.iter().map(|f| f.at(at % width, at / width)).collect();
            let found = cluster::densest(&samples)?;
            (2 * usize::from(found.support) > samples.len()).then_some(found.colour)
        };
        let room = (0..width * height).into_par_iter().map(usual).collect();
        Cloth::of(&Image::from_pixels(width, height, room)?)
    };
    (0..setup.segment_count()).map(of_segment).collect()
}
