//! From views to a model: hull, simplification, atlas, appearance.

use crate::Error;
use crate::stages::Stages;
use capture::{Aabb, View};
use geometry::hull::{HullOptions, choose_hull, visual_hull};
use geometry::mesh::io::read_mesh;
use geometry::{Mesh, SimplifyOptions, TexturedMesh, UnwrapOptions, unwrap_mesh};
use nalgebra::{Point3, Vector3};
use std::path::{Path, PathBuf};
use texture::{Bake, FitOptions, FitReport, Method, Model};

/// Room around a given box, in its longest side. The box of the object is not that of its hull, which
/// reaches beyond: cut at its own box, the Middlebury temple loses 1.6 % of silhouette IoU.
const BOX_MARGIN: f64 = 0.1;

/// Least and largest side of the atlas of a mesh that brings its own.
const MIN_ATLAS_PX: usize = 64;
const MAX_ATLAS_PX: usize = 4096;

/// How the shape is made. What is `None` is chosen on the views given.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShapeOptions {
    /// Grid cells along the object's longest side.
    pub resolution: Option<usize>,
    /// Silhouettes that may exclude a point without carving it.
    pub consensus: Option<usize>,
    /// Pixels by which silhouettes grow before they carve.
    pub grow_px: Option<f64>,
    /// A mesh to use instead of the hull; its texture coordinates are kept if valid.
    pub mesh: Option<PathBuf>,
}

/// Makes a model.
///
/// # Errors
/// Where no shape or no appearance can be made of the views.
pub fn model(
    views: &[View],
    aabb: Option<Aabb>,
    method: Method,
    shape_options: &ShapeOptions,
    fit_options: &FitOptions,
    stages: &mut Stages<'_>,
) -> Result<(Model, FitReport), Error> {
    let mesh = shape(views, aabb, shape_options, stages)?;
    let bake = stages.run("bake", |_| Bake::new(views, &mesh, fit_options))?;
    Ok(stages.run(&format!("fit {}", method.name()), |_| texture::fit(&bake, method, fit_options))?)
}

/// The mesh that carries the appearance: the hull of the views, or the mesh brought.
///
/// # Errors
/// Where the silhouettes leave nothing, or the mesh cannot be read or unfolded.
pub fn shape(
    views: &[View],
    aabb: Option<Aabb>,
    options: &ShapeOptions,
    stages: &mut Stages<'_>,
) -> Result<TexturedMesh, Error> {
    if let Some(path) = &options.mesh {
        return brought(path, views, stages);
    }
    let fine = hull(views, aabb, options, stages)?;
    let texel = texel_size(views, &fine)?;
    let mut coarse = stages.run("simplify", |_| geometry::simplify(&fine, &simplify_options(&fine, texel)))?.mesh;
    // Thin places break into specks when simplified; each would cost two charts.
    coarse.remove_small_parts(HullOptions::default().least_part);
    unwrap(&coarse, texel, stages)
}

/// The visual hull of the views.
///
/// # Errors
/// Where the silhouettes leave nothing.
pub fn hull(
    views: &[View],
    aabb: Option<Aabb>,
    options: &ShapeOptions,
    stages: &mut Stages<'_>,
) -> Result<Mesh, Error> {
    refuse_one_place(views)?;
    let (aabb, resolution) = roomier(aabb, options.resolution);
    let base = HullOptions { resolution, aabb, ..HullOptions::default() };
    let chosen = match (options.consensus, options.grow_px) {
        (Some(consensus), Some(grow_px)) => HullOptions { consensus, grow_px, ..base },
        (consensus, grow_px) => {
            let choice = stages.run("choose hull", |_| choose_hull(views, &base))?.options;
            let (consensus, grow_px) = (consensus.unwrap_or(choice.consensus), grow_px.unwrap_or(choice.grow_px));
            stages.observer().noted(&format!("hull: {consensus} views forgiven, silhouettes grown by {grow_px} px"));
            HullOptions { consensus, grow_px, ..choice }
        }
    };
    Ok(stages.run("hull", |_| visual_hull(views, &chosen))?.mesh)
}

