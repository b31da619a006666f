//! The whole way on a small synthetic capture, whose truth is known.

use capture::{Capture, LoadOptions, View};
use data_synth::{Effort, Scene, SynthOptions, synthesize};
use nalgebra::Point3;
use std::collections::BTreeSet;
use std::path::Path;
use texture::{FitOptions, Method, Model};
use turnlight::evaluate::{self, CompareOptions, Comparison};
use turnlight::output::OutputFolder;
use turnlight::pipeline::{self, ShapeOptions};
use turnlight::stages::{Silent, Stages};
use turnlight::{inspect, playback};

fn views(count: usize) -> (Vec<View>, f64) {
    let options = SynthOptions {
        views: count,
        width: 160,
        height: 120,
        effort: Effort::Samples(4),
        surfaces: 1,
        ..SynthOptions::default()
    };
    let filmed = synthesize(Scene::Temple, &options).expect("a scene");
    let volume = filmed.mesh.signed_volume();
    (filmed.views, volume)
}

#[test]
fn the_hull_holds_the_object_and_fits_its_silhouettes() {
    let (views, true_volume) = views(16);
    let mesh = pipeline::hull(&views, None, &ShapeOptions::default(), &mut Stages::new(&Silent)).expect("a hull");
    let facts = inspect::mesh_facts(&mesh).expect("a mesh");
    assert!(facts.closed_manifold, "{facts:?}");
    assert!(facts.volume > 0.9 * true_volume, "{} of {true_volume}", facts.volume);
    let ious = inspect::silhouette_ious(&mesh, &views);
    let mean = ious.iter().sum::<f64>() / ious.len() as f64;
    assert!(mean > 0.97, "{mean}");
}

#[test]
fn every_model_survives_its_file_and_renders_what_was_seen() {
    let (views, _) = views(12);
    for method in Method::ALL {
        let mut stages = Stages::new(&Silent);
        let (shape, fit) = (ShapeOptions::default(), FitOptions::default());
        let (model, report) = pipeline::model(&views, None, method, &shape, &fit, &mut stages).expect("a model");
        assert!(report.unseen_texels < report.texels);
        let bytes = model.to_glb().expect("a file");
        let stored = Model::from_glb(&bytes, Path::new("memory")).expect("the same model");
        // Directions are rounded once more, so bytes may differ; what is seen must not.
        let again = Model::from_glb(&stored.to_glb().expect("a file"), Path::new("memory")).expect("the same model");
        let apart = largest_difference(&stored, &again, &views[4].camera.center());
        assert!(apart < 0.05, "{}: {apart} levels after a second trip through the file", method.name());
        let eye = views[3].camera.center();
        let frame = playback::player(&stored).render(&stored.atlas(&eye), &views[3].camera);
        let score = texture::metrics::score(&frame, &views[3].image, &views[3].matte).expect("an object");
        assert!(score.error_mean_pct < 15.0 && score.mask_iou > 0.9, "{}: {score:?}", method.name());
    }
}

/// Largest difference of two atlases seen from one eye, in levels.
fn largest_difference(a: &Model, b: &Model, eye: &Point3<f64>) -> f32 {
    let (a, b) = (a.atlas(eye), b.atlas(eye));
    let pairs = a.pixels().as_flattened().iter().zip(b.pixels().as_flattened());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// A comparison on `capture` with its first `train` views against those of `test`.
fn compare(
    capture: &Capture,
    train: Vec<usize>,
    test: Vec<usize>,
    report: Option<&OutputFolder>,
) -> Result<Comparison, turnlight::Error> {
    let options = CompareOptions {
        train,
        test,
        methods: vec![Method::Static, Method::DynTex],
        load: LoadOptions::default(),
        shape: ShapeOptions::default(),
        fit: FitOptions::default(),
        truth: None,
    };
    evaluate::compare(capture, "small", &options, report, &mut Stages::new(&Silent))
}

#[test]
fn a_comparison_leaves_out_leaks_and_says_so() {
    let place = tempfile::tempdir().expect("a folder");
    let capture = Capture::read(&tests::small_capture(place.path(), 12)).expect("a capture");
    let comparison = compare(&capture, vec![0, 2, 4, 6, 8, 10], vec![1, 2, 3], None).expect("a comparison");
    assert_eq!((comparison.test.as_slice(), comparison.left_out.as_slice()), (&[1, 3][..], &[2][..]));
    let methods: Vec<&str> = comparison.methods.iter().map(|m| m.method).collect();
    assert_eq!(methods, ["static", "dyntex"]);
    for method in &comparison.methods {
        assert_eq!(method.views.len(), 2);
        assert!(method.error_mean_pct <= method.error_max_pct && method.bytes > 0 && method.bytes_raw > 0);
        assert!(method.seam.is_some() && method.temporal.is_some());
    }
    let static_texture = &comparison.methods[0];
    assert_eq!(static_texture.temporal, Some(0.0), "one texture for all views does not jump");
    assert!(compare(&capture, vec![0, 1, 2], vec![1, 2], None).is_err(), "nothing left to score");
}

#[test]
fn test_views_cannot_reach_the_model() {
    let place = tempfile::tempdir().expect("a folder");
    let path = tests::small_capture(place.path(), 12);
    let errors = |capture: &Capture| {
        let report = OutputFolder::create(&place.path().join("unused")).expect("a folder");
        compare(capture, vec![0, 2, 4, 6, 8, 10], vec![3], Some(&report)).expect("a comparison");
        std::fs::read(report.path().join(evaluate::view_path("dyntex", 3))).expect("a render")
    };
    let before = errors(&Capture::read(&path).expect("a capture"));
    // Ruin every odd photograph and mask but keep view 3's camera: its render must not change.
    let capture = Capture::read(&path).expect("a capture");
    for frame in capture.frames.iter().skip(1).step_by(2) {
        capture::write_rgb(&frame.image_path, &capture::Image::filled(96, 72, [255, 0, 255])).expect("written");
        let mask = frame.mask_path.as_ref().expect("masks");
        let mut matte = capture::Image::filled(96, 72, 0);
        matte.set(48, 36, 255);
        capture::write_matte(mask, &matte).expect("written");
    }
    assert!(errors(&capture) == before);
}

#[test]
fn a_report_needs_no_other_file_and_holds_its_pictures() {
    let place = tempfile::tempdir().expect("a folder");
    let capture = Capture::read(&tests::small_capture(place.path(), 8)).expect("a capture");
    let report = OutputFolder::create(&place.path().join("report")).expect("a folder");
    let comparison = compare(&capture, vec![0, 2, 4, 6], vec![1, 3, 5, 7], Some(&report)).expect("a comparison");
    let page = evaluate::html(&comparison, &report).expect("a page");
    assert!(page.contains("<svg") && page.contains("data:image/png;base64,"));
    assert!(!page.contains("src=\"http") && !page.contains("href="), "nothing is fetched");
    let csv = evaluate::csv(&comparison);
    let widths: BTreeSet<usize> = csv.lines().map(|line| line.split(',').count()).collect();
    assert_eq!((csv.lines().count(), widths.len()), (3, 1), "{csv}");
}
