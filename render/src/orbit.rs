//! An eye that goes round an object as somebody drags, flings and holds keys.
//!
//! Speed decays as `e^(−t/τ)` and is integrated in closed form, so the way is the same however many frames it is cut into:
//! `v(t) = p + (v₀ − p) e^(−t/τ)`, `x(t) = x₀ + p t + (v₀ − p) τ (1 − e^(−t/τ))`, p the speed that held keys ask for.

use crate::path::{TURN_FRAMES, looking_inward, turntable_cameras, usable_axis, usable_box};
use capture::{Aabb, Camera, Distortion, Intrinsics};
use nalgebra::{Point3, Vector3};
use std::f64::consts::{PI, TAU};

/// Time constants τ in seconds: of azimuth, elevation, distance.
const COAST_S: [f64; 3] = [0.32, 0.32, 0.11];

/// Over so long the speed of a drag is averaged: who rests before letting go flings nothing.
const GRIP_S: f64 = 0.05;

/// Slower than this, in radians or e-folds a second, is standing still.
const REST: f64 = 2e-3;

/// Highest elevation, either way: at the pole itself a picture has no up.
const STEEPEST: f64 = 89.9 / 180.0 * PI;

/// Nearest and farthest, in distances at which the object just fits the frame.
const ZOOM: [f64; 2] = [0.08, 8.0];

/// Radians that a drag over the height of the frame turns.
const TURN_PER_HEIGHT: f64 = PI;

/// Where the eye is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// About the axis, radians, counter-clockwise from above; 0 at home.
    pub azimuth: f64,
    /// Above the plane across the axis, radians.
    pub elevation: f64,
    /// Distance from the point looked at, in distances at which the object just fits the frame.
    pub zoom: f64,
    /// What is looked at, in the world.
    pub target: Point3<f64>,
}

/// An eye and its motion.
#[derive(Clone, Debug)]
pub struct Orbit {
    aabb: Aabb,
    like: Option<Camera>,
    /// Away from azimuth 0, a quarter turn on, and up: right-handed, unit.
    axes: [Vector3<f64>; 3],
    home: Place,
    place: Place,
    /// A second: radians of azimuth and elevation, e-folds of distance.
    speed: [f64; 3],
}

impl Orbit {
    /// An eye at home: where [`turntable_cameras`] begins a turn of [`TURN_FRAMES`] with the same arguments.
    pub fn new(aabb: &Aabb, like: Option<&Camera>, up: Vector3<f64>) -> Self {
        let (aabb, up) = (usable_box(aabb), usable_axis(up));
        let first = first_of_turn(&aabb, like, up, [1, 1]);
        let outward = -first.forward();
        let level = (outward - up * up.dot(&outward)).try_normalize(1e-9);
        // From straight above, the top of the picture is away from azimuth 0.
        let level = level.unwrap_or_else(|| first.rotation.row(1).transpose());
        let elevation = outward.dot(&up).clamp(-1.0, 1.0).asin().clamp(-STEEPEST, STEEPEST);
        let home = Place { azimuth: 0.0, elevation, zoom: 1.0, target: aabb.center() };
        Self { aabb, like: like.copied(), axes: [level, up.cross(&level), up], home, place: home, speed: [0.0; 3] }
    }

    /// Where the eye is.
    pub fn place(&self) -> Place {
        self.place
    }

    /// The axis it goes round, unit.
    pub fn up(&self) -> Vector3<f64> {
        self.axes[2]
    }

    /// What it sees in a frame of `width × height` pixels.
    pub fn camera(&self, size: [usize; 2]) -> Camera {
        self.camera_at(&self.place, size)
    }

    /// A turn from where the eye is, in `n` even steps counter-clockwise.
    pub fn turn(&self, n: usize, size: [usize; 2]) -> Vec<Camera> {
        let at = |k: usize| Place { azimuth: self.place.azimuth + TAU * k as f64 / n as f64, ..self.place };
        (0..n).map(|k| self.camera_at(&at(k), size)).collect()
    }

