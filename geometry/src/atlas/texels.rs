//! What lies under every texel of an atlas.
//!
//! Texel (x, y) has its centre at (x + ½, y + ½) texels. Bilinear sampling at a point reads the texels
//! whose centres are less than one texel away along x and y; so every texel whose centre lies within
//! that square of a triangle is listed. It belongs to the triangle nearest to its centre (the one it
//! lies in, if any; the lower face of equals) and shows that triangle's point nearest to its centre, so
//! nothing is extrapolated.

use crate::mesh::{Mesh, TexturedMesh};
use nalgebra::{Point2, Point3, Vector2, Vector3};
use rayon::prelude::*;

/// Rows per parallel task.
const BAND: usize = 32;

/// One texel that shows the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtlasTexel {
    /// Column.
    pub x: u32,
    /// Row, downwards.
    pub y: u32,
    /// Face of the textured mesh.
    pub face: u32,
    /// Weights of the face's corners, at least 0 and summing to 1.
    pub barycentric: [f32; 3],
    /// True if the centre lies in the face; false of a border texel, which shows the nearest point.
    pub inside: bool,
}

/// The texels of an atlas that a renderer may read, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct AtlasTexels {
    /// Width and height of the atlas.
    pub size: [usize; 2],
    /// Ascending by `y`, then `x`; each texel once.
    pub texels: Vec<AtlasTexel>,
}

/// Lists all texels a bilinear sampler can touch. O(texels), in parallel, the same on any number of
/// threads. Faces without area in the atlas are skipped; UVs outside [0, 1] are cut off.
pub fn rasterize(mesh: &TexturedMesh) -> AtlasTexels {
    let [width, height] = mesh.atlas_size;
    let triangles = triangles_in_texels(mesh);
    let bands = triangles_of_bands(&triangles, height);
    let bands: Vec<Vec<AtlasTexel>> = bands
        .into_par_iter()
        .enumerate()
        .map(|(band, faces)| {
            let rows = band * BAND..((band + 1) * BAND).min(height);
            Canvas::new(width, rows.start, rows.len()).draw(&triangles, &faces)
        })
        .collect();
    AtlasTexels { size: mesh.atlas_size, texels: bands.concat() }
}

impl AtlasTexels {
    /// The surface point of every texel, in world units, in the order of `texels`.
    pub fn positions(&self, mesh: &TexturedMesh) -> Vec<Point3<f64>> {
        let point = |t: &AtlasTexel| {
            let [a, b, c] = mesh.mesh.corners(t.face as usize);
            let w = t.barycentric.map(f64::from);
            Point3::from(a.coords * w[0] + b.coords * w[1] + c.coords * w[2])
        };
        self.texels.par_iter().map(point).collect()
    }

    /// The smooth outward unit normal of every texel: [`welded_vertex_normals`], interpolated.
    pub fn normals(&self, mesh: &TexturedMesh) -> Vec<Vector3<f64>> {
        let vertex_normals = welded_vertex_normals(&mesh.mesh);
        let normal = |t: &AtlasTexel| {
            let w = t.barycentric.map(f64::from);
            let corners = mesh.mesh.faces[t.face as usize].map(|v| vertex_normals[v as usize]);
            let sum = corners[0] * w[0] + corners[1] * w[1] + corners[2] * w[2];
            sum.try_normalize(0.0).unwrap_or(corners[0])
        };
        self.texels.par_iter().map(normal).collect()
    }

    /// True for every texel listed, row by row.
    pub fn mask(&self) -> Vec<bool> {
        let mut mask = vec![false; self.size[0] * self.size[1]];
        for t in &self.texels {
            mask[t.y as usize * self.size[0] + t.x as usize] = true;
        }
        mask
    }
}

/// Area-weighted unit normals per vertex, vertices at the same position taken as one: no seam of the
/// atlas shows in them.
pub fn welded_vertex_normals(mesh: &Mesh) -> Vec<Vector3<f64>> {
    // Adding 0 turns -0 into 0, which has other bits.
    let key = |v: u32| mesh.positions[v as usize].coords.data.0[0].map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    order.par_sort_unstable_by_key(|&v| (key(v), v));
    let mut group = vec![0; mesh.positions.len()];
    for same in order.chunk_by(|&a, &b| key(a) == key(b)) {
        same.iter().for_each(|&v| group[v as usize] = same[0]);
    }
    let mut sums = vec![Vector3::zeros(); mesh.positions.len()];
    for (face, corners) in mesh.faces.iter().enumerate() {
        let normal = mesh.face_area_vector(face);
        corners.iter().for_each(|&v| sums[group[v as usize] as usize] += normal);
    }
    group.into_iter().map(|g| sums[g as usize].try_normalize(0.0).unwrap_or_default()).collect()
}

/// A face in texels, with what its barycentric coordinates need.
struct TexelTriangle {
    corners: [Point2<f64>; 3],
    /// Twice the signed area; 0 marks a face not to draw.
    area: f64,
}

fn triangles_in_texels(mesh: &TexturedMesh) -> Vec<TexelTriangle> {
    let [w, h] = mesh.atlas_size.map(|s| s as f64);
    let triangle = |corners: &[u32; 3]| {
        let corners = corners.map(|v| mesh.uvs[v as usize]).map(|uv| Point2::new(uv.x * w, uv.y * h));
        let area = (corners[1] - corners[0]).perp(&(corners[2] - corners[0]));
        TexelTriangle { corners, area: if area.is_finite() { area } else { 0.0 } }
    };
    mesh.mesh.faces.par_iter().map(triangle).collect()
}

