//! Each test probes the row of its name in `docs/conventions.md`.

use capture::{Camera, Capture, Image, Intrinsics, LoadOptions};
use geometry::{Mesh, TexturedMesh};
use nalgebra::{Matrix3, Point2, Point3, Vector3};
use render::{RenderOptions, cpu};
use texture::metrics;

/// 100 × 80 pixels, looking from z = −5 along +z of the world, its axes those of the world.
fn camera() -> Camera {
    Camera {
        intrinsics: Intrinsics::pinhole(200.0, [100, 80]),
        rotation: Matrix3::identity(),
        translation: Vector3::new(0.0, 0.0, 5.0),
    }
}

/// A unit square in the plane z = 0, seen from below z = 0, with its top-left corner (as `camera` sees
/// it) at the top-left corner of a 2 × 2 atlas.
fn square() -> TexturedMesh {
    let positions = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[x, y]| Point3::new(x, y, 0.0));
    let uvs = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[u, v]| Point2::new(u, v));
    TexturedMesh {
        // Counter-clockwise from z = −5, where y runs down in the picture.
        mesh: Mesh { positions: positions.to_vec(), faces: vec![[0, 3, 2], [0, 2, 1]] },
        uvs: uvs.to_vec(),
        face_charts: vec![0, 0],
        atlas_size: [2, 2],
    }
}

fn cube() -> Mesh {
    let positions = (0..8).map(|i| Point3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2))).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Mesh { positions, faces: quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect() }
}

#[test]
fn camera_axes() {
    let camera = camera();
    assert_eq!(camera.center(), Point3::new(0.0, 0.0, -5.0));
    assert_eq!(camera.forward(), Vector3::z());
    let right = camera.project(&Point3::new(1.0, 0.0, 0.0)).expect("in front");
    assert!(right.pixel.x > 50.0 && right.pixel.y == 40.0, "x of the camera runs right");
    let down = camera.project(&Point3::new(0.0, 1.0, 0.0)).expect("in front");
    assert!(down.pixel.y > 40.0 && down.pixel.x == 50.0, "y of the camera runs down");
    assert!(camera.project(&Point3::new(0.0, 0.0, -6.0)).is_none(), "behind");
    assert_eq!(camera.to_camera(&Point3::origin()), Vector3::new(0.0, 0.0, 5.0), "X_c = R X_w + t");
}

#[test]
fn pixel_centres() {
    let camera = camera();
    let ray = camera.ray(Point2::new(50.0, 40.0)).expect("a pinhole");
    assert!((ray.direction - Vector3::z()).norm() < 1e-15);
    assert!(camera.in_frame(Point2::new(0.0, 0.0)) && !camera.in_frame(Point2::new(100.0, 0.0)));
    // A square whose corners project to whole pixels covers exactly those pixels.
    let frame = cpu::render(&square(), &Image::filled(2, 2, [9.0; 3]), &camera, &RenderOptions::default());
    let covered = frame.pixels().iter().filter(|p| p[3] == 255).count();
    assert_eq!(covered, 40 * 40, "one unit at distance 5 is 40 pixels");
    assert_eq!([frame.at(30, 20)[3], frame.at(29, 20)[3], frame.at(69, 59)[3], frame.at(70, 59)[3]], [255, 0, 255, 0]);
}

