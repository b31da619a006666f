//! The axis of a platter from the poses of what lies on it, and when the camera before it was moved.

use super::homography::median;
use super::pose::moved;
use super::projection::{linearise, project};
use super::rig::{Corner, Picture, Poses, Rig, Turning, turned};
use nalgebra::{
    Isometry3, Matrix3, Matrix6, Point3, Rotation3, SymmetricEigen, Translation3, UnitQuaternion, Vector2, Vector3,
    Vector6,
};
use std::f64::consts::{PI, TAU};

/// Turn between two poses below which they say nothing of an axis, in radians.
const LEAST_TURN: f64 = 0.05;
/// Steps between pictures whose poses are compared.
const STEPS: [usize; 9] = [1, 2, 3, 5, 8, 13, 21, 34, 55];
/// Fewest pictures between two moves of a camera.
pub(super) const SHORTEST: usize = 5;
/// A jump of the axis before the camera, in deviations of its change from picture to picture, and ...
const JUMP: f64 = 12.0;
/// ... in pixels at the rim of the target, is a camera that was moved. Smaller ones are found in the corners.
const JUMP_PX: f64 = 5.0;
/// Part of the misfit that a move of the camera must explain, and ...
const EXPLAINED: f64 = 0.1;
/// ... how many squared deviations of a corner.
const LEAST_GAIN: f64 = 50.0;
/// Rounds of reweighting.
const ROUNDS: usize = 8;

/// A line in target coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    pub(super) point: Point3<f64>,
    pub(super) direction: Vector3<f64>,
}

/// Pairs of pictures of one film.
fn pairs(pictures: &[Picture]) -> Vec<(usize, usize)> {
    let seen: Vec<usize> = (0..pictures.len()).filter(|&k| pictures[k].is_used).collect();
    let pair = |n: usize, step: usize| Some((*seen.get(n)?, *seen.get(n + step)?));
    let all = (0..seen.len()).flat_map(|n| STEPS.into_iter().filter_map(move |step| pair(n, step)).collect::<Vec<_>>());
    all.filter(|&(a, b)| pictures[a].film == pictures[b].film).collect()
}

/// The largest turn between two pictures of one film, in radians.
pub(super) fn largest_turn(poses: &[Isometry3<f64>], pictures: &[Picture]) -> f64 {
    pairs(pictures).iter().map(|&(a, b)| poses[a].rotation.angle_to(&poses[b].rotation)).fold(0.0, f64::max)
}

/// The line about which the target turns between pictures, robustly: its direction is the eigenvector of the turns'
/// axes weighted by `sin²` of half the turn, its point what the motions leave where it is. `None` if nothing turns.
pub(super) fn axis(poses: &[Isometry3<f64>], pictures: &[Picture]) -> Option<Axis> {
    let motions: Vec<Isometry3<f64>> = pairs(pictures).iter().map(|&(a, b)| poses[a].inv_mul(&poses[b])).collect();
    let turns: Vec<(Isometry3<f64>, Vector3<f64>, f64)> = motions
        .iter()
        .filter(|motion| motion.rotation.angle() > LEAST_TURN)
        .filter_map(|m| Some((*m, m.rotation.axis()?.into_inner(), (0.5 * m.rotation.angle()).sin().powi(2))))
        .collect();
    let mut direction = None;
    let mut weights: Vec<f64> = turns.iter().map(|t| t.2).collect();
    for _ in 0..ROUNDS {
        let sum: Matrix3<f64> = turns.iter().zip(&weights).map(|((_, n, _), w)| *w * n * n.transpose()).sum();
        let eigen = SymmetricEigen::try_new(sum, 1e-15, 1000)?;
        let a: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into();
        let deviations: Vec<f64> = turns.iter().map(|(_, n, _)| n.cross(&a).norm()).collect();
        let scale = (2.0 * 1.4826 * median(&deviations)).max(0.005);
        weights = turns.iter().zip(deviations).map(|(t, d)| t.2 / (1.0 + (d / scale).powi(2)).powi(2)).collect();
        direction = (!turns.is_empty()).then_some(a);
    }
    let direction = direction?;
    let mut point = Vector3::zeros();
    for _ in 0..ROUNDS {
        let mut normal = direction * direction.transpose() * weights.iter().sum::<f64>();
        let mut right = Vector3::zeros();
        for ((motion, ..), w) in turns.iter().zip(&weights) {
            let moving = Matrix3::identity() - motion.rotation.to_rotation_matrix().into_inner();
            normal += *w * moving.transpose() * moving;
            right += *w * moving.transpose() * motion.translation.vector;
        }
        point = normal.try_inverse()? * right;
        let misses: Vec<f64> =
            turns.iter().map(|(m, ..)| (m.transform_point(&point.into()).coords - point).norm()).collect();
        let scale = (2.0 * 1.4826 * median(&misses)).max(1e-9 * point.norm().max(1e-9));
        weights = turns.iter().zip(misses).map(|(t, d)| t.2 / (1.0 + (d / scale).powi(2)).powi(2)).collect();
    }
    Some(Axis { point: point.into(), direction })
}

