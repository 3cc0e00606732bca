//! `cargo xtask train`, `eval`, `explain`, `compare-points`: commands of the program `train`, built when first
//! asked for, so that nobody waits for it who trains nothing.

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
    let manifest = workspace::root().join("Cargo.toml");
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["run", "--quiet", "--release", "--package", "train", "--manifest-path"]);
    cargo.arg(manifest);
    let words = args.flags.iter().map(|flag| flag.to_string_lossy());
    // HDF5 takes long to build: only for data that is of it.
    let value = |word: &str| word.rsplit('=').next().unwrap_or_default().to_owned();
    if words.into_iter().any(|word| is_one(Path::new(&value(&word)))) {
        cargo.args(["--features", "hdf5"]);
    }
    cargo.args(["--", command]).args(&args.flags);
    let status = cargo.status().context("cannot start cargo")?;
    Ok(if status.success() { Outcome::Success } else { Outcome::SomeFailed })
}
