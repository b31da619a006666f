//! Polynomial Lafortune lobes, one per view.
//!
//! ```text
//! Y_v(x, c | i) = ρ · max(0, C·i)ⁿ                    ‖C‖ = 1; ρ, C, n of texel x, channel c, view v
//! I(x, c | i, v) ≈ p_vic(Y_v(x, c | i))               p_vic: polynomial of degree 4, one per picture and channel
//! ```
//!
//! The lobe follows the light over each texel; the polynomial brings the lobe's picture to the measured one. Between measured
//! lights the lobe is taken at the light itself, and polynomials are interpolated; between views, values.
//!
//! *Parameters*: bits of the numbers. ρ, C_x, C_y and log n of 8 bits each are Standard and Auto; a ratio or quality sets how
//! many they have together. The literature stores five numbers, the third of C too ([`printed_bytes`]).
//! A polynomial is stored by the smallest and largest Y of its picture and five values at Chebyshev nodes between,
//! in 8 bits: so rounding moves it by about as much, and outside that range it stays as it is at its end.
//! [`Budget::Components`] counts lobes: 1, anything else is refused.
//! *Cost*: fit two starts of at most 20 rounds of Levenberg and Marquardt a texel, channel and view, then least squares
//! of 5 coefficients a picture and channel; a value 9 powers and 27 polynomials.
//! *Limits*: one lobe does not hold both gloss and matt shading, nor a shadow's edge; the ratio does not grow with the tile.
//! *Degenerate data*: what is never lit has ρ = 0; a picture that is constant has a constant polynomial; one light fixes nothing but the value there.
//!
//! Source: Filip and Haindl, "Non-linear reflectance model for bidirectional texture function synthesis", ICPR 2004;
//! Lafortune, Foo, Torrance, Greenberg, SIGGRAPH 1997. Values are clamped at 0.

mod lobe;

use super::budget::{bytes_for, check_samples};
use super::container::{Fault, Reader, Stored, Writer};
use super::rows::{Coding, Rows};
use super::{Blend, Budget, FitReport, Frame, Precision, Sampler};
use crate::TextureError;
use capture::btf::Btf;
use lobe::{EXPONENTS, Lights, Lobe, exp2, log2};
use nalgebra::{SMatrix, SVector, Vector3};
use rayon::prelude::*;

/// Numbers of a lobe: ρ, C_x, C_y, log₂ n.
const NUMBERS: usize = 4;
/// Bits of them together in [`Budget::Standard`].
const STANDARD_BITS: u32 = 32;
/// Bits of them together, at least and at most.
const BITS: [u32; 2] = [4, 64];
/// Coefficients of a polynomial.
const TERMS: usize = 5;
/// Bits of what describes a polynomial.
const POLYNOMIAL_BITS: u32 = 8;
/// Ranges of Y narrower than this are a point.
const NARROW: f32 = 1e-6;
/// What is added to the diagonal of the least squares of a polynomial, as a share of its samples.
const RIDGE: f64 = 1e-5;

/// How it is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// How finely lobes are stored.
    pub budget: Budget,
    /// Floats, or as the budget says.
    pub precision: Precision,
}

/// The codec.
#[derive(Clone, Debug, PartialEq)]
pub struct Lafortune {
    frame: Frame,
    views: Vec<View>,
}

#[derive(Clone, Debug, PartialEq)]
struct View {
    /// Elements texels, rows (channel, number).
    lobes: Rows,
    /// Elements (light, channel), rows smallest and largest Y.
    ranges: Rows,
    /// Elements (light, channel), rows values at Chebyshev nodes.
    nodes: Rows,
    /// (light, channel), for evaluation.
    polynomials: Vec<Polynomial>,
}

/// `Σ_j a_j tʲ`, t = Y · scale + shift clamped to −1..1.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Polynomial {
    scale: f32,
    shift: f32,
    terms: [f32; TERMS],
}

impl Options {
    /// What a budget means for this codec; nothing here is random.
    ///
    /// # Errors
    /// Where a ratio or quality is out of range, or another number of lobes is asked for than 1.
    pub fn new(_btf: &Btf, budget: Budget, precision: Precision, _seed: u64) -> Result<Self, TextureError> {
        match budget.checked()? {
            Budget::Components(count) if count != 1 => Err(TextureError::Degenerate {
                fault: format!("{count} Lafortune lobes a texel and view"),
                remedy: "this codec has 1; ask for a ratio or a quality instead".into(),
            }),
            budget => Ok(Self { budget, precision }),
        }
    }
}

