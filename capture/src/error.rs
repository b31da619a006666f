//! What can go wrong with a capture, by whose fault, with the remedy in the message.

use std::path::PathBuf;

/// A fault in a capture. Every message names the file, what is wrong with it and what to do.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// A file could not be read or written.
    #[error("{path}: {source}", path = path.display())]
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
}
