//! Classifies clouds of points without a GPU.

mod cli;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    formats::outcome::exit_code(cli::run(&cli::Cli::parse())).into()
}
