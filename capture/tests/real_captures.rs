//! Reads the research captures of `../shared/data` (see its README); skips, saying so, without them.

#![allow(clippy::unwrap_used, reason = "tests fail by panicking, helpers included")]

use capture::{Capture, CaptureFormat, LoadOptions, MaskSource, detect_format};
use std::path::{Path, PathBuf};

fn data(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data").join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: {} is absent", path.display());
    None
}

#[test]
fn every_set_is_read_and_loaded() {
    use CaptureFormat as F;
    use MaskSource as M;
    for (name, format, masks, frames) in [
        ("templeRing", F::Middlebury, M::MasksImage, 47),
        ("dinoRing", F::Middlebury, M::MasksImage, 48),
        ("temple_full", F::Middlebury, M::MasksImage, 312),
        ("oxford_dinosaur", F::ProjectionList, M::MasksImage, 36),
        ("squirrel_turntable", F::ProjectionList, M::MasksImage, 36),
        ("ethz_david", F::ProjectionFiles, M::MasksImage, 18),
        ("nerf_lego", F::Transforms, M::Alpha, 50),
        ("analytic_torus", F::Transforms, M::MaskPath, 36),
    ] {
        let Some(path) = data(name) else { continue };
        assert_eq!(detect_format(&path).unwrap().0, format, "{name}");
        let capture = Capture::read(&path).unwrap();
        assert_eq!((capture.frames.len(), capture.mask_source), (frames, masks), "{name}");
        let views = capture.load_views(&[0, 3], &LoadOptions { downscale: 2 }).unwrap();
        assert_eq!(views[1].index, 3);
        assert_eq!(views[1].image.width(), views[1].camera.intrinsics.width, "{name}");
    }
}

#[test]
fn matlab_cells_hold_the_matrices_of_the_text_file() {
    let Some(folder) = data("oxford_dinosaur") else { return };
    let text = Capture::read(&folder).unwrap();
    let cells = Capture::read(&folder.join("dino_Ps.mat")).unwrap();
    for (a, b) in text.frames.iter().zip(&cells.frames) {
        assert_eq!(a.image_path, b.image_path);
        let (p, q) = (a.camera.projection_matrix(), b.camera.projection_matrix());
        assert!((p - q).amax() < 1e-9 * p.amax(), "{}", a.image_path.display());
    }
}

/// Far from any lens: the principal point lies outside the image. With a positive diagonal the skew is
/// −79 (SOURCE.txt of the set gives its size); that the matrix comes back says the sign is right.
#[test]
fn oxford_matrices_decompose_and_come_back() {
    let Some(folder) = data("oxford_dinosaur") else { return };
    let capture = Capture::read(&folder).unwrap();
    let i = capture.frames[0].camera.intrinsics;
    assert_eq!([i.fx, i.fy, i.skew, i.cx - 0.5].map(f64::round), [3217.0, 2292.0, -79.0, 290.0]);

    let text = std::fs::read_to_string(folder.join("projections.txt")).unwrap();
    let line = text.lines().nth(1).unwrap();
    let n: Vec<f64> = line.split_whitespace().skip(1).map(|w| w.parse().unwrap()).collect();
    let p = capture.frames[0].camera.projection_matrix();
    // Undo the half pixel and the third axis (the matrices are for a left-handed world), then compare up to
    // scale.
    let p = |row: usize, column: usize| {
        let value = p[(row, column)] - if row < 2 { 0.5 * p[(2, column)] } else { 0.0 };
        if column == 2 { -value } else { value }
    };
    let scale = n[11] / p(2, 3);
    for (k, expected) in n.iter().enumerate() {
        assert!((scale * p(k / 4, k % 4) - expected).abs() < 1e-9, "entry {k}");
    }
}

/// Mean and smallest intersection over union of the silhouettes found with the scoring masks.
fn silhouette_iou(name: &str) -> Option<(f64, f64)> {
    let capture = Capture::read(&data(name)?).unwrap();
    let options = LoadOptions { downscale: 1 };
    let start = std::time::Instant::now();
    let found = capture.clone().without_masks().load_all_views(&options).unwrap();
    let elapsed = start.elapsed().as_secs_f64();
    let given = capture.load_all_views(&options).unwrap();
    let scores: Vec<f64> = found.iter().zip(&given).map(|(f, g)| iou(f, g)).collect();
    let mean = scores.iter().sum::<f64>() / scores.len() as f64;
    let (worst, least) = scores.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1)).unwrap();
    println!("{name}: IoU mean {mean:.4}, least {least:.4} ({}), {elapsed:.1} s", found[worst].name);
    if let Ok(folder) = std::env::var("SHOW_SILHOUETTES") {
        let differences: Vec<[u8; 3]> =
            found[worst].matte.pixels().iter().zip(given[worst].matte.pixels()).map(|(&f, &g)| [f, g, g]).collect();
        let m = &found[worst].matte;
        let picture = capture::Image::from_pixels(m.width(), m.height(), differences).unwrap();
        capture::write_rgb(&Path::new(&folder).join(format!("{name}.png")), &picture).unwrap();
    }
    Some((mean, *least))
}

fn iou(a: &capture::View, b: &capture::View) -> f64 {
    let pairs = || a.matte.pixels().iter().zip(b.matte.pixels()).map(|(&a, &b)| (a >= 128, b >= 128));
    pairs().filter(|&(a, b)| a && b).count() as f64 / pairs().filter(|&(a, b)| a || b).count() as f64
}

#[test]
fn silhouettes_agree_with_the_scoring_masks() {
    for name in ["oxford_dinosaur", "templeRing", "dinoRing", "squirrel_turntable", "ethz_david"] {
        let Some((mean, _)) = silhouette_iou(name) else { continue };
        // The scoring masks of the dinosaur lie a pixel right and below of its photographs: a plain threshold
        // of view 17 agrees with them to 0.957 in place, to 0.995 moved by (1, 1).
        let least = if name == "oxford_dinosaur" { 0.96 } else { 0.97 };
        assert!(mean >= least, "{name}: {mean}");
    }
}

#[test]
fn real_captures_pass_the_check() {
    for name in
        ["analytic_torus", "templeRing", "dinoRing", "oxford_dinosaur", "squirrel_turntable", "ethz_david", "nerf_lego"]
    {
        let Some(path) = data(name) else { continue };
        let capture = Capture::read(&path).unwrap();
        let views = capture.load_all_views(&LoadOptions { downscale: 1 }).unwrap();
        let check = capture::doctor::check(&capture, &views);
        let [left, right] = check.consistency_half_pixel;
        println!(
            "{name}: IoU {:.3}, rays {:.3} ({left:.3} {right:.3}), {:?}, {:?}",
            check.silhouette_iou, check.silhouette_consistency, check.layout, check.findings
        );
        assert_eq!(check.center_in_frame, capture.frames.len(), "{name}");
    }
}
