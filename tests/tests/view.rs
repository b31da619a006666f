//! What a window shows: the pictures `render` draws, side by side, held against photographs, and on the screen itself.

use capture::{Camera, Capture, Image, read_rgb};
use render::material::Coats;
use render::path::TURN_FRAMES;
use std::path::Path;
use std::sync::OnceLock;
use tests::hostile::{Hostile, hostile};
use tests::played::played;
use tests::{small_capture, turnlight};
use texture::{Method, Model};
use turnlight::scene::Scene;
use turnlight::viewer::false_colour::of_facet;
use turnlight::viewer::{BACKGROUND, Exhibit, Lamp, Side, Viewer, ViewerOptions};

const SIZE: [usize; 2] = [320, 240];

/// The four methods, made once.
fn exhibits() -> &'static [Exhibit] {
    static EXHIBITS: OnceLock<Vec<Exhibit>> = OnceLock::new();
    EXHIBITS.get_or_init(|| {
        let exhibit = |(method, glb): &(Method, Vec<u8>)| {
            let model = Model::from_glb(glb, Path::new("memory")).expect("a model");
            Exhibit::new(method.name().to_owned(), Scene::of(model))
        };
        played().models.iter().map(exhibit).collect()
    })
}

/// None of our exhibits has materials.
fn bare() -> &'static [Vec<Option<Coats<'static>>>] {
    static BARE: OnceLock<Vec<Vec<Option<Coats<'static>>>>> = OnceLock::new();
    BARE.get_or_init(|| exhibits().iter().map(|_| vec![None]).collect())
}

fn viewer(capture: Option<Capture>) -> Viewer<'static> {
    Viewer::new(exhibits(), bare(), ViewerOptions { capture, ..ViewerOptions::default() }).expect("a viewer")
}

/// The share of pixels that are further apart than a level.
fn apart(a: &Image<[u8; 3]>, b: &Image<[u8; 3]>) -> f64 {
    assert_eq!((a.width(), a.height()), (b.width(), b.height()));
    let differs = |(p, q): (&[u8; 3], &[u8; 3])| (0..3).any(|c| p[c].abs_diff(q[c]) > 1);
    let count = a.pixels().iter().zip(b.pixels()).filter(|pair| differs(*pair)).count();
    count as f64 / a.pixels().len() as f64
}

fn opaque(frame: &Image<[u8; 4]>) -> Image<[u8; 3]> {
    assert!(frame.pixels().iter().all(|p| p[3] == 255), "the picture is transparent somewhere");
    frame.map(|[r, g, b, _]| [r, g, b])
}

fn columns(image: &Image<[u8; 3]>, columns: std::ops::Range<usize>) -> Image<[u8; 3]> {
    let pixels = (0..image.height()).flat_map(|y| image.row(y)[columns.clone()].to_vec()).collect();
    Image::from_pixels(columns.len(), image.height(), pixels).expect("pixels")
}

/// What `render` writes for the first view of a turn.
fn rendered(place: &Path, model: &str, size: [usize; 2]) -> Image<[u8; 3]> {
    let (size, turn) = (format!("{}x{}", size[0], size[1]), TURN_FRAMES.to_string());
    let background = BACKGROUND.map(|level| level.to_string()).join(",");
    let args = [
        "render",
        model,
        "--turntable",
        &turn,
        "--size",
        &size,
        "--background",
        &background,
        "-o",
        "frames",
        "--quiet",
    ];
    let run = turnlight(place, &args);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    read_rgb(&place.join("frames/0000.png")).expect("a picture")
}

#[test]
fn the_first_picture_is_the_first_that_render_draws_of_a_turn() {
    let place = tempfile::tempdir().expect("a folder");
    let mut viewer = viewer(None);
    for (k, (method, glb)) in played().models.iter().enumerate() {
        std::fs::write(place.path().join("m.glb"), glb).expect("written");
        viewer.left = Side::Method(k);
        let share = apart(&opaque(&viewer.frame(SIZE)), &rendered(place.path(), "m.glb", SIZE));
        assert!(share < 0.001, "{}: {share} of the pixels are apart", method.name());
    }
}

#[test]
fn a_split_picture_is_two_pictures_of_one_frame() {
    let mut viewer = viewer(None);
    let whole = |viewer: &mut Viewer<'_>, side: Side| {
        (viewer.left, viewer.right) = (side, None);
        opaque(&viewer.frame(SIZE))
    };
    for sides in [[Side::Method(3), Side::Method(1)], [Side::Facets(3), Side::Ranks(0)]] {
        let [left, right] = sides.map(|side| whole(&mut viewer, side));
        assert!(apart(&left, &right) > 0.01, "nothing tells {sides:?} apart");
        for divider in [0.3, 0.5] {
            (viewer.left, viewer.right, viewer.divider) = (sides[0], Some(sides[1]), divider);
            let split = opaque(&viewer.frame(SIZE));
            let at = (divider * SIZE[0] as f64).round() as usize;
            assert!(apart(&columns(&split, 0..at), &columns(&left, 0..at)) < 0.001);
            assert!(apart(&columns(&split, at..SIZE[0]), &columns(&right, at..SIZE[0])) < 0.001);
        }
    }
}

