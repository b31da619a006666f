//! The normal equations of the joint estimate: lens, axis, segments and markers (the head, dense), and for each picture
//! a block of its own (an angle or a pose), eliminated by its Schur complement (Triggs 2000).

use super::LensParameter;
use super::lens::{LensPrior, step};
use super::pose::moved;
use super::projection::linearise;
use super::rig::{Corner, Picture, Poses, Rig, Shape, unit_corner};
use nalgebra::{Cholesky, DMatrix, DVector, Isometry3, Matrix3, UnitQuaternion, Vector2, Vector3, Vector6};

/// What a corner counts that the rig puts out of sight, in pixels.
pub(super) const OUT_OF_SIGHT: f64 = 1e4;
/// What a marker that is not flat (or the rim of a board) may tilt, in radians, and rise, in sides: paper that curls.
const TILT: f64 = 0.2;
const RISE: f64 = 0.3;

/// What a solution may change, and what is assumed.
#[derive(Clone, Copy)]
pub(super) struct Freedom<'a> {
    pub(super) lens: &'a [LensParameter],
    pub(super) prior: &'a LensPrior,
}

/// Where the parameters of the head are.
pub(super) struct Head<'a> {
    lens: &'a [LensParameter],
    pub(super) axis: usize,
    segments: usize,
    markers: usize,
    pub(super) size: usize,
    pub(super) block: usize,
}

/// The normal equations: head, a block for each picture, and what couples them.
pub(super) struct Equations {
    head: DMatrix<f64>,
    gradient: DVector<f64>,
    pub(super) blocks: Vec<Block>,
    pub(super) cost: f64,
}

/// What belongs to one picture.
pub(super) struct Block {
    pub(super) normal: DMatrix<f64>,
    pub(super) coupling: DMatrix<f64>,
    gradient: DVector<f64>,
}

/// How a corner counts: its share of the cost and its weight, for a squared distance.
#[derive(Clone, Copy)]
pub(super) enum Loss {
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

/// Turns and moves of a marker: in its plane, or all.
fn freedoms(is_flat: bool) -> &'static [usize] {
    if is_flat { &[2, 3, 4] } else { &[0, 1, 2, 3, 4, 5] }
}

/// What is assumed of one number of a marker that is not flat, or of a board that curls.
struct Relief {
    /// Position in the head.
    at: usize,
    value: f64,
    /// One over the standard deviation.
    weight: f64,
}

/// How far markers are out of their plane, or how much a board curls.
fn relief(shape: &Shape, head: &Head) -> Vec<Relief> {
    if let Shape::Curled(curled) = shape {
        let bend = |(i, &value): (usize, &f64)| Relief { at: head.markers + i, value, weight: curled.reach / TILT };
        return curled.curvature.iter().enumerate().map(bend).collect();
    }
    let Shape::Squares { side, places, fixed, is_flat: false } = shape else { return Vec::new() };
    let of = |(n, place): (usize, &Isometry3<f64>)| {
        let first = head.markers + 6 * (n - usize::from(n > *fixed));
        let turn = place.rotation.scaled_axis();
        [(0, turn.x, TILT), (1, turn.y, TILT), (5, place.translation.z, RISE * side)]
            .map(|(freedom, value, deviation)| Relief { at: first + freedom, value, weight: 1.0 / deviation })
    };
    places.iter().enumerate().filter(|(n, _)| n != fixed).flat_map(of).collect()
}

/// Cholesky factor of a matrix scaled to a unit diagonal.
pub(super) struct Scaled {
    scale: DVector<f64>,
    factor: Cholesky<f64, nalgebra::Dyn>,
}

pub(super) fn factor(mut matrix: DMatrix<f64>) -> Option<Scaled> {
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
    pub(super) fn solve(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        let scaled = |mut m: DMatrix<f64>| {
            (0..m.nrows()).for_each(|i| m.row_mut(i).scale_mut(self.scale[i]));
            m
        };
        scaled(self.factor.solve(&scaled(right.clone())))
    }
}

