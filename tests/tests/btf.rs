//! Coded materials as a stranger meets them: every codec through the command, figures of the contract, the
//! same bytes from every run, damaged files refused by name.

use capture::{Image, read_rgb, write_rgb};
use serde_json::Value;
use std::fs;
use std::path::Path;
use tests::turnlight;

/// All codecs, each with a size that a small tile can carry.
const CODECS: [(&str, &[&str]); 10] = [
    ("gaussian-mixture", &["--components", "12"]),
    ("multilevel-vq", &["--quality", "50"]),
    ("pca", &["--components", "3"]),
    ("pca-view", &["--components", "2"]),
    ("local-pca", &["--components", "2"]),
    ("ptm", &[]),
    ("lafortune", &[]),
    ("gmrf", &[]),
    ("car2d", &[]),
    ("car3d", &[]),
];
const SYNTHESIZERS: [&str; 3] = ["gmrf", "car2d", "car3d"];

/// A folder with a small material in it.
fn place() -> tempfile::TempDir {
    let place = tempfile::tempdir().expect("a folder");
    done(place.path(), &["btf", "synth", "analytic", "-o", "data", "--size", "8"]);
    place
}

fn done(place: &Path, args: &[&str]) -> Value {
    let run = turnlight(place, &[args, &["--json", "--quiet"]].concat());
    assert_eq!(run.code, Some(0), "{args:?}: {}", run.stderr);
    serde_json::from_str(&run.stdout).unwrap_or_else(|e| panic!("{e} in {}", run.stdout))
}

fn refused(place: &Path, args: &[&str], code: i32, words: &str) {
    let run = turnlight(place, &[args, &["--quiet"]].concat());
    assert_eq!(run.code, Some(code), "{args:?}: {}", run.stderr);
    assert!(run.stderr.contains(words), "{args:?} does not say '{words}': {}", run.stderr);
    let lines = run.stderr.trim_end().lines().count();
    assert!(code == 2 || (1..=2).contains(&lines), "{args:?}: {}", run.stderr);
}

#[test]
fn every_codec_fits_and_is_judged_by_the_contract() {
    let place = place();
    for (codec, size) in CODECS {
        let fit = [&["btf", "fit", "data", "-o", "m.btfz", "--codec", codec], size].concat();
        let fitted = done(place.path(), &fit);
        let found = done(place.path(), &["btf", "eval", "m.btfz", "data", "--sheet", "sheet.png"]);
        let bytes = fs::metadata(place.path().join("m.btfz")).expect("a file").len();
        assert_eq!(found["codec"], codec);
        assert_eq!((fitted["bytes"].as_u64(), found["bytes"].as_u64()), (Some(bytes), Some(bytes)), "{codec}");
        let parts: u64 =
            found["parts"].as_array().expect("parts").iter().map(|p| p["bytes"].as_u64().expect("bytes")).sum();
        assert_eq!(parts, bytes, "{codec}: parts do not add up");
        let figure = |key: &str| found[key].as_f64().unwrap_or_else(|| panic!("{codec} has no {key}"));
        let raw = 8.0 * 8.0 * 6561.0 * 3.0;
        assert!((figure("ratio") - raw / bytes as f64).abs() < 1e-6, "{codec}");
        assert!(figure("psnr_db") > 5.0 && figure("rmse") > 0.0 && figure("ssim") <= 1.0, "{codec}: {found}");
        if !SYNTHESIZERS.contains(&codec) {
            assert!(figure("psnr_db") > 14.0, "{codec}: {found}");
            assert!(figure("evals_per_s_core") > 1e3 && figure("evals_per_s_all") > 1e3, "{codec}");
        }
        assert_eq!(found["samples_per_s_core"].is_f64(), codec == "multilevel-vq");
        for key in ["fit_s", "fit_peak_bytes"] {
            assert!(figure(key) > 0.0 && found[key] == fitted[key], "{codec}: {key}");
        }
        assert!(figure("peak_bytes") > 0.0, "{codec}");
        assert!(place.path().join("sheet.png").is_file());
    }
}

#[test]
fn the_same_bytes_from_every_run_and_thread_count() {
    let place = place();
    for (codec, size) in CODECS {
        let mut files = Vec::new();
        for threads in ["1", "2"] {
            let fit = [&["btf", "fit", "data", "-o", "m.btfz", "--codec", codec, "--threads", threads], size].concat();
            done(place.path(), &fit);
            files.push(fs::read(place.path().join("m.btfz")).expect("a file"));
        }
        assert!(files[0] == files[1], "{codec} depends on the thread count");
    }
}

