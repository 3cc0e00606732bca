//! `cargo xtask bench train`: times one step of training the baseline with our program
//! and with PyTorch, in turns.

use super::candidate::{Arithmetic, Candidate, Job, Label};
use super::comparison::{Entry, compare};
use super::model::{self, worst};
use super::roster::{Material, TRAINERS, served, start};
use super::speed_tables::show;
use crate::measure::machine::Machine;
use anyhow::Result;
use clap::Args;
use formats::atomic;
use serde::Serialize;
use std::path::PathBuf;
use xtask::venv::cache_dir;
use xtask::workspace;

#[derive(Args, Debug)]
pub struct TrainArgs {
    /// Sizes of the clouds, in points.
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = super::positive,
          default_value = "64,1024")]
    points: Vec<usize>,
    /// Number of clouds in a batch.
    #[arg(long, value_name = "N", value_parser = super::positive, default_value = "24")]
    batch: usize,
    /// Number of rounds. In each round, every program takes several steps at every size; the median
    /// of all steps is shown.
    #[arg(long, value_name = "N", value_parser = super::positive, default_value = "5")]
    rounds: usize,
    /// Do not compare with PyTorch, which is a download of about 5 GB from PyPI.
    #[arg(long)]
    no_torch: bool,
    /// Write all figures, with every step, to this JSON file.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Tolerance of losses, relative: two steps of some 30 layers in fp32, batch norms of 24 clouds
/// among them, summed in different orders.
const TOLERANCE: f64 = 1e-2;

#[derive(Serialize)]
struct Report {
    machine: Machine,
    steps: Vec<Entry>,
}

pub fn run(args: &TrainArgs) -> Result<()> {
    let folder = cache_dir().join("train");
    let material = Material { model: folder.join("random.safetensors"), folder };
    model::write_random(&material.model)?;
    let most = args.points.iter().max().copied().unwrap_or(0) * args.batch;
    model::write_cloud(&model::cloud(most), &material.cloud())?;

    let mut candidates = vec![ours(&material)?];
    candidates.extend(start(&TRAINERS, |_| true, !args.no_torch, &material));
    let jobs: Vec<Job> =
        args.points.iter().map(|&points| Job { points, setting: args.batch }).collect();
    let mut steps = Vec::new();
    for &job in &jobs {
        eprintln!("{} clouds of {} points", job.setting, job.points);
        let engine = &mut candidates[0].engine;
        engine.load(job)?;
        let truth = engine.answer()?;
        let error_of = |given: &[f64]| worst(given, &truth, true);
        steps.extend(compare(&mut candidates, job, args.rounds, error_of, |_| TOLERANCE));
    }
    let title = format!("A step of training, batch {}", args.batch);
    show(&title, &steps, &jobs, |job| job.points.to_string());
    if let Some(file) = &args.json {
        let report = Report { machine: Machine::here(), steps };
        atomic::write_bytes(file, serde_json::to_string(&report)? + "\n")?;
    }
    Ok(())
}

fn ours(material: &Material) -> Result<Candidate> {
    let mut command = workspace::cargo(&["run", "--quiet", "--release", "--package", "train"]);
    command.args(["--", "serve"]).args([&material.model, &material.folder]);
    let label = Label { name: "ours".to_owned(), arithmetic: Arithmetic::F32, ours: true };
    served(label, &mut command)
}