/// Fits the codec. The objective is the RMSE × 255 as stored.
///
/// # Errors
/// Where samples are not finite.
pub fn fit(btf: &Btf, options: &Options) -> Result<(Lafortune, FitReport), TextureError> {
    check_samples(btf)?;
    let frame = Frame::of(btf);
    let mut report = FitReport::default();
    let bits = match (options.precision, options.budget) {
        (Precision::Full, _) => None,
        (_, Budget::Ratio(ratio)) => Some(bits_within(btf, bytes_for(ratio, btf), &mut report.notes)),
        (_, Budget::Quality(quality)) => Some((16.0 + 0.24 * quality).round() as u32),
        _ => Some(STANDARD_BITS),
    };
    let lights = Lights::new(&btf.lights);
    let samples = 3 * btf.texels() * btf.lights.len();
    let fitted: Vec<(View, f64)> =
        btf.samples.par_chunks_exact(samples).map(|pictures| fit_view(pictures, btf, &lights, bits)).collect();
    let square: f64 = fitted.iter().map(|(_, square)| square).sum();
    report.objective.push(255.0 * (square / btf.samples.len() as f64).sqrt());
    let views = fitted.into_iter().map(|(view, _)| view).collect();
    Ok((Lafortune { frame, views }, report))
}

/// Bytes of one view as the literature counts them: five numbers of a lobe and five of a polynomial, 8 bits each.
pub fn printed_bytes(texels: usize, lights: usize) -> usize {
    3 * (5 * texels + TERMS * lights)
}

fn lobe_codings(bits: Option<u32>) -> Vec<Coding> {
    let number = |j: usize| match bits {
        None => Coding::Float,
        // What four do not divide goes to the axis, then to the height.
        Some(bits) => Coding::Bits(bits / 4 + u32::from([2, 0, 1, 3][j] < bits % 4)),
    };
    (0..3 * NUMBERS).map(|j| number(j % NUMBERS)).collect()
}

fn polynomial_codings(bits: Option<u32>, rows: usize) -> Vec<Coding> {
    vec![bits.map_or(Coding::Float, |_| Coding::Bits(POLYNOMIAL_BITS)); rows]
}

/// The most bits a lobe may have.
fn bits_within(btf: &Btf, most: usize, notes: &mut Vec<String>) -> u32 {
    let row = |length: usize, bits: u32| 9 + (length * bits as usize).div_ceil(8);
    let size = |bits: u32| {
        let lobe = |coding: Coding| row(btf.texels(), coding.bits(0.0));
        let lobes: usize = lobe_codings(Some(bits)).into_iter().map(lobe).sum();
        btf.views.len() * (lobes + (2 + TERMS) * row(3 * btf.lights.len(), POLYNOMIAL_BITS))
    };
    (BITS[0]..=BITS[1]).rev().find(|&bits| size(bits) <= most).unwrap_or_else(|| {
        notes.push(format!("{most} bytes were asked for, {} are needed", size(BITS[0])));
        BITS[0]
    })
}

/// A view's lobes and polynomials, of its pictures (light, texel, channel), and the sum of squared errors.
fn fit_view(pictures: &[f32], btf: &Btf, lights: &Lights, bits: Option<u32>) -> (View, f64) {
    let (length, count) = (3 * btf.texels(), btf.lights.len());
    let element = |e: usize| {
        let values: Vec<f32> = (0..count).map(|i| pictures[i * length + e]).collect();
        let lobe = lights.fit(&values);
        [lobe.rho, lobe.axis.x, lobe.axis.y, log2(lobe.exponent)]
    };
    let numbers: Vec<f32> = (0..length).into_par_iter().flat_map_iter(element).collect();
    let lobes = Rows::new(btf.texels(), numbers, &lobe_codings(bits));
    let shown = shown(&lobes, &btf.lights);
    let ranges: Vec<f32> = (0..3 * count).flat_map(|p| range(&shown, p, length)).collect();
    let ranges = Rows::new(3 * count, ranges, &polynomial_codings(bits, 2));
    let pairs = |p: usize| {
        let place = move |x: usize| (p / 3) * length + 3 * x + p % 3;
        (0..btf.texels()).map(|x| (shown[place(x)], pictures[place(x)])).collect::<Vec<_>>()
    };
    let node = |p: usize| fit_nodes(&pairs(p), domain(ranges.element(p)));
    let nodes: Vec<f32> = (0..3 * count).into_par_iter().flat_map_iter(node).collect();
    let nodes = Rows::new(3 * count, nodes, &polynomial_codings(bits, TERMS));
    let view = View::new(lobes, ranges, nodes);
    let error = |p: usize| {
        let square = |(y, value): (f32, f32)| f64::from(view.polynomials[p].value(y) - value).powi(2);
        pairs(p).into_iter().map(square).sum::<f64>()
    };
    let squares: Vec<f64> = (0..3 * count).into_par_iter().map(error).collect();
    (view, squares.iter().sum())
}

