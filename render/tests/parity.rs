//! The fast renderer draws what the reference defines.

#[path = "support/difference.rs"]
mod difference;
#[path = "support/scenes.rs"]
mod scenes;
mod support;

use capture::btf::{Encoding, bonn_directions};
use capture::{Camera, Image};
use difference::difference;
use nalgebra::{Point3, Vector3};
use render::material::{Coat, Coats, Light, Lighting, Lit};
use render::{RenderOptions, cpu, reference};
use scenes::{Scene, at, scenes};
use std::sync::Arc;
use support::{atlas, knot, look_at, sphere, surface, torus};
use texture::btf::{DirectionSet, Frame, Sampler};

/// Parity as we promise it: 99.9 % of inner pixels to rounding; of edge pixels as much, for both
/// renderers test the same points and only ties may fall differently.
#[test]
fn every_scene_is_drawn_alike() {
    for Scene { name, mesh, atlas, camera, options, .. } in scenes() {
        let expected = reference::render(&mesh, &atlas, &camera, &options);
        let d = difference(&expected, &cpu::render(&mesh, &atlas, &camera, &options));
        println!("{name}: {d:?}");
        assert!(d.inner + d.edge > 100, "{name}: nothing to compare: {d:?}");
        assert!(d.inner_off * 1000 <= d.inner, "{name}: {d:?}");
        assert!(d.edge_off * 100 <= d.edge, "{name}: {d:?}");
    }
}

#[test]
fn background_is_opaque() {
    let (mesh, atlas) = (torus(30, 12), atlas(64, 64));
    let camera = look_at(Point3::new(2.5, 1.0, 1.5), Point3::origin(), 120.0, 80, 60);
    let options = RenderOptions { supersample: 2, background: Some([10, 200, 30]) };
    let frame = cpu::render(&mesh, &atlas, &camera, &options);
    assert_eq!(frame.at(0, 0), [10, 200, 30, 255]);
    assert!(frame.pixels().iter().all(|p| p[3] == 255));
}

/// The harness itself: a picture that is off in one texel of every hundred must not pass.
#[test]
fn a_wrong_picture_is_found() {
    let (mesh, atlas) = (torus(40, 16), atlas(128, 128));
    let camera = look_at(Point3::new(2.5, 1.0, 1.5), Point3::origin(), 120.0, 80, 60);
    let right = cpu::render(&mesh, &atlas, &camera, &at(2));
    let mut wrong = right.clone();
    wrong.pixels_mut().iter_mut().step_by(100).for_each(|p| p[1] = p[1].wrapping_add(2));
    assert_eq!(difference(&right, &right).inner_off, 0);
    let d = difference(&right, &wrong);
    assert!(d.inner_off * 1000 > d.inner, "{d:?}");
}

/// A quad that fills the frame with one texel per pixel: pixel centres meet texel centres.
#[test]
fn one_to_one_is_the_identity() {
    let (width, height) = (61, 47);
    let quad = surface(1, 1, false, |s, t| Point3::new(s * width as f64, t * height as f64, 50.0));
    let mut camera = look_at(Point3::origin(), Point3::new(0.0, 0.0, 1.0), 50.0, width, height);
    camera.rotation = nalgebra::Matrix3::identity();
    (camera.intrinsics.cx, camera.intrinsics.cy) = (0.0, 0.0);
    let mut atlas = atlas(width, height);
    atlas.pixels_mut().iter_mut().for_each(|p| *p = p.map(|c| c.clamp(0.0, 255.0).round()));
    for frame in [reference::render(&quad, &atlas, &camera, &at(1)), cpu::render(&quad, &atlas, &camera, &at(1))] {
        for (p, t) in frame.pixels().iter().zip(atlas.pixels()) {
            assert_eq!(*p, [t[0] as u8, t[1] as u8, t[2] as u8, 255]);
        }
    }
}

/// Shared edges through sub-sample positions: each point belongs to exactly one face, so a plate
/// of any triangulation has no holes.
#[test]
fn grid_aligned_edges_leave_no_holes() {
    let plate = surface(32, 32, true, |s, t| Point3::new(64.0 * s + 0.25, 64.0 * t + 0.25, 50.0));
    let mut camera = look_at(Point3::origin(), Point3::new(0.0, 0.0, 1.0), 50.0, 65, 65);
    camera.rotation = nalgebra::Matrix3::identity();
    (camera.intrinsics.cx, camera.intrinsics.cy) = (0.0, 0.0);
    let frame = cpu::render(&plate, &atlas(64, 64), &camera, &at(2));
    for y in 1..64 {
        for x in 1..64 {
            assert_eq!(frame.at(x, y)[3], 255, "hole at {x}, {y}");
        }
    }
}

