use super::*;
use capture::Ray;
use nalgebra::Point3;

fn small() -> FootageOptions {
    FootageOptions { frames: 5, width: 64, height: 48, samples: 2, ..FootageOptions::default() }
}

/// Without what the sensor and the exposure add.
fn ideal() -> FootageOptions {
    FootageOptions { sensor_noise: None, exposure_drift_stops: 0.0, ..small() }
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_one_and_two_threads() {
    let film = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let options = FootageOptions { seed, motion_blur_deg: 1.0, ..small() };
        pool.install(|| set_up(Scene::Temple, &options).unwrap().frame(3))
    };
    let (one, two, other) = (film(1, 7), film(2, 7), film(2, 8));
    assert_eq!((&one.image, &one.matte), (&two.image, &two.matte));
    assert_ne!(one.image, other.image);
}

#[test]
fn cameras_follow_the_platter_around_its_axis() {
    let footage = set_up(Scene::Temple, &small()).unwrap();
    let first = footage.cameras()[0];
    for (camera, angle) in footage.cameras().iter().zip(footage.angles()) {
        // Where a point of the platter is seen after it has turned, the first camera sees the turned point.
        let p = Point3::new(0.05, 0.02, 0.06);
        let turned = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), *angle) * p;
        let (now, then) = (camera.project(&p).unwrap().pixel, first.project(&turned).unwrap().pixel);
        assert!((now - then).norm() < 1e-9, "{now} against {then}");
    }
    assert!(first.intrinsics.distortion.k1 != 0.0);
}

#[test]
fn the_matte_is_the_object_alone_and_whole() {
    // Rays through the true mesh without the set decide.
    let footage = set_up(Scene::Temple, &ideal()).unwrap();
    let object = Scene::Temple.build().world;
    for k in [0, 2] {
        let frame = footage.frame(k);
        for (y, x) in (0..48).flat_map(|y| (0..64).map(move |x| (y, x))) {
            let meets = |dx: f64, dy: f64| {
                let pixel = nalgebra::Point2::new(x as f64 + dx, y as f64 + dy);
                let Ray { origin, direction } = frame.camera.ray(pixel).unwrap();
                object.first_hit(origin.coords.cast(), direction.cast()).is_some()
            };
            let inner = [[0.1, 0.1], [0.9, 0.1], [0.1, 0.9], [0.9, 0.9], [0.5, 0.5]].map(|[dx, dy]| meets(dx, dy));
            let covered = f64::from(frame.matte.at(x, y)) / 255.0;
            let met = inner.iter().filter(|met| **met).count() as f64 / 5.0;
            assert!((covered - met).abs() < 0.5, "pixel {x}, {y} of frame {k}: {covered} against {met}");
        }
        let covered = frame.matte.pixels().iter().filter(|m| **m >= 128).count();
        assert!((200..1500).contains(&covered), "{covered} pixels");
    }
}

/// Mean of each channel over pixels that `keep` says.
fn mean(view: &View, keep: impl Fn(usize, usize, u8) -> bool) -> [f64; 3] {
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for (y, x) in (0..view.image.height()).flat_map(|y| (0..view.image.width()).map(move |x| (y, x))) {
        if keep(x, y, view.matte.at(x, y)) {
            let pixel = view.image.at(x, y);
            (0..3).for_each(|c| sum[c] += f64::from(pixel[c]));
            count += 1.0;
        }
    }
    sum.map(|s| s / f64::max(count, 1.0))
}

