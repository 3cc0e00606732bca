//! `edgepuck gen-dataset`: a folder of meshes into a LiDAR dataset.

mod bar;
mod example;
mod settings;
mod shard;
mod summary;
mod tars;

use crate::caster::CasterArgs;
use crate::{Outcome, Usage, flags, gen_shapes};
use anyhow::Context;
use clap::Parser;
use clap::error::ErrorKind;
use edgepuck_dataset::check_layouts;
use edgepuck_dataset::config::{DatasetConfig, Layout};
use edgepuck_dataset::finish::finish;
use edgepuck_dataset::journal::Terms;
use edgepuck_dataset::manifest::Manifest;
use edgepuck_dataset::pipeline::{Run, scan_all};
use edgepuck_dataset::progress::Progress;
use edgepuck_dataset::start::{Begin, Start, begin};
use edgepuck_dataset::verify::verify;
use edgepuck_dataset::{DatasetError, MeshFailure};
use edgepuck_shapes as shapes;
use formats::hash::Hashing;
use settings::Settings;
use shard::Shard;
use signal_hook::consts::SIGTERM;
use sim_gpu::internals::mesh::tree::{MeshEntry, discover};
use std::collections::BTreeSet;
use std::fmt::Display;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::SeqCst};
use std::time::Instant;

/// Where the meshes of a run without meshes are written, a seed behind it.
const DEFAULT_SHAPES: &str = "data/default-shapes";

/// Where the dataset of a run without meshes is written.
const DEFAULT_OUT: &str = "data/lidar-shapes";

/// Flags of `gen-dataset`.
#[derive(clap::Args)]
pub struct Args {
    /// Folder of OBJ, OFF, PLY and STL files, as CLASS/{train,test}/NAME or in any other layout
    /// [default: built-in procedural shapes, written to data/default-shapes-SEED]
    #[arg(value_name = "MESHES")]
    meshes: Option<PathBuf>,

    /// Folder to write the dataset to [default: data/lidar-MESHES, or data/lidar-shapes]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Only check a finished dataset against its manifest
    #[arg(long, value_name = "DIR", exclusive = true)]
    verify: Option<PathBuf>,

    /// Continue an interrupted run; the dataset has the same bytes as without the interruption
    #[arg(long, conflicts_with = "overwrite")]
    resume: bool,

    /// Replace an existing dataset in the folder
    #[arg(long)]
    overwrite: bool,

    /// Make only part I of N of the dataset; `merge-dataset` joins the parts. `auto/N` takes the
    /// part from the environment of a job array, counted from 0: SLURM_ARRAY_TASK_ID,
    /// JOB_COMPLETION_INDEX (Kubernetes) or HQ_TASK_ID (HyperQueue). `auto` asks Slurm for N, too
    #[arg(long, value_name = "I/N|auto/N|auto")]
    shard: Option<Shard>,

    #[command(flatten)]
    tars: tars::TarArgs,

    #[command(flatten)]
    settings: Settings,

    #[command(flatten)]
    caster: CasterArgs,
}

/// The configuration of a dataset that is made with these `flags`, such as `--distance=2,10`.
///
/// # Errors
/// A flag that is none or has no such value; a sensor that is missing or does not go with the
/// others.
pub fn config(flags: &[String]) -> anyhow::Result<DatasetConfig> {
    Settings::try_parse_from(behind_name(flags))?.config()
}

/// A command line of these `words`, which begins with the program's name.
fn behind_name(words: &[String]) -> impl Iterator<Item = &str> {
    std::iter::once("gen-dataset").chain(words.iter().map(String::as_str))
}

/// Checks words that are to be given to the tasks of a cluster, which read and write the same folders.
/// These need not be here.
///
/// # Errors
/// As [`config`]; no meshes, no output folder, or no tars.
pub fn check_words_of_tasks(words: &[String]) -> anyhow::Result<()> {
    #[derive(Parser)]
    struct Words {
        #[command(flatten)]
        args: Args,
    }
    let parsed = Words::try_parse_from(behind_name(words));
    let Words { args } = parsed.map_err(|error| match error.kind() {
        ErrorKind::DisplayHelp => Usage("--help: tasks make a dataset".to_owned()),
        _ => Usage(error.to_string().trim_start_matches("error: ").to_owned()),
    })?;
    let config = args.settings.config()?;
    let missing = [
        (args.meshes.is_none(), "the folder of the meshes"),
        (args.out.is_none(), "--out"),
        (!config.layouts.contains(&Layout::Webdataset), "--layout webdataset"),
    ];
    if let Some((_, word)) = missing.into_iter().find(|(is_missing, _)| *is_missing) {
        let cause = format!("expected {word} among the words: tasks share folders and make tars");
        return Err(Usage(cause).into());
    }
    tars::check(&config)
}

