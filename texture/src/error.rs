//! What can go wrong with an appearance.

use std::path::PathBuf;

/// A fault in an appearance or its file, with the remedy in the message.
#[derive(Debug, thiserror::Error)]
pub enum TextureError {
    /// A model file was read and its content is not usable.
    #[error("{path}: {fault}; {remedy}", path = path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        fault: String,
        /// What to do.
        remedy: String,
    },
    /// The views cannot carry the model asked for.
    #[error("{fault}; {remedy}")]
    Degenerate {
        /// What is wrong.
        fault: String,
        /// What to do.
        remedy: String,
    },
}
