//! `edgepuck gen-dataset`: a folder of meshes into a LiDAR dataset.

mod bar;
mod card;
mod empty;
mod example;
mod settings;
mod summary;
mod tars;

use crate::caster::CasterArgs;
use crate::shard::Shard;
use crate::{Outcome, Usage, flags, gen_shapes, signals};
use anyhow::Context;
use edgepuck_dataset::{
    Begin, DatasetError, Layout, Manifest, MeshEntry, MeshFailure, Plan, Progress, discover, make,
    verify,
};
use edgepuck_shapes as shapes;
use formats::counted;
use formats::hash::Hashing;
use program::outputs::check_place;
use settings::Settings;
use sim_gpu::Caster;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::SeqCst;
use std::time::Instant;

/// Folder of the built-in shapes, to which the seed is appended.
const DEFAULT_SHAPES: &str = "data/default-shapes";

/// Folder of the dataset of the built-in shapes.
const DEFAULT_OUT: &str = "data/lidar-shapes";

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder of meshes, such as CLASS/{train,test}/NAME [default: built-in shapes]
    ///
    /// OBJ, OFF, PLY, STL and glTF files are read. The built-in procedural shapes are written to
    /// data/default-shapes-SEED.
    #[arg(value_name = "MESHES")]
    meshes: Option<PathBuf>,

    /// Folder to write the dataset to [default: data/lidar-MESHES]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Only check a finished dataset against its manifest
    #[arg(long, value_name = "DIR", exclusive = true)]
    verify: Option<PathBuf>,

    /// Continue an interrupted run
    ///
    /// The dataset has the same bytes as without the interruption.
    #[arg(long, conflicts_with = "overwrite")]
    resume: bool,

    /// Replace an existing dataset in the folder
    #[arg(long)]
    overwrite: bool,

    /// Make only part I of N; `merge-dataset` joins the parts
    ///
    /// `auto/N` takes the part from the environment of a job array, counted from 0:
    /// SLURM_ARRAY_TASK_ID, JOB_COMPLETION_INDEX (Kubernetes) or HQ_TASK_ID (HyperQueue).
    #[arg(long, value_name = "I/N|auto/N")]
    shard: Option<Shard>,

    #[command(flatten)]
    tars: tars::TarArgs,

    #[command(flatten)]
    settings: Settings,

    #[command(flatten)]
    caster: CasterArgs,

    #[command(flatten)]
    shapes: gen_shapes::ShapeArgs,

    #[command(flatten)]
    card: card::CardArgs,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<Outcome> {
    if let Some(folder) = &args.verify {
        return check(folder);
    }
    if let Some(folder) = &args.card.card {
        return args.card.write(folder, args.overwrite);
    }
    if let Some(folder) = &args.shapes.save_meshes {
        return args.shapes.write(folder, args.settings.seed(), args.overwrite);
    }
    let progress = Progress::default();
    let config = args.settings.config()?;
    config.check().map_err(usage)?;
    let are_tars = config.layouts.contains(&Layout::Webdataset);
    if let Some(flag) = args.tars.given().filter(|_| !are_tars) {
        return Err(usage(format!("{flag} applies to tars only: add --layout webdataset")));
    }
    let (meshes_folder, default_out) = match &args.meshes {
        Some(folder) => (folder.clone(), default_out(folder)),
        None => (write_default_shapes(config.seed)?, PathBuf::from(DEFAULT_OUT)),
    };
    let out = args.out.clone().unwrap_or(default_out);
    let meshes = listed(&meshes_folder, config.seed)?;
    let absolute = |folder: &Path| folder.canonicalize().ok();
    if absolute(&out).is_some_and(|out| absolute(&meshes_folder) == Some(out)) {
        let out = out.display();
        return Err(usage(format!("--out: {out} is the folder of the meshes: name another")));
    }
    check_place(&out.join("manifest.json"))?;
    let caster = args.caster.caster()?;
    let plan = Plan {
        part: args.shard.map(|shard| (shard.number, shard.of)),
        begin: match (args.resume, args.overwrite) {
            (true, _) => Begin::Resume,
            (_, true) => Begin::Overwrite,
            _ => Begin::Fresh,
        },
        ..Plan::new(&out, &config, &meshes)
    };
    let made = if are_tars {
        tars::run(&args.tars, &plan, &caster, &progress)
    } else {
        make_files(&plan, &caster, &progress)
    };
    made.or_else(|error| match error.downcast_ref() {
        Some(DatasetError::Interrupted { .. }) => {
            program::say!("{}: {error}", out.display());
            Ok(Outcome::Interrupted)
        }
        // Another command line helps, and trying again does not.
        Some(
            DatasetError::Occupied { .. }
            | DatasetError::InTheWay { .. }
            | DatasetError::Different { .. }
            | DatasetError::Layout { .. },
        ) => Err(usage(error)),
        _ => Err(error),
    })
}

