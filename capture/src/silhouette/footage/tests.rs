//! A ball on a chequered target, seen by a camera whose truth is known.

use super::light::{encoded, linear};
use super::*;
use crate::{Camera, Distortion, Intrinsics};
use nalgebra::{Matrix3, Point2, Point3, Vector3};

const SIZE: (usize, usize) = (128, 96);
const FRAMES: usize = 16;

#[derive(Clone, Copy)]
struct Stage {
    center: Point3<f64>,
    radius: f64,
    albedo: [f64; 3],
    /// The target is round; beyond it a turning stage shows cloth, a still one the desk.
    board: f64,
    is_turning: bool,
    /// Off the middle of the frame, pixels.
    principal: [f64; 2],
    k1: f64,
}

impl Stage {
    fn new(is_turning: bool) -> Self {
        let center = Point3::new(0.4, 0.1, 1.0);
        Self { center, radius: 1.0, albedo: [0.7, 0.08, 0.06], board: 3.0, is_turning, principal: [0.0; 2], k1: 0.0 }
    }

    fn camera(&self, angle: f64) -> Camera {
        let eye = Point3::new(7.0 * angle.cos(), 7.0 * angle.sin(), 5.0);
        let forward = (Point3::new(0.0, 0.0, 0.7) - eye).normalize();
        let right = forward.cross(&Vector3::z()).normalize();
        let rotation = Matrix3::from_rows(&[right.transpose(), forward.cross(&right).transpose(), forward.transpose()]);
        let intrinsics = Intrinsics {
            fx: 152.0,
            fy: 152.0,
            skew: 0.0,
            cx: 64.0 + self.principal[0],
            cy: 48.0 + self.principal[1],
            distortion: Distortion { k1: self.k1, ..Distortion::default() },
            width: SIZE.0,
            height: SIZE.1,
        };
        Camera { intrinsics, rotation, translation: -(rotation * eye.coords) }
    }

    fn cameras(&self) -> Vec<Camera> {
        (0..FRAMES).map(|i| self.camera(std::f64::consts::TAU * i as f64 / FRAMES as f64)).collect()
    }

    /// Towards the light: in the room, which a turning stage turns against.
    fn light(&self, camera: &Camera) -> Vector3<f64> {
        let in_room = Vector3::new(-0.5, -0.7, -0.4).normalize();
        let turned = camera.rotation.tr_mul(&in_room);
        if self.is_turning { turned } else { Vector3::new(0.3, -0.4, 0.85).normalize() }
    }

    /// Linear light along a ray, and whether it is the ball's.
    fn trace(&self, camera: &Camera, pixel: Point2<f64>) -> ([f64; 3], bool) {
        let ray = camera.ray(pixel).unwrap();
        let light = self.light(camera);
        if let Some(t) = self.hit(&ray.origin, &ray.direction) {
            let normal = (ray.origin + ray.direction * t - self.center) / self.radius;
            let shade = 0.25 + 0.75 * normal.dot(&light).max(0.0);
            return (self.albedo.map(|a| a * shade), true);
        }
        let t = -ray.origin.z / ray.direction.z;
        let place = ray.origin + ray.direction * t;
        let is_on_board = t > 0.0 && place.coords.norm() < self.board;
        if self.is_turning && !is_on_board {
            let uneven = 0.6 + 0.3 * pixel.x / SIZE.0 as f64 + 0.2 * (pixel.y / SIZE.1 as f64).powi(2);
            return ([0.1, 0.35, 0.12].map(|c| c * uneven), false);
        }
        let lit = if self.hit(&place, &light).is_some() { 0.55 } else { 1.0 };
        let is_white = (place.x.mul_add(1.4, 100.0) as i64 + place.y.mul_add(1.4, 100.0) as i64) % 2 == 0;
        let colour = match (is_on_board, is_white) {
            (true, true) => [0.75, 0.74, 0.7],
            (true, false) => [0.03; 3],
            (false, _) => [0.3, 0.22, 0.15],
        };
        (colour.map(|c| c * lit), false)
    }

