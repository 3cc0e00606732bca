//! `cargo xtask bench train`: times one step of training the baseline with our program
//! and with PyTorch, in turns.

use super::candidate::{Arithmetic, Candidate, Job};
use super::cloud::Cloud;
use super::comparison::{Entry, compare};
use super::hosts;
use super::model;
use super::server::Server;
use super::speed_tables::SpeedTables;
use crate::measure::machine::Machine;
use anyhow::{Context, Result, ensure};
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};
use xtask::venv::cache_dir;
use xtask::workspace;

/// Flags of `bench train`.
#[derive(Args, Debug)]
pub struct TrainArgs {
    /// Sizes of the clouds, in points.
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = super::positive,
          default_value = "64,1024")]
    points: Vec<usize>,
    /// Clouds of a batch.
    #[arg(long, value_name = "N", value_parser = super::positive, default_value = "24")]
    batch: usize,
    /// Turns of each program at each size, of several steps each; the median of all
    /// steps is shown.
    #[arg(long, value_name = "N", value_parser = super::positive, default_value = "5")]
    rounds: usize,
    /// Leave PyTorch out, which downloads about 3 GB from PyPI.
    #[arg(long)]
    no_torch: bool,
    /// Write all figures, with every step, to this JSON file.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// By how much losses may differ, relatively: two steps of some 30 layers in
/// fp32, batch norms of 24 clouds among them, summed in different orders.
const TOLERANCE: f64 = 1e-2;

#[derive(Serialize)]
struct Report {
    machine: Machine,
    steps: Vec<Entry>,
}

/// Runs the benchmark that `args` ask for.
///
/// # Errors
/// If our own program cannot be built or started, or a file not written.
pub fn run(args: &TrainArgs) -> Result<()> {
    let folder = cache_dir().join("train");
    std::fs::create_dir_all(&folder)?;
    let model = folder.join("random.safetensors");
    model::write_random(&model)?;
    let most = args.points.iter().max().copied().unwrap_or(0) * args.batch;
    Cloud::new(most).write(&folder.join("cloud.safetensors"))?;

    let mut candidates = vec![ours(&model, &folder)?];
    if !args.no_torch {
        match hosts::trainer(&model, &folder).map(|mut command| Server::start(&mut command)) {
            Ok(Ok(server)) => candidates.push(candidate("torch", false, server)),
            Ok(Err(cause)) => println!("skipped torch: {cause:#}"),
            Err(cause) => println!("skipped torch: {cause}"),
        }
    }
    let jobs: Vec<Job> =
        args.points.iter().map(|&points| Job { points, setting: args.batch }).collect();
    let mut steps = Vec::new();
    for &job in &jobs {
        eprintln!("{} clouds of {} points", job.setting, job.points);
        let engine = &mut candidates[0].engine;
        engine.load(job)?;
        let truth = engine.answer()?;
        let error_of = |given: &[f64]| {
            ensure!(given.len() == truth.len(), "{} losses", given.len());
            let apart = |(a, b): (&f64, &f64)| ((a - b) / b).abs();
            Ok(given.iter().zip(&truth).map(apart).fold(0.0, f64::max))
        };
        steps.extend(compare(&mut candidates, job, args.rounds, error_of, |_| TOLERANCE));
    }
    let title = format!("A step of training, batch {}", args.batch);
    SpeedTables::new(title, &steps, jobs, |job| job.points.to_string()).show();
    if let Some(file) = &args.json {
        let text = serde_json::to_string(&Report { machine: Machine::here(), steps })?;
        std::fs::write(file, text + "\n").with_context(|| format!("writing {}", file.display()))?;
    }
    Ok(())
}

/// Our own program, built if need be.
fn ours(model: &Path, folder: &Path) -> Result<Candidate> {
    let mut command = workspace::cargo(&["run", "--quiet", "--release", "--package", "train"]);
    command.args(["--", "serve"]).arg(model).arg(folder);
    Ok(candidate("ours", true, Server::start(&mut command)?))
}

fn candidate(name: &str, ours: bool, server: Server) -> Candidate {
    Candidate {
        name: name.to_owned(),
        arithmetic: Arithmetic::F32,
        ours,
        version: server.version.clone(),
        engine: Box::new(server),
    }
}
