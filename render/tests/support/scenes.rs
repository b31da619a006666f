//! What every renderer draws: one list for the CPU and for graphics hardware, each held against the reference.

#![allow(dead_code, reason = "every test binary uses some of it")]

use crate::support::{atlas, knot, look_at, sphere, surface, torus};
use capture::{Camera, Distortion, Image};
use geometry::TexturedMesh;
use nalgebra::Point3;
use render::RenderOptions;

/// A mesh, its texture, and who looks at it how.
pub(crate) struct Scene {
    pub(crate) name: String,
    pub(crate) mesh: TexturedMesh,
    pub(crate) atlas: Image<[f32; 3]>,
    pub(crate) camera: Camera,
    pub(crate) options: RenderOptions,
    /// Share of pixels that hardware may put on the other side of an edge: it snaps corners to a grid of 1/256. Cells of
    /// sphere and knot have textures that go on nowhere, unlike charts of a real atlas, so that every one of these shows.
    pub(crate) hardware_off: f64,
}

pub(crate) fn at(supersample: usize) -> RenderOptions {
    RenderOptions { supersample, background: None }
}

fn scene(name: &str, mesh: TexturedMesh, atlas_size: [usize; 2], camera: Camera, supersample: usize) -> Scene {
    let atlas = atlas(atlas_size[0], atlas_size[1]);
    Scene { name: name.to_owned(), mesh, atlas, camera, options: at(supersample), hardware_off: 0.001 }
}

/// Solids from several eyes, far and near, before a background, through skew and lenses, from inside.
pub(crate) fn scenes() -> Vec<Scene> {
    let mut all = Vec::new();
    let solids = [("sphere", sphere(40, 20), 0.002), ("torus", torus(60, 24), 0.001), ("knot", knot(160, 12), 0.002)];
    for (name, mesh, hardware_off) in solids {
        for (eye, n) in [([3.0, 0.4, 1.0], 2), ([0.3, -2.0, 2.0], 1), ([-1.2, 1.1, 0.1], 3)] {
            let camera = look_at(Point3::from(eye), Point3::origin(), 180.0, 201, 151);
            all.push(Scene { hardware_off, ..scene(&format!("{name} {n}"), mesh.clone(), [512, 384], camera, n) });
        }
    }
    let far = look_at(Point3::new(40.0, 5.0, 9.0), Point3::origin(), 700.0, 96, 96);
    all.push(scene("minified", torus(60, 24), [1000, 700], far, 2));
    // Faces smaller than sub-samples, each with a texture of its own.
    all.push(Scene { hardware_off: 0.01, ..scene("specks", knot(200, 16), [1024, 1024], far, 2) });
    let near = look_at(Point3::new(1.3, 0.2, 0.1), Point3::origin(), 400.0, 96, 96);
    all.push(scene("magnified", knot(200, 16), [1000, 700], near, 2));
    let camera = look_at(Point3::new(2.5, 1.0, 1.5), Point3::origin(), 120.0, 80, 60);
    let options = RenderOptions { supersample: 2, background: Some([10, 200, 30]) };
    all.push(Scene { options, ..scene("background", torus(30, 12), [64, 64], camera, 2) });
    let mut camera = look_at(Point3::new(2.6, 0.6, 0.4), Point3::origin(), 150.0, 160, 120);
    camera.intrinsics.skew = 12.0;
    camera.intrinsics.fy = 140.0;
    all.push(scene("skew", sphere(40, 20), [256, 256], camera, 2));
    camera.intrinsics.distortion = Distortion { k1: -0.25, k2: 0.08, k3: 0.0, p1: 0.001, p2: -0.0005 };
    all.push(scene("barrel", sphere(40, 20), [256, 256], camera, 2));
    camera.intrinsics.distortion = Distortion { k1: 0.2, ..Distortion::default() };
    all.push(scene("pincushion", sphere(40, 20), [256, 256], camera, 1));
    for (i, eye) in [[0.0, 0.0, 0.0], [0.9, 0.1, 0.2], [0.3, 0.3, -0.8]].into_iter().enumerate() {
        let camera = look_at(Point3::from(eye), Point3::new(0.2, -1.0, 0.3), 60.0, 120, 90);
        all.push(scene(&format!("inside {i}"), sphere(24, 12), [256, 256], camera, 2));
    }
    // A floor from under one's feet to the horizon crosses the camera plane.
    let floor = surface(3, 3, false, |s, t| Point3::new(40.0 * (s - 0.5), 40.0 * (t - 0.5), 0.0));
    let camera = look_at(Point3::new(0.1, 0.2, 0.7), Point3::new(5.0, 3.0, 0.5), 60.0, 120, 90);
    all.push(scene("floor", floor, [256, 256], camera, 2));
    all.push(scene(
        "without texels",
        torus(30, 12),
        [0, 0],
        look_at(Point3::new(2.5, 1.0, 1.5), Point3::origin(), 120.0, 80, 60),
        2,
    ));
    all
}
