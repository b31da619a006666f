//! The joint least squares estimate: lens, axis, segments and markers (the head, dense), and for each picture a block of
//! its own (an angle or a pose), eliminated by its Schur complement (Triggs 2000). Robust by reweighting.

use super::LensParameter;
use super::homography::median;
use super::lens::{LensPrior, step};
use super::pose::moved;
use super::projection::linearise;
use super::rig::{Corner, Picture, Poses, Rig, Shape, unit_corner};
use nalgebra::{Cholesky, DMatrix, DVector, Isometry3, Matrix3, UnitQuaternion, Vector2, Vector3, Vector6};

/// Steps of one solution; it settles in five to twenty.
const STEPS: usize = 60;
/// Relative fall of the cost below which it has settled.
const SETTLED: f64 = 1e-9;
/// Scale of the Cauchy weights in deviations of the corners: 95 % as good as squares where nothing is wrong.
const CAUCHY: f64 = 2.385;
/// Least deviation of a corner in pixels: nothing is seen better, and squares of nothing weigh nothing.
const LEAST_NOISE: f64 = 0.005;
/// What a corner counts that the rig puts out of sight, in pixels.
const OUT_OF_SIGHT: f64 = 1e4;
/// Robust deviations beyond which a corner contradicts the others: one in three thousand by chance.
const LIMIT: f64 = 4.0;
/// What a marker that is not flat may tilt, in radians, and rise, in sides: paper that curls.
const TILT: f64 = 0.2;
const RISE: f64 = 0.3;
/// Rounds of dropping what contradicts the rest.
const ROUNDS: usize = 6;
/// A picture contradicts the others if its RMS is so many times that of most, or ...
const PICTURE_LIMIT: f64 = 3.0;
/// ... if this part of its corners does.
const DROPPED_LIMIT: f64 = 0.5;

/// What a solution may change, and what is assumed.
#[derive(Clone, Copy)]
pub(super) struct Freedom<'a> {
    pub(super) lens: &'a [LensParameter],
    pub(super) prior: &'a LensPrior,
}

/// How well a rig fits.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    /// Sum of squared distances of the corners used, in square pixels.
    pub(super) cost: f64,
    /// Corners used.
    pub(super) corners: usize,
    /// Deviation of a coordinate of a corner, in pixels.
    pub(super) noise: f64,
    /// What the corners alone tell of the free numbers of the lens: inverse covariance.
    pub(super) information: DMatrix<f64>,
}

impl Fit {
    pub(super) fn rms_px(&self) -> f64 {
        (self.cost / self.corners.max(1) as f64).sqrt()
    }
}

/// Turns and moves of a marker: in its plane, or all.
fn freedoms(is_flat: bool) -> &'static [usize] {
    if is_flat { &[2, 3, 4] } else { &[0, 1, 2, 3, 4, 5] }
}

/// How far markers are out of their plane, in deviations of what paper does: freedom, value, one over the deviation.
fn relief(shape: &Shape) -> Vec<(usize, [(usize, f64, f64); 3])> {
    let Shape::Squares { side, places, fixed, is_flat: false } = shape else { return Vec::new() };
    let of = |(n, place): (usize, &Isometry3<f64>)| {
        let turn = place.rotation.scaled_axis();
        let rise = 1.0 / (RISE * side);
        (
            n - usize::from(n > *fixed),
            [(0, turn.x, 1.0 / TILT), (1, turn.y, 1.0 / TILT), (5, place.translation.z, rise)],
        )
    };
    places.iter().enumerate().filter(|(n, _)| n != fixed).map(of).collect()
}

/// Where the parameters of the head are.
struct Head<'a> {
    lens: &'a [LensParameter],
    axis: usize,
    segments: usize,
    markers: usize,
    size: usize,
    block: usize,
}

/// The normal equations: head, a block for each picture, and what couples them.
struct Equations {
    head: DMatrix<f64>,
    gradient: DVector<f64>,
    blocks: Vec<Block>,
    cost: f64,
}

