//! SKELETON: to be replaced.

use super::container::{Fault, Reader, Stored, Writer};
use super::{Budget, FitReport, Frame, Precision, Sampler};
use crate::TextureError;
use capture::btf::Btf;
use nalgebra::Vector3;

/// How it is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Of everything random.
    pub seed: u64,
}

/// The codec.
#[derive(Clone, Debug, PartialEq)]
pub struct Ptm {
    frame: Frame,
}

impl Options {
    /// What a budget means for this codec.
    ///
    /// # Errors
    /// Where the budget is not one this codec has.
    pub fn new(_btf: &Btf, _budget: Budget, _precision: Precision, seed: u64) -> Result<Self, TextureError> {
        Ok(Self { seed })
    }
}

/// Fits the codec.
///
/// # Errors
/// Where the data cannot carry it.
pub fn fit(btf: &Btf, _options: &Options) -> Result<(Ptm, FitReport), TextureError> {
    Ok((Ptm { frame: Frame::of(btf) }, FitReport::default()))
}

impl Sampler for Ptm {
    fn frame(&self) -> &Frame {
        &self.frame
    }

    fn value(&self, _texel: usize, _light: &Vector3<f32>, _view: &Vector3<f32>) -> [f32; 3] {
        [0.0; 3]
    }
}

impl Stored for Ptm {
    fn write(&self, _out: &mut Writer) {}

    fn read(_from: &mut Reader<'_>, frame: Frame) -> Result<Self, Fault> {
        Ok(Self { frame })
    }
}