/// Y of all pictures, (light, texel, channel).
fn shown(lobes: &Rows, lights: &[Vector3<f64>]) -> Vec<f32> {
    let decoded: Vec<Lobe> =
        (0..lobes.length()).flat_map(|x| lobes.element(x).chunks_exact(NUMBERS).map(decode)).collect();
    lights.par_iter().flat_map_iter(|light| decoded.iter().map(|lobe| lobe.value(&light.cast()))).collect()
}

/// Smallest and largest Y of a (light, channel).
fn range(shown: &[f32], picture: usize, length: usize) -> [f32; 2] {
    let values = || shown[(picture / 3) * length..][..length].iter().skip(picture % 3).step_by(3).copied();
    [values().fold(f32::INFINITY, f32::min), values().fold(0.0, f32::max)]
}

/// What brings Y of a range to −1..1.
fn domain(range: &[f32]) -> (f32, f32) {
    let width = range[1] - range[0];
    if width > NARROW { (2.0 / width, -1.0 - 2.0 * range[0] / width) } else { (0.0, 0.0) }
}

fn place_in(y: f32, (scale, shift): (f32, f32)) -> f32 {
    (y * scale + shift).clamp(-1.0, 1.0)
}

/// T₀..T₄ (Chebyshev).
fn chebyshev(t: f64) -> SVector<f64, TERMS> {
    let q = t * t;
    SVector::from([1.0, t, 2.0 * q - 1.0, t * (4.0 * q - 3.0), 8.0 * q * (q - 1.0) + 1.0])
}

/// Node k of 5.
fn node(k: usize) -> f64 {
    (std::f64::consts::PI * (k as f64 + 0.5) / TERMS as f64).cos()
}

/// Values at the nodes of the polynomial nearest to (Y, measured), no further beyond the measured ones than half their range.
fn fit_nodes(pairs: &[(f32, f32)], domain: (f32, f32)) -> [f32; TERMS] {
    let mut matrix = SMatrix::<f64, TERMS, TERMS>::zeros();
    let mut right = SVector::<f64, TERMS>::zeros();
    let count = pairs.len().max(1) as f64;
    let mean = pairs.iter().map(|p| f64::from(p.1)).sum::<f64>() / count;
    for &(y, value) in pairs {
        let basis = chebyshev(f64::from(place_in(y, domain)));
        matrix += basis * basis.transpose();
        right += basis * (f64::from(value) - mean);
    }
    (0..TERMS).for_each(|j| matrix[(j, j)] += RIDGE * count);
    let coefficients = matrix.cholesky().map_or_else(SVector::zeros, |factor| factor.solve(&right));
    let low = pairs.iter().map(|p| p.1).fold(f32::INFINITY, f32::min);
    let high = pairs.iter().map(|p| p.1).fold(f32::NEG_INFINITY, f32::max);
    let margin = 0.5 * (high - low);
    let at = |k: usize| (mean + coefficients.dot(&chebyshev(node(k)))) as f32;
    std::array::from_fn(|k| at(k).clamp(low - margin, high + margin))
}

/// A lobe of its numbers, within bounds whatever they are.
fn decode(numbers: &[f32]) -> Lobe {
    let [x, y] = [numbers[1].clamp(-1.0, 1.0), numbers[2].clamp(-1.0, 1.0)];
    let z = (1.0 - x * x - y * y).max(0.0).sqrt();
    let exponent = exp2(numbers[3]).clamp(EXPONENTS[0], EXPONENTS[1]);
    Lobe { rho: numbers[0].max(0.0), axis: Vector3::new(x, y, z), exponent }
}

impl Polynomial {
    /// Of a range of Y and values at nodes.
    fn new(range: &[f32], nodes: &[f32]) -> Self {
        let (scale, shift) = domain(range);
        let coefficient = |j: usize| {
            let sum: f64 = (0..TERMS).map(|k| f64::from(nodes[k]) * chebyshev(node(k))[j]).sum();
            sum * if j == 0 { 1.0 } else { 2.0 } / TERMS as f64
        };
        let a: [f64; TERMS] = std::array::from_fn(coefficient);
        let terms = [a[0] - a[2] + a[4], a[1] - 3.0 * a[3], 2.0 * a[2] - 8.0 * a[4], 4.0 * a[3], 8.0 * a[4]];
        Self { scale, shift, terms: terms.map(|term| term as f32) }
    }

