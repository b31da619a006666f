//! What can go wrong with playback, with the remedy in the message.

use std::path::PathBuf;

/// A fault in writing what was rendered. Every message names the file and what to do.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// A file could not be written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The name of the file asks for a format we do not write.
    #[error("{path}: cannot write {what} with this extension; use {supported}", path = path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What was to be written.
        what: &'static str,
        /// The extensions that work.
        supported: &'static str,
    },
    /// The frames cannot make the file asked for.
    #[error("{path}: {fault}; {remedy}", path = path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        fault: String,
        /// What to do.
        remedy: String,
    },
}
