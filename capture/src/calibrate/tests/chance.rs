//! Turntables by chance: whatever is filmed, it is taken for what it is.

use super::*;
use nalgebra::Vector2;

/// How many; 300 of them are what the documentation tells of.
const RUNS: u64 = 30;

/// A lens, a board that fills some of the picture, a platter that turns unevenly, corners missing and misread.
struct Scene {
    film: Film,
    /// Where the camera is pushed, and how it stands after.
    push: Option<(usize, Isometry3<f64>)>,
    /// Part of the corners that are misread.
    misread: f64,
}

fn scene(chance: &mut Chance) -> Scene {
    let mut within = |from: f64, to: f64| from + (to - from) * chance.uniform();
    let focal = within(0.6, 2.2) * SIZE[0] as f64;
    let distortion = Distortion { k1: within(-0.2, 0.1), k2: within(-0.03, 0.08), ..Distortion::default() };
    let [cx, cy] = [640.0 + within(-26.0, 26.0), 360.0 + within(-26.0, 26.0)];
    let lens = Intrinsics { fx: focal, fy: focal, cx, cy, distortion, ..lens() };
    let distance = 0.25 * focal / (within(0.3, 0.75) * SIZE[1] as f64);
    let tilt = if within(0.0, 1.0) < 0.5 { 0.0 } else { within(0.0, 0.05) };
    let up = Rotation3::from_scaled_axis(Vector3::new(tilt, 0.3 * tilt, 0.0)) * Vector3::z();
    let foot = Point3::new(0.105 + within(-0.05, 0.05), 0.105 + within(-0.05, 0.05), 0.0);
    let frames = within(8.0, 148.0) as usize;
    let turns = within(0.3, 1.6);
    let angles = uneven(frames, turns).into_iter().map(|angle| angle + within(-0.003, 0.003)).collect();
    let camera = look(within(12.0, 85.0), distance, foot, within(-0.05, 0.05));
    let by = 0.001 * within(1.0, 4.0).exp();
    let mut aside = || Vector3::new(within(-by, by), within(-by, by), within(-by, by));
    let pushed = Isometry3::new(distance * aside(), aside()) * camera;
    let at = (within(0.33, 0.67) * frames as f64) as usize;
    let push = (frames > 24 && within(0.0, 1.0) < 0.3).then_some((at, pushed));
    let noise = 0.03 * within(0.0, 2.7).exp();
    let dropped = within(0.0, 0.5);
    let misread = (0.2 * within(-0.5, 0.5)).max(0.0);
    Scene { film: Film { lens, points: board(), axis: (foot, up), camera, angles, noise, dropped }, push, misread }
}

impl Scene {
    fn sightings(&self, chance: &mut Chance, seed: u64) -> Vec<Sighting> {
        let mut sightings = self.film.sightings(seed);
        if let Some((at, camera)) = self.push {
            let after = Film { camera, ..self.film.clone() }.sightings(seed);
            sightings.splice(at.., after.into_iter().skip(at));
        }
        for (_, pixel) in sightings.iter_mut().flat_map(|s| &mut s.corners) {
            if chance.uniform() < self.misread {
                *pixel += Vector2::new(20.0 * chance.normal(), 30.0 * chance.normal());
            }
        }
        sightings
    }
}

#[test]
fn turntables_by_chance_are_taken_for_what_they_are() {
    let mut deviations = 0.0;
    for seed in 0..RUNS {
        let mut chance = Chance(7919 * seed);
        let scene = scene(&mut chance);
        let result = of_board(&scene.sightings(&mut chance, seed), &options());
        let turntable = platter(&result);
        assert_eq!(turntable.segments.len(), if scene.push.is_some() { 2 } else { 1 }, "{seed}: {:?}", result.findings);
        assert!(axis_error_deg(&result, &scene.film) < 0.5, "{seed}: {}", axis_error_deg(&result, &scene.film));
        let used = result.frames.iter().filter(|f| f.standing == Standing::Used).count();
        assert!(used as f64 >= 0.9 * result.frames.len() as f64, "{seed}: {:?}", result.findings);
        let focal = term(&result, LensParameter::Focal);
        deviations += ((focal.value - scene.film.lens.fx) / focal.deviation).powi(2) / RUNS as f64;
    }
    println!("focal lengths are off by {:.2} deviations, RMS", deviations.sqrt());
    assert!((0.5..1.5).contains(&deviations.sqrt()), "{deviations}");
}
