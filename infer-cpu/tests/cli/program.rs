//! Runs the program in a folder with a model and clouds.

use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use formats::model_card::ModelCard;
use tempfile::TempDir;

use crate::tiny_model;

pub struct Folder {
    folder: TempDir,
}

impl Folder {
    /// A folder with a model `m.safetensors` of classes a, b, c, d.
    pub fn new() -> Self {
        let folder = Self { folder: tempfile::tempdir().unwrap() };
        tiny_model::write(&folder.path("m.safetensors"), &tiny_model::tensors(4), &card());
        folder
    }

    /// [`Folder::new`] with a cloud `c.xyz` of `n` points.
    pub fn with_cloud(n: usize) -> Self {
        let folder = Self::new();
        folder.cloud("c.xyz", &strip(n));
        folder
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).unwrap();
    }

    pub fn cloud(&self, name: &str, points: &[[f64; 3]]) {
        let lines = points.iter().map(|[x, y, z]| format!("{x:e} {y:e} {z:e}\n"));
        self.write(name, lines.collect::<String>());
    }

    /// The program with the arguments in `line`, separated by blanks.
    pub fn command(&self, line: &str) -> Command {
        let mut command = program();
        command.args(line.split_whitespace()).current_dir(self.folder.path());
        command.env_remove("EDGEPUCK_MODEL");
        command
    }

    pub fn run(&self, line: &str) -> Ran {
        Ran::from_output(self.command(line).output().unwrap())
    }

    pub fn run_with(&self, line: &str, input: &[u8]) -> Ran {
        let mut command = self.command(line);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut pipe = child.stdin.take().unwrap();
        // A program that refuses its arguments reads nothing.
        let _ = pipe.write_all(input);
        drop(pipe);
        Ran::from_output(child.wait_with_output().unwrap())
    }

    /// Checks that the program ends silently when the reader of its output does, such as `head`. The output
    /// must exceed the buffer of a pipe.
    pub fn assert_closed_pipe_is_success(&self, line: &str) {
        let mut command = self.command(line);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let err = String::from_utf8_lossy(&output.stderr);
        assert_eq!((output.status.code(), &*err), (Some(0), ""), "{line}");
    }

    /// `classify` with the folder's model and one thread.
    pub fn classify(&self, line: &str) -> Ran {
        self.run(&format!("classify --model m.safetensors --threads 1 {line}"))
    }

    /// The same as JSON: one object per line.
    pub fn classify_json(&self, line: &str) -> Vec<serde_json::Value> {
        self.classify(&format!("--json {line}")).json()
    }
}

pub struct Ran {
    pub code: i32,
    pub out: String,
    pub err: String,
}

impl Ran {
    fn from_output(output: Output) -> Self {
        Self {
            code: output.status.code().unwrap(),
            out: String::from_utf8(output.stdout).unwrap(),
            err: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// Standard output as one object per line.
    pub fn json(&self) -> Vec<serde_json::Value> {
        self.out.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    /// Checks that it ended with `code` and printed only errors, the first of which begins with
    /// `start`.
    pub fn assert_refused(&self, code: i32, start: &str) {
        assert_eq!((self.code, self.out.as_str()), (code, ""), "{}", self.err);
        assert!(self.err.starts_with(start), "{}", self.err);
    }
}

pub fn card() -> ModelCard {
    ModelCard { classes: ["a", "b", "c", "d"].map(str::to_owned).to_vec(), ..ModelCard::default() }
}

/// A cloud of `n` points on a twisted strip.
pub fn strip(n: usize) -> Vec<[f64; 3]> {
    let point = |i: usize| {
        let t = i as f64 / n as f64 * 6.0;
        [t.cos(), t.sin() * (i % 3) as f64, t / 6.0]
    };
    (0..n).map(point).collect()
}

/// The program, run by the emulator of these tests if there is one.
fn program() -> Command {
    const PROGRAM: &str = env!("CARGO_BIN_EXE_infer-cpu");
    let runner = std::env::var("CARGO_TARGET_AARCH64_UNKNOWN_LINUX_MUSL_RUNNER");
    match runner {
        Ok(runner) if cfg!(all(target_arch = "aarch64", target_env = "musl")) => {
            let mut words = runner.split_whitespace();
            let mut command = Command::new(words.next().unwrap());
            command.args(words).arg(PROGRAM);
            command
        }
        _ => Command::new(PROGRAM),
    }
}
