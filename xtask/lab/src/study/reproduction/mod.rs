//! `cargo xtask reproduce`: repeats the paper's experiments (Meyer and Reitmann 2026, arXiv
//! 2608.07106).
//!
//! The result of each experiment is kept, so that an interrupted run can be resumed.

mod collapse;
mod context;
mod lime;
mod page;
mod samplers;
mod sets;
#[cfg(test)]
mod tests;

use super::{datasets, plan as plans, resume};
use anyhow::Context;
use context::ExperimentContext;
use edgepuck_program::flags::need_folder_of_meshes;
use edgepuck_program::gen_dataset::report_failures;
use edgepuck_program::{Outcome, gen_shapes};
use formats::atomic;
use page::{Section, write_csv};
use sim_gpu::Caster;
use sim_gpu::internals::mesh::tree::discover;
use std::cell::RefCell;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(clap::Args)]
pub struct ReproduceArgs {
    /// ModelNet40's clouds, in any form that `train --data` accepts [default: points sampled from
    /// the meshes' surfaces]
    #[arg(long, value_name = "PATH")]
    clouds: Option<PathBuf>,

    /// Name of the clouds in the report [default: their path]
    #[arg(long, value_name = "TEXT", requires = "clouds")]
    clouds_name: Option<String>,

    /// Folder of meshes, as for gen-dataset [default: built-in shapes]
    #[arg(long, value_name = "DIR")]
    meshes: Option<PathBuf>,

    /// Name of the meshes in the report [default: their path]
    #[arg(long, value_name = "TEXT", requires = "meshes")]
    meshes_name: Option<String>,

    /// Run a subset of the experiments; this takes ten minutes on two cores
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
const DATASETS: [(&str, &str); 4] = [
    ("lidar", "--min-points 16"),
    ("noise-0.02", "--min-points 16 --sensor vlp32c --noise 0.02"),
    ("noise-0.05", "--min-points 16 --sensor vlp32c --noise 0.05"),
    ("noise-0.1", "--min-points 16 --sensor vlp32c --noise 0.1"),
];

/// Makes the datasets, runs the experiments that are not done yet, and writes `report.html` and
/// `report.csv`.
pub fn run(args: &ReproduceArgs) -> anyhow::Result<Outcome> {
    need_folder_of_meshes(args.meshes.as_deref())?;
    let plan = plans::read(args.plan.as_deref(), args.quick)?;
    let scans = args.out.join("data");
    let per_class = [gen_shapes::TRAIN_PER_CLASS, gen_shapes::TEST_PER_CLASS];
    let meshes = datasets::meshes(args.meshes.as_deref(), &scans.join("shapes"), per_class)?;
    make_datasets(&meshes, &scans)?;
    let named = |name: &Option<String>, what: &str, path: &Path| {
        name.clone().unwrap_or_else(|| format!("{what} {}", path.display()))
    };
    let meshes_are = match &args.meshes {
        Some(folder) => named(&args.meshes_name, "meshes of", folder),
        None => "built-in shapes".to_owned(),
    };
    let (clouds, clouds_are) = match &args.clouds {
        Some(path) => (path.clone(), named(&args.clouds_name, "clouds of", path)),
        None => (
            scans.join("surfaces/surface"),
            format!("surface points of {meshes_are}, in place of ModelNet40's"),
        ),
    };
    let (out, read) = (args.out.clone(), RefCell::default());
    experiments(&ExperimentContext { plan, clouds, clouds_are, scans, meshes_are, out, read })?;
    Ok(Outcome::Success)
}

/// Makes those datasets of `folder`, a folder of meshes, that `scans` lacks.
fn make_datasets(folder: &Path, scans: &Path) -> anyhow::Result<()> {
    let source = folder.canonicalize()?.display().to_string();
    resume::keep_terms(&source, &scans.join("meshes.txt"))?;
    let meshes = discover(folder, 0)?;
    datasets::surfaces(&datasets::config("")?, true, &meshes, &scans.join("surfaces"))?;
    for (name, flags) in DATASETS {
        eprintln!("dataset {name}: gen-dataset {flags}");
        let config = datasets::config(flags)?;
        let made = datasets::scans(config, &Caster::auto(), &meshes, &scans.join(name))?;
        report_failures(&made.failures);
    }
    Ok(())
}

/// Runs the experiments on data that are there, and writes the report.
fn experiments(context: &ExperimentContext) -> anyhow::Result<()> {
    let out = &context.out;
    context.check()?;
    resume::keep_terms(&context.terms()?, &out.join("terms.toml"))?;
    fs::create_dir_all(out.join("models"))?;
    let mut sections: Vec<Section> = Vec::new();
    for (name, experiment) in EXPERIMENTS {
        let path = out.join("items").join(format!("{name}.json"));
        sections.push(resume::result(&path, || {
            let begun = Instant::now();
            let section = experiment(context).with_context(|| format!("experiment {name}"))?;
            eprintln!("{name}: done in {:.0} s", begun.elapsed().as_secs_f64());
            Ok(section)
        })?);
    }
    write_csv(&sections, &out.join("report.csv"))?;
    let path = out.join("report.html");
    atomic::write_bytes(&path, page::of(&sections, &context.plan)?)?;
    println!("{}", path.display());
    Ok(())
}

type Experiment = fn(&ExperimentContext) -> anyhow::Result<Section>;

/// The order lets each experiment find the networks that it shares with earlier ones.
const EXPERIMENTS: [(&str, Experiment); 6] = [
    ("1-points", samplers::by_count),
    ("2-matrix", sets::matrix),
    ("3-collapse", collapse::run),
    ("4-samplers", samplers::run),
    ("5-lime", lime::run),
    ("6-noise", sets::noise),
];
