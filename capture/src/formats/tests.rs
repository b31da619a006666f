//! Every reader on a tiny file made by hand, and on damage.

use super::*;
use crate::Image;
use nalgebra::{Point3, Vector3};
use proptest::prelude::*;
use std::fs;

/// A folder with the given files, and images of 8×6 pixels for names that end in `.png`.
fn folder(files: &[(&str, &[u8])]) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for (name, content) in files {
        let path = dir.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        if name.ends_with(".png") && content.is_empty() {
            pixels::write_rgb(&path, &Image::filled(8, 6, [9, 9, 9])).unwrap();
        } else {
            fs::write(&path, content).unwrap();
        }
    }
    dir
}

fn message(dir: &tempfile::TempDir) -> String {
    Capture::read(dir.path()).unwrap_err().to_string()
}

const IDENTITY: &str = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";

fn transforms(keys: &str, matrix: &str) -> String {
    format!(r#"{{{keys} "frames": [{{"file_path": "a.png", "transform_matrix": {matrix}}}]}}"#)
}

#[test]
fn opengl_camera_looks_along_minus_z() {
    // Corner origin: cx = 4 is the middle of 8 columns.
    let text = transforms(r#""camera_angle_x": 1.5707963267948966,"#, IDENTITY);
    let dir = folder(&[("transforms_train.json", text.as_bytes()), ("a.png", b"")]);
    let camera = Capture::read(dir.path()).unwrap().frames[0].camera;
    let seen = camera.project(&Point3::new(0.0, 0.0, -1.0)).unwrap();
    assert!((seen.pixel.x - 4.0).abs() + (seen.pixel.y - 3.0).abs() < 1e-12);
    // A right angle over 8 columns: f = 4. Up in the world is up in the image.
    let above = camera.project(&Point3::new(0.25, 0.5, -1.0)).unwrap();
    assert!((above.pixel.x - 5.0).abs() + (above.pixel.y - 1.0).abs() < 1e-12);
    assert!(camera.project(&Point3::new(0.0, 0.0, 1.0)).is_none());
}

#[test]
fn a_file_without_extension_finds_its_image() {
    let text = transforms(r#""fl_x": 5, "#, IDENTITY).replace("a.png", "./train/a");
    let dir = folder(&[("transforms.json", text.as_bytes()), ("train/a.png", b"")]);
    let capture = Capture::read(&dir.path().join("transforms.json")).unwrap();
    assert!(capture.frames[0].image_path.ends_with("train/a.png"));
}

#[test]
fn a_frames_own_lens_goes_before_the_shared_one() {
    let text = transforms(r#""fl_x": 5, "w": 8, "h": 6, "k1": 0.1, "#, IDENTITY);
    let text = text.replace(r#""file_path""#, r#""fl_x": 7, "exposure": 2, "light_direction": [0, 0, 2], "file_path""#);
    let dir = folder(&[("transforms.json", text.as_bytes())]);
    let frame = &Capture::read(dir.path()).unwrap().frames[0];
    assert_eq!((frame.camera.intrinsics.fx, frame.camera.intrinsics.distortion.k1), (7.0, 0.1));
    assert_eq!((frame.exposure, frame.light_direction), (Some(2.0), Some(Vector3::z())));
}

#[test]
fn faulty_poses_are_told_apart() {
    for (matrix, fault) in [
        ("[[1,0,0,0],[0,1,0,0],[0,0,-1,0],[0,0,0,1]]", "mirrors"),
        ("[[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]", "rotation is none"),
        ("[[1,0,0,0],[0,1,0,0]]", "not 4×4"),
        ("[[NaN,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]", "NaN"),
    ] {
        let text = transforms(r#""fl_x": 5, "w": 8, "h": 6,"#, matrix);
        let found = message(&folder(&[("transforms.json", text.as_bytes())]));
        assert!(found.contains(fault) && found.contains("transforms.json"), "{found}");
    }
}

#[test]
fn a_slightly_skewed_rotation_is_made_exact() {
    let text = transforms(r#""fl_x": 5, "w": 8, "h": 6,"#, "[[1.001,0,0,0],[0,1,0,0],[0.002,0,1,0],[0,0,0,1]]");
    let r = Capture::read(folder(&[("transforms.json", text.as_bytes())]).path()).unwrap().frames[0].camera.rotation;
    assert!((r * r.transpose() - Matrix3::identity()).amax() < 1e-12);
}

#[test]
fn faulty_lenses_and_boxes_are_refused() {
    for (keys, fault) in [
        (r#""fl_x": -5, "w": 8, "h": 6,"#, "focal length"),
        (r#""w": 8, "h": 6,"#, "camera_angle_x"),
        (r#""fl_x": 5, "w": 0, "h": 6,"#, "image size"),
        (r#""fl_x": 5, "w": 8, "h": 6, "camera_model": "OPENCV_FISHEYE","#, "OPENCV_FISHEYE"),
        (r#""fl_x": 5, "w": 8, "h": 6, "aabb": [[0,0,0],[1,-1,1]],"#, "aabb"),
        (r#""fl_x": 5,"#, "does not exist"),
    ] {
        let found = message(&folder(&[("transforms.json", transforms(keys, IDENTITY).as_bytes())]));
        assert!(found.contains(fault), "{found}");
    }
    let none = message(&folder(&[("transforms.json", br#"{"frames": []}"#)]));
    assert!(none.contains("lists no frames"), "{none}");
    assert!(message(&folder(&[("notes.txt", b"hello")])).contains("is no capture: looked for transforms.json"));
}

#[test]
fn colmap_text_keeps_empty_point_lines_apart() {
    let cameras = b"# comment\n1 OPENCV 8 6 5 6 4 3 0.1 0.2 0.3 0.4\n2 SIMPLE_RADIAL 8 6 5 4 3 0.1\n";
    let images = b"# comment\n7 1 0 0 0 1 2 3 1 b 10.png\n\n8 1 0 0 0 1 2 4 2 b 9.png\n1.5 2.5 -1\n";
    let dir = folder(&[("sparse/0/cameras.txt", cameras), ("sparse/0/images.txt", images), ("images/b 9.png", b"")]);
    let capture = Capture::read(dir.path()).unwrap();
    assert_eq!(capture.frames.len(), 2);
    assert!(capture.frames[0].image_path.ends_with("images/b 9.png"));
    let camera = capture.frames[1].camera;
    assert_eq!(camera.translation, Vector3::new(1.0, 2.0, 3.0));
    // COLMAP counts from the corner, as we do.
    assert_eq!((camera.intrinsics.fy, camera.intrinsics.cx, camera.intrinsics.distortion.p2), (6.0, 4.0, 0.4));
}

#[test]
fn colmap_binary_agrees_with_text() {
    let mut cameras = 1_u64.to_le_bytes().to_vec();
    cameras.extend(3_i32.to_le_bytes());
    cameras.extend(1_i32.to_le_bytes());
    cameras.extend([8_u64, 6].map(u64::to_le_bytes).concat());
    cameras.extend([5.0_f64, 6.0, 4.0, 3.0].map(f64::to_le_bytes).concat());
    let mut images = 1_u64.to_le_bytes().to_vec();
    images.extend(1_i32.to_le_bytes());
    images.extend([0.6_f64, 0.0, 0.8, 0.0, 1.0, 2.0, 3.0].map(f64::to_le_bytes).concat());
    images.extend(3_i32.to_le_bytes());
    images.extend(b"a.png\0");
    images.extend(0_u64.to_le_bytes());
    let binary = folder(&[("cameras.bin", &cameras), ("images.bin", &images)]);
    let text = folder(&[("cameras.txt", b"3 PINHOLE 8 6 5 6 4 3"), ("images.txt", b"1 0.6 0 0.8 0 1 2 3 3 a.png\n")]);
    let read = |dir: &tempfile::TempDir| Capture::read(dir.path()).unwrap().frames[0].camera;
    assert_eq!(read(&binary), read(&text));
    let cut = folder(&[("cameras.bin", &cameras), ("images.bin", &images[..40])]);
    assert!(message(&cut).contains("truncated"));
}

#[test]
fn middlebury_lines_and_box_are_read() {
    let par = b"1\na.png 5 0 3 0 6 2 0 0 1 1 0 0 0 1 0 0 0 1 0.1 0.2 0.3\n";
    let readme = b"The box is\n(-1 -2 -3)\n(1.5, 2, 3)\n";
    let dir = folder(&[("toy_par.txt", par), ("README.txt", readme), ("a.png", b"")]);
    let capture = Capture::read(dir.path()).unwrap();
    assert_eq!(capture.aabb.unwrap().max, Point3::new(1.5, 2.0, 3.0));
    let i = capture.frames[0].camera.intrinsics;
    assert_eq!((i.fx, i.fy, i.cx, i.cy, i.width), (5.0, 6.0, 3.5, 2.5, 8));
    let bad = folder(&[("toy_par.txt", b"1\na.png 5 nan 3"), ("a.png", b"")]);
    assert!(message(&bad).contains("line 2: 'nan' is not a finite number"));
    let short = folder(&[("toy_par.txt", b"2\n"), ("a.png", b"")]);
    assert!(message(&short).contains("announces 2 images and lists 0"));
}

#[test]
fn projections_find_their_image_under_another_extension() {
    let dir = folder(&[("projections.txt", b"# c\na.0.ppm 5 0 3 0 0 6 2 0 0 0 1 9\n"), ("a.0.png", b"")]);
    let camera = Capture::read(dir.path()).unwrap().frames[0].camera;
    assert!((camera.intrinsics.cx - 3.5).abs() < 1e-12 && (camera.translation.z - 9.0).abs() < 1e-12);
    let flat = folder(&[("projections.txt", b"a.png 0 0 0 0 0 6 2 0 0 0 1 9\n"), ("a.png", b"")]);
    assert!(message(&flat).contains("singular"));
}

#[test]
fn digits_compare_as_numbers() {
    let mut names = ["image_10", "image_2", "image_02", "b", "image_1"];
    names.sort_by(|a, b| natural_order(a, b));
    assert_eq!(names, ["b", "image_1", "image_02", "image_2", "image_10"]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// No reader panics, whatever the bytes; 1e308 and the like included.
    #[test]
    fn no_reader_panics(bytes in proptest::collection::vec(any::<u8>(), 0..300), words in "[-0-9.e naif\n#]{0,200}") {
        for content in [bytes.as_slice(), words.as_bytes()] {
            for name in ["transforms.json", "x_par.txt", "projections.txt", "a.pa", "p.mat"] {
                let dir = folder(&[(name, content), ("a.png", b"")]);
                let _ = Capture::read(dir.path());
            }
            for (cameras, images) in [("cameras.txt", "images.txt"), ("cameras.bin", "images.bin")] {
                let dir = folder(&[(cameras, content), (images, content)]);
                let _ = Capture::read(dir.path());
            }
            let mut mat = vec![b' '; 124];
            mat.extend([0, 1, b'I', b'M']);
            mat.extend(content);
            let _ = Capture::read(folder(&[("p.mat", &mat)]).path());
        }
    }

    /// `K [R | t]` comes back from its product, whatever its scale and sign.
    #[test]
    fn matrices_decompose(
        angles in proptest::array::uniform3(-3.0_f64..3.0),
        k in proptest::array::uniform5(1.0_f64..2000.0),
        scale in prop_oneof![-10.0_f64..-0.1, 0.1_f64..10.0],
    ) {
        let r = nalgebra::Rotation3::from_euler_angles(angles[0], angles[1], angles[2]).into_inner();
        let k = Matrix3::new(k[0], 0.1 * k[1], k[2], 0.0, k[3], k[4], 0.0, 0.0, 1.0);
        let t = Vector3::new(1.0, -2.0, 3.0);
        let mut p = nalgebra::Matrix3x4::zeros();
        p.fixed_columns_mut::<3>(0).copy_from(&r);
        p.set_column(3, &t);
        let (k2, r2, t2) = projections::decompose(&(k * p * scale)).unwrap();
        prop_assert!((k - k2).amax() < 1e-6 && (r - r2).amax() < 1e-6 && (t - t2).amax() < 1e-5, "{k2} {r2} {t2}");
    }
}
