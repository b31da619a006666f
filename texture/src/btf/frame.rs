//! What every codec shares: the tile's size, and the directions it was measured under.

use super::lookup::Lookup;
use crate::directions::{DirectionComplex, Layout};
use nalgebra::Vector3;
use std::sync::Arc;

/// The grid a codec was fitted to. Cheap to clone.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Texels across.
    pub width: usize,
    /// Texels down.
    pub height: usize,
    /// Towards the eye.
    pub views: Arc<DirectionSet>,
    /// Towards the light.
    pub lights: Arc<DirectionSet>,
}

/// Measured directions, and interpolation between them.
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionSet {
    vectors: Vec<Vector3<f64>>,
    complex: DirectionComplex,
    lookup: Lookup,
}

/// A convex combination of up to three directions; unused entries have weight 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blend {
    /// Position in the set and weight; weights are ≥ 0 and sum to 1.
    pub entries: [(u32, f32); 3],
}

impl Frame {
    /// The grid of measured data.
    pub fn of(btf: &capture::btf::Btf) -> Self {
        Self {
            width: btf.width,
            height: btf.height,
            views: Arc::new(DirectionSet::new(&btf.views)),
            lights: Arc::new(DirectionSet::new(&btf.lights)),
        }
    }

    /// Texels of the tile.
    pub fn texels(&self) -> usize {
        self.width * self.height
    }

    /// The measured pairs about a light and a view, numbered view · lights + light, and their weights; unused
    /// ones have weight 0.
    pub fn blend(&self, light: &Vector3<f32>, view: &Vector3<f32>) -> [(usize, f32); 9] {
        let (light, view) = (self.lights.blend(light), self.views.blend(view));
        std::array::from_fn(|i| {
            let ((v, a), (l, b)) = (view.entries[i / 3], light.entries[i % 3]);
            (v as usize * self.lights.len() + l as usize, a * b)
        })
    }

    /// Pairs of view and light.
    pub fn pairs(&self) -> usize {
        self.views.len() * self.lights.len()
    }
}

impl DirectionSet {
    /// A set of unit vectors.
    pub fn new(vectors: &[Vector3<f64>]) -> Self {
        let complex = DirectionComplex::build(vectors, Layout::General);
        Self { vectors: vectors.to_vec(), lookup: Lookup::new(&complex), complex }
    }

    /// Number of directions.
    pub fn len(&self) -> usize {
        self.vectors.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.vectors.is_empty()
    }

    /// The unit vectors.
    pub fn vectors(&self) -> &[Vector3<f64>] {
        &self.vectors
    }

    /// What directions are interpolated over.
    pub fn complex(&self) -> &DirectionComplex {
        &self.complex
    }

    /// The measured directions about a direction; beyond the outermost ring, the nearest point of the border.
    pub fn blend(&self, direction: &Vector3<f32>) -> Blend {
        let blend = self.lookup.blend(&self.complex, &direction.cast());
        let entries = blend.map_or([(0, 1.0), (0, 0.0), (0, 0.0)], |b| b.entries.map(|(site, w)| (site, w as f32)));
        Blend { entries }
    }
}
