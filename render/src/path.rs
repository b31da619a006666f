//! Cameras for a film: around a turntable, or smoothly through key poses.

use capture::{Aabb, Camera, Distortion, Intrinsics};
use nalgebra::{Matrix3, Point3, Quaternion, Rotation3, Unit, UnitQuaternion, Vector3};
use std::f64::consts::TAU;

/// Frames of a turn for which no number is given.
pub const TURN_FRAMES: usize = 72;

/// How much of the frame the corners of the object's box span at most, in width and in height. A round
/// object then fills two thirds of it and a box-shaped one nearly all: 80 % or so for what lies between,
/// and nothing is ever cut off.
const FILL: f64 = 0.95;

/// Without a camera to go by: elevation of the eye above the turntable.
const ELEVATION: f64 = 20.0 / 180.0 * std::f64::consts::PI;

/// Without a camera to go by: focal length over the frame's height, 40° of field.
const FOCAL_PER_HEIGHT: f64 = 1.373_738_709_727_3;

/// `n` pinhole cameras of `width × height` pixels in even steps around the centre of `aabb` about `up`,
/// counter-clockwise seen from above, all at the distance where the box just fits with a margin, so that
/// what is in it fills some 80 % of the frame.
///
/// `like` gives the field of view, the elevation and the first azimuth; its lens distortion is left
/// behind. Without it: 40° vertically, 20° up. A degenerate box, `up` or `like` gives way to a unit
/// box, z and none.
pub fn turntable_cameras(
    aabb: &Aabb,
    like: Option<&Camera>,
    n: usize,
    width: usize,
    height: usize,
    up: Vector3<f64>,
) -> Vec<Camera> {
    let up = usable_axis(up);
    let aabb = usable_box(aabb);
    let like = like.filter(|camera| crate::is_usable(camera));
    let outward = like
        .and_then(|camera| (camera.center() - aabb.center()).try_normalize(0.0))
        .unwrap_or_else(|| default_outward(&up));
    let intrinsics = intrinsics(like, width, height);
    let axis = Unit::new_unchecked(up);
    let directions: Vec<Vector3<f64>> =
        (0..n).map(|i| Rotation3::from_axis_angle(&axis, TAU * i as f64 / n as f64) * outward).collect();
    let orientations: Vec<Matrix3<f64>> = directions.iter().map(|d| looking_inward(d, &up)).collect();
    let distance = orientations.iter().map(|r| framing_distance(&aabb, r, &intrinsics)).fold(0.0, f64::max);
    directions
        .iter()
        .zip(orientations)
        .map(|(direction, rotation)| {
            let eye = aabb.center() + direction * distance;
            Camera { intrinsics, rotation, translation: -(rotation * eye.coords) }
        })
        .collect()
}

/// `n` cameras from the first of `keys` through all to the last, in even steps of time from key to key: eyes, orientations
/// and focal lengths by Catmull–Rom splines (velocity at a key is half the way between its neighbours), orientations as
/// quaternions on one side of the sphere, made unit. Frames are as large as the first key's, without its lens. None without
/// keys; keys that see nothing are left out.
pub fn smooth_cameras(keys: &[Camera], n: usize) -> Vec<Camera> {
    let keys: Vec<&Camera> = keys.iter().filter(|camera| crate::is_usable(camera)).collect();
    let Some(first) = keys.first() else { return Vec::new() };
    let mut turns: Vec<Quaternion<f64>> = Vec::with_capacity(keys.len());
    for key in &keys {
        let rotation = Rotation3::from_matrix(&key.rotation);
        let turn = UnitQuaternion::from_rotation_matrix(&rotation).into_inner();
        // A quaternion and its negative are one rotation: the one nearer to the last.
        let is_far = turns.last().is_some_and(|last| last.coords.dot(&turn.coords) < 0.0);
        turns.push(if is_far { -turn } else { turn });
    }
    let numbers = |k: usize| {
        let (i, eye, turn) = (keys[k].intrinsics, keys[k].center(), turns[k].coords);
        let scale = first.intrinsics.height as f64 / i.height.max(1) as f64;
        [eye.x, eye.y, eye.z, turn.x, turn.y, turn.z, turn.w, i.fx * scale, i.fy * scale]
    };
    let numbers: Vec<[f64; 9]> = (0..keys.len()).map(numbers).collect();
    let last = (keys.len() - 1) as f64;
    let at = |frame: usize| if n > 1 { last * frame as f64 / (n - 1) as f64 } else { 0.0 };
    (0..n).filter_map(|frame| camera_of(&spline(&numbers, at(frame)), &first.intrinsics)).collect()
}

