//! The errors of files and of values.

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
        /// The error of the system.
        source: io::Error,
    },
    /// The disk or the quota is full.
    #[error("{}: the disk is full", path.display())]
    DiskFull {
        /// The file, which was not written.
        path: PathBuf,
    },
    /// The content of the file is not valid.
    #[error("{}: {part}: {cause}", path.display())]
    Malformed {
        /// The file that was read.
        path: PathBuf,
        /// The key, element or line at fault.
        part: String,
        /// The cause.
        cause: String,
    },
    /// An attribute of a scan has another length than its positions.
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
        /// The cause.
        cause: String,
    },
    /// A word that is not one of the known names.
    #[error("unknown {what} `{word}`, expected one of {choices}")]
    UnknownName {
        /// The word.
        word: String,
        /// The kind of the names.
        what: &'static str,
        /// The known names, separated by commas.
        choices: String,
    },
}

impl FormatError {
    /// The error `source` of reading or writing `path`. A full disk or quota is
    /// [`FormatError::DiskFull`], since it ends a run and other errors need not.
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

/// A key whose value cannot be used, and why.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {cause}")]
pub struct InvalidValue {
    /// The path of the key, such as `rotating.beam[3].elevation_deg`.
    pub key: String,
    /// The cause.
    pub cause: String,
}

impl InvalidValue {
    /// The error that the value of `key` cannot be used because of `cause`.
    pub fn new(key: impl Into<String>, cause: impl Into<String>) -> Self {
        Self { key: key.into(), cause: cause.into() }
    }
}

impl From<InvalidValue> for Vec<InvalidValue> {
    fn from(invalid: InvalidValue) -> Self {
        vec![invalid]
    }
}
