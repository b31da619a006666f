//! What a mesh, a model or a capture holds, and what looks wrong with a capture.

use crate::Error;
use crate::stages::Stages;
use capture::{Aabb, Camera, Capture, LoadOptions, MaskSource, View};
use geometry::depth::{mean_silhouette_iou, silhouette_iou};
use geometry::hull::{HullOptions, visual_hull};
use geometry::{GeometryError, Mesh};
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use serde::Serialize;
use texture::{Appearance, Model};

/// Views looked at when a capture is checked; more say nothing new.
const CHECKED_VIEWS: usize = 24;
/// Images are reduced to about this width for the check.
const CHECKED_WIDTH: usize = 240;
/// Grid cells of the hull that silhouettes are held against.
const CHECKED_RESOLUTION: usize = 64;
/// A hull at this resolution reprojects to about this much of exact silhouettes.
const GOOD_IOU: f64 = 0.9;
/// An assumption explains a capture if it gains at least this much.
const CLEAR_GAIN: f64 = 0.1;

/// A box, corner by corner.
pub type Corners = [[f64; 3]; 2];

/// What a mesh holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeshFacts {
    /// Vertices.
    pub vertices: usize,
    /// Triangles.
    pub triangles: usize,
    /// Parts connected by shared vertices.
    pub components: usize,
    /// Vertices − edges + faces.
    pub euler: i64,
    /// Whether it is a closed, consistently oriented 2-manifold.
    pub closed_manifold: bool,
    /// Signed volume in cubic world units.
    pub volume: f64,
    /// Its box; `None` of an empty mesh.
    pub aabb: Option<Corners>,
}

/// What a model holds.
#[derive(Clone, Debug, Serialize)]
pub struct ModelFacts {
    /// Its mesh, as one surface: vertices that the atlas splits count once.
    #[serde(flatten)]
    pub mesh: MeshFacts,
    /// The appearance it carries.
    pub method: &'static str,
    /// Facets with a basis of their own; none of a lumigraph.
    pub facets: usize,
    /// Layers of each facet.
    pub ranks: Vec<usize>,
    /// Width and height of the atlas in texels.
    pub atlas: [usize; 2],
    /// Bytes, part by part.
    pub bytes: PartBytes,
}

/// Bytes of a model file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct PartBytes {
    /// The whole file.
    pub file: u64,
    /// Layers, weights and directions, as stored.
    pub appearance: u64,
    /// Mesh, preview and description.
    pub rest: u64,
    /// The appearance as raw 8-bit layers; not in the file.
    pub appearance_raw: u64,
}

/// What a capture holds, and what was found when its silhouettes were held against each other.
#[derive(Clone, Debug, Serialize)]
pub struct CaptureFacts {
    /// The kind of calibration.
    pub format: String,
    /// Number of views.
    pub views: usize,
    /// Width and height of the images, where all have one size.
    pub size: Option<[usize; 2]>,
    /// Whether any lens distorts.
    pub distorted: bool,
    /// Where silhouettes come from.
    pub masks: MaskSource,
    /// The object's box, where given.
    pub aabb: Option<Corners>,
    /// Views in which a corner of that box lies outside of the frame or behind the camera.
    pub views_with_box_cut: Vec<usize>,
    /// Metres per world unit, where known.
    pub unit: Option<f64>,
    /// Checked views whose silhouette leaves the frame.
    pub views_leaving_frame: Vec<usize>,
    /// Share of the frame that is object, mean over the checked views.
    pub object_share: f64,
    /// Mean intersection over union of the silhouettes and a coarse hull of them; `None` where the
    /// silhouettes have no point in common.
    pub silhouette_iou: Option<f64>,
    /// The checked view that fits worst, and how well.
    pub worst_view: Option<(usize, f64)>,
    /// What looks wrong, with the likely cause; empty of a good capture.
    pub faults: Vec<String>,
}

/// What a mesh holds.
///
/// # Errors
/// Where a face refers to a vertex that is not there, or a position is not finite.
pub fn mesh_facts(mesh: &Mesh) -> Result<MeshFacts, GeometryError> {
    let check = mesh.check()?;
    Ok(MeshFacts {
        vertices: check.vertices,
        triangles: check.triangles,
        components: check.components,
        euler: check.euler,
        closed_manifold: check.closed_manifold,
        volume: check.volume,
        aabb: mesh.aabb().map(corners),
    })
}