struct Block {
    normal: DMatrix<f64>,
    coupling: DMatrix<f64>,
    gradient: DVector<f64>,
}

/// How a corner counts: its share of the cost and its weight, for a squared distance.
#[derive(Clone, Copy)]
enum Loss {
    Square,
    Cauchy { scale: f64 },
}

impl Loss {
    fn of(self, square: f64) -> (f64, f64) {
        match self {
            Self::Square => (square, 1.0),
            Self::Cauchy { scale } => {
                let s = scale * scale;
                (s * (square / s).ln_1p(), 1.0 / (1.0 + square / s))
            }
        }
    }
}

/// Fits the rig to the pictures: robustly, then without the corners and pictures that contradict the rest, which are
/// marked. `None` where too little is left.
pub(super) fn settle(rig: &mut Rig, pictures: &mut [Picture], freedom: Freedom) -> Option<Fit> {
    for _ in 0..2 {
        let noise = noise(rig, pictures);
        solve(rig, pictures, freedom, Loss::Cauchy { scale: CAUCHY * noise }, noise);
    }
    for _ in 0..ROUNDS {
        let noise = noise(rig, pictures);
        let has_changed = mark(rig, pictures, noise);
        solve(rig, pictures, freedom, Loss::Square, noise);
        if !has_changed {
            break;
        }
    }
    measure(rig, pictures, freedom)
}

/// The robust deviation of a coordinate in pixels, from the median.
fn noise(rig: &Rig, pictures: &[Picture]) -> f64 {
    let mut sizes = Vec::new();
    for (k, picture) in pictures.iter().enumerate().filter(|(_, p)| p.is_used) {
        for residual in rig.residuals(k, &picture.corners) {
            let r = residual.unwrap_or(Vector2::repeat(OUT_OF_SIGHT));
            sizes.extend([r.x.abs(), r.y.abs()]);
        }
    }
    (1.4826 * median(&sizes)).max(LEAST_NOISE)
}

/// Marks corners and pictures that agree; whether any mark changed.
fn mark(rig: &Rig, pictures: &mut [Picture], noise: f64) -> bool {
    let mut has_changed = false;
    let mut rms = Vec::new();
    for (k, picture) in pictures.iter_mut().enumerate() {
        let residuals = rig.residuals(k, &picture.corners);
        let mut sum = (0.0, 0.0);
        for (corner, residual) in picture.corners.iter_mut().zip(residuals) {
            let square = residual.map_or(f64::INFINITY, |r| r.norm_squared());
            let agrees = square <= (LIMIT * noise).powi(2);
            has_changed |= agrees != corner.is_used;
            corner.is_used = agrees;
            if agrees {
                sum = (sum.0 + square, sum.1 + 1.0);
            }
        }
        rms.push((sum.0 / f64::max(sum.1, 1.0)).sqrt());
    }
    let used: Vec<f64> = pictures.iter().zip(&rms).filter(|(p, _)| p.is_used).map(|(_, r)| *r).collect();
    let limit = (PICTURE_LIMIT * median(&used)).max(2.0 * noise);
    for (picture, rms) in pictures.iter_mut().zip(rms) {
        let agreeing = picture.corners.iter().filter(|c| c.is_used).count();
        let enough = agreeing as f64 > DROPPED_LIMIT * picture.corners.len() as f64;
        let is_used = enough && rms <= limit;
        has_changed |= is_used != picture.is_used;
        picture.is_used = is_used;
    }
    has_changed
}

