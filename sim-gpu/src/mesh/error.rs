//! What can be wrong with a mesh file.

use std::fmt;
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
    #[error("{}: is {what}, not a mesh file", path.display())]
    NotAFile {
        /// The path asked for.
        path: PathBuf,
        /// What it is, with its article.
        what: &'static str,
    },
    /// The file name ends in no extension that stands for a mesh format.
    #[error("{}: its extension is none of {}", path.display(), mesh_extensions().join(", "))]
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

/// Which of a mesh's two lists a message is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The vertex positions.
    Vertices,
    /// The faces: triangles or polygons.
    Faces,
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Vertices => "vertices",
            Self::Faces => "faces",
        })
    }
}

/// What is wrong with a mesh file's content.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Malformed {
    /// The file holds no byte.
    #[error("the file is empty")]
    Empty,
    /// The file does not begin as its format must.
    #[error("not {format}: it begins with {found:?}")]
    WrongStart {
        /// The format that the file name promises, with its article.
        format: &'static str,
        /// The first characters found.
        found: String,
    },
    /// A variant of the format that is not read here.
    #[error("{0} is not supported")]
    Unsupported(String),
    /// The file ends, or cannot but end, before all its header promises.
    #[error("truncated: the header promises {promised} {part}, the file holds {held}")]
    Truncated {
        /// Vertices or faces.
        part: Part,
        /// How many were read, or could be at most.
        held: u64,
        /// How many the header promises.
        promised: u64,
    },
    /// A word that should be a number is not.
    #[error("{found:?} is not {expected}")]
    NotANumber {
        /// The word found.
        found: String,
        /// What it should be, with its article.
        expected: &'static str,
    },
    /// A count below zero.
    #[error("{found} is a negative number of {part}")]
    NegativeCount {
        /// Vertices or faces.
        part: Part,
        /// The count as written.
        found: String,
    },
    /// A line ends before all that it must hold.
    #[error("the line holds {held} of {expected} {what}")]
    ShortLine {
        /// What is missing: coordinates, corners, counts.
        what: &'static str,
        /// How many the line holds.
        held: u64,
        /// How many it must hold.
        expected: u64,
    },
    /// A coordinate that is NaN or infinite, or too large for f64.
    #[error("coordinate {found} is not finite")]
    NotFinite {
        /// The coordinate as written.
        found: String,
    },
    /// A face names a vertex that is not there.
    #[error("index {found} is out of range: there are {n_vertices} vertices")]
    IndexOutOfRange {
        /// The index as written.
        found: String,
        /// The number of vertices.
        n_vertices: u64,
    },
    /// More vertices than a 32-bit index can name.
    #[error("{0} vertices are too many: indices have 32 bits")]
    TooManyVertices(u64),
    /// The file is well formed but has no face of three or more corners.
    #[error("there is no triangle")]
    NoTriangle,
    /// What the reading crate said.
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