/// Writes a picture to look at: `TURNLIGHT_LOOK=DIR cargo test -p render look`.
#[test]
fn a_film_of_a_knot() {
    let (mesh, atlas) = (knot(400, 20), atlas(1024, 1024));
    let aabb = mesh.mesh.aabb().unwrap();
    let cameras = render::path::turntable_cameras(&aabb, None, 4, 320, 240, Vector3::z());
    let mut player = cpu::Player::new(&mesh, at(2));
    let frames: Vec<_> = cameras.iter().map(|camera| player.render(&atlas, camera)).collect();
    for frame in &frames {
        assert!(frame.at(0, 0)[3] == 0 && frame.pixels().iter().filter(|p| p[3] == 255).count() > 5_000);
    }
    let kept = std::env::var_os("TURNLIGHT_LOOK").map(std::path::PathBuf::from);
    let folder = tempfile::tempdir().unwrap();
    let folder = kept.as_deref().unwrap_or(folder.path());
    render::film::write_png(&folder.join("knot.png"), &frames[0]).unwrap();
    render::film::write_film(&folder.join("knot.apng"), frames, 10.0).unwrap();
}

#[test]
fn thread_count_changes_nothing() {
    let (mesh, atlas) = (knot(120, 12), atlas(256, 256));
    let camera = look_at(Point3::new(2.0, 1.0, 1.5), Point3::origin(), 200.0, 200, 150);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let alone = pool.install(|| cpu::render(&mesh, &atlas, &camera, &at(2)));
    assert_eq!(alone, cpu::render(&mesh, &atlas, &camera, &at(2)));
}

#[test]
fn broken_input_does_not_panic() {
    let atlas = atlas(16, 16);
    let good = sphere(6, 4);
    let camera = look_at(Point3::new(3.0, 0.0, 0.0), Point3::origin(), 20.0, 24, 16);
    let mut meshes = vec![good.clone(); 6];
    meshes[0].mesh.faces.clear();
    meshes[1].mesh.faces[3] = [0, 1, 9999];
    meshes[2].uvs.truncate(5);
    meshes[3].mesh.positions.iter_mut().step_by(3).for_each(|p| p.x = f64::NAN);
    meshes[4].mesh.positions.fill(Point3::origin());
    meshes[5].uvs.iter_mut().for_each(|uv| uv.x = f64::INFINITY);
    meshes.push(good.clone());
    meshes[6].mesh.positions.iter_mut().for_each(|p| p.y *= 1e300);
    meshes.push(good);
    meshes[7].mesh.positions.iter_mut().for_each(|p| *p *= 1e-200);

    let mut cameras = vec![camera; 9];
    cameras[1].intrinsics.fx = 0.0;
    cameras[2].translation.x = f64::NAN;
    (cameras[3].intrinsics.width, cameras[3].intrinsics.height) = (0, 7);
    (cameras[4].intrinsics.width, cameras[4].intrinsics.height) = (usize::MAX, 2);
    cameras[5].rotation.fill(0.0);
    cameras[6].intrinsics.distortion.k1 = -50.0;
    cameras[7].intrinsics.fx = 1e-300;
    cameras[8].translation.z = 1e55;
    for (mesh, camera) in meshes.iter().flat_map(|m| cameras.iter().map(move |c| (m, c))) {
        for supersample in [0, 1, 40] {
            for atlas in [&atlas, &Image::filled(0, 0, [0.0; 3])] {
                cpu::render(mesh, atlas, camera, &at(supersample));
            }
        }
        reference::render(mesh, &atlas, camera, &at(1));
    }
}

/// Waves over the tile, gloss about the mirror direction: depends on all that both renderers must agree on.
struct Brocade(Frame);

impl Sampler for Brocade {
    fn frame(&self) -> &Frame {
        &self.0
    }

    fn value(&self, texel: usize, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3] {
        let (x, y) = ((texel % self.0.width) as f32, (texel / self.0.width) as f32);
        let half = (light + view).normalize();
        let gloss = 0.8 * half.z.powi(20) * (1.0 + half.x);
        [0.3 + 0.2 * (x * 0.8).sin(), 0.3 + 0.2 * (y * 0.4).sin(), 0.2].map(|albedo| light.z * (albedo + gloss))
    }
}