/// Levenberg–Marquardt. `noise` makes pixels of what is assumed.
fn solve(rig: &mut Rig, pictures: &[Picture], freedom: Freedom, loss: Loss, noise: f64) {
    let head = Head::new(rig, freedom.lens);
    let mut damping = 1e-4;
    let mut equations = equations_of(rig, pictures, freedom, &head, loss, noise);
    for _ in 0..STEPS {
        let Some(tried) = equations.step(damping).map(|by| stepped(rig, &head, &by)) else {
            damping *= 10.0;
            if damping > 1e12 {
                return;
            }
            continue;
        };
        let cost = cost_of(&tried, pictures, freedom, loss, noise);
        if cost < equations.cost {
            let is_settled = equations.cost - cost < SETTLED * equations.cost;
            *rig = tried;
            if is_settled {
                return;
            }
            damping = (0.1 * damping).max(1e-12);
            equations = equations_of(rig, pictures, freedom, &head, loss, noise);
        } else {
            damping *= 10.0;
            if damping > 1e12 {
                return;
            }
        }
    }
}

/// Fit and information of the corners used.
fn measure(rig: &Rig, pictures: &[Picture], freedom: Freedom) -> Option<Fit> {
    let head = Head::new(rig, freedom.lens);
    let equations = equations_of(rig, pictures, freedom, &head, Loss::Square, 0.0);
    let used = pictures.iter().filter(|p| p.is_used);
    let corners = used.clone().map(|p| p.corners.iter().filter(|c| c.is_used).count()).sum::<usize>();
    let unknown = head.size + head.block * used.count();
    let cost = equations.cost;
    if corners == 0 || !cost.is_finite() {
        return None;
    }
    let noise = (cost / (2.0 * corners as f64 - unknown as f64).max(1.0)).sqrt().max(LEAST_NOISE);
    let reduced = equations.reduced(0.0)?.0;
    let information = marginal(&reduced, freedom.lens.len()) / (noise * noise);
    Some(Fit { cost, corners, noise, information })
}

/// Of an information matrix, what it tells of the first `n` numbers when the others are unknown.
fn marginal(all: &DMatrix<f64>, n: usize) -> DMatrix<f64> {
    let m = all.nrows() - n;
    let first = all.view((0, 0), (n, n)).into_owned();
    if n == 0 || m == 0 {
        return first;
    }
    let coupling = all.view((n, 0), (m, n)).into_owned();
    let Some(rest) = factor(all.view((n, n), (m, m)).into_owned()) else { return DMatrix::zeros(n, n) };
    let difference = &first - coupling.transpose() * rest.solve(&coupling);
    0.5 * (&difference + difference.transpose())
}

/// Cholesky factor of a matrix scaled to a unit diagonal.
struct Scaled {
    scale: DVector<f64>,
    factor: Cholesky<f64, nalgebra::Dyn>,
}

fn factor(mut matrix: DMatrix<f64>) -> Option<Scaled> {
    let n = matrix.nrows();
    // A number that nothing depends on stays where it is.
    let scale = DVector::from_fn(n, |i, _| if matrix[(i, i)] > 0.0 { matrix[(i, i)].sqrt().recip() } else { 1.0 });
    for column in 0..n {
        for row in 0..n {
            matrix[(row, column)] *= scale[row] * scale[column];
        }
        matrix[(column, column)] += 1e-13;
    }
    Some(Scaled { scale, factor: matrix.cholesky()? })
}

impl Scaled {
    fn solve(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        let scaled = |mut m: DMatrix<f64>| {
            (0..m.nrows()).for_each(|i| m.row_mut(i).scale_mut(self.scale[i]));
            m
        };
        scaled(self.factor.solve(&scaled(right.clone())))
    }
}

impl<'a> Head<'a> {
    fn new(rig: &Rig, lens: &'a [LensParameter]) -> Self {
        let axis = lens.len();
        let (segments, markers, block) = match &rig.poses {
            Poses::Free(_) => (axis, axis, 6),
            Poses::Turning(turning) => (axis + 4, axis + 4 + 6 * turning.segments.len(), 1),
        };
        let size = match &rig.shape {
            Shape::Points(_) => markers,
            Shape::Squares { places, is_flat, .. } => markers + freedoms(*is_flat).len() * (places.len() - 1),
        };
        Self { lens, axis, segments, markers, size, block }
    }
}

