//! `cargo xtask reproduce`: the paper's experiments, run again (Meyer and
//! Reitmann 2026, arXiv 2608.07106). `xtask` makes the datasets; here networks
//! are trained, measured and reported. Each experiment is kept once it is done,
//! so that a run that was interrupted goes on.

mod chart;
mod collapse;
mod lime;
mod matrix;
mod noise;
mod page;
mod plan;
mod points;
mod samplers;
mod section;
mod workshop;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use formats::atomic;

use plan::Plan;
use section::{Section, write_csv};
use workshop::Workshop;

use crate::once;

/// Flags of `reproduce`.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// ModelNet40's clouds, as `train --data` takes them
    #[arg(long, value_name = "PATH")]
    clouds: PathBuf,
    /// What the report calls them
    #[arg(long, value_name = "TEXT")]
    clouds_are: String,
    /// Scans and surfaces of meshes, as `cargo xtask reproduce` makes them
    #[arg(long, value_name = "DIR")]
    scans: PathBuf,
    /// What the report calls the meshes
    #[arg(long, value_name = "TEXT")]
    meshes_are: String,
    /// The experiments' sizes [default: assets/reproduce/full.toml]
    #[arg(long, value_name = "TOML")]
    plan: Option<PathBuf>,
    /// A subset, in ten minutes on two cores: assets/reproduce/quick.toml
    #[arg(long, conflicts_with = "plan")]
    quick: bool,
    /// Where the report goes, and what it is made from
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// What the report names as its command
    #[arg(long, value_name = "TEXT")]
    command: String,
}

type Experiment = fn(&Workshop) -> anyhow::Result<Section>;

/// In the order in which they share networks.
const EXPERIMENTS: [(&str, Experiment); 6] = [
    ("1-points", points::run),
    ("2-matrix", matrix::run),
    ("3-collapse", collapse::run),
    ("4-samplers", samplers::run),
    ("5-lime", lime::run),
    ("6-noise", noise::run),
];

/// Runs what is not done yet, and writes `report.html` and `report.csv`.
///
/// # Errors
/// Data that cannot be used; another plan than that of an earlier run.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let plan = Plan::read(args.plan.as_deref(), args.quick)?;
    let shop = Workshop::new(
        plan,
        (&args.clouds, &args.clouds_are),
        (&args.scans, &args.meshes_are),
        &args.out,
    );
    shop.check()?;
    once::keep_terms(&shop.terms()?, &args.out)?;
    fs::create_dir_all(&shop.models)?;
    let mut sections = Vec::new();
    for (name, experiment) in EXPERIMENTS {
        sections.push(done(&shop, name, experiment, &args.out)?);
    }
    write_csv(&sections, &args.out.join("report.csv"))?;
    let page = page::of(&sections, &shop.plan, &args.command)?;
    let path = args.out.join("report.html");
    atomic::write_bytes(&path, &page)?;
    println!("{}", path.display());
    Ok(())
}

/// What experiment `name` came to, from an earlier run or from this.
fn done(
    shop: &Workshop,
    name: &str,
    experiment: Experiment,
    out: &Path,
) -> anyhow::Result<Section> {
    let path = out.join("items").join(format!("{name}.json"));
    if path.is_file() {
        let text = fs::read_to_string(&path)?;
        return serde_json::from_str(&text).with_context(|| path.display().to_string());
    }
    let begun = Instant::now();
    let section = experiment(shop).with_context(|| format!("experiment {name}"))?;
    let json = serde_json::to_string(&section)?;
    atomic::write_bytes(&path, &json)?;
    eprintln!("{name}: done in {:.0} s", begun.elapsed().as_secs_f64());
    Ok(section)
}