/// What a model holds.
///
/// # Errors
/// Where the mesh is broken.
pub fn model_facts(model: &Model) -> Result<ModelFacts, Error> {
    let bytes = model.bytes()?;
    let ranks: Vec<usize> = match &model.appearance {
        Appearance::Layers(layers) => layers.facets.iter().map(|facet| facet.rank).collect(),
        Appearance::Lumigraph(..) => Vec::new(),
    };
    Ok(ModelFacts {
        mesh: mesh_facts(&welded(&model.mesh.mesh))?,
        method: model.method.name(),
        facets: ranks.len(),
        ranks,
        atlas: model.mesh.atlas_size,
        bytes: PartBytes {
            file: bytes.file,
            appearance: bytes.appearance,
            rest: bytes.file.saturating_sub(bytes.appearance),
            appearance_raw: bytes.appearance_raw,
        },
    })
}

/// How well a mesh fits each silhouette.
pub fn silhouette_ious(mesh: &Mesh, views: &[View]) -> Vec<f64> {
    views.par_iter().map(|view| silhouette_iou(mesh, view)).collect()
}

/// The same surface with vertices at one place joined.
fn welded(mesh: &Mesh) -> Mesh {
    let key = |v: u32| mesh.positions[v as usize].coords.map(f64::to_bits);
    let mut order: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    order.sort_by(|&a, &b| key(a).iter().cmp(key(b).iter()).then(a.cmp(&b)));
    let mut first: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    for pair in order.windows(2).filter(|pair| key(pair[0]) == key(pair[1])) {
        first[pair[1] as usize] = first[pair[0] as usize];
    }
    Mesh { positions: mesh.positions.clone(), faces: mesh.faces.iter().map(|f| f.map(|v| first[v as usize])).collect() }
}

fn corners(aabb: Aabb) -> Corners {
    [aabb.min.into(), aabb.max.into()]
}

/// What a capture holds. Up to 24 of its views are loaded and held against a coarse hull of themselves.
///
/// # Errors
/// Where a view cannot be loaded.
pub fn capture_facts(capture: &Capture, format: &str, stages: &mut Stages<'_>) -> Result<CaptureFacts, Error> {
    let count = capture.frames.len();
    let positions: Vec<usize> = (0..count).step_by(count.div_ceil(CHECKED_VIEWS).max(1)).collect();
    let widest = capture.frames.iter().map(|frame| frame.camera.intrinsics.width).max().unwrap_or(0);
    let load = LoadOptions { downscale: (widest / CHECKED_WIDTH).max(1) };
    let views = stages.run("load", |_| capture.load_views(&positions, &load))?;
    let ious =
        stages.run("check silhouettes", |_| coarse_hull(&views, capture.aabb).map(|h| silhouette_ious(&h, &views)));
    let mut facts = CaptureFacts {
        format: format.to_owned(),
        views: count,
        size: common_size(capture),
        distorted: capture.frames.iter().any(|frame| !frame.camera.intrinsics.distortion.is_none()),
        masks: capture.mask_source,
        aabb: capture.aabb.map(corners),
        views_with_box_cut: capture.aabb.map_or_else(Vec::new, |aabb| views_cutting(capture, &aabb)),
        unit: capture.unit,
        views_leaving_frame: views.iter().filter(|view| !view.is_complete).map(|view| view.index).collect(),
        object_share: views.iter().map(object_share).sum::<f64>() / views.len().max(1) as f64,
        silhouette_iou: ious.as_ref().map(|ious| ious.iter().sum::<f64>() / ious.len().max(1) as f64),
        worst_view: ious.as_ref().and_then(|ious| worst(&views, ious)),
        faults: Vec::new(),
    };
    facts.faults = stages.run("look for causes", |_| faults(&facts, &views, capture.aabb));
    Ok(facts)
}

fn common_size(capture: &Capture) -> Option<[usize; 2]> {
    let size = |camera: &Camera| [camera.intrinsics.width, camera.intrinsics.height];
    let first = size(&capture.frames.first()?.camera);
    capture.frames.iter().all(|frame| size(&frame.camera) == first).then_some(first)
}

