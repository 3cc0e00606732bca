//! Runs a command line again in a build that can do what it asks for.

use crate::{Outcome, workspace};
use anyhow::{Context, bail};
use std::process::Command;

/// Whether this build cannot decimate meshes.
pub fn lacks_simplify() -> bool {
    cfg!(not(feature = "simplify"))
}

/// Builds this program with the feature `simplify` and runs the same command
/// line in it: so nobody needs a C++ compiler who simplifies nothing.
pub fn with_simplify() -> anyhow::Result<Outcome> {
    eprintln!(
        "--simplify: building with meshoptimizer, which takes a C++ compiler and, the first time, minutes."
    );
    let built = cargo("build").status().context("cannot start cargo")?;
    if !built.success() {
        bail!(
            "--simplify: this program could not be built with meshoptimizer; if a C++ compiler is \
             what is missing, on Debian or Ubuntu `apt-get install g++` brings one"
        );
    }
    let status =
        cargo("run").arg("--quiet").arg("--").args(std::env::args_os().skip(1)).status()?;
    // None where a signal ended it.
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    Ok(Outcome::Elsewhere(code.unwrap_or(1)))
}

/// Cargo on this program, with its own features and `simplify`.
fn cargo(command: &str) -> Command {
    let features = if cfg!(feature = "hdf5") { "simplify,hdf5" } else { "simplify" };
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args([command, "--release", "--package", "xtask", "--bin", "xtask"]);
    cargo.args(["--features", features, "--manifest-path"]);
    cargo.arg(workspace::root().join("Cargo.toml"));
    if cfg!(windows) {
        // There, a program that runs cannot be replaced.
        cargo.arg("--target-dir").arg(workspace::root().join("target/simplify"));
    }
    cargo
}
