//! Where the light comes from, and whether it turns with the object.
//!
//! A shiny ball in view is a mirror: the brightest spot on it says where the light is (the specular ball of Jägersand,
//! Birkbeck, Cobzas: *View-dependent texturing using a linear basis*, Fig. 6). Its outline alone gives the cone under
//! which it is seen, and reflection does not depend on how large or far it is as long as the light is far: neither need
//! be measured.
//!
//! Without a ball the shading itself tells room light from light that turns with the object. Of a diffuse surface under
//! light from direction `l`, `b = albedo · n·l`: if the light stays in the room while the object turns, every point
//! follows `a₀ + a₁ cos θ + b₁ sin θ`, each with a phase of its own; if it turns along, no point changes.

use crate::{Camera, Image};
use nalgebra::{Matrix3, Point2, Point3, Unit, Vector3};
use serde::Serialize;
use std::collections::BTreeMap;

/// A ball in the world. One found by its outline has its centre at distance 1 from the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// In world units.
    pub center: Point3<f64>,
    /// In world units.
    pub radius: f64,
}

/// Brightness of one surface point in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadingSample {
    /// Turn of the object in radians.
    pub angle: f64,
    /// Number of the surface point, the same in all frames that see it.
    pub point: usize,
    /// In any unit, the same for all samples.
    pub brightness: f64,
}

/// What the light is fixed to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LightKind {
    /// The room: it stays while the object turns.
    Room,
    /// The object: it turns along, or neither turns and the camera goes around.
    Object,
    /// The samples do not say.
    Undetermined,
}

/// What the shading says of the light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LightCheck {
    /// The verdict.
    pub kind: LightKind,
    /// By how much a point's brightness follows the turn: RMS of the first harmonic relative to the mean, the middle
    /// one of all points. Under room light 0.1 and more, under light fixed to the object 0.
    pub modulation: f64,
    /// What the harmonic leaves, the same way.
    pub residual: f64,
    /// Points seen often enough to count.
    pub points: usize,
}

/// A spot must stand out from the ball by this many levels of 255.
const MIN_CONTRAST: f64 = 40.0;
/// Share of the ball's outline inside which the spot is looked for: the rim mirrors what lies behind the ball.
const INNER: f64 = 0.97;
/// A spot is what is brighter than this share of the way from the middle level of the ball to its brightest.
const SPOT_LEVEL: f64 = 0.7;

/// The ball whose outline passes through `outline` (pixels, at least three), placed at distance 1: a ball is seen under
/// a right circular cone, so rays `r` to its outline satisfy `r · c = cos α` for its axis `c` and half angle α, linear
/// in `c / cos α`. Exact for any perspective and lens. `None` where the points do not span a cone.
pub fn ball_from_outline(camera: &Camera, outline: &[Point2<f64>]) -> Option<Ball> {
    let rays: Vec<Vector3<f64>> = outline.iter().filter_map(|&p| camera.ray(p)).map(|ray| ray.direction).collect();
    let normal: Matrix3<f64> = rays.iter().map(|r| r * r.transpose()).sum();
    let right: Vector3<f64> = rays.iter().sum();
    let axis = normal.try_inverse()? * right;
    let cos = 1.0 / axis.norm();
    let is_cone = rays.len() >= 3 && cos.is_finite() && cos > 0.0 && cos < 1.0;
    let direction = axis.try_normalize(1e-12)?;
    is_cone.then(|| Ball { center: camera.center() + direction, radius: (1.0 - cos * cos).sqrt() })
}

/// Directions in which an outline is looked for from its middle.
const RAYS: usize = 64;
/// How far the middle and the radius of an outline may be from where they are said to be, in parts of the radius.
const OUTLINE_OFF: f64 = 0.15;
/// A rim counts no more than this many levels a pixel: highlights shall not draw it.
const RIM_CAP: f64 = 20.0;
/// A rim of fewer levels a pixel, in the mean, is none.
const LEAST_RIM: f64 = 4.0;
/// Seen aside, the outline is no circle: its points lie within so many pixels of one.
const OVAL_PX: f64 = 2.0;

