//! The command as a stranger meets it: exit codes, messages, purity of standard output, output that
//! appears whole or not at all, the same bytes from every run.

use capture::Capture;
use serde_json::Value;
use std::fs;
use std::path::Path;
use tests::{Run, small_capture, turnlight};

const VIEWS: usize = 8;

/// A folder with a small capture in it.
fn place() -> tempfile::TempDir {
    let place = tempfile::tempdir().expect("a folder");
    small_capture(place.path(), VIEWS);
    place
}

/// The work failed: code 1, one or two lines that say all of `words`, nothing on standard output, and
/// nothing left behind but what was there.
fn assert_fails(place: &Path, args: &[&str], words: &[&str]) {
    let before = listing(place);
    let run = turnlight(place, &[args, &["--quiet"]].concat());
    assert_eq!(run.code, Some(1), "{args:?}: {}", run.stderr);
    assert!(run.stdout.is_empty(), "{args:?} printed {}", run.stdout);
    assert!((1..=2).contains(&run.stderr.trim_end().lines().count()), "{args:?}: {}", run.stderr);
    for word in words {
        assert!(run.stderr.contains(word), "{args:?} does not say '{word}': {}", run.stderr);
    }
    assert_eq!(listing(place), before, "{args:?} left something behind");
}

fn listing(place: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(place)
        .expect("a folder")
        .map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort_unstable();
    names
}

fn edit(place: &Path, change: impl FnOnce(&mut Value)) {
    let path = place.join("capture/transforms.json");
    let mut file: Value = serde_json::from_str(&fs::read_to_string(&path).expect("a file")).expect("JSON");
    change(&mut file);
    fs::write(path, file.to_string()).expect("written");
}

/// The file below `capture/` that `key` of a frame names.
fn frame_file(place: &Path, key: &str, frame: usize) -> std::path::PathBuf {
    let text = fs::read_to_string(place.join("capture/transforms.json")).expect("a file");
    let file: Value = serde_json::from_str(&text).expect("JSON");
    place.join("capture").join(file["frames"][frame][key].as_str().expect("a path"))
}

fn json(run: &Run) -> Value {
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    serde_json::from_str(&run.stdout).unwrap_or_else(|e| panic!("{e} in {}", run.stdout))
}

#[test]
fn wrong_arguments_return_2() {
    let place = place();
    for args in [
        &["nonsense"][..],
        &["model"],
        &["model", "capture"],
        &["model", "capture", "-o", "x.glb", "--views", "even,odd"],
        &["model", "capture", "-o", "x.glb", "--views", "99"],
        &["model", "capture", "-o", "x.obj"],
        &["model", "capture", "-o", "x.glb", "--threads", "0"],
        &["model", "capture", "-o", "x.glb", "--method", "magic"],
        &["model", "capture", "-o", "x.glb", "--mesh", "m.ply", "--resolution", "64"],
        &["hull", "capture", "-o", "x.stl"],
        &["hull", "capture", "-o", "x.ply", "--grow", "nan"],
        &["hull", "capture", "-o", "x.ply", "--downscale", "0"],
        &["compare", "capture", "--train", "0,1", "--test", "0,1"],
        &["render", "x.glb"],
        &["synth", "temple", "-o", "s", "--size", "10"],
        &["synth", "unheard-of", "-o", "s"],
        &["info", "capture", "--quiet", "-v"],
        &["turntable", "capture/images", "-o", "t", "--camera", "capture"],
        &["turntable", "capture/images", "-o", "t", "--camera", "capture", "--step", "0"],
        &["turntable", "capture/images", "-o", "t", "--camera", "capture", "--step", "5", "--angles", "a.txt"],
        &["turntable", "capture/images", "-o", "t", "--camera", "capture", "--step", "5", "--axis", "0,0,0"],
        &["turntable", "capture/images", "-o", "t", "--camera", "capture", "--step", "5", "--view", "99"],
        &["info", "capture", "--truth", "capture/truth.ply"],
        &["info", "capture/truth.ply", "--tolerance", "1"],
        &["info", "capture/truth.ply", "--truth", "capture/truth.ply", "--tolerance", "-1"],
    ] {
        let run = turnlight(place.path(), args);
        assert_eq!(run.code, Some(2), "{args:?}: {}", run.stderr);
        assert!(run.stdout.is_empty() && !run.stderr.is_empty(), "{args:?}");
    }
    assert_eq!(listing(place.path()), ["capture"]);
}

