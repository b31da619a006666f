//! What can go wrong with a capture, by whose fault, with the remedy in the message.

use std::path::{Path, PathBuf};

/// A fault in a capture. Every message names the file, what is wrong with it and what to do.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// A file could not be read or written.
    #[error("{path}: {source}{remedy}", path = path.display(), remedy = remedy(source))]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file was read and its content is not usable.
    #[error("{path}: {fault}; {remedy}", path = path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, with line or frame where known.
        fault: String,
        /// What to do.
        remedy: String,
    },
    /// A frame was asked for that the capture does not have.
    #[error("frame {position} was asked for, the capture has {frames}; count from 0")]
    Position {
        /// The position asked for.
        position: usize,
        /// How many frames there are.
        frames: usize,
    },
    /// The reduction of the images leaves nothing of them.
    #[error("{path}: cannot be reduced by {downscale}; choose a factor from 1 to its shorter side", path = path.display())]
    Downscale {
        /// The image.
        path: PathBuf,
        /// The factor asked for.
        downscale: usize,
    },
    /// What is said of the footage contradicts itself.
    #[error("footage: {fault}; {remedy}")]
    Stage {
        /// What is wrong.
        fault: String,
        /// What to do.
        remedy: String,
    },
    /// OpenCV could not work on an image in memory.
    #[cfg(feature = "video")]
    #[error("OpenCV failed ({}); report this as a bug", .0.message.trim())]
    OpenCv(#[from] opencv::Error),
}

impl CaptureError {
    pub(crate) fn invalid(path: &Path, fault: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Invalid { path: path.to_owned(), fault: fault.into(), remedy: remedy.into() }
    }

    pub(crate) fn io(path: &Path, source: std::io::Error) -> Self {
        Self::Io { path: path.to_owned(), source }
    }
}

fn remedy(source: &std::io::Error) -> &'static str {
    use std::io::ErrorKind as K;
    match source.kind() {
        K::NotFound => "; check the path, or copy the file there",
        K::PermissionDenied => "; change its permissions, or choose another folder",
        K::StorageFull | K::QuotaExceeded => "; free some space, or write to another disk",
        _ => "",
    }
}
