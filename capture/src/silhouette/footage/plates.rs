//! What the stage looks like without the object: the room as a still camera sees it, and the target plane.

use super::cloth::Cloth;
use super::cluster::{self, Cluster};
use super::contact::{Contact, is_print_in};
use super::light::Toned;
use super::optics::{Cutout, Directions, on_plane};
use super::palette::Palettes;
use super::shade::Shade;
use super::stage::Print;
use crate::matte::components;
use crate::{Aabb, Camera, Image};
use nalgebra::Point3;
use rayon::prelude::*;

/// Texels along a side of the target's plate, at most.
const MOST_TEXELS: f64 = 1000.0;

/// Appearances that vary more than this (standard deviation, encoded levels) explain nothing.
const LARGEST_SPREAD: f32 = 40.0;

/// Views of a place on the target that must agree.
const LEAST_SUPPORT: u8 = 3;

/// Views of a place that leave no doubt.
const SURE: u8 = 6;

/// Log odds by colour from which on a place beside the hull is the object, not the target.
const SUSPICIOUS: f32 = 2.0;

/// The same of a place beside one that the object covers in nearly all frames: a foot lies in the dark, where colours say
/// little.
const OF_A_FOOT: f32 = -1.0;

/// The size of a covered place with the foot around it, as a multiple of all that is covered in nearly all frames, at
/// most.
const LARGEST_FOOT: f64 = 2.5;

/// Of the (encoded) light on the print, what falls on parts of it in the mean of all frames.
const PRINT_LIGHT: std::ops::RangeInclusive<f32> = 0.5..=1.15;

/// A frame that makes plates.
#[derive(Debug)]
pub(super) struct PlateFrame {
    pub(super) picture: Toned,
    pub(super) camera: Camera,
    pub(super) segment: Option<usize>,
    /// Where the object may be, as far as is known (≥ 128).
    pub(super) hidden: Option<Image<u8>>,
}

impl PlateFrame {
    fn is_hidden(&self, x: usize, y: usize) -> bool {
        self.hidden.as_ref().is_some_and(|h| h.at(x, y) >= 128)
    }
}

/// The room behind the platter, per pixel of a still camera; support 0 where it is unknown.
pub(super) fn room(
    frames: &[&PlateFrame],
    area: &Cutout,
    cloth: Option<&Cloth>,
    clean: Option<&Image<[u8; 3]>>,
) -> Image<Cluster> {
    let Some(first) = frames.first() else { return Image::filled(0, 0, Cluster::default()) };
    let (width, height) = (first.camera.intrinsics.width, first.camera.intrinsics.height);
    let pixel = |samples: &mut Vec<[f32; 3]>, x: usize, y: usize| {
        if let Some(clean) = clean {
            return Cluster { colour: clean.at(x, y).map(f32::from), spread: 3.0, support: 255 };
        }
        samples.clear();
        samples.extend(frames.iter().filter(|f| !f.is_hidden(x, y)).map(|f| f.picture.at(x, y)));
        let place = ((x as f64 + 0.5) / width as f64, (y as f64 + 0.5) / height as f64);
        let is_known = frames.iter().all(|f| f.hidden.is_some());
        room_at(samples, cloth.map(|c| (c, c.at(place.0, place.1))), is_known)
    };
    let mut plate = Image::filled(width, height, Cluster::default());
    let rows: Vec<Vec<Cluster>> = (area.top..area.top + area.height)
        .into_par_iter()
        .map_init(Vec::new, |samples, y| (area.left..area.left + area.width).map(|x| pixel(samples, x, y)).collect())
        .collect();
    for (row, y) in rows.iter().zip(area.top..) {
        let start = y * width + area.left;
        plate.pixels_mut()[start..start + area.width].copy_from_slice(row);
    }
    plate
}