/// Makes or verifies a dataset.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    if let Some(folder) = &args.verify {
        return check(folder);
    }
    let config = args.settings.config()?;
    flags::need_simplification(config.simplify.is_some())?;
    let (meshes_folder, default_out) = match &args.meshes {
        Some(folder) => (folder.clone(), default_out(folder)),
        None => (write_default_shapes(config.seed)?, PathBuf::from(DEFAULT_OUT)),
    };
    let out = args.out.clone().unwrap_or(default_out);
    let meshes = discover(&meshes_folder, config.seed)?;
    if config.layouts.contains(&Layout::Webdataset) {
        return tars::run(args, &out, &config, &meshes);
    }
    let meshes = shard(meshes, args.shard);
    let classes: BTreeSet<String> = meshes.iter().map(|mesh| mesh.class.clone()).collect();
    check_layouts(&config, &Vec::from_iter(classes))?;
    let caster = args.caster.open(&config.cast_effects())?;
    let part = args.shard.map(|shard| (shard.number, shard.of));
    let terms = Terms::new(config, &caster, &meshes, part);
    let how = match (args.resume, args.overwrite) {
        (true, _) => Begin::Resume,
        (_, true) => Begin::Overwrite,
        _ => Begin::Fresh,
    };
    if let Start::Complete(manifest) = begin(&out, &terms, how)? {
        eprintln!("{}: the dataset is already complete.", out.display());
        return end(&out, &manifest);
    }

    let started = Instant::now();
    let progress = Progress::default();
    let (config, culling) = (&terms.config, args.caster.culling());
    let is_over = Arc::new(AtomicBool::new(false));
    // Once all is scanned, SIGTERM ends the program as it ends any.
    let is_scanned = Arc::new(AtomicBool::new(false));
    signal_hook::flag::register_conditional_default(SIGTERM, Arc::clone(&is_scanned))?;
    signal_hook::flag::register(SIGTERM, Arc::clone(&is_over))?;
    let (caster, progress) = (&caster, &progress);
    let run = Run { out: &out, config, caster, culling, progress, is_over: &is_over };
    let scanned = match bar::beside(progress, meshes.len(), || scan_all(&run, &meshes)) {
        Err(stopped @ DatasetError::Interrupted { .. }) => {
            eprintln!("{}: {stopped}", out.display());
            return Ok(Outcome::Interrupted);
        }
        scanned => scanned?,
    };
    is_scanned.store(true, SeqCst);
    report_failures(&scanned.failures);
    let packing = Instant::now();
    let manifest = finish(&out, &terms, scanned.records, scanned.failures)?;
    summary::print(&out, &manifest, progress, started.elapsed(), packing.elapsed());
    end(&out, &manifest)
}

/// Prints which meshes failed, and why.
pub fn report_failures(failures: &[MeshFailure]) {
    for failure in failures {
        eprintln!("failed: {failure}");
    }
}

/// Draws the example picture, which an interrupted run may lack, and prints its name.
pub fn end(out: &Path, manifest: &Manifest) -> anyhow::Result<Outcome> {
    match example::draw(out, manifest).context("cannot draw the example")? {
        Some(picture) => eprintln!("Open this picture to see an example: {}", picture.display()),
        None => eprintln!("No scan holds a point, so no example picture was drawn."),
    }
    Ok(if manifest.failures.is_empty() { Outcome::Success } else { Outcome::SomeRefused })
}

fn check(folder: &Path) -> anyhow::Result<Outcome> {
    if edgepuck_dataset::tars::root_file(folder).exists() {
        let problems = edgepuck_dataset::tars::verify(folder)?;
        return tell_problems(&problems, &format!("{}: ", folder.display()));
    }
    let report = verify(folder)?;
    let by = match report.hash {
        Hashing::None => "read, without hashes to compare",
        Hashing::Sha256 | Hashing::Blake3 => "checked",
    };
    tell_problems(&report.problems, &format!("{}: {} files {by}, ", folder.display(), report.files))
}

/// Prints what is wrong with a dataset, a line each, and how much that is behind `introduction`.
fn tell_problems(problems: &[impl Display], introduction: &str) -> anyhow::Result<Outcome> {
    let mut out = std::io::stdout().lock();
    for problem in problems {
        writeln!(out, "{problem}")?;
    }
    eprintln!("{introduction}{} problems.", problems.len());
    Ok(if problems.is_empty() { Outcome::Success } else { Outcome::SomeFailed })
}

fn write_default_shapes(seed: u64) -> anyhow::Result<PathBuf> {
    // A folder of its own for each seed: meshes of another run must not mix in.
    let folder = PathBuf::from(format!("{DEFAULT_SHAPES}-{seed}"));
    eprintln!("No meshes were named: writing built-in procedural shapes to {}.", folder.display());
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

/// Every N-th mesh, from the I-th.
fn shard(meshes: Vec<MeshEntry>, shard: Option<Shard>) -> Vec<MeshEntry> {
    let Some(Shard { number, of }) = shard else { return meshes };
    meshes.into_iter().skip(number as usize).step_by(of as usize).collect()
}

/// A usage error.
fn usage(message: impl Into<String>) -> anyhow::Error {
    Usage(message.into()).into()
}