#[test]
fn what_a_fit_took_is_told_of_its_own_file_alone() {
    let place = place();
    let (path, took) = (place.path(), |found: &Value| [found["fit_s"].clone(), found["fit_peak_bytes"].clone()]);
    let fitted = done(path, &["btf", "fit", "data", "-o", "m.btfz", "--codec", "ptm"]);
    let eval = |name: &str| took(&done(path, &["btf", "eval", name, "data"]));
    assert!(fitted["fit_s"].is_f64() && eval("m.btfz") == took(&fitted));
    fs::copy(path.join("m.btfz"), path.join("alone.btfz")).expect("a copy");
    assert_eq!(eval("alone.btfz"), [Value::Null, Value::Null]);
    // Of another fit, and no record at all.
    done(path, &["btf", "fit", "data", "-o", "other.btfz", "--codec", "pca", "--components", "2"]);
    fs::rename(path.join("other.btfz.json"), path.join("m.btfz.json")).expect("renamed");
    assert_eq!(eval("m.btfz"), [Value::Null, Value::Null]);
    fs::write(path.join("m.btfz.json"), "{}").expect("written");
    assert_eq!(eval("m.btfz"), [Value::Null, Value::Null]);
}

#[test]
fn damaged_materials_and_wrong_data_are_named() {
    let place = place();
    done(place.path(), &["btf", "fit", "data", "-o", "m.btfz", "--codec", "ptm"]);
    done(place.path(), &["btf", "synth", "analytic", "-o", "larger", "--size", "9"]);
    refused(place.path(), &["btf", "eval", "m.btfz", "larger"], 2, "8 × 8 texels");
    let good = fs::read(place.path().join("m.btfz")).expect("a file");
    let mut flipped = good.clone();
    flipped[good.len() / 2] ^= 4;
    for (name, bytes, words) in [
        ("cut.btfz", &good[..good.len() - 9], "cut.btfz"),
        ("flipped.btfz", &flipped[..], "checksum"),
        ("text.btfz", &b"not a material"[..], "no .btfz file"),
        ("empty.btfz", &[][..], "no .btfz file"),
    ] {
        fs::write(place.path().join(name), bytes).expect("written");
        refused(place.path(), &["btf", "eval", name, "data"], 1, words);
    }
    refused(place.path(), &["btf", "fit", "nowhere", "-o", "x.btfz", "--codec", "pca"], 1, "nowhere");
    refused(place.path(), &["btf", "fit", "data", "-o", "x.btfz", "--codec", "magic"], 2, "magic");
    assert!(!place.path().join("x.btfz").exists());
}

#[test]
fn codecs_are_compared_on_one_page() {
    let place = place();
    let codecs = "pca,local-pca,ptm,gmrf";
    let args = ["btf", "compare", "data", "-o", "report", "--codecs", codecs, "--ratios", "20,60"];
    let found = done(place.path(), &args);
    let runs = found["runs"].as_array().expect("runs");
    let names: Vec<&str> = runs.iter().filter_map(|run| run["name"].as_str()).collect();
    assert_eq!(names, ["pca", "pca", "local-pca", "local-pca", "ptm", "gmrf"]);
    assert!(runs.iter().all(|run| run["fault"].is_null() && run["rmse"].is_f64()), "{found}");
    // The file is never larger than asked.
    for run in &runs[..4] {
        assert!(run["ratio"].as_f64() >= run["ratio_asked"].as_f64(), "{run}");
    }
    // Of the two with several sizes, each is as far above the other as that below it.
    let deltas = found["deltas"].as_array().expect("deltas");
    let pairs: Vec<[&Value; 2]> = deltas.iter().map(|delta| [&delta["codec"], &delta["against"]]).collect();
    assert_eq!(pairs, [["pca", "local-pca"], ["local-pca", "pca"]]);
    for key in ["rmse", "psnr_db"] {
        let [there, back] = [0, 1].map(|k: usize| deltas[k][key].as_f64().expect("a figure"));
        assert!(there != 0.0 && (there + back).abs() < 1e-9, "{key}: {there} {back}");
    }
    let page = fs::read_to_string(place.path().join("report/report.html")).expect("a page");
    assert!(page.contains("<svg") && page.matches("data:image/png").count() == 6);
}

