//! `train`, `eval`, `explain` and `compare-points`: these commands start the program
//! `edgepuck-train`. It is a separate program, so that users who do not train need not build it.

use crate::{Outcome, checkout};
use anyhow::Context;
use formats::modelnet_h5_list::is_among;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus};

/// The program's file name, without the system's suffix.
const PROGRAM: &str = "edgepuck-train";

/// The environment variable that names another training program.
const OVERRIDE: &str = "EDGEPUCK_TRAIN";

/// Flags of the command, which the training program reads.
#[derive(clap::Args)]
pub struct TrainerArgs {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    flags: Vec<OsString>,
}

/// Runs `command` of the training program in the current folder.
pub fn run(command: &str, args: &TrainerArgs) -> anyhow::Result<Outcome> {
    let mut program = find(&args.flags);
    program.arg(command).args(&args.flags);
    let status = program.status().with_context(|| {
        let name = program.get_program().to_string_lossy().into_owned();
        format!("cannot start {name}; `cargo install --path train` in a checkout installs it")
    })?;
    Ok(match status.success() {
        true => Outcome::Success,
        false => Outcome::ChildExit(exit_code(status)),
    })
}

/// The exit code for a training program that ended with `status`: its exit code or, as in shells,
/// 128 plus the signal that ended it.
fn exit_code(status: ExitStatus) -> u8 {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        eprintln!("error: the training program was ended by signal {signal}");
        return u8::try_from(128 + signal).unwrap_or(1);
    }
    status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1)
}

/// The training program: the one that the environment names, else the one that the checkout builds,
/// the one beside this program, or the one on PATH.
fn find(flags: &[OsString]) -> Command {
    if let Some(program) = std::env::var_os(OVERRIDE) {
        return Command::new(program);
    }
    if let Some(root) = checkout::root() {
        return built_by_cargo(&root, flags);
    }
    beside_this_program().map_or_else(|| Command::new(PROGRAM), Command::new)
}

fn beside_this_program() -> Option<PathBuf> {
    let name = format!("{PROGRAM}{}", std::env::consts::EXE_SUFFIX);
    let program = std::env::current_exe().ok()?.with_file_name(name);
    program.is_file().then_some(program)
}

/// Cargo, which builds the program if necessary and runs it.
fn built_by_cargo(root: &Path, flags: &[OsString]) -> Command {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(["run", "--release", "--package", "train", "--bin", PROGRAM, "--manifest-path"]);
    cargo.arg(root.join("Cargo.toml"));
    // The HDF5 reader takes long to build: only runs on HDF5 files need it.
    if is_among(flags) {
        cargo.args(["--features", "hdf5"]);
    }
    cargo.arg("--");
    cargo
}
