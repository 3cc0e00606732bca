//! The laboratory's program as users run it, in temporary folders.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop")]

mod gpu;
mod manifest;

use std::path::Path;
use std::process::{Command, Output};

/// The laboratory's program.
const LAB: &str = env!("CARGO_BIN_EXE_edgepuck-lab");

/// Runs `program` with the words, separated by spaces, in `folder`.
fn run(program: &Path, folder: &Path, words: &str) -> Output {
    Command::new(program).current_dir(folder).args(words.split_whitespace()).output().unwrap()
}

/// Runs the program and expects success.
fn succeeds(program: &Path, folder: &Path, words: &str) -> Output {
    let output = run(program, folder, words);
    assert!(output.status.success(), "{words}\n{}", said(&output));
    output
}

/// Runs the program and expects this exit code; returns what it printed.
fn exits(code: i32, program: &Path, folder: &Path, words: &str) -> String {
    let output = run(program, folder, words);
    assert_eq!(output.status.code(), Some(code), "{words}\n{}", said(&output));
    said(&output)
}

fn said(output: &Output) -> String {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    text(&output.stdout) + &text(&output.stderr)
}
