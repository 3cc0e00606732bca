//! The one command line of an Edgepuck workstation.

mod ablate;
mod adapters;
mod advise;
mod bench;
mod build_pi;
mod caster;
mod even_grid;
mod export_onnx;
mod flags;
mod gen_dataset;
mod gen_shapes;
mod import_weights;
mod merge_dataset;
mod one_scan;
mod page;
mod pi_target;
mod preview_scan;
mod rebuild;
mod report;
mod reproduce;
mod sample_surfaces;
mod scan;
mod test;
mod trade;
mod train;
mod venv;
mod workspace;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Turns CAD meshes into realistic LiDAR training data.
#[derive(Parser)]
#[command(name = "cargo xtask", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Scan a folder of meshes into a LiDAR dataset (without arguments: shapes of our own)
    GenDataset(Box<gen_dataset::Args>),
    /// Write the parametric shapes that gen-dataset uses by default as OFF files
    GenShapes(gen_shapes::Args),
    /// Spread points evenly over meshes, as ModelNet40's clouds are
    SampleSurfaces(sample_surfaces::Args),
    /// Scan one scene
    Scan(scan::Args),
    /// Draw a scan from the side, from above and from the front
    Preview(preview_scan::Args),
    /// List the adapters that can cast
    Adapters,
    /// Measure speed and accuracy
    Bench(bench::BenchArgs),
    /// Build infer-cpu as one static file for a Raspberry Pi
    BuildPi(build_pi::Args),
    /// Make one dataset of the shards of one
    MergeDataset(merge_dataset::Args),
    /// Turn a PyTorch checkpoint into a model file for infer-cpu
    ImportWeights(import_weights::Args),
    /// Write a model file as ONNX, for other engines
    ExportOnnx(export_onnx::Args),
    /// Train a network: `cargo xtask train --help`
    #[command(disable_help_flag = true)]
    Train(train::Args),
    /// Measure a model's accuracy on labelled clouds: `cargo xtask eval --help`
    #[command(disable_help_flag = true)]
    Eval(train::Args),
    /// Show what a model's answer rests on: `cargo xtask explain --help`
    #[command(disable_help_flag = true)]
    Explain(train::Args),
    /// Tell how far two clouds are apart: `cargo xtask compare-points A B`
    #[command(disable_help_flag = true)]
    ComparePoints(train::Args),
    /// Run the paper's experiments again, and write one report
    Reproduce(reproduce::Args),
    /// Measure what each knob, from mesh to class, costs and what it is worth
    Trade(trade::Args),
    /// Name one configuration for a device, out of what trade measured
    Advise(advise::Args),
    /// Gather everything that was measured into one page
    Report(report::Args),
    /// Measure what each effect of a scan is worth to a classifier, and what it costs
    Ablate(ablate::Args),
    /// Install what tests need and run all of them
    Test(test::Args),
}

/// How a command that ran to its end ended.
enum Outcome {
    /// All inputs were fine.
    Success,
    /// Some inputs failed and were named.
    SomeFailed,
    /// Another process did what was asked, and ended with this.
    Elsewhere(u8),
}

fn main() -> ExitCode {
    let outcome = match Cli::parse().command {
        Command::GenDataset(args) => gen_dataset::run(&args),
        Command::GenShapes(args) => gen_shapes::run(&args),
        Command::SampleSurfaces(args) => sample_surfaces::run(&args),
        Command::Scan(args) => scan::run(&args),
        Command::Preview(args) => preview_scan::run(&args),
        Command::Adapters => adapters::run(),
        Command::Bench(args) => bench::run(&args),
        Command::BuildPi(args) => build_pi::run(&args),
        Command::MergeDataset(args) => merge_dataset::run(&args),
        Command::ImportWeights(args) => import_weights::run(&args),
        Command::ExportOnnx(args) => export_onnx::run(&args),
        Command::Train(args) => train::run("train", &args),
        Command::Eval(args) => train::run("eval", &args),
        Command::Explain(args) => train::run("explain", &args),
        Command::ComparePoints(args) => train::run("compare-points", &args),
        Command::Reproduce(args) => reproduce::run(&args),
        Command::Trade(args) => trade::run(&args),
        Command::Advise(args) => advise::run(&args),
        Command::Report(args) => report::run(&args),
        Command::Ablate(args) => ablate::run(&args),
        Command::Test(args) => test::run(&args),
    };
    match outcome {
        Ok(Outcome::Success) => ExitCode::SUCCESS,
        Ok(Outcome::SomeFailed) => ExitCode::from(1),
        Ok(Outcome::Elsewhere(code)) => ExitCode::from(code),
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", told_once(&error));
            ExitCode::from(if error.is::<Usage>() { 2 } else { 1 })
        }
    }
}

/// A command line that asks for something that cannot be.
#[derive(Debug)]
struct Usage(String);

impl std::fmt::Display for Usage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Usage {}

/// The error and its causes, but for those that an outer one spells out.
fn told_once(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |told, cause| {
        if told.is_empty() {
            cause
        } else if told.contains(&cause) {
            told
        } else {
            format!("{told}: {cause}")
        }
    })
}

/// Whether whoever read our output has gone, which is no failure of ours.
fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error
        .chain()
        .filter_map(|cause| cause.downcast_ref::<std::io::Error>())
        .any(|cause| cause.kind() == std::io::ErrorKind::BrokenPipe)
}
