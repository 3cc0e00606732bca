//! Errors of mesh files.

use std::io;
use std::path::{Path, PathBuf};

use super::format::mesh_extensions;

/// A mesh could not be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// The file does not exist, or cannot be read.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// The requested file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The path names a directory, a pipe or a device.
    #[error("{}: expected a mesh file, found {what}", path.display())]
    NotAFile {
        /// The requested path.
        path: PathBuf,
        /// The kind of the file, with its article.
        what: &'static str,
    },
    /// The file name does not have the extension of a mesh format.
    #[error("{}: expected one of the extensions {}", path.display(), mesh_extensions().join(", "))]
    UnknownFormat {
        /// The requested file.
        path: PathBuf,
    },
    /// The path of a mesh of a dataset is not Unicode, and so cannot be stored in a manifest.
    #[error("{}: the path is not Unicode; rename it", path.display())]
    NotUnicode {
        /// The file.
        path: PathBuf,
    },
    /// The file was read but is not a mesh.
    #[error("{}{}: {cause}", path.display(), line.map(|line| format!(":{line}")).unwrap_or_default())]
    Malformed {
        /// The requested file.
        path: PathBuf,
        /// The line of the fault, counted from 1, if known.
        line: Option<usize>,
        /// The fault.
        cause: Malformed,
    },
}

/// A fault in the content of a mesh file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Malformed {
    /// The file is empty.
    #[error("the file is empty")]
    Empty,
    /// The file is too short for the counts of its header.
    #[error("truncated: expected {promised} {part}, found {held}")]
    Truncated {
        /// Vertices or faces.
        part: &'static str,
        /// The number that the file holds, or could hold at most.
        held: u64,
        /// The number in the header.
        promised: u64,
    },
    /// A face refers to a vertex that does not exist.
    #[error("index {found} is out of range: there are {n_vertices} vertices")]
    IndexOutOfRange {
        /// The index as written.
        found: String,
        /// The number of vertices.
        n_vertices: u64,
    },
    /// The file is well formed but has no face of three or more corners.
    #[error("expected at least one triangle, found none")]
    NoTriangle,
    /// The content does not follow the format.
    #[error("{0}")]
    Syntax(String),
}

/// A fault and its line, in a file whose path is not known.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{cause}", line.map(|line| format!("line {line}: ")).unwrap_or_default())]
pub struct ParseError {
    /// The line of the fault, counted from 1, if known.
    pub line: Option<usize>,
    /// The fault.
    pub cause: Malformed,
}

impl ParseError {
    /// The error of the file at `path`.
    pub(crate) fn of(self, path: &Path) -> MeshError {
        MeshError::Malformed { path: path.into(), line: self.line, cause: self.cause }
    }
}

impl Malformed {
    pub(super) fn expected(expected: &str, found: &[u8]) -> Self {
        Self::Syntax(format!("expected {expected}, found {:?}", excerpt(found)))
    }

    /// Checks that 32 bits can index `n_vertices` vertices.
    pub(super) fn check_vertex_count(n_vertices: u64) -> Result<(), Self> {
        if n_vertices <= u64::from(u32::MAX) {
            return Ok(());
        }
        Err(Self::Syntax(format!("expected at most {} vertices, found {n_vertices}", u32::MAX)))
    }

    pub(crate) fn at(self, line: usize) -> ParseError {
        ParseError { line: Some(line), cause: self }
    }
}

impl From<Malformed> for ParseError {
    fn from(cause: Malformed) -> Self {
        Self { line: None, cause }
    }
}

/// `bytes` as text for a message: at most 40 characters, without control characters.
pub(super) fn excerpt(bytes: &[u8]) -> String {
    const LONGEST: usize = 40;
    let head = &bytes[..bytes.len().min(4 * LONGEST)];
    let text = String::from_utf8_lossy(head);
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(LONGEST).collect()
}