#[test]
fn help_and_version_return_0() {
    for args in [&["--help"][..], &["--version"], &["model", "--help"], &["help", "compare"]] {
        let run = turnlight(Path::new("."), args);
        assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""), "{args:?}");
    }
}

#[test]
fn broken_files_are_named() {
    let place = place();
    let model: &[&str] = &["model", "capture", "-o", "m.glb"];
    let image = frame_file(place.path(), "file_path", 2);
    let mask = frame_file(place.path(), "mask_path", 3);
    let name = |path: &Path| path.file_name().expect("a name").to_string_lossy().into_owned();
    let (image_bytes, mask_bytes) = (fs::read(&image).expect("an image"), fs::read(&mask).expect("a mask"));

    fs::remove_file(&image).expect("removed");
    assert_fails(place.path(), model, &[&name(&image)]);
    fs::write(&image, &image_bytes[..image_bytes.len() / 2]).expect("written");
    assert_fails(place.path(), model, &[&name(&image)]);
    fs::write(&image, &image_bytes).expect("written");

    capture::write_matte(&mask, &capture::Image::filled(50, 40, 255)).expect("written");
    assert_fails(place.path(), model, &[&name(&mask), "50"]);
    capture::write_matte(&mask, &capture::Image::filled(96, 72, 0)).expect("written");
    assert_fails(place.path(), model, &[&name(&mask), "empty"]);
    fs::write(&mask, &mask_bytes).expect("written");

    fs::create_dir(place.path().join("nothing")).expect("a folder");
    fs::write(place.path().join("nothing/notes.txt"), "x").expect("written");
    for args in [&["model", "nothing", "-o", "m.glb"][..], &["info", "nothing"], &["compare", "nothing", "-o", "r"]] {
        assert_fails(place.path(), args, &["nothing"]);
    }
    assert_fails(place.path(), &["info", "not-there"], &["not-there"]);
    assert_fails(place.path(), &["render", "not-there.glb", "--turntable", "2", "-o", "r"], &["not-there.glb"]);
}

