//! Polynomial texture maps, one per view: each texel is a biquadratic of where the light stands.
//!
//! ```text
//! L(u, v) = a₀u² + a₁v² + a₂uv + a₃u + a₄v + a₅       (u, v) = (x, y) of the unit vector towards the light
//! ```
//!
//! for each channel, so 18 numbers a texel and view. Between measured views values are interpolated; the light needs no
//! interpolation, and is carried to the border of the measured lights where it is beyond, for a polynomial
//! says nothing there.
//!
//! *Parameters*: the noise that coding may add. Standard: 8 bits a coefficient, hence 243/18 = 13.5, with an
//! offset and step for each coefficient, channel and view. A ratio or quality sets the step: coefficients that
//! matter less under the lights measured then get fewer bits. [`Budget::Components`] counts coefficients, of
//! which there are 6 a channel: anything else is refused. Auto is Standard.
//! *Cost*: fit one pseudo-inverse, 6 × n_i, then `6 n_i` multiplications a texel, channel and view; a value 54.
//! *Limits*: blind to edges of shadows and to highlights.
//! *Degenerate data*: lights in one plane or in one place leave coefficients undetermined; the smallest that
//! reproduce the data are taken (singular values below 1e-9 of the largest are 0). Values are clamped at 0.
//!
//! Source: Malzbender, Gelb, Wolters, "Polynomial texture maps", SIGGRAPH 2001, equations 3 to 5; per view in
//! Filip and Haindl, "Bidirectional texture function modeling: a state of the art survey", PAMI 2009.

use super::budget::{bytes_for, check_samples, error_of};
use super::container::{Fault, Reader, Stored, Writer};
use super::principal::times;
use super::rows::{Coding, Rows};
use super::{Blend, Budget, FitReport, Frame, Precision, Sampler};
use crate::TextureError;
use capture::btf::Btf;
use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;

/// Coefficients of a channel.
pub const TERMS: usize = 6;
/// Coefficients of a texel under one view.
const COEFFICIENTS: usize = 3 * TERMS;
/// Bits of a coefficient of [`Budget::Standard`].
const STANDARD_BITS: u32 = 8;
/// Singular values below this share of the largest are taken for 0.
const CUT_OFF: f64 = 1e-9;
/// Halvings of the interval of noise in which a ratio is met.
const BISECTIONS: usize = 24;

/// How it is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// How finely coefficients are stored.
    pub budget: Budget,
    /// Floats, or as the budget says.
    pub precision: Precision,
}

/// The codec.
#[derive(Clone, Debug, PartialEq)]
pub struct Ptm {
    frame: Frame,
    /// One a view; elements texels, rows (channel, term).
    maps: Vec<Rows>,
}

impl Options {
    /// What a budget means for this codec; nothing here is random.
    ///
    /// # Errors
    /// Where a ratio or quality is out of range, or another number of coefficients is asked for than 6.
    pub fn new(_btf: &Btf, budget: Budget, precision: Precision, _seed: u64) -> Result<Self, TextureError> {
        match budget.checked()? {
            Budget::Components(count) if count != TERMS => Err(TextureError::Degenerate {
                fault: format!("a polynomial texture map of {count} coefficients"),
                remedy: format!("it has {TERMS} a channel; ask for a ratio or a quality instead"),
            }),
            budget => Ok(Self { budget, precision }),
        }
    }
}

/// Fits the codec. The objective is the RMSE × 255 of the polynomials before they are coded.
///
/// # Errors
/// Where samples are not finite.
pub fn fit(btf: &Btf, options: &Options) -> Result<(Ptm, FitReport), TextureError> {
    check_samples(btf)?;
    let frame = Frame::of(btf);
    let design = design(&btf.lights);
    let inverse = pseudo_inverse(&design);
    let length = 3 * btf.texels();
    let fitted: Vec<(DMatrix<f32>, f64)> = btf
        .samples
        .par_chunks_exact(length * btf.lights.len())
        .map(|view| coefficients(&DMatrix::from_column_slice(length, btf.lights.len(), view), &inverse, &design))
        .collect();
    let squares: f64 = fitted.iter().map(|(_, square)| square).sum();
    let gains: Vec<f64> = design.column_iter().map(|term| (term.norm_squared() / term.len() as f64).sqrt()).collect();
    let code = |noise: Noise| -> Vec<Rows> { fitted.par_iter().map(|(a, _)| coded(a, &gains, noise)).collect() };
    let mut report = FitReport::default();
    report.objective.push(255.0 * (squares / btf.samples.len() as f64).sqrt());
    let maps = match (options.precision, options.budget) {
        (Precision::Full, _) => code(Noise::None),
        (_, Budget::Ratio(ratio)) => within(bytes_for(ratio, btf), &code, &mut report.notes),
        (_, Budget::Quality(quality)) => code(Noise::Rms(error_of(quality))),
        _ => code(Noise::Bits(STANDARD_BITS)),
    };
    Ok((Ptm { frame, maps }, report))
}

