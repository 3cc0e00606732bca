//! The laboratory: everything that measures Edgepuck, which `cargo xtask` starts.

mod bench;
mod measure;
mod pi5;
mod rivals;
mod study;
mod table;

use clap::{Parser, Subcommand};
use edgepuck_program::{Outcome, outcome};
use std::process::ExitCode;
use study::{mutants, reproduction};

/// Measures Edgepuck.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Measure speed and accuracy
    #[command(subcommand)]
    Bench(bench::Benchmark),
    /// Reproduce the accuracies of Meyer and Reitmann (2026) by points, sampler and dataset
    Reproduce(reproduction::ReproduceArgs),
    /// Change the code in one place at a time, and count the changes that the tests notice
    Mutants(mutants::MutantsArgs),
}

fn main() -> ExitCode {
    outcome::exit_code(run(&Cli::parse().command)).into()
}

fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Bench(benchmark) => bench::run(benchmark),
        Command::Reproduce(args) => reproduction::run(args),
        Command::Mutants(args) => mutants::run(args),
    }
}
