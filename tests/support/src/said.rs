//! Tables of command lines and of what a program says, in text files:
//!
//! ```text
//! # A comment. A file that the commands below it find:
//! write scene.toml
//!     [[sensor]]
//!     profile = "vlp16"
//! # The file with other text in one place or more, or in several:
//! swap scene.toml | vlp16 | vlp32c
//! # An exit code, a command, and parts of the message; one that must not be there, and one that is there twice:
//! 2 scan scene.toml --views 3 --out a.npz | --views applies to | !panicked | =2 scene.toml
//! # A file that is there, and parts of it:
//! holds scene.toml | [[sensor]]
//! gone a.npz
//! ```
//!
//! `linux` before a command restricts it to Linux. `\n`, `\r` and `\xNN` are bytes of a file, which ends with
//! a line feed unless its last line ends with `\c`. A file whose name ends with `/` is a folder.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Writes the files of the table `file` to `folder`, and gives each command to `run`: its exit code, its
/// arguments, and parts of the message. A command that exits with 1 or 2 must write nothing.
///
/// # Panics
/// If a line is not one of these kinds, or a command writes something.
pub fn play(file: &Path, folder: &Path, mut run: impl FnMut(i32, &str, &[&str])) {
    let text = fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let mut written = BTreeMap::new();
    let mut lines = text.lines().filter(|line| !line.starts_with('#')).peekable();
    while let Some(line) = lines.next() {
        if let Some(name) = line.strip_prefix("write ") {
            let mut content = Vec::new();
            while let Some(line) = lines.peek().and_then(|line| line.strip_prefix("    ")) {
                content.extend(unescaped(line));
                lines.next();
            }
            write(&folder.join(name), &content);
            written.insert(name, content);
        } else if let Some(line) = line.strip_prefix("swap ") {
            let fields: Vec<&str> = line.split(" | ").collect();
            let mut content = String::from_utf8_lossy(&written[fields[0]]).into_owned();
            for pair in fields[1..].chunks_exact(2) {
                let [from, to] = [pair[0], pair[1]].map(|text| text.replace("\\n", "\n"));
                assert!(content.contains(&from), "{line}");
                content = content.replace(&from, &to);
            }
            write(&folder.join(fields[0]), content.as_bytes());
        } else if let Some(line) = line.strip_prefix("holds ") {
            let (name, parts) = line.split_once(" | ").unwrap_or((line, ""));
            let bytes = fs::read(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
            let parts = parts.replace("\\n", "\n");
            let parts: Vec<&str> = parts.split(" | ").collect();
            assert_parts(name, &String::from_utf8_lossy(&bytes), &parts);
        } else if let Some(name) = line.strip_prefix("gone ") {
            assert!(!folder.join(name).exists(), "{name} is there");
        } else {
            let Some(line) = on_this_system(line) else { continue };
            let mut fields = line.split(" | ");
            let words = fields.next().unwrap_or_default();
            let (code, words) = words.split_once(' ').unwrap_or_else(|| panic!("{line}"));
            let code = code.parse().unwrap_or_else(|_| panic!("expected an exit code: {line}"));
            let before = tree(folder);
            run(code, words, &fields.collect::<Vec<_>>());
            assert!(![1, 2].contains(&code) || tree(folder) == before, "{words} wrote something");
        }
    }
}

/// The files of a table with lines `FILE -> MESSAGE`, in the escapes of [`play`]'s files, and the messages.
///
/// # Panics
/// If a line has no arrow.
pub fn faults(table: &str) -> impl Iterator<Item = (Vec<u8>, &str)> {
    let lines: Vec<_> = table.lines().filter(|line| !line.starts_with('#')).collect();
    assert!(!lines.is_empty(), "expected faults, found none");
    lines.into_iter().map(|line| {
        let (file, message) = line.rsplit_once(" -> ").expect("FILE -> MESSAGE");
        (unescaped(&format!("{file}\\c")), message)
    })
}

/// Asserts that `text` has these parts of a table.
///
/// # Panics
/// If it has not.
pub fn assert_parts(name: &str, text: &str, parts: &[&str]) {
    for part in parts {
        let counted = part.strip_prefix('=').and_then(|part| part.split_once(' '));
        let has_it = match (part.strip_prefix('!'), counted) {
            (Some(part), _) => !text.contains(part),
            (None, Some((n, part))) => Ok(text.matches(part).count()) == n.parse(),
            (None, None) => text.contains(part),
        };
        assert!(has_it, "{name}: expected {part}, found {text}");
    }
}

fn on_this_system(line: &str) -> Option<&str> {
    match line.strip_prefix("linux ") {
        Some(line) => cfg!(target_os = "linux").then_some(line),
        None => Some(line),
    }
}

fn write(path: &Path, content: &[u8]) {
    let is_folder = path.as_os_str().to_string_lossy().ends_with('/');
    let parent = if is_folder { Some(path) } else { path.parent() };
    fs::create_dir_all(parent.expect("a folder")).expect("a folder");
    if !is_folder {
        fs::write(path, content).expect("a file");
    }
}

/// All files and folders below a folder, with the bytes of files.
fn tree(folder: &Path) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
    let mut tree = BTreeMap::new();
    for item in fs::read_dir(folder).expect("a folder") {
        let path = item.expect("a file").path();
        if path.is_dir() {
            tree.append(&mut self::tree(&path));
        }
        tree.insert(path.clone(), fs::read(path).ok());
    }
    tree
}

/// The bytes of a line of a file.
fn unescaped(line: &str) -> Vec<u8> {
    let (mut bytes, mut rest) = (Vec::new(), line.as_bytes());
    while let [first, more @ ..] = rest {
        let (byte, n) = match (first, more) {
            (b'\\', [b'c', ..]) => return bytes,
            (b'\\', [b'n', ..]) => (b'\n', 1),
            (b'\\', [b'r', ..]) => (b'\r', 1),
            (b'\\', [b'x', hex @ ..]) => {
                let digits = String::from_utf8_lossy(&hex[..2]);
                (u8::from_str_radix(&digits, 16).expect("two hexadecimal digits"), 3)
            }
            _ => (*first, 0),
        };
        bytes.push(byte);
        rest = &more[n..];
    }
    bytes.push(b'\n');
    bytes
}
