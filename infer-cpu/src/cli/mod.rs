//! The commands of the programs `infer-cpu` and `edgepuck`.

mod bench;
mod classify;
mod default_model;
mod input;
mod inspect;
#[cfg(feature = "mcap")]
mod live;
mod model;
mod report;
mod sample;
mod sampler;

use clap::Subcommand;
use program::outcome::{Outcome, Usage};

/// A command and its flags.
#[derive(Subcommand)]
pub enum Command {
    /// Classify clouds
    Classify(Box<classify::ClassifyArgs>),
    /// Reduce a cloud with a sampler, and write the chosen points
    Sample(Box<sample::SampleArgs>),
    /// Show the layers of a model file, their sizes and operation counts
    Inspect(inspect::InspectArgs),
    /// Classify and track the objects in the packets of a LiDAR
    #[cfg(feature = "mcap")]
    Live(Box<live::LiveArgs>),
    /// Measure the latency on this machine
    Bench(Box<bench::BenchArgs>),
}

/// Runs `command` in the current folder, and prints its results.
///
/// # Errors
/// With the file and the cause, or a [`Usage`].
pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Classify(args) => classify::run(args),
        Command::Sample(args) => sample::run(args),
        Command::Inspect(args) => inspect::run(args),
        #[cfg(feature = "mcap")]
        Command::Live(args) => live::run(args),
        Command::Bench(args) => {
            bench::run(args, &model::find(args.model.as_deref())).map(|()| Outcome::Success)
        }
    }
}

/// Turns an error of a model or of options into a [`Usage`] if only another command line can help.
fn of_setup(error: crate::Error) -> anyhow::Error {
    use crate::Error;
    match error {
        Error::KernelMissing(_)
        | Error::KernelPrecision { .. }
        | Error::Sampler(_)
        | Error::FrontMissing { .. }
        | Error::TooManyThreads(_) => Usage(error.to_string()).into(),
        Error::Threads { .. } => anyhow::anyhow!("{error}; --threads 1 starts none"),
        _ => error.into(),
    }
}

/// The requested number of threads, else one per core, at most as many as a Raspberry Pi has cores:
/// more never helped in measurements.
fn n_threads(requested: Option<u16>) -> usize {
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    requested.map_or_else(|| cores().min(4), usize::from)
}