    fn hit(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        let to = origin - self.center;
        let b = to.dot(direction);
        let discriminant = b * b - to.norm_squared() + self.radius * self.radius;
        let t = -b - discriminant.sqrt();
        (t > 1e-9).then_some(t)
    }

    /// A frame with a little noise, and the coverage by the ball.
    fn shot(&self, camera: &Camera, gains: [f64; 3]) -> (Image<[u8; 3]>, Image<u8>) {
        let mut picture = Image::filled(SIZE.0, SIZE.1, [0; 3]);
        let mut truth = Image::filled(SIZE.0, SIZE.1, 0);
        for y in 0..SIZE.1 {
            for x in 0..SIZE.0 {
                let mut sum = [0.0; 3];
                let mut covered = 0;
                for k in 0..9 {
                    let at = |v: usize, k: usize| v as f64 + (k as f64 + 0.5) / 3.0;
                    let (light, is_ball) = self.trace(camera, Point2::new(at(x, k % 3), at(y, k / 3)));
                    (0..3).for_each(|c| sum[c] += light[c] / 9.0);
                    covered += usize::from(is_ball);
                }
                let noise =
                    |c: usize| ((x * 7919 + y * 104_729 + c * 31 + (camera.translation.x * 1e6) as usize) % 5) as f32;
                let level = |c: usize| encoded((sum[c] * gains[c]) as f32) + noise(c) - 2.0;
                picture.set(x, y, [0, 1, 2].map(|c| level(c).round().clamp(0.0, 255.0) as u8));
                truth.set(x, y, (covered * 255 / 9) as u8);
            }
        }
        (picture, truth)
    }

    fn setup(&self) -> StageSetup {
        let segment = if self.is_turning { Some(0) } else { None };
        StageSetup {
            cameras: self.cameras(),
            segments: vec![segment; FRAMES],
            has_plane: true,
            ..StageSetup::default()
        }
    }

    fn shots(&self) -> (Vec<Image<[u8; 3]>>, Vec<Image<u8>>) {
        self.cameras().par_iter().map(|c| self.shot(c, [1.0; 3])).unzip()
    }
}

fn found(pictures: &[Image<[u8; 3]>], setup: &StageSetup) -> Silhouettes {
    find_silhouettes(&|i| Ok(pictures[i].clone()), setup, &SilhouetteOptions::default()).unwrap()
}

fn ious(found: &Silhouettes, truth: &[Image<u8>]) -> Vec<f64> {
    found.mattes.iter().zip(truth).map(|(a, b)| judgement::iou(a, b)).collect()
}

fn least(values: &[f64]) -> f64 {
    values.iter().copied().fold(1.0, f64::min)
}

#[test]
fn a_ball_on_a_board_is_found_by_a_hand_held_camera() {
    let stage = Stage::new(false);
    let (pictures, truth) = stage.shots();
    let found = found(&pictures, &stage.setup());
    let ious = ious(&found, &truth);
    assert!(least(&ious) > 0.96, "{ious:?}");
    assert!(least(&found.agreement) > 0.93, "{:?}", found.agreement);
    assert_eq!((found.contradicting, found.findings), (Vec::<usize>::new(), Vec::<String>::new()));
}

#[test]
fn a_ball_on_a_platter_is_found_before_uneven_cloth() {
    let stage = Stage::new(true);
    let (pictures, truth) = stage.shots();
    let found = found(&pictures, &stage.setup());
    let ious = ious(&found, &truth);
    assert!(least(&ious) > 0.96, "{ious:?}");
    assert!(found.contradicting.is_empty(), "{:?}", found.agreement);
    let bounds = found.aabb.unwrap();
    assert!((bounds.max.z - 2.0).abs() < 0.15 && bounds.min.z == 0.0, "{bounds:?}");
}

