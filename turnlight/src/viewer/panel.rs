//! What can be unfolded beside the picture.

use std::str::FromStr;

/// A panel of the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Panel {
    /// Facets and ranks in false colour.
    Facets,
    /// Where a facet was photographed from, and where the eye is.
    Directions,
    /// A facet's layers and their weights.
    Basis,
    /// Light on materials.
    Light,
    /// The nearest photograph, and how far the model is from it.
    Capture,
    /// How long frames take.
    Times,
    /// What keys and buttons of the mouse do.
    Keys,
}

impl Panel {
    /// All of them, from the top.
    pub const ALL: [Self; 7] =
        [Self::Facets, Self::Directions, Self::Basis, Self::Light, Self::Capture, Self::Times, Self::Keys];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Facets => "facets",
            Self::Directions => "directions",
            Self::Basis => "basis",
            Self::Light => "light",
            Self::Capture => "capture",
            Self::Times => "times",
            Self::Keys => "keys",
        }
    }
}

impl FromStr for Panel {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|panel| panel.name() == name);
        found.ok_or_else(|| format!("no panel '{name}'; there are {}", Self::ALL.map(Self::name).join(", ")))
    }
}
