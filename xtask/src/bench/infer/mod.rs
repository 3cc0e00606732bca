//! `cargo xtask bench infer`: our classifier and samplers against others' on
//! the same weights and clouds, in one run, taking turns.

mod cloud;
mod contest;
mod entrant;
mod grid;
mod hosts;
mod judge;
mod model;
mod roster;
mod server;

use super::machine::Machine;
use super::venv::workshop;
use crate::Usage;
use anyhow::{Context, Result};
use clap::Args;
use cloud::Cloud;
use contest::Entry;
use entrant::{Arithmetic, Entrant, Job};
use grid::{Figure, Grid};
use hosts::{Host, Material};
use judge::{Judge, shortfall, worst};
use roster::{CLASSIFIERS, Rival, SAMPLERS};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Points of a cloud and how many of them a sampler keeps.
const SAMPLINGS: [[usize; 2]; 3] = [[1024, 128], [1024, 64], [4096, 128]];

/// What the points of the largest cloud calibrate in eight bits.
const LEAST_CLOUD: usize = 4096;

/// What `bench infer` is told.
#[derive(Args, Debug)]
pub struct InferArgs {
    /// Weights for all engines: safetensors with the key names of yanx27's
    /// `pointnet_cls` [default: random ones of its shapes].
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Sizes of the clouds to classify, points.
    #[arg(
        long,
        value_name = "N,...",
        value_delimiter = ',',
        default_value = "16,32,64,128,256,512,1024,2048,4096",
        value_parser = clap::value_parser!(u16).range(1..)
    )]
    points: Vec<u16>,
    /// Numbers of threads to classify with.
    #[arg(
        long,
        value_name = "N,...",
        value_delimiter = ',',
        default_value = "1,2",
        value_parser = clap::value_parser!(u16).range(1..)
    )]
    threads: Vec<u16>,
    /// Turns that each engine has at each job; each holds several repeats.
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = clap::value_parser!(u16).range(1..))]
    rounds: u16,
    /// Write everything measured, every repeat of it, to this file.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Measure these engines only; `ncnn` stands for `ncnn-f16` too.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    engines: Vec<String>,
    /// Measure PyTorch too, from some 3 GB of PyPI.
    #[arg(long)]
    torch: bool,
}

/// Everything that a run measured.
#[derive(Serialize)]
struct Report {
    machine: Machine,
    model: PathBuf,
    /// Of each engine.
    versions: BTreeMap<String, String>,
    classifying: Vec<Entry>,
    sampling: Vec<Entry>,
}

/// Runs the benchmark that `args` ask for.
///
/// # Errors
/// If an engine is unknown, the model cannot be read or a file not written.
pub fn run(args: &InferArgs) -> Result<()> {
    let chosen = |rivals: &[Rival]| -> Vec<Rival> {
        let with_torch = |rival: &&Rival| args.torch || rival.host != Host::Torch;
        let named = |rival: &&Rival| is_named(&args.engines, rival.name);
        rivals.iter().filter(with_torch).filter(named).copied().collect()
    };
    check_names(&args.engines)?;
    let folder = workshop().join("infer");
    let model = match &args.model {
        Some(model) => model.clone(),
        None => folder.join("random.safetensors"),
    };
    if args.model.is_none() {
        model::write_random(&model)?;
    }
    let judge = Judge::open(&model)?;
    let material = Material { model, folder };
    let most = args.points.iter().map(|&n| n.into()).fold(LEAST_CLOUD, usize::max);
    let cloud = Cloud::new(most);
    cloud.write(&material.cloud())?;

    let mut classifiers = roster::start(&chosen(&CLASSIFIERS), &material);
    let mut samplers = roster::start(&chosen(&SAMPLERS), &material);
    let mut report = Report {
        machine: Machine::here(),
        model: material.model.clone(),
        versions: versions(classifiers.iter().chain(&samplers)),
        classifying: Vec::new(),
        sampling: Vec::new(),
    };
    report.classifying = classify(&mut classifiers, args, &judge, &cloud)?;
    report.sampling = sample(&mut samplers, args, &cloud);
    if let Some(file) = &args.json {
        write(&report, file)?;
    }
    Ok(())
}

fn classify(
    entrants: &mut [Entrant],
    args: &InferArgs,
    judge: &Judge,
    cloud: &Cloud,
) -> Result<Vec<Entry>> {
    let mut entries = Vec::new();
    for &threads in &args.threads {
        let mut jobs = Vec::new();
        for &points in &args.points {
            let job = Job { points: points.into(), setting: threads.into() };
            eprintln!("{} points, {} threads", job.points, job.setting);
            let truth = judge.log_probabilities(cloud.first(job.points))?;
            let spread = Spread::of(truth.iter().copied());
            entries.extend(contest::hold(
                entrants,
                job,
                args.rounds.into(),
                |answer| worst(answer, &truth),
                |arithmetic| tolerance(arithmetic, spread.max - spread.min),
            ));
            jobs.push(job);
        }
        let title = format!("PointNet by points, {threads} threads");
        show(&Grid::new(title, &entries, jobs, |job| job.points.to_string()));
    }
    Ok(entries)
}
