//! The four methods on views they have not seen.
//!
//! Geometry and appearance come from the training views alone. Each model is scored as it is stored:
//! written to a `.glb`, read back, rendered with the cameras of the test views, and compared with their
//! photographs. Per-view figures are rounded to six decimals before they are averaged, as the referee
//! does, so that both print the same digits.

mod crops;
mod figures;
mod page;
mod plot;
mod surface;
mod table;

pub use figures::{Comparison, MethodFigures, ViewFigures};
pub use page::html;
pub use table::{csv, text};

use crate::output::OutputFolder;
use crate::pipeline::{self, ShapeOptions};
use crate::stages::{Observer, Stages, median};
use crate::truth::{self, TruthFigures};
use crate::{Error, playback};
use capture::{Capture, Image, LoadOptions, View};
use figures::round6;
use geometry::TexturedMesh;
use geometry::mesh::io::read_mesh;
use nalgebra::Point3;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::time::Instant;
use surface::Probes;
use texture::{Bake, FitOptions, Method, Model, metrics};

/// A test view closer than this to a training view, seen from the object, shows nothing new.
pub const LEAK_DEG: f64 = 2.0;

/// Frames rendered before their scores are taken, in parallel.
const BATCH: usize = 8;

/// What is compared, and on which views.
#[derive(Clone, Debug)]
pub struct CompareOptions {
    /// Positions of the views that are fitted.
    pub train: Vec<usize>,
    /// Positions of the views that are rendered and scored; those fitted, or close to one, are left out.
    pub test: Vec<usize>,
    /// The methods, in the order reported.
    pub methods: Vec<Method>,
    /// How the views are loaded.
    pub load: LoadOptions,
    /// How the shape is made.
    pub shape: ShapeOptions,
    /// How the appearances are fitted.
    pub fit: FitOptions,
    /// The true surface, to hold the shape against; it has no part in the fit.
    pub truth: Option<PathBuf>,
}

/// Compares the methods on `capture`; `name` is what the report calls it. Rendered views, references and
/// masks are written below `views/` of `report` where one is given.
///
/// # Errors
/// Where a view cannot be loaded, no shape or appearance can be made, or no test view is left.
pub fn compare(
    capture: &Capture,
    name: &str,
    options: &CompareOptions,
    report: Option<&OutputFolder>,
    stages: &mut Stages<'_>,
) -> Result<Comparison, Error> {
    let train = stages.run("load", |_| capture.load_views(&options.train, &options.load))?;
    let mesh = pipeline::shape(&train, capture.aabb, &options.shape, stages)?;
    let geometry = options.truth.as_deref().and_then(|path| judge_shape(&mesh, path, capture.unit, stages));
    let (test, left_out) = without_leaks(capture, &mesh, &options.train, &options.test);
    if test.is_empty() {
        let fault = format!("every test view is a training view or lies within {LEAK_DEG}° of one");
        return Err(Error::Arguments(format!("{fault}; choose other --train and --test views")));
    }
    if !left_out.is_empty() {
        let n = left_out.len();
        stages.observer().noted(&format!("{n} test views within {LEAK_DEG}° of a training view are left out"));
    }
    let held_out = stages.run("load test views", |_| capture.load_views(&test, &options.load))?;
    let start = Instant::now();
    let bake = stages.run("bake", |_| Bake::new(&train, &mesh, &options.fit))?;
    let bake_s = start.elapsed().as_secs_f64();
    let probes = stages.run("probe surface", |_| Probes::new(&bake, &train, &held_out));
    if let Some(report) = report {
        stages.run("write references", |_| write_references(&held_out, report))?;
    }
    let mut methods = Vec::with_capacity(options.methods.len());
    for &method in &options.methods {
        let (model, mut cost) = fit_and_store(&bake, method, &options.fit, stages)?;
        cost.build_s += bake_s;
        let judged = stages.run(&format!("render {}", method.name()), |observer| {
            judge(&model, &held_out, &probes, report, observer)
        })?;
        methods.push(MethodFigures::new(method, cost, judged));
    }
    Ok(Comparison {
        capture: name.to_owned(),
        train: options.train.clone(),
        test,
        left_out,
        geometry,
        stages: stages.finished().to_vec(),
        methods,
    })
}

/// Where the rendered, reference or mask picture of a view lies in a report.
pub fn view_path(kind: &str, position: usize) -> PathBuf {
    Path::new("views").join(kind).join(format!("{position:04}.png"))
}

/// What making and storing a model cost.
struct Cost {
    build_s: f64,
    bytes: u64,
    bytes_raw: u64,
}

