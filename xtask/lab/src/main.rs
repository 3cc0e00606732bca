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
use study::{ablation, reproduction, trade};

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
    Bench(bench::BenchArgs),
    /// Sweep every parameter from the mesh to the class, and record time and accuracy
    Trade(trade::Args),
    /// Measure how much each effect of a scan matters to a classifier, and what it costs
    Ablate(ablation::Args),
    /// Reproduce the paper's experiments, and write one report
    Reproduce(reproduction::Args),
    /// Show the results of all measurements on one HTML page
    Report(report::Args),
}

fn main() -> ExitCode {
    outcome::exit_code(run(&Cli::parse().command)).into()
}

fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Bench(args) => bench::run(args),
        Command::Trade(args) => trade::run(args),
        Command::Ablate(args) => ablation::run(args),
        Command::Reproduce(args) => reproduction::run(args),
        Command::Report(args) => report::run(args),
    }
}
