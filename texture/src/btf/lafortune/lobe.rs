//! One lobe `Y(l) = ρ · max(0, C·l)ⁿ`, ‖C‖ = 1, and its fit to what one texel shows under all lights.
//!
//! Levenberg and Marquardt on (C on the sphere, ln n, ρ), from two starts: the mean bright direction with the
//! exponent of a line through logarithms, and the brightest light with a narrow lobe. Bounded: `C_z ≥ 0.02`,
//! `0.1 ≤ n ≤ 100`, `ρ ≥ 0`; so neither 0ⁿ nor n → 0 or ∞ occurs, and what is black is ρ = 0.

use crate::btf::linear::dot;
use nalgebra::{Matrix4, Vector3, Vector4};

/// Smallest and largest exponent.
pub(super) const EXPONENTS: [f32; 2] = [0.1, 100.0];
/// Lowest elevation of a lobe: its z.
const LOWEST: f32 = 0.02;
/// Cosines below it lie outside the lobe.
const EDGE: f32 = 1e-4;
/// Rounds of one start.
const ROUNDS: usize = 20;
/// A round that lowers the error by less than this share is the last.
const SETTLED: f32 = 1e-4;
/// Exponent of the narrow start.
const NARROW: f32 = 12.0;

/// A lobe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lobe {
    /// Its height.
    pub(super) rho: f32,
    /// Its axis.
    pub(super) axis: Vector3<f32>,
    /// Its exponent.
    pub(super) exponent: f32,
}

impl Lobe {
    /// Its value under a unit vector towards the light.
    pub(super) fn value(&self, light: &Vector3<f32>) -> f32 {
        let cosine = self.axis.dot(light).min(1.0);
        if cosine > EDGE { self.rho * exp2(self.exponent * log2(cosine)) } else { 0.0 }
    }
}

/// Unit vectors towards lights, by coordinate.
#[derive(Debug)]
pub(super) struct Lights {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
}

/// What one round computes for every light.
struct Scratch {
    cosine: Vec<f32>,
    /// 0 outside the lobe.
    log: Vec<f32>,
    /// `cosineⁿ`.
    power: Vec<f32>,
    /// Derivatives by ρ, along two tangents, by ln n.
    slopes: [Vec<f32>; 4],
    rest: Vec<f32>,
}

impl Lights {
    pub(super) fn new(lights: &[Vector3<f64>]) -> Self {
        let coordinate = |c: usize| lights.iter().map(|l| l[c] as f32).collect();
        Self { x: coordinate(0), y: coordinate(1), z: coordinate(2) }
    }

    fn get(&self, i: usize) -> Vector3<f32> {
        Vector3::new(self.x[i], self.y[i], self.z[i])
    }

