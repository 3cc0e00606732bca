//! `train`, `eval`, `explain` and `compare-points`: commands of the program
//! `edgepuck-train`, which is a program of its own so that nobody who trains
//! nothing has to build it.

use crate::{Outcome, checkout};
use anyhow::Context;
use formats::modelnet_h5_list::is_among;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus};

/// The program's file name, without the system's suffix.
const PROGRAM: &str = "edgepuck-train";

/// Names a training program to start instead of the one that would be found.
const OVERRIDE: &str = "EDGEPUCK_TRAIN";

/// Flags of the command, which the training program itself reads.
#[derive(clap::Args)]
pub struct Args {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    flags: Vec<OsString>,
}

/// Runs `command` of the training program in the caller's folder.
///
/// # Errors
/// The training program is missing or cannot be started.
pub fn run(command: &str, args: &Args) -> anyhow::Result<Outcome> {
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

/// The code to end with for a training program that ended with `status`: its own,
/// or as shells have it 128 more than the signal that ended it, which is named.
fn exit_code(status: ExitStatus) -> u8 {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        eprintln!("error: the training program was ended by signal {signal}");
        return u8::try_from(128 + signal).unwrap_or(1);
    }
    status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1)
}

/// The training program: the one that the environment names, the one that a
/// checkout builds, the one beside this program, or the one on PATH.
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

/// Cargo, which builds the program if need be and then runs it.
fn built_by_cargo(root: &Path, flags: &[OsString]) -> Command {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(["run", "--release", "--package", "train", "--bin", PROGRAM, "--manifest-path"]);
    cargo.arg(root.join("Cargo.toml"));
    // The HDF5 reader takes long to build, so only such data asks for it.
    if is_among(flags) {
        cargo.args(["--features", "hdf5"]);
    }
    cargo.arg("--");
    cargo
}
