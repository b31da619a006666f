//! What can go wrong, by whose fault, with the remedy in the message.

use std::path::{Path, PathBuf};

/// A fault in what was asked of the synthesizer, or in writing its result.
#[derive(Debug, thiserror::Error)]
pub enum SynthError {
    /// No scene has this name.
    #[error("no scene is called \"{name}\"; choose one of {known}")]
    UnknownScene {
        /// What was asked for.
        name: String,
        /// What there is, comma-separated.
        known: String,
    },
    /// No material has this name.
    #[error("no material is called \"{name}\"; choose one of {known}")]
    UnknownMaterial {
        /// What was asked for.
        name: String,
        /// What there is, comma-separated.
        known: String,
    },
    /// An option is out of its range.
    #[error("{option} is {value}; it must be {allowed}")]
    Option {
        /// The field of the options.
        option: &'static str,
        /// What was given.
        value: String,
        /// What is accepted.
        allowed: String,
    },
    /// A scene could not be built: our own fault, reported instead of a panic.
    #[error("the scene has no usable surface: {fault}; please report this")]
    Scene {
        /// What is wrong with it.
        fault: &'static str,
    },
    /// The output folder is there already and is not ours to replace.
    #[error("{path}: exists already; choose another folder or remove it", path = path.display())]
    Exists {
        /// The folder.
        path: PathBuf,
    },
    /// A file could not be written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A picture could not be encoded.
    #[error("{path}: {source}", path = path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// What the encoder said.
        source: image::ImageError,
    },
    /// Maps could not be encoded.
    #[error("{path}: {source}", path = path.display())]
    Maps {
        /// The file.
        path: PathBuf,
        /// What the encoder said.
        source: exr::error::Error,
    },
}

/// Turns a fault of the system into one that names the file.
pub(crate) fn io_error(path: &Path) -> impl FnOnce(std::io::Error) -> SynthError {
    let path = path.to_owned();
    move |source| SynthError::Io { path, source }
}