/// The noise of single dark pixels is all that is left of the room's; the board is brighter.
#[test]
fn gains_come_back_to_a_percent() {
    for (is_turning, tolerance) in [(false, 0.005), (true, 0.012)] {
        let stage = Stage::new(is_turning);
        let setup = stage.setup();
        let given = |i: usize| [1.0 + 0.1 * (i as f64).sin(), 1.0, 1.0 - 0.05 * (1.7 * i as f64).sin()];
        let pictures: Vec<_> = setup.cameras.par_iter().enumerate().map(|(i, c)| stage.shot(c, given(i)).0).collect();
        let thumbnails: Vec<_> = pictures.iter().map(|p| light::thumbnail(p, 1)).collect();
        let bounds = stage::search_box(&setup).unwrap();
        let gains = gains::find(&thumbnails, &setup.cameras, &setup, Some(&bounds));
        for c in 0..3 {
            let products: Vec<f64> = (0..FRAMES).map(|i| gains[i][c] * given(i)[c]).collect();
            let mean = products.iter().sum::<f64>() / FRAMES as f64;
            for p in &products {
                assert!((p / mean - 1.0).abs() < tolerance, "channel {c}, turning {is_turning}: {products:?}");
            }
        }
    }
}

#[test]
fn a_wrong_camera_and_an_empty_frame_are_named() {
    let stage = Stage::new(true);
    let (mut pictures, _) = stage.shots();
    let mut setup = stage.setup();
    setup.cameras[5] = stage.camera(3.0);
    let gone = Stage { center: Point3::new(0.0, 0.0, -50.0), ..stage };
    pictures[13] = gone.shot(&setup.cameras[13], [1.0; 3]).0;
    let found = found(&pictures, &setup);
    assert_eq!(found.contradicting, vec![5, 13], "{:?}", found.agreement);
    assert!(found.findings.iter().any(|f| f.contains("contradict")), "{:?}", found.findings);
}

#[test]
fn the_frame_does_not_carve_what_it_cuts() {
    let stage = Stage { principal: [44.0, 0.0], k1: -0.05, ..Stage::new(true) };
    let (pictures, truth) = stage.shots();
    assert!(truth.iter().any(crate::load::touches_border));
    let found = found(&pictures, &stage.setup());
    let ious = ious(&found, &truth);
    assert!(least(&ious) > 0.94, "{ious:?}");
}

#[test]
fn a_ball_of_the_cloths_colour_is_not_found_and_that_is_said() {
    let stage = Stage { albedo: [0.1, 0.35, 0.12], board: 0.0, ..Stage::new(true) };
    let (pictures, _) = stage.shots();
    let found = found(&pictures, &StageSetup { has_plane: false, ..stage.setup() });
    assert!(!found.findings.is_empty());
}

#[test]
fn without_target_and_still_camera_the_backdrop_decides() {
    let stage = Stage { board: 0.0, ..Stage::new(true) };
    let (pictures, truth) = stage.shots();
    let setup = StageSetup { has_plane: false, segments: vec![None; FRAMES], ..stage.setup() };
    let found = found(&pictures, &setup);
    assert_eq!(found.evidence, Evidence::Backdrop);
    let ious = ious(&found, &truth);
    assert!(least(&ious) > 0.9, "{ious:?}");
}

#[test]
fn given_silhouettes_are_judged() {
    let stage = Stage::new(true);
    let (_, mut truth) = stage.shots();
    truth[7] = truth[7].map(|v| 255 - v);
    let judged = check_silhouettes(&truth, &stage.setup()).unwrap();
    assert_eq!(judged.contradicting, vec![7], "{:?}", judged.agreement);
    assert_eq!(judged.mattes, truth);
    let empty = vec![Image::filled(SIZE.0, SIZE.1, 0); FRAMES];
    assert!(check_silhouettes(&empty, &stage.setup()).unwrap().aabb.is_none());
}