fn views_cutting(capture: &Capture, aabb: &Aabb) -> Vec<usize> {
    let pick = |corner: usize, axis: usize| if corner >> axis & 1 == 0 { aabb.min[axis] } else { aabb.max[axis] };
    let corners: Vec<Point3<f64>> = (0..8).map(|c| Point3::new(pick(c, 0), pick(c, 1), pick(c, 2))).collect();
    let holds = |camera: &Camera| {
        corners.iter().all(|corner| camera.project(corner).is_some_and(|seen| camera.in_frame(seen.pixel)))
    };
    (0..capture.frames.len()).filter(|&i| !holds(&capture.frames[i].camera)).collect()
}

fn object_share(view: &View) -> f64 {
    let pixels = view.matte.pixels();
    pixels.iter().filter(|m| **m >= 128).count() as f64 / pixels.len().max(1) as f64
}

fn worst(views: &[View], ious: &[f64]) -> Option<(usize, f64)> {
    let (i, iou) = ious.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1))?;
    Some((views[i].index, *iou))
}

/// A hull that forgives a tenth of the views, so that a few bad masks show as such.
fn coarse_hull(views: &[View], aabb: Option<Aabb>) -> Option<Mesh> {
    let consensus = views.len() / 10;
    let options = HullOptions { resolution: Some(CHECKED_RESOLUTION), consensus, aabb, ..HullOptions::default() };
    visual_hull(views, &options).ok().map(|hull| hull.mesh)
}

fn coarse_iou(views: &[View]) -> f64 {
    coarse_hull(views, None).map_or(0.0, |mesh| mean_silhouette_iou(&mesh, views))
}

