//! The repository's command line: developer commands, and access to the other programs.

mod forward;
mod release_check;
mod summary;
mod test;

use clap::{Parser, Subcommand};
use forward::EDGEPUCK;
use std::ffi::OsString;
use std::process::ExitCode;
use xtask::build_pi;
use xtask::workspace::LAB;

/// Runs the developer commands of Edgepuck's repository.
///
/// All other commands, such as gen-dataset, are passed to the program `edgepuck`, which is built first if
/// necessary.
/// `cargo xtask edgepuck --help` describes them.
#[derive(Parser)]
#[command(name = "cargo xtask", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Install the packages that the tests need, and run the tests; with --all, all of them
    Test(test::Args),
    /// Check packages, binaries, dependencies and version numbers before a release
    ReleaseCheck,
    /// Build infer-cpu as one static binary for a Raspberry Pi
    BuildPi(build_pi::Args),
    /// Measure speed and accuracy: `cargo xtask bench --help`
    Bench(Forwarded),
    /// Run the program `edgepuck` with these arguments
    Edgepuck(Forwarded),
    /// A command of the program `edgepuck`
    #[command(external_subcommand)]
    Product(Vec<OsString>),
}

/// Words that another program reads, `--help` among them.
#[derive(clap::Args)]
#[command(disable_help_flag = true)]
struct Forwarded {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    words: Vec<OsString>,
}

fn main() -> ExitCode {
    let typed: Vec<OsString> = std::env::args_os().skip(1).collect();
    let done = match Cli::parse().command {
        Command::Test(args) => test::run(&args),
        Command::ReleaseCheck => release_check::run(),
        Command::BuildPi(args) => build_pi::run(&args).map(|()| 0),
        Command::Edgepuck(args) => forward::run(EDGEPUCK, &args.words),
        Command::Product(words) => forward::run(EDGEPUCK, &words),
        // The laboratory's command has the same name there.
        Command::Bench(_) => forward::run(LAB, &typed),
    };
    match done {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