#[test]
fn faults_of_the_setup_are_named() {
    let stage = Stage::new(true);
    let fetch = |_: usize| Ok(Image::filled(SIZE.0, SIZE.1, [0; 3]));
    let short = StageSetup { segments: vec![None], ..stage.setup() };
    let error = find_silhouettes(&fetch, &short, &SilhouetteOptions::default()).unwrap_err();
    assert!(error.to_string().contains("16 cameras for 1 segments"), "{error}");
    let plate = Some(Image::filled(10, 10, [0; 3]));
    let small = StageSetup { clean_plates: vec![plate], ..stage.setup() };
    let error = find_silhouettes(&fetch, &small, &SilhouetteOptions::default()).unwrap_err();
    assert!(error.to_string().contains("the clean plate of segment 0 is 10x10"), "{error}");
}

#[test]
fn black_frames_and_no_frames_have_an_answer() {
    let stage = Stage::new(true);
    let black = vec![Image::filled(SIZE.0, SIZE.1, [0; 3]); FRAMES];
    let answer = found(&black, &stage.setup());
    assert_eq!(answer.mattes.len(), FRAMES);
    assert!(!answer.findings.is_empty());
    assert!(found(&[], &StageSetup::default()).mattes.is_empty());
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let stage = Stage::new(true);
    let (pictures, _) = stage.shots();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| found(&pictures, &stage.setup()))
    };
    let (one, three) = (with(1), with(3));
    assert_eq!((one.mattes, one.agreement, one.gains), (three.mattes, three.agreement, three.gains));
}

/// A straight edge at a known place within the pixel, mixed as a film mixes hues: after encoding.
#[test]
fn coverage_at_the_rim_is_linear_in_encoded_levels() {
    for part in [0.1, 0.3, 0.5, 0.8] {
        let (object, cloth) = ([0.6, 0.3, 0.2], [0.05, 0.4, 0.1]);
        let mixed = |c: usize, alpha: f32| alpha * encoded(object[c]) + (1.0 - alpha) * encoded(cloth[c]);
        let level = |alpha: f32| [0, 1, 2].map(|c| mixed(c, alpha).round() as u8);
        let mut picture = Image::filled(24, 24, level(0.0));
        let mut mask = Image::filled(24, 24, 0);
        for y in 0..24 {
            (0..10).for_each(|x| picture.set(x, y, level(1.0)));
            (0..10).for_each(|x| mask.set(x, y, 255));
            picture.set(10, y, level(part));
        }
        let behind = Image::filled(24, 24, Some(cloth.map(encoded)));
        let matte = rim::refined(&light::Toned::new(picture, &[1.0; 3]), &behind, &mask);
        let coverage = f32::from(matte.at(10, 12)) / 255.0;
        assert!((coverage - part).abs() < 0.02, "{coverage} for {part}");
    }
}

#[test]
fn the_usual_colour_outvotes_a_changing_occluder() {
    let mut samples: Vec<[f32; 3]> = (0..14).map(|i| [15.0 * i as f32, 30.0, 200.0 - 14.0 * i as f32]).collect();
    samples.extend([[90.0, 92.0, 91.0]; 6]);
    let found = cluster::densest(&samples).unwrap();
    assert!((found.colour[1] - 92.0).abs() < 2.0 && found.support >= 6, "{found:?}");
    assert!(cluster::densest(&[]).is_none());
}

#[test]
fn linear_light_and_levels_are_inverse() {
    for level in [0.0, 5.0, 10.3, 128.0, 255.0] {
        assert!((encoded(linear(level)) - level).abs() < 1e-3);
    }
}

/// Numbers that differ, the same every time.
fn scattered(seed: u64, count: usize, range: std::ops::Range<i32>) -> Vec<i32> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        range.start + ((state >> 33) % (range.end - range.start) as u64) as i32
    };
    (0..count).map(|_| next()).collect()
}

