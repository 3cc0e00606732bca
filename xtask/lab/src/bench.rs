//! `cargo xtask bench`: measures, and writes the figures and the machine to a record.
//!
//! [`embree`] compares with Embree; [`pi5`] is about a Raspberry Pi, [`gpu`] about adapters and the time of a
//! dataset.

use crate::measure::backends;
use crate::measure::bench_mesh::{self, BenchMesh};
use crate::measure::machine::{self, Machine};
use crate::pi5;
use crate::rivals as embree;
use crate::study::gpu;
use crate::table::write_json;
use anyhow::Result;
use clap::{Args, Subcommand};
use program::Outcome;
use serde::Serialize;
use serde_json::json;
use sim_gpu::internals::caster::AdapterRequest;
use std::path::PathBuf;

#[derive(Subcommand, Debug)]
pub enum Benchmark {
    /// Compare casting with Embree, which is installed from PyPI under `target/peers`.
    Embree(EmbreeArgs),
    /// Model the run time of the classifier on a Raspberry Pi 5; no board is needed.
    ///
    /// llvm-mca analyses the compiled inner loops, QEMU counts the instructions outside them, and a
    /// model adds the effects of memory and threads.
    PiModel(pi5::PiModelArgs),
    /// Check and measure a GPU in one call of some minutes, and write gpu.json.
    ///
    /// Every shader is compared with its counterpart on the CPU, and rays are aimed at the vertices
    /// and edges of a closed surface. Then rays per second, datasets per second and memory are
    /// measured. The exit code is 1 if a comparison fails. A copy of the program runs on a machine
    /// without the workspace and without a network.
    Gpu(gpu::GpuArgs),
}

/// Meshes to cast at, and casters.
#[derive(Args, Debug)]
pub struct EmbreeArgs {
    /// Meshes to measure in addition to the generated ones: a file or a folder.
    meshes: Option<PathBuf>,
    /// Measure this adapter only: `auto`, `cpu` or part of a name [default: all].
    #[arg(long, value_name = "NAME")]
    adapter: Option<AdapterRequest>,
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
}

#[derive(Serialize)]
struct Report<T> {
    machine: Machine,
    #[serde(flatten)]
    figures: T,
    peak_memory_bytes: Option<u64>,
}

pub fn run(benchmark: &Benchmark) -> Result<Outcome> {
    match benchmark {
        Benchmark::Gpu(args) => return gpu::run(args),
        Benchmark::Embree(args) => args.embree(),
        Benchmark::PiModel(args) => pi5::run(args),
    }?;
    Ok(Outcome::Success)
}

impl EmbreeArgs {
    fn embree(&self) -> Result<()> {
        let (machine, backends) = (Machine::here(), backends::open(self.adapter.as_ref())?);
        let peers = embree::measure(&self.bench_meshes()?, &backends, self.rounds.into())?;
        let Some(peers) = peers else { return Ok(()) };
        print!("{}", peers.table());
        self.write(machine, json!({ "peers": peers }))
    }

    fn bench_meshes(&self) -> Result<Vec<BenchMesh>> {
        let mut meshes = bench_mesh::tori(&self.triangles);
        if let Some(given) = &self.meshes {
            meshes.extend(bench_mesh::real(given, self.limit)?);
        }
        Ok(meshes)
    }

    fn write(&self, machine: Machine, figures: impl Serialize) -> Result<()> {
        let peak_memory_bytes = machine::peak_memory_bytes();
        write_json(&Report { machine, figures, peak_memory_bytes }, self.json.as_deref())
    }
}