#[test]
fn the_cloth_fills_the_background_and_spills_on_the_object() {
    let frame = |backdrop: Backdrop| {
        let options = FootageOptions { backdrop, samples: 64, ..ideal() };
        set_up(Scene::Temple, &options).unwrap().frame(1)
    };
    let [green, blue, grey] = [Backdrop::Green, Backdrop::Blue, Backdrop::Grey].map(frame);
    let above = |view: &View| mean(view, |_, y, m| y < 8 && m == 0);
    let [r, g, b] = above(&green);
    assert!(g > 1.5 * r && g > 1.5 * b, "{r} {g} {b}");
    let [r, g, b] = above(&blue);
    assert!(b > 1.3 * g && b > 1.8 * r, "{r} {g} {b}");
    let share = |view: &View, c: usize| {
        let rgb = mean(view, |_, _, m| m == 255);
        rgb[c] / rgb.iter().sum::<f64>()
    };
    assert!(share(&green, 1) > share(&grey, 1) + 0.0015, "{} and {}", share(&green, 1), share(&grey, 1));
    assert!(share(&blue, 2) > share(&grey, 2) + 0.0015, "{} and {}", share(&blue, 2), share(&grey, 2));
}

#[test]
fn a_longer_shutter_smears_what_turns_but_not_the_cloth() {
    let frame = |motion_blur_deg: f64| {
        let options = FootageOptions { motion_blur_deg, samples: 16, ..ideal() };
        set_up(Scene::Temple, &options).unwrap().frame(1)
    };
    let (still, smeared) = (frame(0.0), frame(16.0));
    let partly = |view: &View| view.matte.pixels().iter().filter(|m| (1..255).contains(*m)).count();
    assert!(partly(&smeared) > partly(&still) * 5 / 4, "{} against {}", partly(&smeared), partly(&still));
    let far = |view: &View| mean(view, |_, y, _| y < 6);
    (0..3).for_each(|c| assert!((far(&still)[c] - far(&smeared)[c]).abs() < 1.5));
}

#[test]
fn the_folder_is_a_capture_with_the_truth_of_the_film() {
    let footage = set_up(Scene::Temple, &FootageOptions { frames: 2, samples: 1, ..small() }).unwrap();
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("film");
    let mut folder = TruthFolder::create(&footage, &dir).unwrap();
    (0..2).for_each(|k| folder.add(&footage.frame(k)).unwrap());
    folder.finish().unwrap();
    let capture = capture::Capture::read(&dir).unwrap();
    assert_eq!(capture.frames.len(), 2);
    let (read, true_camera) = (capture.frames[1].camera, footage.cameras()[1]);
    assert!((read.center() - true_camera.center()).norm() < 1e-12);
    assert_eq!(read.intrinsics, true_camera.intrinsics);
    let text = std::fs::read_to_string(dir.join("truth.json")).unwrap();
    let truth: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(truth["board"]["text"].as_str().unwrap().parse::<Board>().unwrap(), *footage.board());
    assert!((truth["frames"][1]["angle_deg"].as_f64().unwrap() - 378.0).abs() < 1e-9);
    assert!((truth["frames"][1]["time_s"].as_f64().unwrap() - 1.0 / 30.0).abs() < 1e-12);
    assert!(matches!(TruthFolder::create(&footage, &dir), Err(SynthError::Exists { .. })));
}

#[test]
fn options_out_of_range_are_refused_by_name() {
    for (bad, name) in [
        (FootageOptions { frames: 0, ..small() }, "frames"),
        (FootageOptions { width: 4, ..small() }, "width"),
        (FootageOptions { fps: f64::NAN, ..small() }, "fps"),
        (FootageOptions { unsteadiness: 0.9, ..small() }, "unsteadiness"),
        (FootageOptions { elevation_deg: 90.0, ..small() }, "elevation_deg"),
        (FootageOptions { motion_blur_deg: -1.0, ..small() }, "motion_blur_deg"),
        (FootageOptions { board: Some(Board::Chessboard { columns: 1, rows: 9, square: 0.03 }), ..small() }, "board"),
        (FootageOptions { distortion: Distortion { k1: -2.0, ..Distortion::default() }, ..small() }, "distortion"),
    ] {
        let error = set_up(Scene::Temple, &bad).unwrap_err().to_string();
        assert!(error.starts_with(name), "{error}");
    }
}
