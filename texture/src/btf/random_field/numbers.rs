//! Numbers as they are stored: floats, or whole multiples of a common step.

use super::super::Precision;
use super::super::container::{Fault, Reader, Writer};

/// Larger numbers are nothing a fit makes; a file that holds one is refused.
const LARGEST: f32 = 1e6;

/// How many bits a number gets where space counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) enum Width {
    Byte,
    Word,
}

/// A list of numbers.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) enum Numbers {
    Floats(Vec<f32>),
    /// Step, and multiples of it.
    Words(f32, Vec<i16>),
    Bytes(f32, Vec<i8>),
}

impl Numbers {
    /// Rounds; the step is such that the largest magnitude is the last multiple.
    pub(in super::super) fn new(values: &[f64], precision: Precision, width: Width) -> Self {
        let limit = f64::from(LARGEST);
        let sane = values.iter().map(|&v| if v.is_finite() { v.clamp(-limit, limit) } else { 0.0 });
        let peak = sane.clone().fold(0.0_f64, |peak, v| peak.max(v.abs()));
        let last = if width == Width::Byte { 127.0 } else { 32767.0 };
        let step = (peak / last) as f32;
        let code = |v: f64| if step > 0.0 { (v / f64::from(step)).round().clamp(-last, last) } else { 0.0 };
        match (precision, width) {
            (Precision::Full, _) => Self::Floats(sane.map(|v| v as f32).collect()),
            (_, Width::Word) => Self::Words(step, sane.map(|v| code(v) as i16).collect()),
            (_, Width::Byte) => Self::Bytes(step, sane.map(|v| code(v) as i8).collect()),
        }
    }

    pub(in super::super) fn values(&self) -> Vec<f64> {
        match self {
            Self::Floats(values) => values.iter().map(|&v| f64::from(v)).collect(),
            Self::Words(step, codes) => codes.iter().map(|&c| f64::from(c) * f64::from(*step)).collect(),
            Self::Bytes(step, codes) => codes.iter().map(|&c| f64::from(c) * f64::from(*step)).collect(),
        }
    }

    /// Step and codes; the count is not stored.
    pub(in super::super) fn write(&self, out: &mut Writer) {
        match self {
            Self::Floats(values) => out.f32s(values),
            Self::Words(step, codes) => {
                out.f32(*step);
                codes.iter().for_each(|&c| out.u16(c as u16));
            }
            Self::Bytes(step, codes) => {
                out.f32(*step);
                codes.iter().for_each(|&c| out.u8(c as u8));
            }
        }
    }

    pub(in super::super) fn read(
        from: &mut Reader<'_>,
        count: usize,
        precision: Precision,
        width: Width,
    ) -> Result<Self, Fault> {
        let bounded = |value: f32| {
            let fault = || Fault(format!("{value} is out of the range of a model's numbers"));
            (value.abs() <= LARGEST).then_some(value).ok_or_else(fault)
        };
        Ok(match (precision, width) {
            (Precision::Full, _) => Self::Floats(from.f32s(count)?.into_iter().map(bounded).collect::<Result<_, _>>()?),
            (_, Width::Word) => {
                let step = bounded(from.f32()?)?;
                Self::Words(step, from.u16s(count)?.into_iter().map(|c| c as i16).collect())
            }
            (_, Width::Byte) => {
                let step = bounded(from.f32()?)?;
                Self::Bytes(step, from.take(count)?.iter().map(|&c| c as i8).collect())
            }
        })
    }
}