#[test]
fn broken_cameras_are_named() {
    for (word, matrix) in [
        ("transforms.json", r#"[["NaN",0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"#),
        ("transforms.json", "[[1e999,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"),
        ("rotation", "[[3,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"),
        ("transforms.json", "[[1,0,0],[0,1,0]]"),
    ] {
        let place = place();
        let path = place.path().join("capture/transforms.json");
        edit(place.path(), |file| file["frames"][1]["transform_matrix"] = "HERE".into());
        let text = fs::read_to_string(&path).expect("a file").replace("\"HERE\"", matrix);
        fs::write(&path, text).expect("written");
        assert_fails(place.path(), &["model", "capture", "-o", "m.glb"], &["transforms.json", word]);
    }
}

#[test]
fn views_that_make_no_shape_are_refused() {
    let place = place();
    assert_fails(place.path(), &["model", "capture", "-o", "m.glb", "--views", "0"], &["one place", "views"]);
    // A silhouette in the wrong corner of every view: nothing is common to them.
    for i in 0..VIEWS {
        let mut matte = capture::Image::filled(96, 72, 0);
        let corner = [(4, 4), (88, 4), (4, 64), (88, 64)][i % 4];
        (0..4).for_each(|k| matte.set(corner.0 + k, corner.1 + k, 255));
        capture::write_matte(&frame_file(place.path(), "mask_path", i), &matte).expect("written");
    }
    assert_fails(place.path(), &["hull", "capture", "-o", "m.ply", "--consensus", "0"], &[]);
}

#[test]
fn two_identical_views_are_as_good_as_one() {
    let place = place();
    edit(place.path(), |file| {
        let first = file["frames"][0].clone();
        file["frames"].as_array_mut().expect("frames").insert(1, first);
    });
    let run = turnlight(place.path(), &["model", "capture", "-o", "m.glb", "--json"]);
    assert_eq!(json(&run)["views"], VIEWS + 1);
    assert_fails(place.path(), &["model", "capture", "-o", "n.glb", "--views", "0,1"], &["one place"]);
}

#[test]
fn a_mesh_may_be_brought_with_holes_or_refused_by_name() {
    let place = place();
    let run = turnlight(place.path(), &["hull", "capture", "-o", "hull.obj", "--resolution", "32", "--quiet"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    // Every fifth face missing.
    let text = fs::read_to_string(place.path().join("hull.obj")).expect("a mesh");
    let holed = text.lines().enumerate().filter(|(i, line)| !line.starts_with('f') || i % 5 > 0).map(|(_, line)| line);
    fs::write(place.path().join("holed.obj"), holed.collect::<Vec<_>>().join("\n")).expect("written");
    let facts = json(&turnlight(place.path(), &["info", "holed.obj", "--json"]));
    assert_eq!(facts["closed_manifold"], false);
    let run = turnlight(place.path(), &["model", "capture", "-o", "m.glb", "--mesh", "holed.obj", "--json"]);
    assert_eq!(json(&run)["triangles"], facts["triangles"]);

    fs::write(place.path().join("nan.obj"), "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n").expect("written");
    fs::write(place.path().join("empty.ply"), "").expect("written");
    let bytes = fs::read(place.path().join("m.glb")).expect("a model");
    fs::write(place.path().join("cut.glb"), &bytes[..bytes.len() / 2]).expect("written");
    for mesh in ["nan.obj", "empty.ply", "cut.glb", "none.ply"] {
        assert_fails(place.path(), &["model", "capture", "-o", "n.glb", "--mesh", mesh], &[mesh]);
    }
    assert_fails(place.path(), &["render", "cut.glb", "--turntable", "2", "-o", "r"], &["cut.glb"]);
    assert_fails(place.path(), &["info", "cut.glb"], &["cut.glb"]);
}

#[test]
fn an_object_that_leaves_the_frame_is_still_modelled() {
    let place = place();
    // The right half of view 2 is unknown from now on: silhouette to the very border.
    let path = frame_file(place.path(), "mask_path", 2);
    let mut matte = capture::read_matte(&path).expect("a mask");
    (0..72).for_each(|y| (48..96).for_each(|x| matte.set(x, y, 255)));
    capture::write_matte(&path, &matte).expect("written");
    let run = turnlight(place.path(), &["hull", "capture", "-o", "h.ply", "--json"]);
    let facts = json(&run);
    assert_eq!(facts["closed_manifold"], true);
    assert!(facts["silhouette_iou"][0].as_f64().expect("IoU") > 0.9);
}

#[test]
fn outputs_that_cannot_be_written_leave_nothing() {
    let place = place();
    assert_fails(place.path(), &["hull", "capture", "-o", "none/h.ply"], &["none"]);
    fs::create_dir(place.path().join("mine")).expect("a folder");
    fs::write(place.path().join("mine/thesis.tex"), "x").expect("written");
    assert_fails(place.path(), &["compare", "capture", "-o", "mine"], &["mine"]);
    assert_fails(place.path(), &["demo", "-o", "mine"], &["mine"]);
    assert_fails(place.path(), &["import", "capture", "-o", "mine"], &["mine"]);
    assert_fails(place.path(), &["synth", "temple", "-o", "mine", "--views", "1", "--size", "8x8"], &["mine"]);
    assert_eq!(fs::read_to_string(place.path().join("mine/thesis.tex")).expect("still there"), "x");
}

/// Needs the right to mount: skips, saying so, without it.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_named_and_leaves_nothing() {
    let place = place();
    let disk = place.path().join("disk");
    fs::create_dir(&disk).expect("a folder");
    let mount =
        std::process::Command::new("mount").args(["-t", "tmpfs", "-o", "size=32k", "tmpfs"]).arg(&disk).output();
    if !mount.is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: a small file system cannot be mounted here");
        return;
    }
    let runs = [
        &["model", "capture", "-o", "disk/m.glb"][..],
        &["hull", "capture", "-o", "disk/h.ply"],
        &["import", "capture", "-o", "disk/c"],
        &["compare", "capture", "-o", "disk/r", "--method", "static"],
        &["synth", "temple", "-o", "disk/s", "--views", "4", "--size", "96x72"],
    ]
    .map(|args| (args, turnlight(place.path(), &[args, &["--quiet"]].concat()), listing(&disk)));
    let unmounted = std::process::Command::new("umount").arg(&disk).status();
    assert!(unmounted.is_ok_and(|status| status.success()), "{} is still mounted", disk.display());
    for (args, run, left) in runs {
        assert_eq!(run.code, Some(1), "{args:?}: {}", run.stderr);
        assert!(run.stderr.contains("disk"), "{args:?}: {}", run.stderr);
        assert!(left.is_empty(), "{args:?} left {left:?}");
    }
}

#[test]
fn json_is_all_there_is_on_standard_output() {
    let place = place();
    for args in [
        &["info", "capture"][..],
        &["import", "capture", "-o", "imported"],
        &["hull", "capture", "-o", "hull.ply"],
        &["info", "hull.ply"],
        &["model", "capture", "-o", "m.glb"],
        &["info", "m.glb"],
        &["render", "m.glb", "--cameras", "capture", "--views", "odd", "-o", "frames"],
        &["render", "m.glb", "--turntable", "3", "--size", "32x24", "--video", "film.png"],
        &["compare", "capture", "-o", "report", "-v"],
        &["synth", "temple", "-o", "filmed", "--views", "2", "--size", "16x12"],
    ] {
        let run = turnlight(place.path(), &[args, &["--json"]].concat());
        assert!(json(&run).is_object(), "{args:?}");
    }
    assert_eq!(fs::read_dir(place.path().join("frames")).expect("frames").filter(is_png).count(), VIEWS / 2);
    assert!(place.path().join("frames/0003.png").exists(), "numbered by position");
    for file in ["report.html", "report.json", "report.csv", "views/dyntex/0001.png", "views/mask/0001.png"] {
        assert!(place.path().join("report").join(file).exists(), "{file}");
    }
    let quiet = turnlight(place.path(), &["info", "hull.ply", "--quiet"]);
    assert_eq!((quiet.code, quiet.stdout.as_str(), quiet.stderr.as_str()), (Some(0), "", ""));
}

/// One picture, whoever draws it: where there is no adapter the CPU does, and says so once.
#[test]
fn renderers_draw_the_same() {
    let place = place();
    assert_eq!(turnlight(place.path(), &["model", "capture", "-o", "m.glb"]).code, Some(0));
    let draw = |renderer: &str| {
        let size = ["--turntable", "2", "--size", "96x72"];
        turnlight(
            place.path(),
            &[&["render", "m.glb", "--renderer", renderer, "-o", renderer, "--json"], &size[..]].concat(),
        )
    };
    let gpu = draw("gpu");
    if !cfg!(feature = "gpu") {
        assert_eq!(gpu.code, Some(2));
        return assert!(gpu.stderr.contains("--features gpu"), "{}", gpu.stderr);
    }
    let is_adapter = json(&gpu)["frame_device"].as_str().is_some_and(|device| device.starts_with("gpu"));
    assert_eq!(gpu.stderr.matches("the CPU draws: ").count(), usize::from(!is_adapter), "{}", gpu.stderr);
    assert!(json(&draw("cpu"))["frame_device"].as_str().is_some_and(|device| device.starts_with("cpu")));
    assert_eq!(draw("auto").code, Some(0));
    for frame in ["0000.png", "0001.png"] {
        let [a, b] = ["cpu", "gpu"].map(|r| capture::read_rgb(&place.path().join(r).join(frame)).expect("a picture"));
        let pairs: Vec<_> = a.pixels().iter().zip(b.pixels()).filter(|(p, q)| **p != [0; 3] || **q != [0; 3]).collect();
        let off = pairs.iter().filter(|(p, q)| (0..3).any(|c| p[c].abs_diff(q[c]) > 1)).count();
        assert!(pairs.len() > 500 && off * 200 <= pairs.len(), "{off} of {}", pairs.len());
    }
}

fn is_png(entry: &std::io::Result<fs::DirEntry>) -> bool {
    entry.as_ref().is_ok_and(|e| e.path().extension().is_some_and(|x| x == "png"))
}

#[test]
fn reports_have_the_keys_of_the_contract() {
    let place = place();
    let hull = json(&turnlight(place.path(), &["hull", "capture", "-o", "h.ply", "--json"]));
    let mesh = json(&turnlight(place.path(), &["info", "h.ply", "--json"]));
    for key in ["vertices", "triangles", "components", "euler", "closed_manifold", "volume", "aabb"] {
        assert_eq!(hull[key].is_null(), mesh[key].is_null(), "{key}");
        assert!(!mesh[key].is_null(), "{key}");
    }
    let compared = json(&turnlight(place.path(), &["compare", "capture", "--json"]));
    assert_eq!(compared["capture"], "capture");
    assert_eq!(compared["train"], serde_json::json!([0, 2, 4, 6]));
    assert_eq!(compared["test"], serde_json::json!([1, 3, 5, 7]));
    let stage = &compared["stages"][0];
    assert!(stage["stage"].is_string() && stage["seconds"].is_number() && stage.get("peak_bytes").is_some());
    let names: Vec<&Value> = compared["methods"].as_array().expect("methods").iter().map(|m| &m["method"]).collect();
    assert_eq!(names, ["static", "vdtm", "lumigraph", "dyntex"]);
    for key in [
        "error_mean_pct",
        "error_max_pct",
        "error_variance",
        "error_union_pct",
        "psnr_db",
        "ssim",
        "psnr_full_db",
        "mask_iou",
        "seam",
        "temporal",
        "bytes",
        "bytes_raw",
        "build_s",
        "frame_ms",
    ] {
        assert!(compared["methods"][3][key].is_number(), "{key}");
    }
    turnlight(place.path(), &["model", "capture", "-o", "m.glb"]);
    let model = json(&turnlight(place.path(), &["info", "m.glb", "--json"]));
    assert_eq!(model["method"], "dyntex");
    assert!(model["facets"].is_number() && model["ranks"].is_array() && model["bytes"]["appearance"].is_number());
    assert_eq!(model["bytes"]["file"], fs::metadata(place.path().join("m.glb")).expect("a model").len());
}

/// Writes a cube around the origin.
fn write_cube(path: &Path, half: f64) {
    let corner = |i: i32| [i & 1, i >> 1 & 1, i >> 2].map(|bit| half * f64::from(2 * bit - 1));
    let mut text: String = (0..8).map(corner).map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    for [a, b, c, d] in [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]] {
        text.push_str(&format!("f {a} {b} {c}\nf {a} {c} {d}\n"));
    }
    fs::write(path, text).expect("written");
}

