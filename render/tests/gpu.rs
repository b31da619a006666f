//! Graphics hardware, or Mesa's stand-in for it, draws what the reference defines. Without an adapter these tests
//! skip, and say so.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a helper that fails fails its test")]

#[path = "support/difference.rs"]
mod difference;
#[path = "support/models.rs"]
mod models;
#[path = "support/scenes.rs"]
mod scenes;
mod support;

use capture::btf::{Btf, Encoding, bonn_directions};
use capture::{Camera, Image};
use difference::{Difference, difference};
use geometry::TexturedMesh;
use models::{bumpy_ball, dyntex, lumigraph, still, vdtm};
use nalgebra::{Matrix3, Point3, Rotation3, Vector3};
use render::cpu::Object;
use render::gpu::{Blend, Device, GpuError, Renderer, Shot, Target, wgpu};
use render::material::{Coat, Coats, Light, Lighting, Lit};
use render::{Pose, RenderOptions, cpu, reference};
use scenes::{Scene, at, scenes};
use std::sync::OnceLock;
use support::{atlas, knot, look_at, sphere, surface, torus};
use texture::btf::{Budget, Precision, Sampler, gaussian_mixture, multilevel_vq};
use texture::{Appearance, Layer};

/// The one device of these tests.
fn device() -> Option<&'static Device> {
    static DEVICE: OnceLock<Result<Device, GpuError>> = OnceLock::new();
    match DEVICE.get_or_init(Device::headless) {
        Ok(device) => Some(device),
        Err(fault) => {
            println!("skipped: {fault}");
            None
        }
    }
}

fn shot(camera: &Camera, options: RenderOptions) -> Shot<'_> {
    Shot { camera, lighting: None, options }
}

/// 99.9 % of the object's pixels to rounding, coverage included.
fn assert_near(what: &str, expected: &Image<[u8; 4]>, actual: &Image<[u8; 4]>) {
    assert_share(what, expected, actual, 0.001);
}

fn assert_share(what: &str, expected: &Image<[u8; 4]>, actual: &Image<[u8; 4]>, most: f64) {
    let d = difference(expected, actual);
    println!("{what}: {d:?}");
    let Difference { inner, inner_off, edge, edge_off } = d;
    assert!(inner + edge > 100, "{what}: nothing to compare: {d:?}");
    assert!((inner_off + edge_off) as f64 <= most * (inner + edge) as f64, "{what}: {d:?}");
}

fn drawn(mesh: &TexturedMesh, atlas: &Image<[f32; 3]>, shot: &Shot<'_>) -> Option<Image<[u8; 4]>> {
    let mut renderer = Renderer::of_mesh(device()?, mesh).unwrap();
    renderer.set_atlas(atlas).unwrap();
    Some(renderer.render(shot).unwrap())
}

/// Writes a picture to look at: `TURNLIGHT_LOOK=DIR cargo test -p render --features gpu --test gpu`.
fn keep(name: &str, picture: &Image<[u8; 4]>) {
    if let Some(folder) = std::env::var_os("TURNLIGHT_LOOK") {
        render::film::write_png(&std::path::Path::new(&folder).join(format!("gpu {name}.png")), picture).unwrap();
    }
}

#[test]
fn every_scene_is_drawn_alike() {
    let Some(device) = device() else { return };
    for Scene { name, mesh, atlas, camera, options, hardware_off } in scenes() {
        let mut renderer = Renderer::of_mesh(device, &mesh).unwrap();
        renderer.set_atlas(&atlas).unwrap();
        let drawn = renderer.render(&shot(&camera, options));
        if camera.intrinsics.distortion.is_none() {
            let drawn = drawn.unwrap();
            keep(&name, &drawn);
            assert_share(&name, &reference::render(&mesh, &atlas, &camera, &options), &drawn, hardware_off);
        } else {
            let fault = drawn.unwrap_err();
            assert!(matches!(&fault, GpuError::Unsupported { what } if what.contains("lens")), "{name}: {fault}");
        }
    }
}

#[test]
fn background_is_opaque() {
    let (mesh, atlas) = (torus(30, 12), atlas(64, 64));
    let camera = look_at(Point3::new(2.5, 1.0, 1.5), Point3::origin(), 120.0, 80, 60);
    let options = RenderOptions { supersample: 2, background: Some([10, 200, 30]) };
    let Some(frame) = drawn(&mesh, &atlas, &shot(&camera, options)) else { return };
    assert_eq!(frame.at(0, 0), [10, 200, 30, 255]);
    assert!(frame.pixels().iter().all(|p| p[3] == 255));
}