/// World axes on a turning axis: z along it, out of the target's plane, the origin where it meets that plane, x the
/// target's (or its y, along whose x the axis is). An axis along the plane is met where it is nearest to the points'
/// middle.
pub(super) fn world_from_target(axis: &Axis, plane: Option<&Isometry3<f64>>, points: &[Point3<f64>]) -> Isometry3<f64> {
    let middle = points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / points.len().max(1) as f64;
    let normal = plane.map_or(Vector3::z(), |plane| plane.rotation * Vector3::z());
    let up = axis.direction.dot(&normal);
    let z = if up < 0.0 { -axis.direction } else { axis.direction };
    let from = middle - axis.point.coords;
    let along = if up.abs() > 0.2 { from.dot(&normal) / z.dot(&normal) } else { from.dot(&z) };
    let origin = axis.point.coords + along * z;
    let lead = if z.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let x = (lead - z * lead.dot(&z)).normalize();
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, z.cross(&x), z]).transpose());
    let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
    Isometry3::from_parts(Translation3::identity(), rotation) * Translation3::from(-origin)
}

/// The pictures from which on a camera stands elsewhere: the first of each film, and those at which the axis jumps, as
/// free poses show it.
pub(super) fn starts(
    axis: &Axis,
    poses: &[Isometry3<f64>],
    pictures: &[Picture],
    focal: f64,
    reach: f64,
) -> Vec<usize> {
    let places: Vec<[f64; 6]> = poses.iter().map(|pose| place(axis, pose, reach)).collect();
    let mut starts = Vec::new();
    let mut first = 0;
    while first < pictures.len() {
        let length = pictures[first..].iter().take_while(|p| p.film == pictures[first].film).count();
        starts.push(first);
        split(&places, pictures, first..first + length, focal, &mut starts);
        first += length;
    }
    starts
}

/// A platter that turns about the axis, as free poses show it, with a segment from each start.
pub(super) fn initial(
    axis: &Axis,
    world_from_target: Isometry3<f64>,
    poses: &[Isometry3<f64>],
    pictures: &[Picture],
    reach: f64,
    starts: &[usize],
) -> Turning {
    let places: Vec<[f64; 6]> = poses.iter().map(|pose| place(axis, pose, reach)).collect();
    let mut turning = Turning {
        world_from_target,
        segments: Vec::new(),
        references: Vec::new(),
        segment_of: vec![0; pictures.len()],
        angles: vec![0.0; pictures.len()],
    };
    let mut bounds = starts.to_vec();
    bounds.push(pictures.len());
    bounds.sort_unstable();
    for range in bounds.windows(2) {
        add_segment(&mut turning, &places, poses, pictures, range[0]..range[1]);
    }
    turning
}

/// Where the axis stands before a camera: its point, and its direction times the target's reach.
fn place(axis: &Axis, pose: &Isometry3<f64>, reach: f64) -> [f64; 6] {
    let (p, d) = (pose * axis.point, pose.rotation * axis.direction * reach);
    [p.x, p.y, p.z, d.x, d.y, d.z]
}

