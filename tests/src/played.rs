//! Models that other players play, and how their pictures are held against ours.

use capture::{Camera, Image};
use data_synth::{Effort, Scene, SynthOptions, synthesize};
use serde_json::{Value, json};
use std::sync::OnceLock;
use texture::{FitOptions, Method};
use turnlight::pipeline::{self, ShapeOptions};
use turnlight::stages::{Silent, Stages};

/// Views that were filmed.
const VIEWS: usize = 12;

/// Those of them near which pictures are compared.
pub const COMPARED: [usize; 2] = [1, 7];

/// Largest difference of a pixel in levels.
const MOST_LEVELS: u8 = 2;

/// The share of pixels that must keep to [`MOST_LEVELS`].
pub const SHARE: f64 = 0.99;

/// What is played, made once.
#[derive(Debug)]
pub struct Played {
    /// A file per method.
    pub models: Vec<(Method, Vec<u8>)>,
    /// One near each view.
    pub cameras: Vec<Camera>,
}

impl Played {
    /// The file of a method.
    ///
    /// # Panics
    /// Never: there is one of each.
    pub fn model(&self, method: Method) -> &[u8] {
        let found = self.models.iter().find(|model| model.0 == method);
        &found.unwrap_or_else(|| panic!("no model of {}", method.name())).1
    }
}

/// A small temple by all four methods.
///
/// # Panics
/// Where it cannot be made.
pub fn played() -> &'static Played {
    static PLAYED: OnceLock<Played> = OnceLock::new();
    PLAYED.get_or_init(|| {
        let options = SynthOptions {
            views: VIEWS,
            width: 160,
            height: 120,
            effort: Effort::Samples(4),
            surfaces: 1,
            ..SynthOptions::default()
        };
        let views = synthesize(Scene::Temple, &options).unwrap_or_else(|e| panic!("{e}")).views;
        let model = |method: Method| {
            let (shape, fit) = (ShapeOptions::default(), FitOptions { layers: 8, ..FitOptions::default() });
            let mut stages = Stages::new(&Silent);
            let model = pipeline::model(&views, None, method, &shape, &fit, &mut stages);
            let (model, _) = model.unwrap_or_else(|e| panic!("{}: {e}", method.name()));
            (method, model.to_glb().unwrap_or_else(|e| panic!("{}: {e}", method.name())))
        };
        Played {
            models: Method::ALL.map(model).into(),
            cameras: views.iter().map(|view| moved(&view.camera)).collect(),
        }
    })
}

/// Twice as many pixels, a little nearer and to the side: a view that no photograph took.
fn moved(camera: &Camera) -> Camera {
    let mut camera = *camera;
    let i = &mut camera.intrinsics;
    (i.width, i.height) = (2 * i.width, 2 * i.height);
    for value in [&mut i.fx, &mut i.fy, &mut i.cx, &mut i.cy] {
        *value *= 2.0;
    }
    camera.translation.z *= 0.93;
    camera.translation.x += 0.03 * camera.translation.z;
    camera
}

/// A frame of a transforms.json: camera to world, x right, y up, z back.
pub fn frame(camera: &Camera) -> Value {
    let (axes, center, i) = (camera.rotation.transpose(), camera.center(), &camera.intrinsics);
    let row = |r: usize| [axes[(r, 0)], -axes[(r, 1)], -axes[(r, 2)], center[r]];
    json!({
        "transform_matrix": [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]],
        "fl_x": i.fx, "fl_y": i.fy, "cx": i.cx, "cy": i.cy, "w": i.width, "h": i.height,
    })
}

/// Share of the object's pixels, edges apart, within two levels of `ours`.
///
/// # Panics
/// Where the pictures differ in size or hardly show the object.
pub fn agreement(ours: &Image<[u8; 4]>, theirs: &Image<[u8; 3]>) -> f64 {
    assert_eq!((ours.width(), ours.height()), (theirs.width(), theirs.height()));
    let is_inside = |x: usize, y: usize| {
        let around = |dy: isize| (-1..=1).map(move |dx| (dx, dy));
        (-1..=1).flat_map(around).all(|(dx, dy)| ours.at_clamped(x as isize + dx, y as isize + dy)[3] == 255)
    };
    let (mut near, mut all) = (0, 0);
    for (x, y) in (0..ours.height()).flat_map(|y| (0..ours.width()).map(move |x| (x, y))) {
        if is_inside(x, y) {
            let (a, b) = (ours.at(x, y), theirs.at(x, y));
            near += usize::from((0..3).all(|c| a[c].abs_diff(b[c]) <= MOST_LEVELS));
            all += 1;
        }
    }
    assert!(all > 1000, "{all} pixels of the object");
    near as f64 / all as f64
}
