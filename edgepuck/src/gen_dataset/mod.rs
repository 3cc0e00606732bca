//! `edgepuck gen-dataset`: a folder of meshes into a LiDAR dataset.

mod bar;
mod example;
mod settings;
mod summary;
mod tars;

use crate::caster::CasterArgs;
use crate::shard::Shard;
use crate::{Outcome, Usage, flags, gen_shapes, outcome, signals};
use anyhow::Context;
use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};
use edgepuck_dataset::{
    Begin, DatasetConfig, DatasetError, Layout, Manifest, MeshEntry, MeshFailure, PackedRecord,
    Plan, Progress, check_layouts, discover, doubts, make, verify,
};
use edgepuck_shapes as shapes;
use formats::hash::Hashing;
use formats::outputs::check_place;
use settings::Settings;
use sim_gpu::{Caster, Tally};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::SeqCst;
use std::time::Instant;
pub use summary::print_notes;

/// Folder of the built-in shapes, to which the seed is appended.
const DEFAULT_SHAPES: &str = "data/default-shapes";

/// Folder of the dataset of the built-in shapes.
const DEFAULT_OUT: &str = "data/lidar-shapes";

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder of OBJ, OFF, PLY, STL and glTF files, as CLASS/{train,test}/NAME or in any other layout
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

    /// Also print the numbers of rays and the time of each stage
    #[arg(long, short)]
    verbose: bool,

    #[command(flatten)]
    tars: tars::TarArgs,

    #[command(flatten)]
    settings: Settings,

    #[command(flatten)]
    caster: CasterArgs,
}

/// The settings of a dataset that these `flags` ask for, such as `--distance=2,10`.
pub fn config(flags: &[String]) -> anyhow::Result<DatasetConfig> {
    outcome::parsed::<Settings>(Settings::command(), behind_name(flags))?.config()
}

/// A command line: the program's name and these `words`.
fn behind_name(words: &[String]) -> impl Iterator<Item = &str> {
    std::iter::once("gen-dataset").chain(words.iter().map(String::as_str))
}

/// Checks the words of a command line for the tasks of a cluster, which share their folders. The
/// folders need not exist on this machine.
pub(crate) fn check_words_of_tasks(words: &[String]) -> anyhow::Result<()> {
    #[derive(Parser)]
    struct Words {
        #[command(flatten)]
        args: Args,
    }
    let parsed = outcome::parsed(Words::command(), behind_name(words));
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
    Ok(check_layouts(&config, &[])?)
}

pub(crate) fn run(args: &Args) -> anyhow::Result<Outcome> {
    if let Some(folder) = &args.verify {
        return check(folder);
    }
    let progress = Progress::default();
    let config = args.settings.config()?;
    flags::need_simplification(config.simplify.is_some())?;
    check_layouts(&config, &[])?;
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
        make_files(&plan, &caster, &progress, args.verbose)
    };
    made.or_else(|error| match error.downcast_ref() {
        Some(DatasetError::Interrupted { .. }) => {
            formats::say!("{}: {error}", out.display());
            Ok(Outcome::Interrupted)
        }
        _ => Err(error),
    })
}

fn make_files(
    plan: &Plan,
    caster: &Caster,
    progress: &Progress,
    verbose: bool,
) -> anyhow::Result<Outcome> {
    let started = Instant::now();
    let manifest =
        bar::beside(progress, || signals::stop(progress, || make(plan, caster, progress)))?;
    if progress.is_scanned.load(SeqCst) {
        report_failures(&manifest.failures);
        summary::print(plan.out, &manifest, progress, started.elapsed(), verbose);
    } else {
        formats::say!("{}: the dataset is already complete.", plan.out.display());
        summary::tell_failures(plan.out, &manifest);
    }
    end(plan.out, &manifest)
}

/// The meshes in `folder`; prints what is odd about its layout.
pub fn listed(folder: &Path, seed: u64) -> anyhow::Result<Vec<MeshEntry>> {
    let meshes = discover(folder, seed)?;
    for doubt in doubts(folder, &meshes) {
        formats::say!("warning: {}: {doubt}", folder.display());
    }
    Ok(meshes)
}