impl Equations {
    /// Head without the blocks, its gradient, and the factors of the blocks.
    fn reduced(&self, damping: f64) -> Option<(DMatrix<f64>, DMatrix<f64>, Vec<Scaled>)> {
        let damp = |matrix: &DMatrix<f64>| {
            let mut damped = matrix.clone();
            (0..damped.nrows()).for_each(|i| damped[(i, i)] *= 1.0 + damping);
            damped
        };
        let mut head = damp(&self.head);
        let mut gradient = DMatrix::from_column_slice(self.gradient.len(), 1, self.gradient.as_slice());
        let mut factors = Vec::with_capacity(self.blocks.len());
        for block in &self.blocks {
            let mut normal = damp(&block.normal);
            // A block that nothing depends on stays where it is.
            (0..normal.nrows()).for_each(|i| normal[(i, i)] += f64::from(u8::from(block.normal[(i, i)] <= 0.0)));
            let factor = factor(normal)?;
            let solved = factor.solve(&block.coupling.transpose());
            head -= &block.coupling * &solved;
            gradient -= solved.tr_mul(&block.gradient);
            factors.push(factor);
        }
        Some((head, gradient, factors))
    }

    /// Steps of the head, and then of every block.
    fn step(&self, damping: f64) -> Option<(DVector<f64>, Vec<DVector<f64>>)> {
        let (head, gradient, factors) = self.reduced(damping)?;
        let first = factor(head)?.solve(&gradient).column(0).into_owned();
        let rest = |(block, factor): (&Block, &Scaled)| {
            let right = &block.gradient - block.coupling.tr_mul(&first);
            factor.solve(&DMatrix::from_column_slice(right.len(), 1, right.as_slice())).column(0).into_owned()
        };
        let steps: Vec<DVector<f64>> = self.blocks.iter().zip(&factors).map(rest).collect();
        let is_finite = first.iter().chain(steps.iter().flat_map(DVector::iter)).all(|v| v.is_finite());
        is_finite.then_some((first, steps))
    }
}

/// The corners of a picture that count: all of them while weights are robust.
fn counting(picture: &Picture, loss: Loss) -> impl Iterator<Item = &Corner> {
    let all = matches!(loss, Loss::Cauchy { .. });
    picture.corners.iter().filter(move |c| picture.is_used && (all || c.is_used))
}

/// Squared deviations from what is assumed.
fn assumed(rig: &Rig, freedom: Freedom) -> f64 {
    let relief = relief(&rig.shape).into_iter().flat_map(|(_, terms)| terms);
    freedom.prior.cost(&rig.lens, freedom.lens)
        + relief.map(|(_, value, precision)| (value * precision).powi(2)).sum::<f64>()
}

fn cost_of(rig: &Rig, pictures: &[Picture], freedom: Freedom, loss: Loss, noise: f64) -> f64 {
    let mut cost = noise * noise * assumed(rig, freedom);
    for (k, picture) in pictures.iter().enumerate() {
        let corners: Vec<Corner> = counting(picture, loss).copied().collect();
        for residual in rig.residuals(k, &corners) {
            cost += loss.of(residual.map_or(OUT_OF_SIGHT * OUT_OF_SIGHT, |r| r.norm_squared())).0;
        }
    }
    cost
}

