//! Files that are not of the format that their names say.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::FormatError;

/// The beginnings of files that occur in place of others, and what they are.
const KINDS: [(&[u8], &str); 7] = [
    (b"version https://git-lfs", "a Git LFS pointer: fetch the file by `git lfs pull`"),
    (b"\xFF\xFE", UTF_16),
    (b"\xFE\xFF", UTF_16),
    (b"\x1F\x8B", COMPRESSED),
    (ZIP, COMPRESSED),
    (b"<!DOCTYPE", "a web page"),
    (b"<html", "a web page"),
];

const UTF_16: &str = "text in UTF-16: save it as UTF-8";
const COMPRESSED: &str = "a compressed file: unpack it";
const ZIP: &[u8] = b"PK\x03\x04";
/// More bytes than the longest beginning has.
const EXAMINED: u64 = 64;

/// What a file is that begins with `bytes`, if it is of a kind that often stands in place of others.
#[must_use]
pub fn foreign(bytes: &[u8]) -> Option<&'static str> {
    let begins = |start: &[u8]| {
        bytes.get(..start.len()).is_some_and(|head| head.eq_ignore_ascii_case(start))
    };
    let known = KINDS.iter().find(|(start, _)| begins(start)).map(|(_, what)| *what);
    known.or(match bytes {
        [1..=127, 0, 1..=127, 0, ..] | [0, 1..=127, 0, 1..=127, ..] => Some(UTF_16),
        _ => None,
    })
}

/// `error`, or what was found in `content` in place of what was `expected`. Zip archives keep their
/// error: NPZ files and PyTorch's checkpoints are such.
pub(crate) fn or_foreign(
    path: &Path,
    content: impl Read,
    expected: &str,
    error: FormatError,
) -> FormatError {
    let mut start = Vec::new();
    let read = content.take(EXAMINED).read_to_end(&mut start);
    let keeps = start.starts_with(ZIP) && ["npz", "safetensors"].contains(&expected);
    match foreign(&start).filter(|_| read.is_ok() && !keeps) {
        Some(found) => {
            FormatError::malformed(path, "format", format!("expected {expected}, found {found}"))
        }
        None => error,
    }
}

/// As [`or_foreign`], for the file at `path`.
pub(crate) fn or_foreign_file(path: &Path, expected: &str, error: FormatError) -> FormatError {
    match File::open(path) {
        Ok(file) => or_foreign(path, file, expected, error),
        Err(_) => error,
    }
}
