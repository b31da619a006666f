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
pub const FILES: [AddOnFile; 14] = files![
    "__init__.py",
    "appearance.py",
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
    fn the_add_on_has_the_version_of_the_program_and_reaches_for_no_network() {
        let manifest = FILES.iter().find(|file| file.path.ends_with(".toml")).unwrap();
        assert!(text(manifest).contains(concat!("\nversion = \"", env!("CARGO_PKG_VERSION"), "\"")));
        for word in ["socket", "urllib", "http", "subprocess", "eval(", "exec("] {
            assert!(FILES.iter().all(|file| !text(file).contains(word)), "{word}");
        }
    }
}
