//! Starts the repository's other programs, which Cargo builds first if need be.

use anyhow::Context;
use formats::modelnet_h5_list::is_one;
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitStatus;
use xtask::workspace::{cargo_command, root};

/// A program of the repository.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Program {
    /// The product.
    Edgepuck,
    /// The laboratory, which measures.
    Lab,
}

/// Runs `program` in the caller's folder and gives the exit code that it ended with.
///
/// # Errors
/// Cargo cannot be started.
pub fn run(program: Program, command: Option<&str>, words: &[OsString]) -> anyhow::Result<u8> {
    let mut cargo = cargo_command();
    cargo.args(["run", "--release", "--package", program.package(), "--bin", program.package()]);
    cargo.arg("--manifest-path").arg(root().join("Cargo.toml"));
    for feature in program.features(words) {
        cargo.args(["--features", feature]);
    }
    cargo.arg("--").args(command).args(words);
    let status = cargo.status().context("cannot start cargo")?;
    Ok(exit_code(status))
}

impl Program {
    fn package(self) -> &'static str {
        match self {
            Self::Edgepuck => "edgepuck",
            Self::Lab => "edgepuck-lab",
        }
    }

    /// The features that a command line needs beyond the default ones, which
    /// leave out what takes long to build: meshoptimizer and HDF5.
    fn features(self, words: &[OsString]) -> Vec<&'static str> {
        let has = |flag: &str| words.iter().any(|word| word.to_string_lossy().starts_with(flag));
        let names = |name: &str| words.iter().any(|word| word.to_string_lossy().contains(name));
        let mut features = Vec::new();
        if has("--simplify") {
            features.push("simplify");
        }
        if self == Self::Edgepuck && has("--layout") && names("modelnet-h5") {
            features.push("hdf5");
        }
        if self == Self::Lab && words.iter().any(|word| is_one(path_of(word))) {
            features.push("hdf5");
        }
        features
    }
}

/// The value of a flag `--name=VALUE`, or the whole word.
fn path_of(word: &OsString) -> &Path {
    let value = word.to_str().and_then(|word| word.split_once('=')).map(|(_, value)| value);
    value.map_or(Path::new(word), Path::new)
}

/// The code that the child ended with; 128 more than its signal, as shells have
/// it, where a signal ended it.
fn exit_code(status: ExitStatus) -> u8 {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        return u8::try_from(128 + signal).unwrap_or(1);
    }
    status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1)
}
