//! The commands.

mod bench;
mod classify;
mod failure;
mod input;
mod inspect;
mod model;
mod names;
mod report;
mod sample;
mod sampler;

use clap::{Parser, Subcommand};

pub use failure::{Usage, is_broken_pipe, say, told_once};

/// Classify point clouds on a CPU: PointNet behind a Critical Points Layer.
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
    /// Write the points of a cloud that a sampler chooses
    Sample(Box<sample::Args>),
    /// Show the layers of a model file and what they cost
    Inspect(inspect::Args),
    /// Measure the latency on this machine
    Bench(Box<bench::Args>),
}

/// Exit status of a completed command.
pub enum Outcome {
    /// All inputs were fine.
    Success,
    /// Some inputs failed and were named.
    SomeFailed,
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
        Command::Bench(args) => {
            bench::run(args, &model::find(args.model.as_deref())?).map(|()| Outcome::Success)
        }
    }
}