/// The positions in a range at which the axis jumps, largest jump first, each with enough pictures on both sides.
fn split(
    places: &[[f64; 6]],
    pictures: &[Picture],
    range: std::ops::Range<usize>,
    focal: f64,
    starts: &mut Vec<usize>,
) {
    let seen: Vec<usize> = range.clone().filter(|&k| pictures[k].is_used).collect();
    if seen.len() < 2 * SHORTEST {
        return;
    }
    let middle = |window: &[usize], axis: usize| median(&window.iter().map(|&k| places[k][axis]).collect::<Vec<_>>());
    let depth = middle(&seen, 2).abs().max(1e-12);
    let noise: Vec<f64> = (0..6)
        .map(|axis| {
            let changes = seen.windows(2).map(|w| (places[w[1]][axis] - places[w[0]][axis]).abs());
            median(&changes.collect::<Vec<_>>()).max(1e-7 * depth)
        })
        .collect();
    let jump = |n: usize| {
        let step = |axis: usize| middle(&seen[n..n + SHORTEST], axis) - middle(&seen[n - SHORTEST..n], axis);
        let worst = (0..6).map(|axis| step(axis).abs() / noise[axis]).fold(0.0, f64::max);
        let pixels = (0..6).filter(|axis| *axis != 2).map(|axis| step(axis).abs()).fold(0.0, f64::max) * focal / depth;
        if pixels > JUMP_PX { worst } else { 0.0 }
    };
    let jumps = (SHORTEST..=seen.len() - SHORTEST).map(|n| (n, jump(n)));
    let Some((at, most)) = jumps.max_by(|a, b| a.1.total_cmp(&b.1)) else { return };
    if most < JUMP {
        return;
    }
    // The windows reach over the jump on both sides: the largest single step near it is where it is.
    let near = at.saturating_sub(SHORTEST).max(1)..(at + SHORTEST).min(seen.len());
    let step = |n: usize| (0..6).map(|a| ((places[seen[n]][a] - places[seen[n - 1]][a]) / noise[a]).powi(2)).sum();
    let at = near.map(|n| (n, step(n))).max_by(|a: &(_, f64), b| a.1.total_cmp(&b.1)).map_or(at, |(n, _)| n);
    if at < SHORTEST || seen.len() - at < SHORTEST {
        return;
    }
    starts.push(seen[at]);
    split(places, pictures, range.start..seen[at], focal, starts);
    split(places, pictures, seen[at]..range.end, focal, starts);
}

fn add_segment(
    turning: &mut Turning,
    places: &[[f64; 6]],
    poses: &[Isometry3<f64>],
    pictures: &[Picture],
    range: std::ops::Range<usize>,
) {
    let used: Vec<usize> = range.clone().filter(|&k| pictures[k].is_used).collect();
    let middle: Vec<f64> =
        (0..6).map(|axis| median(&used.iter().map(|&k| places[k][axis]).collect::<Vec<_>>())).collect();
    let distance = |k: &usize| (0..6).map(|axis| (places[*k][axis] - middle[axis]).powi(2)).sum::<f64>();
    let reference = used.iter().copied().min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(range.start);
    let target_from_world = turning.world_from_target.inverse();
    let segment = poses[reference] * target_from_world;
    for k in range {
        turning.segment_of[k] = turning.segments.len();
        if pictures[k].is_used {
            turning.angles[k] = angle_about_z(&(segment.inverse() * poses[k] * target_from_world).rotation);
        }
    }
    turning.segments.push(segment);
    turning.references.push(reference);
}

/// The turn about z that is nearest to a rotation.
fn angle_about_z(rotation: &UnitQuaternion<f64>) -> f64 {
    let m = rotation.to_rotation_matrix();
    (m[(1, 0)] - m[(0, 1)]).atan2(m[(0, 0)] + m[(1, 1)])
}

/// Where a camera was most likely moved in the middle of a segment: by how much a second pose from there on would lower
/// the squared misfit, by one Gauss–Newton step on robust weights (the score test, Rao 1948). `None` if nowhere by much.
pub(super) fn likeliest_move(rig: &Rig, pictures: &[Picture], noise: f64) -> Option<usize> {
    let Poses::Turning(turning) = &rig.poses else { return None };
    let scores: Vec<Score> = (0..pictures.len()).map(|k| score(rig, turning, &pictures[k], k, noise)).collect();
    let mut best = (0.0, None);
    for segment in 0..turning.segments.len() {
        let members: Vec<usize> = (0..pictures.len()).filter(|&k| turning.segment_of[k] == segment).collect();
        let total = members.iter().map(|&k| scores[k]).fold(Score::default(), Score::plus);
        let mut before = Score::default();
        for (n, &k) in members.iter().enumerate() {
            let after =
                Score { information: total.information - before.information, pull: total.pull - before.pull, ..total };
            let gain = before.gain() + after.gain() - total.gain();
            let is_long = n >= SHORTEST && members.len() - n >= SHORTEST;
            if is_long && gain > best.0 && gain > EXPLAINED * total.cost && gain > LEAST_GAIN * noise * noise {
                best = (gain, Some(k));
            }
            before = before.plus(scores[k]);
        }
    }
    best.1
}

