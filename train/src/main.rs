//! `train`: the program that `cargo xtask train` and `eval` start.

mod compare_points;
mod cross;
mod eval;
mod explain;
mod once;
mod report;
mod reproduce;
mod run;
mod serve;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Trains and measures PointNets.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", version, max_term_width = 100)]
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
    /// Show what a model's answer rests on
    Explain(explain::Args),
    /// Tell how far two clouds are apart
    ComparePoints(compare_points::Args),
    /// Run the paper's experiments
    #[command(hide = true)]
    Reproduce(reproduce::Args),
    /// Train on some sets and test on some: what `cargo xtask ablate` starts
    #[command(hide = true)]
    Cross(cross::Args),
    /// Take part in `bench train`
    #[command(hide = true)]
    Serve(serve::Args),
}

fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Command::Train(args) => run::run(&args),
        Command::Eval(args) => eval::run(&args),
        Command::Explain(args) => explain::run(&args),
        Command::ComparePoints(args) => compare_points::run(&args),
        Command::Reproduce(args) => reproduce::run(&args),
        Command::Cross(args) => cross::run(&args),
        Command::Serve(args) => serve::run(&args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