/// Points of the outline of a ball near a circle `[x, y, radius]` (pixels) drawn by hand: the circle across which most
/// changes (the integro-differential operator of Daugman: High confidence visual recognition of persons by a test of
/// statistical independence, PAMI 15(11), 1993), and on each ray from its middle the steepest place nearby. `None` where
/// nothing round stands out there.
pub fn outline_near(image: &Image<[u8; 3]>, drawn: [f64; 3]) -> Option<Vec<Point2<f64>>> {
    let luma = image.map(|p| p.map(f64::from).iter().sum::<f64>() / 3.0);
    let reach = OUTLINE_OFF * drawn[2];
    let mut step = (0.5 * reach).clamp(0.25, 1.5);
    let mut best = drawn;
    let mut radius = (reach / step).ceil() as i32;
    while step > 0.1 {
        best = around(best, step, radius).max_by(|a, b| rim(&luma, a).total_cmp(&rim(&luma, b)))?;
        (step, radius) = (0.5 * step, 1);
    }
    if rim(&luma, &best) < LEAST_RIM {
        return None;
    }
    let points: Vec<Point2<f64>> = (0..RAYS).filter_map(|ray| steepest(&luma, &best, ray)).collect();
    (2 * points.len() > RAYS).then_some(points)
}

/// Circles about one, in steps, to each side in middle and radius.
fn around([x, y, r]: [f64; 3], step: f64, radius: i32) -> impl Iterator<Item = [f64; 3]> {
    let steps = move || (-radius..=radius).map(move |k| f64::from(k) * step);
    let moved = move |dx: f64| steps().flat_map(move |dy| steps().map(move |dr| [x + dx, y + dy, r + dr]));
    steps().flat_map(moved)
}

/// How much changes across a circle, in levels a pixel, the mean of all rays.
fn rim(luma: &Image<f64>, circle: &[f64; 3]) -> f64 {
    (0..RAYS).map(|ray| slope(luma, circle, ray, 0.0).abs().min(RIM_CAP)).sum::<f64>() / RAYS as f64
}

/// On a ray of a circle, `off` pixels beyond it.
fn on_ray([x, y, r]: &[f64; 3], ray: usize, off: f64) -> Point2<f64> {
    let angle = std::f64::consts::TAU * ray as f64 / RAYS as f64;
    Point2::new(x + (r + off) * angle.cos(), y + (r + off) * angle.sin())
}

/// Levels a pixel, outwards.
fn slope(luma: &Image<f64>, circle: &[f64; 3], ray: usize, off: f64) -> f64 {
    let level = |off: f64| {
        let p = on_ray(circle, ray, off) - nalgebra::Vector2::repeat(0.5);
        let (x, y) = (p.x.floor(), p.y.floor());
        let at = |dx: isize, dy: isize| luma.at_clamped(x as isize + dx, y as isize + dy);
        let row = |dy: isize| at(0, dy) + (at(1, dy) - at(0, dy)) * (p.x - x);
        row(0) + (row(1) - row(0)) * (p.y - y)
    };
    0.5 * (level(off + 1.0) - level(off - 1.0))
}

/// Where a ray crosses the outline: the middle of the slope around its steepest place.
fn steepest(luma: &Image<f64>, circle: &[f64; 3], ray: usize) -> Option<Point2<f64>> {
    let at = |off: f64| (off, slope(luma, circle, ray, off).abs());
    let all = (-8..=8).map(|k| at(OVAL_PX * f64::from(k) / 8.0));
    let (peak, most) = all.max_by(|a, b| a.1.total_cmp(&b.1))?;
    if most < LEAST_RIM {
        return None;
    }
    let near: Vec<(f64, f64)> = (-4..=4).map(|k| at(peak + 0.25 * f64::from(k))).collect();
    let total: f64 = near.iter().map(|(_, slope)| slope).sum();
    Some(on_ray(circle, ray, near.iter().map(|(off, slope)| off * slope).sum::<f64>() / total))
}