    /// The lobe nearest to `values`, one a light, in the sense of least squares.
    pub(super) fn fit(&self, values: &[f32]) -> Lobe {
        let brightest = (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b]).then(b.cmp(&a)));
        let Some(brightest) = brightest.filter(|&i| values[i] > 0.0) else {
            return Lobe { rho: 0.0, axis: Vector3::z(), exponent: 1.0 };
        };
        let mut scratch = Scratch::new(values.len());
        let wide = self.mean_start(values);
        let narrow = Lobe { rho: 0.0, axis: raised(self.get(brightest)), exponent: NARROW };
        let (a, b) = (self.refine(values, wide, &mut scratch), self.refine(values, narrow, &mut scratch));
        if b.1 < a.1 { b.0 } else { a.0 }
    }

    fn mean_start(&self, values: &[f32]) -> Lobe {
        let axis = raised(Vector3::new(dot(&self.x, values), dot(&self.y, values), dot(&self.z, values)));
        let peak = values.iter().copied().fold(0.0, f32::max);
        let mut sums = [0.0f32; 5];
        for (i, &value) in values.iter().enumerate() {
            let cosine = axis.dot(&self.get(i));
            if cosine > 0.05 && value > 0.05 * peak {
                let (w, x, y) = (value * value, log2(cosine.min(1.0)), log2(value));
                [w, w * x, w * y, w * x * x, w * x * y].iter().zip(&mut sums).for_each(|(v, s)| *s += v);
            }
        }
        let [w, x, y, xx, xy] = sums;
        let slope = (w * xy - x * y) / (w * xx - x * x);
        let exponent = if slope.is_finite() { slope.clamp(EXPONENTS[0], EXPONENTS[1]) } else { 1.0 };
        Lobe { rho: 0.0, axis, exponent }
    }

    /// The best height for axis and exponent, and the squared error; leaves what it computed in `scratch`.
    fn evaluate(&self, values: &[f32], lobe: &mut Lobe, scratch: &mut Scratch) -> f32 {
        let (axis, n) = (lobe.axis, lobe.exponent);
        for i in 0..values.len() {
            let cosine = axis.x * self.x[i] + axis.y * self.y[i] + axis.z * self.z[i];
            let inside = cosine.clamp(EDGE, 1.0);
            let log = log2(inside);
            let power = exp2(n * log);
            let within = if cosine > EDGE { 1.0 } else { 0.0 };
            scratch.cosine[i] = inside;
            scratch.log[i] = log;
            scratch.power[i] = power * within;
        }
        let square = dot(&scratch.power, &scratch.power);
        lobe.rho = if square > 1e-20 { (dot(&scratch.power, values) / square).max(0.0) } else { 0.0 };
        for i in 0..values.len() {
            scratch.rest[i] = values[i] - lobe.rho * scratch.power[i];
        }
        dot(&scratch.rest, &scratch.rest)
    }

    fn refine(&self, values: &[f32], start: Lobe, scratch: &mut Scratch) -> (Lobe, f32) {
        let mut lobe = start;
        let mut error = self.evaluate(values, &mut lobe, scratch);
        let mut damping = 1e-2f32;
        let mut normal = self.normal(&lobe, scratch);
        for _ in 0..ROUNDS {
            let Some(mut next) = step(&lobe, &normal, damping) else { break };
            let now = self.evaluate(values, &mut next, scratch);
            if now < error {
                let settled = now > error * (1.0 - SETTLED);
                (lobe, error, damping) = (next, now, (damping * 0.2).max(1e-7));
                if settled {
                    break;
                }
                normal = self.normal(&lobe, scratch);
            } else {
                damping *= 8.0;
                if damping > 1e5 {
                    break;
                }
            }
        }
        (lobe, error)
    }

    /// `JᵀJ` and `Jᵀr`.
    fn normal(&self, lobe: &Lobe, scratch: &mut Scratch) -> (Matrix4<f32>, Vector4<f32>) {
        let [s, t] = tangents(&lobe.axis);
        let scale = lobe.rho * lobe.exponent;
        for i in 0..self.x.len() {
            let power = scratch.power[i];
            let along = scale * power / scratch.cosine[i];
            scratch.slopes[0][i] = power;
            scratch.slopes[1][i] = along * (s.x * self.x[i] + s.y * self.y[i] + s.z * self.z[i]);
            scratch.slopes[2][i] = along * (t.x * self.x[i] + t.y * self.y[i] + t.z * self.z[i]);
            scratch.slopes[3][i] = scale * power * scratch.log[i] * std::f32::consts::LN_2;
        }
        let slopes = &scratch.slopes;
        let mut matrix = Matrix4::zeros();
        for i in 0..4 {
            for j in 0..=i {
                matrix[(i, j)] = dot(&slopes[i], &slopes[j]);
                matrix[(j, i)] = matrix[(i, j)];
            }
        }
        (matrix, Vector4::from_fn(|i, _| dot(&slopes[i], &scratch.rest)))
    }
}

impl Scratch {
    fn new(lights: usize) -> Self {
        let list = || vec![0.0; lights];
        Self { cosine: list(), log: list(), power: list(), slopes: std::array::from_fn(|_| list()), rest: list() }
    }
}

/// The lobe one damped step on; its height is left to be found.
fn step(lobe: &Lobe, (matrix, right): &(Matrix4<f32>, Vector4<f32>), damping: f32) -> Option<Lobe> {
    let mut damped = *matrix;
    let floor = 1e-9 * matrix.diagonal().amax() + f32::MIN_POSITIVE;
    (0..4).for_each(|i| damped[(i, i)] += damping * matrix[(i, i)] + floor);
    let change = damped.cholesky()?.solve(right);
    if change.iter().any(|c| !c.is_finite()) {
        return None;
    }
    let [s, t] = tangents(&lobe.axis);
    let limit = |x: f32, most: f32| x.clamp(-most, most);
    let axis = raised(lobe.axis + s * limit(change[1], 0.5) + t * limit(change[2], 0.5));
    let exponent = (lobe.exponent * limit(change[3], 1.5).exp()).clamp(EXPONENTS[0], EXPONENTS[1]);
    Some(Lobe { rho: 0.0, axis, exponent })
}

