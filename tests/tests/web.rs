//! The browser player: what it shows is what our renderer draws, and it refuses what is no model.
//!
//! Chromium and node play the pages headless (`render/web/test`); where either is missing the test skips, saying so.

use capture::{Camera, Image, read_rgb};
use data_synth::{Effort, Scene, SynthOptions, synthesize};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use texture::{FitOptions, Method, Model};
use turnlight::export::web::Site;
use turnlight::pipeline::{self, ShapeOptions};
use turnlight::playback;
use turnlight::serve::Server;
use turnlight::stages::{Silent, Stages};

/// Views that were filmed, and those of them near which pictures are compared.
const VIEWS: usize = 12;
const COMPARED: [usize; 2] = [1, 7];

/// Largest difference of a pixel in levels, and the share of pixels that must keep to it.
const MOST_LEVELS: u8 = 2;
const SHARE: f64 = 0.99;

/// Frames of which the median time is printed.
const FRAMES: usize = 20;

/// What is played, made once.
struct Played {
    /// A file per method.
    models: Vec<(Method, Vec<u8>)>,
    cameras: Vec<Camera>,
}

fn played() -> &'static Played {
    static PLAYED: OnceLock<Played> = OnceLock::new();
    PLAYED.get_or_init(|| {
        let options = SynthOptions {
            views: VIEWS,
            width: 160,
            height: 120,
            effort: Effort::Samples(4),
            surfaces: 1,
            ..SynthOptions::default()
        };
        let views = synthesize(Scene::Temple, &options).expect("a scene").views;
        let model = |method| {
            let (shape, fit) = (ShapeOptions::default(), FitOptions { layers: 8, ..FitOptions::default() });
            let mut stages = Stages::new(&Silent);
            let (model, _) = pipeline::model(&views, None, method, &shape, &fit, &mut stages).expect("a model");
            (method, model.to_glb().expect("a file"))
        };
        Played {
            models: Method::ALL.map(model).into(),
            cameras: views.iter().map(|view| moved(&view.camera)).collect(),
        }
    })
}

/// Twice as many pixels, a little nearer and to the side: a view that no photograph took.
fn moved(camera: &Camera) -> Camera {
    let mut camera = *camera;
    let i = &mut camera.intrinsics;
    (i.width, i.height) = (2 * i.width, 2 * i.height);
    for value in [&mut i.fx, &mut i.fy, &mut i.cx, &mut i.cy] {
        *value *= 2.0;
    }
    camera.translation.z *= 0.93;
    camera.translation.x += 0.03 * camera.translation.z;
    camera
}

/// A frame of a transforms.json: camera to world, x right, y up, z back.
fn frame(camera: &Camera) -> Value {
    let (axes, center, i) = (camera.rotation.transpose(), camera.center(), &camera.intrinsics);
    let row = |r: usize| [axes[(r, 0)], -axes[(r, 1)], -axes[(r, 2)], center[r]];
    json!({
        "transform_matrix": [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]],
        "fl_x": i.fx, "fl_y": i.fy, "cx": i.cx, "cy": i.cy, "w": i.width, "h": i.height,
    })
}

/// Chromium, where it and node are installed; `TURNLIGHT_CHROMIUM` names another.
fn chromium() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let find = |name: &str| std::env::split_paths(&path).map(|folder| folder.join(name)).find(|file| file.is_file());
    find("node")?;
    if let Some(named) = std::env::var_os("TURNLIGHT_CHROMIUM") {
        return Some(named.into());
    }
    ["chromium", "chromium-browser", "google-chrome"].into_iter().find_map(find)
}

/// Serves `model` until the process ends; the page's address.
fn serve(model: Vec<u8>) -> String {
    let server = Server::bind(Site::new(model), 0).expect("a port");
    let url = server.url();
    std::thread::spawn(move || server.run());
    url
}

