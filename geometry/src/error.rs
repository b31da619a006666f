//! What can go wrong with geometry, with the remedy in the message.

use std::path::PathBuf;

/// A fault of the input or of the options of a geometric step.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GeometryError {
    /// An option is out of its range.
    #[error("{option}: {fault}; {remedy}")]
    Options {
        /// The field.
        option: &'static str,
        /// What is wrong with it.
        fault: String,
        /// What to do.
        remedy: &'static str,
    },
    /// One view cannot be used.
    #[error("view {index} ({name}): {fault}; {remedy}")]
    View {
        /// Position of its frame in the capture.
        index: usize,
        /// File stem of its image.
        name: String,
        /// What is wrong with it.
        fault: String,
        /// What to do.
        remedy: &'static str,
    },
    /// The views together do not determine a solid.
    #[error("{fault}; {remedy}")]
    Views {
        /// What is wrong with them.
        fault: String,
        /// What to do.
        remedy: String,
    },
    /// A mesh is not usable.
    #[error("mesh: {fault}; {remedy}")]
    Mesh {
        /// What is wrong with it, with the vertex or face.
        fault: String,
        /// What to do.
        remedy: &'static str,
    },
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
