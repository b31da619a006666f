//! Bidirectional texture functions whose truth is known.
//!
//! A material is one period of a surface ([`patch::Patch`]): relief, threads and fibres as triangles.
//! [`BtfStudio`] looks at it from the 81 directions of the measurements of 2003, under light from the
//! same 81, with shadowing, masking, parallax and interreflection. `analytic` is no surface but formulas
//! ([`analytic`]), exact at every texel.
//!
//! - Values are linear radiance under unit irradiance perpendicular to the light: the cosine of the light
//!   is in them. A white Lambertian plane is `cos θ / π`, whatever the view.
//! - Texels are boxes on the reference plane z = 0, which runs through the relief, so raised
//!   points shift with the view. x runs right and y up: row 0 is at the largest y. Azimuths run from x to y.
//! - The pattern is one period however many texels sample it, and the tile continues itself on all sides.

pub mod analytic;
mod material;
mod patch;
mod tile;
mod trace;
mod write;

pub use capture::btf::{BtfDirection, DIRECTIONS};
pub use material::BtfMaterial;
pub use write::{BtfWritten, write_btf};

use crate::error::SynthError;
use crate::material::Vec3;
use tile::Tile;
use trace::Tracing;

/// How a material is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BtfOptions {
    /// Texels per side of the tile, 1 to 1024: a view is held in memory, a gigabyte at most.
    pub size: usize,
    /// Of everything random; the same seed gives the same bytes.
    pub seed: u64,
    /// Paths per texel and view, 1 to 65536; powers of two are stratified best.
    pub samples: u32,
    /// Surfaces a path of light may touch, 1 to 16; 1 is direct light only.
    pub surfaces: usize,
}

/// A bidirectional texture function in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct SynthBtf {
    /// What was measured.
    pub material: BtfMaterial,
    /// Directions, of view and of light alike.
    pub directions: Vec<BtfDirection>,
    /// Texels per side.
    pub size: usize,
    /// Linear RGB radiance under unit perpendicular irradiance, laid out (view, light, y, x, channel).
    pub samples: Vec<f32>,
}

/// A material under the measuring dome, view by view.
#[derive(Debug)]
pub struct BtfStudio {
    options: BtfOptions,
    tile: Option<Tile>,
    directions: [Vec3; DIRECTIONS],
}

impl Default for BtfOptions {
    /// A tile of 24 texels in well under a minute.
    fn default() -> Self {
        Self { size: 24, seed: 0, samples: 16, surfaces: 3 }
    }
}

impl BtfOptions {
    fn check(&self) -> Result<(), SynthError> {
        let within = |option: &'static str, value: usize, most: usize| {
            let ok = (1..=most).contains(&value);
            let fault =
                || SynthError::Option { option, value: value.to_string(), allowed: format!("between 1 and {most}") };
            if ok { Ok(()) } else { Err(fault()) }
        };
        within("size", self.size, 1024)?;
        within("samples", self.samples as usize, 65_536)?;
        within("surfaces", self.surfaces, 16)
    }
}

impl BtfStudio {
    /// Makes the material; the geometry depends on the seed too.
    ///
    /// # Errors
    /// Names the option that is out of range.
    pub fn new(material: BtfMaterial, options: &BtfOptions) -> Result<Self, SynthError> {
        options.check()?;
        let tile = material.patch(options.seed).map(Tile::new);
        Ok(Self::of(tile, *options))
    }

    fn of(tile: Option<Tile>, options: BtfOptions) -> Self {
        let all = BtfDirection::all();
        let directions = std::array::from_fn(|i| all[i].vector().cast());
        Self { options, tile, directions }
    }

    /// All samples of one view, laid out (light, y, x, channel); `view` counts in [`BtfDirection::all`].
    ///
    /// # Errors
    /// A view that is not there.
    pub fn view(&self, view: usize) -> Result<Vec<f32>, SynthError> {
        self.view_at(&self.options, view)
    }

    fn view_at(&self, options: &BtfOptions, view: usize) -> Result<Vec<f32>, SynthError> {
        let Some(&towards) = self.directions.get(view) else {
            let allowed = format!("between 0 and {}", DIRECTIONS - 1);
            return Err(SynthError::Option { option: "view", value: view.to_string(), allowed });
        };
        let BtfOptions { size, seed, samples, surfaces } = *options;
        Ok(match &self.tile {
            Some(tile) => Tracing { size, samples, surfaces, seed }.view(tile, &self.directions, view, towards),
            None => analytic::view(size, view),
        })
    }

    /// The brightest there is but for one sample in two hundred, as a light meter would find it: on a
    /// coarse tile, in one view of each ring.
    fn metered(&self) -> Result<f32, SynthError> {
        let coarse =
            BtfOptions { size: self.options.size.min(16), samples: self.options.samples.min(4), ..self.options };
        let mut peaks = Vec::new();
        for view in [0, 1, 7, 19, 37, 57] {
            let samples = self.view_at(&coarse, view)?;
            peaks.extend(samples.chunks_exact(3).map(|c| c[0].max(c[1]).max(c[2])));
        }
        peaks.sort_unstable_by(f32::total_cmp);
        Ok(peaks[(peaks.len() - 1) * 199 / 200].max(f32::MIN_POSITIVE))
    }
}

/// Measures a material into memory: 79 kB per texel.
///
/// # Errors
/// Names the option that is out of range.
pub fn synthesize_btf(material: BtfMaterial, options: &BtfOptions) -> Result<SynthBtf, SynthError> {
    let studio = BtfStudio::new(material, options)?;
    let mut samples = Vec::new();
    for view in 0..DIRECTIONS {
        samples.extend(studio.view(view)?);
    }
    Ok(SynthBtf { material, directions: BtfDirection::all(), size: options.size, samples })
}

#[cfg(test)]
mod tests;
