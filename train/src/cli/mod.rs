//! The commands of `edgepuck-train`, what ends them, and the exit code it gives.

pub mod compare_points;
pub mod eval;
pub mod explain;
pub mod serve;
pub mod train;

use std::io::{ErrorKind, Write, stdout};
use std::process::ExitCode;

/// A command line that cannot be carried out. The exit code is then 2.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Usage(pub String);

/// Writes a line to standard output.
///
/// # Errors
/// What the system reports.
pub fn print(line: &str) -> anyhow::Result<()> {
    Ok(writeln!(stdout(), "{line}")?)
}

/// 0 for success, 1 for a failure and 2 for a wrong command line. A failure is
/// described on standard error. When the reader of the output has gone, the command
/// succeeds.
pub fn exit_code(done: anyhow::Result<()>) -> ExitCode {
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(if error.is::<Usage>() { 2 } else { 1 })
        }
    }
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let mut causes = error.chain().filter_map(|cause| cause.downcast_ref::<std::io::Error>());
    causes.any(|cause| cause.kind() == ErrorKind::BrokenPipe)
}