/// Plays every case and returns what `play.mjs` says of each.
fn play(chromium: &Path, place: &Path, cases: &[Value]) -> Vec<Value> {
    let job = place.join("job.json");
    std::fs::write(&job, json!({"chromium": chromium, "cases": cases}).to_string()).expect("written");
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../render/web/test/play.mjs");
    let output = Command::new("node").arg(script).arg(job).output().expect("node runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn list(report: &Value, key: &str) -> Vec<String> {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    report[key].as_array().unwrap_or_else(|| panic!("no {key} in {report}")).iter().map(text).collect()
}

/// Nothing was asked for but what the page's own server has, and nothing was thrown that nobody caught.
fn assert_quiet(name: &str, url: &str, report: &Value) {
    let is_own = |request: &String| {
        request.strip_prefix("blob:").unwrap_or(request).starts_with(url.trim_end_matches('/'))
            || request.starts_with("data:,")
    };
    let foreign: Vec<String> = list(report, "requests").into_iter().filter(|request| !is_own(request)).collect();
    assert!(foreign.is_empty(), "{name} asked for {foreign:?}");
    assert_eq!(list(report, "exceptions"), [""; 0], "{name}");
}

/// Share of the object's pixels, edges apart, within [`MOST_LEVELS`] of `ours`.
fn agreement(ours: &Image<[u8; 4]>, theirs: &Image<[u8; 3]>) -> f64 {
    assert_eq!((ours.width(), ours.height()), (theirs.width(), theirs.height()));
    let is_inside = |x: usize, y: usize| {
        let around = |dy: isize| (-1..=1).map(move |dx| (dx, dy));
        (-1..=1).flat_map(around).all(|(dx, dy)| ours.at_clamped(x as isize + dx, y as isize + dy)[3] == 255)
    };
    let (mut near, mut all) = (0, 0);
    for (x, y) in (0..ours.height()).flat_map(|y| (0..ours.width()).map(move |x| (x, y))) {
        if is_inside(x, y) {
            let (a, b) = (ours.at(x, y), theirs.at(x, y));
            near += usize::from((0..3).all(|c| a[c].abs_diff(b[c]) <= MOST_LEVELS));
            all += 1;
        }
    }
    assert!(all > 1000, "{all} pixels of the object");
    near as f64 / all as f64
}

#[test]
fn the_page_shows_what_the_renderer_draws() {
    let Some(chromium) = chromium() else {
        eprintln!("skipped: chromium or node is not installed (apt-get install chromium nodejs)");
        return;
    };
    let Played { models, cameras } = played();
    let place = tempfile::tempdir().expect("a folder");
    let frames: Vec<Value> = COMPARED.iter().map(|&view| frame(&cameras[view])).collect();
    let case = |(method, bytes): &(Method, Vec<u8>)| {
        let output = place.path().join(method.name());
        std::fs::create_dir(&output).expect("a folder");
        json!({"url": serve(bytes.clone()), "output": output, "cameras": frames, "frames": FRAMES})
    };
    let cases: Vec<Value> = models.iter().map(case).collect();
    for (((method, bytes), case), report) in models.iter().zip(&cases).zip(play(&chromium, place.path(), &cases)) {
        let name = method.name();
        assert!(report["failed"].is_null() && report["message"].is_null(), "{name}: {report}");
        assert_eq!(report["state"]["isPlaying"], true, "{name}: {report}");
        assert_quiet(name, case["url"].as_str().unwrap_or_default(), &report);
        assert_eq!(list(&report, "errors"), [""; 0], "{name}");
        let model = Model::from_glb(bytes, Path::new("memory")).expect("a model");
        for (i, &view) in COMPARED.iter().enumerate() {
            let camera = &cameras[view];
            let ours = playback::player(&model).render(&model.atlas(&camera.center()), camera);
            let theirs = read_rgb(&place.path().join(name).join(format!("{i:04}.png"))).expect("a picture");
            let share = agreement(&ours, &theirs);
            assert!(share >= SHARE, "{name}, view {view}: {share} of the pixels agree");
        }
        let rate = report["frame_ms"].as_f64().map_or(0.0, |ms| 1e3 / ms);
        println!("{name}: {rate:.0} frames/s at {}×{}", cameras[0].intrinsics.width, cameras[0].intrinsics.height);
    }
}

/// A model taken apart: the JSON and the binary chunk.
fn split(glb: &[u8]) -> (Value, Vec<u8>) {
    let length = glb.get(12..16).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes) as usize;
    (serde_json::from_slice(&glb[20..20 + length]).expect("JSON"), glb[28 + length..].to_vec())
}

