//! `cargo xtask bench`: measures, and writes the figures and the machine to a record.
//!
//! `bench sim` has a file for each question: the [`speed`] of building and tracing, the
//! time of a dataset [`to_disk`], which of the [`builders`] is faster for how many rays,
//! the comparison with Embree ([`peers`]), the rays lost without [`watertightness`], and
//! what [`simplify`] saves. [`infer`] is about classifying, sampling and learning,
//! [`pi5`] about a Raspberry Pi, [`numerics`] about errors, [`devices`] about adapters.

use crate::measure::{backends, bench_mesh, machine};
use crate::pi5;
use crate::rivals::{casting as peers, infer};
use crate::study::casting::{builders, simplify, speed, to_disk, watertightness};
use crate::study::{devices, numerics};
use anyhow::{Context, Result};
use clap::{Args, Subcommand};
use edgepuck_program::Outcome;
use serde::Serialize;
use sim_gpu::caster::AdapterRequest;
use std::path::PathBuf;

/// What to measure.
#[derive(Args, Debug)]
pub struct BenchArgs {
    #[command(subcommand)]
    what: Benchmark,
}

#[derive(Subcommand, Debug)]
enum Benchmark {
    /// Measure the simulator: building hierarchies, casting rays, writing a dataset to disk.
    Sim(SimArgs),
    /// Measure the classifier and the sampler against other engines, in turns.
    ///
    /// The other engines are Python packages, installed from PyPI under `target/peers`,
    /// and Rust crates, built there. An engine that cannot be installed is skipped with a
    /// message; an engine whose answer is wrong is not timed.
    Infer(infer::InferArgs),
    /// Measure a step of training against PyTorch's, in turns.
    Train(infer::learn::TrainArgs),
    /// Model the classifier on a Raspberry Pi 5 without having one.
    ///
    /// llvm-mca analyses the compiled inner loops, QEMU counts the instructions outside
    /// them, and a model adds memory and threads.
    PiModel(pi5::PiModelArgs),
    /// Measure how errors grow with scale, offset, N and K, and compare them with derived bounds.
    Growth(numerics::GrowthArgs),
    /// Compare every adapter with the CPU on the same meshes.
    Devices(devices::DevicesArgs),
}

#[derive(Args, Debug)]
struct SimArgs {
    /// Meshes to measure besides the generated ones: a file or a folder.
    meshes: Option<PathBuf>,
    /// Measure this adapter only: `auto`, `cpu` or part of a name [default: all].
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Write all figures to this JSON file.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Repeats of each measurement; the median is shown.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..))]
    rounds: u16,
    /// Sizes of the generated meshes, in triangles.
    #[arg(long, value_delimiter = ',', default_value = "1000,10000,100000,1000000")]
    triangles: Vec<usize>,
    /// Use at most this many of the given meshes, spread evenly over their list.
    #[arg(long, default_value_t = 16, value_name = "N")]
    limit: usize,
    /// Measure instead which builder is faster for how many rays.
    #[arg(long)]
    builders: bool,
    /// Compare instead with Embree, which is installed from PyPI under `target/peers`.
    #[arg(long)]
    peers: bool,
    /// Measure instead the rays that plain Möller-Trumbore in f32 loses at vertices and edges.
    #[arg(long)]
    trade: bool,
    /// Measure instead the time that `--simplify auto` saves and the errors that it makes.
    #[arg(long)]
    simplify: bool,
}

/// All figures of a run.
#[derive(Serialize)]
struct Report {
    machine: machine::Machine,
    #[serde(skip_serializing_if = "Option::is_none")]
    speed: Option<speed::Speed>,
    /// Empty unless meshes were given.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    datasets: Vec<to_disk::Dataset>,
    #[serde(skip_serializing_if = "Option::is_none")]
    builders: Option<builders::Measurements>,
    #[serde(skip_serializing_if = "Option::is_none")]
    peers: Option<peers::Comparison>,
    #[serde(skip_serializing_if = "Option::is_none")]
    trade: Option<watertightness::Watertightness>,
    #[serde(skip_serializing_if = "Option::is_none")]
    simplify: Option<simplify::Simplified>,
    peak_memory_bytes: Option<u64>,
}

/// Runs the benchmark that `args` ask for.
///
/// # Errors
/// If no mesh can be read, an adapter fails or the report cannot be written.
pub fn run(args: &BenchArgs) -> Result<Outcome> {
    match &args.what {
        Benchmark::Sim(args) => return sim(args),
        Benchmark::Infer(args) => infer::run(args),
        Benchmark::Train(args) => infer::learn::run(args),
        Benchmark::PiModel(args) => pi5::run(args),
        Benchmark::Growth(args) => numerics::run(args),
        Benchmark::Devices(args) => devices::run(args),
    }?;
    Ok(Outcome::Success)
}

fn sim(args: &SimArgs) -> Result<Outcome> {
    let request: Option<AdapterRequest> = match &args.adapter {
        Some(name) => Some(name.parse()?),
        None => None,
    };
    let mut bench_meshes = bench_mesh::tori(&args.triangles);
    if let Some(meshes) = &args.meshes {
        bench_meshes.extend(bench_mesh::real(meshes, args.limit)?);
    }
    let mut report = Report {
        machine: machine::Machine::here(),
        speed: None,
        datasets: Vec::new(),
        builders: None,
        peers: None,
        trade: None,
        simplify: None,
        peak_memory_bytes: None,
    };
    let rounds = args.rounds.into();
    if args.builders {
        let measured = builders::measure(&bench_meshes, rounds)?;
        measured.tables().iter().for_each(|table| print!("{table}"));
        report.builders = Some(measured);
    } else if args.peers {
        report.peers = peers::measure(&bench_meshes, &backends::open(request.as_ref())?, rounds)?;
        report.peers.iter().for_each(|measured| print!("{}", measured.table()));
    } else if args.trade {
        let measured = watertightness::measure(rounds)?;
        print!("{}", measured.table());
        report.trade = Some(measured);
    } else if args.simplify {
        let measured =
            simplify::measure(&bench_meshes, &backends::open(request.as_ref())?, rounds)?;
        measured.tables().iter().for_each(|table| print!("{table}"));
        report.simplify = Some(measured);
    } else {
        let backends = backends::open(request.as_ref())?;
        let measured = speed::measure(&bench_meshes, &backends, rounds)?;
        measured.tables().iter().for_each(|table| print!("{table}"));
        report.speed = Some(measured);
        if let Some(meshes) = &args.meshes {
            report.datasets = to_disk::measure(meshes, args.limit, &backends, rounds)?;
            print!("{}", to_disk::table(&report.datasets));
        }
    }
    report.peak_memory_bytes = machine::peak_memory_bytes();
    if let Some(file) = &args.json {
        let text = serde_json::to_string_pretty(&report)?;
        std::fs::write(file, text + "\n").with_context(|| format!("writing {}", file.display()))?;
    }
    Ok(Outcome::Success)
}