#[test]
fn the_cut_is_the_cheapest_of_all() {
    for seed in 0..60 {
        let (width, height) = [(1, 1), (4, 3), (3, 4), (5, 2)][seed as usize % 4];
        let count = width * height;
        let image = |seed, range| Image::from_pixels(width, height, scattered(seed, count, range)).unwrap();
        let inside = image(seed, -9..10);
        let [right, down] = [image(seed + 100, 0..8), image(seed + 200, 0..8)];
        let cost = |labels: &dyn Fn(usize) -> bool| -> i32 {
            let at = |at: usize| {
                let gain = inside.pixels()[at];
                let alone = if labels(at) { (-gain).max(0) } else { gain.max(0) };
                let is_border = |next: usize| labels(at) != labels(next);
                let to_right = !(at + 1).is_multiple_of(width) && is_border(at + 1);
                let to_below = at + width < count && is_border(at + width);
                alone + i32::from(to_right) * right.pixels()[at] + i32::from(to_below) * down.pixels()[at]
            };
            (0..count).map(at).sum()
        };
        let least = (0..1_u32 << count).map(|bits| cost(&|at| bits >> at & 1 == 1)).min().unwrap();
        let found = cut::Cut::new(&inside, &right, &down).inside();
        assert_eq!(cost(&|at| found.pixels()[at]), least, "seed {seed}");
    }
}

#[test]
fn a_cut_of_nothing_is_nothing() {
    let none = Image::filled(0, 0, 0);
    assert!(cut::Cut::new(&none, &none, &none).inside().pixels().is_empty());
}

/// A border between an object of many colours and cloth: single pixels say next to nothing, together they do.
#[test]
fn noise_of_the_object_does_not_fray_its_edge() {
    let cloth = [40, 120, 50];
    let mut picture = Image::filled(40, 40, cloth);
    let levels = scattered(3, 40 * 40, 5..200);
    let mut mask = Image::filled(40, 40, 0);
    for y in 0..40 {
        for x in 0..20 {
            let level = levels[y * 40 + x] as u8;
            picture.set(x, y, [level, level, level / 2 + 40]);
            mask.set(x, y, 255);
        }
    }
    let behind = Image::filled(40, 40, Some(cloth.map(f32::from)));
    let matte = rim::refined(&light::Toned::new(picture, &[1.0; 3]), &behind, &mask);
    for y in 5..35 {
        let edge: f32 = (10..30).map(|x| f32::from(matte.at(x, y)) / 255.0).sum();
        // No pixel of the mask changes sides.
        assert!((edge - 10.0).abs() < 0.5, "row {y}: {edge}");
    }
}

/// A foot as grey as paper in a shadow, and such a shadow.
#[test]
fn a_foot_is_not_taken_for_the_print_beside_it() {
    let (paper, ink, foot) = ([210.0, 208.0, 200.0], [42.0, 42.0, 40.0], [70.0, 62.0, 55.0]);
    let plain = |colour: [f32; 3]| cluster::Cluster { colour, spread: 3.0, support: 9 };
    let places = || (0..120).flat_map(|y| (0..120).map(move |x| (x, y)));
    let dark = |x: usize, y: usize| if (x / 24 + y / 24).is_multiple_of(2) { 0.0 } else { 1.0 };
    let shadow = |x: usize| 1.0 - 0.55 * (-0.5 * ((x as f32 - 96.0) / 12.0).powi(2)).exp();
    let is_foot = |x: usize, y: usize| (52..64).contains(&x) && (52..64).contains(&y);
    let print = |x: usize, y: usize| if dark(x, y) == 0.0 { paper } else { ink }.map(|v: f32| v * shadow(x));
    let texel = |(x, y)| plain(if is_foot(x, y) { foot } else { print(x, y) });
    let samples = |colour: [f32; 3]| std::iter::repeat_n(colour, 8000);
    let around = samples(paper).chain(samples(ink)).chain(samples(paper.map(|v| v * 0.5)));
    let palettes = palette::Palettes {
        object: palette::Palette::learned(samples(foot)),
        surroundings: palette::Palette::learned(around),
    };
    let mut texture = Image::from_pixels(120, 120, places().map(texel).collect()).unwrap();
    let dark: Vec<_> = places().map(|(x, y)| Some(dark(x, y))).collect();
    plates::put_print(&mut texture, &dark, &palettes);
    for (x, y) in places() {
        let (found, truth) = (texture.at(x, y).colour[0], print(x, y)[0]);
        assert!((found - truth).abs() < 4.0 + 0.15 * truth, "{x}, {y}: {found} for {truth}");
    }
}

