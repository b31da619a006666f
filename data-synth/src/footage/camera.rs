//! Where the film's camera stands.

use super::{FootageOptions, set};
use crate::error::SynthError;
use crate::sampler::splitmix;
use crate::turntable::{Station, look_at};
use capture::{Camera, Intrinsics};
use nalgebra::{Point2, Point3, Rotation3, Vector3};
use std::f64::consts::TAU;

/// Focal length in longer sides of the frame: the main lens of a phone.
const FOCAL: f64 = 0.92;
/// Share of the frame the object may fill, in the direction where it fills more.
const FILL: f64 = 0.54;
/// Most the camera leans to either side, in degrees.
const ROLL_DEG: f64 = 1.5;
/// Where the camera looks, in heights of the object.
const AIM: f64 = 0.42;

/// One camera per station, all alike: as far away as fits an object of the given footprint radius and height.
pub(super) fn cameras(
    stations: &[Station],
    [footprint, height]: [f64; 2],
    set_length: f64,
    options: &FootageOptions,
) -> Result<Vec<Camera>, SynthError> {
    let intrinsics = lens(options)?;
    let target = Point3::new(0.0, 0.0, AIM * height);
    let elevation = options.elevation_deg.to_radians();
    let fits = |distance: f64| {
        let camera = look_at(&target, &Station { azimuth: 0.0, elevation }, distance, intrinsics);
        fits(&camera, footprint, height)
    };
    // Never so near that the object's nearest part is beside the lens, never beyond the wall.
    let (mut near, mut far) = (1.3 * footprint.hypot(height), 0.9 * set::WALL * set_length);
    for _ in 0..60 {
        let middle = 0.5 * (near + far);
        if fits(middle) { far = middle } else { near = middle }
    }
    let lean = (splitmix(options.seed ^ splitmix(0x2011)) >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0;
    let roll = Rotation3::from_axis_angle(&Vector3::z_axis(), lean * ROLL_DEG.to_radians()).into_inner();
    let camera = |station: &Station| {
        let level = look_at(&target, station, far, intrinsics);
        Camera { rotation: roll * level.rotation, translation: roll * level.translation, ..level }
    };
    Ok(stations.iter().map(camera).collect())
}

fn lens(options: &FootageOptions) -> Result<Intrinsics, SynthError> {
    let (width, height) = (options.width as f64, options.height as f64);
    let [right, down] = options.principal_offset;
    let focal = FOCAL * width.max(height);
    let intrinsics = Intrinsics {
        fx: focal,
        fy: focal,
        skew: 0.0,
        cx: (0.5 + right) * width,
        cy: (0.5 + down) * height,
        distortion: options.distortion,
        width: options.width,
        height: options.height,
    };
    let corners = [[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]];
    let sees = |[x, y]: [f64; 2]| intrinsics.undistort_pixel(Point2::new(x, y)).is_some();
    if corners.into_iter().all(sees) {
        return Ok(intrinsics);
    }
    let (option, value) = ("distortion", format!("{:?}", options.distortion));
    Err(SynthError::Option { option, value, allowed: "such that a ray goes through every corner".to_owned() })
}

/// Whether a cylinder, in which the object turns, stays within its share of the frame.
fn fits(camera: &Camera, footprint: f64, height: f64) -> bool {
    let i = camera.intrinsics;
    let half = [0.5 * FILL * i.width as f64 / i.fx, 0.5 * FILL * i.height as f64 / i.fy];
    let inside = |p: Point3<f64>| {
        let c = camera.to_camera(&p);
        c.z > 0.0 && (c.x / c.z).abs() <= half[0] && (c.y / c.z).abs() <= half[1]
    };
    let rim = |k: usize, z: f64| {
        let (s, c) = (TAU * k as f64 / 64.0).sin_cos();
        Point3::new(footprint * c, footprint * s, z)
    };
    (0..64).all(|k| inside(rim(k, 0.0)) && inside(rim(k, height)))
}
