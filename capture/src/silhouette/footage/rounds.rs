//! One round: plates from some frames, odds and silhouettes of all, and the hull they make.

use super::cloth::Cloth;
use super::cluster::{self, Cluster};
use super::consensus::{Consensus, Dissent};
use super::light::Toned;
use super::nearby::Nearby;
use super::optics::Cutout;
use super::palette::{Palette, Palettes};
use super::plates::{self, PlateFrame, TargetPlate};
use super::shade::Shade;
use super::{FetchFrame, SilhouetteOptions, StageSetup, decision, judgement, odds, rim};
use crate::matte::{blur, grow, signed_distance};
use crate::{Aabb, Camera, CaptureError, Image};
use rayon::prelude::*;

/// Pixels around the object's box that are looked at, at least.
const MARGIN: f64 = 12.0;

/// Colours a frame adds to the palette, at most.
const PALETTE_SAMPLES: usize = 2000;

/// Of the (encoded) light on what is around the object, what its shadow may leave.
const SHADOWS: [f32; 5] = [0.5, 0.6, 0.7, 0.8, 0.9];

/// Reach of the blur that takes the noise of single pixels from odds, pixels (standard deviation).
const EVEN: f64 = 1.1;

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
    /// Whether the hull is still too coarse to decide, and the object may stand on more than is seen of it.
    is_guess: bool,
    /// Log odds that a pixel of distance outside the hull costs: little as long as too much may be carved.
    distrust: f32,
    /// Whether the hull has seen through every hole by now: what it does not see through is a patch.
    fills_holes: bool,
    /// Around the hull what may be object as well, as a share of the longer side of a frame: a plate made there would be
    /// of the object's foot.
    hidden: f64,
    /// Whether coverage at the edge is asked for.
    is_refined: bool,
}

/// Dissent tolerated among views of which `share` err.
const fn up_to(share: f64) -> Dissent {
    Dissent { share, least: 1 }
}

/// On thumbnails, first without and then with a rough hull: clutter and holes are many.
pub(super) const GUESS: Round = Round {
    resolution: 80,
    dissent: up_to(0.2),
    is_guess: true,
    distrust: 0.0,
    fills_holes: false,
    hidden: 2.0 / 320.0,
    is_refined: false,
};
/// On thumbnails, with a hull.
pub(super) const COARSE: Round = Round {
    resolution: 96,
    dissent: up_to(0.12),
    is_guess: false,
    distrust: 0.5,
    fills_holes: false,
    hidden: 2.5 / 320.0,
    is_refined: false,
};
/// At full size.
pub(super) const FINE: Round = Round {
    resolution: 128,
    dissent: up_to(0.08),
    is_guess: false,
    distrust: 0.5,
    fills_holes: false,
    hidden: 2.5 / 320.0,
    is_refined: true,
};
/// At full size, for good.
pub(super) const LAST: Round = Round {
    resolution: 160,
    dissent: up_to(0.04),
    is_guess: false,
    distrust: 0.5,
    fills_holes: true,
    hidden: 1.25 / 320.0,
    is_refined: true,
};

/// What is known of the object.
#[derive(Clone, Debug)]
pub(super) struct Belief {
    /// Nothing of it is outside, as it seems.
    pub(super) bounds: Aabb,
    /// Nothing of it can be outside.
    pub(super) limits: Aabb,
    pub(super) hull: Option<Consensus>,
    pub(super) palettes: Palettes,
}

impl Belief {
    pub(super) fn none(limits: Aabb) -> Self {
        Self { bounds: limits, limits, hull: None, palettes: Palettes::anything() }
    }

    /// The part of a box that is possible, down to where the object stands.
    pub(super) fn within(&self, bounds: &Aabb) -> Aabb {
        let mut inside = Aabb { min: bounds.min.sup(&self.limits.min), max: bounds.max.inf(&self.limits.max) };
        inside.min.z = self.limits.min.z;
        inside
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
    /// Some colours of the object, and of what is around it.
    pub(super) colours: [Vec<[f32; 3]>; 2],
}

impl Part {
    /// A silhouette from elsewhere.
    pub(super) fn given(camera: &Camera, matte: &Image<u8>) -> Self {
        let cutout = Cutout::whole(camera);
        Self { cutout, camera: *camera, matte: matte.clone(), unseparated: 0.0, colours: [Vec::new(), Vec::new()] }
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
        let plates = self.plates(belief, &cutouts, round)?;
        let parts: Vec<_> = (0..count)
            .into_par_iter()
            .map(|i| (self.fetch)(i).map(|image| self.part(i, &image, belief, &plates, cutouts[i], round)))
            .collect();
        let parts: Vec<Part> = parts.into_iter().collect::<Result<_, _>>()?;
        let seen = |side: usize| parts.iter().flat_map(move |p: &Part| p.colours[side].iter().copied());
        let object = Palette::learned(seen(0));
        // Under the object nothing else is seen of what is around it than its shade.
        let in_shade = seen(1).enumerate().map(|(i, colour)| colour.map(|v| v * SHADOWS[i % SHADOWS.len()]));
        let surroundings = Palette::learned(seen(1).chain(in_shade));
        let palettes = Palettes { object, surroundings };
        Ok(judgement::agreed(parts, belief, palettes, round.resolution, round.dissent))
    }

