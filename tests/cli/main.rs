//! The command line as a user meets it: the real binary, in folders of its own.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop")]

mod advise;
mod bad_input;
mod checkpoints;
mod datasets;
mod end_to_end;
#[cfg(unix)]
mod exit_codes;
mod export_onnx;
mod import_weights;
mod interrupted;
mod meshes;
mod packets;
mod reference;
mod scenes;
#[cfg(feature = "simplify")]
mod simplified;
mod surfaces;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// `edgepuck` with these words, run in `folder`.
fn edgepuck(folder: &Path, words: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_edgepuck"));
    command.current_dir(folder).args(words);
    command
}

/// Runs the words, separated by spaces, and expects success.
fn succeeds(folder: &Path, words: &str) -> Output {
    let output = run(folder, words);
    assert!(output.status.success(), "{words}\n{}", said(&output));
    output
}

/// Runs the words and expects this exit code; what was said.
fn exits(code: i32, folder: &Path, words: &str) -> String {
    let output = run(folder, words);
    assert_eq!(output.status.code(), Some(code), "{words}\n{}", said(&output));
    said(&output)
}

fn run(folder: &Path, words: &str) -> Output {
    edgepuck(folder, &words.split_whitespace().collect::<Vec<_>>()).output().unwrap()
}

fn said(output: &Output) -> String {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    text(&output.stdout) + &text(&output.stderr)
}

/// Every file below `folder` and its bytes.
fn tree(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(at) = folders.pop() {
        for entry in std::fs::read_dir(&at).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let inside = path.strip_prefix(folder).unwrap().to_owned();
                files.insert(inside, std::fs::read(&path).unwrap());
            }
        }
    }
    files
}

/// That two folders hold the same files with the same bytes; names the first
/// that differs.
fn assert_same_tree(p: &Path, q: &Path) {
    let (p, q) = (tree(p), tree(q));
    assert_eq!(p.keys().collect::<Vec<_>>(), q.keys().collect::<Vec<_>>());
    for (path, bytes) in &p {
        assert!(bytes == &q[path], "{} differs", path.display());
    }
}
