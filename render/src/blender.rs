//! The add-on of Blender: a Python package that imports models and plays them for the camera.
//!
//! `render/blender` holds the files; here they are part of the program, so that an exported folder needs
//! nothing else.

/// A file of the add-on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AddOnFile {
    /// Where it lies in the archive that Blender installs, with `/` between parts.
    pub path: &'static str,
    /// What it holds.
    pub bytes: &'static [u8],
}

macro_rules! files {
    ($($name:literal),* $(,)?) => {
        [$(AddOnFile {
            path: concat!("turnlight/", $name),
            bytes: include_bytes!(concat!("../blender/turnlight/", $name)),
        }),*]
    };
}

/// The add-on.
pub const FILES: [AddOnFile; 15] = files![
    "__init__.py",
    "appearance.py",
    "bake.py",
    "blender_manifest.toml",
    "directions.py",
    "glb.py",
    "gutter.py",
    "headers.py",
    "layers.py",
    "lumigraph.py",
    "material.py",
    "objects.py",
    "pictures.py",
    "playback.py",
    "surface.py",
];

#[cfg(test)]
mod tests {
    use super::*;

    fn text(file: &AddOnFile) -> &'static str {
        std::str::from_utf8(file.bytes).unwrap()
    }

    #[test]
    fn every_module_that_is_imported_is_in_the_archive() {
        for line in FILES.iter().flat_map(|file| text(file).lines()) {
            // `from . import a, b` and `from .a import Name`.
            let Some(rest) = line.strip_prefix("from .") else { continue };
            let (module, names) = rest.split_once(" import ").unwrap();
            let modules = if module.is_empty() { names.split(", ").collect() } else { vec![module] };
            for module in modules {
                let path = format!("turnlight/{module}.py");
                assert!(FILES.iter().any(|file| file.path == path), "{path}");
            }
        }
    }

    #[test]
    fn the_add_on_imports_nothing_that_reaches_the_network_or_runs_programs() {
        const ALLOWED: [&str; 9] =
            ["bpy", "bpy_extras", "dataclasses", "json", "mathutils", "numpy", "pathlib", "struct", "zlib"];
        for line in FILES.iter().flat_map(|file| text(file).lines()) {
            let named = line.strip_prefix("import ").or_else(|| line.strip_prefix("from "));
            let module = named.and_then(|rest| rest.split([' ', '.']).next()).unwrap_or_default();
            assert!(module.is_empty() || ALLOWED.contains(&module), "{line}");
        }
    }

    #[test]
    fn the_add_on_has_the_version_of_the_program() {
        let manifest = FILES.iter().find(|file| file.path.ends_with(".toml")).unwrap();
        assert!(text(manifest).contains(concat!("\nversion = \"", env!("CARGO_PKG_VERSION"), "\"")));
    }
}
