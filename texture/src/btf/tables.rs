//! The numbers a sampler computes with, for programs that compute elsewhere, as on graphics hardware.

use super::multilevel_vq::Grid;

/// A codec's numbers.
#[derive(Clone, Debug, PartialEq)]
pub enum Tables {
    /// [`super::gaussian_mixture`].
    GaussianMixture(MixtureTables),
    /// [`super::multilevel_vq`].
    MultilevelVq(VqTables),
}

/// `mean(l, v) + Σ share · colour`, shares proportional to `exp(bias − Σ ((input − mean) · scale)²)`; inputs are
/// x, y, α and s of the light, α and s of the view. Differences of x and y are to the mean's nearest image.
#[derive(Clone, Debug, PartialEq)]
pub struct MixtureTables {
    /// Components.
    pub components: Vec<MixtureComponent>,
    /// After how many texels x and y begin again; 0 where they do not.
    pub periods: [f32; 2],
    /// Mean colours (view, light), to be interpolated between directions.
    pub mean: Vec<[f32; 3]>,
}

/// One component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MixtureComponent {
    /// Of the inputs.
    pub mean: [f32; 6],
    /// √½ over the deviation of each input.
    pub scale: [f32; 6],
    /// Less the mean colour.
    pub color: [f32; 3],
    /// Logarithm of what the exponential is multiplied by.
    pub bias: f32,
}

/// The chains of equation 4, M folded into P3 and C into I1. Links are (place of the first child's number, scale).
#[derive(Clone, Debug, PartialEq)]
pub struct VqTables {
    /// Nodes of directions.
    pub grid: Grid,
    /// Cosine and sine of each azimuth of the view.
    pub turns: Vec<[f32; 2]>,
    /// P6: a link to an item of `texels` per texel, or one that stands for all.
    pub plane: Vec<(u32, f32)>,
    /// P4, `phi` an item; links to places in `views`.
    pub texels: Vec<(u32, f32)>,
    /// P3: places in `slices` and `color_slices`, scale.
    pub views: Vec<(u32, u32, f32)>,
    /// P2; links to places in `rows`.
    pub slices: Vec<(u32, f32)>,
    /// P1.
    pub rows: Vec<f32>,
    /// I2; places in `color_rows`.
    pub color_slices: Vec<u32>,
    /// I1: Cr, Cb.
    pub color_rows: Vec<[f32; 2]>,
}