#[test]
fn what_the_object_shows_near_by_is_likelier_there() {
    let mut picture = Image::filled(160, 80, [200, 40, 30]);
    (0..80).for_each(|y| (80..160).for_each(|x| picture.set(x, y, [45, 42, 40])));
    let everywhere = Image::filled(160, 80, 255);
    let near = nearby::Nearby::of(&light::Toned::new(picture, &[1.0; 3]), &everywhere, 160);
    let all = palette::Palette::anything();
    let at = |x: usize| near.log_density(&[46.0, 40.0, 41.0], x, 40, &all);
    assert!(at(140) > all.log_density(&[46.0, 40.0, 41.0]) + 3.0, "{}", at(140));
    assert!(at(20) < at(140) - 5.0, "{} {}", at(20), at(140));
}

/// The handle of a mug before cloth, and a patch of glaze as green as the cloth: the hull takes both for solid.
#[test]
fn a_hole_is_filled_where_the_object_has_the_colour_seen_in_it() {
    let (cloth, glaze) = ([40, 120, 50], [180, 50, 40]);
    let mut picture = Image::filled(40, 40, cloth);
    let mut hull = Image::filled(40, 40, 0);
    for (x, y) in (8..32).flat_map(|y| (8..32).map(move |x| (x, y))) {
        hull.set(x, y, 255);
        if !(15..25).contains(&x) || !(15..25).contains(&y) {
            picture.set(x, y, glaze);
        }
    }
    let log_odds = picture.map(|p| if p == glaze { 8.0 } else { -8.0 });
    let odds = Odds { log_odds, background: Image::filled(40, 40, Some(cloth.map(f32::from))) };
    let picture = light::Toned::new(picture, &[1.0; 3]);
    for (shown, is_filled) in [(vec![glaze], false), (vec![glaze, cloth], true)] {
        let seen = shown.iter().cycle().take(8000).map(|colour| colour.map(f32::from));
        let palette = palette::Palette::learned(seen);
        let mask = decision::decided(&picture, &odds, &hull, 0.5, Some(&palette));
        assert_eq!(mask.at(20, 20) == 255, is_filled, "{shown:?}");
        assert_eq!((mask.at(10, 20), mask.at(3, 20)), (255, 0));
    }
}

/// Squares show between the legs of an object that is black and white itself, and the hull does not look through there.
#[test]
fn a_hole_is_open_where_the_print_shows_in_it() {
    let (paper, ink, glaze) = ([200, 198, 190], [42, 42, 40], [180, 50, 40]);
    let print =
        Image::from_pixels(40, 40, (0..1600).map(|at| if at / 40 < 20 { paper } else { ink }).collect()).unwrap();
    let (mut picture, mut hull) = (print.clone(), Image::filled(40, 40, 0));
    for (x, y) in (8..32).flat_map(|y| (8..32).map(move |x| (x, y))) {
        hull.set(x, y, 255);
        if !(15..25).contains(&x) || !(15..25).contains(&y) {
            picture.set(x, y, glaze);
        }
    }
    let log_odds = picture.map(|p| if p == glaze { 8.0 } else { -8.0 });
    let odds = Odds { log_odds, background: print.map(|p| Some(p.map(f32::from))) };
    let picture = light::Toned::new(picture, &[1.0; 3]);
    let shown = [paper, ink, glaze].into_iter().cycle().take(9000).map(|colour| colour.map(f32::from));
    let mask = decision::decided(&picture, &odds, &hull, 0.5, Some(&palette::Palette::learned(shown)));
    assert_eq!((mask.at(20, 17), mask.at(20, 23), mask.at(10, 20)), (0, 0, 255));
}

