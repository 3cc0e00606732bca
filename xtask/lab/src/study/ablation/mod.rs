//! `cargo xtask ablate`: how much each effect of a scan matters to a classifier,
//! and what it costs. Datasets are made with and without the effect, and networks
//! trained on both by the library `train`.

mod costs;
mod crossing;
mod datasets;
mod design;
mod effects;
pub mod plan;
mod positions;
mod rows;
mod sets;
mod street;
mod summary;
#[cfg(test)]
mod tests;

use super::{meshes, plan as plans, resume};
use anyhow::Context;
use datasets::{Made, bytes_per_cloud, make};
use design::Design;
use edgepuck_program::Outcome;
use edgepuck_program::flags::need_folder_of_meshes;
use effects::{DATASETS, EFFECTS, Effect, Judge};
use formats::atomic;
use plan::Plan;
use serde::Serialize;
use sim_gpu::internals::mesh::tree::{MeshEntry, discover};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Flags of `ablate`.
#[derive(clap::Args)]
pub struct Args {
    /// Folder of meshes, as for gen-dataset [default: built-in shapes]
    #[arg(long, value_name = "DIR")]
    meshes: Option<PathBuf>,

    /// Use only a few meshes or scenes; this takes two minutes
    #[arg(long, conflicts_with = "plan")]
    quick: bool,

    /// Plan of the study: its sizes, in a TOML file like those in assets/ablations
    #[arg(long, value_name = "TOML")]
    plan: Option<PathBuf>,

    /// Compare street scenes with one effect more each, and the networks that learn from them,
    /// on simulated and on real objects; see assets/ablations/street.toml
    #[arg(long, conflicts_with = "meshes")]
    street: bool,

    /// Labelled clusters of real scans that the networks of --street are tested on, in NPZ files
    /// as `eval --data` takes them; repeat the flag
    #[arg(long, value_name = "NPZ", requires = "street")]
    real: Vec<PathBuf>,

    /// Folder for ablations.csv (street/street.csv) and all intermediate files; an interrupted run is resumed
    #[arg(long, value_name = "DIR", default_value = "data/ablations")]
    out: PathBuf,
}

/// Shapes of each class that are made where no meshes are named, to train on
/// and to test with.
const SHAPES: [u32; 2] = [40, 10];

/// Makes, trains, tests and compares what is not there yet; writes
/// `ablations.csv` and `tables.txt`, and prints the latter.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    if args.street {
        let plan = plans::read(args.plan.as_deref(), args.quick)?;
        return street::run(&plan, &args.real, &args.out.join("street"));
    }
    need_folder_of_meshes(args.meshes.as_deref())?;
    let plan: Plan = plans::read(args.plan.as_deref(), args.quick)?;
    let work = args.out.join("work");
    keep_terms(&plan, args.meshes.as_deref(), &args.out)?;
    let per_class = plan.most_per_class.unwrap_or(SHAPES);
    let folder_of_meshes = meshes::folder(args.meshes.as_deref(), &work.join("shapes"), per_class)?;
    let mut meshes = discover(&folder_of_meshes, 0)?;
    if let Some(most) = plan.most_per_class {
        meshes::keep_at_most(most, &mut meshes);
    }
    let made = make_all(&plan, &meshes, &work)?;
    let compared = compare(&made)?;
    let seconds = costs::costs(&plan, &meshes, &work.join("scratch"), &work.join("costs.json"))?;
    let mut costs = BTreeMap::new();
    for (&(name, source), made) in DATASETS.iter().zip(&made) {
        let bytes_per_cloud = bytes_per_cloud(made, source)?;
        let seconds = *seconds.get(name).with_context(|| format!("no cost of {name}"))?;
        costs.insert(name, (seconds, bytes_per_cloud));
    }
    let answers = crossing::run(&Design::of(&plan), &work, &work.join("trained"))?;
    let rows = rows::rows(&answers, &compared, &costs);
    let summary = summary::of(&rows);
    atomic::write_bytes(&args.out.join("tables.txt"), summary.trim_start())?;
    let csv = args.out.join("ablations.csv");
    write_csv(&rows, &csv)?;
    println!("{summary}\n{}", csv.display());
    let failed = made.iter().any(|made| made.failures > 0);
    Ok(if failed { Outcome::SomeFailed } else { Outcome::Success })
}

/// Writes `rows` as CSV.
fn write_csv(rows: &[impl Serialize], path: &Path) -> anyhow::Result<()> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    rows.iter().try_for_each(|row| csv.serialize(row))?;
    Ok(atomic::write_bytes(path, csv.into_inner()?)?)
}

/// Writes the plan and the meshes' folder beside the results, or compares them
/// with an earlier run's.
fn keep_terms(plan: &Plan, meshes: Option<&Path>, out: &Path) -> anyhow::Result<()> {
    #[derive(Serialize)]
    struct Terms<'a> {
        version: &'a str,
        meshes: String,
        plan: &'a Plan,
    }
    let meshes = match meshes {
        Some(folder) => folder.canonicalize()?.display().to_string(),
        None => "shapes of our own".to_owned(),
    };
    let text = toml::to_string(&Terms { version: env!("CARGO_PKG_VERSION"), meshes, plan })?;
    resume::keep_terms(&text, &out.join("terms.toml"))
}

/// Where the dataset `name` lies.
fn folder(work: &Path, name: &str) -> PathBuf {
    work.join("data").join(name)
}

/// All datasets, in the order of [`DATASETS`].
fn make_all(plan: &Plan, meshes: &[MeshEntry], work: &Path) -> anyhow::Result<Vec<Made>> {
    let made = DATASETS.iter().map(|&(name, source)| {
        eprintln!("dataset {name}: {} meshes", meshes.len());
        make((name, source), plan, meshes, &folder(work, name))
            .with_context(|| format!("dataset {name}"))
    });
    made.collect()
}

/// How many scans are equal in all positions, of each effect that reaches none.
fn compare(made: &[Made]) -> anyhow::Result<BTreeMap<&'static str, usize>> {
    let made = |name: &str| {
        let made = made.iter().find(|made| made.name == name);
        made.with_context(|| format!("no dataset {name}"))
    };
    let compared = EFFECTS.iter().filter(|effect| effect.judged_by == Judge::Positions);
    let compared = compared.map(|Effect { name, with, without, .. }| {
        let n = positions::compare(made(with)?, made(without)?);
        Ok((*name, n.with_context(|| format!("effect {name}"))?))
    });
    compared.collect()
}