/// A way in which calibrations go wrong: what it is called, and what undoes it.
type Assumption = (&'static str, fn(&View) -> View);

const ASSUMPTIONS: [Assumption; 6] = [
    ("the masks are inverted: the object is black in them", with_inverted_matte),
    ("the camera axes are flipped: poses are OpenGL where OpenCV is meant, or the reverse", |view| {
        with_camera(view, |c| turned(c, Vector3::new(1.0, -1.0, -1.0)))
    }),
    ("the poses are inverted: camera to world where world to camera is meant, or the reverse", |view| {
        with_camera(view, inverted)
    }),
    ("the images are mirrored, or the handedness of the cameras is", |view| with_camera(view, mirrored)),
    ("the images are upside down: the pixel origin is at the bottom", |view| with_camera(view, upside_down)),
    ("the images are turned by half a turn", |view| with_camera(view, |c| mirrored(&upside_down(c)))),
];

fn faults(facts: &CaptureFacts, views: &[View], aabb: Option<Aabb>) -> Vec<String> {
    let mut faults = Vec::new();
    if views.len() < 2 {
        faults.push("one view does not determine a shape; add views from other sides".to_owned());
        return faults;
    }
    if !facts.views_with_box_cut.is_empty() {
        let n = facts.views_with_box_cut.len();
        faults.push(format!("the object's box is cut by the frame, or behind the camera, in {n} views; check aabb"));
    }
    let found = facts.silhouette_iou.unwrap_or(0.0);
    if found < GOOD_IOU {
        faults.push(likely_cause(views, aabb, found));
    }
    if let Some((view, iou)) = facts.worst_view.filter(|(_, iou)| found >= GOOD_IOU && *iou < found - 0.2) {
        faults.push(format!("view {view} fits the others badly (IoU {iou:.3}); look at its mask and its pose"));
    }
    faults
}

fn likely_cause(views: &[View], aabb: Option<Aabb>, found: f64) -> String {
    let disagreement = if found == 0.0 {
        "the silhouettes have no point in common".to_owned()
    } else {
        format!("the silhouettes disagree (IoU {found:.3} with their own hull)")
    };
    // Without the box first: it may be the fault itself.
    let base = if aabb.is_some() { coarse_iou(views) } else { found };
    if base > found + CLEAR_GAIN {
        return format!("{disagreement}; likely the given box is wrong: without it they agree to {base:.3}");
    }
    let tried = ASSUMPTIONS.par_iter().map(|(cause, undo)| {
        let undone: Vec<View> = views.iter().map(undo).collect();
        (*cause, coarse_iou(&undone))
    });
    let tried: Vec<(&str, f64)> = tried.collect();
    match tried.iter().max_by(|a, b| a.1.total_cmp(&b.1)) {
        Some((cause, iou)) if *iou > found + CLEAR_GAIN => {
            format!("{disagreement}; likely {cause} (undone, they agree to {iou:.3})")
        }
        _ => format!("{disagreement}; look at the masks, and whether every pose belongs to its image"),
    }
}

fn with_camera(view: &View, change: impl Fn(&Camera) -> Camera) -> View {
    View { camera: change(&view.camera), ..view.clone() }
}

fn with_inverted_matte(view: &View) -> View {
    View { matte: view.matte.map(|m| 255 - m), ..view.clone() }
}

/// Camera axes multiplied by signs whose product is one.
fn turned(camera: &Camera, signs: Vector3<f64>) -> Camera {
    let turn = nalgebra::Matrix3::from_diagonal(&signs);
    Camera { rotation: turn * camera.rotation, translation: turn * camera.translation, ..*camera }
}

fn inverted(camera: &Camera) -> Camera {
    let rotation = camera.rotation.transpose();
    Camera { rotation, translation: -(rotation * camera.translation), ..*camera }
}

/// The camera of the image read from right to left.
fn mirrored(camera: &Camera) -> Camera {
    let mut i = camera.intrinsics;
    (i.fx, i.skew, i.cx) = (-i.fx, -i.skew, i.width as f64 - i.cx);
    Camera { intrinsics: i, ..*camera }
}

/// The camera of the image read from the bottom up.
fn upside_down(camera: &Camera) -> Camera {
    let mut i = camera.intrinsics;
    (i.fy, i.cy) = (-i.fy, i.height as f64 - i.cy);
    Camera { intrinsics: i, ..*camera }
}

impl MeshFacts {
    /// In words.
    pub fn text(&self) -> String {
        let closed = if self.closed_manifold { "closed manifold" } else { "not a closed manifold" };
        let mut text = format!(
            "mesh: {} vertices, {} triangles, {} components, Euler number {}, {closed}, volume {:.6}",
            self.vertices, self.triangles, self.components, self.euler, self.volume
        );
        if let Some([min, max]) = self.aabb {
            text.push_str(&format!("\nbox: {min:.4?} to {max:.4?}"));
        }
        text
    }
}

impl ModelFacts {
    /// In words.
    pub fn text(&self) -> String {
        let [width, height] = self.atlas;
        let mean_rank = self.ranks.iter().sum::<usize>() as f64 / self.ranks.len().max(1) as f64;
        format!(
            "{}\n{}: {} facets of {mean_rank:.1} layers in the mean, atlas {width} × {height}\n\
             {} bytes: appearance {} (raw {}), mesh and preview {}",
            self.mesh.text(),
            self.method,
            self.facets,
            self.bytes.file,
            self.bytes.appearance,
            self.bytes.appearance_raw,
            self.bytes.rest
        )
    }
}

impl CaptureFacts {
    /// In words.
    pub fn text(&self) -> String {
        let size = self.size.map_or_else(|| "several sizes".to_owned(), |[w, h]| format!("{w} × {h} pixels"));
        let lens = if self.distorted { ", with lens distortion" } else { "" };
        let mut lines = vec![format!("{}: {} views, {size}{lens}", self.format, self.views), self.masks.to_string()];
        if let Some([min, max]) = self.aabb {
            lines.push(format!("box: {min:.4?} to {max:.4?}"));
        }
        if !self.views_leaving_frame.is_empty() {
            lines.push(format!("the object leaves the frame in views {:?}", self.views_leaving_frame));
        }
        if let Some(iou) = self.silhouette_iou {
            lines.push(format!("silhouettes agree with their hull to {iou:.3} (IoU)"));
        }
        match self.faults.as_slice() {
            [] => lines.push("nothing looks wrong".to_owned()),
            faults => lines.extend(faults.iter().map(|fault| format!("warning: {fault}"))),
        }
        lines.join("\n")
    }
}
