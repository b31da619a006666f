//! The pose of a target in one picture: both answers for a flat one (Collins and Bartoli 2014), and which of them.

use super::homography::{Pair, fit_robust, median};
use super::projection::{linearise, project};
use super::rig::Corner;
use crate::Intrinsics;
use nalgebra::{
    Isometry3, Matrix2, Matrix3, Matrix6, Point2, Point3, Rotation3, SMatrix, SVector, SymmetricEigen, Translation3,
    UnitQuaternion, Vector2, Vector3, Vector6,
};

/// Steps of the refinement; it settles in about five.
const STEPS: usize = 20;
/// Turn between neighbouring pictures that costs as much as one deviation of the corners, in radians.
const USUAL_TURN: f64 = 0.25;
/// Most that a turn or a misfit costs in the choice: pictures need not be neighbours, corners may be misread.
const MOST_COST: f64 = 12.0;

/// A pose that one picture allows.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    /// Target to camera.
    pub(super) pose: Isometry3<f64>,
    /// Of the corners that agree, in pixels.
    pub(super) rms_px: f64,
    /// How many agree.
    pub(super) agreeing: usize,
    /// Whether the target's points count from the opposite end.
    pub(super) is_turned: bool,
}

/// A corner on the target, on the normalised image plane without distortion, and in the picture.
#[derive(Clone, Copy)]
struct Seen {
    point: Point3<f64>,
    at: Vector2<f64>,
    pixel: Point2<f64>,
}

/// The plane of points, as [`plane_near`]; `None` where they do not lie in one, to a hundredth of their extent.
pub(super) fn plane_of(points: &[Point3<f64>]) -> Option<Isometry3<f64>> {
    let plane = plane_near(points)?;
    let offsets = points.iter().map(|p| plane.inverse_transform_point(p).coords);
    let (across, along) =
        offsets.fold((0.0, 0.0), |(across, along), o| (across + o.z * o.z, along + o.xy().norm_squared()));
    (across <= 1e-4 * along).then_some(plane)
}

/// The plane nearest to points: from it to target coordinates; its z is the normal on the side of the target's z.
pub(super) fn plane_near(points: &[Point3<f64>]) -> Option<Isometry3<f64>> {
    let middle = points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / points.len() as f64;
    let spread: Matrix3<f64> = points.iter().map(|p| (p.coords - middle) * (p.coords - middle).transpose()).sum();
    let eigen = SymmetricEigen::try_new(spread, 1e-15, 1000)?;
    let normal: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into();
    let leading = normal.z + 1e-3 * normal.y + 1e-6 * normal.x;
    let normal = if leading < 0.0 { -normal } else { normal };
    let rotation = UnitQuaternion::rotation_between(&Vector3::z(), &normal)?;
    Some(Isometry3::from_parts(middle.into(), rotation))
}

/// Poses that the corners allow, the better first: two where the target is flat, one where it is not; none where too
/// few corners are seen, or only from behind.
pub(super) fn candidates(
    lens: &Intrinsics,
    points: &[Point3<f64>],
    plane: Option<&Isometry3<f64>>,
    corners: &[Corner],
    seed: u64,
) -> Vec<Candidate> {
    let straight = |c: &Corner| {
        let at = lens.distortion.undistort(lens.plane_from_pixel(c.pixel))?;
        Some(Seen { point: points[c.point], at, pixel: c.pixel })
    };
    let seen: Vec<Seen> = corners.iter().filter_map(straight).collect();
    let (poses, agreeing) = match plane {
        Some(plane) => {
            let flat = |s: &Seen| -> Pair { (plane.inverse_transform_point(&s.point).xy(), Point2::from(s.at)) };
            let pairs: Vec<Pair> = seen.iter().map(flat).collect();
            let Some((map, agrees)) = fit_robust(&pairs, seed) else { return Vec::new() };
            let poses = flat_poses(&map, &pairs, &agrees).map(|pose| pose * plane.inverse());
            (poses.to_vec(), agrees)
        }
        None => (solid_pose(&seen).into_iter().collect(), vec![true; seen.len()]),
    };
    let kept: Vec<Seen> = seen.iter().zip(&agreeing).filter(|(_, a)| **a).map(|(s, _)| *s).collect();
    let mut found: Vec<Candidate> = poses.iter().filter_map(|pose| refined(lens, pose, &kept)).collect();
    if let Some(plane) = plane {
        found.retain(|c| is_from_front(&(c.pose * plane)));
    }
    found.sort_by(|a, b| a.rms_px.total_cmp(&b.rms_px));
    found
}

/// Whether a plane's z points towards the camera.
fn is_from_front(pose: &Isometry3<f64>) -> bool {
    (pose.rotation * Vector3::z()).dot(&pose.translation.vector) < 0.0
}