    fn plates(&self, belief: &Belief, cutouts: &[Cutout], round: &Round) -> Result<Plates, CaptureError> {
        let count = self.setup.cameras.len();
        let wanted = self.options.plate_frames.clamp(3, count.max(3)).min(count);
        let chosen: Vec<usize> = (0..wanted).map(|i| i * count / wanted).collect();
        let hull = belief.hull.as_ref().map(|h| if round.is_guess { h.with_support() } else { h.clone() });
        let frames: Vec<_> =
            chosen.par_iter().map(|&i| self.plate_frame(i, hull.as_ref(), cutouts[i], round)).collect();
        let frames: Vec<PlateFrame> = frames.into_iter().collect::<Result<_, _>>()?;
        let target = if self.setup.has_plane {
            TargetPlate::of(&frames, &belief.bounds, &belief.palettes, self.setup.print.as_ref())
        } else {
            None
        };
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

    fn plate_frame(
        &self,
        i: usize,
        hull: Option<&Consensus>,
        cutout: Cutout,
        round: &Round,
    ) -> Result<PlateFrame, CaptureError> {
        let image = (self.fetch)(i)?;
        let camera = self.setup.cameras[i];
        let margin = round.hidden * longest_side(&camera) as f64;
        let hidden = hull.map(|h| cutout.back(&grow(&h.silhouette(&cutout.camera(&camera)), margin), &camera, 0));
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
        let hull = belief.hull.as_ref().map(|h| h.silhouette(&camera));
        let longest = longest_side(&self.setup.cameras[i]);
        let target = plates.target.as_ref().map(|t| {
            let seen = t.predicted(&camera);
            let hidden = hull.as_ref().map(|h| grow(h, round.hidden * longest as f64));
            let shade = Shade::of(&picture, &seen, hidden.as_ref(), longest);
            (seen, shade)
        });
        let room = self.setup.segments[i].and_then(|s| plates.rooms[s].as_ref()).map(|r| cutout.of(r));
        let target = target.as_ref().map(|(seen, shade)| (seen, shade));
        let hull = hull.filter(|_| !round.is_guess);
        let size = (cutout.width, cutout.height);
        let deepest = odds::DEEPEST_SHADOW[usize::from(hull.is_some())];
        let odds_given = |nearby: Option<&Nearby>| {
            odds::of(&picture, room.as_ref(), target, &belief.palettes, nearby, deepest, size)
        };
        let nearby = hull.as_ref().map(|h| {
            let unexplained = without_explained(h, &blur(&odds_given(None).log_odds, EVEN));
            Nearby::of(&picture, &unexplained, longest)
        });
        let odds = odds_given(nearby.as_ref());
        // Without the noise of single pixels.
        let even = blur(&odds.log_odds, EVEN);
        let Some(hull) = hull else {
            let matte = decision::guessed(&even);
            let colours = colours(&picture, &even, &matte);
            return Part { cutout, camera, matte, unseparated: 0.0, colours };
        };
        let patches = round.fills_holes.then_some(&belief.palettes.object);
        let mask = decision::decided(&picture, &odds, &hull, round.distrust, patches);
        let matte = if round.is_refined { rim::refined(&picture, &odds.background, &mask) } else { mask };
        let colours = colours(&picture, &even, &matte);
        Part { cutout, camera, matte, unseparated: unseparated(&even, &hull), colours }
    }
}

/// Of a frame, in pixels.
fn longest_side(camera: &Camera) -> usize {
    camera.intrinsics.width.max(camera.intrinsics.height)
}

/// The hull without what is likelier background: a gap between legs that it does not show is not to say what colours
/// the legs have.
fn without_explained(hull: &Image<u8>, log_odds: &Image<f32>) -> Image<u8> {
    let pixels = hull.pixels().iter().zip(log_odds.pixels()).map(|(&h, &l)| if l < 0.0 { 0 } else { h });
    Image::from_pixels(hull.width(), hull.height(), pixels.collect()).unwrap_or_default()
}

/// Of pixels that are object, and background, by themselves and not at its edge.
fn colours(picture: &Toned, log_odds: &Image<f32>, matte: &Image<u8>) -> [Vec<[f32; 3]>; 2] {
    let distance = signed_distance(matte);
    let width = matte.width();
    [1.0, -1.0].map(|side| {
        let is_sure = |i: &usize| side * distance.pixels()[*i] > 2.0 && side * log_odds.pixels()[*i] > 1.0;
        let sure: Vec<usize> = (0..width * matte.height()).filter(is_sure).collect();
        let step = sure.len().div_ceil(PALETTE_SAMPLES).max(1);
        sure.iter().step_by(step).map(|&i| picture.at(i % width, i / width)).collect()
    })
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
