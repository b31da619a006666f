//! Chores, run as `cargo xtask demo`, `cargo xtask test` and `cargo xtask lint`.
//!
//! All bring what they need: system packages through `apt-get` where it exists, and for the tests a
//! browser, and a glTF validator and Python environments below `target/tools`. What cannot be brought is said, and
//! the tests that wanted it skip, saying so. Blender is a gigabyte on disk and comes only when asked for.

mod packages;
mod tools;

use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

const USAGE: &str = "usage: cargo xtask demo [ARGS] | test [--blender] [ARGS] | lint [ARGS]
  demo   build turnlight and run its demo; ARGS go to `turnlight demo`
  lint   run clippy over all of it, and over the default build; ARGS go to `cargo clippy`
  test   run the whole test suite, and that of the default build, with --blender in Blender too (374 MB once); ARGS go to `cargo test`";

/// Asks for the tests in Blender.
const BLENDER: &str = "--blender";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let outcome = match args.split_first() {
        Some((chore, rest)) if chore == "demo" => demo(rest),
        Some((chore, rest)) if chore == "lint" => lint(rest),
        Some((chore, rest)) if chore == "test" => test(rest),
        _ => {
            eprintln!("{USAGE}");
            return ExitCode::from(2);
        }
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Builds the command alone, and runs its demo in the current folder.
fn demo(args: &[String]) -> Result<()> {
    packages::ensure(&[packages::COMPILER])?;
    let root = root()?;
    run(cargo(&root).args(["run", "--release", "--package", "turnlight", "--", "demo"]).args(args))
}

/// Runs every test of the workspace, with films where OpenCV is to be had; where nothing narrower is asked for, then those
/// of the command as it is built by default.
fn test(args: &[String]) -> Result<()> {
    packages::ensure(&[packages::COMPILER])?;
    let root = root()?;
    if let Err(fault) = packages::ensure(&[packages::VULKAN]) {
        eprintln!("xtask: a Vulkan driver is not to be had ({fault:#}); where there is no other, its tests skip");
    }
    if let Err(fault) = packages::ensure(&[packages::XVFB]) {
        eprintln!("xtask: Xvfb is not to be had ({fault:#}); the test of what is on the screen skips");
    }
    let (with_blender, args) = match args.split_first() {
        Some((first, rest)) if first == BLENDER => (true, rest),
        _ => (false, args),
    };
    let tools = tools::prepare(&root, with_blender);
    run(cargo(&root).args(["test", "--workspace"]).args(features()).args(args).envs(tools))?;
    if args.is_empty() { run(cargo(&root).args(["test", "--package", "turnlight"])) } else { Ok(()) }
}

/// Runs the linter over every target, as the tests build them, then over the command as it is built by default.
fn lint(args: &[String]) -> Result<()> {
    packages::ensure(&[packages::COMPILER])?;
    let root = root()?;
    let lint = |what: &[&str], features: &[&str]| {
        let clippy = ["clippy", "--all-targets"];
        run(cargo(&root).args(clippy).args(what).args(features).args(args).args(["--", "-D", "warnings"]))
    };
    lint(&["--workspace"], features())?;
    lint(&["--package", "turnlight"], &[])
}

/// What to build besides the default.
fn features() -> &'static [&'static str] {
    match packages::ensure(&[packages::OPENCV, packages::CLANG]) {
        Ok(()) => &["--features", "tests/window,tests/video"],
        Err(fault) => {
            eprintln!("xtask: OpenCV is not to be had ({fault:#}); films are neither built nor tested");
            &["--features", "tests/window"]
        }
    }
}

fn cargo(root: &Path) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root);
    command
}

/// The workspace's folder: two above this crate's.
fn root() -> Result<PathBuf> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.ancestors().nth(2).map(Path::to_path_buf).context("this crate does not lie in .ci/xtask")
}

/// Runs a command to its end.
fn run(command: &mut Command) -> Result<()> {
    let name = command.get_program().to_string_lossy().into_owned();
    let status = command.status().with_context(|| format!("{name} cannot be started"))?;
    if !status.success() {
        bail!("{name} failed ({status})");
    }
    Ok(())
}
