//! Errors of decoders.
//!
//! Decoders return [`io::Error`], as their readers do; [`error_in`] tells the two apart when the
//! file is known.

use std::io;
use std::path::Path;

use crate::error::FormatError;

pub(crate) fn invalid(cause: impl ToString) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, cause.to_string())
}

/// The error of `part` of the file at `path`. Bytes that are invalid or end too early are an error
/// of the file, and all others are errors of the system.
pub(crate) fn error_in(path: &Path, part: &str, error: io::Error) -> FormatError {
    match error.kind() {
        io::ErrorKind::InvalidData | io::ErrorKind::UnexpectedEof | io::ErrorKind::InvalidInput => {
            FormatError::malformed(path, part, error)
        }
        _ => FormatError::io(path, error),
    }
}

/// The start of `text` for one line of an error.
pub(crate) fn excerpt(text: &str) -> String {
    const LONGEST: usize = 60;
    let mut letters = text.trim().chars();
    let start = letters.by_ref().take(LONGEST);
    let mut excerpt = String::new();
    start.for_each(|letter| match letter {
        '\t' => excerpt.push_str("\\t"),
        letter if letter.is_control() => excerpt.push('\u{fffd}'),
        letter => excerpt.push(letter),
    });
    if letters.next().is_some() {
        excerpt.push('…');
    }
    excerpt
}