    fn camera_at(&self, place: &Place, size: [usize; 2]) -> Camera {
        let first = self.framed(size);
        let outward = self.direction(place.azimuth, place.elevation);
        let rotation = looking_inward(&outward, &self.axes[2]);
        let eye = place.target + outward * (place.zoom * self.fitting_distance(&first));
        Camera { intrinsics: first.intrinsics, rotation, translation: -(rotation * eye.coords) }
    }

    /// The first camera of a turn at home.
    fn framed(&self, size: [usize; 2]) -> Camera {
        first_of_turn(&self.aabb, self.like.as_ref(), self.axes[2], size)
    }

    fn fitting_distance(&self, first: &Camera) -> f64 {
        (self.home.target - first.center()).norm()
    }

    /// The unit direction at these angles, in radians, in the world.
    pub fn direction(&self, azimuth: f64, elevation: f64) -> Vector3<f64> {
        let [level, across, up] = self.axes;
        let ((sin_a, cos_a), (sin_e, cos_e)) = (azimuth.sin_cos(), elevation.sin_cos());
        (level * cos_a + across * sin_a) * cos_e + up * sin_e
    }

    /// The object follows a pointer that moved by so many pixels (right, down) of a frame `height` high within `dt` seconds;
    /// a wheel that was turned goes on.
    pub fn drag(&mut self, [right, down]: [f64; 2], height: usize, dt: f64) {
        let turn = TURN_PER_HEIGHT / height.max(1) as f64;
        let moved = [-right * turn, down * turn];
        let folds = self.coast(2, dt, 0.0);
        self.add([moved[0], moved[1], folds]);
        let share = if dt > 0.0 { -(-dt / GRIP_S).exp_m1() } else { 0.0 };
        for k in 0..2 {
            let now = if dt > 0.0 { moved[k] / dt } else { 0.0 };
            self.speed[k] += share * (now - self.speed[k]);
        }
    }

    /// Lets `dt` seconds pass while nobody drags; `push` is the speed that held keys ask for, as the eye's own: radians of
    /// azimuth and elevation, e-folds of distance a second.
    pub fn advance(&mut self, dt: f64, push: [f64; 3]) {
        let way = [0, 1, 2].map(|k| self.coast(k, dt, push[k]));
        self.add(way);
        if push == [0.0; 3] && self.speed.iter().all(|v| v.abs() < REST) {
            self.speed = [0.0; 3];
        }
    }

    /// The way of one coordinate in `dt` seconds towards the speed `push`, which becomes its own.
    fn coast(&mut self, k: usize, dt: f64, push: f64) -> f64 {
        let (left, over) = ((-dt / COAST_S[k]).exp(), self.speed[k] - push);
        self.speed[k] = push + over * left;
        push * dt + over * COAST_S[k] * (1.0 - left)
    }

    /// Comes nearer by `steps` notches of a wheel, softly; negative goes away.
    pub fn wheel(&mut self, steps: f64) {
        self.speed[2] -= 0.16 * steps / COAST_S[2];
    }

    /// Comes nearer by this factor at once, as fingers on a touchpad say.
    pub fn pinch(&mut self, factor: f64) {
        if factor > 0.0 && factor.is_finite() {
            self.add([0.0, 0.0, -factor.ln()]);
        }
    }

    /// The object follows a pointer sideways: pixels (right, down) of a frame of `size`. It stays within reach.
    pub fn pan(&mut self, [right, down]: [f64; 2], size: [usize; 2]) {
        let camera = self.camera(size);
        let per_pixel = (camera.center() - self.place.target).norm() / camera.intrinsics.fy;
        let [x, y] = [0, 1].map(|row| camera.rotation.row(row).transpose());
        let target = self.place.target - (x * right + y * down) * per_pixel;
        let (apart, reach) = (target - self.home.target, self.aabb.diagonal());
        if apart.norm() <= reach {
            self.place.target = target;
        } else if let Some(direction) = apart.try_normalize(0.0).filter(|d| d.x.is_finite()) {
            self.place.target = self.home.target + direction * reach;
        }
    }

