//! The commands.

mod bench;
mod classify;
mod input;
mod inspect;
#[cfg(feature = "mcap")]
mod live;
mod model;
mod names;
mod report;
mod sample;
mod sampler;

use clap::{Parser, Subcommand};
use formats::outcome::{Outcome, Usage};

/// Classify point clouds on a CPU with PointNet, after a Critical Points Layer
/// or another sampler.
#[derive(Parser)]
#[command(name = "infer-cpu", version, max_term_width = 100)]
#[command(after_help = "\
Exit status: 0 on success, 1 if an input failed (the message names it), 2 if the
command line is invalid.")]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Classify clouds
    Classify(Box<classify::Args>),
    /// Reduce a cloud with a sampler, and write the chosen points
    Sample(Box<sample::Args>),
    /// Show the layers of a model file, their sizes and operation counts
    Inspect(inspect::Args),
    /// Name and track the objects that a LiDAR sees, from its packets, as they come
    #[cfg(feature = "mcap")]
    Live(Box<live::Args>),
    /// Measure the latency on this machine
    Bench(Box<bench::Args>),
}

/// Does what the command line asks for.
///
/// # Errors
/// Whatever ends a command: a [`Usage`] if it is the command line's fault.
pub fn run(cli: &Cli) -> anyhow::Result<Outcome> {
    match &cli.command {
        Command::Classify(args) => classify::run(args),
        Command::Sample(args) => sample::run(args),
        Command::Inspect(args) => inspect::run(args),
        #[cfg(feature = "mcap")]
        Command::Live(args) => live::run(args),
        Command::Bench(args) => {
            bench::run(args, &model::find(args.model.as_deref())?).map(|()| Outcome::Success)
        }
    }
}

/// The error of a model or of options, as a [`Usage`] where only another
/// command line can help.
fn of_setup(error: infer_cpu::Error) -> anyhow::Error {
    use infer_cpu::Error;
    match error {
        Error::KernelMissing(_)
        | Error::KernelPrecision { .. }
        | Error::Sampler(_)
        | Error::FrontMissing { .. }
        | Error::VotesWithoutDraws(_)
        | Error::TooManyThreads(_)
        | Error::Threads { .. } => Usage(error.to_string()).into(),
        _ => error.into(),
    }
}
