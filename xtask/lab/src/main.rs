//! The laboratory: everything that measures Edgepuck, which `cargo xtask` starts.

mod bench;
mod measure;
mod pi5;
mod render;
mod report;
mod rivals;
mod study;

use clap::{Parser, Subcommand};
use edgepuck_program::{Outcome, outcome};
use std::process::ExitCode;
use study::{ablation, mutants, reproduction, trade};

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
    /// Sweep every parameter from the mesh to the class, and record time and accuracy
    Trade(trade::TradeArgs),
    /// Measure how much each effect of a scan matters to a classifier, and its cost
    #[command(subcommand)]
    Ablate(ablation::Ablation),
    /// Reproduce the paper's experiments, and write one report
    Reproduce(reproduction::ReproduceArgs),
    /// Change the code in one place at a time, and count the changes that the tests notice
    Mutants(mutants::MutantsArgs),
    /// Show the results of all measurements on one HTML page
    Report(report::ReportArgs),
}

fn main() -> ExitCode {
    outcome::exit_code(run(&Cli::parse().command)).into()
}

fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Bench(benchmark) => bench::run(benchmark),
        Command::Trade(args) => trade::run(args),
        Command::Ablate(ablation) => ablation::run(ablation),
        Command::Reproduce(args) => reproduction::run(args),
        Command::Mutants(args) => mutants::run(args),
        Command::Report(args) => report::run(args),
    }
}
