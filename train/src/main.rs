//! The program `edgepuck-train`. The commands `train`, `eval`, `explain` and `compare-points` of
//! `edgepuck` and `cargo xtask` start it.

mod cli;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use cli::{compare_points, eval, explain, train};
use formats::outcome::{Outcome, exit_code};

/// Trains PointNets and evaluates them
#[derive(Parser)]
#[command(name = "edgepuck-train", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Train a network
    Train(train::TrainArgs),
    /// Measure a model's accuracy on labelled clouds
    Eval(eval::EvalArgs),
    /// Show which points determined a prediction
    Explain(explain::ExplainArgs),
    /// Compute the Chamfer distance of two clouds
    ComparePoints(compare_points::ComparePointsArgs),
}

fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Command::Train(args) => train::run(&args),
        Command::Eval(args) => eval::run(&args),
        Command::Explain(args) => explain::run(&args),
        Command::ComparePoints(args) => compare_points::run(&args),
    };
    exit_code(done.map(|()| Outcome::Success)).into()
}