    /// Back to where it began, at rest.
    pub fn go_home(&mut self) {
        (self.place, self.speed) = (self.home, [0.0; 3]);
    }

    /// Looks from where `camera` does at what is on its axis beside the middle of the object, as large as there; without
    /// its roll, lens and principal point. One that does not look at the object is left alone.
    pub fn look_as(&mut self, camera: &Camera) {
        let (eye, forward) = (camera.center(), camera.forward());
        let depth = (self.home.target - eye).dot(&forward);
        let i = &camera.intrinsics;
        let first = self.framed([i.width, i.height]);
        let zoom = depth * first.intrinsics.fy / (i.fy.abs() * self.fitting_distance(&first));
        let [level, across, up] = self.axes;
        let elevation = -forward.dot(&up).clamp(-1.0, 1.0).asin();
        let azimuth = (-forward.dot(&across)).atan2(-forward.dot(&level));
        if depth > 0.0 && [zoom, elevation, azimuth].iter().all(|x| x.is_finite()) {
            self.place = Place { azimuth, elevation, zoom, target: eye + forward * depth };
            self.speed = [0.0; 3];
            self.add([0.0; 3]);
        }
    }

    /// Whether the next [`Orbit::advance`] without a push would change anything.
    pub fn is_moving(&self) -> bool {
        self.speed != [0.0; 3]
    }

    /// Moves on, up to the limits, where it stops.
    fn add(&mut self, [azimuth, elevation, folds]: [f64; 3]) {
        if ![azimuth, elevation, folds].iter().all(|x| x.is_finite()) {
            self.speed = [0.0; 3];
            return;
        }
        let place = &mut self.place;
        place.azimuth = (place.azimuth + azimuth).rem_euclid(TAU);
        let (steep, zoom) = (place.elevation + elevation, place.zoom * folds.exp());
        place.elevation = steep.clamp(-STEEPEST, STEEPEST);
        place.zoom = zoom.clamp(ZOOM[0], ZOOM[1]);
        if place.elevation != steep {
            self.speed[1] = 0.0;
        }
        if place.zoom != zoom {
            self.speed[2] = 0.0;
        }
    }
}

fn first_of_turn(aabb: &Aabb, like: Option<&Camera>, up: Vector3<f64>, [width, height]: [usize; 2]) -> Camera {
    turntable_cameras(aabb, like, TURN_FRAMES, width.max(1), height.max(1), up)[0]
}

