//! How far axis and angles are off: the covariance of the joint estimate (Triggs, McLauchlan, Hartley, Fitzgibbon: Bundle
//! adjustment, a modern synthesis, 2000).

use super::equations::{Freedom, Head, Loss, equations_of, factor};
use super::estimate::Estimate;
use super::rig::Turning;
use nalgebra::{DMatrix, DVector};

/// Standard deviations in radians.
pub(super) struct Deviations {
    /// Of the axis in the target: root of the mean squared angle.
    pub(super) axis: f64,
    /// Of the angle of each picture used, against the mean of its segment.
    pub(super) angles: Vec<Option<f64>>,
}

/// With the head's information `S` (n × n) after the angles are eliminated, an angle's own information `d` and its
/// coupling `c` (n) to the head, angles covary by `σ² (δ / d + wᵢᵀ S⁻¹ wⱼ)`, `w = c / d`. `None` where
/// the equations have no solution.
pub(super) fn deviations(estimate: &Estimate, turning: &Turning) -> Option<Deviations> {
    let noise = estimate.fit.noise;
    let freedom = Freedom { lens: &estimate.free, prior: &estimate.prior };
    let head = Head::new(&estimate.rig, freedom.lens);
    let equations = equations_of(&estimate.rig, &estimate.pictures, freedom, &head, Loss::Square, noise);
    let information = factor(equations.reduced(0.0)?.0)?;
    let both = DMatrix::from_fn(head.size, 2, |row, column| f64::from(u8::from(row == head.axis + column)));
    let tilts = information.solve(&both);
    let axis = noise * (tilts[(head.axis, 0)] + tilts[(head.axis + 1, 1)]).max(0.0).sqrt();
    // The angle of a segment's reference is held: it has no information of its own, and no deviation.
    let own: Vec<f64> =
        equations.blocks.iter().map(|b| b.normal[(0, 0)]).map(|d| if d > 0.0 { 1.0 / d } else { 0.0 }).collect();
    let arms: Vec<DVector<f64>> =
        equations.blocks.iter().zip(&own).map(|(b, own)| b.coupling.column(0) * *own).collect();
    let mut angles = vec![None; own.len()];
    for segment in 0..turning.segments.len() {
        let is_member = |&k: &usize| turning.segment_of[k] == segment && estimate.pictures[k].is_used;
        let members: Vec<usize> = (0..own.len()).filter(is_member).collect();
        let count = members.len() as f64;
        let mean = members.iter().fold(DVector::zeros(head.size), |sum, &k| sum + &arms[k] / count);
        let spread = members.iter().map(|&k| own[k]).sum::<f64>() / (count * count);
        for &k in &members {
            let arm = DMatrix::from_column_slice(head.size, 1, (&arms[k] - &mean).as_slice());
            let shared = arm.dot(&information.solve(&arm));
            let variance = own[k] * (1.0 - 2.0 / count) + spread + shared;
            angles[k] = Some(noise * variance.max(0.0).sqrt());
        }
    }
    Some(Deviations { axis, angles })
}