#[test]
fn a_mesh_is_held_against_the_truth() {
    let place = tempfile::tempdir().expect("a folder");
    write_cube(&place.path().join("truth.obj"), 1.0);
    write_cube(&place.path().join("mesh.obj"), 1.1);
    let info = |args: &[&str]| turnlight(place.path(), &[&["info", "mesh.obj", "--truth"], args].concat());
    let found = json(&info(&["truth.obj", "--json"]));
    let figure = |key: &str| found[key].as_f64().unwrap_or_else(|| panic!("no {key} in {found}"));
    assert_eq!(found["triangles"], 12, "what info says of any mesh is still there");
    // Every point of the truth is a tenth from the mesh; beside the edges the mesh is farther from the truth.
    assert!(figure("accuracy_90") > 0.1 && figure("accuracy_90") < 0.12, "{found}");
    assert!((figure("signed_mean_of_truth") + 0.1).abs() < 1e-9 && figure("signed_mean") > 0.1, "{found}");
    assert!((figure("hausdorff") - 0.1 * 3.0_f64.sqrt()).abs() < 1e-9, "{found}");
    assert!(figure("distance_rms") >= figure("distance_mean") && figure("distance_mean") > 0.1);
    assert!((figure("tolerance") - 0.02 * 3.0_f64.sqrt()).abs() < 1e-12, "a hundredth of the diagonal");
    assert_eq!((figure("completeness_pct"), figure("left_out_pct")), (0.0, 0.0));
    assert_eq!(json(&info(&["truth.obj", "--tolerance", "0.11", "--json"]))["completeness_pct"], 100.0);
    let text = info(&["truth.obj"]).stdout;
    assert!(text.contains("unit of the mesh") && text.contains("bias +1."), "{text}");
    let args = ["info", "mesh.obj", "--truth", "none.ply"];
    assert_fails(place.path(), &args, &["none.ply"]);
    fs::write(place.path().join("point.obj"), "v 0 0 0\nf 1 1 1\n").expect("written");
    assert_fails(place.path(), &["info", "mesh.obj", "--truth", "point.obj"], &["true mesh"]);
}