/// The two poses whose perspective near the middle of the pairs is the homography's, in closed form.
fn flat_poses(map: &Matrix3<f64>, pairs: &[Pair], agrees: &[bool]) -> [Isometry3<f64>; 2] {
    let kept = || pairs.iter().zip(agrees).filter(|(_, a)| **a).map(|(pair, _)| pair);
    let middle = kept().map(|(p, _)| p.coords).sum::<Vector2<f64>>() / kept().count().max(1) as f64;
    let shifted = map * Matrix3::new(1.0, 0.0, middle.x, 0.0, 1.0, middle.y, 0.0, 0.0, 1.0);
    let h = shifted / shifted[(2, 2)];
    let p = Vector2::new(h[(0, 2)], h[(1, 2)]);
    // How the image moves with the plane at the middle.
    let jacobian = Matrix2::new(
        h[(0, 0)] - h[(2, 0)] * p.x,
        h[(0, 1)] - h[(2, 1)] * p.x,
        h[(1, 0)] - h[(2, 0)] * p.y,
        h[(1, 1)] - h[(2, 1)] * p.y,
    );
    let sight = Rotation3::rotation_between(&Vector3::z(), &Vector3::new(p.x, p.y, 1.0)).unwrap_or_default();
    let v = sight.matrix();
    let b = Matrix2::new(
        v[(0, 0)] - p.x * v[(2, 0)],
        v[(0, 1)] - p.x * v[(2, 1)],
        v[(1, 0)] - p.y * v[(2, 0)],
        v[(1, 1)] - p.y * v[(2, 1)],
    );
    let a = b.try_inverse().unwrap_or_else(Matrix2::identity) * jacobian;
    let square = a * a.transpose();
    let (sum, difference) = (square[(0, 0)] + square[(1, 1)], square[(0, 0)] - square[(1, 1)]);
    let largest = (0.5 * (sum + difference.hypot(2.0 * square[(0, 1)]))).sqrt();
    let r = a / largest;
    let rest = Matrix2::identity() - r.transpose() * r;
    let (x, y) = (rest[(0, 0)].max(0.0).sqrt(), rest[(1, 1)].max(0.0).sqrt());
    let y = if rest[(0, 1)] < 0.0 { -y } else { y };
    [1.0, -1.0].map(|sign| {
        let first = Vector3::new(r[(0, 0)], r[(1, 0)], sign * x);
        let second = Vector3::new(r[(0, 1)], r[(1, 1)], sign * y);
        let rotation = Matrix3::from_columns(&[first, second, first.cross(&second)]);
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&(v * rotation)));
        let depth = 1.0 / largest;
        let at_middle = Isometry3::from_parts(Translation3::new(p.x * depth, p.y * depth, depth), rotation);
        at_middle * Translation3::new(-middle.x, -middle.y, 0.0)
    })
}

/// The linear pose of a target that is not flat, from six points and more: the right singular vector of the least
/// singular value, made a rotation.
fn solid_pose(seen: &[Seen]) -> Option<Isometry3<f64>> {
    if seen.len() < 6 {
        return None;
    }
    let middle = seen.iter().map(|s| s.point.coords).sum::<Vector3<f64>>() / seen.len() as f64;
    let size = seen.iter().map(|s| (s.point.coords - middle).norm()).sum::<f64>() / seen.len() as f64;
    let mut normal = SMatrix::<f64, 12, 12>::zeros();
    for Seen { point, at, .. } in seen {
        let p = (point.coords - middle) / size;
        for (row, value) in [(0, at.x), (4, at.y)] {
            let mut equation = SVector::<f64, 12>::zeros();
            for (k, v) in [p.x, p.y, p.z, 1.0].into_iter().enumerate() {
                equation[row + k] = v;
                equation[8 + k] = -value * v;
            }
            normal += equation * equation.transpose();
        }
    }
    let eigen = SymmetricEigen::try_new(normal, 1e-15, 1000)?;
    let h = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    let matrix = Matrix3::from_fn(|row, column| h[4 * row + column]);
    let sign = matrix.determinant().signum();
    let svd = matrix.try_svd(true, true, 1e-15, 1000)?;
    let rotation = svd.u? * svd.v_t? * sign;
    let scale = sign * size / (svd.singular_values.sum() / 3.0);
    let translation = Vector3::new(h[3], h[7], h[11]) * scale;
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&rotation));
    let pose = Isometry3::from_parts(translation.into(), rotation) * Translation3::from(-middle);
    pose.translation.vector.iter().all(|v| v.is_finite()).then_some(pose)
}

