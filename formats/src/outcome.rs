//! How a program ends: its exit code, and what it says of an error.

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};

/// The exit status of a completed command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Every input was fine.
    Success,
    /// Some inputs failed, and were named.
    SomeFailed,
    /// All is done, but for some inputs that were refused and named: to try again is no use. A
    /// scheduler tells it from a failure by its code.
    SomeRefused,
    /// The work was stopped by SIGTERM, and may go on from where it was.
    Interrupted,
    /// The work was done by a child process, which ended with this code.
    ChildExit(u8),
}

/// A command line that asks for something impossible.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Usage(pub String);

/// Prints the error, if there is one, and gives the program's exit code: 0 for
/// success, 1 for a failure, 2 for a [`Usage`], 3 where inputs were refused, and 75 for an
/// interruption. When the reader of the output has gone, the command succeeds.
pub fn exit_code(result: anyhow::Result<Outcome>) -> u8 {
    match result {
        Ok(Outcome::Success) => 0,
        Ok(Outcome::SomeFailed) => 1,
        Ok(Outcome::SomeRefused) => 3,
        // EX_TEMPFAIL of sysexits.h: try again later.
        Ok(Outcome::Interrupted) => 75,
        Ok(Outcome::ChildExit(code)) => code,
        Err(error) if is_broken_pipe(&error) => 0,
        Err(error) => {
            say(format_args!("error: {}", joined_causes(&error)));
            if error.is::<Usage>() { 2 } else { 1 }
        }
    }
}

/// The error and its causes, without those that an outer one already spells out.
#[must_use]
pub fn joined_causes(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |message, cause| {
        if message.is_empty() {
            cause
        } else if message.contains(&cause) {
            message
        } else {
            format!("{message}: {cause}")
        }
    })
}

/// Writes a line to standard error. A closed one does not stop the program.
pub fn say(line: impl Display) {
    let _ = writeln!(io::stderr(), "{line}");
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let mut causes = error.chain().filter_map(|cause| cause.downcast_ref::<io::Error>());
    causes.any(|cause| cause.kind() == ErrorKind::BrokenPipe)
}
