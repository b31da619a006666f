//! System packages, installed where they are missing.

use anyhow::{Result, bail};
use std::process::{Command, Stdio};

/// A program we need, and the Debian packages that bring it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Package {
    /// What shows that it is there: a command line that succeeds.
    probe: &'static [&'static str],
    /// Debian's names.
    names: &'static [&'static str],
}

/// Mesh simplification is C++.
pub(crate) const COMPILER: Package = Package { probe: &["c++", "--version"], names: &["g++"] };
/// Films and calibration: OpenCV's headers, and what reads them to make the bindings.
pub(crate) const OPENCV: Package =
    Package { probe: &["pkg-config", "--exists", "opencv4"], names: &["libopencv-dev", "pkg-config"] };
/// Runs while the bindings are made; its headers come with it.
pub(crate) const CLANG: Package = Package { probe: &["clang", "--version"], names: &["clang", "libclang-dev"] };
/// Runs the glTF validator, and drives the browser.
pub(crate) const NODE: Package = Package { probe: &["npm", "--version"], names: &["nodejs", "npm"] };
/// Plays exported models.
pub(crate) const CHROMIUM: Package = Package { probe: &["chromium", "--version"], names: &["chromium"] };
/// Stands in for graphics hardware.
pub(crate) const VULKAN: Package =
    Package { probe: &["sh", "-c", "ls /usr/share/vulkan/icd.d/lvp_icd*"], names: &["mesa-vulkan-drivers"] };
/// A screen in memory, and what a window asks of its keyboard.
pub(crate) const XVFB: Package = Package {
    probe: &["sh", "-c", "command -v Xvfb && ls /usr/lib/*/libxkbcommon-x11.so.0 /usr/lib/*/libXcursor.so.1"],
    names: &["xvfb", "libxkbcommon-x11-0", "libxcursor1", "libxi6", "libxrandr2"],
};
/// Runs the referee, and what we hand to Blender.
pub(crate) const PYTHON: Package =
    Package { probe: &["python3", "-c", "import ensurepip, venv"], names: &["python3", "python3-venv"] };
/// What Blender as a module wants of a screen, which it does not use.
pub(crate) const SCREEN: Package = Package {
    probe: &[
        "python3",
        "-c",
        "import ctypes; libraries = 'X11.so.6 Xrender.so.1 Xfixes.so.3 Xi.so.6 xkbcommon.so.0 SM.so.6 GL.so.1'; \
         [ctypes.CDLL('lib' + name) for name in libraries.split()]",
    ],
    names: &["libx11-6", "libxrender1", "libxfixes3", "libxi6", "libxkbcommon0", "libsm6", "libgl1"],
};

/// Installs what is missing of `packages`.
pub(crate) fn ensure(packages: &[Package]) -> Result<()> {
    let missing: Vec<&str> =
        packages.iter().filter(|package| !succeeds(package.probe)).flat_map(|p| p.names).copied().collect();
    if missing.is_empty() {
        return Ok(());
    }
    let names = missing.join(" ");
    if !succeeds(&["apt-get", "--version"]) {
        bail!("{names} missing, and there is no apt-get here; install them and run again");
    }
    eprintln!("xtask: installing {names}");
    // The lists of a fresh image are empty or stale.
    if !(apt(&["update", "-q"]) && apt(&[&["install", "-q", "-y", "--no-install-recommends"], &missing[..]].concat())) {
        bail!("apt-get could not install {names}; install them and run again");
    }
    Ok(())
}

fn apt(args: &[&str]) -> bool {
    let is_root = Command::new("id").arg("-u").output().is_ok_and(|id| id.stdout.trim_ascii() == b"0");
    let mut command = if is_root {
        Command::new("apt-get")
    } else {
        let mut sudo = Command::new("sudo");
        sudo.arg("apt-get");
        sudo
    };
    // Standard output belongs to the chore.
    command.args(args).env("DEBIAN_FRONTEND", "noninteractive").stdout(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

/// Whether a command line runs and reports success.
pub(crate) fn succeeds(line: &[&str]) -> bool {
    let Some((program, args)) = line.split_first() else { return false };
    let mut command = Command::new(program);
    command.args(args).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}
