//! What can go wrong with a shape, by whose fault, with the remedy in the message.

use std::path::PathBuf;

/// A fault in a mesh, a hull or an atlas. Every message says what is wrong and what to do.
#[derive(Debug, thiserror::Error)]
pub enum GeometryError {
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
        /// What is wrong with it, with line or element where known.
        fault: String,
        /// What to do.
        remedy: String,
    },
    /// A shape from which nothing can be made.
    #[error("{fault}; {remedy}")]
    Degenerate {
        /// What is wrong, with counts.
        fault: String,
        /// What to do.
        remedy: String,
    },
}

impl GeometryError {
    /// A [`GeometryError::Degenerate`] from two phrases.
    pub(crate) fn degenerate(fault: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Degenerate { fault: fault.into(), remedy: remedy.into() }
    }
}