/// The whole picture of `camera` in the middle of a frame of `size`, as large as it fits, without the lens.
pub fn contained(camera: &Camera, [width, height]: [usize; 2]) -> Camera {
    let i = &camera.intrinsics;
    let [across, down] = [width as f64 / i.width.max(1) as f64, height as f64 / i.height.max(1) as f64];
    let scale = across.min(down);
    let intrinsics = Intrinsics {
        fx: i.fx * scale,
        fy: i.fy * scale,
        skew: i.skew * scale,
        cx: 0.5 * width as f64 + (i.cx - 0.5 * i.width as f64) * scale,
        cy: 0.5 * height as f64 + (i.cy - 0.5 * i.height as f64) * scale,
        distortion: Distortion::default(),
        width,
        height,
    };
    Camera { intrinsics, ..*camera }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn orbit() -> Orbit {
        let aabb = Aabb { min: Point3::new(1.0, 2.0, 3.0), max: Point3::new(2.0, 4.0, 3.5) };
        Orbit::new(&aabb, None, Vector3::z())
    }

    fn apart(a: &Camera, b: &Camera) -> f64 {
        (a.rotation - b.rotation).norm() + (a.translation - b.translation).norm()
    }

    #[test]
    fn home_and_a_turn_from_it_are_those_of_a_turntable() {
        let like = turntable_cameras(&orbit().aabb, None, 5, 30, 20, Vector3::new(0.2, 0.1, 1.0))[3];
        for (like, up) in [(None, Vector3::z()), (Some(&like), Vector3::new(0.2, 0.1, 1.0)), (None, -Vector3::y())] {
            let orbit = Orbit::new(&orbit().aabb, like, up);
            for size in [[640, 480], [300, 700]] {
                let table = turntable_cameras(&orbit.aabb, like, TURN_FRAMES, size[0], size[1], up);
                for (a, b) in orbit.turn(TURN_FRAMES, size).iter().zip(&table) {
                    assert!(apart(a, b) < 1e-9 && a.intrinsics == b.intrinsics);
                }
            }
        }
    }

    #[test]
    fn a_fling_goes_as_far_at_30_as_at_240_frames_a_second() {
        let end = |fps: f64| {
            let mut orbit = orbit();
            // A drag that speeds up and is let go at full speed, 0.2 s; then half a second of a held key; then coasting.
            let steps = (0.2 * fps) as usize;
            let at = |k: usize| 500.0 * (k as f64 / fps).powi(2);
            (0..steps).for_each(|k| orbit.drag([at(k + 1) - at(k), 0.0], 480, 1.0 / fps));
            orbit.wheel(1.0);
            (0..(0.5 * fps) as usize).for_each(|_| orbit.advance(1.0 / fps, [0.5, 0.0, 0.0]));
            (0..(4.0 * fps) as usize).for_each(|_| orbit.advance(1.0 / fps, [0.0; 3]));
            assert!(!orbit.is_moving());
            orbit.place()
        };
        let (slow, fast) = (end(30.0), end(240.0));
        // The speed at the end of the drag is an average over frames; all after it is exact.
        assert!((slow.azimuth - fast.azimuth).abs() < 0.02, "{slow:?} {fast:?}");
        assert!((slow.zoom - fast.zoom).abs() < 1e-3, "{slow:?} {fast:?}");
        let coasted = |fps: f64| {
            let mut orbit = orbit();
            orbit.speed = [2.0, -0.3, 1.0];
            (0..(1.0 * fps) as usize).for_each(|_| orbit.advance(1.0 / fps, [0.2, 0.0, 0.0]));
            (orbit.place().azimuth, orbit.place().elevation, orbit.place().zoom)
        };
        let (slow, fast) = (coasted(30.0), coasted(240.0));
        assert!(
            (slow.0 - fast.0).abs() + (slow.1 - fast.1).abs() + (slow.2 - fast.2).abs() < 1e-9,
            "{slow:?} {fast:?}"
        );
    }

    #[test]
    fn a_fling_coasts_as_far_as_its_speed_and_time_constant_say() {
        let mut orbit = orbit();
        orbit.speed[0] = 1.5;
        (0..600).for_each(|_| orbit.advance(0.01, [0.0; 3]));
        assert!((orbit.place().azimuth - 1.5 * COAST_S[0]).abs() < REST, "{:?}", orbit.place());
    }

    #[test]
    fn a_wheel_comes_as_near_during_a_drag() {
        let (mut dragged, mut free) = (orbit(), orbit());
        dragged.wheel(2.0);
        free.wheel(2.0);
        for _ in 0..50 {
            dragged.drag([3.0, 1.0], 480, 0.01);
            free.advance(0.01, [0.0; 3]);
        }
        let (zoom, known) = (dragged.place().zoom, free.place().zoom);
        assert!(known < 0.8 && (zoom - known).abs() < 1e-3, "{zoom} {known}");
    }

    #[test]
    fn whoever_rests_before_letting_go_flings_nothing() {
        let mut orbit = orbit();
        (0..10).for_each(|_| orbit.drag([20.0, 0.0], 480, 0.01));
        assert!(orbit.is_moving());
        (0..60).for_each(|_| orbit.drag([0.0, 0.0], 480, 0.01));
        orbit.advance(0.01, [0.0; 3]);
        assert!(!orbit.is_moving());
    }

    #[test]
    fn poles_and_zoom_limits_stop_it_and_no_camera_breaks() {
        let mut orbit = orbit();
        for (right, down, steps) in [(3.0, 40.0, 3.0), (-5.0, -90.0, -7.0)] {
            for _ in 0..100 {
                orbit.drag([right, down], 480, 0.01);
                orbit.wheel(steps);
                orbit.advance(0.02, [0.1, down, steps]);
                let camera = orbit.camera([64, 48]);
                assert!(camera.center().iter().chain(camera.rotation.iter()).all(|x| x.is_finite()));
                assert!((camera.rotation.determinant() - 1.0).abs() < 1e-9);
                // Up stays up in the picture, however near the pole.
                assert!(camera.rotation.row(1).transpose().dot(&orbit.up()) < 0.0);
            }
            let place = orbit.place();
            assert_eq!(place.elevation.abs(), STEEPEST);
            assert!(place.zoom == ZOOM[0] || place.zoom == ZOOM[1], "{place:?}");
            (0..200).for_each(|_| orbit.advance(0.02, [0.0; 3]));
            assert!(!orbit.is_moving());
        }
        for bad in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
            let before = orbit.place();
            orbit.pinch(bad);
            assert_eq!(orbit.place(), before);
        }
        orbit.drag([f64::NAN, 0.0], 0, 0.0);
        assert!(orbit.place().azimuth.is_finite() && !orbit.is_moving());
    }

    #[test]
    fn panning_moves_the_object_with_the_pointer_and_no_further_than_its_size() {
        let mut orbit = orbit();
        let point = orbit.place().target;
        let before = orbit.camera([640, 480]).project(&point).unwrap().pixel;
        orbit.pan([30.0, -12.0], [640, 480]);
        let after = orbit.camera([640, 480]).project(&point).unwrap().pixel;
        assert!((after - before - nalgebra::Vector2::new(30.0, -12.0)).norm() < 1e-6, "{before} {after}");
        (0..99).for_each(|_| orbit.pan([500.0, 0.0], [640, 480]));
        assert!((orbit.place().target - point).norm() < 1.0001 * orbit.aabb.diagonal());
        orbit.go_home();
        assert_eq!(orbit.place(), orbit.home);
    }

    #[test]
    fn it_looks_as_an_upright_camera_does() {
        let mut orbit = orbit();
        for camera in turntable_cameras(&orbit.aabb, None, 9, 320, 240, Vector3::z()) {
            orbit.look_as(&camera);
            assert!(apart(&orbit.camera([320, 240]), &camera) < 1e-9);
            orbit.wheel(2.0);
        }
        let before = orbit.place();
        let mut away = orbit.camera([320, 240]);
        away.translation.z = -9.0;
        orbit.look_as(&away);
        assert_eq!(orbit.place(), before, "a camera that looks away is no place");
    }

    #[test]
    fn a_picture_is_contained_whole_and_in_the_middle() {
        let camera = turntable_cameras(&orbit().aabb, None, 1, 320, 240, Vector3::z())[0];
        for (size, corner) in [([640, 480], [0.0, 0.0]), ([640, 240], [160.0, 0.0]), ([320, 480], [0.0, 120.0])] {
            let fitted = contained(&camera, size);
            let ray = camera.ray(nalgebra::Point2::origin()).unwrap();
            let pixel = fitted.project(&(ray.origin + ray.direction * 3.0)).unwrap().pixel;
            assert!((pixel - nalgebra::Point2::from(corner)).norm() < 1e-9, "{size:?}: {pixel}");
        }
        assert_eq!(contained(&camera, [320, 240]), camera);
    }
}