#[test]
fn materials_are_lit_alike() {
    let directions = Arc::new(DirectionSet::new(&bonn_directions()));
    let brocade = Brocade(Frame { width: 16, height: 32, views: directions.clone(), lights: directions });
    let atlas = atlas(512, 384);
    let charts: Vec<u32> = (0..2000).step_by(2).collect();
    for (name, mesh, tile_size) in
        [("sphere", sphere(40, 20), 0.3), ("torus", torus(60, 24), 0.02), ("knot", knot(160, 12), 2.0)]
    {
        let (encoding, exposure) = (Encoding::Srgb, 0.7);
        let coat = Coat { charts: &charts, tile_size, sampler: &brocade, encoding, exposure, includes_cosine: true };
        let coats = Coats::new(&mesh, &[coat]);
        let lights = vec![
            Light::directional(Vector3::new(1.0, -0.5, 0.7)),
            Light::point(Point3::new(1.5, 1.0, 0.4), &Point3::origin()),
        ];
        let lighting = Lighting { lights, stops: -0.5 };
        let lit = Lit { coats: &coats, lighting: &lighting };
        for (eye, n) in [([3.0, 0.4, 1.0], 2), ([0.3, -2.0, 2.0], 1), ([0.1, 0.2, 0.1], 1)] {
            let camera = look_at(Point3::from(eye), Point3::origin(), 180.0, 201, 151);
            let expected = reference::render_lit(&mesh, &atlas, &lit, &camera, &at(n));
            let d = difference(&expected, &cpu::render_lit(&mesh, &atlas, &lit, &camera, &at(n)));
            println!("{name}: {d:?}");
            assert!(d.inner > 1000 && d.inner_off * 1000 <= d.inner && d.edge_off * 100 <= d.edge, "{name}: {d:?}");
            let plain = difference(&expected, &cpu::render(&mesh, &atlas, &camera, &at(n)));
            assert!(plain.inner_off * 4 > plain.inner, "{name}: the material does not show");
        }
    }
}

/// One column in four is white: what a texel in the middle of a cell says is wrong everywhere.
struct Stripes(Frame);

impl Sampler for Stripes {
    fn frame(&self) -> &Frame {
        &self.0
    }

    fn value(&self, texel: usize, _: &Vector3<f32>, _: &Vector3<f32>) -> [f32; 3] {
        [if (texel % self.0.width).is_multiple_of(4) { 1.0 } else { 0.0 }; 3]
    }
}

#[test]
fn fine_stripes_from_afar_are_grey_and_still() {
    let directions = Arc::new(DirectionSet::new(&bonn_directions()));
    let stripes = Stripes(Frame { width: 32, height: 32, views: directions.clone(), lights: directions });
    let (mesh, atlas) = (sphere(40, 20), atlas(64, 64));
    let charts: Vec<u32> = (0..2000).collect();
    // Eighteen to a hundred texels under a pixel.
    let (encoding, exposure, tile_size) = (Encoding::Srgb, 1.0, 0.01);
    let coat = Coat { charts: &charts, tile_size, sampler: &stripes, encoding, exposure, includes_cosine: true };
    let coats = Coats::new(&mesh, &[coat]);
    let light = Light::Directional { toward: Vector3::new(3.0, 0.4, 1.0), irradiance: [1.0; 3] };
    let lighting = Lighting { lights: vec![light], stops: 0.0 };
    let lit = Lit { coats: &coats, lighting: &lighting };
    let seen = |render: &dyn Fn(&Camera) -> Image<[u8; 4]>, shift: f64| {
        render(&look_at(Point3::new(3.0, 0.4, 1.0 + shift), Point3::origin(), 180.0, 101, 76))
    };
    let fast = |camera: &Camera| cpu::render_lit(&mesh, &atlas, &lit, camera, &at(1));
    let arbiter = |camera: &Camera| reference::render_lit(&mesh, &atlas, &lit, camera, &at(1));
    for render in [&fast as &dyn Fn(&Camera) -> _, &arbiter] {
        let (here, there) = (seen(render, 0.0), seen(render, 0.003));
        // A quarter of white, encoded.
        let middle = here.at(50, 38);
        assert_eq!([middle[0], middle[3]], [137, 255], "{middle:?}");
        let inside = |a: &[u8; 4], b: &[u8; 4]| a[3] == 255 && b[3] == 255;
        let pairs: Vec<_> = here.pixels().iter().zip(there.pixels()).filter(|(a, b)| inside(a, b)).collect();
        let change = pairs.iter().map(|(a, b)| a[0].abs_diff(b[0])).max().unwrap();
        assert!(pairs.len() > 2000 && change <= 2, "{} pixels change by up to {change}", pairs.len());
    }
}
