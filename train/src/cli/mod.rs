//! The commands of `edgepuck` that train networks and explain them.

mod eval;
mod explain;
mod train;

use clap::Subcommand;
use program::outcome::{Outcome, Usage};
use std::io::Write;

/// A command and its flags.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Train a network
    Train(train::TrainArgs),
    /// Measure a model's accuracy on labelled clouds
    Eval(eval::EvalArgs),
    /// Show which points determined a prediction
    Explain(explain::ExplainArgs),
}

/// Runs `command` in the current folder, and prints its results.
///
/// # Errors
/// With the file and the cause, or a [`Usage`].
pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Train(args) => train::run(args),
        Command::Eval(args) => eval::run(args),
        Command::Explain(args) => explain::run(args),
    }?;
    Ok(Outcome::Success)
}

fn print(line: &str) -> anyhow::Result<()> {
    Ok(writeln!(std::io::stdout(), "{line}")?)
}
