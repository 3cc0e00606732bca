//! What goes wrong while bytes are made sense of.
//!
//! Decoders report it as [`io::Error`], because that is what their readers
//! report too; [`error_in`] tells the two apart once the file is known.

use std::io;
use std::path::Path;

use crate::error::FormatError;

/// The error of bytes that make no sense.
pub(crate) fn invalid(cause: impl ToString) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, cause.to_string())
}

/// The error of `part` of the file at `path`: bytes that end too early or make
/// no sense are the file's fault, everything else is the system's.
pub(crate) fn error_in(path: &Path, part: &str, error: io::Error) -> FormatError {
    match error.kind() {
        io::ErrorKind::InvalidData | io::ErrorKind::UnexpectedEof | io::ErrorKind::InvalidInput => {
            FormatError::malformed(path, part, error)
        }
        _ => FormatError::io(path, error),
    }
}

/// The start of `text`, fit for one line of an error.
pub(crate) fn excerpt(text: &str) -> String {
    const LONGEST: usize = 60;
    let mut letters = text.trim().chars();
    let start = letters.by_ref().take(LONGEST);
    let mut excerpt: String = start.map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if letters.next().is_some() {
        excerpt.push('…');
    }
    excerpt
}