/// Unit direction towards the light, in the world, that the ball mirrors at `highlight` (pixels): `2 (n·v) n − v` with
/// `v` towards the camera. `None` where the pixel misses the ball.
pub fn light_from_highlight(camera: &Camera, ball: &Ball, highlight: Point2<f64>) -> Option<Vector3<f64>> {
    let ray = camera.ray(highlight)?;
    let to_center = ball.center - ray.origin;
    let along = to_center.dot(&ray.direction);
    let half_chord2 = ball.radius * ball.radius - (to_center - ray.direction * along).norm_squared();
    let distance = along - half_chord2.max(0.0).sqrt();
    if half_chord2 < 0.0 || distance <= 0.0 {
        return None;
    }
    let normal = Unit::try_new(ray.origin + ray.direction * distance - ball.center, 1e-12)?;
    let view = -ray.direction;
    (2.0 * normal.dot(&view) * normal.into_inner() - view).try_normalize(1e-12)
}

/// Unit direction towards the light, in the world, as the brightest spot on a ball in the picture shows it; `None` where
/// none stands out, or the ball is not in the picture. The mean over the spot is that of directions, not of pixels:
/// seen from afar, a mirror ball maps all directions to equal areas, so a spot near the rim is not drawn inwards.
pub fn ball_light(image: &Image<[u8; 3]>, camera: &Camera, ball: &Ball) -> Option<Vector3<f64>> {
    let spot = brightest_spot(image, camera, ball)?;
    let direction = |&(x, y, weight): &(usize, usize, f64)| {
        light_from_highlight(camera, ball, Point2::new(x as f64 + 0.5, y as f64 + 0.5)).map(|d| d * weight)
    };
    spot.iter().filter_map(direction).sum::<Vector3<f64>>().try_normalize(1e-12)
}

/// Pixels of the spot with the most light: column, row, how far they exceed the threshold.
fn brightest_spot(image: &Image<[u8; 3]>, camera: &Camera, ball: &Ball) -> Option<Vec<(usize, usize, f64)>> {
    let inside = pixels_inside(image, camera, ball);
    let luma = |&(x, y): &(usize, usize)| image.at(x, y).map(f64::from).iter().sum::<f64>() / 3.0;
    let mut levels: Vec<f64> = inside.iter().map(luma).collect();
    let brightest = levels.iter().copied().fold(0.0, f64::max);
    levels.sort_by(f64::total_cmp);
    let middle = levels.get(levels.len() / 2)?;
    if brightest - middle < MIN_CONTRAST {
        return None;
    }
    let threshold = middle + SPOT_LEVEL * (brightest - middle);
    let spots = connected(inside.into_iter().filter(|p| luma(p) > threshold).collect());
    let weighted = |spot: Vec<(usize, usize)>| spot.iter().map(|p| (p.0, p.1, luma(p) - threshold)).collect::<Vec<_>>();
    let total = |spot: &Vec<(usize, usize, f64)>| spot.iter().map(|p| p.2).sum::<f64>();
    spots.into_iter().map(weighted).max_by(|a, b| total(a).total_cmp(&total(b)))
}

/// Pixels whose rays meet the inner part of the ball, row by row.
fn pixels_inside(image: &Image<[u8; 3]>, camera: &Camera, ball: &Ball) -> Vec<(usize, usize)> {
    let to_center = ball.center - camera.center();
    let sin = INNER * ball.radius / to_center.norm();
    let Some(axis) = to_center.try_normalize(1e-12).filter(|_| sin < 1.0) else { return Vec::new() };
    let cos = (1.0 - sin * sin).sqrt();
    let meets = |x: usize, y: usize| {
        let ray = camera.ray(Point2::new(x as f64 + 0.5, y as f64 + 0.5));
        ray.is_some_and(|ray| ray.direction.dot(&axis) >= cos)
    };
    let all = (0..image.height()).flat_map(|y| (0..image.width()).map(move |x| (x, y)));
    all.filter(|&(x, y)| meets(x, y)).collect()
}

/// Groups of pixels that share sides or corners. `pixels` come row by row.
fn connected(pixels: Vec<(usize, usize)>) -> Vec<Vec<(usize, usize)>> {
    let mut open: std::collections::BTreeSet<(usize, usize)> = pixels.into_iter().collect();
    let mut groups = Vec::new();
    while let Some(first) = open.pop_first() {
        let mut group = vec![first];
        let mut next = 0;
        while let Some(&(x, y)) = group.get(next) {
            let around = (x.saturating_sub(1)..=x + 1).flat_map(|x| (y.saturating_sub(1)..=y + 1).map(move |y| (x, y)));
            group.extend(around.filter(|p| open.remove(p)));
            next += 1;
        }
        groups.push(group);
    }
    groups
}