/// Paper and ink in the shadow of something round; where it stands nothing is seen.
#[test]
fn shadow_that_turns_with_the_target_is_known_where_little_of_it_is_seen() {
    let (paper, ink) = ([210.0, 208.0, 200.0], [42.0, 42.0, 40.0]);
    let shadow = |x: usize, y: usize| {
        let squared = (x as f32 - 60.0).powi(2) + (y as f32 - 60.0).powi(2);
        1.0 - 0.7 * (-0.5 * squared / 400.0).exp()
    };
    let places = || (0..120).flat_map(|y| (0..120).map(move |x| (x, y)));
    let print = |x: usize, y: usize| if (x / 12 + y / 12).is_multiple_of(2) { paper } else { ink };
    let hidden = |x: usize, y: usize| (50..70).contains(&x) && (54..66).contains(&y);
    let texel = |(x, y): (usize, usize)| match hidden(x, y) {
        true => cluster::Cluster::COVERED,
        false => cluster::Cluster { colour: print(x, y).map(|v| v * shadow(x, y)), spread: 3.0, support: 9 },
    };
    let seen = Image::from_pixels(120, 120, places().map(texel).collect()).unwrap();
    let printed: Vec<_> = places().map(|(x, y)| Some(print(x, y))).collect();
    let light = contact::Contact::of(&seen, &printed);
    for (x, y) in places() {
        let (found, truth) = (light.at(x, y), shadow(x, y));
        assert!((found - truth).abs() < 0.12, "{x}, {y}: {found} for {truth}");
    }
    // Nothing seen, nothing printed: as in the open.
    let unknown = contact::Contact::of(&Image::filled(20, 20, cluster::Cluster::COVERED), &vec![Some(paper); 400]);
    assert_eq!(unknown.at(10, 10), 1.0);
}

/// A red foot at whose place no frame saw the target: the covered place grows over it, not over paper in shade.
#[test]
fn a_foot_beside_a_covered_place_is_not_taken_for_the_target() {
    let (red, paper) = ([120.0, 20.0, 25.0], [200.0, 198.0, 190.0]);
    let samples = |colour: [f32; 3]| std::iter::repeat_n(colour, 8000);
    let palettes = palette::Palettes {
        object: palette::Palette::learned(samples(red)),
        surroundings: palette::Palette::learned(samples(paper).chain(samples(paper.map(|v| v * 0.7)))),
    };
    let plain = |colour: [f32; 3]| cluster::Cluster { colour, spread: 3.0, support: 9 };
    let mut seen = Image::filled(20, 5, plain(paper.map(|v| v * 0.7)));
    (0..5).for_each(|y| (6..10).for_each(|x| seen.set(x, y, plain(red))));
    (0..5).for_each(|y| (10..14).for_each(|x| seen.set(x, y, cluster::Cluster::COVERED)));
    // What is red elsewhere is printed on the target; of what was never seen nothing is known.
    seen.set(1, 1, plain(red));
    (0..5).for_each(|y| seen.set(14, y, cluster::Cluster::default()));
    plates::cover_feet(&mut seen, &palettes);
    for x in 0..20 {
        assert_eq!(seen.at(x, 1).is_covered(), (6..14).contains(&x), "{x}");
    }
}

/// A white plate on white paper: what is around it has its colour, and is no foot of it.
#[test]
fn paper_of_the_object_s_colour_is_no_foot() {
    let (white, dark) = ([190.0, 190.0, 195.0], [40.0, 42.0, 40.0]);
    let samples = |colour: [f32; 3]| std::iter::repeat_n(colour, 8000);
    let palettes = palette::Palettes {
        object: palette::Palette::learned(samples(white)),
        surroundings: palette::Palette::learned(samples(white).chain(samples(dark))),
    };
    let mut seen = Image::filled(40, 40, cluster::Cluster { colour: white, spread: 3.0, support: 9 });
    let is_under = |x: usize, y: usize| (15..25).contains(&x) && (15..25).contains(&y);
    let places = || (0..40).flat_map(|y| (0..40).map(move |x| (x, y)));
    places().filter(|(x, y)| is_under(*x, *y)).for_each(|(x, y)| seen.set(x, y, cluster::Cluster::COVERED));
    plates::cover_feet(&mut seen, &palettes);
    places().for_each(|(x, y)| assert_eq!(seen.at(x, y).is_covered(), is_under(x, y), "{x} {y}"));
}

