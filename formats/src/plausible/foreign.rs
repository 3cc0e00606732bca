//! Files that are not of the format that their names say.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use crate::error::FormatError;

/// The beginnings of files that occur in place of others, and what they are.
const KINDS: [(&[u8], &str); 14] = [
    (b"version https://git-lfs", "a Git LFS pointer: fetch the file by `git lfs pull`"),
    (b"\xFF\xFE", UTF_16),
    (b"\xFE\xFF", UTF_16),
    (b"\x1F\x8B", COMPRESSED),
    (ZIP, COMPRESSED),
    (b"<!DOCTYPE", "a web page"),
    (b"<html", "a web page"),
    (b"\xA1\xB2\xC3\xD4", CAPTURE),
    (b"\xD4\xC3\xB2\xA1", CAPTURE),
    (b"\xA1\xB2\x3C\x4D", CAPTURE),
    (b"\x4D\x3C\xB2\xA1", CAPTURE),
    (b"\n\r\r\n", CAPTURE),
    (b"\x89MCAP", "a recording (MCAP)"),
    (b"\x89PNG", "a picture (PNG)"),
];

/// Kinds of files in TOML, and keys that tell them. A scene with effects is a scene.
#[cfg(feature = "mistakes")]
const KINDS_OF_TOML: [(&str, &[&str]); 7] = [
    ("a sensor's profile", &["rotating", "uniform", "grid", "risley", "table"]),
    ("a recipe of scenes", &["mount", "ground", "object.kind"]),
    ("a scene", &["object.mesh", "object.scene", "sensor.position_m", "sensor.trajectory"]),
    ("a recipe of a training", &["network", "epochs", "batch", "schedule", "normalization"]),
    ("corruptions of sweeps", &["sweep"]),
    ("poses", &["pose"]),
    ("effects", &["effects"]),
];

const UTF_16: &str = "text in UTF-16: save it as UTF-8";
/// A capture of packets: classic ones of micro- or nanoseconds in either byte order, and pcapng.
const CAPTURE: &str = "a capture of packets (pcap)";
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
    if begins(ZIP) && bytes.windows(4).take(EXAMINED as usize).any(|name| name == b".npy") {
        return Some("a NumPy archive (NPZ)");
    }
    let known = KINDS.iter().find(|(start, _)| begins(start)).map(|(_, what)| *what);
    known.or(match bytes {
        [1..=127, 0, 1..=127, 0, ..] | [0, 1..=127, 0, 1..=127, ..] => Some(UTF_16),
        _ => None,
    })
}

/// That a `text` is not what is `expected` in TOML, if it is of a kind that occurs there.
#[cfg(feature = "mistakes")]
#[must_use]
pub fn foreign_toml(text: &str, expected: &str) -> Option<String> {
    let found = match (text.parse::<toml::Table>(), text.trim_start().as_bytes()) {
        (Ok(table), _) => kind_of(&table).filter(|kind| !kind.starts_with(expected))?,
        (_, [b'<', ..]) => "XML".to_owned(),
        (_, [b'{', ..] | [b'[', b'{' | b'\n', ..]) => "JSON".to_owned(),
        _ => (!text.contains('=')).then(|| "text without a key".to_owned())?,
    };
    Some(format!("expected {expected}, found {found}"))
}

/// The kind of a file in TOML, and a key that tells it.
#[cfg(feature = "mistakes")]
fn kind_of(table: &toml::Table) -> Option<String> {
    let has = |key: &&&str| match key.split_once('.') {
        Some((list, key)) => table.get(list).and_then(|of| of.get(0)?.get(key)).is_some(),
        None => table.contains_key(**key),
    };
    let told = |(kind, keys): &(&str, &[&str])| {
        keys.iter().find(has).map(|key| format!("{kind}: it has `{key}`"))
    };
    KINDS_OF_TOML.iter().find_map(told)
}

/// The first `longest` bytes of the text at `path`, without the byte order mark that Windows'
/// editors begin files with.
///
/// # Errors
/// The file cannot be read, or it is not UTF-8; the error names the line.
pub fn read_text(path: &Path, longest: u64) -> io::Result<String> {
    let wrong = |found: String| {
        let cause = format!("expected text in UTF-8, found {found}");
        io::Error::new(io::ErrorKind::InvalidData, cause)
    };
    if path.is_dir() {
        let cause = "expected a file, found a folder";
        return Err(io::Error::new(io::ErrorKind::IsADirectory, cause));
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(longest).read_to_end(&mut bytes)?;
    let binary = bytes.contains(&0).then_some("binary data");
    if let Some(found) = foreign(&bytes).or(binary) {
        return Err(wrong(found.to_owned()));
    }
    let text = String::from_utf8(bytes).map_err(|error| {
        let valid = error.utf8_error().valid_up_to();
        let (before, after) = error.as_bytes().split_at(valid);
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        wrong(format!("the byte 0x{:02X} in line {line}: save it as UTF-8", after[0]))
    })?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

/// `error`, or what was found in `content` in place of what was `expected`. Captures keep their error
/// where they are expected, and zip archives where NPZ files or PyTorch's checkpoints are.
pub(crate) fn or_foreign(
    path: &Path,
    content: impl Read,
    expected: &str,
    error: FormatError,
) -> FormatError {
    let mut start = Vec::new();
    let read = content.take(EXAMINED).read_to_end(&mut start);
    let keeps = start.starts_with(ZIP) && ["npz", "safetensors"].contains(&expected);
    let is_other = |found: &&str| read.is_ok() && !keeps && !found.starts_with(expected);
    foreign(&start).filter(is_other).map_or(error, |found| {
        FormatError::malformed(path, "format", format!("expected {expected}, found {found}"))
    })
}

/// As [`or_foreign`], for the file at `path`.
#[cfg(any(feature = "files", feature = "pcap", feature = "poses"))]
pub(crate) fn or_foreign_file(path: &Path, expected: &str, error: FormatError) -> FormatError {
    // Opening a named pipe would wait for a writer.
    match path.is_file().then(|| File::open(path)) {
        Some(Ok(file)) => or_foreign(path, file, expected, error),
        _ => error,
    }
}