/// Points with fewer samples say nothing of three coefficients.
const MIN_SAMPLES: usize = 6;
/// Fewer points than this decide nothing.
const MIN_POINTS: usize = 8;
/// Matt surfaces under lamps of a room follow the turn by at least this much, seen from all sides…
const ROOM: f64 = 0.06;
/// …and by this many times what else changes them: texture that slides under the points does both.
const ROOM_RATIO: f64 = 1.3;
/// Light that turns along leaves less than this.
const OBJECT: f64 = 0.025;
/// Rounds in which levels of points and gains of frames are found.
const EVENING_ROUNDS: usize = 30;
/// Least determinant of the mean normal matrix of `(1, cos θ, sin θ)`, that of 30°: shorter arcs fix no harmonic.
const MIN_DETERMINANT: f64 = 2e-6;

/// Judges from shading whether the light turns with the object, whatever the exposure of each frame. The points face all
/// sides, level ones left out: far light shades those alike at every angle. Samples that are not finite or not positive
/// are left out.
pub fn judge_light(samples: &[ShadingSample]) -> LightCheck {
    let is_sound = |s: &&ShadingSample| s.brightness.is_finite() && s.brightness > 0.0 && s.angle.is_finite();
    let sound: Vec<ShadingSample> = samples.iter().filter(is_sound).copied().collect();
    let relative = evened(sound);
    let fits: Vec<[f64; 2]> = by_point(&relative).values().filter_map(|of_point| fit_harmonic(of_point)).collect();
    let middle = |k: usize| median(fits.iter().map(|fit| fit[k]).collect()).unwrap_or(0.0);
    let (modulation, residual) = (middle(0), middle(1));
    let kind = if fits.len() < MIN_POINTS {
        LightKind::Undetermined
    } else if modulation > ROOM && modulation > ROOM_RATIO * residual {
        LightKind::Room
    } else if modulation < OBJECT {
        LightKind::Object
    } else {
        LightKind::Undetermined
    };
    LightCheck { kind, modulation, residual, points: fits.len() }
}

/// Each sample relative to its point's level and its frame's gain, which are found in turns: the mean of a point depends
/// on the frames that see it. Frames are told apart by their angle.
fn evened(mut samples: Vec<ShadingSample>) -> Vec<ShadingSample> {
    for _ in 0..EVENING_ROUNDS {
        divide_by_level(&mut samples, |s| s.point as u64);
        divide_by_level(&mut samples, |s| s.angle.to_bits());
    }
    samples
}

/// Divides by the middle brightness of all samples with the same key.
fn divide_by_level(samples: &mut [ShadingSample], key: impl Fn(&ShadingSample) -> u64) {
    let mut groups: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
    samples.iter().for_each(|s| groups.entry(key(s)).or_default().push(s.brightness));
    let levels: BTreeMap<u64, f64> = groups.into_iter().filter_map(|(at, all)| Some((at, median(all)?))).collect();
    samples.iter_mut().for_each(|s| s.brightness /= levels.get(&key(s)).copied().unwrap_or(1.0));
}

fn by_point(samples: &[ShadingSample]) -> BTreeMap<usize, Vec<ShadingSample>> {
    let mut points: BTreeMap<usize, Vec<ShadingSample>> = BTreeMap::new();
    samples.iter().for_each(|s| points.entry(s.point).or_default().push(*s));
    points
}