#[test]
fn at_its_place_a_photograph_is_itself_and_the_model_near_it() {
    let place = tempfile::tempdir().expect("a folder");
    let capture = Capture::read(&small_capture(place.path(), 8)).expect("a capture");
    let frames = capture.frames.clone();
    let mut viewer = viewer(Some(capture));
    viewer.left = Side::Photograph;
    for k in [0, 5] {
        viewer.visit(k);
        let i = &frames[k].camera.intrinsics;
        let photograph = read_rgb(&frames[k].image_path).expect("a picture");
        assert_eq!(opaque(&viewer.frame([i.width, i.height])), photograph);
        // The table of another fit of the same object: what matters is that the object is compared, not the cloth.
        let (_, found) = viewer.difference(3, &frames[k].camera).expect("an object").expect("a photograph");
        assert!(found.pixels > 200 && found.mean_pct < 12.0, "{} pixels, {} %", found.pixels, found.mean_pct);
        assert!(found.mean_pct <= found.rms_pct);
    }
    // At 5, still: a picture from elsewhere takes the photograph from there.
    for frame in &frames {
        let photograph = read_rgb(&frame.image_path).expect("a picture");
        assert_eq!(opaque(&viewer.frame_of(&frame.camera)), photograph);
    }
    viewer.steer().pan([3.0, 0.0], SIZE);
    assert_eq!(viewer.visited(), None);
    let file = frames[5].image_path.clone();
    let bytes = std::fs::read(&file).expect("a file");
    std::fs::remove_file(&file).expect("removed");
    let mut fresh =
        self::viewer(Some(Capture { frames, ..Capture::read(&place.path().join("capture")).expect("one") }));
    fresh.visit(5);
    fresh.left = Side::Photograph;
    let is_empty = |viewer: &mut Viewer<'_>| viewer.frame(SIZE).pixels().iter().all(|p| p[..3] == BACKGROUND);
    assert!(is_empty(&mut fresh));
    assert!(fresh.take_notes().iter().any(|note| note.contains("check")), "nothing says why");
    std::fs::write(&file, bytes).expect("written");
    assert!(is_empty(&mut fresh), "it is tried at every frame");
    fresh.visit(4);
    assert!(!is_empty(&mut fresh));
    fresh.visit(5);
    assert!(!is_empty(&mut fresh), "it is never tried again");
}

#[test]
fn a_click_chooses_the_facet_that_is_painted_there() {
    let mut viewer = viewer(None);
    for k in [0, 3] {
        viewer.left = Side::Facets(k);
        let painted = viewer.frame(SIZE);
        let (mut hits, mut agree) = (0, 0);
        for (x, y) in (0..SIZE[1]).step_by(7).flat_map(|y| (0..SIZE[0]).step_by(7).map(move |x| (x, y))) {
            let is_object = painted.at(x, y)[..3] != BACKGROUND;
            let is_hit = viewer.pick([x as f64 + 0.5, y as f64 + 0.5], SIZE);
            let chosen = viewer.picked(k).expect("the middle of the picture at least");
            if is_hit && is_object {
                hits += 1;
                let colour = of_facet(chosen.facet);
                agree += usize::from((0..3).all(|c| painted.at(x, y)[c].abs_diff(colour[c]) <= 3));
            }
        }
        // Between facets colours mix.
        assert!(hits > 100 && agree * 10 > hits * 8, "{agree} of {hits} agree");
    }
}

