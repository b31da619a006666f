//! The add-on of Blender: what it reads and blends is what we do, and what Cycles draws is what our renderer draws.
//!
//! Weights and refusals need a Python with numpy, pictures one with the module `bpy` (`cargo xtask test --blender`
//! brings it; `TURNLIGHT_BPY` names another). Where either is missing the test skips, saying so.

use capture::{Camera, Image, read_rgb};
use data_synth::{Effort, Layout, Scene, SynthOptions, synthesize};
use nalgebra::Point3;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;
use tests::hostile::hostile;
use tests::played::{COMPARED, SHARE, agreement, frame, played};
use texture::{Appearance, FitOptions, Layers, Method, Model, SurfaceTexels};
use turnlight::pipeline::{self, ShapeOptions};
use turnlight::playback;
use turnlight::stages::{Silent, Stages};

/// Sub-samples along a pixel's side, as our player has them.
const SUPERSAMPLE: usize = 2;

/// A Python that imports `module`: the one `variable` names, or the system's.
fn python(variable: &str, module: &str) -> Option<PathBuf> {
    let named = std::env::var_os(variable).map(PathBuf::from);
    let import = |python: &PathBuf| {
        let output = Command::new(python).args(["-c", &format!("import {module}")]).output();
        output.is_ok_and(|output| output.status.success())
    };
    let found = named.into_iter().chain(["python3".into()]).find(import);
    if found.is_none() {
        eprintln!("skipped: no Python with the module {module} (cargo xtask test --blender brings it)");
    }
    found
}

/// The folder that `turnlight export --to blender` makes of `model`, below `place`.
fn exported(place: &Path, model: &[u8], to: &str) -> PathBuf {
    std::fs::write(place.join("m.glb"), model).expect("written");
    let run = tests::turnlight(place, &["export", "m.glb", "--to", to, "-o", to, "--quiet"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    place.join(to)
}

/// Runs a script of `render/blender/test` in an empty folder, which it must leave so; its report.
fn report(python: &Path, script: &str, place: &Path, addon: Option<&Path>, cases: &[Value]) -> Vec<Value> {
    let (job, report, empty) = (place.join("job.json"), place.join("report.json"), place.join("empty"));
    std::fs::create_dir_all(&empty).expect("a folder");
    let text = json!({"addon": addon, "report": report, "cases": cases}).to_string();
    std::fs::write(&job, text).expect("written");
    let script = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../render/blender/test")).join(script);
    let mut command = Command::new(python);
    // Blender's own folders, so that nobody's preferences are read or written.
    command.arg(script).arg(&job).current_dir(&empty).env("BLENDER_USER_RESOURCES", place.join("resources"));
    let output = command.output().expect("python runs");
    let said = [output.stdout, output.stderr].concat();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&said));
    assert_eq!(std::fs::read_dir(&empty).expect("a folder").count(), 0, "a file was left");
    let said = String::from_utf8_lossy(&said);
    assert!(!said.contains("Traceback"), "{said}");
    serde_json::from_slice(&std::fs::read(report).expect("a report")).expect("JSON")
}

fn model(bytes: &[u8]) -> Model {
    Model::from_glb(bytes, Path::new("memory")).expect("a model")
}

fn layers(model: &Model) -> &Layers {
    let Appearance::Layers(layers) = &model.appearance else { panic!("{} has no layers", model.method.name()) };
    layers
}

#[test]
fn the_folder_holds_the_model_the_add_on_and_what_to_do_with_them() {
    let place = tempfile::tempdir().expect("a folder");
    let file = played().model(Method::Static);
    let folder = exported(place.path(), file, "blender");
    let names: BTreeSet<String> = std::fs::read_dir(&folder)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    assert!(names.iter().eq([".turnlight", "README.txt", "model.glb", "turnlight-addon.zip"]), "{names:?}");
    assert_eq!(std::fs::read(folder.join("model.glb")).expect("a model"), file);
    let text = std::fs::read_to_string(folder.join("README.txt")).expect("text");
    assert!(["turnlight-addon.zip", "model.glb"].iter().all(|name| text.contains(name)), "{text}");
}