/// RMS of the first harmonic, less what noise would give it, and RMS of what it leaves; `None` of too few samples.
fn fit_harmonic(samples: &[ShadingSample]) -> Option<[f64; 2]> {
    if samples.len() < MIN_SAMPLES {
        return None;
    }
    let n = samples.len() as f64;
    let row = |s: &ShadingSample| Vector3::new(1.0, s.angle.cos(), s.angle.sin());
    let normal: Matrix3<f64> = samples.iter().map(|s| row(s) * row(s).transpose()).sum();
    let right: Vector3<f64> = samples.iter().map(|s| row(s) * s.brightness).sum();
    if (normal / n).determinant() < MIN_DETERMINANT {
        return None;
    }
    let fit = normal.try_inverse()? * right;
    let mean = samples.iter().map(|s| s.brightness).sum::<f64>() / n;
    let squares = |of: &dyn Fn(&ShadingSample) -> f64| samples.iter().map(|s| of(s).powi(2)).sum::<f64>();
    let left = squares(&|s| s.brightness - row(s).dot(&fit)) / (n - 3.0);
    // Two more coefficients take two parts in n of the noise.
    let explained = squares(&|s| row(s).dot(&fit) - mean) / n - 2.0 * left / n;
    Some([explained.max(0.0).sqrt(), left.sqrt()]).filter(|both| both.iter().all(|v| v.is_finite()))
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contour::Contours;
    use crate::{Distortion, Intrinsics};
    use nalgebra::Rotation3;

    fn camera() -> Camera {
        let distortion = Distortion { k1: -0.06, k2: 0.02, ..Distortion::default() };
        let intrinsics =
            Intrinsics { fx: 300.0, fy: 302.0, skew: 0.0, cx: 163.0, cy: 118.0, distortion, width: 320, height: 240 };
        let rotation = Rotation3::from_euler_angles(0.3, -0.2, 0.9).into_inner();
        Camera { intrinsics, rotation, translation: Vector3::new(0.1, -0.2, 4.0) }
    }

    fn ball() -> Ball {
        let in_camera = Vector3::new(0.8, 0.5, 3.5);
        let camera = camera();
        Ball { center: Point3::from(camera.rotation.transpose() * (in_camera - camera.translation)), radius: 0.4 }
    }

    /// A mirror ball on grey ground under a round light of 4° radius at `light`, 16 rays a pixel; and its coverage.
    fn picture(light: Vector3<f64>) -> (Image<[u8; 3]>, Image<u8>) {
        let (camera, ball) = (camera(), ball());
        let (mut image, mut cover) = (Image::filled(320, 240, [110; 3]), Image::filled(320, 240, 0));
        for y in 0..240_usize {
            for x in 0..320_usize {
                let at = |k: usize| {
                    Point2::new(x as f64 + (k % 4) as f64 / 4.0 + 0.125, y as f64 + (k / 4) as f64 / 4.0 + 0.125)
                };
                let hits: Vec<f64> = (0..16)
                    .filter_map(|k| light_from_highlight(&camera, &ball, at(k)))
                    .map(|d| if d.angle(&light) < 4.0_f64.to_radians() { 255.0 } else { 60.0 })
                    .collect();
                let ground = 110.0 * (16 - hits.len()) as f64;
                image.set(x, y, [((hits.iter().sum::<f64>() + ground) / 16.0) as u8; 3]);
                cover.set(x, y, (hits.len() * 255 / 16) as u8);
            }
        }
        (image, cover)
    }

    #[test]
    fn the_outline_of_a_ball_gives_its_cone() {
        let (_, cover) = picture(Vector3::z());
        let outline: Vec<_> = Contours::from_matte(&cover).loops().flatten().copied().collect();
        let found = ball_from_outline(&camera(), &outline).unwrap();
        let (eye, truth) = (camera().center(), ball());
        let distance = (truth.center - eye).norm();
        assert!((found.center - eye).angle(&(truth.center - eye)) < 2e-4);
        assert!((found.radius - truth.radius / distance).abs() < 3e-4, "{}", found.radius);
    }

    #[test]
    fn an_outline_drawn_by_hand_is_drawn_to_the_ball() {
        let (image, _) = picture((camera().center() - ball().center).normalize() + Vector3::new(0.3, 0.8, 0.1));
        let middle = camera().project(&ball().center).unwrap().pixel;
        let (eye, truth) = (camera().center(), ball());
        // 34 pixels, drawn two to four off.
        for [dx, dy, dr] in [[0.0, 0.0, 0.0], [3.0, -2.0, 2.0], [-3.5, 3.0, -3.0]] {
            let outline = outline_near(&image, [middle.x + dx, middle.y + dy, 34.0 + dr]).unwrap();
            let found = ball_from_outline(&camera(), &outline).unwrap();
            let off = (found.center - eye).angle(&(truth.center - eye));
            // A third of a pixel is 1e-3.
            assert!(off < 1e-3, "{off}");
            assert!((found.radius - truth.radius / (truth.center - eye).norm()).abs() < 1e-3, "{}", found.radius);
        }
        assert_eq!(outline_near(&Image::filled(320, 240, [90; 3]), [160.0, 120.0, 30.0]), None);
        assert_eq!(outline_near(&image, [20.0, 20.0, 12.0]), None);
    }

    #[test]
    fn a_ball_shows_where_the_light_is() {
        let toward = (camera().center() - ball().center).normalize();
        for aside in [Vector3::new(0.3, 0.8, 0.1), Vector3::new(-0.9, 0.2, 0.6), Vector3::new(0.1, -0.4, 1.2)] {
            let light = (toward + aside).normalize();
            let (image, cover) = picture(light);
            let outline: Vec<_> = Contours::from_matte(&cover).loops().flatten().copied().collect();
            let found = ball_from_outline(&camera(), &outline).unwrap();
            let direction = ball_light(&image, &camera(), &found).unwrap();
            // A pixel is 3° here.
            assert!(direction.angle(&light).to_degrees() < 1.0, "{}", direction.angle(&light).to_degrees());
        }
    }

    #[test]
    fn no_spot_and_no_ball_have_no_light() {
        let flat = Image::filled(320, 240, [90; 3]);
        assert_eq!(ball_light(&flat, &camera(), &ball()), None);
        let behind = Ball { center: camera().center() - camera().forward(), radius: 0.3 };
        assert_eq!(ball_light(&flat, &camera(), &behind), None);
        let around = Ball { center: camera().center(), radius: 1.0 };
        assert_eq!(ball_light(&flat, &camera(), &around), None);
        assert_eq!(light_from_highlight(&camera(), &ball(), Point2::new(5.0, 5.0)), None);
        let line = [1.0, 2.0, 3.0].map(|x| Point2::new(163.0 + x, 118.0));
        assert!(ball_from_outline(&camera(), &line[..2]).is_none());
        assert!(ball_from_outline(&camera(), &[]).is_none());
    }

    /// Diffuse points facing all sides, seen while they face the camera, with exposure that drifts and 1 % of noise.
    fn shading(tilt: f64, turns_along: bool) -> Vec<ShadingSample> {
        let light = Vector3::new(0.5, 0.6, 0.8).normalize();
        let mut samples = Vec::new();
        for point in 0..40_usize {
            let azimuth = point as f64 * 0.7;
            let normal = Vector3::new(tilt * azimuth.cos(), tilt * azimuth.sin(), 1.0).normalize();
            for frame in 0..60_usize {
                let angle = frame as f64 * 0.105;
                let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), angle) * normal;
                if turned.dot(&Vector3::new(0.9, 0.0, 0.45)) < 0.2 {
                    continue;
                }
                let shade = 0.2 + light.dot(if turns_along { &normal } else { &turned }).max(0.0);
                let noise = 1.0 + 0.01 * ((point * 7919 + frame * 104_729) as f64).sin();
                let exposure = 1.0 + 0.2 * (angle * 0.8).sin();
                samples.push(ShadingSample { angle, point, brightness: 100.0 * shade * noise * exposure });
            }
        }
        samples
    }

    #[test]
    fn light_in_the_room_changes_what_turns() {
        let check = judge_light(&shading(4.0, false));
        assert_eq!(check.kind, LightKind::Room, "{check:?}");
        assert!(check.modulation > 0.15, "{check:?}");
    }

    #[test]
    fn light_that_turns_along_changes_nothing_even_if_exposure_drifts() {
        let check = judge_light(&shading(4.0, true));
        assert_eq!(check.kind, LightKind::Object, "{check:?}");
        assert!(check.modulation < 0.01, "{check:?}");
    }

    #[test]
    fn samples_without_meaning_decide_nothing() {
        let same = ShadingSample { angle: 1.0, point: 3, brightness: 5.0 };
        let broken = ShadingSample { brightness: f64::NAN, ..same };
        let dark = ShadingSample { brightness: 0.0, ..same };
        for samples in [vec![], vec![same; 50], vec![broken; 50], vec![dark; 50]] {
            let check = judge_light(&samples);
            assert_eq!((check.kind, check.points), (LightKind::Undetermined, 0));
        }
    }
}
