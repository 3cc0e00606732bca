//! Files that are not of the format that their names say.

use super::error::{Malformed, ParseError};

/// The beginnings of files that occur in place of others, and what they are.
const KINDS: [(&[u8], &str); 7] = [
    (b"version https://git-lfs", "a Git LFS pointer: fetch the file by `git lfs pull`"),
    (b"\xFF\xFE", UTF_16),
    (b"\xFE\xFF", UTF_16),
    (b"\x1F\x8B", "a compressed file: unpack it"),
    (b"PK\x03\x04", "a compressed file: unpack it"),
    (b"<!DOCTYPE", "a web page"),
    (b"<html", "a web page"),
];

const UTF_16: &str = "text in UTF-16: save it as UTF-8";

/// The error that `bytes` are of a kind that often stands in place of what was `expected`.
pub(super) fn foreign(bytes: &[u8], expected: &str) -> Option<ParseError> {
    let begins = |start: &[u8]| {
        bytes.get(..start.len()).is_some_and(|head| head.eq_ignore_ascii_case(start))
    };
    let known = KINDS.iter().find(|(start, _)| begins(start)).map(|(_, what)| *what);
    let what = known.or(match bytes {
        [1..=127, 0, 1..=127, 0, ..] | [0, 1..=127, 0, 1..=127, ..] => Some(UTF_16),
        _ => None,
    })?;
    Some(Malformed::Syntax(format!("expected {expected}, found {what}")).into())
}
