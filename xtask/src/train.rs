//! `cargo xtask train`, `eval`, `explain`, `compare-points`: commands of the program `train`, built when first
//! asked for, so that nobody waits for it who trains nothing. `EDGEPUCK_TRAIN` names one
//! that is built already.

use crate::{Outcome, workspace};
use anyhow::Context;
use formats::modelnet_h5_list::is_one;
use std::ffi::OsString;
use std::path::Path;
use std::process::Command;

/// Flags of the command, which `train` itself understands.
#[derive(clap::Args)]
pub struct Args {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    flags: Vec<OsString>,
}

impl From<Vec<OsString>> for Args {
    fn from(flags: Vec<OsString>) -> Self {
        Self { flags }
    }
}

/// Runs `command` of `train`, in the folder that the caller is in.
pub fn run(command: &str, args: &Args) -> anyhow::Result<Outcome> {
    let mut program = match std::env::var_os("EDGEPUCK_TRAIN") {
        Some(built) => Command::new(built),
        None => built_by_cargo(&args.flags),
    };
    program.arg(command).args(&args.flags);
    let status = program
        .status()
        .with_context(|| format!("cannot start {}", program.get_program().to_string_lossy()))?;
    Ok(if status.success() { Outcome::Success } else { Outcome::SomeFailed })
}

/// Cargo, which builds the program for `flags` if need be and then runs it.
fn built_by_cargo(flags: &[OsString]) -> Command {
    let manifest = workspace::root().join("Cargo.toml");
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["run", "--quiet", "--release", "--package", "train", "--manifest-path"]);
    cargo.arg(manifest);
    let words = flags.iter().map(|flag| flag.to_string_lossy());
    // HDF5 takes long to build: only for data that is of it.
    let value = |word: &str| word.rsplit('=').next().unwrap_or_default().to_owned();
    if words.into_iter().any(|word| is_one(Path::new(&value(&word)))) {
        cargo.args(["--features", "hdf5"]);
    }
    cargo.arg("--");
    cargo
}
