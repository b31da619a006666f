//! The arbiter: one ray per sub-sample, nothing clever.
//!
//! Rays find their candidates in a bounding volume hierarchy and meet triangles by the watertight
//! test of Woop, Benthin and Wald (Watertight Ray/Triangle Intersection, JCGT 2013) in `f64`; the
//! mip level comes from ray differentials (Igehy, Tracing Ray Differentials, SIGGRAPH 1999). Some
//! microseconds per sub-sample; rows run in parallel.

use crate::face::{Corners, corners};
use crate::filter::{MipChain, level_of_footprint, top_level};
use crate::material::{Lit, Spot};
use crate::resolve::{Accumulator, ideal_position};
use crate::{RenderOptions, frame_size, is_usable};
use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::Bvh;
use capture::{Camera, Image};
use geometry::TexturedMesh;
use nalgebra::{Point2, Point3, Vector2, Vector3};
use rayon::prelude::*;

/// Draws `mesh` with `atlas` (encoded 0..=255, unclamped) as `camera` sees it: RGBA, 8 bit encoded,
/// not premultiplied, alpha the share of covered sub-samples.
///
/// Faces with broken indices or numbers are left out; a camera that is not finite sees nothing.
pub fn render(
    mesh: &TexturedMesh,
    atlas: &Image<[f32; 3]>,
    camera: &Camera,
    options: &RenderOptions,
) -> Image<[u8; 4]> {
    draw(mesh, atlas, None, camera, options)
}

/// The same with materials, which must have been laid over `mesh`.
pub fn render_lit(
    mesh: &TexturedMesh,
    atlas: &Image<[f32; 3]>,
    lit: &Lit<'_>,
    camera: &Camera,
    options: &RenderOptions,
) -> Image<[u8; 4]> {
    draw(mesh, atlas, Some(lit), camera, options)
}

fn draw(
    mesh: &TexturedMesh,
    atlas: &Image<[f32; 3]>,
    lit: Option<&Lit<'_>>,
    camera: &Camera,
    options: &RenderOptions,
) -> Image<[u8; 4]> {
    let (width, height) = frame_size(camera);
    let nothing = Accumulator::default().finish(1, options.background);
    let mut frame = Image::filled(width, height, nothing);
    let scene = Scene::new(mesh);
    if scene.triangles.is_empty() || !is_usable(camera) || width == 0 {
        return frame;
    }
    let chain = MipChain::build(atlas, top_level(atlas.width(), atlas.height()));
    let n = options.per_side();
    frame.pixels_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.iter_mut().enumerate() {
            let mut sum = Accumulator::default();
            for (row, column) in (n * y..n * (y + 1)).flat_map(|r| (n * x..n * (x + 1)).map(move |c| (r, c))) {
                let ray = ideal_position(camera, column, row, n).map(|p| PixelRay::new(camera, p, n));
                if let Some(colour) = ray.and_then(|ray| scene.shade(&ray, &chain, lit)) {
                    sum.add(colour);
                }
            }
            *pixel = sum.finish(n * n, options.background);
        }
    });
    frame
}

/// A ray and how its direction changes from one sub-sample to the next, in world units.
struct PixelRay {
    origin: Point3<f64>,
    /// Unit length along the optical axis, so that a distance along the ray is a depth.
    direction: Vector3<f64>,
    direction_dx: Vector3<f64>,
    direction_dy: Vector3<f64>,
}

impl PixelRay {
    fn new(camera: &Camera, ideal_pixel: Point2<f64>, per_side: usize) -> Self {
        let i = &camera.intrinsics;
        let plane = i.plane_from_pixel(ideal_pixel);
        let step = 1.0 / per_side as f64;
        let world_from_camera = camera.rotation.transpose();
        Self {
            origin: camera.center(),
            direction: world_from_camera * Vector3::new(plane.x, plane.y, 1.0),
            direction_dx: world_from_camera * Vector3::new(step / i.fx, 0.0, 0.0),
            direction_dy: world_from_camera * Vector3::new(-step * i.skew / (i.fx * i.fy), step / i.fy, 0.0),
        }
    }
}

/// A face in the hierarchy.
struct Triangle {
    corners: Corners,
    face: usize,
    node: usize,
}

impl Bounded<f64, 3> for Triangle {
    fn aabb(&self) -> Aabb<f64, 3> {
        let [a, b, c] = self.corners.positions;
        let (low, high) = (a.inf(&b).inf(&c), a.sup(&b).sup(&c));
        // A ray that runs exactly in a face of its box misses it in this crate: leave some air.
        let air = Vector3::repeat(1e-9 * (low.coords.amax() + high.coords.amax()) + f64::MIN_POSITIVE);
        Aabb::with_bounds(low - air, high + air)
    }
}