/// Of samples at one pixel. As long as nothing is known of the object, what stays may be a plain object on the axis:
/// before a cloth only what looks like cloth is room.
fn room_at(samples: &[[f32; 3]], cloth: Option<(&Cloth, [f32; 3])>, object_is_known: bool) -> Cluster {
    let still = cluster::densest(samples).filter(|c| c.support >= 4 && 2 * usize::from(c.support) > samples.len());
    let Some((cloth, expected)) = cloth else { return still.unwrap_or_default() };
    let alike: Vec<[f32; 3]> = samples.iter().copied().filter(|s| cloth.is_like(&expected, s)).collect();
    let filled = Cluster { colour: expected, spread: cloth.spread + 4.0, support: 1 };
    match cluster::densest(&alike).filter(|c| c.support >= 2) {
        Some(seen) => seen,
        None if object_is_known => still.unwrap_or(filled),
        None => filled,
    }
}

/// The target: the plane z = 0, seen from above.
#[derive(Clone, Debug)]
pub(super) struct TargetPlate {
    /// World coordinates of the first texel's outer corner.
    origin: [f64; 2],
    /// Edge of a texel in world units.
    texel: f64,
    texture: Image<Cluster>,
}

impl TargetPlate {
    /// Of the part of the plane that is seen behind and below `bounds`. `None` where no frame sees any.
    pub(super) fn of(frames: &[PlateFrame], bounds: &Aabb, palettes: &Palettes, print: Option<&Print>) -> Option<Self> {
        let footprints: Vec<[f64; 2]> = frames.iter().flat_map(|f| shadow_of(bounds, &f.camera)).collect();
        let area = Aabb::around(footprints.iter().map(|p| Point3::new(p[0], p[1], 0.0)))?;
        // Rays near the horizon reach far: no further than three times the object's box.
        let (center, reach) = (bounds.center(), 1.5 * bounds.size().norm());
        let limit = |v: f64, axis: usize| v.clamp(center[axis] - reach, center[axis] + reach);
        let [min, max] = [area.min, area.max].map(|p| [limit(p.x, 0), limit(p.y, 1)]);
        let sizes = frames.iter().filter_map(|f| {
            let depth = f.camera.project(&Point3::new(center.x, center.y, 0.0))?.depth;
            Some(depth / f.camera.intrinsics.fx.max(f.camera.intrinsics.fy))
        });
        let footprint = sizes.fold(f64::INFINITY, f64::min);
        let longest = (max[0] - min[0]).max(max[1] - min[1]);
        let texel = footprint.max(longest / MOST_TEXELS);
        if !(texel.is_finite() && texel > 0.0 && longest > 0.0) {
            return None;
        }
        let count = |axis: usize| ((max[axis] - min[axis]) / texel).ceil().max(1.0) as usize;
        let (width, height) = (count(0), count(1));
        let mut plate = Self { origin: min, texel, texture: Image::filled(width, height, Cluster::default()) };
        plate.texture = plate.looked_up(frames, None, palettes);
        if frames.iter().any(|f| f.segment.is_some()) {
            // The light stays in the room while the target turns under it.
            let shades: Vec<Shade> = frames.par_iter().map(|f| plate.shade(f)).collect();
            plate.texture = plate.looked_up(frames, Some(&shades), palettes);
        }
        if let Some(print) = print {
            plate.complete(print, palettes);
        }
        Some(plate)
    }

    /// Puts what is printed where too few frames agree on what they see, or on something else.
    fn complete(&mut self, print: &Print, palettes: &Palettes) {
        let width = self.texture.width();
        let place = |at: usize| [at % width, at / width].map(|v| v as f64 + 0.5);
        let dark: Vec<Option<f32>> = (0..self.texture.pixels().len())
            .into_par_iter()
            .map(|at| {
                let [u, v] = place(at);
                print.dark_share([self.origin[0] + u * self.texel, self.origin[1] + v * self.texel], self.texel)
            })
            .collect();
        put_print(&mut self.texture, &dark, palettes);
    }