fn make_files(plan: &Plan, caster: &Caster, progress: &Progress) -> anyhow::Result<Outcome> {
    let started = Instant::now();
    let manifest =
        bar::beside(progress, || signals::stop(progress, || make(plan, caster, progress)))?;
    if progress.is_scanned.load(SeqCst) {
        report_failures(&manifest.failures);
        summary::print(plan.out, &manifest, progress, started.elapsed());
    } else {
        program::say!("{}: the dataset is already complete.", plan.out.display());
        summary::tell_failures(plan.out, &manifest);
    }
    end(plan.out, &manifest)
}

/// The meshes in `folder`; prints what is odd about its layout.
pub fn listed(folder: &Path, seed: u64) -> anyhow::Result<Vec<MeshEntry>> {
    let meshes = discover(folder, seed)?;
    for warning in edgepuck_mesh::tree::warnings(folder, &meshes) {
        program::say!("warning: {}: {warning}", folder.display());
    }
    Ok(meshes)
}

/// Prints the meshes that failed, with the causes.
pub fn report_failures(failures: &[MeshFailure]) {
    for failure in failures {
        program::say!("failed: {failure}");
    }
}

/// Draws the example picture, which is missing after an interruption, and prints its path.
pub(crate) fn end(out: &Path, manifest: &Manifest) -> anyhow::Result<Outcome> {
    match example::draw(out, manifest).context("cannot draw the example")? {
        Some(picture) => {
            program::say!("Open this picture to see an example: {}", picture.display())
        }
        None => program::say!("No scan holds a point, so no example picture was drawn."),
    }
    let has_clouds = empty::report_empty_sets(manifest) && empty::report_empty_packed(manifest);
    Ok(match manifest.failures.is_empty() && has_clouds {
        true => Outcome::Success,
        false => Outcome::SomeRefused,
    })
}

/// Verifies the dataset in `folder` and prints its problems, one a line.
fn check(folder: &Path) -> anyhow::Result<Outcome> {
    let report = verify(flags::dataset_folder(folder))?;
    let by = match report.hash {
        Hashing::None => "read, without hashes to compare",
        Hashing::Sha256 => "checked",
    };
    let mut out = std::io::stdout().lock();
    for problem in &report.problems {
        writeln!(out, "{problem}")?;
    }
    let problems = counted(report.problems.len(), "problem");
    program::say!("{}: {} {by}, {problems}.", folder.display(), counted(report.files, "file"));
    Ok(if report.is_sound() { Outcome::Success } else { Outcome::SomeFailed })
}

fn write_default_shapes(seed: u64) -> anyhow::Result<PathBuf> {
    // Each seed has its own folder, so that meshes of different runs do not mix.
    let folder = PathBuf::from(format!("{DEFAULT_SHAPES}-{seed}"));
    program::say!(
        "No meshes were named: writing built-in procedural shapes to {}.",
        folder.display()
    );
    shapes::write_tree(&folder, seed, gen_shapes::TRAIN_PER_CLASS, gen_shapes::TEST_PER_CLASS)
        .context("cannot write the shapes")?;
    Ok(folder)
}

/// `data/lidar-NAME` for the folder called NAME.
fn default_out(meshes: &Path) -> PathBuf {
    let absolute = std::path::absolute(meshes).unwrap_or_else(|_| meshes.to_owned());
    let name = absolute.file_stem().map_or("meshes".into(), |name| name.to_string_lossy());
    Path::new("data").join(format!("lidar-{name}"))
}

fn usage(message: impl std::fmt::Display) -> anyhow::Error {
    Usage(message.to_string()).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{CommandFactory, Parser};

    #[derive(Parser)]
    #[command(term_width = 100)]
    struct Words {
        #[command(flatten)]
        _args: Args,
    }

    #[test]
    fn the_short_help_fits_one_screen() {
        let help = Words::command().render_help().to_string();
        assert!(help.lines().count() <= 45, "{} lines:\n{help}", help.lines().count());
    }
}