fn equations_of(rig: &Rig, pictures: &[Picture], freedom: Freedom, head: &Head, loss: Loss, noise: f64) -> Equations {
    let mut sum = Equations {
        head: DMatrix::zeros(head.size, head.size),
        gradient: DVector::zeros(head.size),
        blocks: Vec::with_capacity(pictures.len()),
        cost: noise * noise * assumed(rig, freedom),
    };
    for (i, &parameter) in freedom.lens.iter().enumerate() {
        sum.head[(i, i)] += noise * noise * freedom.prior.precision(parameter);
        sum.gradient[i] += noise * noise * freedom.prior.pull(&rig.lens, parameter);
    }
    for (marker, terms) in relief(&rig.shape) {
        for (freedom, value, precision) in terms {
            let i = head.markers + 6 * marker + freedom;
            sum.head[(i, i)] += (noise * precision).powi(2);
            sum.gradient[i] -= (noise * precision).powi(2) * value;
        }
    }
    let mut row = Vec::new();
    for (k, picture) in pictures.iter().enumerate() {
        let b = head.block;
        let mut block =
            Block { normal: DMatrix::zeros(b, b), coupling: DMatrix::zeros(head.size, b), gradient: DVector::zeros(b) };
        let view = View::new(rig, k);
        for corner in counting(picture, loss) {
            row.clear();
            let Some((residual, own)) = view.derivatives(corner, head, &mut row) else {
                sum.cost += loss.of(OUT_OF_SIGHT * OUT_OF_SIGHT).0;
                continue;
            };
            let (cost, weight) = loss.of(residual.norm_squared());
            sum.cost += cost;
            sum.add(&mut block, &row, &own[..b], residual, weight);
        }
        sum.blocks.push(block);
    }
    for column in 0..head.size {
        (0..column).for_each(|row| sum.head[(column, row)] = sum.head[(row, column)]);
    }
    sum
}

impl Equations {
    /// Adds a corner: its derivatives by numbers of the head, and by those of its picture. Fills the upper triangle.
    fn add(
        &mut self,
        block: &mut Block,
        row: &[(usize, Vector2<f64>)],
        own: &[Vector2<f64>],
        residual: Vector2<f64>,
        weight: f64,
    ) {
        for (n, &(i, a)) in row.iter().enumerate() {
            let a = weight * a;
            self.gradient[i] += a.dot(&residual);
            for &(j, b) in &row[n..] {
                self.head[(i.min(j), i.max(j))] += a.dot(&b);
            }
            for (j, b) in own.iter().enumerate() {
                block.coupling[(i, j)] += a.dot(b);
            }
        }
        for (i, a) in own.iter().enumerate() {
            block.gradient[i] += weight * a.dot(&residual);
            for (j, b) in own.iter().enumerate() {
                block.normal[(i, j)] += weight * a.dot(b);
            }
        }
    }
}

/// One picture of a rig, with what its corners have in common.
struct View<'a> {
    rig: &'a Rig,
    /// Target to world, world to the axis at rest, and to the camera.
    world: Isometry3<f64>,
    platter: UnitQuaternion<f64>,
    camera: Isometry3<f64>,
    /// Target's and world's axes in the camera.
    from_target: Matrix3<f64>,
    from_world: Matrix3<f64>,
    segment: usize,
    is_reference: bool,
}

