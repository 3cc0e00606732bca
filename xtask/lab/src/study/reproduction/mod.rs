//! `cargo xtask reproduce`: repeats the paper's experiments on accuracy (Meyer and Reitmann 2026,
//! arXiv 2608.07106).
//!
//! Datasets and networks are kept, so that an interrupted run can be resumed.

mod context;
mod experiments;
#[cfg(test)]
mod tests;

use super::resume;
use crate::table::publish;
use anyhow::{Context, Result};
use context::{ExperimentContext, Plan};
use edgepuck_dataset::{
    Begin, DatasetConfig, MeshEntry, Progress, SurfaceConfig, Views, make, write_surfaces,
};
use edgepuck_program::gen_dataset::{self, report_failures};
use edgepuck_program::{Outcome, gen_shapes};
use edgepuck_shapes::write_tree;
use experiments::{EXPERIMENTS, Network, networks};
use formats::atomic;
use sim_gpu::Caster;
use sim_gpu::internals::mesh::tree::discover;
use std::cell::RefCell;
use std::fs;
use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::thread;

#[derive(clap::Args)]
pub struct ReproduceArgs {
    /// ModelNet40's clouds, in any form that `train --data` accepts [default: points sampled from
    /// the meshes' surfaces]
    #[arg(long, value_name = "PATH")]
    clouds: Option<PathBuf>,

    /// Folder of meshes, as for gen-dataset [default: built-in shapes]
    #[arg(long, value_name = "DIR")]
    meshes: Option<PathBuf>,

    /// Run a subset of the experiments; this takes two minutes on two cores
    #[arg(long, conflicts_with = "plan")]
    quick: bool,

    /// Plan of the experiments: their sizes, in a TOML file like those in assets/reproduce
    #[arg(long, value_name = "TOML")]
    plan: Option<PathBuf>,

    /// Folder for the report and all intermediate files; an interrupted run is resumed
    #[arg(long, value_name = "DIR", default_value = "data/reproduce")]
    out: PathBuf,
}

/// The datasets of scans: a folder, and flags of `gen-dataset`.
const DATASETS: [(&str, &str); 3] = [
    ("static", "--min-points 16 --sensor generic-static"),
    ("blainder", "--min-points 16 --sensor blainder-ultrapuck"),
    ("vlp32c", "--min-points 16 --sensor vlp32c"),
];

/// Makes the datasets, runs the experiments, and writes `report.md`.
pub fn run(args: &ReproduceArgs) -> Result<Outcome> {
    let plan = Plan::read(args.plan.as_deref(), args.quick)?;
    let scans = args.out.join("data");
    let meshes = match &args.meshes {
        Some(folder) => folder.clone(),
        None => {
            let (folder, train) = (scans.join("shapes"), gen_shapes::TRAIN_PER_CLASS);
            write_tree(&folder, 0, train, gen_shapes::TEST_PER_CLASS)
                .context("cannot write the shapes")?;
            folder
        }
    };
    make_datasets(&meshes, &scans)?;
    let clouds = args.clouds.clone().unwrap_or_else(|| scans.join("surfaces/surface"));
    let (out, read) = (args.out.clone(), RefCell::default());
    run_all(&ExperimentContext { plan, clouds, scans, out, read })?;
    Ok(Outcome::Success)
}

/// Makes those datasets of `folder`, a folder of meshes, that `scans` lacks.
fn make_datasets(folder: &Path, scans: &Path) -> Result<()> {
    let source = folder.canonicalize();
    let source = source.with_context(|| format!("--meshes: cannot find {}", folder.display()))?;
    let source = source.display().to_string();
    resume::keep_terms(&source, &scans.join("meshes.txt"))?;
    let meshes = discover(folder, 0)?;
    surfaces(&config("")?, &meshes, &scans.join("surfaces"))?;
    for (name, flags) in DATASETS {
        eprintln!("dataset {name}: gen-dataset {flags}");
        let (config, out) = (config(flags)?, scans.join(name));
        let plan = edgepuck_dataset::Plan::new(&out, &config, &meshes);
        let plan = edgepuck_dataset::Plan { begin: Begin::Resume, ..plan };
        report_failures(&make(&plan, &Caster::auto(), &Progress::default())?.failures);
    }
    Ok(())
}

/// The configuration of `gen-dataset` with `flags`, separated by spaces.
fn config(flags: &str) -> Result<DatasetConfig> {
    let words: Vec<String> = flags.split_whitespace().map(str::to_owned).collect();
    gen_dataset::config(&words).with_context(|| format!("gen-dataset {flags}"))
}

/// Samples the surfaces of `meshes` into `surface-*.npz` in `out`, unless that is done.
fn surfaces(config: &DatasetConfig, meshes: &[MeshEntry], out: &Path) -> Result<()> {
    let done = out.join("failures.txt");
    if done.is_file() {
        return Ok(());
    }
    atomic::sweep_leftovers(out)?;
    let surfaces = SurfaceConfig {
        seed: config.seed,
        normalize: config.normalize,
        up: config.up,
        points: config.packed_points,
        min_points: config.min_points,
        views: Views { count: 0, ..Views::ROTATING },
    };
    let failures = write_surfaces(out, &surfaces, meshes, &Progress::default())?.len();
    Ok(atomic::write_bytes(&done, failures.to_string())?)
}

/// Runs the experiments on data that are there, and writes the report.
fn run_all(context: &ExperimentContext) -> Result<()> {
    let out = &context.out;
    context.check()?;
    resume::keep_terms(&context.terms()?, &out.join("terms.toml"))?;
    fs::create_dir_all(out.join("models"))?;
    println!("{}", context.plan.about);
    train_all(networks(context)?)?;
    let tables = EXPERIMENTS.iter().map(|experiment| experiment(context));
    publish(&tables.collect::<Result<Vec<_>>>()?, Some(&out.join("report.md")))
}

/// Trains those of `networks` that are not there, as many at once as there are cores: one network alone
/// does not keep two cores busy. The bytes do not depend on the threads. After an error, those that
/// have begun are finished.
fn train_all(networks: Vec<Network>) -> Result<()> {
    let cores = thread::available_parallelism().map_or(1, usize::from);
    let at_once = cores.min(networks.len()).max(1);
    let rest = Mutex::new(networks.into_iter());
    let rest = || rest.lock().unwrap_or_else(PoisonError::into_inner);
    let work = || -> Result<()> {
        let own = rayon::ThreadPoolBuilder::new().num_threads(cores / at_once).build()?;
        loop {
            let Some(network) = rest().next() else { return Ok(()) };
            own.install(|| network.train()).inspect_err(|_| rest().by_ref().for_each(drop))?;
        }
    };
    thread::scope(|scope| {
        let workers: Vec<_> = (0..at_once).map(|_| scope.spawn(work)).collect();
        let ends = workers
            .into_iter()
            .map(|worker| worker.join().unwrap_or_else(|panic| resume_unwind(panic)));
        ends.collect()
    })
}
