//! The surface behind every texel of the atlas.

use geometry::TexturedMesh;
use geometry::atlas::rasterize;
use nalgebra::{Point3, Vector3};

/// No atlas has more texels, or is wider or higher: what a model holds of one must fit in memory.
const MOST_TEXELS: usize = 1 << 26;
const LONGEST_SIDE: usize = 1 << 15;

/// Whether a model may have an atlas of this width and height.
pub(crate) fn is_atlas_size([width, height]: [usize; 2]) -> bool {
    let sides = 1..=LONGEST_SIDE;
    sides.contains(&width) && sides.contains(&height) && width * height <= MOST_TEXELS
}

/// One entry per texel that carries surface, in row-major order of the atlas.
#[derive(Clone, Debug)]
pub struct SurfaceTexels {
    /// Width and height of the atlas.
    pub size: [usize; 2],
    /// `y · width + x` of each texel, ascending.
    pub index: Vec<u32>,
    /// The face behind each texel.
    pub faces: Vec<u32>,
    /// The surface point at each texel's centre, in the world.
    pub positions: Vec<Point3<f64>>,
    /// Smooth unit normal there.
    pub normals: Vec<Vector3<f64>>,
}

impl SurfaceTexels {
    /// Bakes the surface of `mesh` into its atlas.
    pub fn bake(mesh: &TexturedMesh) -> Self {
        let atlas = rasterize(mesh);
        let width = atlas.size[0] as u32;
        Self {
            size: atlas.size,
            index: atlas.texels.iter().map(|t| t.y * width + t.x).collect(),
            faces: atlas.texels.iter().map(|t| t.face).collect(),
            positions: atlas.positions(mesh),
            normals: atlas.normals(mesh),
        }
    }

    /// Texels that carry surface.
    pub fn len(&self) -> usize {
        self.index.len()
    }

    /// Whether no texel carries surface.
    pub fn is_empty(&self) -> bool {
        self.index.is_empty()
    }
}