/// Two materials in one file answer as they do alone, about as large as apart, for these have little in common.
#[test]
fn materials_share_books_and_are_told_apart() {
    let place = tempfile::tempdir().expect("a folder");
    let path = place.path();
    for (material, size) in [("analytic", "4"), ("corduroy", "2")] {
        done(path, &["btf", "synth", material, "-o", material, "--size", size, "--samples", "4"]);
    }
    let fit = |data: &[&str], to: &str| {
        let options = ["-o", to, "--codec", "multilevel-vq", "--quality", "0", "--mip-maps"];
        done(path, &[&["btf", "fit"], data, &options].concat())
    };
    let eval = |file: &str, data: &str, member: &str| done(path, &["btf", "eval", file, data, "--member", member]);
    let shared = fit(&["analytic", "corduroy"], "both.btfz");
    assert_eq!(shared["members"], serde_json::json!(["analytic", "corduroy"]));
    let mut apart = 0;
    for (member, data, smaller) in [("0", "analytic", &[2, 1][..]), ("1", "corduroy", &[1])] {
        apart += fit(&[data], "alone.btfz")["bytes"].as_u64().expect("bytes");
        let [alone, found] = [eval("alone.btfz", data, "0"), eval("both.btfz", data, member)];
        let [alone_rmse, rmse] = [&alone, &found].map(|found| found["rmse"].as_f64().expect("a figure"));
        assert!(rmse < 1.15 * alone_rmse, "{data}: {rmse} {alone_rmse}");
        // All but the name is the same.
        let [bytes, all] = [&found, &shared].map(|told| told["bytes"].as_u64().expect("bytes"));
        assert_eq!(bytes, all + data.len() as u64 - "analytic".len() as u64, "{data}");
        let levels = found["levels"].as_array().expect("levels");
        let sizes: Vec<Value> = levels.iter().map(|level| level["size"].clone()).collect();
        assert_eq!(sizes, smaller.iter().map(|side| serde_json::json!([side, side])).collect::<Vec<_>>());
        // Of so few texels the books have little for averages.
        assert!(levels.iter().all(|level| level["rmse"].as_f64() < Some(50.0)), "{data}: {levels:?}");
    }
    let bytes = shared["bytes"].as_u64().expect("bytes");
    assert!(2 * bytes < 3 * apart && 2 * bytes > apart, "{bytes} {apart}");
    refused(path, &["btf", "eval", "both.btfz", "analytic", "--member", "1"], 2, "fitted to 2 × 2 texels");
    refused(path, &["btf", "eval", "both.btfz", "analytic", "--member", "2"], 2, "analytic, corduroy");
    done(path, &["btf", "render", "both.btfz", "-o", "b.png", "--member", "1", "--shape", "tile", "--size", "16x16"]);
    refused(path, &["btf", "fit", "analytic", "corduroy", "-o", "x.btfz", "--codec", "pca"], 2, "cannot share");
}

#[test]
fn books_are_measured_and_coloured_as_asked() {
    let place = place();
    let path = place.path();
    done(path, &["btf", "synth", "foil", "-o", "bright", "--size", "3", "--samples", "4", "--hdr"]);
    let fit = |data: &str, options: &[&str]| {
        let usual = ["btf", "fit", data, "-o", "m.btfz", "--codec", "multilevel-vq", "--quality", "30"];
        done(path, &[&usual, options].concat());
        let found = done(path, &["btf", "eval", "m.btfz", data]);
        ["ssim", "rmse_stops"].map(|key| found[key].as_f64().unwrap_or(f64::NAN))
    };
    assert!(fit("data", &["--measure", "ssim"])[0] > 0.8);
    let [[_, luv], [_, usual]] = [fit("bright", &["--color", "logluv"]), fit("bright", &[])];
    assert!(luv < 2.0 * usual && luv != usual, "{luv} {usual}");
    let asked = ["btf", "fit", "data", "-o", "x.btfz", "--codec", "multilevel-vq", "--color", "logluv"];
    refused(path, &asked, 1, "LogLuv is for a high range");
    for option in [&["--mip-maps"][..], &["--measure", "ssim"], &["--color", "logluv"]] {
        refused(path, &[&["btf", "fit", "data", "-o", "x.btfz", "--codec", "ptm"], option].concat(), 2, "ptm has none");
    }
    assert!(!path.join("x.btfz").exists());
}

/// The picture of a material under further options, 64 × 64 pixels before magenta.
fn drawn(place: &Path, options: &[&str]) -> (Value, Image<[u8; 3]>) {
    let usual = ["btf", "render", "m.btfz", "-o", "drawn.png", "--size", "64x64", "--background", "255,0,255"];
    let told = done(place, &[&usual, options].concat());
    (told, read_rgb(&place.join("drawn.png")).expect("a picture"))
}

const MAGENTA: [u8; 3] = [255, 0, 255];
/// Two triangles over [0, 2] × [0, 1].
const SHEET: &str =
    "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";

