//! The exit codes and error messages of programs.

use std::error::Error;
use std::ffi::OsString;
use std::fmt::Display;
use std::io::{self, ErrorKind, Write};
use std::num::{IntErrorKind, ParseFloatError, ParseIntError};

use clap::error::ContextKind;

/// The exit status of a completed command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All inputs were processed.
    Success,
    /// Some inputs failed and were named.
    SomeFailed,
    /// Some inputs were refused and named, and all others were processed. Trying again is
    /// useless; the exit code tells schedulers so.
    SomeRefused,
    /// SIGTERM stopped the work, which can be resumed.
    Interrupted,
}

/// An error in the command line.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Usage(pub String);

/// The command line `words`, whose first is the program's name. Values may be negative numbers, which
/// are judged as any other, and not taken for flags.
///
/// # Errors
/// What is wrong with the words, or the help that they ask for.
pub fn parsed<T: clap::FromArgMatches>(
    command: clap::Command,
    words: impl IntoIterator<Item = impl Into<OsString> + Clone>,
) -> Result<T, clap::Error> {
    let mut command = with_negative_numbers(command);
    let matches = command.try_get_matches_from_mut(words);
    let read = matches.and_then(|mut matches| T::from_arg_matches_mut(&mut matches));
    read.map_err(|error| in_words(error.format(&mut command)))
}

/// The error, which says what is expected in place of a word that is not a number.
fn in_words(error: clap::Error) -> clap::Error {
    let Some(source) = error.source() else { return error };
    let expected = match source.downcast_ref().map(ParseIntError::kind) {
        Some(IntErrorKind::PosOverflow) => "a smaller number",
        Some(_) => "a whole number, 0 or more",
        None if source.is::<ParseFloatError>() => "a number",
        None => return error,
    };
    let part = |kind| error.get(kind).map(ToString::to_string).unwrap_or_default();
    let [value, arg] = [ContextKind::InvalidValue, ContextKind::InvalidArg].map(part);
    let message = format!(
        "invalid value '{value}' for '{arg}': expected {expected}\n\nFor more information, try '--help'.\n"
    );
    clap::Error::raw(error.kind(), message)
}

fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let signed = |arg: clap::Arg| {
        let takes_values = arg.get_action().takes_values();
        arg.allow_negative_numbers(takes_values)
    };
    command.mut_args(signed).mut_subcommands(with_negative_numbers)
}

/// The exit codes, as `--help` lists them.
pub const EXIT_CODES: &str = "\
Exit codes:
  0   done
  1   failed, or some inputs did (each is named): a file is missing, malformed or cannot be
      written, or the machine failed
  2   the command line is wrong, or an output exists: another try does not help
  3   done, except for inputs that were refused (each is named), or nothing came out
  75  stopped by a signal: --resume continues";

/// Prints the error, if there is one, and returns the program's exit code of [`EXIT_CODES`]. A broken
/// pipe is success.
pub fn exit_code(result: anyhow::Result<Outcome>) -> u8 {
    match result {
        Ok(Outcome::Success) => 0,
        Ok(Outcome::SomeFailed) => 1,
        Ok(Outcome::SomeRefused) => 3,
        // EX_TEMPFAIL of sysexits.h: try again later.
        Ok(Outcome::Interrupted) => 75,
        Err(error) if is_broken_pipe(&error) => 0,
        Err(error) => {
            say(format_args!("error: {}", joined_causes(&error)));
            if error.is::<Usage>() { 2 } else { 1 }
        }
    }
}

/// The error and its causes, without causes that an outer error already contains.
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

/// Writes a line to standard error, and ignores errors of a closed one.
pub fn say(line: impl Display) {
    let _ = writeln!(io::stderr(), "{line}");
}

/// As `eprintln!`, but ignores errors of a closed standard error: the work goes on.
#[macro_export]
macro_rules! say {
    ($($words:tt)*) => { $crate::outcome::say(format_args!($($words)*)) };
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let mut causes = error.chain().filter_map(|cause| cause.downcast_ref::<io::Error>());
    causes.any(|cause| cause.kind() == ErrorKind::BrokenPipe)
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::anyhow;

    #[derive(Debug, thiserror::Error)]
    #[error("stdout")]
    struct Writing(#[source] io::Error);

    #[test]
    fn kinds_of_ends_have_their_exit_codes() {
        let io = |kind| io::Error::from(kind);
        let written = |kind| Err(Writing(io(kind)).into());
        for (result, expected) in [
            (Ok(Outcome::SomeFailed), 1),
            (Ok(Outcome::SomeRefused), 3),
            (Ok(Outcome::Interrupted), 75),
            (Err(io(ErrorKind::BrokenPipe).into()), 0),
            // A reader that has enough closes the pipe under whatever writes to it.
            (written(ErrorKind::BrokenPipe), 0),
            (written(ErrorKind::StorageFull), 1),
            (Err(anyhow!("no file")), 1),
            (Err(Usage("--seed".to_owned()).into()), 2),
        ] {
            let shown = format!("{result:?}");
            assert_eq!(exit_code(result), expected, "{shown}");
        }
    }
}