/// A model of views all over a dome, whose directions are triangulated; views on one ring are not.
fn dome() -> Vec<u8> {
    let options = SynthOptions {
        views: 20,
        width: 80,
        height: 60,
        effort: Effort::Samples(1),
        surfaces: 1,
        layout: Layout::Hemisphere { above_deg: 5.0 },
        ..SynthOptions::default()
    };
    let views = synthesize(Scene::Temple, &options).expect("a scene").views;
    let (shape, fit) = (ShapeOptions::default(), FitOptions { layers: 6, ..FitOptions::default() });
    let (model, _) =
        pipeline::model(&views, None, Method::DynTex, &shape, &fit, &mut Stages::new(&Silent)).expect("a model");
    assert!(layers(&model).facets.iter().any(|f| !f.complex.triangles().is_empty()), "no triangle");
    model.to_glb().expect("a file")
}

/// Eyes all around, near and far, above and below; in the middle of a facet, where there is no direction; beyond
/// all numbers.
fn eyes(model: &Model) -> Vec<Point3<f64>> {
    let around = (0..40).map(|k| {
        let (a, z) = (0.37 * f64::from(k), 0.9 * (1.3 * f64::from(k)).sin());
        let far = 0.4 + 0.1 * f64::from(k);
        Point3::new(far * a.cos(), far * a.sin(), far * z)
    });
    around.chain([layers(model).facets[0].center, Point3::new(1e100, 1e100, 0.0)]).collect()
}

#[test]
fn weights_are_ours_on_rings_and_domes() {
    let Some(python) = python("TURNLIGHT_PYTHON", "numpy") else { return };
    let place = tempfile::tempdir().expect("a folder");
    let files = [Method::Static, Method::Vdtm, Method::DynTex].map(|method| played().model(method).to_vec());
    let files = [files.to_vec(), vec![dome()]].concat();
    let addon = exported(place.path(), &files[0], "blender").join("turnlight-addon.zip");
    let case = |(i, file): (usize, &Vec<u8>)| {
        let path = place.path().join(format!("{i}.glb"));
        std::fs::write(&path, file).expect("written");
        let eyes: Vec<[f64; 3]> = eyes(&model(file)).into_iter().map(Into::into).collect();
        json!({"model": path, "eyes": eyes})
    };
    let cases: Vec<Value> = files.iter().enumerate().map(case).collect();
    for (file, report) in files.iter().zip(report(&python, "read.py", place.path(), Some(&addon), &cases)) {
        let model = model(file);
        for (e, eye) in eyes(&model).iter().enumerate() {
            for (f, facet) in layers(&model).facets.iter().enumerate() {
                for (k, ours) in facet.at(eye).into_iter().enumerate() {
                    let theirs = report["weights"][e][f][k].as_f64().unwrap_or(f64::NAN);
                    let error = (theirs - f64::from(ours)).abs();
                    assert!(
                        error <= 1e-5 * (1.0 + theirs.abs()),
                        "{} facet {f} layer {k}: {ours} {theirs} from {eye}",
                        model.method.name()
                    );
                }
            }
        }
    }
}

#[test]
fn texels_show_the_points_of_the_surface_that_ours_do() {
    let Some(python) = python("TURNLIGHT_PYTHON", "numpy") else { return };
    let place = tempfile::tempdir().expect("a folder");
    let file = played().model(Method::Static);
    let addon = exported(place.path(), file, "blender").join("turnlight-addon.zip");
    let surface = place.path().join("surface");
    let case = json!({"model": place.path().join("m.glb"), "eyes": [], "surface": surface});
    report(&python, "read.py", place.path(), Some(&addon), &[case]);
    let bytes = std::fs::read(surface).expect("points");
    let numbers: Vec<f64> = bytes.as_chunks::<8>().0.iter().map(|&b| f64::from_le_bytes(b)).collect();
    let theirs: BTreeMap<u32, Point3<f64>> =
        numbers.as_chunks::<4>().0.iter().map(|&[i, x, y, z]| (i as u32, Point3::new(x, y, z))).collect();
    let model = model(file);
    let ours = SurfaceTexels::bake(&model.mesh);
    let size = model.mesh.mesh.aabb().map_or(0.0, |b| (b.max - b.min).norm());
    assert_eq!(theirs.len(), ours.len());
    let is_same = |(i, p): (&u32, &Point3<f64>)| theirs.get(i).is_some_and(|q| (p - q).norm() < 1e-6 * size);
    let same = ours.index.iter().zip(&ours.positions).filter(|&(i, p)| is_same((i, p))).count();
    assert_eq!(same, ours.len());
}

