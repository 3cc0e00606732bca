//! What can be wrong with a mesh file.

use std::io;
use std::path::PathBuf;

use super::format::mesh_extensions;

/// Why a mesh could not be had from a path.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// The file system refused: no such file, no permission, a broken disk.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// The file asked for.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The path names a directory, a pipe or a device.
    #[error("{}: expected a mesh file, found {what}", path.display())]
    NotAFile {
        /// The path asked for.
        path: PathBuf,
        /// What it is, with its article.
        what: &'static str,
    },
    /// The file name ends in no extension that stands for a mesh format.
    #[error("{}: expected one of the extensions {}", path.display(), mesh_extensions().join(", "))]
    UnknownFormat {
        /// The file asked for.
        path: PathBuf,
    },
    /// The file was read but is not a mesh.
    #[error("{}{}: {cause}", path.display(), line.map(|line| format!(":{line}")).unwrap_or_default())]
    Malformed {
        /// The file asked for.
        path: PathBuf,
        /// The line at fault, counted from 1, where there is one.
        line: Option<usize>,
        /// What is wrong there.
        cause: Malformed,
    },
}

/// What is wrong with a mesh file's content.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Malformed {
    /// The file holds no byte.
    #[error("the file is empty")]
    Empty,
    /// The file ends, or cannot but end, before all its header promises.
    #[error("truncated: expected {promised} {part}, found {held}")]
    Truncated {
        /// Vertices or faces.
        part: &'static str,
        /// How many were read, or could be at most.
        held: u64,
        /// How many the header promises.
        promised: u64,
    },
    /// A face names a vertex that is not there.
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
    /// Something else than the format has there.
    #[error("{0}")]
    Syntax(String),
}

/// A cause and the line where it lies, of a file whose path is not known.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{cause}", line.map(|line| format!("line {line}: ")).unwrap_or_default())]
pub struct ParseError {
    /// The line at fault, counted from 1, where there is one.
    pub line: Option<usize>,
    /// What is wrong there.
    pub cause: Malformed,
}

impl Malformed {
    /// That `found` stands in a file where its format has `expected`.
    pub(super) fn expected(expected: &str, found: &[u8]) -> Self {
        Self::Syntax(format!("expected {expected}, found {:?}", excerpt(found)))
    }

    /// Checks that indices of 32 bits can name `n_vertices` vertices.
    pub(super) fn check_vertex_count(n_vertices: u64) -> Result<(), Self> {
        if n_vertices <= u64::from(u32::MAX) {
            return Ok(());
        }
        Err(Self::Syntax(format!("expected at most {} vertices, found {n_vertices}", u32::MAX)))
    }

    /// The cause, found at `line`.
    pub(super) fn at(self, line: usize) -> ParseError {
        ParseError { line: Some(line), cause: self }
    }
}

impl From<Malformed> for ParseError {
    fn from(cause: Malformed) -> Self {
        Self { line: None, cause }
    }
}

/// `bytes` as text for a message: at most 40 characters, none a control.
pub(super) fn excerpt(bytes: &[u8]) -> String {
    const LONGEST: usize = 40;
    let head = &bytes[..bytes.len().min(4 * LONGEST)];
    let text = String::from_utf8_lossy(head);
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(LONGEST).collect()
}