/// Several objects of two models, posed, one of them nowhere: what the CPU draws of the same scene.
#[test]
fn whole_scenes_are_drawn_alike_whoever_blends() {
    let Some(device) = device() else { return };
    let ball = || bumpy_ball(9, [200, 180]);
    let models = [dyntex(ball(), 8, 30, |facet| 1 + facet % 8), lumigraph(ball(), 7)];
    let rotation = Rotation3::from_euler_angles(0.4, 0.2, -1.0).into_inner();
    let poses = [
        Pose { rotation, translation: Vector3::new(1.5, 0.6, 0.1), scale: 0.4 },
        Pose { translation: Vector3::new(-1.0, 0.0, 0.0), ..Pose::default() },
        Pose { rotation, translation: Vector3::new(-3.0, 2.0, -0.5), scale: 1.7 },
        Pose { translation: Vector3::repeat(f64::NAN), ..Pose::default() },
    ];
    let object = |(k, pose): (usize, &Pose)| Object { pose: *pose, ..Object::new(&models[k % 2]) };
    let mut objects: Vec<Object<'_>> = poses.iter().enumerate().map(object).collect();
    objects.push(Object { pose: Pose { translation: Vector3::new(0.0, -2.0, 0.0), ..poses[0] }, ..objects[0] });
    let mut player = cpu::ScenePlayer::new(&objects, at(2));
    for blend in [Blend::Adapter, Blend::Cpu] {
        let mut renderer = Renderer::of_scene(device, &objects, blend).unwrap();
        for (i, eye) in [[5.0, 0.4, 1.0], [0.3, -6.0, 2.0], [5.0, 0.4, 1.0]].into_iter().enumerate() {
            let camera = look_at(Point3::from(eye), Point3::origin(), 180.0, 201, 151);
            let name = format!("scene {blend:?} {i}");
            let actual = renderer.render(&shot(&camera, at(2))).unwrap();
            keep(&name, &actual);
            assert_near(&name, &player.render(&camera, &Lighting::default()), &actual);
            assert!(renderer.bytes() > 0, "{name}");
        }
    }
    let mut empty = Renderer::of_scene(device, &[], Blend::Adapter).unwrap();
    let camera = look_at(Point3::new(5.0, 0.4, 1.0), Point3::origin(), 180.0, 20, 15);
    assert!(empty.render(&shot(&camera, at(1))).unwrap().pixels().iter().all(|p| *p == [0; 4]));
}

/// A model without texels is black, as everywhere.
#[test]
fn a_model_without_texels_is_black() {
    let Some(device) = device() else { return };
    let mut model = still(bumpy_ball(5, [40, 30]));
    let Appearance::Layers(layers) = &mut model.appearance else { return };
    layers.facet_of_texel = Image::filled(0, 0, 0);
    layers.layers.iter_mut().for_each(|layer| layer.texels = Image::filled(0, 0, [0; 3]));
    let camera = look_at(Point3::new(3.0, 0.4, 1.0), Point3::origin(), 60.0, 60, 45);
    for blend in [Blend::Adapter, Blend::Cpu] {
        let frame = Renderer::with_blend(device, &model, blend).unwrap().render(&shot(&camera, at(1))).unwrap();
        assert_near("black", &reference::render(&model.mesh, &Image::filled(0, 0, [0.0; 3]), &camera, &at(1)), &frame);
    }
}

#[test]
fn one_to_one_is_the_identity() {
    let (width, height) = (61, 47);
    let quad = surface(1, 1, false, |s, t| Point3::new(s * width as f64, t * height as f64, 50.0));
    let mut camera = look_at(Point3::origin(), Point3::new(0.0, 0.0, 1.0), 50.0, width, height);
    camera.rotation = Matrix3::identity();
    (camera.intrinsics.cx, camera.intrinsics.cy) = (0.0, 0.0);
    let mut atlas = atlas(width, height);
    atlas.pixels_mut().iter_mut().for_each(|p| *p = p.map(|c| c.clamp(0.0, 255.0).round()));
    let Some(frame) = drawn(&quad, &atlas, &shot(&camera, at(1))) else { return };
    for (p, t) in frame.pixels().iter().zip(atlas.pixels()) {
        assert_eq!(*p, [t[0] as u8, t[1] as u8, t[2] as u8, 255]);
    }
}