impl TexelTriangle {
    /// Rows (axis 1) or columns (axis 0) whose centres lie within one texel.
    fn span(&self, axis: usize, cells: usize) -> std::ops::Range<usize> {
        let at = self.corners.map(|p| p[axis]);
        let low = at[0].min(at[1]).min(at[2]) - 1.5;
        let high = at[0].max(at[1]).max(at[2]) + 0.5;
        (low.ceil().max(0.0) as usize)..((high.floor() + 1.0).max(0.0) as usize).min(cells)
    }

    /// Barycentric coordinates of the triangle's point nearest to `p`, and its squared distance.
    fn nearest(&self, p: Point2<f64>) -> ([f64; 3], f64) {
        let [a, b, c] = self.corners;
        let w = [(c - b).perp(&(p - b)) / self.area, (a - c).perp(&(p - c)) / self.area];
        let w = [w[0], w[1], 1.0 - w[0] - w[1]];
        if w.iter().all(|&w| w >= 0.0) {
            return (w, 0.0);
        }
        // Outside: the nearest point of the nearest edge.
        let mut best = ([1.0, 0.0, 0.0], f64::INFINITY);
        for k in 0..3 {
            let (from, to) = (self.corners[k], self.corners[(k + 1) % 3]);
            let edge = to - from;
            let t = ((p - from).dot(&edge) / edge.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            let distance = (p - (from + edge * t)).norm_squared();
            if distance < best.1 {
                let mut w = [0.0; 3];
                (w[k], w[(k + 1) % 3]) = (1.0 - t, t);
                best = (w, distance);
            }
        }
        best
    }

    /// Whether `p` lies inside, a thousandth of a texel from the edges at least.
    fn holds(&self, p: Point2<f64>) -> bool {
        (0..3).all(|k| {
            let (from, to) = (self.corners[k], self.corners[(k + 1) % 3]);
            (to - from).perp(&(p - from)) * self.area.signum() > 1e-3 * (to - from).norm()
        })
    }

    /// Whether the triangle meets the open square of half-width 1 around `p`; its box is known to.
    fn meets_square(&self, p: Point2<f64>) -> bool {
        (0..3).all(|k| {
            let (from, to) = (self.corners[k], self.corners[(k + 1) % 3]);
            let n = Vector2::new(from.y - to.y, to.x - from.x) * self.area.signum();
            n.dot(&(p - from)) + n.x.abs() + n.y.abs() > 0.0
        })
    }
}

/// Per band of rows the faces that may show there, ascending.
fn triangles_of_bands(triangles: &[TexelTriangle], height: usize) -> Vec<Vec<u32>> {
    let mut bands = vec![Vec::new(); height.div_ceil(BAND)];
    for (triangle, face) in triangles.iter().zip(0..).filter(|t| t.0.area != 0.0) {
        let rows = triangle.span(1, height);
        if !rows.is_empty() {
            (rows.start / BAND..=(rows.end - 1) / BAND).for_each(|b| bands[b].push(face));
        }
    }
    bands
}

/// Some rows of the atlas, with the nearest face so far.
struct Canvas {
    width: usize,
    top: usize,
    rows: usize,
    distances: Vec<f64>,
    texels: Vec<AtlasTexel>,
}

const UNCOVERED: AtlasTexel = AtlasTexel { x: 0, y: 0, face: u32::MAX, barycentric: [0.0; 3], inside: false };

impl Canvas {
    fn new(width: usize, top: usize, rows: usize) -> Self {
        let n = width * rows;
        Self { width, top, rows, distances: vec![f64::INFINITY; n], texels: vec![UNCOVERED; n] }
    }

    fn draw(mut self, triangles: &[TexelTriangle], faces: &[u32]) -> Vec<AtlasTexel> {
        faces.iter().for_each(|&face| self.draw_one(&triangles[face as usize], face));
        self.texels.retain(|t| t.face != u32::MAX);
        self.texels
    }

    fn draw_one(&mut self, triangle: &TexelTriangle, face: u32) {
        let rows = triangle.span(1, self.top + self.rows);
        for y in rows.start.max(self.top)..rows.end {
            for x in triangle.span(0, self.width) {
                let slot = (y - self.top) * self.width + x;
                let center = Point2::new(x as f64 + 0.5, y as f64 + 0.5);
                if self.distances[slot] <= 0.0 || !triangle.meets_square(center) {
                    continue;
                }
                let (weights, distance) = triangle.nearest(center);
                if distance < self.distances[slot] {
                    self.distances[slot] = distance;
                    let barycentric = weights.map(|w| w as f32);
                    let (x, y) = (x as u32, y as u32);
                    self.texels[slot] = AtlasTexel { x, y, face, barycentric, inside: distance <= 0.0 };
                }
            }
        }
    }
}

/// Texel centres that lie well inside two faces: an atlas must have none.
pub(crate) fn overlapping_texels(mesh: &TexturedMesh) -> usize {
    let [width, height] = mesh.atlas_size;
    let triangles = triangles_in_texels(mesh);
    let bands = triangles_of_bands(&triangles, height);
    let in_band = |(band, faces): (usize, Vec<u32>)| {
        let (top, end) = (band * BAND, ((band + 1) * BAND).min(height));
        let mut covered = vec![0_u8; width * BAND];
        for triangle in faces.iter().map(|&f| &triangles[f as usize]) {
            let rows = triangle.span(1, end);
            for y in rows.start.max(top)..rows.end {
                for x in triangle.span(0, width) {
                    // Off the centre, where exporters like to put edges.
                    if triangle.holds(Point2::new(x as f64 + 0.5013, y as f64 + 0.4987)) {
                        let count = &mut covered[(y - top) * width + x];
                        *count = count.saturating_add(1);
                    }
                }
            }
        }
        covered.iter().filter(|&&c| c > 1).count()
    };
    bands.into_par_iter().enumerate().map(in_band).sum()
}
