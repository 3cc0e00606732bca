//! `cargo xtask bench`: measures, and writes the figures and the machine to a record.
//!
//! `bench sim` has a file for each question: the [`speed`] of building and tracing, the
//! time of a dataset [`to_disk`], which of the [`builders`] is faster for how many rays,
//! the comparison with Embree ([`peers`]), the rays lost without [`watertightness`], and
//! what [`simplify`] saves. [`scenes`] is about scenes of many objects, [`infer`] is about
//! classifying, sampling and learning, [`pi5`] about a Raspberry Pi, [`numerics`] about
//! errors, [`devices`] and [`gpu`] about adapters, [`sensor`] about how true a profile is to real
//! sweeps, [`frames`] about what is found in them, [`sydney`] about what a network that has
//! learnt from simulated scenes gives to one of real objects, [`robustness`] about what
//! classifiers make of strays, turns and few points, [`scale`] about what many scans cost.

use crate::measure::machine::{self, Machine};
use crate::measure::{backends, bench_mesh};
use crate::pi5;
use crate::render::table::Table;
use crate::rivals::{casting as peers, infer};
use crate::study::casting::{builders, scenes, simplify, speed, to_disk, watertightness};
use crate::study::{devices, frames, gpu, numerics, robustness, scale, sensor, sydney};
use anyhow::Result;
use clap::{Args, Subcommand};
use edgepuck_program::Outcome;
use formats::atomic;
use serde::Serialize;
use sim_gpu::internals::caster::AdapterRequest;
use std::path::PathBuf;

/// What to measure.
#[derive(Args, Debug)]
pub struct BenchArgs {
    #[command(subcommand)]
    what: Benchmark,
}

#[derive(Subcommand, Debug)]
enum Benchmark {
    /// Measure the simulator: building BVHs, casting rays, writing a dataset to disk.
    Sim(SimArgs),
    /// Compare what a scene of many objects costs with what its rays cost at one mesh.
    Scenes(scenes::ScenesArgs),
    /// Compare the speed of the classifier and the sampler with other engines.
    ///
    /// The engines run in alternation. The other engines are Python packages, installed from PyPI
    /// under `target/peers`, and Rust crates, built there. An engine that cannot be installed is
    /// skipped with a message; an engine whose answer is wrong is not timed.
    Infer(infer::InferArgs),
    /// Compare the time of a training step with PyTorch's.
    Train(infer::learn::TrainArgs),
    /// Model the run time of the classifier on a Raspberry Pi 5; no board is needed.
    ///
    /// llvm-mca analyses the compiled inner loops, QEMU counts the instructions outside them, and a
    /// model adds the effects of memory and threads.
    PiModel(pi5::PiModelArgs),
    /// Measure how numerical errors grow with scale, offset and size, and compare them with derived
    /// bounds.
    Growth(numerics::GrowthArgs),
    /// Compare every adapter with the CPU on the same meshes.
    Devices(devices::DevicesArgs),
    /// Check and measure a GPU in one call of some minutes, and write gpu.json.
    ///
    /// Every shader is compared with its counterpart on the CPU, and rays are aimed at the vertices
    /// and edges of a closed surface. Then rays per second, datasets per second and memory are
    /// measured. The exit code is 1 if a comparison fails. A copy of the program runs on a machine
    /// without the workspace and without a network.
    Gpu(gpu::GpuArgs),
    /// Compare a sensor's profile with real sweeps of the sensor: directions, noise, missing returns.
    Sensor(sensor::SensorArgs),
    /// Detect the cars and persons in labelled sweeps of real sensors, and count false alarms.
    Frames(frames::FramesArgs),
    /// Follow the protocol of the Sydney Urban Objects benchmark, pre-trained and from scratch.
    Sydney(sydney::SydneyArgs),
    /// Measure classifiers of whole objects on strays, turned and sparse clouds, and on no objects.
    Robustness(robustness::RobustnessArgs),
    /// Measure tasks of `gen-dataset --layout webdataset`, and model what 1e6, 1e9 and 1e12 scans cost.
    Scale(scale::ScaleArgs),
}

