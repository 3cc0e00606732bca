//! What ends a command, and whose fault it is.

use std::io::{ErrorKind, Write};

/// A command line that asks for something that cannot be.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Usage(pub String);

/// The error of a model or of options, as a [`Usage`] where only another
/// command line can help.
pub fn of_setup(error: infer_cpu::Error) -> anyhow::Error {
    use infer_cpu::Error;
    match error {
        Error::KernelMissing(_)
        | Error::KernelPrecision { .. }
        | Error::Sampler(_)
        | Error::FrontMissing { .. }
        | Error::VotesWithoutDraws(_)
        | Error::TooManyThreads(_)
        | Error::Threads { .. } => Usage(error.to_string()).into(),
        _ => error.into(),
    }
}

/// Whether whoever read our output has gone.
pub fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let causes = error.chain().filter_map(|cause| cause.downcast_ref::<std::io::Error>());
    causes.into_iter().any(|cause| cause.kind() == ErrorKind::BrokenPipe)
}

/// The error and its causes, but for those that an outer one spells out.
pub fn told_once(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |told, cause| {
        if told.is_empty() {
            cause
        } else if told.contains(&cause) {
            told
        } else {
            format!("{told}: {cause}")
        }
    })
}

/// Writes a line to standard error. A closed one does not stop the program.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}