    /// Colour and spread at a place on the plane, or [`Cluster::COVERED`]; `None` where too little is known.
    pub(super) fn at(&self, place: [f64; 2]) -> Option<Cluster> {
        let [x, y] = [0, 1].map(|i| (place[i] - self.origin[i]) / self.texel - 0.5);
        let (width, height) = (self.texture.width(), self.texture.height());
        if !(x >= 0.0 && y >= 0.0 && x < width as f64 - 1.0 && y < height as f64 - 1.0) {
            return None;
        }
        let (column, row) = (x as usize, y as usize);
        let (fx, fy) = ((x - column as f64) as f32, (y - row as f64) as f32);
        let texels = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| self.texture.at(column + dx, row + dy));
        if texels.iter().any(Cluster::is_covered) {
            return Some(Cluster::COVERED);
        }
        if texels.iter().any(|t| t.support < LEAST_SUPPORT || t.spread > LARGEST_SPREAD) {
            return None;
        }
        let mix = |v: [f32; 4]| {
            let (top, bottom) = (v[0] + (v[1] - v[0]) * fx, v[2] + (v[3] - v[2]) * fx);
            top + (bottom - top) * fy
        };
        let colour = [0, 1, 2].map(|c| mix(texels.map(|t| t.colour[c])));
        // A fifth of a pixel of error in the cameras, across the steepest channel.
        let range = |c: usize| {
            let v = texels.map(|t| t.colour[c]);
            v.iter().copied().fold(0.0, f32::max) - v.iter().copied().fold(255.0, f32::min)
        };
        let steepest = range(0).max(range(1)).max(range(2));
        let spread = mix(texels.map(|t| t.spread)).hypot(0.2 * steepest);
        Some(Cluster { colour, spread, support: texels.iter().map(|t| t.support).min().unwrap_or(0) })
    }

    fn shade(&self, frame: &PlateFrame) -> Shade {
        let seen = self.predicted(&frame.camera);
        Shade::of(&frame.picture, &seen, frame.hidden.as_ref(), seen.width().max(seen.height()))
    }

    /// What a camera would see of the plane; support 0 where it does not.
    pub(super) fn predicted(&self, camera: &Camera) -> Image<Cluster> {
        let directions = Directions::of(&camera.intrinsics);
        let center = camera.center();
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        let pixel = |at: usize| {
            let direction = directions.at(at % width, at / width)?;
            self.at(on_plane(camera, &center, direction)?)
        };
        let pixels = (0..width * height).map(|at| pixel(at).unwrap_or_default()).collect();
        Image::from_pixels(width, height, pixels).unwrap_or_default()
    }

    fn looked_up(&self, frames: &[PlateFrame], shades: Option<&[Shade]>, palettes: &Palettes) -> Image<Cluster> {
        let (width, height) = (self.texture.width(), self.texture.height());
        let texel = |samples: &mut Vec<[f32; 3]>, at: usize| {
            let x = self.origin[0] + ((at % width) as f64 + 0.5) * self.texel;
            let y = self.origin[1] + ((at / width) as f64 + 0.5) * self.texel;
            let point = Point3::new(x, y, 0.0);
            samples.clear();
            let mut hidden = 0;
            for (i, frame) in frames.iter().enumerate() {
                let Some(pixel) = frame.camera.project(&point).map(|p| p.pixel) else { continue };
                if !frame.camera.in_frame(pixel) {
                    continue;
                }
                if frame.is_hidden(pixel.x as usize, pixel.y as usize) {
                    hidden += 1;
                    continue;
                }
                let shade = shades.map_or(1.0, |s| s[i].at(pixel.x, pixel.y));
                samples.push(frame.picture.between(pixel.x, pixel.y).map(|v| v / shade));
            }
            if hidden > 0 && samples.len() < usize::from(LEAST_SUPPORT) {
                return Cluster::COVERED;
            }
            let found = cluster::densest(samples).unwrap_or_default();
            // The object itself, where the hull so far is too small.
            if hidden > 0 && palettes.log_odds(&found.colour) > SUSPICIOUS {
                return Cluster::COVERED;
            }
            // Less than a third of the views is no agreement.
            if 3 * usize::from(found.support) < samples.len() { Cluster::default() } else { found }
        };
        let pixels = (0..width * height).into_par_iter().map_init(Vec::new, texel).collect();
        let mut seen = Image::from_pixels(width, height, pixels).unwrap_or_default();
        cover_feet(&mut seen, palettes);
        seen
    }
}