#[test]
fn meshes_carry_a_material() {
    let place = place();
    let path = place.path();
    done(path, &["btf", "fit", "data", "-o", "m.btfz", "--codec", "ptm"]);
    fs::write(path.join("sheet.obj"), SHEET).expect("written");
    let above = ["--shape", "sheet.obj", "--view", "0,0", "--light", "0,0.5,1"];
    let (told, picture) = drawn(path, &[&above[..], &["--tiles", "4"]].concat());
    assert_eq!(told["tile_size"], 0.5, "tiles along the longest side");
    assert!(picture.at(32, 32) != MAGENTA && picture.at(1, 1) == MAGENTA);
    let is_covered = |x: usize, y: usize| picture.at(x, y) != MAGENTA;
    // Twice as wide as high.
    let [wide, high] = [(0..64).filter(|&x| is_covered(x, 32)).count(), (0..64).filter(|&y| is_covered(32, y)).count()];
    assert!(wide.abs_diff(2 * high) <= 2, "{wide} {high}");
    let (_, other) = drawn(path, &[&above[..], &["--tiles", "1"]].concat());
    assert!(other.pixels() != picture.pixels(), "tiles are larger");
    let bare = SHEET.lines().filter(|line| !line.starts_with("vt")).map(|line| line.split('/').next().unwrap_or(line));
    let bare: String =
        bare.map(|line| if line.starts_with('f') { "f 1 2 3\n".into() } else { format!("{line}\n") }).collect();
    fs::write(path.join("bare.obj"), bare).expect("written");
    refused(path, &["btf", "render", "m.btfz", "-o", "x.png", "--shape", "bare.obj"], 1, "bare.obj");
}

#[test]
fn panoramas_shine_on_a_material() {
    let place = place();
    let path = place.path();
    done(path, &["btf", "fit", "data", "-o", "m.btfz", "--codec", "ptm"]);
    let paint = |[sky, ground]: [u8; 2]| {
        let level = |p: usize| if p < 32 * 8 { sky } else { ground };
        let pixels = (0..32 * 16).map(|p| [level(p); 3]).collect();
        write_rgb(&path.join("around.png"), &Image::from_pixels(32, 16, pixels).expect("as many")).expect("written");
    };
    let mean = |levels: [u8; 2]| {
        paint(levels);
        let (_, picture) = drawn(path, &["--shape", "tile", "--environment", "around.png"]);
        picture.pixels().iter().map(|p| f64::from(p[1])).sum::<f64>() / (64.0 * 64.0)
    };
    let [below, dim, bright] = [[0, 120], [60, 0], [120, 0]].map(mean);
    assert!(below < 2.0, "what lies below lights nothing: {below}");
    assert!(dim > 10.0 && bright > 1.5 * dim, "{dim} {bright}");
    let all_around = mean([120, 120]);
    assert!((all_around / bright - 1.0).abs() < 0.15, "{all_around} {bright}");
    paint([0, 0]);
    let dark = ["btf", "render", "m.btfz", "-o", "x.png", "--environment", "around.png"];
    refused(path, &dark, 1, "around.png: it is black");
}

/// A tile of random fields begins again where it ends, and is another for another seed.
#[test]
fn random_fields_are_tiled() {
    let place = place();
    let path = place.path();
    for codec in SYNTHESIZERS {
        done(path, &["btf", "fit", "data", "-o", "m.btfz", "--codec", codec]);
        let tile = |tiles: &str, seed: &str| drawn(path, &["--shape", "tile", "--tiles", tiles, "--seed", seed]).1;
        let (twice, whole) = (tile("2", "1"), tile("1", "1"));
        for (y, x) in (0..32).flat_map(|y| (0..32).map(move |x| (y, x))) {
            let repeated = [(x + 32, y), (x, y + 32), (x + 32, y + 32)].map(|(x, y)| twice.at(x, y));
            assert!(repeated.iter().all(|pixel| *pixel == twice.at(x, y)), "{codec} at {x}, {y}");
        }
        assert!(whole.pixels() != twice.pixels(), "{codec}");
        assert!(tile("2", "2").pixels() != twice.pixels() && tile("2", "1").pixels() == twice.pixels(), "{codec}");
    }
}

#[test]
fn stacks_of_lights_that_were_measured_are_coded() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/rti_loewenkopf240/data");
    if !data.is_dir() {
        eprintln!("skipped: {} is not there", data.display());
        return;
    }
    let place = tempfile::tempdir().expect("a folder");
    let data = data.to_str().expect("UTF-8");
    let fitted = done(place.path(), &["btf", "fit", data, "-o", "m.btfz", "--codec", "ptm", "--precision", "full"]);
    assert!(fitted["ratio"].as_f64() > Some(3.0));
    // Six terms per channel by another program: 27.05 dB.
    let found = done(place.path(), &["btf", "eval", "m.btfz", data]);
    assert!((found["psnr_db"].as_f64().expect("a figure") - 27.05).abs() < 0.5, "{found}");
}