#[test]
fn a_picture_is_drawn_again_when_something_changed() {
    let mut viewer = viewer(None);
    assert!(viewer.frame_if_changed(SIZE).is_some());
    assert!(viewer.frame_if_changed(SIZE).is_none());
    let changes: [fn(&mut Viewer<'_>); 5] = [
        |viewer| viewer.left = Side::Method(1),
        |viewer| viewer.right = Some(Side::Ranks(2)),
        |viewer| viewer.divider = 0.4,
        |viewer| viewer.lamp = Lamp::Fixed { azimuth_deg: 10.0, elevation_deg: 20.0 },
        |viewer| viewer.steer().drag([5.0, 2.0], 240, 0.01),
    ];
    for (k, change) in changes.into_iter().enumerate() {
        change(&mut viewer);
        assert!(viewer.frame_if_changed(SIZE).is_some(), "change {k} changes nothing");
        assert!(viewer.frame_if_changed(SIZE).is_none(), "change {k} does not rest");
    }
    assert!(viewer.frame_if_changed([200, 100]).is_some());
}

#[test]
fn held_weights_change_their_facet_alone_until_they_are_let_go() {
    let mut viewer = viewer(None);
    let k = 3;
    viewer.left = Side::Method(k);
    let picked = viewer.picked(k).expect("a facet");
    let hold = |facet, weight: f64| render::blend::Pin { facet, layer: 0, weight: weight as f32 };
    // What the eye asks for anyway changes nothing; in a narrow frame it is farther off.
    for size in [[400, 800], SIZE] {
        let before = viewer.frame(size);
        let weights = viewer.coefficients(k, &viewer.camera(size)).expect("layers");
        viewer.pin(k, picked.object, hold(Some(picked.facet), weights[0].asked));
        assert_eq!(viewer.frame(size), before);
        viewer.unpin(k);
    }
    let before = viewer.frame(SIZE);
    viewer.pin(k, picked.object, hold(Some(picked.facet), 0.0));
    let one = viewer.frame(SIZE);
    viewer.pin(k, picked.object, hold(None, 0.0));
    let all = viewer.frame(SIZE);
    let changed = |frame: &Image<[u8; 4]>| frame.pixels().iter().zip(before.pixels()).filter(|(a, b)| a != b).count();
    assert!(changed(&one) > 20 && changed(&all) > 5 * changed(&one), "{} {}", changed(&one), changed(&all));
    viewer.unpin(k);
    assert_eq!(viewer.frame(SIZE), before);
}

#[test]
fn the_eye_lies_in_the_dome_among_the_directions_it_is_blended_of() {
    let viewer = viewer(None);
    let camera = viewer.camera([400, 800]);
    for k in 0..exhibits().len() {
        let dome = viewer.dome(k, &camera).expect("a facet");
        let sum: f64 = dome.shares.iter().map(|(_, share)| share).sum();
        let name = exhibits()[k].name.as_str();
        let is_lumigraph = name == "lumigraph";
        assert_eq!(dome.sites.is_empty(), name == "static", "{name}");
        match name {
            "static" | "lumigraph" => assert!(dome.shares.is_empty(), "{name}"),
            _ => assert!((sum - 1.0).abs() < 1e-6, "{name}: {sum}"),
        }
        assert!(viewer.coefficients(k, &camera).is_none() == is_lumigraph);
    }
}

#[test]
fn hostile_models_are_refused_before_a_window_opens() {
    let place = tempfile::tempdir().expect("a folder");
    for Hostile { name, bytes, .. } in hostile(played().model(Method::DynTex)) {
        std::fs::write(place.path().join("bad.glb"), bytes).expect("written");
        let run = turnlight(place.path(), &["view", "bad.glb"]);
        assert!(run.stdout.is_empty(), "{name}: {}", run.stdout);
        if cfg!(feature = "window") {
            assert_eq!(run.code, Some(1), "{name}: {}", run.stderr);
            assert!(run.stderr.contains("bad.glb"), "{name}: {}", run.stderr);
        } else {
            assert_eq!(run.code, Some(2), "{name}: {}", run.stderr);
            assert!(run.stderr.contains("--web") && run.stderr.contains("--features window"), "{}", run.stderr);
        }
    }
}

#[cfg(all(target_os = "linux", feature = "window"))]
mod on_a_screen {
    use super::*;
    use std::fs;
    use std::io::{BufRead, BufReader};
    use std::process::{Child, Command, Stdio};
    use std::time::{Duration, Instant};

    /// A screen in memory, as large as the window, and what is on it.
    struct Screen {
        server: Child,
        display: String,
        folder: tempfile::TempDir,
    }

    impl Screen {
        /// `None` where Xvfb or a Vulkan driver is not installed.
        fn open([width, height]: [usize; 2]) -> Option<Self> {
            fs::read_dir("/usr/share/vulkan/icd.d").ok()?.next()?.ok()?;
            let folder = tempfile::tempdir().expect("a folder");
            let size = format!("{width}x{height}x24");
            let mut server = Command::new("Xvfb")
                .args(["-displayfd", "1", "-screen", "0", &size, "-nolisten", "tcp", "-fbdir"])
                .arg(folder.path())
                .stdout(Stdio::piped())
                .stderr(Stdio::null())
                .spawn()
                .ok()?;
            let mut line = String::new();
            BufReader::new(server.stdout.take().expect("a pipe")).read_line(&mut line).expect("a display");
            Some(Self { server, display: format!(":{}", line.trim()), folder })
        }

        fn view(&self, place: &Path, args: &[&str]) -> Command {
            let mut command = Command::new(tests::command());
            command.arg("view").args(args).current_dir(place).env("DISPLAY", &self.display);
            command.env_remove("WAYLAND_DISPLAY").env("XDG_RUNTIME_DIR", self.folder.path());
            command
        }

        /// What is on the screen, as Xvfb keeps it: an X window dump (XWDFile.h), of 32 bits a pixel.
        fn picture(&self) -> Option<Image<[u8; 3]>> {
            let dump = fs::read(self.folder.path().join("Xvfb_screen0")).ok()?;
            let word =
                |k: usize| dump.get(4 * k..4 * k + 4).map(|b| u32::from_be_bytes([b[0], b[1], b[2], b[3]]) as usize);
            let (width, height, stride) = (word(4)?, word(5)?, word(12)?);
            let pixels = dump.get(word(0)? + 12 * word(19)?..)?;
            let row = |y: usize| pixels.get(y * stride..y * stride + 4 * width);
            let rows = (0..height).map(row).collect::<Option<Vec<_>>>()?;
            let rgb = rows.iter().flat_map(|row| row.chunks_exact(4).map(|p| [p[2], p[1], p[0]])).collect();
            Image::from_pixels(width, height, rgb)
        }
    }

    impl Drop for Screen {
        fn drop(&mut self) {
            // It may have gone by itself.
            let _ = self.server.kill();
            let _ = self.server.wait();
        }
    }

    #[test]
    fn the_screen_holds_the_picture_byte_for_byte() {
        const SCREEN: [usize; 2] = [400, 300];
        let Some(screen) = Screen::open(SCREEN) else {
            eprintln!("skipped: Xvfb or a Vulkan driver is not installed (apt-get install xvfb mesa-vulkan-drivers)");
            return;
        };
        let place = tempfile::tempdir().expect("a folder");
        fs::write(place.path().join("m.glb"), played().model(Method::DynTex)).expect("written");
        let known = rendered(place.path(), "m.glb", SCREEN);
        let args = ["m.glb", "--size", "400x300", "--panels", "none"];
        let shot =
            screen.view(place.path(), &[&args[..], &["--screenshot", "shot.png"]].concat()).output().expect("runs");
        assert!(shot.status.success(), "{}", String::from_utf8_lossy(&shot.stderr));
        let taken = read_rgb(&place.path().join("shot.png")).expect("a picture");
        assert!(apart(&taken, &known) < 0.001);
        let mut window = screen.view(place.path(), &args).stderr(Stdio::null()).spawn().expect("turnlight runs");
        let start = Instant::now();
        let is_there = || screen.picture().is_some_and(|picture| picture == taken);
        // A slow machine is no fault.
        while !is_there() && start.elapsed() < Duration::from_secs(60) {
            std::thread::sleep(Duration::from_millis(100));
        }
        let outcome = is_there();
        window.kill().expect("ended");
        window.wait().expect("ended");
        assert!(outcome, "the screen holds another picture");
    }

    #[test]
    fn without_a_screen_the_command_says_what_else_there_is() {
        let place = tempfile::tempdir().expect("a folder");
        fs::write(place.path().join("m.glb"), played().model(Method::Static)).expect("written");
        for display in [None, Some(":9999")] {
            let mut command = Command::new(tests::command());
            command
                .args(["view", "m.glb"])
                .current_dir(place.path())
                .env_remove("DISPLAY")
                .env_remove("WAYLAND_DISPLAY");
            command.env_remove("WAYLAND_SOCKET").envs(display.map(|display| ("DISPLAY", display)));
            let run = command.output().expect("turnlight runs");
            let said = String::from_utf8_lossy(&run.stderr);
            assert_eq!(run.status.code(), Some(1), "{said}");
            assert!(
                said.contains("--web") && said.contains("turnlight render") && !said.contains("panicked"),
                "{said}"
            );
        }
    }
}

#[test]
fn several_files_become_methods_by_name() {
    let place = tempfile::tempdir().expect("a folder");
    let paths: Vec<_> = ["a.glb", "b.glb"].iter().map(|name| place.path().join(name)).collect();
    std::fs::write(&paths[0], played().model(Method::Static)).expect("written");
    std::fs::write(&paths[1], played().model(Method::Vdtm)).expect("written");
    let names = |paths: &[std::path::PathBuf]| -> Vec<String> {
        Exhibit::read_all(paths).expect("models").into_iter().map(|exhibit| exhibit.name).collect()
    };
    assert_eq!(names(&paths), ["static", "vdtm"]);
    assert_eq!(names(&[paths[0].clone(), paths[0].clone()]), ["a", "a"]);
    let camera: Camera = viewer(None).camera(SIZE);
    assert_eq!([camera.intrinsics.width, camera.intrinsics.height], SIZE);
}