/// What one picture says of the pose of its segment, whatever its angle is.
#[derive(Clone, Copy, Default)]
struct Score {
    information: Matrix6<f64>,
    pull: Vector6<f64>,
    cost: f64,
}

impl Score {
    fn plus(self, other: Self) -> Self {
        Self {
            information: self.information + other.information,
            pull: self.pull + other.pull,
            cost: self.cost + other.cost,
        }
    }

    /// Squared misfit that a step of the pose takes away.
    fn gain(&self) -> f64 {
        let mut damped = self.information;
        (0..6).for_each(|i| damped[(i, i)] = damped[(i, i)] * (1.0 + 1e-9) + 1e-12);
        damped.cholesky().map_or(0.0, |factor| self.pull.dot(&factor.solve(&self.pull)))
    }
}

fn score(rig: &Rig, turning: &Turning, picture: &Picture, k: usize, noise: f64) -> Score {
    let camera = &turning.segments[turning.segment_of[k]];
    let platter = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turning.angles[k]);
    let mut sum = Score::default();
    let (mut coupling, mut own, mut pull) = (Vector6::zeros(), 0.0, 0.0);
    for corner in &picture.corners {
        let on_platter = platter * (turning.world_from_target * rig.shape.point(corner.point)).coords;
        let tilted = camera.rotation * on_platter;
        let Some(at) = linearise(&rig.lens, &(tilted + camera.translation.vector)) else { continue };
        let residual = corner.pixel - at.pixel;
        let weight = 1.0 / (1.0 + residual.norm_squared() / (3.0 * noise).powi(2));
        let by_turn = at.by_point * -tilted.cross_matrix();
        let by_angle: Vector2<f64> = at.by_point * (camera.rotation * Vector3::z().cross(&on_platter));
        for axis in 0..2 {
            let row = Vector6::from_fn(|i, _| if i < 3 { by_turn[(axis, i)] } else { at.by_point[(axis, i - 3)] });
            sum.information += weight * row * row.transpose();
            sum.pull += weight * row * residual[axis];
            coupling += weight * row * by_angle[axis];
            own += weight * by_angle[axis] * by_angle[axis];
            pull += weight * by_angle[axis] * residual[axis];
        }
        sum.cost += weight * residual.norm_squared();
    }
    if own > 0.0 {
        sum.information -= coupling * coupling.transpose() / own;
        sum.pull -= coupling * pull / own;
        sum.cost -= pull * pull / own;
    }
    sum
}

/// The platter without a move of the camera that the corners do not show: one that shifts the target's points by less
/// than their noise, in pixels. `None` if every move shows.
pub(super) fn joined(rig: &Rig, turning: &Turning, pictures: &[Picture], noise: f64) -> Option<Turning> {
    let film = |s: usize| turning.segment_of.iter().position(|&of| of == s).map(|k| pictures[k].film);
    let points = rig.shape.points();
    let shift = |s: usize, by: f64| {
        let (a, b) = (turning.segments[s], turned(&turning.segments[s + 1], by));
        let shift = |p: &Point3<f64>| {
            let on_platter = turning.world_from_target * p;
            let [a, b] = [a, b].map(|pose| project(&rig.lens, &(pose * on_platter).coords));
            a.zip(b).map_or(f64::MAX.sqrt(), |(a, b)| (a - b).norm())
        };
        median(&points.iter().map(shift).collect::<Vec<_>>())
    };
    let turn = |s: usize| nearest_turn(&turning.segments[s], &turning.segments[s + 1]);
    let hidden = |s: &usize| film(*s) == film(s + 1) && shift(*s, turn(*s)) < noise;
    let s = (0..turning.segments.len().saturating_sub(1)).find(hidden)?;
    let mut next = turning.clone();
    for (k, of) in next.segment_of.iter_mut().enumerate() {
        if *of == s + 1 {
            next.angles[k] -= turn(s);
        }
        *of -= usize::from(*of > s);
    }
    next.segments.remove(s + 1);
    next.references.remove(s + 1);
    Some(next)
}