fn joined(root: &Value, body: &[u8]) -> Vec<u8> {
    let mut text = root.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let word = |n: usize| (n as u32).to_le_bytes();
    let head = [b"glTF".as_slice(), &word(2), &word(28 + text.len() + body.len()), &word(text.len()), b"JSON"].concat();
    [head, text, word(body.len()).to_vec(), b"BIN\0".to_vec(), body.to_vec()].concat()
}

/// Where the data of an accessor or an image of the model's extension begins in the binary chunk.
fn place_of(root: &Value, kind: &str, index: &Value) -> usize {
    let index = index.as_u64().expect("an index") as usize;
    let view = root[kind][index]["bufferView"].as_u64().expect("a view") as usize;
    root["bufferViews"][view]["byteOffset"].as_u64().expect("a place") as usize
}

type Change = fn(&mut Value, &mut Vec<u8>);

const EXTENSION: &str = "/materials/0/extensions/TURNLIGHT_view_dependent_texture";

fn set(root: &mut Value, path: &str, value: Value) {
    let path = path.replace('$', EXTENSION);
    *root.pointer_mut(&path).unwrap_or_else(|| panic!("no {path}")) = value;
}

fn get(root: &Value, path: &str) -> Value {
    root.pointer(&path.replace('$', EXTENSION)).unwrap_or_else(|| panic!("no {path}")).clone()
}

