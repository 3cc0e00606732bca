//! The laboratory: everything that measures Edgepuck, which `cargo xtask` starts.

mod bench;
mod measure;
mod pi5;
mod rivals;
mod study;
mod table;

use clap::{Parser, Subcommand};
use program::outcome;
use std::process::ExitCode;

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
}

fn main() -> ExitCode {
    let Command::Bench(benchmark) = Cli::parse().command;
    outcome::exit_code(bench::run(&benchmark)).into()
}
