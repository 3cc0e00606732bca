//! `cargo xtask reproduce`: repeats the paper's experiments (Meyer and Reitmann
//! 2026, arXiv 2608.07106). Datasets are made by `edgepuck`, networks trained and
//! measured by the library `train`. The result of each experiment is kept, so that
//! an interrupted run can be resumed.

mod collapse;
mod context;
mod datasets;
mod lime;
mod matrix;
mod noise;
mod page;
pub mod plan;
mod points;
mod samplers;
mod section;
#[cfg(test)]
mod tests;

use super::{meshes, plan as plans, resume};
use anyhow::Context;
use context::ExperimentContext;
use edgepuck_program::flags::need_folder_of_meshes;
use edgepuck_program::{Outcome, gen_shapes};
use formats::atomic;
use section::{Section, write_csv};
use std::cell::RefCell;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Flags of `reproduce`.
#[derive(clap::Args)]
pub struct Args {
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

/// Makes the datasets, runs the experiments that are not done yet, and writes
/// `report.html` and `report.csv`.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    need_folder_of_meshes(args.meshes.as_deref())?;
    let plan = plans::read(args.plan.as_deref(), args.quick)?;
    let scans = args.out.join("data");
    let per_class = [gen_shapes::TRAIN_PER_CLASS, gen_shapes::TEST_PER_CLASS];
    let meshes = meshes::folder(args.meshes.as_deref(), &scans.join("shapes"), per_class)?;
    datasets::make(&meshes, &scans)?;
    let meshes_are = match &args.meshes {
        Some(folder) => named(args.meshes_name.as_ref(), "meshes of", folder),
        None => "shapes of our own".to_owned(),
    };
    let (clouds, clouds_are) = match &args.clouds {
        Some(path) => (path.clone(), named(args.clouds_name.as_ref(), "clouds of", path)),
        None => (
            scans.join("surfaces/surface"),
            format!("surface points of {meshes_are}, in place of ModelNet40's"),
        ),
    };
    let out = args.out.clone();
    experiments(&ExperimentContext {
        plan,
        clouds,
        clouds_are,
        scans,
        meshes_are,
        out,
        read: RefCell::default(),
    })?;
    Ok(Outcome::Success)
}

fn named(name: Option<&String>, what: &str, path: &Path) -> String {
    name.cloned().unwrap_or_else(|| format!("{what} {}", path.display()))
}

/// Runs the experiments on data that are there, and writes the report.
fn experiments(context: &ExperimentContext) -> anyhow::Result<()> {
    let out = &context.out;
    context.check()?;
    resume::keep_terms(&context.terms()?, &out.join("terms.toml"))?;
    fs::create_dir_all(context.models())?;
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

/// In this order each finds the networks that it shares with those before it.
const EXPERIMENTS: [(&str, Experiment); 6] = [
    ("1-points", points::run),
    ("2-matrix", matrix::run),
    ("3-collapse", collapse::run),
    ("4-samplers", samplers::run),
    ("5-lime", lime::run),
    ("6-noise", noise::run),
];