/// Bytes of a texel under one view with 8 bits a coefficient.
pub fn printed_bytes() -> usize {
    COEFFICIENTS
}

/// How coefficients are coded.
#[derive(Clone, Copy)]
enum Noise {
    None,
    Bits(u32),
    /// RMS in the samples, of all coefficients together.
    Rms(f64),
}

/// The terms of the polynomial.
fn terms(u: f32, v: f32) -> [f32; TERMS] {
    [u * u, v * v, u * v, u, v, 1.0]
}

/// n_i × 6.
fn design(lights: &[Vector3<f64>]) -> DMatrix<f64> {
    DMatrix::from_fn(lights.len(), TERMS, |i, j| f64::from(terms(lights[i].x as f32, lights[i].y as f32)[j]))
}

/// n_i × 6, transposed: coefficients are samples times it. Of minimum norm where lights leave some undetermined.
fn pseudo_inverse(design: &DMatrix<f64>) -> DMatrix<f32> {
    let none = || DMatrix::zeros(TERMS, design.nrows());
    let inverse = design.clone().try_svd(true, true, 1e-15, 10_000).map_or_else(none, |svd| {
        let largest = svd.singular_values.amax();
        svd.pseudo_inverse(CUT_OFF * largest).unwrap_or_else(|_| none())
    });
    inverse.transpose().cast()
}

/// Coefficients, (texel, channel) × term, of pictures, (texel, channel) × light, and the sum of squared errors.
fn coefficients(view: &DMatrix<f32>, inverse: &DMatrix<f32>, design: &DMatrix<f64>) -> (DMatrix<f32>, f64) {
    let found = times(view, inverse);
    let transposed = design.transpose().cast::<f32>();
    let shown = times(&found, &transposed);
    let square = |(a, b): (&f32, &f32)| f64::from(a - b).powi(2);
    let error = shown.as_slice().iter().zip(view.as_slice()).map(square).sum();
    (found, error)
}

fn coded(coefficients: &DMatrix<f32>, gains: &[f64], noise: Noise) -> Rows {
    let texels = coefficients.nrows() / 3;
    let value = |i: usize| coefficients[(i / TERMS, i % TERMS)];
    let coding = |j: usize| match noise {
        Noise::None => Coding::Float,
        Noise::Bits(bits) => Coding::Bits(bits),
        Noise::Rms(rms) => Coding::Noise(rms / ((TERMS as f64).sqrt() * gains[j % TERMS].max(1e-3))),
    };
    Rows::new(
        texels,
        (0..texels * COEFFICIENTS).map(value).collect(),
        &(0..COEFFICIENTS).map(coding).collect::<Vec<_>>(),
    )
}

/// The least noise that `most` bytes allow.
fn within(most: usize, code: &dyn Fn(Noise) -> Vec<Rows>, notes: &mut Vec<String>) -> Vec<Rows> {
    let size = |maps: &[Rows]| maps.iter().map(Rows::bytes).sum::<usize>();
    let (mut fine, mut coarse) = (1e-6f64, 10.0f64);
    let mut found = code(Noise::Rms(coarse));
    if size(&found) > most {
        notes.push(format!("{most} bytes were asked for, {} are needed", size(&found)));
        return found;
    }
    for _ in 0..BISECTIONS {
        let middle = (fine * coarse).sqrt();
        let tried = code(Noise::Rms(middle));
        if size(&tried) > most {
            fine = middle;
        } else {
            (coarse, found) = (middle, tried);
        }
    }
    found
}

impl Ptm {
    /// The terms at a light, which beyond the outermost measured one is carried to the border.
    fn terms_at(&self, light: &Vector3<f32>) -> [f32; TERMS] {
        let blend = self.frame.lights.blend(light);
        let on_border = blend.entries[2].1 <= 0.0;
        let direction = if on_border { self.blended(&blend) } else { *light };
        let unit = direction.try_normalize(1e-20).unwrap_or_else(Vector3::z);
        terms(unit.x, unit.y)
    }

