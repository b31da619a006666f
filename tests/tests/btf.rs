//! Coded materials as a stranger meets them: every codec through the command, figures of the contract, the
//! same bytes from every run, damaged files refused by name.

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