#[test]
fn a_frame_of_several_tiles_is_one_picture() {
    let (mesh, atlas) = (torus(60, 24), atlas(256, 256));
    let camera = look_at(Point3::new(2.5, 1.0, 1.5), Point3::origin(), 300.0, 301, 203);
    // 16 sub-samples along a side make tiles of 128 pixels.
    let Some(fine) = drawn(&mesh, &atlas, &shot(&camera, at(16))) else { return };
    assert_near("16 × 16", &cpu::render(&mesh, &atlas, &camera, &at(16)), &fine);
}

#[test]
fn broken_input_does_not_panic() {
    let Some(device) = device() else { return };
    let good = sphere(6, 4);
    let camera = look_at(Point3::new(3.0, 0.0, 0.0), Point3::origin(), 20.0, 24, 16);
    let mut meshes = vec![good.clone(); 6];
    meshes[0].mesh.faces.clear();
    meshes[1].mesh.faces[3] = [0, 1, 9999];
    meshes[2].uvs.truncate(5);
    meshes[3].mesh.positions.iter_mut().step_by(3).for_each(|p| p.x = f64::NAN);
    meshes[4].mesh.positions.fill(Point3::origin());
    meshes[5].mesh.positions.iter_mut().for_each(|p| *p *= 1e-200);
    meshes.push(good);
    let mut cameras = vec![camera; 7];
    cameras[1].intrinsics.fx = 0.0;
    cameras[2].translation.x = f64::NAN;
    (cameras[3].intrinsics.width, cameras[3].intrinsics.height) = (0, 7);
    (cameras[4].intrinsics.width, cameras[4].intrinsics.height) = (usize::MAX, 2);
    cameras[5].rotation.fill(0.0);
    cameras[6].translation.z = 1e55;
    for mesh in &meshes {
        let mut renderer = Renderer::of_mesh(device, mesh).unwrap();
        for camera in &cameras {
            renderer.render(&shot(camera, at(2))).unwrap();
        }
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let Some(device) = device() else { return };
    let mut mesh = sphere(6, 4);
    mesh.atlas_size = [1 << 15, 16];
    let fault = Renderer::of_mesh(device, &mesh).unwrap_err();
    assert!(matches!(fault, GpuError::TooLarge { .. }) && fault.to_string().contains("let the CPU play"), "{fault}");
    mesh.atlas_size = [1 << 14, 1 << 14];
    assert!(matches!(Renderer::of_mesh(device, &mesh).unwrap_err(), GpuError::TooLarge { .. }));
    let model = dyntex(bumpy_ball(3, [40, 30]), 5000, 1, |_| 1);
    let fault = Renderer::with_blend(device, &model, Blend::Adapter).unwrap_err();
    assert!(fault.to_string().contains("5000 layers"), "{fault}");
    assert!(Renderer::with_blend(device, &model, Blend::Cpu).is_ok());
}

/// Neither layers nor atlas are a GiB, but both together; the layers of one model count once, the atlases of its objects
/// each. Nothing is read of what is refused.
#[test]
fn what_does_not_fit_together_is_refused() {
    let Some(device) = device() else { return };
    let mut model = still(bumpy_ball(3, [40, 30]));
    let Appearance::Layers(layers) = &mut model.appearance else { return };
    let side = 4096;
    layers.facet_of_texel = Image::filled(side, side, 0);
    let empty = Image::filled(0, 0, [0; 3]);
    layers.layers = vec![Layer { texels: empty, scale: 1.0, offset: 0.0, coded: Vec::new() }; 14];
    let fault = Renderer::with_blend(device, &model, Blend::Adapter).unwrap_err();
    assert!(fault.to_string().starts_with("1098 MiB of textures, where"), "{fault}");
    let seven = vec![Object::new(&model); 7];
    let fault = Renderer::of_scene(device, &seven, Blend::Cpu).unwrap_err();
    assert!(fault.to_string().starts_with("1194 MiB of textures, where"), "{fault}");
}

/// A window's target: another format, its size not that of one tile, and an encoding of its own.
#[test]
fn somebody_elses_target_shows_the_same() {
    let Some(device) = device() else { return };
    let (mesh, atlas) = (knot(120, 12), atlas(256, 256));
    let camera = look_at(Point3::new(2.0, 1.0, 1.5), Point3::origin(), 200.0, 200, 150);
    let options = RenderOptions { supersample: 12, background: Some([30, 60, 90]) };
    let mut renderer = Renderer::of_mesh(device, &mesh).unwrap();
    renderer.set_atlas(&atlas).unwrap();
    let expected = renderer.render(&shot(&camera, options)).unwrap();
    for format in [wgpu::TextureFormat::Rgba8Unorm, wgpu::TextureFormat::Rgba8UnormSrgb] {
        let window = window(device, [200, 150], format);
        let view = window.create_view(&wgpu::TextureViewDescriptor::default());
        renderer.draw(&shot(&camera, options), &Target { view: &view, format }).unwrap();
        assert_near(&format!("{format:?}"), &expected, &contents(device, &window));
    }
}

fn window(device: &Device, [width, height]: [u32; 2], format: wgpu::TextureFormat) -> wgpu::Texture {
    device.wgpu().create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

/// The bytes of a texture, as they lie there.
fn contents(device: &Device, texture: &wgpu::Texture) -> Image<[u8; 4]> {
    let (width, height) = (texture.width(), texture.height());
    let stride = (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.wgpu().create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(stride * height),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = device.wgpu().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(stride), rows_per_image: None };
    let to = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
    encoder.copy_texture_to_buffer(texture.as_image_copy(), to, texture.size());
    device.queue().submit([encoder.finish()]);
    buffer.slice(..).map_async(wgpu::MapMode::Read, |mapped| mapped.unwrap());
    device.wgpu().poll(wgpu::PollType::wait_indefinitely()).unwrap();
    let bytes = buffer.slice(..).get_mapped_range().unwrap();
    let rows = bytes.chunks(stride as usize).flat_map(|row| row[..4 * width as usize].as_chunks::<4>().0.to_vec());
    Image::from_pixels(width as usize, height as usize, rows.collect()).unwrap()
}

#[test]
fn every_method_is_drawn_alike_whoever_blends() {
    let Some(device) = device() else { return };
    let ball = || bumpy_ball(9, [200, 180]);
    let models = [still(ball()), vdtm(ball(), 9), dyntex(ball(), 20, 30, |facet| 1 + facet % 20), lumigraph(ball(), 7)];
    let eyes = [[3.0, 0.4, 1.0], [0.3, -2.0, 2.0], [-1.6, 1.1, -0.6]];
    for (model, blend) in models.iter().flat_map(|m| [Blend::Adapter, Blend::Cpu].map(|blend| (m, blend))) {
        let mut renderer = Renderer::with_blend(device, model, blend).unwrap();
        for (i, eye) in eyes.into_iter().enumerate() {
            let camera = look_at(Point3::from(eye), Point3::origin(), 180.0, 201, 151);
            let name = format!("{} {blend:?} {i}", model.method.name());
            let expected = reference::render(&model.mesh, &model.atlas(&camera.center()), &camera, &at(2));
            let actual = renderer.render(&shot(&camera, at(2))).unwrap();
            keep(&name, &actual);
            assert_near(&name, &expected, &actual);
        }
    }
}

/// A picture that does not follow the eye must not pass.
#[test]
fn the_methods_of_these_tests_depend_on_the_eye() {
    let ball = || bumpy_ball(9, [200, 180]);
    let camera = look_at(Point3::new(3.0, 0.4, 1.0), Point3::origin(), 180.0, 201, 151);
    for model in [vdtm(ball(), 9), dyntex(ball(), 20, 30, |facet| 1 + facet % 20), lumigraph(ball(), 7)] {
        let seen = |eye: &Point3<f64>| cpu::render(&model.mesh, &model.atlas(eye), &camera, &at(2));
        let d = difference(&seen(&camera.center()), &seen(&Point3::new(0.3, -2.0, 2.0)));
        assert!(d.inner_off * 4 > d.inner, "{d:?}");
    }
}

/// A small weave with gloss, measured under a third of the usual directions.
fn weave(encoding: Encoding, includes_cosine: bool) -> Btf {
    let directions: Vec<Vector3<f64>> = bonn_directions().into_iter().step_by(3).collect();
    let (width, height) = (12, 16);
    let mut samples = Vec::new();
    for (view, light) in directions.iter().flat_map(|v| directions.iter().map(move |l| (v, l))) {
        let gloss = (view + light).normalize().z.powi(30);
        for i in 0..width * height {
            let (x, y) = ((i % width) as f64, (i / width) as f64);
            let thread =
                if (i % width / 3 + i / width / 4) % 2 == 0 { 0.5 + 0.1 * x.sin() } else { 0.2 + 0.1 * y.cos() };
            let cosine = if includes_cosine { light.z } else { 1.0 };
            let radiance = [0.9, 0.6, 0.3].map(|c| (cosine * (c * thread + 0.4 * gloss) / 3.0) as f32);
            samples.extend(radiance.map(|r| encoding.encode(r)));
        }
    }
    Btf {
        name: "weave".to_owned(),
        views: directions.clone(),
        lights: directions,
        width,
        height,
        encoding,
        exposure: 1.0,
        includes_cosine,
        texel_pitch_mm: None,
        samples,
        measured: Vec::new(),
    }
}

/// What the codec answers, not how well it was fitted, is compared.
#[test]
fn materials_are_lit_alike() {
    let Some(device) = device() else { return };
    let log = Encoding::Log { floor: 1e-3, peak: 1.0 };
    let mixture = mixture(&weave(Encoding::Srgb, true));
    let vq = vector_quantised(&weave(log, false));
    // A torus of one chart; a sphere whose cells carry the material in turns. Texels are far larger than sub-samples,
    // at the limb too, for averages are not drawn by the adapter.
    let [smooth, weave] = [(&mixture as &dyn Sampler, Encoding::Srgb, true), (&vq, log, false)];
    let cases = [
        ("mixture", smooth, torus(60, 24), 8.0, 0.001),
        ("vq", weave, torus(60, 24), 8.0, 0.001),
        ("vq in cells", weave, sphere(40, 20), 8.0, 0.002),
    ];
    let charts: Vec<u32> = (0..2000).step_by(2).collect();
    let atlas = atlas(128, 96);
    for (name, (sampler, encoding, includes_cosine), mesh, tile_size, most) in cases {
        let coat = Coat { charts: &charts, tile_size, sampler, encoding, exposure: 0.7, includes_cosine };
        let coats = Coats::new(&mesh, &[coat]);
        let lights = vec![
            Light::directional(Vector3::new(1.0, -0.5, 0.7)),
            Light::point(Point3::new(1.5, 1.0, 0.4), &Point3::origin()),
        ];
        let lighting = Lighting { lights, stops: -0.5 };
        let lit = Lit { coats: &coats, lighting: &lighting };
        let mut renderer = Renderer::of_mesh(device, &mesh).unwrap();
        renderer.set_atlas(&atlas).unwrap();
        renderer.lay(&coats).unwrap();
        for (i, (eye, n)) in [([3.0, 0.4, 1.0], 2), ([0.1, 0.2, 0.1], 1)].into_iter().enumerate() {
            let camera = look_at(Point3::from(eye), Point3::origin(), 90.0, 101, 76);
            let expected = reference::render_lit(&mesh, &atlas, &lit, &camera, &at(n));
            let shot = Shot { lighting: Some(&lighting), ..shot(&camera, at(n)) };
            let actual = renderer.render(&shot).unwrap();
            keep(&format!("{name} {i}"), &actual);
            assert_share(&format!("{name} {i}"), &expected, &actual, most);
            let plain = renderer.render(&Shot { lighting: None, ..shot }).unwrap();
            assert_share("without light", &cpu::render(&mesh, &atlas, &camera, &at(n)), &plain, most);
            assert!(difference(&actual, &plain).inner_off * 4 > difference(&actual, &plain).inner, "{name} shows");
        }
    }
}

fn vector_quantised(btf: &Btf) -> multilevel_vq::MultilevelVq {
    let options = multilevel_vq::Options::new(btf, Budget::Standard, Precision::Compact, 1).unwrap();
    multilevel_vq::fit(btf, &options).unwrap().0
}

fn mixture(btf: &Btf) -> gaussian_mixture::GaussianMixture {
    let options = gaussian_mixture::Options::new(btf, Budget::Components(24), Precision::Full, 1).unwrap();
    let quick = gaussian_mixture::Options { rounds: 6, warm_up: None, try_shapes: false, ..options };
    gaussian_mixture::fit(btf, &quick).unwrap().0
}