    fn blended(&self, blend: &Blend) -> Vector3<f32> {
        let vectors = self.frame.lights.vectors();
        blend.entries.iter().map(|&(l, w)| vectors[l as usize].cast::<f32>() * w).sum()
    }
}

fn polynomial(coefficients: &[f32], terms: &[f32; TERMS]) -> f32 {
    coefficients.iter().zip(terms).map(|(a, t)| a * t).sum()
}

impl Sampler for Ptm {
    fn frame(&self) -> &Frame {
        &self.frame
    }

    fn value(&self, texel: usize, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3] {
        let terms = self.terms_at(light);
        let mut value = [0.0; 3];
        for (view, weight) in self.frame.views.blend(view).entries.into_iter().filter(|(_, w)| *w > 0.0) {
            let map = self.maps[view as usize].element(texel);
            (0..3).for_each(|c| value[c] += weight * polynomial(&map[c * TERMS..][..TERMS], &terms).max(0.0));
        }
        value
    }

    fn picture(&self, light: &Vector3<f32>, view: &Vector3<f32>) -> Vec<f32> {
        let terms = self.terms_at(light);
        let mut picture = vec![0.0; 3 * self.frame.texels()];
        for (view, weight) in self.frame.views.blend(view).entries.into_iter().filter(|(_, w)| *w > 0.0) {
            let coefficients = self.maps[view as usize].elements(0, self.frame.texels()).chunks_exact(TERMS);
            picture.iter_mut().zip(coefficients).for_each(|(p, a)| *p += weight * polynomial(a, &terms).max(0.0));
        }
        picture
    }
}

impl Stored for Ptm {
    fn write(&self, out: &mut Writer) {
        out.part("coefficients");
        self.maps.iter().for_each(|map| map.write(out));
    }

    fn read(from: &mut Reader<'_>, frame: Frame) -> Result<Self, Fault> {
        let read = |_| Rows::read(from, frame.texels(), COEFFICIENTS);
        Ok(Self { maps: (0..frame.views.len()).map(read).collect::<Result<_, _>>()?, frame })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use capture::btf::bonn_directions;

    /// Pictures of one row of 4 texels that are the given function of (texel, channel, light).
    fn view(lights: &[Vector3<f64>], shade: impl Fn(usize, &Vector3<f64>) -> f64) -> DMatrix<f32> {
        DMatrix::from_fn(12, lights.len(), |e, i| shade(e, &lights[i]) as f32)
    }

    fn fitted(lights: &[Vector3<f64>], data: &DMatrix<f32>) -> (DMatrix<f32>, f64) {
        let design = design(lights);
        coefficients(data, &pseudo_inverse(&design), &design)
    }

    #[test]
    fn the_printed_ratio_is_reproduced() {
        assert!((f64::from(3 * 81) / printed_bytes() as f64 - 13.5).abs() < 1e-12);
    }

    #[test]
    fn a_biquadratic_is_exact_and_a_constant_has_one_coefficient() {
        let lights = bonn_directions();
        let truth = |e: usize, j: usize| ((e * 7 + j * 3) as f64).sin() * 0.3;
        let value = |e: usize, l: &Vector3<f64>| {
            (0..TERMS).map(|j| truth(e, j) * f64::from(terms(l.x as f32, l.y as f32)[j])).sum()
        };
        let (found, error) = fitted(&lights, &view(&lights, value));
        assert!(found.iter().enumerate().all(|(i, &a)| (f64::from(a) - truth(i % 12, i / 12)).abs() < 1e-5));
        assert!(error < 1e-9);
        let (constant, _) = fitted(&lights, &view(&lights, |_, _| 0.4));
        assert!(constant.columns(0, 5).amax() < 1e-6 && (constant.column(5).min() - 0.4).abs() < 1e-6);
    }

    #[test]
    fn lights_in_a_plane_or_in_one_place_give_the_smallest_coefficients() {
        let plane: Vec<_> = bonn_directions().into_iter().filter(|l| l.y.abs() < 1e-9).collect();
        let (found, error) = fitted(&plane, &view(&plane, |e, l| 0.2 + 0.01 * e as f64 + 0.3 * l.x));
        assert!(error < 1e-9, "{error}");
        assert!([1, 2, 4].iter().all(|&j| found.column(j).amax() < 1e-6), "nothing is known of y");
        let one = [Vector3::new(0.6, 0.0, 0.8)];
        let (found, error) = fitted(&one, &view(&one, |e, _| 0.05 * e as f64));
        assert!(error < 1e-12 && found.iter().all(|a| a.is_finite()));
    }
}
