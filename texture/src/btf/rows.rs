//! Vectors of one length, each stored with its own offset, step and width.
//!
//! ```text
//! x̂ = offset + step · code,   code in 0 ..= 2^bits − 1
//! ```
//!
//! A uniform quantiser leaves a noise of RMS step/√12. Each row is given the fewest bits that keep its noise
//! below what the caller allows, which is reverse water-filling (Cover and Thomas, "Elements of Information
//! Theory", 10.3.3): weak components cost few bits, strong ones many. In memory the same element of all rows
//! is contiguous, for that is what one evaluation needs. On disk: per row u8 bits (32: floats, no quantiser),
//! f32 offset, f32 step; then the codes row by row, packed.

use super::container::{Fault, Reader, Writer};

/// Bits of a row of floats.
const FLOAT: u32 = 32;
/// Most bits of a quantised row.
const MOST_BITS: u32 = 16;
/// Bytes of a row beside its codes.
const ROW_BYTES: usize = 9;
/// Steps finer than this share of the largest value are lost when an f32 is rounded.
const FINEST: f32 = 1.0 / (1 << 21) as f32;
/// Numbers beyond it are refused, so that no sum of products of them overflows.
pub(super) const LARGEST: f32 = 1e9;

/// How a row is stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Coding {
    /// As 32-bit floats.
    Float,
    /// In steps that leave a noise of at most this RMS, 1 to 16 bits.
    Noise(f64),
    /// In this many bits, 1 to 16.
    Bits(u32),
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Row {
    bits: u32,
    offset: f32,
    step: f32,
}

/// The vectors.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Rows {
    length: usize,
    rows: Vec<Row>,
    /// As decoded, (element, row).
    values: Vec<f32>,
}

impl Coding {
    /// Bits of a row whose values span `range`.
    pub(super) fn bits(self, range: f64) -> u32 {
        match self {
            Self::Float => FLOAT,
            Self::Bits(bits) => bits.clamp(1, MOST_BITS),
            Self::Noise(noise) => {
                let levels = range / (noise * 12f64.sqrt()).max(f64::MIN_POSITIVE) + 1.0;
                levels.log2().ceil().clamp(1.0, f64::from(MOST_BITS)) as u32
            }
        }
    }
}

impl Row {
    fn of(values: impl Iterator<Item = f32> + Clone, coding: Coding) -> Self {
        let low = values.clone().fold(f32::INFINITY, f32::min);
        let high = values.fold(f32::NEG_INFINITY, f32::max);
        if matches!(coding, Coding::Float) || low > high {
            return Self { bits: coding.bits(0.0), offset: 0.0, step: 0.0 };
        }
        let bits = coding.bits(f64::from(high) - f64::from(low));
        let exact = (high - low) / ((1u32 << bits) - 1) as f32;
        let step = if high > low { exact.max(low.abs().max(high.abs()) * FINEST) } else { 0.0 };
        Self { bits, offset: low, step }
    }

    fn code(self, value: f32) -> u32 {
        if self.step > 0.0 {
            ((value - self.offset) / self.step).round().clamp(0.0, ((1u32 << self.bits) - 1) as f32) as u32
        } else {
            0
        }
    }

    fn value(self, code: u32) -> f32 {
        self.offset + self.step * code as f32
    }

    fn bytes(self, length: usize) -> usize {
        ROW_BYTES + (length * self.bits as usize).div_ceil(8)
    }
}

impl Rows {
    /// Codes `values`, (element, row), one coding a row.
    pub(super) fn new(length: usize, mut values: Vec<f32>, codings: &[Coding]) -> Self {
        let count = codings.len();
        let column = |j: usize| values.iter().skip(j).step_by(count.max(1)).copied();
        let rows: Vec<Row> = (0..count).map(|j| Row::of(column(j), codings[j])).collect();
        for element in values.chunks_exact_mut(count.max(1)) {
            let quantised = element.iter_mut().zip(&rows).filter(|(_, row)| row.bits < FLOAT);
            quantised.for_each(|(value, row)| *value = row.value(row.code(*value)));
        }
        Self { length, rows, values }
    }

    /// Elements of a row.
    pub(super) fn length(&self) -> usize {
        self.length
    }

    /// Number of rows.
    pub(super) fn count(&self) -> usize {
        self.rows.len()
    }

    /// One element of all rows.
    pub(super) fn element(&self, element: usize) -> &[f32] {
        &self.values[element * self.rows.len()..][..self.rows.len()]
    }

    /// Successive elements of all rows.
    pub(super) fn elements(&self, first: usize, count: usize) -> &[f32] {
        &self.values[first * self.rows.len()..][..count * self.rows.len()]
    }