#[test]
fn a_comparison_judges_the_shape_where_the_truth_is_known() {
    let place = place();
    let compare = || turnlight(place.path(), &["compare", "capture", "--method", "static", "-o", "r", "--json"]);
    let compared = json(&compare());
    let figure = |key: &str| compared["geometry"][key].as_f64().unwrap_or_else(|| panic!("no {key} in {compared}"));
    // In metres: the temple is about 0.2 long, its pixels at this size 3 mm.
    assert_eq!(figure("tolerance"), 0.00125);
    assert!(figure("accuracy_90") > 1e-4 && figure("accuracy_90") < 0.05, "{}", figure("accuracy_90"));
    assert!(figure("completeness_pct") > 1.0 && figure("signed_mean") > 0.0, "{compared}");
    let page = fs::read_to_string(place.path().join("r/report.html")).expect("a page");
    assert!(page.contains("90 % of the mesh within"));
    // A truth that is no mesh is named and left out; so is one that is not there, in silence.
    let truth = place.path().join("capture/truth.ply");
    fs::write(&truth, "ply?").expect("written");
    let run = compare();
    assert!(run.stderr.contains("truth.ply") && json(&run).get("geometry").is_none(), "{}", run.stderr);
    fs::remove_file(&truth).expect("removed");
    assert!(json(&compare()).get("geometry").is_none());
}