#[derive(Args, Debug)]
struct SimArgs {
    /// Meshes to measure in addition to the generated ones: a file or a folder.
    meshes: Option<PathBuf>,
    /// Measure this adapter only: `auto`, `cpu` or part of a name [default: all].
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Write all figures to this JSON file.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Number of repeats of each measurement; the median is shown.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..))]
    rounds: u16,
    /// Sizes of the generated meshes, in triangles.
    #[arg(long, value_delimiter = ',', default_value = "1000,10000,100000,1000000")]
    triangles: Vec<usize>,
    /// Use at most this many of the given meshes, spread evenly over their list.
    #[arg(long, default_value_t = 16, value_name = "N")]
    limit: usize,
    /// Measure only which BVH builder is faster, depending on the number of rays.
    #[arg(long)]
    builders: bool,
    /// Only compare with Embree, which is installed from PyPI under `target/peers`.
    #[arg(long)]
    peers: bool,
    /// Measure only the rays that the standard Möller-Trumbore test in f32 misses at vertices and
    /// edges.
    #[arg(long)]
    trade: bool,
    /// Measure only the time that `--simplify auto` saves and the errors that it causes.
    #[arg(long)]
    simplify: bool,
}

/// All figures of a run.
#[derive(Serialize)]
struct Report {
    machine: Machine,
    /// `None` where what was to be measured cannot be had.
    #[serde(flatten)]
    figures: Option<Figures>,
    /// Empty unless meshes were given.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    datasets: Vec<to_disk::Dataset>,
    peak_memory_bytes: Option<u64>,
}

/// What was measured, by its name in the report.
#[derive(Serialize)]
#[serde(rename_all = "lowercase")]
enum Figures {
    Speed(speed::Speed),
    Builders(builders::Measurements),
    Peers(peers::Comparison),
    Trade(watertightness::Watertightness),
    Simplify(simplify::Simplified),
}

impl Figures {
    fn tables(&self) -> Vec<Table> {
        match self {
            Self::Speed(measured) => measured.tables(),
            Self::Builders(measured) => measured.tables(),
            Self::Peers(measured) => vec![measured.table()],
            Self::Trade(measured) => vec![measured.table()],
            Self::Simplify(measured) => measured.tables(),
        }
    }
}

/// Runs the benchmark that `args` ask for.
pub fn run(args: &BenchArgs) -> Result<Outcome> {
    match &args.what {
        Benchmark::Sim(args) => return sim(args),
        Benchmark::Gpu(args) => return gpu::run(args),
        Benchmark::Scenes(args) => scenes::run(args),
        Benchmark::Infer(args) => infer::run(args),
        Benchmark::Train(args) => infer::learn::run(args),
        Benchmark::PiModel(args) => pi5::run(args),
        Benchmark::Growth(args) => numerics::run(args),
        Benchmark::Devices(args) => devices::run(args),
        Benchmark::Sensor(args) => sensor::run(args),
        Benchmark::Frames(args) => frames::run(args),
        Benchmark::Sydney(args) => sydney::run(args),
        Benchmark::Robustness(args) => robustness::run(args),
        Benchmark::Scale(args) => scale::run(args),
    }?;
    Ok(Outcome::Success)
}

fn sim(args: &SimArgs) -> Result<Outcome> {
    let request: Option<AdapterRequest> = match &args.adapter {
        Some(name) => Some(name.parse()?),
        None => None,
    };
    let mut meshes = bench_mesh::tori(&args.triangles);
    if let Some(given) = &args.meshes {
        meshes.extend(bench_mesh::real(given, args.limit)?);
    }
    let machine = Machine::here();
    let backends = || backends::open(request.as_ref());
    let rounds = args.rounds.into();
    let figures = if args.builders {
        Some(Figures::Builders(builders::measure(&meshes, rounds)?))
    } else if args.peers {
        peers::measure(&meshes, &backends()?, rounds)?.map(Figures::Peers)
    } else if args.trade {
        Some(Figures::Trade(watertightness::measure(rounds)?))
    } else if args.simplify {
        Some(Figures::Simplify(simplify::measure(&meshes, &backends()?, rounds)?))
    } else {
        Some(Figures::Speed(speed::measure(&meshes, &backends()?, rounds)?))
    };
    figures.iter().flat_map(Figures::tables).for_each(|table| print!("{table}"));
    let mut datasets = Vec::new();
    if let (Some(Figures::Speed(_)), Some(given)) = (&figures, &args.meshes) {
        datasets = to_disk::measure(given, args.limit, &backends()?, rounds)?;
        print!("{}", to_disk::table(&datasets));
    }
    let peak_memory_bytes = machine::peak_memory_bytes();
    if let Some(file) = &args.json {
        let report = Report { machine, figures, datasets, peak_memory_bytes };
        atomic::write_bytes(file, serde_json::to_string_pretty(&report)? + "\n")?;
    }
    Ok(Outcome::Success)
}
