//! What can go wrong with a file or with what should go into it.

use std::io;
use std::path::{Path, PathBuf};

/// An error that names the file, the part of it and the cause.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FormatError {
    /// The operating system reported an error.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file that was read or written.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// No room (or no quota) is left for the file.
    #[error("{}: the disk is full", path.display())]
    DiskFull {
        /// The file that was to be written; nothing lies under its name.
        path: PathBuf,
    },
    /// The file's content is not what its name or its header says.
    #[error("{}: {part}: {cause}", path.display())]
    Malformed {
        /// The file that was read.
        path: PathBuf,
        /// The key, element or line at fault.
        part: String,
        /// What is wrong with it.
        cause: String,
    },
    /// A scan's attribute is not as long as its positions.
    #[error("attribute {attribute}: expected {expected} values, one for each point, found {found}")]
    Length {
        /// The name of the attribute at fault.
        attribute: &'static str,
        /// The number of points.
        expected: usize,
        /// The number of values.
        found: usize,
    },
    /// An instance that the dataset's layout cannot hold.
    #[error("instance `{name}`: {cause}")]
    Instance {
        /// The instance's name.
        name: String,
        /// Why it cannot be held.
        cause: String,
    },
    /// A word that is not one of the known names.
    #[error("unknown {what} `{word}`, expected one of {choices}")]
    UnknownName {
        /// The word as given.
        word: String,
        /// What it should name.
        what: &'static str,
        /// The known names, separated by commas.
        choices: String,
    },
}

impl FormatError {
    /// The error of a failed read or write of `path`. A full disk or quota is
    /// an error of its own, because it ends a run and other errors need not.
    #[must_use]
    pub fn io(path: &Path, source: io::Error) -> Self {
        let path = path.to_path_buf();
        match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::DiskFull { path },
            _ => Self::Io { path, source },
        }
    }

    /// The error of a file whose `part` is wrong.
    #[must_use]
    pub fn malformed(path: &Path, part: impl Into<String>, cause: impl ToString) -> Self {
        Self::Malformed { path: path.to_path_buf(), part: part.into(), cause: cause.to_string() }
    }

    /// The error of an instance that a dataset's layout cannot hold.
    #[must_use]
    pub fn instance(name: &str, cause: impl Into<String>) -> Self {
        Self::Instance { name: name.to_owned(), cause: cause.into() }
    }
}