/// Few frames look through a loop of rope, so the hull has it filled. Threads of the cloth's colour make a single pixel
/// doubtful, not the hole.
#[test]
fn a_loop_that_the_hull_fills_stays_open() {
    let (cloth, rope) = ([30, 60, 160], [190, 170, 130]);
    let is_hole = |x: usize, y: usize| (30..50).contains(&x) && (30..50).contains(&y);
    let is_rope = |x: usize, y: usize| (10..70).contains(&x) && (10..70).contains(&y) && !is_hole(x, y);
    let mut picture = Image::filled(80, 80, cloth);
    let mut hull = Image::filled(80, 80, 0);
    for (x, y) in (10..70).flat_map(|y| (10..70).map(move |x| (x, y))) {
        hull.set(x, y, 255);
        if is_rope(x, y) {
            picture.set(x, y, rope);
        }
    }
    let log_odds = picture.map(|p| if p == rope { 6.0 } else { -4.5 });
    let odds = Odds { log_odds, background: Image::filled(80, 80, Some(cloth.map(f32::from))) };
    let mask = decision::decided(&light::Toned::new(picture, &[1.0; 3]), &odds, &hull, 0.5, None);
    for (x, y) in (0..80).flat_map(|y| (0..80).map(move |x| (x, y))) {
        assert_eq!(mask.at(x, y) == 255, is_rope(x, y), "{x} {y}");
    }
}

/// Without any camera: the cloth stays, print and ball move.
#[test]
fn what_moves_before_a_still_camera_is_told_without_cameras() {
    let stage = Stage::new(true);
    let (images, truths) = stage.shots();
    let found = find_moving(&|i| Ok(images[i].clone()), FRAMES).unwrap().unwrap();
    for ((camera, truth), moving) in stage.cameras().iter().zip(&truths).zip(&found) {
        let matte = moving.matte();
        let mut turning = truth.clone();
        for (x, y) in (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y))) {
            let ray = camera.ray(Point2::new(x as f64 + 0.5, y as f64 + 0.5)).unwrap();
            let place = ray.origin - ray.direction * (ray.origin.z / ray.direction.z);
            if ray.direction.z < 0.0 && place.coords.norm() < stage.board {
                turning.set(x, y, 255);
            }
        }
        let share = |of: &Image<u8>, is_turning: bool| {
            let places = || of.pixels().iter().zip(matte.pixels()).filter(|(v, _)| (**v >= 128) == is_turning);
            places().filter(|(_, v)| **v >= 128).count() as f64 / places().count() as f64
        };
        let (inside, beside) = (share(&turning, true), share(&crate::matte::grow(&turning, 4.0), false));
        assert!(inside > 0.9 && beside < 0.01, "{inside} {beside}");
    }
    // The same picture for ever, or another each time.
    assert!(find_moving(&|_| Ok(images[0].clone()), FRAMES).unwrap().is_none());
    let carried = |i: usize| Ok(Image::filled(64, 48, [(i * 37 % 256) as u8; 3]));
    assert!(find_moving(&carried, FRAMES).unwrap().is_none());
    assert!(find_moving(&|i| Ok(images[i].clone()), 3).unwrap().is_none());
}

#[test]
fn a_plate_of_another_set_is_unlike_the_border_of_the_frames() {
    let (images, _) = Stage::new(true).shots();
    let set = Stage { radius: 0.0, board: 0.0, ..Stage::new(true) };
    let (plate, _) = set.shot(&set.camera(0.0), [1.0; 3]);
    let like = |plate: &Image<[u8; 3]>| clean_plate_likeness(plate, &images).unwrap();
    assert!(like(&plate) > 0.9, "{}", like(&plate));
    assert_eq!(like(&plate.map(|_| [0; 3])), 0.0);
    assert_eq!(like(&plate.map(|[r, g, b]| [b, r, g])), 0.0);
    assert_eq!(clean_plate_likeness(&Image::filled(5, 5, [0; 3]), &images), None);
}
