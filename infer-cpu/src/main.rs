//! Classifies clouds of points without a GPU.

use clap::{CommandFactory, Parser};
use infer_cpu::cli::{Command, run};
use program::outcome::{exit_code, parsed};
use std::process::ExitCode;

/// Classify point clouds on a CPU with PointNet, after a Critical Points Layer or another sampler.
#[derive(Parser)]
#[command(name = "infer-cpu", version, max_term_width = 100)]
#[command(after_help = "\
Exit status: 0 on success, 1 if an input failed (the message names it), 2 if the
command line is invalid.")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

fn main() -> ExitCode {
    let cli: Cli = parsed(Cli::command(), std::env::args_os()).unwrap_or_else(|error| error.exit());
    exit_code(run(&cli.command)).into()
}
