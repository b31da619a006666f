//! Light from all around: a panorama as a few directional lights, by median cut.
//!
//! The panorama is split into regions: the one with the most light across its longer side, where half
//! its light lies on either side, until there are as many as wanted. Each becomes one light, from
//! where its light lies in the mean, with all of it (Debevec, A Median Cut Algorithm for Light Probe Sampling, 2005; there
//! all regions are split in each round, so that counts are powers of two). Deterministic.
//!
//! Longitude and latitude: row 0 is towards +z, the last towards −z; the middle column is towards +x, and
//! columns run clockwise seen from +z, as someone in the middle sees them.

use super::Light;
use capture::Image;
use nalgebra::Vector3;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// A part of the panorama and the light in it.
#[derive(Clone, Debug)]
struct Region {
    columns: Range<usize>,
    rows: Range<usize>,
    luminance: f64,
}

/// The panorama (linear radiance, RGB) as at most `count` lights. Black regions give none; what is not finite or
/// is negative counts as black.
pub fn lights_of_panorama(panorama: &Image<[f32; 3]>, count: usize) -> Vec<Light> {
    let whole = Region { columns: 0..panorama.width(), rows: 0..panorama.height(), luminance: f64::INFINITY };
    if panorama.pixels().is_empty() || count == 0 {
        return Vec::new();
    }
    let mut regions = vec![whole];
    while regions.len() < count {
        let brighter = |a: &&Region, b: &&Region| a.luminance.total_cmp(&b.luminance);
        // The first of equals.
        let splittable = regions.iter().rev().filter(|r| r.luminance > 0.0 && r.columns.len() * r.rows.len() > 1);
        let Some(brightest) = splittable.max_by(brighter).cloned() else { break };
        let at = regions.iter().position(|r| (&r.columns, &r.rows) == (&brightest.columns, &brightest.rows));
        let [first, second] = split(panorama, &brightest);
        regions.splice(at.unwrap_or(0)..=at.unwrap_or(0), [first, second]);
    }
    regions.iter().filter_map(|region| light(panorama, region)).collect()
}

/// Towards the middle of a pixel.
pub(crate) fn direction(panorama: &Image<[f32; 3]>, column: usize, row: usize) -> Vector3<f64> {
    let azimuth = PI - TAU * (column as f64 + 0.5) / panorama.width() as f64;
    let (sin, cos) = polar(panorama, row).sin_cos();
    Vector3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos)
}

/// The column and row, in pixels from the outer corner of the first, that lie in a direction of any length; the inverse of
/// [`direction`] at their centres.
pub(crate) fn position(panorama: &Image<[f32; 3]>, direction: &Vector3<f64>) -> [f64; 2] {
    let azimuth = direction.y.atan2(direction.x);
    let polar = direction.x.hypot(direction.y).atan2(direction.z);
    [(PI - azimuth) / TAU * panorama.width() as f64, polar / PI * panorama.height() as f64]
}

fn polar(panorama: &Image<[f32; 3]>, row: usize) -> f64 {
    PI * (row as f64 + 0.5) / panorama.height() as f64
}

/// Solid angle of a pixel.
fn solid_angle(panorama: &Image<[f32; 3]>, row: usize) -> f64 {
    let edge = |row: usize| (PI * row as f64 / panorama.height() as f64).cos();
    (edge(row) - edge(row + 1)) * TAU / panorama.width() as f64
}

/// Irradiance that a pixel gives to what faces it.
fn irradiance(panorama: &Image<[f32; 3]>, column: usize, row: usize) -> [f64; 3] {
    let is_light = |v: f32| v.is_finite() && v > 0.0;
    panorama.at(column, row).map(|v| if is_light(v) { f64::from(v) * solid_angle(panorama, row) } else { 0.0 })
}

/// Weight of channels: Rec. 709.
fn luminance([r, g, b]: [f64; 3]) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

fn split(panorama: &Image<[f32; 3]>, region: &Region) -> [Region; 2] {
    let middle = polar(panorama, (region.rows.start + region.rows.end) / 2);
    // Columns draw together towards the poles.
    let across = region.columns.len() as f64 * TAU / panorama.width() as f64 * middle.sin();
    let down = region.rows.len() as f64 * PI / panorama.height() as f64;
    let by_column = region.rows.len() == 1 || (across > down && region.columns.len() > 1);
    let light = |column, row| luminance(irradiance(panorama, column, row));
    let slice = |k: usize| -> f64 {
        if by_column {
            region.rows.clone().map(|row| light(k, row)).sum()
        } else {
            region.columns.clone().map(|column| light(column, k)).sum()
        }
    };
    let range = if by_column { region.columns.clone() } else { region.rows.clone() };
    let (cut, before, after) = median(range, slice);
    let part = |columns, rows, luminance| Region { columns, rows, luminance };
    let (c, r) = (region.columns.clone(), region.rows.clone());
    if by_column {
        [part(c.start..cut, r.clone(), before), part(cut..c.end, r, after)]
    } else {
        [part(c.clone(), r.start..cut, before), part(c, cut..r.end, after)]
    }
}

