//! Classifies clouds of points without a GPU.

mod cli;

use std::process::ExitCode;

use clap::Parser;

use cli::{Cli, Outcome, Usage};

fn main() -> ExitCode {
    match cli::run(&Cli::parse()) {
        Ok(Outcome::Success) => ExitCode::SUCCESS,
        Ok(Outcome::SomeFailed) => ExitCode::from(1),
        // The reader of the output has gone: that is not a failure.
        Err(error) if cli::is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            cli::say(&format!("error: {}", cli::told_once(&error)));
            ExitCode::from(if error.is::<Usage>() { 2 } else { 1 })
        }
    }
}