#[test]
fn files_are_opengl() {
    let place = tempfile::tempdir().expect("a folder");
    let pixels = Image::filled(100, 80, [200; 3]);
    std::fs::create_dir(place.path().join("images")).expect("a folder");
    capture::write_rgb(&place.path().join("images/a.png"), &pixels).expect("written");
    // Identity: at the origin, y up, looking along −z.
    let file = r#"{"w": 100, "h": 80, "fl_x": 200, "fl_y": 200, "cx": 50, "cy": 40, "frames": [
        {"file_path": "images/a.png", "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]}"#;
    std::fs::write(place.path().join("transforms.json"), file).expect("written");
    let camera = Capture::read(place.path()).expect("a capture").frames[0].camera;
    assert!((camera.forward() + Vector3::z()).norm() < 1e-12, "the camera looks along −z");
    let above = camera.project(&Point3::new(0.0, 1.0, -5.0)).expect("in front");
    assert!(above.pixel.y < 40.0, "y of the file runs up");
}

#[test]
fn handedness() {
    for camera in render::path::turntable_cameras(
        &capture::Aabb { min: Point3::origin(), max: Point3::new(1.0, 1.0, 1.0) },
        None,
        5,
        64,
        48,
        Vector3::z(),
    ) {
        assert!((camera.rotation.determinant() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn uv_origin() {
    let mut atlas = Image::filled(2, 2, [0.0; 3]);
    atlas.set(0, 0, [255.0, 0.0, 0.0]);
    atlas.set(1, 0, [0.0, 255.0, 0.0]);
    atlas.set(0, 1, [0.0, 0.0, 255.0]);
    let frame = cpu::render(&square(), &atlas, &camera(), &RenderOptions::default());
    // Texel centres are at (¼, ¼), …: a quarter of 40 pixels into the square.
    assert!(frame.at(38, 28)[0] > 200, "texel (0, 0) is top left: {:?}", frame.at(38, 28));
    assert!(frame.at(61, 28)[1] > 200, "u runs right: {:?}", frame.at(61, 28));
    assert!(frame.at(38, 51)[2] > 200, "v runs down: {:?}", frame.at(38, 51));
}

#[test]
fn winding() {
    let cube = cube();
    assert!((cube.signed_volume() - 1.0).abs() < 1e-12);
    assert!(cube.check().expect("finite").closed_manifold);
    let outward = cube.face_area_vector(0).dot(&(cube.corners(0)[0] - Point3::new(0.5, 0.5, 0.5)));
    assert!(outward > 0.0, "normals point outward");
}

#[test]
fn mattes() {
    let frame = Image::filled(4, 1, [0, 0, 0, 255]);
    let photograph = Image::filled(4, 1, [255; 3]);
    let matte = Image::from_pixels(4, 1, vec![0, 127, 128, 255]).expect("four pixels");
    let score = metrics::score(&frame, &photograph, &matte).expect("an object");
    assert_eq!(score.mask_iou, 0.5, "two of four pixels are object");
}

#[test]
fn intensities() {
    // Encoded values pass through unchanged, and a fifth of 255 is 20 %.
    let frame = cpu::render(&square(), &Image::filled(2, 2, [51.0; 3]), &camera(), &RenderOptions::default());
    assert_eq!(frame.at(50, 40), [51, 51, 51, 255]);
    let mask = frame.map(|p| p[3]);
    let score = metrics::score(&frame, &Image::filled(100, 80, [0; 3]), &mask).expect("an object");
    assert!((score.error_mean_pct - 20.0).abs() < 1e-12);
}

#[test]
fn alpha() {
    // Half a pixel to the right: the left and the right column are half covered, colour unchanged.
    let mut camera = camera();
    camera.intrinsics.cx += 0.5;
    let frame = cpu::render(&square(), &Image::filled(2, 2, [100.0; 3]), &camera, &RenderOptions::default());
    assert_eq!(frame.at(30, 40), [100, 100, 100, 128], "not premultiplied");
    assert_eq!(frame.at(20, 40)[3], 0);
}

#[test]
fn positions() {
    let place = tempfile::tempdir().expect("a folder");
    let capture = Capture::read(&tests::small_capture(place.path(), 4)).expect("a capture");
    let views = capture.load_views(&[3, 1], &LoadOptions::default()).expect("views");
    assert_eq!(views.iter().map(|v| v.index).collect::<Vec<_>>(), [3, 1]);
    assert_eq!(views[0].camera, capture.frames[3].camera);
    assert_eq!("even".parse::<turnlight::Selection>().expect("a selection").positions(4).expect("views"), [0, 2]);
}

#[test]
fn outside_the_frame() {
    let place = tempfile::tempdir().expect("a folder");
    let path = tests::small_capture(place.path(), 3);
    let capture = Capture::read(&path).expect("a capture");
    let views = capture.load_all_views(&LoadOptions::default()).expect("views");
    assert!(views.iter().all(|view| view.is_complete), "the object does not touch the border");
    let mask = capture.frames[0].mask_path.clone().expect("masks");
    capture::write_matte(&mask, &Image::filled(96, 72, 255)).expect("written");
    let views = capture.load_all_views(&LoadOptions::default()).expect("views");
    assert!(!views[0].is_complete && views[1].is_complete, "what touches the border may go on beyond");
}

#[test]
fn every_row_has_its_test() {
    let page =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/conventions.md")).expect("the page");
    let source = include_str!("conventions.rs");
    let rows: Vec<&str> = page.lines().filter_map(|l| l.strip_prefix("| `")?.split('`').next()).collect();
    assert!(rows.len() >= 11);
    for row in rows {
        assert!(source.contains(&format!("#[test]\nfn {row}()")), "{row} has no test");
    }
}