#[test]
fn the_add_on_refuses_hostile_models() {
    let Some(python) = python("TURNLIGHT_PYTHON", "numpy") else { return };
    refuse(&python, "read.py");
}

#[test]
fn blender_refuses_hostile_models_and_keeps_nothing_of_them() {
    let Some(python) = python("TURNLIGHT_BPY", "bpy") else { return };
    for report in refuse(&python, "play.py") {
        assert_eq!((&report["objects"], &report["meshes"], &report["images"]), (&json!(0), &json!([]), &json!([])));
    }
}

/// Has every hostile file refused by a script, for the reason that every player gives.
fn refuse(python: &Path, script: &str) -> Vec<Value> {
    let place = tempfile::tempdir().expect("a folder");
    let good = played().model(Method::DynTex);
    let addon = exported(place.path(), good, "blender").join("turnlight-addon.zip");
    let files = hostile(good);
    let case = |(i, file): (usize, &tests::hostile::Hostile)| {
        let path = place.path().join(format!("{i}.glb"));
        std::fs::write(&path, &file.bytes).expect("written");
        json!({"model": path, "eyes": []})
    };
    let cases: Vec<Value> = files.iter().enumerate().map(case).collect();
    let reports = report(python, script, place.path(), Some(&addon), &cases);
    for (file, report) in files.iter().zip(&reports) {
        let said = report["refused"].as_str().unwrap_or_else(|| panic!("{} is shown: {report}", file.name));
        assert!(said.contains(file.word), "{}: '{said}' does not say '{}'", file.name, file.word);
    }
    reports
}

/// A picture of ours out of one with [`SUPERSAMPLE`]² pixels for each: their mean, rounded once.
fn reduced(path: &Path) -> Image<[u8; 3]> {
    let fine = read_rgb(path).expect("a picture");
    let n = SUPERSAMPLE;
    let (width, height) = (fine.width() / n, fine.height() / n);
    let mean = |i: usize| {
        let (x, y) = (n * (i % width), n * (i / width));
        let at = |c: usize| (0..n * n).map(|k| f64::from(fine.at(x + k % n, y + k / n)[c])).sum::<f64>();
        std::array::from_fn(|c| (at(c) / (n * n) as f64).round() as u8)
    };
    Image::from_pixels(width, height, (0..width * height).map(mean).collect()).expect("as many pixels as asked for")
}

/// Cameras half as near again as elsewhere: Cycles has no mip levels, so that pictures can only agree where texels are
/// not smaller than samples.
fn compared() -> [Camera; 2] {
    COMPARED.map(|view| {
        let mut camera = played().cameras[view];
        let i = &mut camera.intrinsics;
        (i.width, i.height) = (3 * i.width / 2, 3 * i.height / 2);
        for value in [&mut i.fx, &mut i.fy, &mut i.cx, &mut i.cy] {
            *value *= 1.5;
        }
        camera
    })
}

/// A case of `play.py` whose pictures go to `folder/name`.
fn case(folder: &Path, name: &str, rest: Value) -> Value {
    let output = folder.join(name);
    std::fs::create_dir_all(&output).expect("a folder");
    let mut case = json!({"cameras": compared().map(|c| frame(&c)), "output": output, "supersample": SUPERSAMPLE});
    rest.as_object().into_iter().flatten().for_each(|(key, value)| case[key] = value.clone());
    case
}

/// The pictures of a case; files differ, since Blender writes the time into them.
fn pictures(folder: &Path, name: &str) -> Vec<Image<[u8; 3]>> {
    let read = |i| read_rgb(&folder.join(name).join(format!("{i:04}.png"))).expect("a picture");
    (0..COMPARED.len()).map(read).collect()
}

