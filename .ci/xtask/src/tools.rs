//! What the tests compare us with: the Khronos glTF validator, a browser, and Python for the referee.

use crate::packages::{self, succeeds};
use crate::run;
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The validator's release our files are checked with.
const VALIDATOR: &str = "gltf-validator@2.0.0-dev.3.10";
/// The independent scorer of the image figures.
const REFEREE: &str = "../shared/referee.py";
/// What it imports.
const MODULES: &str = "import numpy, PIL, skimage";

/// Installs the tools and says where they are, as environment variables of the tests. A tool that
/// cannot be had is named, and its tests skip.
pub(crate) fn prepare(root: &Path) -> Vec<(&'static str, PathBuf)> {
    let tools = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), PathBuf::from).join("tools");
    let mut found = vec![
        ("TURNLIGHT_GLTF_VALIDATOR", "the glTF validator", validator(&tools)),
        ("TURNLIGHT_CHROMIUM", "Chromium", chromium()),
    ];
    // The referee is no part of the project: Python is wanted only where it lies beside it.
    if root.join(REFEREE).exists() {
        found.push(("TURNLIGHT_PYTHON", "Python with numpy, Pillow and scikit-image", python(&tools)));
    }
    let mut variables = Vec::new();
    for (variable, what, place) in found {
        match place {
            Ok(place) => variables.push((variable, place)),
            Err(fault) => eprintln!("xtask: {what} is not to be had ({fault:#}); the tests that need it skip"),
        }
    }
    variables
}

/// The folder of the validator's npm module.
fn validator(tools: &Path) -> Result<PathBuf> {
    let folder = tools.join("gltf-validator");
    let module = folder.join("node_modules").join("gltf-validator");
    if !module.join("package.json").exists() {
        packages::ensure(&[packages::NODE])?;
        std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
        let mut npm = Command::new("npm");
        npm.args(["install", "--silent", "--no-audit", "--no-fund", "--no-save", "--prefix"]).arg(&folder);
        run(npm.arg(VALIDATOR))?;
    }
    Ok(module)
}

/// A browser that needs no screen.
fn chromium() -> Result<PathBuf> {
    packages::ensure(&[packages::NODE, packages::CHROMIUM])?;
    Ok("chromium".into())
}

/// A Python that can run the referee: the system's if it has the modules, else one of our own.
fn python(tools: &Path) -> Result<PathBuf> {
    if succeeds(&["python3", "-c", MODULES]) {
        return Ok("python3".into());
    }
    let folder = tools.join("python");
    let python = folder.join("bin").join("python3");
    let is_ready = |python: &Path| succeeds(&[&python.to_string_lossy(), "-c", MODULES]);
    if !is_ready(&python) {
        packages::ensure(&[packages::PYTHON])?;
        run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
        let pip = ["-m", "pip", "install", "--quiet", "numpy", "pillow", "scikit-image"];
        run(Command::new(&python).args(pip))?;
    }
    Ok(python)
}
