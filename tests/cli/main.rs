//! The command line: the tests run the real binary in temporary folders.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop")]

mod calibrate;
mod cards;
mod corrupt;
mod datasets;
mod detectors;
mod drives;
mod end_to_end;
mod golden;
mod interrupted;
mod meanings;
mod mesh_scans;
mod meshes;
mod packets;
mod said;
mod scenes;
mod sensors;
mod sweeps;
mod tars;
mod training;
mod weather;

use formats::Scan;
use formats::scan_file::read_scan;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// A folder in which `edgepuck` runs; it is removed when dropped.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn with_meshes() -> Self {
        let folder = Self::new();
        meshes::write_tree(&folder);
        folder
    }

    fn at(&self, file: &str) -> PathBuf {
        self.0.path().join(file)
    }

    fn write(&self, file: &str, content: impl AsRef<[u8]>) {
        let path = self.at(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }

    fn bytes(&self, file: &str) -> Vec<u8> {
        fs::read(self.at(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
    }

    fn text(&self, file: &str) -> String {
        String::from_utf8(self.bytes(file)).unwrap()
    }

    fn scan(&self, file: &str) -> Scan {
        read_scan(&self.at(file)).unwrap_or_else(|error| panic!("{error}"))
    }

    fn edgepuck(&self, words: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_edgepuck"));
        command.current_dir(&self.0);
        // `NAME=VALUE` before a command is for its environment.
        for word in words.split_whitespace() {
            match word.split_once('=').filter(|_| command.get_args().next().is_none()) {
                Some((name, value)) => command.env(name, value),
                None => command.arg(word),
            };
        }
        command
    }

    fn succeeds(&self, words: &str) -> String {
        self.exits(0, words)
    }

    fn exits(&self, code: i32, words: &str) -> String {
        let output = self.edgepuck(words).output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{words}\n{}", said(&output));
        said(&output)
    }

    /// Each of `cases` has arguments and a part of the message.
    fn refuses(&self, code: i32, cases: &[(&str, &str)]) {
        for (words, part) in cases {
            let said = self.exits(code, words);
            assert!(said.contains(part), "{words}: {said}");
            assert!(!said.contains("panicked"), "{words}: {said}");
        }
    }

    fn assert_same_tree(&self, left: &str, right: &str) {
        tests::tree::assert_same(&self.at(left), &self.at(right));
    }
}

/// Sends SIGTERM through the shell's own `kill`, since not every system has a program `kill`.
#[cfg(unix)]
fn terminate(child: &std::process::Child) -> bool {
    let kill = format!("kill {}", child.id());
    Command::new("sh").args(["-c", &kill]).status().unwrap().success()
}

/// Kills `command` with SIGKILL if it is still running after `milliseconds`.
fn run_for(command: &mut Command, milliseconds: u64) {
    let mut child = command.stderr(Stdio::null()).spawn().unwrap();
    let killed_at = Instant::now() + Duration::from_millis(milliseconds);
    while child.try_wait().unwrap().is_none() && Instant::now() < killed_at {
        std::thread::sleep(Duration::from_millis(1));
    }
    let _ = child.kill();
    child.wait().unwrap();
}

fn said(output: &Output) -> String {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    text(&output.stdout) + &text(&output.stderr)
}

fn in_repository(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file)
}