/// The spline through `keys` at `t`, which counts keys; at its ends it runs straight on.
fn spline<const N: usize>(keys: &[[f64; N]], t: f64) -> [f64; N] {
    let last = keys.len() - 1;
    let segment = (t as usize).min(last.saturating_sub(1));
    let s = t - segment as f64;
    let key = |k: isize| keys[k.clamp(0, last as isize) as usize];
    let i = segment as isize;
    let (a, b, c, d) = (key(i - 1), key(i), key(i + 1), key(i + 2));
    std::array::from_fn(|k| {
        let (from, to) = (0.5 * (c[k] - a[k]), 0.5 * (d[k] - b[k]));
        let rise = c[k] - b[k];
        b[k] + s * (from + s * (3.0 * rise - 2.0 * from - to + s * (from + to - 2.0 * rise)))
    })
}

/// `None` where quaternions cancel.
fn camera_of(&[x, y, z, i, j, k, w, fx, fy]: &[f64; 9], like: &Intrinsics) -> Option<Camera> {
    let turn = UnitQuaternion::try_new(Quaternion::new(w, i, j, k), 1e-9)?;
    let rotation = turn.to_rotation_matrix().into_inner();
    let intrinsics = Intrinsics { fx, fy, distortion: Distortion::default(), ..*like };
    Some(Camera { intrinsics, rotation, translation: -(rotation * Vector3::new(x, y, z)) })
}

/// The axis of the turntable that `cameras` were taken on: the normal of the plane through their
/// centres, on the side their pictures call up. Where the centres span no plane (fewer than three,
/// or in one line) or fill space, the mean of the pictures' up directions. `None` without a usable camera.
pub fn up_axis(cameras: &[Camera]) -> Option<Vector3<f64>> {
    let usable: Vec<&Camera> = cameras.iter().filter(|camera| crate::is_usable(camera)).collect();
    if usable.is_empty() {
        return None;
    }
    let share = 1.0 / usable.len() as f64;
    // A picture's up is against its y axis.
    let up = usable.iter().fold(Vector3::zeros(), |sum, c| sum - c.rotation.row(1).transpose()) * share;
    let mean = usable.iter().fold(Vector3::zeros(), |sum, c| sum + c.center().coords) * share;
    let scatter = usable.iter().fold(Matrix3::zeros(), |sum, c| {
        let apart = c.center().coords - mean;
        sum + apart * apart.transpose()
    });
    let fallback = up.try_normalize(1e-6).unwrap_or_else(|| -usable[0].rotation.row(1).transpose());
    let Some(normal) = plane_normal(&scatter) else { return Some(fallback) };
    let side = normal.dot(&up);
    // Centres strewn over a sphere have a normal of chance; so has one that pictures see sideways.
    if side.abs() < 0.1 {
        return Some(fallback);
    }
    Some(normal * side.signum())
}

/// The direction of least scatter, where the points lie in a plane and not in a line.
fn plane_normal(scatter: &Matrix3<f64>) -> Option<Vector3<f64>> {
    if !scatter.iter().all(|x| x.is_finite()) {
        return None;
    }
    let eigen = scatter.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let [least, middle, most] = order.map(|k| eigen.eigenvalues[k].max(0.0));
    let in_line = middle <= 1e-6 * most;
    // A ring at one height has none; two or three rings of a multi-pass capture still tell the axis.
    let in_space = least > 0.25 * middle;
    (!in_line && !in_space).then(|| eigen.eigenvectors.column(order[0]).into_owned())
}

/// Unit; z where it says nothing.
/// The unit axis along `axis`, of any length; z where that is zero or not finite.
pub fn usable_axis(axis: Vector3<f64>) -> Vector3<f64> {
    axis.try_normalize(0.0).filter(|u| u.iter().all(|x| x.is_finite())).unwrap_or_else(Vector3::z)
}

