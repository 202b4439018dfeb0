//! Why a model file was not loaded: always the file, the place in it and the cause.

use std::path::{Path, PathBuf};

/// Why a model file was not loaded.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file could not be read.
    #[error("{}: cannot be read: {cause}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// The file is of a kind, or uses a feature, that is not supported.
    #[error("{}: {place}: {cause}", file.display())]
    Unsupported {
        /// The file.
        file: PathBuf,
        /// Where in it.
        place: String,
        /// What is not supported, and what is.
        cause: String,
    },
    /// Temporary files, which meshes larger than memory need, cannot be used.
    #[error("temporary files in {}: {cause}", folder.display())]
    Temporary {
        /// Where they are.
        folder: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// The caller asked for the work to stop.
    #[error("cancelled")]
    Cancelled,
    /// The file is not what it should be.
    #[error("{}: {place}: {cause}", file.display())]
    Data {
        /// The file.
        file: PathBuf,
        /// The line, face, accessor or node.
        place: String,
        /// What is wrong there.
        cause: String,
    },
}

impl LoadError {
    pub(super) fn data(file: &Path, place: impl Into<String>, cause: impl Into<String>) -> Self {
        Self::Data { file: file.to_owned(), place: place.into(), cause: cause.into() }
    }

    pub(super) fn temporary(folder: &Path, cause: std::io::Error) -> Self {
        match cause.kind() {
            std::io::ErrorKind::Interrupted => Self::Cancelled,
            _ => Self::Temporary { folder: folder.to_owned(), cause },
        }
    }

    /// A chunk file that was just made cannot be read.
    pub(super) fn kept(file: &Path, fault: farfield_core::Fault) -> Self {
        Self::data(file, "chunk file", fault.to_string())
    }

    pub(super) fn unsupported(file: &Path, place: impl Into<String>, cause: impl Into<String>) -> Self {
        Self::Unsupported { file: file.to_owned(), place: place.into(), cause: cause.into() }
    }
}