#[test]
fn cycles_draws_what_the_renderer_draws_and_again_after_saving() {
    let Some(python) = python("TURNLIGHT_BPY", "bpy") else { return };
    let place = tempfile::tempdir().expect("a folder");
    let at = |name: &str| place.path().join(name);
    let addon = exported(place.path(), played().model(Method::DynTex), "blender").join("turnlight-addon.zip");
    let mut cases = Vec::new();
    for (method, bytes) in &played().models {
        let path = at(&format!("{}.glb", method.name()));
        std::fs::write(&path, bytes).expect("written");
        let save = at(&format!("{}.blend", method.name()));
        cases.push(case(place.path(), method.name(), json!({"model": path, "save": save})));
    }
    // Lying on its side, elsewhere, and larger: what counts is where the eye is from the object.
    let turn = [[0.0, -2.0, 0.0, 3.0], [0.0, 0.0, -2.0, -1.0], [2.0, 0.0, 0.0, 0.5], [0.0, 0.0, 0.0, 1.0]];
    cases.push(case(place.path(), "turned", json!({"model": at("dyntex.glb"), "turn": turn})));
    cases.push(case(place.path(), "animated", json!({"model": at("dyntex.glb"), "animated": true})));
    let rest = json!({"model": at("dyntex.glb"), "animated": true, "baked": at("frames"), "save": at("baked.blend")});
    cases.push(case(place.path(), "baked", rest));
    report(&python, "play.py", place.path(), Some(&addon), &cases);
    for (name, method) in Method::ALL.map(|m| (m.name(), m)).into_iter().chain([("turned", Method::DynTex)]) {
        let model = model(played().model(method));
        for (i, camera) in compared().iter().enumerate() {
            let ours = playback::player(&model).render(&model.atlas(&camera.center()), camera);
            let share = agreement(&ours, &reduced(&at(name).join(format!("{i:04}.png"))));
            println!("{name}, view {}: {:.2} % of the pixels agree", COMPARED[i], 100.0 * share);
            assert!(share >= SHARE, "{name}, view {}: {share} of the pixels agree", COMPARED[i]);
        }
    }
    let first = |name: &str| pictures(place.path(), name);
    assert!(first("dyntex") == first("animated"), "frames of an animation are drawn otherwise than stills");
    assert!(first("dyntex") == first("baked"), "baked frames differ");
    // In another process, first with the add-on, then without.
    let again =
        |name: &str| case(place.path(), &format!("{name} again"), json!({"blend": at(&format!("{name}.blend"))}));
    let cases = Method::ALL.map(|method| again(method.name()));
    report(&python, "play.py", place.path(), Some(&addon), &cases);
    for method in Method::ALL {
        assert!(first(method.name()) == first(&format!("{} again", method.name())), "{}", method.name());
    }
    std::fs::remove_dir_all(at("resources")).expect("Blender's folders");
    let alone = case(place.path(), "alone", json!({"blend": at("dyntex.blend")}));
    let baked = case(place.path(), "baked alone", json!({"blend": at("baked.blend"), "animated": true}));
    report(&python, "play.py", place.path(), None, &[alone, baked]);
    assert!(first("dyntex") == first("baked alone"), "what was baked still wants the add-on");
    assert!(first("alone")[1] == first("dyntex")[1], "what was seen last is lost without the add-on");
    assert!(first("alone")[0] != first("dyntex")[0], "without the add-on the object cannot follow the camera");
}

#[test]
fn blender_opens_the_mesh_with_one_picture() {
    let Some(python) = python("TURNLIGHT_BPY", "bpy") else { return };
    let place = tempfile::tempdir().expect("a folder");
    let file = played().model(Method::DynTex);
    let folder = exported(place.path(), file, "obj");
    let case = json!({"obj": folder.join("model.obj")});
    let report = report(&python, "play.py", place.path(), None, &[case]);
    let mesh = model(file).mesh;
    let [width, height] = mesh.atlas_size;
    assert_eq!(report[0]["meshes"][0][1], mesh.mesh.faces.len());
    assert_eq!(report[0]["meshes"][0][2], 1, "texture coordinates");
    assert_eq!(report[0]["images"], json!([["model.png", width, height]]));
}
