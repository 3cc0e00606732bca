//! `train`: the program that `cargo xtask train` and `eval` start.

mod eval;
mod report;
mod run;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Trains and measures PointNets.
#[derive(Parser)]
#[command(name = "cargo xtask", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Train a network
    Train(run::Args),
    /// Measure a model's accuracy
    Eval(eval::Args),
}

fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Command::Train(args) => run::run(&args),
        Command::Eval(args) => eval::run(&args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