impl<'a> Head<'a> {
    pub(super) fn new(rig: &Rig, lens: &'a [LensParameter]) -> Self {
        let axis = lens.len();
        let (segments, markers, block) = match &rig.poses {
            Poses::Free(_) => (axis, axis, 6),
            Poses::Turning(turning) => (axis + 4, axis + 4 + 6 * turning.segments.len(), 1),
        };
        let size = match &rig.shape {
            Shape::Points(_) => markers,
            Shape::Curled(_) => markers + 3,
            Shape::Squares { places, is_flat, .. } => markers + freedoms(*is_flat).len() * (places.len() - 1),
        };
        Self { lens, axis, segments, markers, size, block }
    }
}

impl Equations {
    /// Head without the blocks, its gradient, and the factors of the blocks.
    pub(super) fn reduced(&self, damping: f64) -> Option<(DMatrix<f64>, DMatrix<f64>, Vec<Scaled>)> {
        let damp = |matrix: &DMatrix<f64>| {
            let mut damped = matrix.clone();
            (0..damped.nrows()).for_each(|i| damped[(i, i)] *= 1.0 + damping);
            damped
        };
        let mut head = damp(&self.head);
        let mut gradient = DMatrix::from_column_slice(self.gradient.len(), 1, self.gradient.as_slice());
        let mut factors = Vec::with_capacity(self.blocks.len());
        for block in &self.blocks {
            let factor = factor(damp(&block.normal))?;
            let solved = factor.solve(&block.coupling.transpose());
            head -= &block.coupling * &solved;
            gradient -= solved.tr_mul(&block.gradient);
            factors.push(factor);
        }
        Some((head, gradient, factors))
    }

    /// Steps of the head, and then of every block.
    pub(super) fn step(&self, damping: f64) -> Option<(DVector<f64>, Vec<DVector<f64>>)> {
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
fn assumed(rig: &Rig, freedom: Freedom, head: &Head) -> f64 {
    let relief = relief(&rig.shape, head).into_iter().map(|r| (r.value * r.weight).powi(2));
    freedom.prior.cost(&rig.lens, freedom.lens) + relief.sum::<f64>()
}

/// What a solution makes less: misfit and, in square pixels, what is assumed.
pub(super) fn cost_of(rig: &Rig, pictures: &[Picture], freedom: Freedom, head: &Head, loss: Loss, noise: f64) -> f64 {
    let mut cost = noise * noise * assumed(rig, freedom, head);
    for (k, picture) in pictures.iter().enumerate() {
        let corners: Vec<Corner> = counting(picture, loss).copied().collect();
        for residual in rig.residuals(k, &corners) {
            cost += loss.of(residual.map_or(OUT_OF_SIGHT * OUT_OF_SIGHT, |r| r.norm_squared())).0;
        }
    }
    cost
}

pub(super) fn equations_of(
    rig: &Rig,
    pictures: &[Picture],
    freedom: Freedom,
    head: &Head,
    loss: Loss,
    noise: f64,
) -> Equations {
    let mut sum = Equations {
        head: DMatrix::zeros(head.size, head.size),
        gradient: DVector::zeros(head.size),
        blocks: Vec::with_capacity(pictures.len()),
        cost: noise * noise * assumed(rig, freedom, head),
    };
    for (i, &parameter) in freedom.lens.iter().enumerate() {
        sum.head[(i, i)] += noise * noise * freedom.prior.precision(parameter);
        sum.gradient[i] += noise * noise * freedom.prior.pull(&rig.lens, parameter);
    }
    for Relief { at, value, weight } in relief(&rig.shape, head) {
        sum.head[(at, at)] += (noise * weight).powi(2);
        sum.gradient[at] -= (noise * weight).powi(2) * value;
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
        if let Shape::Curled(curled) = &self.rig.shape {
            let by_place = at.by_point * self.from_target;
            let by_curvature = curled.by_curvature(corner.point);
            row.extend(by_curvature.into_iter().enumerate().map(|(i, by)| (head.markers + i, by_place * by)));
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
pub(super) fn stepped(rig: &Rig, head: &Head, (first, rest): &(DVector<f64>, Vec<DVector<f64>>)) -> Rig {
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
    if let Shape::Curled(curled) = &mut next.shape {
        curled.curvature.iter_mut().enumerate().for_each(|(i, value)| *value += at(head.markers + i));
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
