//! How likely each pixel shows the object: what room and target explain is background, in full light or in shadow;
//! what they do not, or what has the object's colours, is object.
//!
//! With background `b`, its deviation σ (encoded levels) and the object's palette `q`, the log odds of a colour `v`
//! are `ln q(v) − ln max(0.85 N(v; b, σ²I), 0.13 S(v), 0.02 / 256³)`, where the shadow `S` spreads evenly along
//! `r b` for r from 0.35 to 1 and as a Gaussian across (Horprasert, Harwood and Davis, A Statistical Approach for
//! Real-time Robust Background Subtraction and Shadow Detection, 1999, put shadow on the same line).

use super::cluster::Cluster;
use super::light::Toned;
use super::nearby::Nearby;
use super::palette::Palettes;
use super::shade::Shade;
use crate::Image;

/// Noise of sensor and codec, encoded levels.
const NOISE: f32 = 3.0;

/// Of what is expected: light that is not quite as smooth as thought.
const LIGHT_ERROR: f32 = 0.03;

/// The least of what is left of the (encoded) light in shadow: where no hull is known yet, and with it the light beside
/// it.
pub(super) const DEEPEST_SHADOW: [f32; 2] = [0.35, 0.7];

/// Of the light that a shadow takes: what the object beside it throws back in its own colour.
const SHADOW_TINT: f32 = 0.1;

/// Odds of one pixel are not trusted beyond this: neighbours share their errors.
const LARGEST: f32 = 8.0;

/// Log odds where nothing was ever seen behind the object, but for its colour.
const COVERED: f32 = 0.5;

/// What the colour alone can say.
const LARGEST_BY_COLOUR: f32 = 4.0;

/// What a frame shows behind the object.
#[derive(Debug)]
pub(super) struct Odds {
    /// Natural logarithm of the odds for the object.
    pub(super) log_odds: Image<f32>,
    /// What would be seen in place of the object, encoded levels; `None` where that is unknown.
    pub(super) background: Image<Option<[f32; 3]>>,
}

/// Of a picture, given what room and target look like from there. Where both are
/// unknown (support 0) the two palettes decide. `deepest` is the least that shadow leaves of the encoded light.
pub(super) fn of(
    picture: &Toned,
    room: Option<&Image<Cluster>>,
    target: Option<(&Image<Cluster>, &Shade)>,
    palettes: &Palettes,
    nearby: Option<&Nearby>,
    deepest: f32,
    size: (usize, usize),
) -> Odds {
    let (width, height) = size;
    let mut log_odds = Image::filled(width, height, 0.0);
    let mut background = Image::filled(width, height, None);
    for y in 0..height {
        for x in 0..width {
            let on_target = target.map(|(seen, shade)| {
                let factor = shade.at(x as f64 + 0.5, y as f64 + 0.5);
                let cluster = seen.at(x, y);
                Cluster { colour: cluster.colour.map(|v| v * factor), ..cluster }
            });
            let known = |c: &Cluster| c.support > 0;
            // The target hides the room, even where it is itself hidden.
            let is_covered = on_target.is_some_and(|c| c.is_covered());
            let in_room = room.map(|r| r.at(x, y)).filter(|c| known(c) && !is_covered);
            let Some(behind) = on_target.filter(known).or(in_room) else {
                let colour = picture.at(x, y);
                let odds = palettes.log_odds(&colour) + COVERED;
                log_odds.set(x, y, odds.clamp(-LARGEST_BY_COLOUR, LARGEST_BY_COLOUR));
                continue;
            };
            let colour = picture.at(x, y);
            let object = match nearby {
                Some(nearby) => nearby.log_density(&colour, x, y, &palettes.object),
                None => palettes.object.log_density(&colour),
            };
            let odds = object - log_density(&colour, &behind, deepest);
            log_odds.set(x, y, odds.clamp(-LARGEST, LARGEST));
            background.set(x, y, Some(behind.colour));
        }
    }
    Odds { log_odds, background }
}

/// Natural logarithm of the density of `colour` where `behind` is seen.
fn log_density(colour: &[f32; 3], behind: &Cluster, deepest: f32) -> f32 {
    let b = behind.colour;
    let length = (b[0] * b[0] + b[1] * b[1] + b[2] * b[2]).sqrt();
    let sigma = (behind.spread.powi(2) + NOISE.powi(2) + (LIGHT_ERROR * length * 0.58).powi(2)).sqrt();
    let squares = |factor: f32| (0..3).map(|c| (colour[c] - factor * b[c]).powi(2)).sum::<f32>();
    // ln √(2π)
    let gauss = |squares: f32, sigma: f32, dimensions: f32| {
        -0.5 * squares / (sigma * sigma) - dimensions * (sigma.ln() + 0.919)
    };
    let lit = 0.85_f32.ln() + gauss(squares(1.0), sigma, 3.0);
    let along = (0..3).map(|c| colour[c] * b[c]).sum::<f32>() / (length * length).max(1.0);
    let factor = along.clamp(deepest, 1.0);
    let shadow_sigma = sigma.hypot(SHADOW_TINT * (1.0 - factor) * length);
    let shadow_length = ((1.0 - deepest) * length).max(2.5 * sigma);
    let in_shadow = gauss(squares(factor), shadow_sigma, 2.0) - shadow_length.ln();
    let anything = 0.02_f32.ln() - 3.0 * 256.0_f32.ln();
    lit.max(0.13_f32.ln() + in_shadow).max(anything)
}
