//! What a file holds.
//!
//! ```text
//! u8     1 compact, else full; plus 2 and 4 where the tile continues itself along x and y
//! u32    M
//! mean   (view, light, channel): u8, 255 stands for 1
//! full   M × (f32 weight, f32 × 9 means, f32 × 9 deviations)
//! compact M × (u8 weight, u16 × 6 means, u8 × 6 deviations, u16 × 3 colours)
//! ```
//!
//! Compact codes are even in the means, and in the logarithms of weights and deviations. The deviations of colours are
//! needed to fit and by no answer: compact files do not hold them.

use super::GaussianMixture;
use super::mixture::Component;
use super::refit::LARGEST_COLOUR;
use super::size::MOST;
use super::variables::{INPUTS, Period, VARIABLES};
use crate::btf::container::{Fault, Reader, Stored, Writer};
use crate::btf::{Frame, Precision};
use std::f64::consts::FRAC_PI_2;

/// Logarithm of the smallest weight.
pub(super) const LEAST_LOG_WEIGHT: f64 = -20.0;
/// What the deviations of colours are where no file holds them.
const UNKNOWN_SIGMA: f64 = 1.0;
/// Numbers of a full file are within this, and deviations above its inverse.
const LARGEST: f64 = 1e5;

/// How sizes are counted in print.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counting {
    /// Samples over numbers, means and deviations of components and the mean picture, each as one.
    Numbers,
    /// Bytes, numbers of components being 4/1000 of 1024 bytes each.
    Kibibytes,
    /// Bytes without those of the weights.
    WithoutWeights,
    /// Bytes of all that is needed.
    Everything,
}

/// The compression ratio as the source counts it (sections 3 and 4; its 1 : 45 323, 1 : 22 989 and 195.6), and as
/// it would be: raw bytes, one a sample, over what M components and the mean picture of that many pairs take.
pub fn ratio_as_printed(raw: f64, components: usize, pairs: usize, counting: Counting) -> f64 {
    let (numbers, mean) = ((components * 2 * VARIABLES) as f64, 3.0 * pairs as f64);
    let taken = match counting {
        Counting::Numbers => numbers,
        Counting::Kibibytes => numbers * 4.0 * 1.024,
        Counting::WithoutWeights => numbers * 4.0,
        Counting::Everything => (numbers + components as f64) * 4.0,
    };
    raw / (taken + mean)
}

/// Bytes as the source counts them: 18 floats a component, without its weight, and the mean picture in bytes.
pub fn printed_bytes(components: usize, pairs: usize) -> usize {
    4 * 2 * VARIABLES * components + 3 * pairs
}

/// Bytes of a component.
pub(super) fn component_bytes(precision: Precision) -> usize {
    match precision {
        Precision::Full => 4 * (1 + 2 * VARIABLES),
        Precision::Compact => 1 + 2 * INPUTS + INPUTS + 2 * 3,
    }
}

/// Bytes of a file without its components: the container's header and directions, and the mean picture.
pub(super) fn other_bytes(btf: &capture::btf::Btf) -> usize {
    crate::btf::container::header_bytes(btf) + 1 + 4 + 3 * btf.pairs()
}

/// Codes evenly spaced between two values.
#[derive(Clone, Copy)]
struct Scale {
    low: f64,
    high: f64,
    steps: f64,
}

impl Scale {
    fn code(self, value: f64) -> u16 {
        ((value - self.low) / (self.high - self.low) * self.steps).round().clamp(0.0, self.steps) as u16
    }

    fn value(self, code: u16) -> f64 {
        self.low + (self.high - self.low) * f64::from(code) / self.steps
    }
}

/// The codes of means of the inputs and logarithms of their deviations.
fn scales(frame: &Frame) -> [[Scale; 2]; INPUTS] {
    let mean = |low: f64, high: f64| Scale { low, high, steps: 65535.0 };
    let sigma = |low: f64, high: f64| Scale { low: low.ln(), high: high.ln(), steps: 255.0 };
    let side = |texels: usize| [mean(0.0, texels as f64), sigma(0.25, 4.0 * texels as f64)];
    let [alpha, s] = [mean(-FRAC_PI_2, FRAC_PI_2), mean(-1.0, 1.0)].map(|m| [m, sigma(0.04, 4.0)]);
    [side(frame.width), side(frame.height), alpha, s, alpha, s]
}

const WEIGHT: Scale = Scale { low: LEAST_LOG_WEIGHT, high: 0.0, steps: 255.0 };
const COLOUR: Scale = Scale { low: -LARGEST_COLOUR, high: LARGEST_COLOUR, steps: 65535.0 };

/// The component as it comes back from a file.
pub(super) fn rounded(component: &Component, precision: Precision, frame: &Frame) -> Component {
    match precision {
        Precision::Full => {
            let single = |v: f64| f64::from(v as f32);
            Component {
                weight: single(component.weight),
                mean: component.mean.map(single),
                sigma: component.sigma.map(single),
            }
        }
        Precision::Compact => from_codes(&to_codes(component, frame), frame),
    }
}