/// The pose near `start` of least squared distances in pixels, by Levenberg–Marquardt.
fn refined(lens: &Intrinsics, start: &Isometry3<f64>, seen: &[Seen]) -> Option<Candidate> {
    let mut pose = *start;
    let mut cost = cost_of(lens, &pose, seen)?;
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let (normal, gradient) = equations(lens, &pose, seen);
        let mut damped = normal;
        (0..6).for_each(|i| damped[(i, i)] += damping * normal[(i, i)] + 1e-12);
        let next = moved(&pose, &damped.cholesky()?.solve(&gradient));
        match cost_of(lens, &next, seen) {
            Some(tried) if tried < cost => {
                let is_settled = cost - tried < 1e-9 * cost;
                (pose, cost) = (next, tried);
                damping *= 0.2;
                if is_settled {
                    break;
                }
            }
            _ => damping *= 10.0,
        }
    }
    let rms_px = (cost / seen.len() as f64).sqrt();
    Some(Candidate { pose, rms_px, agreeing: seen.len(), is_turned: false })
}

/// Turned by the first three about the camera's axes, then moved by the last three: how a pose is stepped everywhere.
pub(super) fn moved(pose: &Isometry3<f64>, by: &Vector6<f64>) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(by.fixed_rows::<3>(0).into_owned());
    let mut rotation = turn * pose.rotation;
    rotation.renormalize();
    Isometry3::from_parts((pose.translation.vector + by.fixed_rows::<3>(3)).into(), rotation)
}

fn cost_of(lens: &Intrinsics, pose: &Isometry3<f64>, seen: &[Seen]) -> Option<f64> {
    let square = |s: &Seen| Some((project(lens, &(pose * s.point).coords)? - s.pixel).norm_squared());
    seen.iter().map(square).sum()
}

fn equations(lens: &Intrinsics, pose: &Isometry3<f64>, seen: &[Seen]) -> (Matrix6<f64>, Vector6<f64>) {
    let (mut normal, mut gradient) = (Matrix6::zeros(), Vector6::zeros());
    for Seen { point, pixel, .. } in seen {
        let turned = pose.rotation * point.coords;
        let Some(at) = linearise(lens, &(turned + pose.translation.vector)) else { continue };
        let mut rows = SMatrix::<f64, 2, 6>::zeros();
        rows.fixed_columns_mut::<3>(0).copy_from(&(-at.by_point * turned.cross_matrix()));
        rows.fixed_columns_mut::<3>(3).copy_from(&at.by_point);
        normal += rows.transpose() * rows;
        gradient += rows.transpose() * (pixel - at.pixel);
    }
    (normal, gradient)
}

/// One candidate for each picture, so that corners fit and neighbours turn little: the shortest path through them.
/// Pictures without candidates are passed over.
pub(super) fn choose(pictures: &[Vec<Candidate>]) -> Vec<Option<usize>> {
    let least: Vec<f64> = pictures.iter().filter_map(|c| c.first()).map(|c| c.rms_px).collect();
    let noise = median(&least).max(0.05);
    let misfit = |list: &[Candidate], c: &Candidate| {
        let best = list[0].rms_px;
        (c.agreeing as f64 * (c.rms_px.powi(2) - best.powi(2)) / noise.powi(2)).min(MOST_COST)
    };
    let turn =
        |a: &Candidate, b: &Candidate| (a.pose.rotation.angle_to(&b.pose.rotation) / USUAL_TURN).powi(2).min(MOST_COST);
    let seen: Vec<usize> = (0..pictures.len()).filter(|&k| !pictures[k].is_empty()).collect();
    // Cost of the best path to each candidate, and the candidate before it.
    let mut paths: Vec<Vec<(f64, usize)>> = Vec::new();
    for (n, &k) in seen.iter().enumerate() {
        let list = &pictures[k];
        let reach = |c: &Candidate| {
            let own = misfit(list, c);
            let Some(before) = n.checked_sub(1).map(|m| (&pictures[seen[m]], &paths[m])) else { return (own, 0) };
            let ways = before.0.iter().zip(before.1).map(|(b, (cost, _))| cost + own + turn(b, c));
            ways.enumerate().map(|(i, cost)| (cost, i)).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((own, 0))
        };
        paths.push(list.iter().map(reach).collect());
    }
    let mut chosen = vec![None; pictures.len()];
    let Some(last) = paths.last() else { return chosen };
    let ends = last.iter().enumerate().min_by(|a, b| a.1.0.total_cmp(&b.1.0));
    let mut at = ends.map_or(0, |(i, _)| i);
    for (n, &k) in seen.iter().enumerate().rev() {
        chosen[k] = Some(at);
        at = paths[n][at].1;
    }
    chosen
}