#[test]
fn the_same_bytes_from_every_run() {
    let place = place();
    let mut models = Vec::new();
    for (file, threads) in [("a.glb", "1"), ("b.glb", "2"), ("c.glb", "2")] {
        let run = turnlight(place.path(), &["model", "capture", "-o", file, "--threads", threads, "--quiet"]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        models.push(fs::read(place.path().join(file)).expect("a model"));
    }
    assert!(models[0] == models[1], "one thread and two differ");
    assert!(models[1] == models[2], "two runs differ");
    for (folder, threads) in [("fa", "1"), ("fb", "2")] {
        let args = ["render", "a.glb", "--cameras", "capture", "--views", "3", "-o", folder, "--threads", threads];
        assert_eq!(turnlight(place.path(), &args).code, Some(0));
    }
    let frame = |folder: &str| fs::read(place.path().join(folder).join("0003.png")).expect("a frame");
    assert!(frame("fa") == frame("fb"), "renders differ");
}

#[test]
fn a_second_run_replaces_the_first() {
    let place = place();
    for _ in 0..2 {
        let run = turnlight(place.path(), &["compare", "capture", "-o", "report", "--method", "static", "--quiet"]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let run = turnlight(place.path(), &["import", "capture", "-o", "imported", "--quiet"]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
    }
    assert_eq!(listing(place.path()), ["capture", "imported", "report"]);
}

#[test]
fn boards_are_drawn_to_the_scale_they_say() {
    let place = tempfile::tempdir().expect("a folder");
    for (file, start) in [("a.pdf", &b"%PDF-1.7"[..]), ("a.svg", b"<svg"), ("a.png", b"\x89PNG")] {
        let answer = json(&turnlight(place.path(), &["board", "-o", file, "--square", "2.5cm", "--json"]));
        assert_eq!(answer["board"], "charuco:7x5:25mm:18.75mm:4x4_50");
        assert_eq!(answer["size_mm"], serde_json::json!([175.0, 125.0]));
        assert!(fs::read(place.path().join(file)).expect("a sheet").starts_with(start), "{file}");
    }
    let before = listing(place.path());
    for (args, word) in [
        (&["-o", "b.gif"][..], ".pdf"),
        (&["-o", "b.pdf", "--square", "30"], "unit"),
        (&["-o", "b.pdf", "--columns", "20"], "larger paper"),
        (&["-o", "b.pdf", "--columns", "12", "--rows", "12", "--square", "10mm"], "larger dictionary"),
        (&["-o", "b.pdf", "--dictionary", "4x4"], "4x4_50"),
        (&["-o", "b.pdf", "--paper", "a9"], "letter"),
    ] {
        let run = turnlight(place.path(), &[&["board"], args].concat());
        assert_eq!(run.code, Some(2), "{args:?}: {}", run.stderr);
        assert!(run.stderr.contains(word), "{args:?} does not say '{word}': {}", run.stderr);
    }
    assert_eq!(listing(place.path()), before);
}

#[test]
fn films_are_written_where_the_build_can() {
    let place = tempfile::tempdir().expect("a folder");
    let args = ["synth", "temple", "-o", "capture", "--views", "3", "--size", "32x24", "--quiet", "--video"];
    let run = turnlight(place.path(), &[&args[..], &["film.gif"]].concat());
    assert_eq!(run.code, Some(2), "{}", run.stderr);
    assert!(run.stderr.contains(".apng") && listing(place.path()).is_empty(), "{}", run.stderr);
    let run = turnlight(place.path(), &[&args[..], &["film.mp4"]].concat());
    if cfg!(feature = "video") {
        assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
        assert!(fs::read(place.path().join("film.mp4")).expect("a film")[4..].starts_with(b"ftyp"));
        assert!(place.path().join("capture/truth.json").exists());
        fs::remove_dir_all(place.path().join("capture")).expect("our own folder");
        let odd = ["synth", "temple", "-o", "capture", "--size", "33x24", "--video", "odd.mp4"];
        assert!(turnlight(place.path(), &odd).stderr.contains("32x24"));
    } else {
        assert_eq!(run.code, Some(2), "{}", run.stderr);
        assert!(run.stderr.contains("--features video"), "{}", run.stderr);
        assert!(listing(place.path()).is_empty());
    }
    // An animated picture needs no codec, and shows the same.
    let run = turnlight(place.path(), &[&args[..], &["film.png", "--backdrop", "blue"]].concat());
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    assert!(fs::read(place.path().join("film.png")).expect("a film").starts_with(b"\x89PNG"));
    let run = turnlight(place.path(), &["synth", "temple", "-o", "s", "--video", "a.png", "--backdrop", "pink"]);
    assert_eq!(run.code, Some(2));
    assert!(run.stderr.contains("green, blue, grey, black"), "{}", run.stderr);
}

#[test]
fn synth_films_as_asked_and_keeps_the_truth_beside() {
    let place = tempfile::tempdir().expect("a folder");
    let small = ["--views", "3", "--size", "32x24", "--seed", "4"];
    let run = |name: &str, more: &[&str]| {
        let args = [&["synth", "mug", "-o", name, "--json", "--quiet"], small.as_slice(), more].concat();
        let run = turnlight(place.path(), &args);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        serde_json::from_str::<Value>(&run.stdout).expect("JSON")
    };
    let read = |path: &str| -> Value {
        serde_json::from_str(&fs::read_to_string(place.path().join(path)).expect("a file")).expect("JSON")
    };
    let filmed = run("plain", &["--noise", "12", "--maps", "--light", "object", "--layout", "spiral"]);
    assert!(filmed["noise_rms_levels"].as_f64().expect("noise") < 16.0, "{filmed}");
    assert!(place.path().join("plain/truth/0002.exr").exists());
    let (capture, truth) = (read("plain/transforms.json"), read("plain/truth.json"));
    for k in 0..3 {
        assert_eq!(capture["frames"][k]["transform_matrix"], truth["frames"][k]["transform_matrix"]);
        assert_eq!(capture["frames"][k]["light_direction"], capture["frames"][0]["light_direction"]);
    }
    let faults = ["--calibration-error", "1", "--exposure-drift", "0.2", "--sensor-noise", "3000", "--jitter", "1"];
    run("faulty", &[faults.as_slice(), &["--mask-grow", "-1", "--mask-holes", "2", "--motion-blur", "2"]].concat());
    let (capture, truth) = (read("faulty/transforms.json"), read("faulty/truth.json"));
    assert_ne!(capture["frames"][1]["transform_matrix"], truth["frames"][1]["transform_matrix"]);
    assert_ne!(truth["frames"][0]["exposure"], truth["frames"][1]["exposure"]);
    assert!(!place.path().join("faulty/truth").exists());
}

#[test]
fn one_camera_an_axis_and_angles_make_the_ring_again() {
    let place = place();
    // The lower ring comes first; its cameras go around z: the object turns the other way.
    fs::write(place.path().join("angles.txt"), "0\n-90\n-180\n-270\n0\n0\n0\n0\n").expect("written");
    let args = ["turntable", "capture/images", "--camera", "capture", "--angles"];
    let answer = json(&turnlight(place.path(), &[&args[..], &["angles.txt", "-o", "made", "--json"]].concat()));
    assert_eq!((answer["views"].as_u64(), answer["masks"].as_str()), (Some(VIEWS as u64), Some("masks_image")));
    let cameras = |name: &str| Capture::read(&place.path().join(name)).expect("a capture").frames;
    for (made, truth) in cameras("made").iter().zip(cameras("capture")).take(4) {
        assert!((made.camera.translation - truth.camera.translation).norm() < 1e-9);
        assert!((made.camera.rotation - truth.camera.rotation).norm() < 1e-9);
    }
    fs::write(place.path().join("few.txt"), "0\n45\n").expect("written");
    let few = [&args[..], &["few.txt", "-o", "t"]].concat();
    assert_fails(place.path(), &few, &["capture/images", "holds 8 images, 2 angles are given"]);
}

#[test]
fn synth_names_the_option_that_is_out_of_range() {
    let place = tempfile::tempdir().expect("a folder");
    let with = |more: &[&'static str]| [&["synth", "mug", "-o", "s", "--views", "2"], more].concat();
    for (wrong, word) in [
        (&["--jitter", "NaN"][..], "camera_jitter_deg"),
        (&["--elevations", "95"], "elevation"),
        (&["--noise", "0"], "--noise"),
        (&["--noise", "2", "--samples", "8"], "--samples"),
        (&["--light", "moon"], "--light"),
        (&["--turns", "3"], "--layout spiral"),
    ] {
        let run = turnlight(place.path(), &with(wrong));
        assert_eq!(run.code, Some(2), "{wrong:?}: {}", run.stderr);
        assert!(run.stderr.contains(word), "{wrong:?}: {}", run.stderr);
    }
}

#[test]
fn btf_synth_writes_a_material_whole_or_not_at_all() {
    let place = tempfile::tempdir().expect("a folder");
    let args = ["btf", "synth", "analytic", "-o", "material", "--size", "4", "--samples", "1", "--json", "--quiet"];
    let run = turnlight(place.path(), &args);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    serde_json::from_str::<Value>(&run.stdout).expect("JSON");
    let view = place.path().join("material/tv030_pv060");
    assert_eq!(fs::read_dir(&view).expect("a view").count(), 81);
    // Ring of 30 degrees: views 7, 8, 9, ...; the third of these is at 60 degrees of azimuth.
    assert!(view.join("00009 tl000 pl000 tv030 pv060.png").exists());
    assert_fails(place.path(), &args[..9], &["material"]);
    let wrong = turnlight(place.path(), &["btf", "synth", "velvet", "-o", "other"]);
    assert_eq!(wrong.code, Some(2), "{}", wrong.stderr);
    assert!(wrong.stderr.contains("corduroy"), "{}", wrong.stderr);
}

#[test]
fn a_material_is_drawn_and_takes_the_place_of_what_was_photographed() {
    let place = place();
    let done = |args: &[&str]| json(&turnlight(place.path(), &[args, &["--json", "--quiet"]].concat()));
    done(&["btf", "synth", "analytic", "-o", "data", "--size", "4", "--samples", "1"]);
    done(&["btf", "fit", "data", "-o", "m.btfz", "--codec", "pca", "--components", "4"]);
    for (shape, light) in
        [("tile", ["--light", "0,0,1"]), ("sphere", ["--point", "-2,-3,4"]), ("cloth", ["--exposure", "1"])]
    {
        let drawn = done(
            &[&["btf", "render", "m.btfz", "-o", "a.png", "--shape", shape, "--size", "48x40"], &light[..]].concat(),
        );
        assert_eq!((&drawn["width"], &drawn["height"]), (&Value::from(48), &Value::from(40)), "{shape}");
        let first = fs::read(place.path().join("a.png")).expect("a picture");
        done(
            &[
                &["btf", "render", "m.btfz", "-o", "a.png", "--shape", shape, "--size", "48x40"],
                &light[..],
                &["--threads", "1"],
            ]
            .concat(),
        );
        assert_eq!(first, fs::read(place.path().join("a.png")).expect("a picture"), "{shape}: other bytes");
    }
    done(&["model", "capture", "-o", "plain.glb", "--method", "static"]);
    done(&["model", "capture", "-o", "coated.glb", "--method", "static", "--material", "all=m.btfz@0.1"]);
    let facts = done(&["info", "coated.glb"]);
    let (material, bytes) = (&facts["materials"][0], fs::metadata(place.path().join("m.btfz")).expect("a file").len());
    assert_eq!((&material["codec"], &facts["bytes"]["materials"]), (&Value::from("pca"), &Value::from(bytes)));
    assert_eq!(material["charts"].as_array().map(|c| c.len() as u64), facts["charts"].as_u64());
    let frames = |model: &str, light: &str| {
        done(&["render", model, "--turntable", "1", "--size", "40x30", "-o", "frames", "--light", light]);
        fs::read(place.path().join("frames/0000.png")).expect("a frame")
    };
    assert_eq!(frames("plain.glb", "1,0,0"), frames("plain.glb", "-1,0,0"));
    assert_ne!(frames("coated.glb", "1,0,0"), frames("coated.glb", "-1,0,0"));
    assert_fails(
        place.path(),
        &["btf", "render", "m.btfz", "-o", "b.png", "--environment", "m.btfz"],
        &["m.btfz", ".exr"],
    );
    assert_fails(
        place.path(),
        &["btf", "render", "capture/transforms.json", "-o", "b.png"],
        &["transforms.json", "btf fit"],
    );
    for wrong in ["7777=m.btfz", "all=m.btfz@-1", "m.btfz"] {
        let run =
            turnlight(place.path(), &["model", "capture", "-o", "b.glb", "--method", "static", "--material", wrong]);
        assert_eq!(run.code, Some(2), "{wrong}: {}", run.stderr);
    }
}
