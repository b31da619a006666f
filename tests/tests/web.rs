//! The browser player: what it shows is what our renderer draws, and it refuses what is no model.
//!
//! Chromium and node play the pages headless (`render/web/test`); where either is missing the test skips, saying so.

use capture::btf::{Btf, Encoding};
use capture::read_rgb;
use nalgebra::Vector3;
use serde_json::{Value, json};
use std::f32::consts::PI;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tests::hostile::{Hostile, coated_twice, hostile};
use tests::played::{COMPARED, Played, SHARE, agreement, frame, played};
use texture::btf::multilevel_vq::Variant;
use texture::btf::{self, Budget, CodecKind, Precision};
use texture::{MaterialLayer, Method, Model};
use turnlight::export::web::Site;
use turnlight::playback;
use turnlight::serve::Server;

/// Frames of which the median time is printed.
const FRAMES: usize = 20;

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

/// A model with matt red paint, measured under few directions, on every other chart.
fn coated(glb: &[u8]) -> Model {
    let polar = |k: usize| Vector3::new((0.3 * k as f64).sin(), 0.0, (0.3 * k as f64).cos());
    let directions: Vec<Vector3<f64>> = (0..4).map(polar).collect();
    let lit = |light: &Vector3<f64>| [0.8, 0.2, 0.1].map(|albedo| albedo * light.z as f32).repeat(4);
    let btf = Btf {
        name: "paint".to_owned(),
        samples: directions.iter().flat_map(|_| directions.iter().flat_map(lit)).collect(),
        views: directions.clone(),
        lights: directions,
        width: 2,
        height: 2,
        encoding: Encoding::Linear,
        exposure: PI,
        includes_cosine: true,
        texel_pitch_mm: None,
        measured: Vec::new(),
    };
    let (codec, budget) = (CodecKind::Ptm, Budget::Standard);
    let options = btf::FitOptions { codec, budget, precision: Precision::Full, seed: 1, books: Variant::default() };
    let (bytes, _) = btf::fit(btf.encoded(Encoding::Srgb), &options).expect("a fit").0.to_bytes();
    let mut model = Model::from_glb(glb, Path::new("memory")).expect("a model");
    let charts = (0..model.number_charts() as u32).step_by(2).collect();
    model.lay(vec![MaterialLayer::new(charts, 0.5, bytes).expect("a layer")]).expect("charts");
    model
}

#[test]
fn materials_are_painted_on_and_the_rest_plays() {
    let Some(chromium) = chromium() else {
        eprintln!("skipped: chromium or node is not installed (apt-get install chromium nodejs)");
        return;
    };
    let place = tempfile::tempdir().expect("a folder");
    let model = coated(played().model(Method::DynTex));
    let camera = &played().cameras[COMPARED[0]];
    let url = serve(model.to_glb().expect("a file"));
    let case = json!({"url": url, "output": place.path(), "cameras": [frame(camera)]});
    let report = play(&chromium, place.path(), &[case]).remove(0);
    assert_eq!((&report["state"]["isPlaying"], &report["message"]), (&json!(true), &Value::Null), "{report}");
    assert!(report["notice"].as_str().is_some_and(|notice| notice.contains("painted on")), "{report}");
    let mut player = playback::player(&model);
    let [live, still] = [model.atlas(&camera.center()), model.still()].map(|atlas| player.render(&atlas, camera));
    let theirs = read_rgb(&place.path().join("0000.png")).expect("a picture");
    let is_near = |ours: &[u8; 4], theirs: &[u8; 3]| (0..3).all(|c| ours[c].abs_diff(theirs[c]) <= 2);
    // Whether a pixel of the object is as it plays, and as it is painted.
    let near = |x: usize, y: usize| {
        let (l, s, theirs) = (live.at(x, y), still.at(x, y), theirs.at(x, y));
        (l[3] == 255).then(|| [is_near(&l, &theirs), is_near(&s, &theirs)])
    };
    // Where the two meet, filters of one texture read what the other does not show; so do they at the outline.
    let is_seam = |x: usize, y: usize| {
        let around = || (x - 1..=x + 1).flat_map(|x| (y - 1..=y + 1).map(move |y| near(x, y)));
        around().any(|p| p.is_none())
            || (around().any(|p| p == Some([true, false])) && around().any(|p| p == Some([false, true])))
    };
    let (width, height) = (live.width(), live.height());
    let inside = (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| (x, y)));
    let found: Vec<[bool; 2]> =
        inside.filter(|&(x, y)| near(x, y).is_some() && !is_seam(x, y)).filter_map(|(x, y)| near(x, y)).collect();
    let share = |of: [bool; 2]| found.iter().filter(|near| **near == of).count() as f64 / found.len() as f64;
    let (live, still, neither) = (share([true, false]), share([false, true]), share([false; 2]));
    // What is painted has the browser's own mip levels.
    assert!(live > 0.2 && still > 0.2 && neither < 0.02, "{live} play, {still} are painted, {neither} are neither");
}

#[test]
fn the_page_refuses_hostile_models_and_fetches_nothing() {
    let Some(chromium) = chromium() else {
        eprintln!("skipped: chromium or node is not installed (apt-get install chromium nodejs)");
        return;
    };
    let model = played().model(Method::DynTex);
    let files = [hostile(model), vec![coated_twice(model)]].concat();
    let place = tempfile::tempdir().expect("a folder");
    let case = |file: &Hostile| json!({"url": serve(file.bytes.clone()), "output": place.path()});
    let cases: Vec<Value> = files.iter().map(case).collect();
    for ((Hostile { name, word, bytes }, case), report) in
        files.iter().zip(&cases).zip(play(&chromium, place.path(), &cases))
    {
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