/// What is done to a model, and a word of the refusal.
const HOSTILE: [(&str, &str, Change); 13] = [
    ("count", "more elements", |root, _| {
        let facets = get(root, "$/facets");
        set(root, &format!("/accessors/{facets}/count"), json!(1_000_000_000));
    }),
    ("fewer coefficients", "more coefficients", |root, _| {
        let path = format!("/accessors/{}/count", get(root, "$/coefficients"));
        let count = get(root, &path).as_u64().expect("a count");
        set(root, &path, json!(count - 1));
    }),
    ("NaN centre", "no number", |root, body| {
        let at = place_of(root, "accessors", &get(root, "$/facetCenters"));
        body[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    }),
    ("infinite scale", "no number", |root, _| set(root, "$/layers/1/scale", Value::Null)),
    ("coefficient scale", "coefficient scales", |root, _| set(root, "$/coefficientScales/0", json!("NaN"))),
    ("huge atlas", "atlas", |root, _| set(root, "$/atlasSize", json!([65536, 65536]))),
    ("huge image", "65535×65535", |root, body| {
        let at = place_of(root, "images", &get(root, "$/facetMap"));
        // Width and height in the header of a PNG.
        body[at + 16..at + 24].copy_from_slice(&[0, 0, 255, 255, 0, 0, 255, 255]);
    }),
    ("rotten image", "decompress", |root, body| {
        let at = place_of(root, "images", &get(root, "$/facetMap"));
        body[at + 60..at + 90].fill(0xff);
    }),
    ("vertex", "names vertex", |root, body| {
        let at = place_of(root, "accessors", &get(root, "/meshes/0/primitives/0/indices"));
        body[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    }),
    ("site", "unsound", |root, body| {
        let at = place_of(root, "accessors", &get(root, "$/edges"));
        body[at..at + 2].copy_from_slice(&u16::MAX.to_le_bytes());
    }),
    ("image elsewhere", "outside the file", |root, _| {
        let image = get(root, "$/layers/1/image");
        set(root, &format!("/images/{image}"), json!({"uri": "http://127.0.0.1:9/spy.png"}));
    }),
    ("buffer elsewhere", "outside the file", |root, _| {
        root["buffers"][0]["uri"] = json!("../../../../etc/passwd");
    }),
    ("version", "version 2", |root, _| set(root, "$/version", json!(2))),
];

#[test]
fn the_page_refuses_hostile_models_and_fetches_nothing() {
    let Some(chromium) = chromium() else {
        eprintln!("skipped: chromium or node is not installed (apt-get install chromium nodejs)");
        return;
    };
    let (_, model) = played().models.iter().find(|(method, _)| *method == Method::DynTex).expect("a model");
    let mut files = vec![
        ("cut in half", "cut off", model[..model.len() / 2].to_vec()),
        ("a byte short", "cut off", model[..model.len() - 1].to_vec()),
        ("empty", "cut off", Vec::new()),
        ("text", "no binary glTF", b"<html>a page that a server sends for every path</html>".to_vec()),
    ];
    for (name, word, change) in HOSTILE {
        let (mut root, mut body) = split(model);
        change(&mut root, &mut body);
        files.push((name, word, joined(&root, &body)));
    }
    let place = tempfile::tempdir().expect("a folder");
    let case = |(_, _, bytes): &(&str, &str, Vec<u8>)| json!({"url": serve(bytes.clone()), "output": place.path()});
    let cases: Vec<Value> = files.iter().map(case).collect();
    for (((name, word, bytes), case), report) in files.iter().zip(&cases).zip(play(&chromium, place.path(), &cases)) {
        let message = report["message"].as_str().unwrap_or_else(|| panic!("{name} is shown: {report}"));
        assert!(message.contains(word), "{name}: '{message}' does not say '{word}'");
        assert_quiet(name, case["url"].as_str().unwrap_or_default(), &report);
        assert!(Model::from_glb(bytes, Path::new("memory")).is_err(), "{name} is read here");
    }
}

#[test]
fn models_are_exported_whole_or_not_at_all() {
    let place = tempfile::tempdir().expect("a folder");
    let (_, model) = &played().models[0];
    std::fs::write(place.path().join("good.glb"), model).expect("written");
    std::fs::write(place.path().join("bad.glb"), &model[..model.len() / 2]).expect("written");
    let export = |file: &str, to: &str, folder: &str| {
        tests::turnlight(place.path(), &["export", file, "--to", to, "-o", folder, "--quiet"])
    };
    assert_eq!(export("good.glb", "web", "site").code, Some(0));
    let site = place.path().join("site");
    assert_eq!(std::fs::read(site.join("model.glb")).expect("a model"), *model);
    for file in ["index.html", "player.js", "style.css", "turnlight-loader.js", "vendor/three.min.js"] {
        assert!(site.join(file).is_file(), "{file}");
    }
    assert_eq!(export("good.glb", "obj", "mesh").code, Some(0));
    let mesh = geometry::mesh::io::read_mesh(place.path().join("mesh/model.obj")).expect("a mesh");
    let known = Model::from_glb(model, Path::new("memory")).expect("a model").mesh;
    assert_eq!(mesh.mesh.faces.len(), known.mesh.faces.len());
    let picture = read_rgb(&place.path().join("mesh/model.png")).expect("a picture");
    assert_eq!([picture.width(), picture.height()], known.atlas_size);
    let refused = export("bad.glb", "web", "broken");
    assert_eq!(refused.code, Some(1), "{}", refused.stderr);
    assert!(refused.stderr.contains("bad.glb"), "{}", refused.stderr);
    assert!(!place.path().join("broken").exists());
    std::fs::create_dir(place.path().join("mine")).expect("a folder");
    std::fs::write(place.path().join("mine/thesis.tex"), "x").expect("written");
    assert_eq!(export("good.glb", "web", "mine").code, Some(1));
}

#[test]
fn view_prints_an_address_and_serves_there() {
    let place = tempfile::tempdir().expect("a folder");
    std::fs::write(place.path().join("m.glb"), &played().models[0].1).expect("written");
    let mut command = Command::new(tests::command());
    let mut child = command
        .args(["view", "--web", "m.glb"])
        .current_dir(place.path())
        .stdout(Stdio::piped())
        .spawn()
        .expect("turnlight runs");
    let mut line = String::new();
    let out = child.stdout.take().expect("a pipe");
    BufReader::new(out).read_line(&mut line).expect("a line");
    let address = line.trim().strip_prefix("http://").and_then(|rest| rest.strip_suffix('/')).unwrap_or_default();
    let mut stream = TcpStream::connect(address).expect("a server");
    write!(stream, "GET / HTTP/1.1\r\nHost: {address}\r\n\r\n").expect("sent");
    let mut page = String::new();
    stream.read_to_string(&mut page).expect("an answer");
    child.kill().expect("ended");
    child.wait().expect("ended");
    assert!(page.starts_with("HTTP/1.1 200 OK") && page.contains("player.js"), "{page}");
}