/// Puts print, `dark` where given the share of ink, where it is not seen or something else is: places that the object
/// nearly always covers are known all the same, and its foot is not taken for the print beside it. Ink and paper look as
/// they do where they are seen, in the light that falls there.
pub(super) fn put_print(texture: &mut Image<Cluster>, dark: &[Option<f32>], palettes: &Palettes) {
    let seen = |share: f32| -> Option<Cluster> {
        let alike = texture.pixels().iter().zip(dark).filter(|(t, d)| **d == Some(share) && t.support >= SURE);
        let mut levels: [Vec<f32>; 4] = Default::default();
        for (texel, _) in alike {
            (0..3).for_each(|c| levels[c].push(texel.colour[c]));
            levels[3].push(texel.spread);
        }
        let [r, g, b, spread] = levels.map(median);
        Some(Cluster { colour: [r?, g?, b?], spread: spread?, support: SURE })
    };
    let (Some(paper), Some(ink)) = (seen(0.0), seen(1.0)) else { return };
    let mixed = |dark: f32| [0, 1, 2].map(|c| paper.colour[c] + (ink.colour[c] - paper.colour[c]) * dark);
    let printed: Vec<Option<[f32; 3]>> = dark.iter().map(|dark| dark.map(mixed)).collect();
    let is_object = |texel: &Cluster| palettes.log_odds(&texel.colour) > SUSPICIOUS;
    let bare = texture.map(|texel| if is_object(&texel) { Cluster::COVERED } else { texel });
    let contact = Contact::of(&bare, &printed);
    let width = texture.width();
    for (at, (texel, printed)) in texture.pixels_mut().iter_mut().zip(&printed).enumerate() {
        let Some(printed) = *printed else { continue };
        let light = contact.at(at % width, at / width);
        let colour = printed.map(|v| v * light);
        let is_seen = texel.support >= SURE && !texel.is_covered();
        if !is_seen || !is_print_in(&texel.colour, &colour, &PRINT_LIGHT) {
            *texel = Cluster { colour, spread: paper.spread.max(ink.spread), support: SURE };
        }
    }
}

/// Where a place is covered, what is seen beside it and has not the colours of what is around, in light or shade, is the
/// object, too: a foot that the hull so far does not reach. White paper around a white object is none, though it looks like
/// one: it is too large.
pub(super) fn cover_feet(seen: &mut Image<Cluster>, palettes: &Palettes) {
    let may_be_object =
        |texel: Cluster| texel.is_covered() || texel.support > 0 && palettes.log_odds(&texel.colour) > OF_A_FOOT;
    let (sizes, labels) = components(&seen.map(may_be_object));
    let covered = seen.pixels().iter().filter(|texel| texel.is_covered()).count();
    let largest = (LARGEST_FOOT * covered as f64) as usize;
    let mut is_foot = vec![false; sizes.len() + 1];
    let labelled = || labels.pixels().iter().map(|&label| label as usize);
    for (label, _) in labelled().zip(seen.pixels()).filter(|(_, texel)| texel.is_covered()) {
        is_foot[label] = sizes[label - 1] <= largest;
    }
    for (label, texel) in labelled().zip(seen.pixels_mut()) {
        if is_foot[label] {
            *texel = Cluster::COVERED;
        }
    }
}

fn median(mut values: Vec<f32>) -> Option<f32> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// Where the rays through the corners of a box meet the plane.
fn shadow_of(bounds: &Aabb, camera: &Camera) -> Vec<[f64; 2]> {
    let center = camera.center();
    let corner = |i: usize| {
        let pick = |axis: usize| if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
        let point = Point3::new(pick(0), pick(1), pick(2).max(0.0));
        let d = point - center;
        if center.z <= 0.0 || d.z >= -0.035 * d.norm() {
            return None;
        }
        let t = -center.z / d.z;
        Some([center.x + t * d.x, center.y + t * d.y])
    };
    (0..8).filter_map(corner).collect()
}
