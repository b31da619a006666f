//! What the light is fixed to, and where it is.

use super::pictures::Pictures;
use super::{FootageOptions, Shots};
use crate::Error;
use crate::shading::shading_samples;
use capture::light::{LightCheck, LightKind, ball_from_outline, ball_light, judge_light, outline_near};
use capture::silhouette::Silhouettes;
use capture::{Camera, Image, View};
use geometry::hull::{HullOptions, visual_hull};
use nalgebra::{Point2, Vector3};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// The light of footage.
#[derive(Clone, Debug)]
pub struct FootageLight {
    /// What the shading of the object says; `None` where the silhouettes leave no shape.
    pub check: Option<LightCheck>,
    /// Per frame chosen, unit direction towards the light in the world, where a ball shows it.
    pub directions: Vec<Option<Vector3<f64>>>,
}

/// Longer side of the pictures that are looked at: shading is coarse.
const SIDE: usize = 320;
/// Cells along the object's longest side.
const CELLS: usize = 48;
/// Frames in which the ball's outline is looked for together.
const MEAN_OF: usize = 8;
/// Points of the outline of a ball that does not stand out.
const OUTLINE: usize = 32;

/// Follows the shading of places on a coarse hull over the frames, and looks at the ball, if there is one.
pub(super) fn find(
    pictures: &Pictures,
    shots: &Shots,
    kept: &[usize],
    silhouettes: &Silhouettes,
    options: &FootageOptions,
) -> Result<FootageLight, Error> {
    let directions = directions(pictures, shots, kept, options)?;
    let usable = |&at: &usize| !silhouettes.contradicting.contains(&at) && has_object(silhouettes, at);
    let usable: Vec<usize> = (0..kept.len()).filter(usable).collect();
    let view = |&at: &usize| small_view(pictures, shots, kept, silhouettes, at);
    let views: Vec<_> = usable.par_iter().map(view).collect::<Vec<_>>().into_iter().collect::<Result<_, Error>>()?;
    let views: Vec<View> = views.into_iter().flatten().collect();
    let check = shading(&views, shots, kept, silhouettes);
    Ok(FootageLight { check, directions })
}

fn has_object(silhouettes: &Silhouettes, at: usize) -> bool {
    silhouettes.mattes[at].pixels().iter().any(|&v| v >= 128)
}

/// The frame at position `at` of those chosen, small.
fn small_view(
    pictures: &Pictures,
    shots: &Shots,
    kept: &[usize],
    silhouettes: &Silhouettes,
    at: usize,
) -> Result<Option<View>, Error> {
    let Some(camera) = shots.shots[kept[at]].camera else { return Ok(None) };
    let (image, matte) = (pictures.read(at)?, silhouettes.mattes[at].clone());
    let factor = image.width().max(image.height()).div_ceil(SIDE);
    let view = View { index: at, name: String::new(), image, matte, is_complete: true, camera };
    Ok(Some(view.downscaled(factor)))
}

/// `None` where the silhouettes leave no object.
fn shading(views: &[View], shots: &Shots, kept: &[usize], silhouettes: &Silhouettes) -> Option<LightCheck> {
    let hull_options = HullOptions {
        resolution: Some(CELLS),
        consensus: views.len() / 20,
        grow_px: 0.5,
        aabb: silhouettes.aabb,
        ..HullOptions::default()
    };
    let mesh = visual_hull(views, &hull_options).ok()?.mesh;
    let turn = |view: &View| shots.shots[kept[view.index]].angle.unwrap_or_else(|| -azimuth(&view.camera));
    let angles: Vec<f64> = views.iter().map(turn).collect();
    let check = judge_light(&shading_samples(&mesh, views, &angles, &Vector3::z()));
    // A camera that is carried around leaves object and light alone.
    let is_carried = shots.calibration.is_some() && shots.turntable().is_none();
    Some(if is_carried { LightCheck { kind: LightKind::Object, ..check } } else { check })
}

fn azimuth(camera: &Camera) -> f64 {
    let centre = camera.center();
    centre.y.atan2(centre.x)
}

/// Refuses a ball that cannot be: it stands in the room, at one place of the picture while the camera stands still.
pub(super) fn check_ball(shots: &Shots, options: &FootageOptions) -> Result<(), Error> {
    if options.light_ball.is_none() || shots.standpoints.len() == 1 {
        return Ok(());
    }
    let fault = "--light-ball: has to stand before a camera that stands still, and this one was carried or moved";
    Err(Error::Arguments(format!("{fault}; leave it away, or give the films one by one")))
}

fn on_circle([x, y]: [f64; 2], radius: f64) -> impl Fn(f64) -> Point2<f64> {
    move |angle| Point2::new(x + radius * angle.cos(), y + radius * angle.sin())
}

/// What stands still, sharp, and what turns, smeared: the mean of a few frames.
fn mean_picture(pictures: &Pictures, count: usize) -> Result<Image<[u8; 3]>, Error> {
    let chosen: Vec<usize> = (0..count).step_by(count.div_ceil(MEAN_OF).max(1)).collect();
    let mut sums: Vec<[u32; 3]> = Vec::new();
    let mut size = [0, 0];
    for &at in &chosen {
        let image = pictures.read(at)?;
        size = [image.width(), image.height()];
        sums.resize(image.pixels().len(), [0; 3]);
        sums.iter_mut().zip(image.pixels()).for_each(|(sum, p)| (0..3).for_each(|c| sum[c] += u32::from(p[c])));
    }
    let mean = |sum: [u32; 3]| sum.map(|v| (v / chosen.len() as u32) as u8);
    Ok(Image::from_pixels(size[0], size[1], sums.into_iter().map(mean).collect()).unwrap_or_default())
}

/// Where the highlight of the ball says the light is. The ball stands in the room: its outline is the same in all frames
/// of a camera that stands still.
fn directions(
    pictures: &Pictures,
    shots: &Shots,
    kept: &[usize],
    options: &FootageOptions,
) -> Result<Vec<Option<Vector3<f64>>>, Error> {
    let Some([x, y, radius]) = options.light_ball else { return Ok(vec![None; kept.len()]) };
    let outline = match outline_near(&mean_picture(pictures, kept.len())?, [x, y, radius]) {
        Some(outline) => outline,
        None => (0..OUTLINE).map(|k| TAU * k as f64 / OUTLINE as f64).map(on_circle([x, y], radius)).collect(),
    };
    let direction = |at: usize| {
        let Some(camera) = shots.shots[kept[at]].camera else { return Ok(None) };
        let ball = ball_from_outline(&camera, &outline);
        let image = pictures.read(at)?;
        Ok(ball.and_then(|ball| ball_light(&image, &camera, &ball)))
    };
    let found: Vec<Result<_, Error>> = (0..kept.len()).into_par_iter().map(direction).collect();
    found.into_iter().collect()
}
