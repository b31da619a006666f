//! What the whole-pipeline tests share: the command, captures and models to break, and where real data lies.

pub mod cartoon;
pub mod hostile;
pub mod played;

use capture::Image;
use data_synth::{Effort, Scene, SynthOptions, synthesize};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Intersection over union of two silhouettes of one size, object from 128 on; 0 where both are empty.
pub fn iou(a: &Image<u8>, b: &Image<u8>) -> f64 {
    let both = a.pixels().iter().zip(b.pixels()).map(|(&a, &b)| (a >= 128, b >= 128));
    let (and, or) = both.fold((0, 0), |(and, or), (a, b)| (and + usize::from(a && b), or + usize::from(a || b)));
    and as f64 / or.max(1) as f64
}

/// A run of the `turnlight` command.
#[derive(Debug)]
pub struct Run {
    /// Its exit code, `None` where a signal ended it.
    pub code: Option<i32>,
    /// What it printed on standard output.
    pub stdout: String,
    /// What it printed on standard error.
    pub stderr: String,
}

/// Runs `turnlight` with `args`, in `folder`.
///
/// # Panics
/// Where the command cannot be started.
pub fn turnlight(folder: &Path, args: &[&str]) -> Run {
    let output = Command::new(command()).args(args).current_dir(folder).output();
    let Output { status, stdout, stderr } = output.unwrap_or_else(|e| panic!("turnlight cannot be started: {e}"));
    Run {
        code: status.code(),
        stdout: String::from_utf8_lossy(&stdout).into_owned(),
        stderr: String::from_utf8_lossy(&stderr).into_owned(),
    }
}

/// The command, built once by the cargo that runs the tests: a test crate does not get the programs of
/// its dependencies built.
///
/// # Panics
/// Where it cannot be built.
pub fn command() -> &'static Path {
    static COMMAND: std::sync::OnceLock<PathBuf> = std::sync::OnceLock::new();
    COMMAND.get_or_init(build)
}

fn build() -> PathBuf {
    let here = std::env::current_exe().unwrap_or_else(|e| panic!("the test does not know where it is: {e}"));
    // target/PROFILE/deps/test-hash
    let profile = here.ancestors().nth(2).unwrap_or_else(|| panic!("{} is in no target folder", here.display()));
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["build", "--quiet", "--package", "turnlight", "--bin", "turnlight"]);
    let features =
        [("gpu", cfg!(feature = "gpu")), ("video", cfg!(feature = "video")), ("window", cfg!(feature = "window"))];
    for (feature, is_on) in features {
        if is_on {
            cargo.args(["--features", feature]);
        }
    }
    if profile.ends_with("release") {
        cargo.arg("--release");
    }
    cargo.current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    if let Some(target) = profile.parent() {
        cargo.env("CARGO_TARGET_DIR", target);
    }
    let status = cargo.status().unwrap_or_else(|e| panic!("cargo cannot be started: {e}"));
    assert!(status.success(), "turnlight does not build");
    profile.join(if cfg!(windows) { "turnlight.exe" } else { "turnlight" })
}

/// Writes a small synthetic capture to `folder/capture` and returns its path.
///
/// # Panics
/// Where it cannot be made.
pub fn small_capture(folder: &Path, views: usize) -> PathBuf {
    let options = SynthOptions {
        views,
        width: 96,
        height: 72,
        effort: Effort::Samples(2),
        surfaces: 1,
        ..SynthOptions::default()
    };
    let path = folder.join("capture");
    let filmed = synthesize(Scene::Temple, &options).unwrap_or_else(|e| panic!("{e}"));
    filmed.write(&path).unwrap_or_else(|e| panic!("{e}"));
    path
}

/// Real captures, where they lie beside the project.
pub fn real_data() -> Option<PathBuf> {
    beside("shared/data")
}

/// The independent scorer, where it lies beside the project, and a Python that can run it.
pub fn referee() -> Option<(PathBuf, PathBuf)> {
    let python = std::env::var_os("TURNLIGHT_PYTHON").map_or_else(|| "python3".into(), PathBuf::from);
    let imports = Command::new(&python).args(["-c", "import numpy, PIL, skimage"]).output();
    imports.is_ok_and(|output| output.status.success()).then_some(())?;
    Some((python, beside("shared/referee.py")?))
}

fn beside(what: &str) -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join(what);
    path.exists().then_some(path)
}