    /// Bytes on disk.
    pub(super) fn bytes(&self) -> usize {
        self.rows.iter().map(|row| row.bytes(self.length)).sum()
    }

    /// Appends the rows; their length and number are not written.
    pub(super) fn write(&self, out: &mut Writer) {
        for (j, row) in self.rows.iter().enumerate() {
            out.u8(row.bits as u8);
            out.f32(row.offset);
            out.f32(row.step);
            let values = (0..self.length).map(|i| self.element(i)[j]);
            if row.bits == FLOAT {
                values.for_each(|value| out.f32(value));
            } else {
                values.for_each(|value| out.bits(row.code(value), row.bits));
                out.align();
            }
        }
    }

    /// Reads what [`Rows::write`] wrote.
    ///
    /// # Errors
    /// Where fewer bytes are left than rows of one bit an element take, before anything is allocated, and
    /// where a number is not finite or beyond any use.
    pub(super) fn read(from: &mut Reader<'_>, length: usize, count: usize) -> Result<Self, Fault> {
        from.expect(count, ROW_BYTES + length.div_ceil(8))?;
        let mut values = vec![0.0; length * count];
        let mut rows = Vec::with_capacity(count);
        for j in 0..count {
            let row = read_row(from)?;
            for i in 0..length {
                let value = if row.bits == FLOAT { from.f32()? } else { row.value(from.bits(row.bits)?) };
                if value.is_nan() || value.abs() > LARGEST {
                    return Err(Fault(format!("{value} stands in row {j}")));
                }
                values[i * count + j] = value;
            }
            from.align();
            rows.push(row);
        }
        Ok(Self { length, rows, values })
    }
}

fn read_row(from: &mut Reader<'_>) -> Result<Row, Fault> {
    let bits = u32::from(from.u8()?);
    if bits != FLOAT && !(1..=MOST_BITS).contains(&bits) {
        return Err(Fault(format!("a row of {bits} bits")));
    }
    Ok(Row { bits, offset: from.f32()?, step: from.f32()? })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(length: usize, count: usize) -> Vec<f32> {
        (0..length * count).map(|i| (i as f32 * 0.37).sin() * (1 + i % count) as f32).collect()
    }

    #[test]
    fn the_noise_is_what_was_allowed() {
        for noise in [0.2, 0.01, 0.0005] {
            let (length, values) = (5000, wave(5000, 3));
            let rows = Rows::new(length, values.clone(), &[Coding::Noise(noise); 3]);
            let square: f64 = (0..length * 3).map(|i| f64::from(values[i] - rows.values[i]).powi(2)).sum();
            let rms = (square / (3 * length) as f64).sqrt();
            assert!(rms < 1.02 * noise && rms > 0.4 * noise, "{rms} for {noise}");
        }
    }

    #[test]
    fn what_is_read_is_what_was_written_and_counted() {
        for coding in [Coding::Float, Coding::Noise(0.01), Coding::Bits(5), Coding::Bits(16)] {
            let mut values = wave(37, 4);
            values.iter_mut().skip(2).step_by(4).for_each(|v| *v = 1000.0);
            values.iter_mut().skip(3).step_by(4).for_each(|v| *v = 1000.0 + *v * 1e-4);
            let rows = Rows::new(37, values, &[coding; 4]);
            let mut out = Writer::default();
            rows.write(&mut out);
            let bytes = out.into_bytes();
            assert_eq!(bytes.len(), rows.bytes(), "{coding:?}");
            assert_eq!(Rows::read(&mut Reader::new(&bytes), 37, 4).unwrap(), rows, "{coding:?}");
        }
    }

    #[test]
    fn rows_without_spread_or_elements_are_exact() {
        let rows = Rows::new(4, vec![0.7; 4], &[Coding::Noise(1.0)]);
        assert_eq!(rows.element(3), [0.7]);
        assert_eq!(rows.bytes(), ROW_BYTES + 1);
        assert_eq!(Rows::new(0, Vec::new(), &[Coding::Bits(8)]).bytes(), ROW_BYTES);
        assert!(Rows::new(3, Vec::new(), &[]).element(2).is_empty());
    }

    #[test]
    fn more_elements_than_bytes_are_refused_before_they_are_allocated() {
        assert!(Rows::read(&mut Reader::new(&[8; 64]), usize::MAX / 2, 3).is_err(), "huge length");
        assert!(Rows::read(&mut Reader::new(&[8; 64]), 1 << 40, 1).is_err(), "long row");
    }
}
