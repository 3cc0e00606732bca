//! Classifies clouds of points without a GPU.

use clap::{CommandFactory, Parser};
use infer_cpu::cli::{Command, run};
use program::outcome::{EXIT_CODES, exit_code, parsed};
use std::process::ExitCode;

/// Classify point clouds on a CPU with PointNet, after a Critical Points Layer or another sampler.
#[derive(Parser)]
#[command(name = "infer-cpu", version, max_term_width = 100)]
#[command(after_help = EXIT_CODES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

fn main() -> ExitCode {
    let cli: Cli = parsed(Cli::command(), std::env::args_os()).unwrap_or_else(|error| error.exit());
    exit_code(run(&cli.command)).into()
}
