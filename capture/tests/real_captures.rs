//! Reads the research captures of `../shared/data` (see its README); skips, saying so, without them.

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
    // Undo the half pixel, then compare up to scale.
    let p = |row: usize, column: usize| p[(row, column)] - if row < 2 { 0.5 * p[(2, column)] } else { 0.0 };
    let scale = n[11] / p(2, 3);
    for (k, expected) in n.iter().enumerate() {
        assert!((scale * p(k / 4, k % 4) - expected).abs() < 1e-9, "entry {k}");
    }
}