/// The box with room around it, and the resolution at which its cells stay as large as asked for.
fn roomier(aabb: Option<Aabb>, resolution: Option<usize>) -> (Option<Aabb>, Option<usize>) {
    let Some(tight) = aabb else { return (None, resolution) };
    let margin = Vector3::repeat(BOX_MARGIN * tight.size().max());
    let scale = 1.0 + 2.0 * BOX_MARGIN;
    let resolution = resolution.map(|n| (n as f64 * scale).round() as usize);
    (Some(Aabb { min: tight.min - margin, max: tight.max + margin }), resolution)
}

/// Silhouettes from one place leave the depth open, which a box of the object would only hide.
fn refuse_one_place(views: &[View]) -> Result<(), Error> {
    let first = views.first().map(|view| view.camera.center());
    let is_first =
        |view: &View| first.is_some_and(|first| (view.camera.center() - first).norm() <= 1e-6 * first.coords.norm());
    if views.iter().all(is_first) {
        let fault = format!("{} views from one place do not determine a shape", views.len());
        return Err(Error::Failed(format!("{fault}; add views from other sides, or bring a mesh with --mesh")));
    }
    Ok(())
}

/// A hull at one to two pixels a cell holds many more triangles than its silhouettes need.
fn simplify_options(mesh: &Mesh, texel: f64) -> SimplifyOptions {
    SimplifyOptions { target_faces: (mesh.faces.len() / 50).max(2000), max_error: Some(0.5 * texel) }
}

fn unwrap(mesh: &Mesh, texel: f64, stages: &mut Stages<'_>) -> Result<TexturedMesh, Error> {
    Ok(stages.run("atlas", |_| unwrap_mesh(mesh, &UnwrapOptions::new(texel)))?.mesh)
}

/// A mesh from a file, unfolded unless it comes with a valid atlas.
fn brought(path: &Path, views: &[View], stages: &mut Stages<'_>) -> Result<TexturedMesh, Error> {
    let file = stages.run("read mesh", |_| read_mesh(path))?;
    if let Some(fault) = &file.uv_fault {
        stages.observer().noted(&format!("{}: its texture coordinates are not used: {fault}", path.display()));
    }
    let texel = texel_size(views, &file.mesh)?;
    match file.textured {
        Some(textured) => Ok(TexturedMesh { atlas_size: atlas_size(&textured, texel), ..textured }),
        None => unwrap(&file.mesh, texel, stages),
    }
}

/// The square atlas in which a texel of a given parametrisation covers `texel` world units in the mean.
fn atlas_size(mesh: &TexturedMesh, texel: f64) -> [usize; 2] {
    let (mut surface, mut covered) = (0.0, 0.0);
    for (face, corners) in mesh.mesh.faces.iter().enumerate() {
        surface += mesh.mesh.face_area_vector(face).norm();
        let [a, b, c] = corners.map(|v| mesh.uvs[v as usize]);
        covered += (b - a).perp(&(c - a)).abs();
    }
    let side = (surface / covered).sqrt() / texel;
    // Not a number where nothing is covered; the cast makes that the least size.
    [(side.round() as usize).clamp(MIN_ATLAS_PX, MAX_ATLAS_PX); 2]
}

/// World units that one pixel of the median view covers at the object: a texel for each.
fn texel_size(views: &[View], mesh: &Mesh) -> Result<f64, Error> {
    let center = mesh.aabb().map_or_else(Point3::origin, |aabb| aabb.center());
    let pixel = |view: &View| view.camera.to_camera(&center).z / view.camera.intrinsics.fx.abs();
    let mut sizes: Vec<f64> = views.iter().map(pixel).filter(|s| s.is_finite() && *s > 0.0).collect();
    sizes.sort_by(f64::total_cmp);
    let none = || Error::Failed("no view faces the object; check the axes of the cameras".to_owned());
    sizes.get(sizes.len() / 2).copied().ok_or_else(none)
}