pub(crate) fn usable_box(aabb: &Aabb) -> Aabb {
    let size = aabb.size();
    if size.iter().all(|x| x.is_finite() && *x >= 0.0) && aabb.diagonal() > 0.0 && aabb.diagonal().is_finite() {
        return *aabb;
    }
    Aabb { min: Point3::new(-0.5, -0.5, -0.5), max: Point3::new(0.5, 0.5, 0.5) }
}

/// Towards the eye when nothing says where to begin.
fn default_outward(up: &Vector3<f64>) -> Vector3<f64> {
    // The world axis least along `up`, so that the cross product is well conditioned.
    let axis = Vector3::ith(up.iamin(), 1.0);
    let level = (axis - up * up.dot(&axis)).normalize();
    level * ELEVATION.cos() + up * ELEVATION.sin()
}

fn intrinsics(like: Option<&Camera>, width: usize, height: usize) -> Intrinsics {
    let per_height = like
        .map(|camera| (camera.intrinsics.fy / camera.intrinsics.height as f64).abs())
        .filter(|f| f.is_finite() && *f > 0.0)
        .unwrap_or(FOCAL_PER_HEIGHT);
    let focal = per_height * height as f64;
    Intrinsics::pinhole(focal, [width, height])
}

/// World to camera, from a place in direction `outward` towards the centre, `up` upwards.
pub(crate) fn looking_inward(outward: &Vector3<f64>, up: &Vector3<f64>) -> Matrix3<f64> {
    let forward = -outward;
    // Straight above or below, any direction will do as right.
    let right = forward
        .cross(up)
        .try_normalize(1e-9)
        .unwrap_or_else(|| forward.cross(&Vector3::ith(forward.iamin(), 1.0)).normalize());
    let down = forward.cross(&right);
    Matrix3::from_rows(&[right.transpose(), down.transpose(), forward.transpose()])
}

