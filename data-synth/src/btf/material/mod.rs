//! The materials. To add one: a file with `patch` and `SIDE_MM`, a variant in [`BtfMaterial`]; the
//! compiler lists the rest.

mod bark;
mod cells;
mod corduroy;
mod foil;
mod knit;
mod leather;
mod weave;
mod yarn;

use super::patch::Patch;
use crate::error::SynthError;
use std::fmt;
use std::str::FromStr;

/// A material with a bidirectional texture function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BtfMaterial {
    /// Wales of cut pile on a cotton ground.
    Corduroy,
    /// Stockinette of three-ply wool.
    Knit,
    /// A tartan twill.
    Weave,
    /// Grained, waxed cowhide.
    Leather,
    /// Fissured bark of an old tree.
    Bark,
    /// Crumpled aluminium foil.
    Foil,
    /// Four reflectances in closed form: see [`super::analytic`].
    Analytic,
}

impl BtfMaterial {
    /// Every material, in the order of a listing.
    pub const ALL: [Self; 7] =
        [Self::Corduroy, Self::Knit, Self::Weave, Self::Leather, Self::Bark, Self::Foil, Self::Analytic];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Corduroy => "corduroy",
            Self::Knit => "knit",
            Self::Weave => "weave",
            Self::Leather => "leather",
            Self::Bark => "bark",
            Self::Foil => "foil",
            Self::Analytic => "analytic",
        }
    }

    /// Length of the period along x and y, in millimetres.
    pub fn side_mm(self) -> f64 {
        match self {
            Self::Corduroy => corduroy::SIDE_MM,
            Self::Knit => knit::SIDE_MM,
            Self::Weave => weave::SIDE_MM,
            Self::Leather => leather::SIDE_MM,
            Self::Bark => bark::SIDE_MM,
            Self::Foil => foil::SIDE_MM,
            Self::Analytic => 10.0,
        }
    }

    /// The surface; `None` of formulas.
    pub(super) fn patch(self, seed: u64) -> Option<Patch> {
        match self {
            Self::Corduroy => Some(corduroy::patch(seed)),
            Self::Knit => Some(knit::patch(seed)),
            Self::Weave => Some(weave::patch(seed)),
            Self::Leather => Some(leather::patch(seed)),
            Self::Bark => Some(bark::patch(seed)),
            Self::Foil => Some(foil::patch(seed)),
            Self::Analytic => None,
        }
    }
}

impl FromStr for BtfMaterial {
    type Err = SynthError;

    fn from_str(name: &str) -> Result<Self, SynthError> {
        let found = Self::ALL.into_iter().find(|m| m.name().eq_ignore_ascii_case(name));
        found.ok_or_else(|| SynthError::UnknownMaterial {
            name: name.to_owned(),
            known: Self::ALL.map(Self::name).join(", "),
        })
    }
}

impl fmt::Display for BtfMaterial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