/// A unit vector no lower than [`LOWEST`].
fn raised(direction: Vector3<f32>) -> Vector3<f32> {
    let unit = direction.try_normalize(1e-20).unwrap_or_else(Vector3::z);
    if unit.z >= LOWEST { unit } else { Vector3::new(unit.x, unit.y, LOWEST).normalize() }
}

fn tangents(axis: &Vector3<f32>) -> [Vector3<f32>; 2] {
    let helper = if axis.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let s = helper.cross(axis).normalize();
    [s, axis.cross(&s)]
}

/// Base-2 logarithm of a positive normal number, to 1e-7, the same on all machines. In lanes where it is in a loop.
pub(super) fn log2(x: f32) -> f32 {
    const ROOT_HALF: u32 = 0x3f35_04f3;
    let shifted = x.to_bits().wrapping_sub(ROOT_HALF) as i32;
    let exponent = shifted >> 23;
    let mantissa = f32::from_bits(x.to_bits().wrapping_sub((exponent << 23) as u32));
    let t = (mantissa - 1.0) / (mantissa + 1.0);
    let q = t * t;
    let series = t * (1.0 + q * (1.0 / 3.0 + q * (0.2 + q * (1.0 / 7.0))));
    exponent as f32 + series * (2.0 * std::f32::consts::LOG2_E)
}

/// `2ˣ`, to 1e-6 relative, the same on all machines; x below −126 counts as −126, above 126 as 126.
pub(super) fn exp2(x: f32) -> f32 {
    /// Added, it rounds to the nearest integer, which then stands in the lowest bits.
    const ROUNDER: f32 = 12_582_912.0;
    let x = x.clamp(-126.0, 126.0);
    let rounded = x + ROUNDER;
    let f = (x - (rounded - ROUNDER)) * std::f32::consts::LN_2;
    let series = 1.0 + f * (1.0 + f * (0.5 + f * (1.0 / 6.0 + f * (1.0 / 24.0 + f * (1.0 / 120.0 + f / 720.0)))));
    f32::from_bits(series.to_bits().wrapping_add(rounded.to_bits().wrapping_sub(ROUNDER.to_bits()) << 23))
}

#[cfg(test)]
mod tests {
    use super::*;
    use capture::btf::bonn_directions;

    fn shown(lobe: &Lobe) -> Vec<f32> {
        bonn_directions().iter().map(|l| lobe.value(&l.cast())).collect()
    }

    #[test]
    fn powers_agree_with_the_library() {
        for i in 1..2000 {
            let x = i as f32 * 0.0007;
            assert!((log2(x) - x.log2()).abs() < 2e-6, "log2 {x}");
            let y = i as f32 * 0.126 - 126.0;
            assert!((exp2(y) / y.exp2() - 1.0).abs() < 1e-6, "exp2 {y}");
        }
        assert!(exp2(-1e9) > 0.0 && exp2(1e9).is_finite());
    }

    #[test]
    fn a_lobe_is_recovered() {
        let lights = Lights::new(&bonn_directions());
        for (exponent, x, y) in
            [(1.0, 0.0, 0.0), (0.5, 0.3, -0.2), (6.0, -0.5, 0.1), (25.0, 0.2, 0.4), (60.0, 0.1, 0.02)]
        {
            let axis = Vector3::new(x, y, 1.0f32).normalize();
            let truth = Lobe { rho: 0.7, axis, exponent };
            let values = shown(&truth);
            let found = lights.fit(&values);
            let error = shown(&found).iter().zip(&values).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(error < 0.004, "{error} of exponent {exponent}: {found:?}");
        }
    }

    #[test]
    fn black_one_light_spikes_and_huge_values_stay_within_bounds() {
        let lights = Lights::new(&bonn_directions());
        assert_eq!(lights.fit(&[0.0; 81]).rho, 0.0);
        assert_eq!(lights.fit(&[-1.0; 81]).rho, 0.0);
        let mut spike = [0.0; 81];
        spike[70] = 1.0;
        for values in [spike, [1.0; 81], std::array::from_fn(|i| if i == 3 { 1e6 } else { 1.0 })] {
            let found = lights.fit(&values);
            assert!(found.rho.is_finite() && found.rho >= 0.0 && found.axis.z > 0.0, "{found:?}");
            assert!((EXPONENTS[0]..=EXPONENTS[1]).contains(&found.exponent), "{found:?}");
        }
        let one = Lights::new(&[Vector3::new(0.6, 0.0, 0.8)]);
        let found = one.fit(&[0.5]);
        assert!((found.value(&Vector3::new(0.6, 0.0, 0.8)) - 0.5).abs() < 1e-5, "{found:?}");
    }
}