    fn value(&self, y: f32) -> f32 {
        let t = place_in(y, (self.scale, self.shift));
        self.terms.iter().rev().fold(0.0, |sum, term| sum * t + term)
    }
}

impl View {
    fn new(lobes: Rows, ranges: Rows, nodes: Rows) -> Self {
        let polynomials = (0..ranges.length()).map(|p| Polynomial::new(ranges.element(p), nodes.element(p))).collect();
        Self { lobes, ranges, nodes, polynomials }
    }

    /// `light` for the lobe, `lights` for the polynomials.
    fn value(&self, texel: usize, channel: usize, light: &Vector3<f32>, lights: &Blend) -> f32 {
        let y = decode(&self.lobes.element(texel)[channel * NUMBERS..][..NUMBERS]).value(light);
        let used = lights.entries.iter().filter(|(_, w)| *w > 0.0);
        used.map(|&(l, w)| w * self.polynomials[3 * l as usize + channel].value(y)).sum::<f32>().max(0.0)
    }
}

impl Sampler for Lafortune {
    fn frame(&self) -> &Frame {
        &self.frame
    }

    fn value(&self, texel: usize, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3] {
        let lights = self.frame.lights.blend(light);
        let light = light.try_normalize(1e-20).filter(|l| l.x.is_finite()).unwrap_or_else(Vector3::z);
        let mut value = [0.0; 3];
        for (view, weight) in self.frame.views.blend(view).entries.into_iter().filter(|(_, w)| *w > 0.0) {
            let view = &self.views[view as usize];
            (0..3).for_each(|c| value[c] += weight * view.value(texel, c, &light, &lights));
        }
        value
    }
}

impl Stored for Lafortune {
    fn write(&self, out: &mut Writer) {
        out.part("lobes");
        self.views.iter().for_each(|view| view.lobes.write(out));
        out.part("polynomials");
        for view in &self.views {
            view.ranges.write(out);
            view.nodes.write(out);
        }
    }

    fn read(from: &mut Reader<'_>, frame: Frame) -> Result<Self, Fault> {
        let (views, pictures) = (frame.views.len(), 3 * frame.lights.len());
        let lobes = (0..views).map(|_| Rows::read(from, frame.texels(), 3 * NUMBERS)).collect::<Result<Vec<_>, _>>()?;
        let view = |lobes| {
            let ranges = Rows::read(from, pictures, 2)?;
            Ok(View::new(lobes, ranges, Rows::read(from, pictures, TERMS)?))
        };
        Ok(Self { views: lobes.into_iter().map(view).collect::<Result<_, _>>()?, frame })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_printed_ratio_is_reproduced() {
        assert_eq!(format!("{:.2}", f64::from(625 * 3 * 81) / printed_bytes(625, 81) as f64), "14.34");
    }

    #[test]
    fn a_polynomial_of_degree_four_is_found_and_stays_within_its_range() {
        let truth = |y: f32| 0.3 + 0.2 * y - 0.5 * y * y + y.powi(4);
        let pairs: Vec<_> = (0..50).map(|i| i as f32 * 0.02).map(|y| (y, truth(y))).collect();
        let range = [0.0, 0.98];
        let found = Polynomial::new(&range, &fit_nodes(&pairs, domain(&range)));
        assert!(pairs.iter().all(|&(y, value)| (found.value(y) - value).abs() < 1e-3));
        assert_eq!(found.value(7.0), found.value(0.98));
        let constant = fit_nodes(&[(0.4, 0.7); 9], domain(&[0.4, 0.4]));
        assert!((Polynomial::new(&[0.4, 0.4], &constant).value(0.1) - 0.7).abs() < 1e-6);
    }

    #[test]
    fn left_over_bits_go_to_the_axis_first() {
        let bits = |total| lobe_codings(Some(total))[..NUMBERS].iter().map(|c| c.bits(1.0)).collect::<Vec<_>>();
        assert_eq!(bits(32), [8, 8, 8, 8]);
        assert_eq!(bits(33), [8, 9, 8, 8]);
        assert_eq!(bits(34), [8, 9, 9, 8]);
        assert_eq!(bits(35), [9, 9, 9, 8]);
    }
}