/// Prints the meshes that failed, with the causes.
pub fn report_failures(failures: &[MeshFailure]) {
    for failure in failures {
        formats::say!("failed: {failure}");
    }
}

/// Draws the example picture, which is missing after an interruption, and prints its path.
pub(crate) fn end(out: &Path, manifest: &Manifest) -> anyhow::Result<Outcome> {
    match example::draw(out, manifest).context("cannot draw the example")? {
        Some(picture) => {
            formats::say!("Open this picture to see an example: {}", picture.display())
        }
        None => formats::say!("No scan holds a point, so no example picture was drawn."),
    }
    let has_clouds = report_empty_sets(manifest) && report_empty_packed(manifest);
    Ok(match manifest.failures.is_empty() && has_clouds {
        true => Outcome::Success,
        false => Outcome::SomeRefused,
    })
}

/// Prints the sets without a point, with the likely reason. Returns whether every set has points.
fn report_empty_sets(manifest: &Manifest) -> bool {
    let mut all_have_points = true;
    for set in &manifest.config.sets {
        let scans = manifest.meshes.iter().flat_map(|mesh| &mesh.scans);
        let of_set = scans.filter(|scan| scan.set == set.name).flat_map(|scan| &scan.variants);
        let tally = of_set.fold(Tally::default(), |mut sum, scan| {
            sum += scan.tally;
            sum
        });
        if tally.points > 0 || manifest.meshes.is_empty() {
            continue;
        }
        all_have_points = false;
        let lost = tally.out_of_range + tally.dropped + tally.undetected + tally.negative;
        let range = &set.sensor.profile().range;
        let reason = match lost {
            0 => "no beam met a mesh".to_owned(),
            _ => format!(
                "of {lost} beams that met a mesh, {} did so outside the sensor's range of {} to {} m",
                tally.out_of_range, range.min_m, range.max_m
            ),
        };
        formats::say!(
            "No scan of {} holds a point: {reason}. --distance, --normalize and --units change this.",
            set.name
        );
    }
    all_have_points
}

/// Prints the packed files from which all clouds are left out. Returns `false` if one of these is of a
/// set whose other part has no cloud either.
fn report_empty_packed(manifest: &Manifest) -> bool {
    let is_empty = |packed: &&PackedRecord| packed.clouds == 0 && !packed.left_out.is_empty();
    let empty: Vec<_> = manifest.packed.iter().filter(is_empty).collect();
    for PackedRecord { file, left_out, .. } in &empty {
        let most = left_out.iter().map(|scan| scan.points).max().unwrap_or_default();
        formats::say!(
            "{file} holds no cloud: expected scans of {} points, found {most} at most. --min-points, \
             --distance and --sensor change this.",
            manifest.config.min_points
        );
    }
    let set = |packed: &PackedRecord| packed.file.rsplit_once('-').map(|(set, _)| set.to_owned());
    let has_clouds = |of: &&PackedRecord| {
        manifest.packed.iter().any(|other| set(other) == set(of) && other.clouds > 0)
    };
    empty.iter().all(has_clouds)
}

/// Verifies the dataset in `folder` and prints its problems, one a line.
fn check(folder: &Path) -> anyhow::Result<Outcome> {
    let report = verify(flags::dataset_folder(folder))?;
    let by = match report.hash {
        Hashing::None => "read, without hashes to compare",
        Hashing::Sha256 | Hashing::Blake3 => "checked",
    };
    let mut out = std::io::stdout().lock();
    for problem in &report.problems {
        writeln!(out, "{problem}")?;
    }
    let (files, problems) = (report.files, report.problems.len());
    formats::say!("{}: {files} files {by}, {problems} problems.", folder.display());
    Ok(if report.is_sound() { Outcome::Success } else { Outcome::SomeFailed })
}

fn write_default_shapes(seed: u64) -> anyhow::Result<PathBuf> {
    // Each seed has its own folder, so that meshes of different runs do not mix.
    let folder = PathBuf::from(format!("{DEFAULT_SHAPES}-{seed}"));
    formats::say!(
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