impl<'a> View<'a> {
    fn new(rig: &'a Rig, picture: usize) -> Self {
        let (world, platter, camera, segment, is_reference) = match &rig.poses {
            Poses::Free(poses) => (Isometry3::identity(), UnitQuaternion::identity(), poses[picture], 0, false),
            Poses::Turning(t) => {
                let platter = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), t.angles[picture]);
                let segment = t.segment_of[picture];
                let is_reference = t.references[segment] == picture;
                (t.world_from_target, platter, t.segments[segment], segment, is_reference)
            }
        };
        let from_world = (camera.rotation * platter).to_rotation_matrix().into_inner();
        let from_target = from_world * world.rotation.to_rotation_matrix().into_inner();
        Self { rig, world, platter, camera, from_target, from_world, segment, is_reference }
    }

    /// Distance to where a corner is seen and its derivatives: by numbers of the head into `row`, by those of the
    /// picture (as many as the block has) returned. `None` out of sight.
    fn derivatives(
        &self,
        corner: &Corner,
        head: &Head,
        row: &mut Vec<(usize, Vector2<f64>)>,
    ) -> Option<(Vector2<f64>, [Vector2<f64>; 6])> {
        let lens = &self.rig.lens;
        let on_target = self.rig.shape.point(corner.point).coords;
        let tilted = self.world.rotation * on_target;
        let in_world = tilted + self.world.translation.vector;
        let turned = self.camera.rotation * (self.platter * in_world);
        let at = linearise(lens, &(turned + self.camera.translation.vector))?;
        row.extend(head.lens.iter().enumerate().map(|(i, &p)| (i, at.by_lens(lens, p))));
        let by_turn = at.by_point * -turned.cross_matrix();
        let rigid = [0, 1, 2, 3, 4, 5].map(|i| {
            let column = if i < 3 { by_turn.column(i) } else { at.by_point.column(i - 3) };
            Vector2::new(column[0], column[1])
        });
        if let Shape::Squares { side, places, fixed, is_flat } = &self.rig.shape {
            let marker = corner.point / 4;
            if marker != *fixed {
                let freedoms = freedoms(*is_flat);
                let first = head.markers + freedoms.len() * (marker - usize::from(marker > *fixed));
                let by_place = at.by_point * self.from_target;
                let arm = places[marker].rotation * (*side * unit_corner(corner.point));
                let by = |i: usize| if i < 3 { Vector3::ith(i, 1.0).cross(&arm) } else { Vector3::ith(i - 3, 1.0) };
                row.extend(freedoms.iter().enumerate().map(|(n, &i)| (first + n, by_place * by(i))));
            }
        }
        let residual = corner.pixel - at.pixel;
        if matches!(self.rig.poses, Poses::Free(_)) {
            return Some((residual, rigid));
        }
        let by_world = at.by_point * self.from_world;
        row.push((head.axis, by_world * Vector3::x().cross(&tilted)));
        row.push((head.axis + 1, by_world * Vector3::y().cross(&tilted)));
        row.push((head.axis + 2, by_world * Vector3::x()));
        row.push((head.axis + 3, by_world * Vector3::y()));
        let first = head.segments + 6 * self.segment;
        row.extend(rigid.into_iter().enumerate().map(|(i, v)| (first + i, v)));
        let by_angle = by_world * Vector3::z().cross(&in_world);
        let by_angle = if self.is_reference { Vector2::zeros() } else { by_angle };
        Some((
            residual,
            [by_angle, Vector2::zeros(), Vector2::zeros(), Vector2::zeros(), Vector2::zeros(), Vector2::zeros()],
        ))
    }
}

/// The rig after a step.
fn stepped(rig: &Rig, head: &Head, (first, rest): &(DVector<f64>, Vec<DVector<f64>>)) -> Rig {
    let mut next = rig.clone();
    let at = |i: usize| first[i];
    let lens: Vec<f64> = (0..head.lens.len()).map(at).collect();
    next.lens = step(&rig.lens, head.lens, &lens);
    let six = |i: usize| Vector6::from_fn(|k, _| at(i + k));
    match &mut next.poses {
        Poses::Free(poses) => {
            for (pose, by) in poses.iter_mut().zip(rest) {
                *pose = moved(pose, &Vector6::from_fn(|k, _| by[k]));
            }
        }
        Poses::Turning(t) => {
            let [rx, ry, x, y] = [0, 1, 2, 3].map(|i| at(head.axis + i));
            t.world_from_target = moved(&t.world_from_target, &Vector6::new(rx, ry, 0.0, x, y, 0.0));
            for (s, segment) in t.segments.iter_mut().enumerate() {
                *segment = moved(segment, &six(head.segments + 6 * s));
            }
            t.angles.iter_mut().zip(rest).for_each(|(angle, by)| *angle += by[0]);
        }
    }
    if let Shape::Squares { places, fixed, is_flat, .. } = &mut next.shape {
        let freedoms = freedoms(*is_flat);
        for (n, place) in places.iter_mut().enumerate().filter(|(n, _)| n != fixed) {
            let first_of = head.markers + freedoms.len() * (n - usize::from(n > *fixed));
            let mut by = Vector6::zeros();
            freedoms.iter().enumerate().for_each(|(k, &i)| by[i] = at(first_of + k));
            *place = moved(place, &by);
        }
    }
    next
}