/// Weight, means of inputs, deviations of inputs, colours.
type Codes = (u16, [u16; INPUTS], [u16; INPUTS], [u16; 3]);

fn to_codes(component: &Component, frame: &Frame) -> Codes {
    let scales = scales(frame);
    (
        WEIGHT.code(component.weight.ln()),
        std::array::from_fn(|v| scales[v][0].code(component.mean[v])),
        std::array::from_fn(|v| scales[v][1].code(component.sigma[v].ln())),
        std::array::from_fn(|c| COLOUR.code(component.mean[INPUTS + c])),
    )
}

fn from_codes((weight, means, sigmas, colours): &Codes, frame: &Frame) -> Component {
    let scales = scales(frame);
    let mean = |v: usize| if v < INPUTS { scales[v][0].value(means[v]) } else { COLOUR.value(colours[v - INPUTS]) };
    let sigma = |v: usize| if v < INPUTS { scales[v][1].value(sigmas[v]).exp() } else { UNKNOWN_SIGMA };
    Component {
        weight: WEIGHT.value(*weight).exp(),
        mean: std::array::from_fn(mean),
        sigma: std::array::from_fn(sigma),
    }
}

impl Stored for GaussianMixture {
    fn write(&self, out: &mut Writer) {
        out.part("mean picture");
        let [x, y] = self.packed.periods.map(|period| u8::from(period.length > 0.0));
        out.u8(u8::from(self.precision == Precision::Compact) + 2 * x + 4 * y);
        out.u32(self.components.len() as u32);
        out.bytes(&self.mean);
        out.part("components");
        for component in &self.components {
            match self.precision {
                Precision::Full => {
                    let numbers = [component.weight].into_iter().chain(component.mean).chain(component.sigma);
                    numbers.for_each(|v| out.f32(v as f32));
                }
                Precision::Compact => {
                    let (weight, means, sigmas, colours) = to_codes(component, &self.frame);
                    out.u8(weight as u8);
                    out.u16s(&means);
                    sigmas.iter().for_each(|&code| out.u8(code as u8));
                    out.u16s(&colours);
                }
            }
        }
    }

    fn read(from: &mut Reader<'_>, frame: Frame) -> Result<Self, Fault> {
        let how = from.u8()?;
        let precision = match how {
            0..8 if how & 1 == 1 => Precision::Compact,
            0..8 => Precision::Full,
            other => return Err(Fault(format!("flags {other} are unknown; read it with a newer turnlight"))),
        };
        let period = |bit: u8, side: usize| if how & bit != 0 { Period::of(side) } else { Period::default() };
        let periods = [period(2, frame.width), period(4, frame.height)];
        let count = from.u32()? as usize;
        let mean = from.take(3 * frame.pairs())?.to_vec();
        from.expect(count, component_bytes(precision))?;
        if !(1..=MOST).contains(&count) {
            return Err(Fault(format!("it has {count} components, and 1 to {MOST} are made")));
        }
        let read = |_| match precision {
            Precision::Full => read_full(from),
            Precision::Compact => read_compact(from, &frame),
        };
        let components = (0..count).map(read).collect::<Result<Vec<_>, _>>()?;
        Ok(Self::new(frame, precision, periods, mean, components))
    }
}

fn read_full(from: &mut Reader<'_>) -> Result<Component, Fault> {
    let weight = f64::from(from.f32()?);
    let mut nine = || -> Result<[f64; VARIABLES], Fault> {
        let numbers = from.f32s(VARIABLES)?;
        Ok(std::array::from_fn(|v| f64::from(numbers[v])))
    };
    let (mean, sigma) = (nine()?, nine()?);
    let sound = weight >= LEAST_LOG_WEIGHT.exp() * 0.99
        && weight <= 1.01
        && mean.iter().all(|m| m.abs() <= LARGEST)
        && sigma.iter().all(|s| (1.0 / LARGEST..=LARGEST).contains(s));
    if !sound {
        return Err(Fault(format!("a component of weight {weight} at {mean:?}, deviations {sigma:?}")));
    }
    Ok(Component { weight, mean, sigma })
}

fn read_compact(from: &mut Reader<'_>, frame: &Frame) -> Result<Component, Fault> {
    let weight = u16::from(from.u8()?);
    let means = from.u16s(INPUTS)?;
    let sigmas = from.take(INPUTS)?;
    let colours = from.u16s(3)?;
    let codes: Codes = (
        weight,
        std::array::from_fn(|v| means[v]),
        std::array::from_fn(|v| u16::from(sigmas[v])),
        std::array::from_fn(|c| colours[c]),
    );
    Ok(from_codes(&codes, frame))
}
