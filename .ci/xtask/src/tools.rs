//! What the tests compare us with: the Khronos glTF validator, a browser, Blender, and Python for it and the referee.

use crate::packages::{self, Package, succeeds};
use crate::run;
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The validator's release our files are checked with.
const VALIDATOR: &str = "gltf-validator@2.0.0-dev.3.10";
/// The independent scorer of the image figures.
const REFEREE: &str = "../shared/referee.py";

/// A Python environment.
#[derive(Clone, Copy, Debug)]
struct Environment {
    /// Of the folder that is made where the system's Python lacks a module.
    name: &'static str,
    /// What it imports.
    modules: &'static str,
    /// What pip installs for that.
    packages: &'static [&'static str],
    /// What else it wants of the system.
    system: &'static [Package],
}

/// Reads what we hand to Blender, without it.
const NUMBERS: Environment = Environment { name: "numbers", modules: "numpy", packages: &["numpy"], system: &[] };
/// Runs the referee too.
const REFEREE_PYTHON: Environment = Environment {
    name: "python",
    modules: "numpy, PIL, skimage",
    packages: &["numpy", "pillow", "scikit-image"],
    system: &[],
};
/// Blender as a module; pip takes the release for the Python that is there.
const BLENDER: Environment =
    Environment { name: "blender", modules: "bpy", packages: &["bpy"], system: &[packages::SCREEN] };

/// Installs the tools and says where they are, as environment variables of the tests. A tool that
/// cannot be had is named, and its tests skip; so they do without Blender, unless it is asked for.
pub(crate) fn prepare(root: &Path, with_blender: bool) -> Vec<(&'static str, PathBuf)> {
    let tools = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), PathBuf::from).join("tools");
    let mut found = vec![
        ("TURNLIGHT_GLTF_VALIDATOR", "the glTF validator", validator(&tools)),
        ("TURNLIGHT_CHROMIUM", "Chromium", chromium()),
    ];
    // The referee is no part of the project.
    let python_for = if root.join(REFEREE).exists() { REFEREE_PYTHON } else { NUMBERS };
    found.push(("TURNLIGHT_PYTHON", "Python with numpy", python(&tools, python_for)));
    if with_blender {
        found.push(("TURNLIGHT_BPY", "Blender", python(&tools, BLENDER)));
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

/// A Python that has the modules: the system's, else one of our own.
fn python(tools: &Path, environment: Environment) -> Result<PathBuf> {
    let import = format!("import {}", environment.modules);
    let is_ready = |python: &Path| succeeds(&[&python.to_string_lossy(), "-c", &import]);
    let system = PathBuf::from("python3");
    if is_ready(&system) {
        return Ok(system);
    }
    let folder = tools.join(environment.name);
    let python = folder.join("bin").join("python3");
    if !is_ready(&python) {
        packages::ensure(&[&[packages::PYTHON], environment.system].concat())?;
        run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
        run(Command::new(&python).args(["-m", "pip", "install", "--quiet"]).args(environment.packages))?;
    }
    Ok(python)
}