/// The distance of the eye from the box's centre at which its corners span at most [`FILL`] of the frame.
fn framing_distance(aabb: &Aabb, rotation: &Matrix3<f64>, i: &Intrinsics) -> f64 {
    let half = aabb.size() / 2.0;
    let (reach_x, reach_y) = (FILL * i.width as f64 / 2.0, FILL * i.height as f64 / 2.0);
    (0..8)
        .map(|corner| {
            let sign = |bit: usize| if corner >> bit & 1 == 0 { -1.0 } else { 1.0 };
            let c = rotation * Vector3::new(sign(0) * half.x, sign(1) * half.y, sign(2) * half.z);
            // fx |x| / (d + z) ≤ reach, solved for d.
            (i.fx * c.x.abs() / reach_x).max(i.fy * c.y.abs() / reach_y) - c.z
        })
        .filter(|d| d.is_finite())
        .fold(aabb.diagonal(), f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit_box() -> Aabb {
        Aabb { min: Point3::new(1.0, 2.0, 3.0), max: Point3::new(2.0, 4.0, 3.5) }
    }

    fn corners(aabb: &Aabb) -> Vec<Point3<f64>> {
        let pick = |corner: usize, k: usize| if corner >> k & 1 == 0 { aabb.min[k] } else { aabb.max[k] };
        (0..8).map(|c| Point3::new(pick(c, 0), pick(c, 1), pick(c, 2))).collect()
    }

    #[test]
    fn the_box_fills_the_frame_and_stays_inside() {
        for up in [Vector3::z(), Vector3::y(), Vector3::new(1.0, -2.0, 0.5)] {
            let cameras = turntable_cameras(&unit_box(), None, 12, 320, 200, up);
            let mut widest: f64 = 0.0;
            for camera in &cameras {
                for corner in corners(&unit_box()) {
                    let pixel = camera.project(&corner).unwrap().pixel;
                    widest = widest.max((pixel.x / 160.0 - 1.0).abs()).max((pixel.y / 100.0 - 1.0).abs());
                }
                let r = camera.rotation;
                assert!((r * r.transpose() - Matrix3::identity()).norm() < 1e-12 && r.determinant() > 0.0);
            }
            assert!((widest - FILL).abs() < 1e-9, "{widest}");
        }
    }

    #[test]
    fn the_orbit_continues_the_camera_it_is_like() {
        let first = turntable_cameras(&unit_box(), None, 7, 320, 200, Vector3::y())[2];
        let again = turntable_cameras(&unit_box(), Some(&first), 7, 640, 400, Vector3::y());
        let direction = |c: &Camera| (c.center() - unit_box().center()).normalize();
        assert!((direction(&again[0]) - direction(&first)).norm() < 1e-12);
        assert!((again[0].intrinsics.fx - 2.0 * first.intrinsics.fx).abs() < 1e-9);
    }

    #[test]
    fn a_path_passes_its_keys_without_a_jump() {
        let keys = turntable_cameras(&unit_box(), None, 5, 320, 200, Vector3::z());
        let path = smooth_cameras(&keys, 4 * 30 + 1);
        assert_eq!(path.len(), 121);
        for (k, key) in keys.iter().enumerate() {
            let found = &path[30 * k];
            assert!((found.center() - key.center()).norm() < 1e-9 && (found.rotation - key.rotation).norm() < 1e-9);
        }
        let steps: Vec<f64> = path.windows(2).map(|w| (w[1].center() - w[0].center()).norm()).collect();
        let changes = steps.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
        let mean = steps.iter().sum::<f64>() / steps.len() as f64;
        // Velocity is continuous: of straight lines from key to key it would jump at each.
        assert!(changes < 0.15 * mean, "{changes} of {mean}");
        let turns = path.windows(2).map(|w| (w[1].rotation - w[0].rotation).norm()).fold(0.0, f64::max);
        assert!(turns < 0.1, "{turns}");
        let orthonormal = |c: &Camera| (c.rotation * c.rotation.transpose() - Matrix3::identity()).norm() < 1e-9;
        assert!(path.iter().all(orthonormal));
    }

    #[test]
    fn a_path_of_few_keys_stands_or_goes_straight() {
        let keys = turntable_cameras(&unit_box(), None, 2, 320, 200, Vector3::z());
        assert!(smooth_cameras(&[], 5).is_empty() && smooth_cameras(&keys, 0).is_empty());
        let still = smooth_cameras(&keys[..1], 3);
        assert!(still.len() == 3 && still.iter().all(|c| (c.center() - keys[0].center()).norm() < 1e-9));
        let mut broken = keys.clone();
        broken[0].translation.x = f64::NAN;
        assert!(smooth_cameras(&broken, 3).iter().all(crate::is_usable));
    }

    #[test]
    fn the_axis_of_a_ring_is_found() {
        for up in [Vector3::z(), Vector3::new(0.3, -2.0, 0.5).normalize()] {
            let ring = turntable_cameras(&unit_box(), None, 12, 320, 200, up);
            assert!((up_axis(&ring).unwrap() - up).norm() < 1e-9);
            // Half a turn, and too few for a plane.
            assert!((up_axis(&ring[..5]).unwrap() - up).norm() < 1e-9);
            assert!(up_axis(&ring[..2]).unwrap().dot(&up) > 0.8);
        }
        assert_eq!(up_axis(&[]), None);
    }

    #[test]
    fn degenerate_input_gives_finite_cameras() {
        let point = Aabb { min: Point3::origin(), max: Point3::origin() };
        let nan = Aabb { min: Point3::new(f64::NAN, 0.0, 0.0), max: Point3::origin() };
        let above = turntable_cameras(&unit_box(), None, 1, 9, 9, Vector3::z());
        for aabb in [point, nan, unit_box()] {
            for up in [Vector3::zeros(), Vector3::repeat(f64::NAN), Vector3::x()] {
                for like in [None, above.first()] {
                    for camera in turntable_cameras(&aabb, like, 3, 64, 48, up) {
                        assert!(crate::is_usable(&camera));
                    }
                }
            }
        }
        assert!(turntable_cameras(&unit_box(), None, 0, 64, 48, Vector3::z()).is_empty());
        assert_eq!(turntable_cameras(&unit_box(), None, 2, 0, 0, Vector3::z()).len(), 2);
    }
}