impl BHShape<f64, 3> for Triangle {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

/// Where a ray meets a face.
struct Hit {
    depth: f64,
    barycentric: [f64; 3],
}

/// The drawable faces of a mesh in a hierarchy.
struct Scene {
    triangles: Vec<Triangle>,
    hierarchy: Option<Bvh<f64, 3>>,
}

impl Scene {
    fn new(mesh: &TexturedMesh) -> Self {
        let mut triangles: Vec<Triangle> = (0..mesh.mesh.faces.len())
            .filter_map(|face| Some(Triangle { corners: corners(mesh, face)?, face, node: 0 }))
            .collect();
        let hierarchy = (!triangles.is_empty()).then(|| Bvh::build(&mut triangles));
        Self { triangles, hierarchy }
    }

    /// The colour of the nearest face along the ray; the face of lower index where two coincide.
    fn shade(&self, ray: &PixelRay, chain: &MipChain, lit: Option<&Lit<'_>>) -> Option<[f32; 3]> {
        let query = bvh::ray::Ray::new(ray.origin, ray.direction);
        let mut nearest: Option<(Hit, &Triangle)> = None;
        for triangle in self.hierarchy.as_ref()?.traverse(&query, &self.triangles) {
            let Some(hit) = intersect(ray, &triangle.corners.positions) else { continue };
            let closer =
                nearest.as_ref().is_none_or(|(best, other)| (hit.depth, triangle.face) < (best.depth, other.face));
            if closer {
                nearest = Some((hit, triangle));
            }
        }
        let (hit, triangle) = nearest?;
        Some(lookup(ray, &hit, triangle, chain, lit))
    }
}

/// Woop, Benthin and Wald's test: shear the triangle so that the ray becomes the z axis, then three
/// two-dimensional edge functions. Both sides count; `None` at depth zero and behind.
fn intersect(ray: &PixelRay, corners: &[Point3<f64>; 3]) -> Option<Hit> {
    let d = ray.direction;
    let kz = d.iamax();
    let (kx, ky) = ((kz + 1) % 3, (kz + 2) % 3);
    let [a, b, c] = corners.map(|p| p - ray.origin);
    let shear = |p: &Vector3<f64>| (p[kx] - d[kx] / d[kz] * p[kz], p[ky] - d[ky] / d[kz] * p[kz]);
    let ((ax, ay), (bx, by), (cx, cy)) = (shear(&a), shear(&b), shear(&c));
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    let det = u + v + w;
    if !inside || det == 0.0 {
        return None;
    }
    let barycentric = [u / det, v / det, w / det];
    let depth = (barycentric[0] * a[kz] + barycentric[1] * b[kz] + barycentric[2] * c[kz]) / d[kz];
    (depth > 0.0).then_some(Hit { depth, barycentric })
}

/// The texture at a hit, filtered over the footprint of a sub-sample, or the material there.
fn lookup(ray: &PixelRay, hit: &Hit, triangle: &Triangle, chain: &MipChain, lit: Option<&Lit<'_>>) -> [f32; 3] {
    let corners = &triangle.corners;
    let size = Vector2::new(chain.level(0).width() as f64, chain.level(0).height() as f64);
    let texels = corners.uvs.map(|uv| uv.coords.component_mul(&size));
    let at = texels[0] * hit.barycentric[0] + texels[1] * hit.barycentric[1] + texels[2] * hit.barycentric[2];
    let footprint = [ray.direction_dx, ray.direction_dy]
        .map(|change| texel_change(ray, hit, corners, &texels, &change).norm_squared())
        .into_iter()
        .fold(0.0, f64::max);
    if let Some(lit) = lit.filter(|lit| lit.coats.cover(triangle.face)) {
        let uv = at.component_div(&size).into();
        let side = (footprint / (size.x * size.y)).sqrt();
        return lit.colour(&Spot { face: triangle.face, uv, side }, &ray.origin);
    }
    chain.sample(at.x as f32, at.y as f32, level_of_footprint(footprint as f32))
}

/// How far the hit moves over the texture when the ray's direction changes by `change`.
fn texel_change(
    ray: &PixelRay,
    hit: &Hit,
    corners: &Corners,
    texels: &[Vector2<f64>; 3],
    change: &Vector3<f64>,
) -> Vector2<f64> {
    let [a, b, c] = corners.positions;
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(&ac);
    // P = O + t D stays in the plane: dP = t (dD − D (N·dD)/(N·D)).
    let moved = (change - ray.direction * (normal.dot(change) / normal.dot(&ray.direction))) * hit.depth;
    // Barycentric coordinates of a vector in the plane (Ericson, Real-Time Collision Detection, 3.4).
    let area = normal.norm_squared();
    let second = moved.cross(&ac).dot(&normal) / area;
    let third = ab.cross(&moved).dot(&normal) / area;
    (texels[1] - texels[0]) * second + (texels[2] - texels[0]) * third
}