/// Where a range is cut so that both sides hold half, as nearly as whole slices allow, and what they hold. Both
/// sides get at least one slice.
fn median(range: Range<usize>, slice: impl Fn(usize) -> f64) -> (usize, f64, f64) {
    let slices: Vec<f64> = range.clone().map(slice).collect();
    let total: f64 = slices.iter().sum();
    let (mut best, mut before) = ((1, slices[0]), 0.0);
    for (k, s) in slices.iter().enumerate().take(slices.len() - 1) {
        before += s;
        if (before - 0.5 * total).abs() < (best.1 - 0.5 * total).abs() {
            best = (k + 1, before);
        }
    }
    (range.start + best.0, best.1, total - best.1)
}

/// The light of a region; `None` of a black one.
fn light(panorama: &Image<[f32; 3]>, region: &Region) -> Option<Light> {
    let (mut sum, mut toward) = ([0.0; 3], Vector3::zeros());
    for (column, row) in region.rows.clone().flat_map(|row| region.columns.clone().map(move |column| (column, row))) {
        let pixel = irradiance(panorama, column, row);
        toward += direction(panorama, column, row) * luminance(pixel);
        (0..3).for_each(|c| sum[c] += pixel[c]);
    }
    // The light of a whole even panorama comes from nowhere: of its middle, then.
    let middle = || {
        direction(panorama, (region.columns.start + region.columns.end) / 2, (region.rows.start + region.rows.end) / 2)
    };
    let toward = toward.try_normalize(1e-9 * luminance(sum)).unwrap_or_else(middle);
    (luminance(sum) > 0.0).then(|| Light::Directional { toward, irradiance: sum.map(|v| v as f32) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn total(lights: &[Light]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for light in lights {
            let Light::Directional { irradiance, .. } = light else { continue };
            (0..3).for_each(|c| sum[c] += f64::from(irradiance[c]));
        }
        sum
    }

    #[test]
    fn no_light_is_lost_and_matt_paint_under_an_even_sky_is_white() {
        let even = Image::filled(64, 32, [1.0, 0.5, 0.25]);
        for count in [1, 2, 7, 64, 3000] {
            let lights = lights_of_panorama(&even, count);
            assert_eq!(lights.len(), count.min(64 * 32));
            let sum = total(&lights);
            assert!((sum[0] - 4.0 * PI).abs() < 1e-4 && (sum[2] - PI).abs() < 1e-4, "{sum:?}");
        }
        // Σ E cos⁺ / π of a white matt plane facing up: the integral is 1.
        let lights = lights_of_panorama(&even, 256);
        let lit: f64 = lights
            .iter()
            .map(|light| match light {
                Light::Directional { toward, irradiance } => toward.z.max(0.0) * f64::from(irradiance[0]) / PI,
                Light::Point { .. } => 0.0,
            })
            .sum();
        assert!((lit - 1.0).abs() < 0.02, "{lit}");
    }

    #[test]
    fn a_sun_is_found_where_it_stands() {
        let mut sky = Image::filled(128, 64, [0.01; 3]);
        sky.set(96, 16, [5000.0, 4000.0, 3000.0]);
        let lights = lights_of_panorama(&sky, 8);
        let strength = |l: &&Light| match l {
            Light::Directional { irradiance, .. } => irradiance[0],
            Light::Point { .. } => 0.0,
        };
        let sun = lights.iter().max_by(|a, b| strength(a).total_cmp(&strength(b)));
        let Some(Light::Directional { toward, .. }) = sun else { panic!("no sun") };
        // Three quarters across: clockwise from +x, so at −y; a quarter down: 45° up.
        assert!(toward.angle(&Vector3::new(0.0, -1.0, 1.0)) < 0.08, "{toward:?}");
    }

    #[test]
    fn what_holds_no_light_gives_none() {
        for value in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(lights_of_panorama(&Image::filled(8, 4, [value; 3]), 16).is_empty());
        }
        assert!(lights_of_panorama(&Image::filled(0, 0, [1.0; 3]), 16).is_empty());
        assert_eq!(lights_of_panorama(&Image::filled(1, 1, [1.0; 3]), 16).len(), 1);
    }
}