/// The angle at which a segment's camera sees a picture's corners best, found from all sides; with the median distance
/// in pixels. `None` without corners.
pub(super) fn best_angle(rig: &Rig, turning: &Turning, picture: &Picture, segment: usize) -> Option<(f64, f64)> {
    const SIDES: usize = 180;
    if picture.corners.len() < 2 {
        return None;
    }
    let distance = |angle: f64| {
        let pose = turned(&turning.segments[segment], angle) * turning.world_from_target;
        let away = |c: &Corner| {
            let seen = project(&rig.lens, &(pose * rig.shape.point(c.point)).coords);
            seen.map_or(f64::MAX.sqrt(), |seen| (seen - c.pixel).norm())
        };
        median(&picture.corners.iter().map(away).collect::<Vec<_>>())
    };
    let step = TAU / SIDES as f64;
    let sides = (0..SIDES).map(|n| n as f64 * step);
    let (mut angle, mut least) = sides.map(|a| (a, distance(a))).min_by(|a, b| a.1.total_cmp(&b.1))?;
    let mut reach = 0.5 * step;
    while reach > 1e-5 {
        let tried = [angle - reach, angle + reach].map(|a| (a, distance(a)));
        match tried.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((a, d)) if d < least => (angle, least) = (a, d),
            _ => reach *= 0.5,
        }
    }
    Some((angle, least))
}

/// The same platter in the axes of [`world_from_target`], the first segment's camera at angle 0 at its first picture,
/// the others turned about the axis to where they are nearest to it.
pub(super) fn canonical(
    turning: &Turning,
    pictures: &[Picture],
    plane: Option<&Isometry3<f64>>,
    points: &[Point3<f64>],
) -> Turning {
    let target_from_world = turning.world_from_target.inverse();
    let axis =
        Axis { point: target_from_world * Point3::origin(), direction: target_from_world.rotation * Vector3::z() };
    let mut next = turning.clone();
    next.world_from_target = world_from_target(&axis, plane, points);
    // Both worlds share the axis; what turns the one into the other about it goes to the cameras. If z changes ends,
    // angles change sign.
    let change = turning.world_from_target * next.world_from_target.inverse();
    let sign = (change.rotation * Vector3::z()).z.signum();
    for segment in &mut next.segments {
        // By nothing, which makes the rotation one again after many products.
        *segment = moved(&(*segment * change), &Vector6::zeros());
    }
    next.angles.iter_mut().for_each(|angle| *angle *= sign);
    for s in 0..next.segments.len() {
        let is_first = |k: &usize| next.segment_of[*k] == s && pictures[*k].is_used;
        let Some(first) = (0..pictures.len()).find(is_first) else { continue };
        let by = if s == 0 { next.angles[first] } else { nearest_turn(&next.segments[0], &next.segments[s]) };
        next.segments[s] = turned(&next.segments[s], by);
        for (angle, _) in next.angles.iter_mut().zip(&next.segment_of).filter(|(_, of)| **of == s) {
            *angle -= by;
        }
    }
    next
}

/// The turn of the platter that brings a camera nearest to another.
fn nearest_turn(to: &Isometry3<f64>, from: &Isometry3<f64>) -> f64 {
    let m = (to.rotation.inverse() * from.rotation).to_rotation_matrix();
    (m[(0, 1)] - m[(1, 0)]).atan2(m[(0, 0)] + m[(1, 1)])
}

/// Adds whole turns so that angles go on as the platter's speed says: `known` holds position, time and angle within a
/// turn, by time. Steps of more than half a turn are counted by the median speed.
pub(super) fn unwrap(known: &mut [(usize, f64, f64)]) {
    let near = |angle: f64, expected: f64| angle + TAU * ((expected - angle) / TAU).round();
    let rates: Vec<f64> = known
        .windows(2)
        .filter(|w| w[1].1 > w[0].1)
        .map(|w| (near(w[1].2 - w[0].2, 0.0) / (w[1].1 - w[0].1), w[1].1 - w[0].1))
        .filter(|(rate, time)| (rate * time).abs() < 0.5 * PI)
        .map(|(rate, _)| rate)
        .collect();
    let rate = median(&rates);
    for n in 1..known.len() {
        let (before, after) = (known[n - 1], known[n]);
        let step = near(after.2 - before.2, 0.0);
        let expected = rate * (after.1 - before.1);
        // Short steps need no speed; it only counts the turns of long gaps.
        let step = if expected.abs() > 0.5 * PI { near(step, expected) } else { step };
        known[n].2 = before.2 + step;
    }
}