/// What rendering the held-out views showed.
struct Judged {
    views: Vec<ViewFigures>,
    seam: Option<f64>,
    temporal: Option<f64>,
    frame_ms: f64,
    frame_size: [usize; 2],
}

/// A truth that cannot be used is no reason to compare nothing: it is named and left out.
fn judge_shape(mesh: &TexturedMesh, path: &Path, unit: Option<f64>, stages: &mut Stages<'_>) -> Option<TruthFigures> {
    let judged = stages.run("judge shape", |_| {
        let truth = read_mesh(path)?.mesh;
        truth::judge(&mesh.mesh, &truth, truth::default_tolerance(&truth, unit))
    });
    let unused = |fault| stages.observer().noted(&format!("{}: the shape is not judged: {fault}", path.display()));
    judged.map_err(unused).ok()
}

/// Test positions a training view gives away go to the second list.
fn without_leaks(capture: &Capture, mesh: &TexturedMesh, train: &[usize], test: &[usize]) -> (Vec<usize>, Vec<usize>) {
    let center = mesh.mesh.aabb().map_or_else(Point3::origin, |aabb| aabb.center());
    let direction = |i: usize| (capture.frames[i].camera.center() - center).try_normalize(0.0).unwrap_or_default();
    let is_new = |i: &usize| {
        let seen = direction(*i);
        // From the chord: an arc cosine loses half of its digits at small angles.
        let angle = |other: usize| 2.0 * ((seen - direction(other)).norm() / 2.0).min(1.0).asin();
        train.iter().all(|&other| other != *i && angle(other).to_degrees() >= LEAK_DEG)
    };
    test.iter().copied().partition(is_new)
}

fn write_references(views: &[View], report: &OutputFolder) -> Result<(), Error> {
    views.par_iter().try_for_each(|view| {
        capture::write_rgb(&report.place(view_path("reference", view.index))?, &view.image)?;
        Ok(capture::write_matte(&report.place(view_path("mask", view.index))?, &view.matte)?)
    })
}

/// Fits a method and takes it through its file, so that what is judged is what a user gets.
fn fit_and_store(
    bake: &Bake<'_>,
    method: Method,
    options: &FitOptions,
    stages: &mut Stages<'_>,
) -> Result<(Model, Cost), Error> {
    let start = Instant::now();
    let name = method.name();
    let (model, _) = stages.run(&format!("fit {name}"), |_| texture::fit(bake, method, options))?;
    let build_s = start.elapsed().as_secs_f64();
    let stored = stages.run(&format!("store {name}"), |_| {
        let bytes = model.bytes()?;
        Model::from_glb(&model.to_glb()?, Path::new(name)).map(|model| (model, bytes))
    });
    let (model, bytes) = stored?;
    Ok((model, Cost { build_s, bytes: bytes.appearance, bytes_raw: bytes.appearance_raw }))
}

fn judge(
    model: &Model,
    views: &[View],
    probes: &Probes,
    report: Option<&OutputFolder>,
    observer: &dyn Observer,
) -> Result<Judged, Error> {
    let name = model.method.name();
    let mut player = playback::player(model);
    let mut judged = Vec::with_capacity(views.len());
    let mut times_ms = Vec::with_capacity(views.len());
    let mut seams = Vec::new();
    for batch in views.chunks(BATCH) {
        let first = judged.len();
        let mut frames = Vec::with_capacity(batch.len());
        for view in batch {
            let start = Instant::now();
            frames.push(player.render(&model.atlas(&view.camera.center()), &view.camera));
            times_ms.push(start.elapsed().as_secs_f64() * 1e3);
        }
        let scored: Result<Vec<_>, Error> =
            batch.par_iter().zip(&frames).map(|(view, frame)| score_view(view, frame, name, report)).collect();
        judged.extend(scored?);
        let seam = |(i, (view, frame))| probes.seam(first + i, view, frame);
        seams.extend(batch.iter().zip(&frames).enumerate().filter_map(seam));
        observer.advanced(judged.len(), views.len());
    }
    let frame_size = views.first().map_or([0, 0], |v| [v.image.width(), v.image.height()]);
    let seam = (!seams.is_empty()).then(|| round6(seams.iter().sum::<f64>() / seams.len() as f64));
    let temporal = probes.temporal(model).map(round6);
    Ok(Judged { views: judged, seam, temporal, frame_ms: median(times_ms), frame_size })
}

fn score_view(
    view: &View,
    frame: &Image<[u8; 4]>,
    method: &str,
    report: Option<&OutputFolder>,
) -> Result<ViewFigures, Error> {
    if let Some(report) = report {
        render::film::write_png(&report.place(view_path(method, view.index))?, frame)?;
    }
    Ok(ViewFigures::new(view.index, &metrics::score(frame, &view.image, &view.matte)?))
}
