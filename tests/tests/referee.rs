//! Our figures against an independent scorer that shares no code with us: the Python script beside the
//! project. Skips, saying so, where the script or its modules are absent.

use capture::Image;
use std::path::Path;
use std::process::Command;
use texture::metrics;

/// Per-view figures: our name, the scorer's.
const FIGURES: [(&str, &str); 9] = [
    ("error_mean_pct", "mae_pct"),
    ("error_union_pct", "mae_union_pct"),
    ("error_inner_pct", "mae_inner_pct"),
    ("psnr_db", "psnr_mask"),
    ("psnr_full_db", "psnr_full"),
    ("ssim", "ssim_mask"),
    ("mask_iou", "iou"),
    ("hole_pct", "hole_pct"),
    ("spill_pct", "spill_pct"),
];

/// What the scorer prints for three folders; `None` where it cannot run.
fn judged(render: &Path, reference: &Path, mask: &Path) -> Option<serde_json::Value> {
    let Some((python, script)) = tests::referee() else {
        eprintln!("skipped: no referee.py beside the project, or no Python with numpy, Pillow and scikit-image");
        return None;
    };
    let mut command = Command::new(python);
    command.arg(script).arg("--render").arg(render).arg("--ref").arg(reference).arg("--mask").arg(mask);
    let output = command.output().expect("python runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(serde_json::from_slice(&output.stdout).expect("JSON"))
}

/// A seeded picture whose values are neither smooth nor uniform.
fn noisy(width: usize, height: usize, seed: u32) -> Image<[u8; 4]> {
    let mut state = seed;
    let mut next = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    let pixels = (0..width * height).map(|p| {
        let wave = ((p % width) as f64 / 7.0).sin() * 60.0 + 128.0;
        [wave as u8 ^ next() >> 3, next(), (p / width) as u8, next()]
    });
    Image::from_pixels(width, height, pixels.collect()).expect("as many pixels as asked for")
}

#[test]
fn metrics_agree_to_six_decimals() {
    let place = tempfile::tempdir().expect("a folder");
    let folder = |name: &str| place.path().join(name);
    ["r", "g", "m"].iter().for_each(|name| std::fs::create_dir(folder(name)).expect("a folder"));
    let mut ours = Vec::new();
    // The object in the middle, at the border, and a wide frame; partial alpha everywhere.
    for (view, (width, height, mask_side)) in
        [(64, 48, 0..40), (31, 57, 3..31), (120, 20, 2..110)].into_iter().enumerate()
    {
        let render = noisy(width, height, 1 + view as u32);
        let photograph = noisy(width, height, 100 + view as u32).map(|[r, g, b, _]| [r, g, b]);
        let is_object = |p: usize| mask_side.contains(&(p % width)) && p / width > 2;
        let mask = (0..width * height).map(|p| if is_object(p) { 128 } else { 127 }).collect();
        let mask = Image::from_pixels(width, height, mask).expect("as many pixels as asked for");
        render::film::write_png(&folder("r").join(format!("{view}.png")), &render).expect("written");
        capture::write_rgb(&folder("g").join(format!("{view}.png")), &photograph).expect("written");
        capture::write_matte(&folder("m").join(format!("{view}.png")), &mask).expect("written");
        ours.push(metrics::score(&render, &photograph, &mask).expect("an object"));
    }
    let Some(judged) = judged(&folder("r"), &folder("g"), &folder("m")) else { return };
    for (view, s) in ours.iter().enumerate() {
        let theirs = |name: &str| judged["views"][view][name].as_f64().expect(name);
        let values = [
            s.error_mean_pct,
            s.error_union_pct,
            s.error_inner_pct.expect("enough pixels"),
            s.psnr_db,
            s.psnr_full_db,
            s.ssim,
            s.mask_iou,
            s.hole_pct,
            s.spill_pct,
        ];
        for (value, (name, their_name)) in values.iter().zip(FIGURES) {
            let their_value = theirs(their_name);
            assert!((value - their_value).abs() <= 5.1e-7, "view {view}: {name} {value}, referee {their_value}");
        }
    }
}

#[test]
fn a_comparison_agrees_to_the_digits_it_prints() {
    let place = tempfile::tempdir().expect("a folder");
    tests::small_capture(place.path(), 12);
    let run = tests::turnlight(place.path(), &["compare", "capture", "-o", "report", "--json", "--quiet"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let comparison: serde_json::Value = serde_json::from_str(&run.stdout).expect("JSON");
    let views = place.path().join("report/views");
    for method in comparison["methods"].as_array().expect("methods") {
        let name = method["method"].as_str().expect("a name");
        let Some(judged) = judged(&views.join(name), &views.join("reference"), &views.join("mask")) else { return };
        let aggregate = &judged["aggregate"];
        let mut pairs: Vec<(&str, f64)> =
            FIGURES.iter().map(|(ours, theirs)| (*ours, aggregate[theirs]["mean"].as_f64().expect(theirs))).collect();
        pairs.push(("error_max_pct", aggregate["mae_pct"]["max"].as_f64().expect("max")));
        pairs.push(("error_variance", aggregate["mae_pct"]["var"].as_f64().expect("var")));
        for (ours, theirs) in pairs {
            let value = method[ours].as_f64().expect(ours);
            assert!((value - theirs).abs() <= 1.1e-6, "{name}: {ours} {value}, referee {theirs}");
        }
    }
}
