//! `edgepuck gen-scenes`: scans street scenes and packs their clusters as a training set, or drives
//! through a street.

mod drive;
pub mod labels;
mod layout;
pub mod parts;
pub mod sequence;

use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use edgepuck_scenes::{ClusterCounts, LabelledScene, Recipe, Stage, generate};
use edgepuck_segment::Settings;
use formats::atomic::{self, UnfinishedFolder};
use formats::hash::{Hashing, of_bytes, of_file};
use formats::scan_file::{ScanFormat, write_scan};
use formats::{FormatError, counted};
use indicatif::{ProgressBar, ProgressStyle};
use layout::{Layout, Writer};
use serde_json::{Value, json};

use crate::caster::CasterArgs;
use crate::shard::Shard;
use crate::view::frame::{Frame, Labels};
use crate::view::preview;
use crate::{Outcome, Usage};
use program::outputs::Overwrite;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Scene recipe: street, room, yard, or the path of a TOML file
    #[arg(value_name = "RECIPE", default_value = "street")]
    recipe: PathBuf,

    /// Folder for packed/train.npz and packed/test.npz (labelled clusters), sweeps/ and preview.png
    /// [default: data/scenes]
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,

    /// Number of scenes; each is scanned once
    #[arg(long, default_value_t = 40, value_name = "N")]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    sweeps: u32,

    /// Sensors to use in place of the recipe's: built-in names or TOML files, separated by commas. A drive
    /// has one [default: vlp32c], whose head turns, with the recipe's noise and effects if the recipe has it
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    sensor: Vec<String>,

    /// Folder of your own meshes, for the recipe's objects of kind "mesh"
    #[arg(long, value_name = "DIR")]
    meshes: Option<PathBuf>,

    /// Number of sweeps to write as scans (.npz), each with a JSON file that lists its objects
    #[arg(long, default_value_t = 10, value_name = "N")]
    save: u32,

    /// Also write all sweeps as a data set for trainers, into a folder of this name in --out:
    /// semantickitti, with the class and the object of each point; kitti, with the boxes before a
    /// camera in the sensor; openpcdet (custom), with all boxes. Every tenth sweep is for validation
    #[arg(long, value_name = "LAYOUT")]
    layout: Option<Layout>,

    /// Seed of all random numbers
    #[arg(long, default_value_t = 0)]
    seed: u64,

    /// Make only part I of N of the scenes; `merge-dataset` joins the parts. `auto/N` takes the part from
    /// a job array, as in gen-dataset
    #[arg(long, value_name = "I/N|auto/N")]
    shard: Option<Shard>,

    #[command(flatten)]
    overwrite: Overwrite,

    #[command(flatten)]
    caster: CasterArgs,

    #[command(flatten)]
    drive: drive::DriveArgs,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<Outcome> {
    match args.drive.drive {
        Some(seconds) => drive::run(args, seconds),
        None => scan_scenes(args),
    }
}

impl Args {
    /// The folder of the scenes.
    fn folder(&self) -> &Path {
        self.out.as_deref().unwrap_or(Path::new("data/scenes"))
    }
}

fn scan_scenes(args: &Args) -> anyhow::Result<Outcome> {
    let out = args.folder();
    let numbers = args.shard.map_or(0..args.sweeps, |shard| shard.part_of(args.sweeps));
    if let Some(Shard { of, .. }) = args.shard.filter(|shard| shard.of > args.sweeps) {
        let most = counted(args.sweeps, "part");
        let cause = format!("--shard: expected at most {most}, one a sweep, found {of}");
        return Err(Usage(cause).into());
    }
    let mut recipe = Recipe::resolve(&args.recipe)?;
    let [preview, record] = [out.join("preview.png"), parts::record(out)];
    let mut folders = ["packed", "sweeps"].map(|folder| out.join(folder)).to_vec();
    let set = args.layout.map(|layout| out.join(layout.name()));
    folders.extend(set.clone());
    let outputs = || folders.iter().map(PathBuf::as_path);
    args.overwrite.check_cleared(outputs(), is_written)?;
    args.overwrite.check([&*preview, &*record])?;
    let layouts = Layout::ALL.iter().map(|layout| out.join(layout.name()));
    for other in layouts.filter(|other| set.as_ref() != Some(other) && other.exists()) {
        program::say!("warning: {}: it is of another run, and stays", other.display());
    }
    recipe.use_sensors(&args.sensor);
    let meshes = args.meshes.as_deref();
    let caster = args.caster.caster()?;
    let stage = Stage::with_caster(recipe, &args.recipe, meshes, args.seed, &caster)?;
    stage.warnings().iter().for_each(|warning| program::say!("warning: {warning}"));
    args.overwrite.clear(outputs(), is_written)?;
    for file in [&preview, &record].into_iter().filter(|file| file.exists()) {
        std::fs::remove_file(file).with_context(|| file.display().to_string())?;
    }
    let started = Instant::now();
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} scenes, {per_sec}, {eta} left")?;
    let bar = ProgressBar::new(numbers.len() as u64).with_style(style);
    let mut n_points = 0;
    let mut stand = vec![false; stage.recipe().object.len()];
    let packed = out.join("packed");
    // Saved sweeps are complete, one by one; of packed clusters, only all are.
    let begun = UnfinishedFolder::begin(&packed);
    let begun_set = set.as_deref().map(UnfinishedFolder::begin);
    let set = args.layout.zip(set);
    let set = set.map(|(layout, folder)| Writer::new(layout, folder, args.sweeps));
    let counts = generate(&stage, &Settings::default(), numbers.clone(), &packed, |done| {
        bar.inc(1);
        n_points += done.sweep.points().len();
        done.scene.objects.iter().for_each(|object| stand[object.entry] = true);
        if done.scene.number == 0 {
            draw(&stage, done, &preview)?;
        }
        if let Some(set) = &set {
            set.add(&stage, done)?;
        }
        if done.scene.number < args.save { save(&stage, done, args) } else { Ok(()) }
    })?;
    set.map_or(Ok(()), |set| set.finish())?;
    begun_set.into_iter().for_each(UnfinishedFolder::finish);
    begun.finish();
    if let Some(shard) = args.shard {
        parts::write_record(out, shard, settings(&stage, args)?)?;
    }
    bar.finish_and_clear();
    let seconds = started.elapsed().as_secs_f64();
    program::say!(
        "{} of {} on average in {seconds:.1} s ({:.1} a second)",
        counted(numbers.len(), "sweep"),
        counted(n_points / numbers.len(), "point"),
        numbers.len() as f64 / seconds
    );
    let is_whole = args.shard.is_none();
    if is_whole {
        report_missing(&stage, &stand, numbers.len());
    }
    let has_clusters = report(&stage, &counts, is_whole)?;
    program::say!("Clusters: {}. Picture: {}.", packed.display(), preview.display());
    if n_points == 0 {
        program::say!("warning: no beam returned a point");
    }
    Ok(if n_points > 0 && has_clusters { Outcome::Success } else { Outcome::SomeRefused })
}

/// Draws the sweep of a scene, each point in the colour of its class.
fn draw(stage: &Stage, done: &LabelledScene, out: &Path) -> anyhow::Result<()> {
    let (names, values) = labels::point_classes(stage, done);
    let labels = Labels { name: "class", values, names: Some(names) };
    let shown = Frame::of_scan(String::new(), done.sweep.scan.clone(), vec![labels]);
    preview::draw(&shown, out)
}

/// Warns of objects of the recipe that stand in none of `n_scenes` scenes, unless they had no turn: a
/// count that may be 0 is 0 in half of the scenes at most, and in all of twenty with a chance below 1e-6.
fn report_missing(stage: &Stage, stand: &[bool], n_scenes: usize) {
    const ENOUGH: usize = 20;
    let objects = stage.recipe().object.iter().zip(stand).enumerate();
    for (i, (object, _)) in objects.filter(|(_, (_, stands))| !**stands) {
        let [least, most] = object.count;
        let why = if most == 0 {
            "its count is [0, 0]"
        } else if least > 0 || n_scenes >= ENOUGH {
            "there was no free place for it"
        } else {
            continue;
        };
        program::say!("warning: object[{i}], a {}: no scene has it: {why}", object.class);
    }
}

/// Prints the clusters of each class, and what a whole set, of which a part need not have all, lacks.
/// Returns whether there is a cluster where there must be one.
fn report(stage: &Stage, counts: &ClusterCounts, is_whole: bool) -> std::io::Result<bool> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{:<16} {:>9} {:>9}", "class", "train", "test")?;
    for ((class, train), test) in stage.classes().iter().zip(&counts.train).zip(&counts.test) {
        writeln!(out, "{class:<16} {train:>9} {test:>9}")?;
    }
    let [has_train, has_test] =
        [&counts.train, &counts.test].map(|part| part.iter().any(|n| *n > 0));
    if is_whole && !has_train && !has_test {
        program::say!(
            "warning: no object is in a cluster: expected some above the ground that stand where the \
             sensors see them"
        );
    } else if is_whole && !has_test {
        program::say!("warning: no cluster is in the test part, which has every tenth of --sweeps");
    }
    Ok(has_train || has_test || !is_whole)
}

/// What decides of the files that are written.
fn settings(stage: &Stage, args: &Args) -> Result<Value, FormatError> {
    let meshes = stage.mesh_files().iter().map(|file| of_file(file));
    let sensors = stage.profiles().map(|profile| of_bytes(format!("{profile:?}").as_bytes()));
    Ok(json!({
        "recipe": of_bytes(format!("{:?}", stage.recipe()).as_bytes()),
        "sensors": sensors.collect::<Vec<_>>(),
        "meshes": meshes.collect::<Result<Vec<_>, _>>()?,
        "sweeps": args.sweeps,
        "seed": args.seed,
        "save": args.save,
        "layout": args.layout.map(Layout::name),
    }))
}

/// Whether this command writes files of this name: packed clusters, and sweeps by their numbers.
pub fn is_written(file: &Path) -> bool {
    let text = |part: Option<&OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
    let (stem, extension) = (text(file.file_stem()), text(file.extension()));
    match &*extension {
        "npz" if ["train", "test"].contains(&&*stem) => true,
        "txt" if ["train", "val", "calib", "poses", "times"].contains(&&*stem) => true,
        "npz" | "npy" | "json" | "bin" | "label" | "txt" => {
            stem.len() >= 6 && stem.parse::<u32>().is_ok()
        }
        _ => false,
    }
}

/// Writes the sweep, and the objects of the scene as JSON.
fn save(stage: &Stage, done: &LabelledScene, args: &Args) -> anyhow::Result<()> {
    let sweeps = args.folder().join("sweeps");
    let file = |end: &str| sweeps.join(format!("{:06}.{end}", done.scene.number));
    write_scan(&file("npz"), ScanFormat::Npz, Hashing::None, &done.sweep.scan)?;
    let described = serde_json::to_vec_pretty(&description(stage, done)).context("writing JSON")?;
    Ok(atomic::write_bytes(&file("json"), described)?)
}

fn description(stage: &Stage, done: &LabelledScene) -> Value {
    let scene = &done.scene;
    let points = done.sweep.points_by_surface(scene);
    let objects = scene.objects.iter().enumerate().map(|(i, object)| {
        let entry = &stage.recipe().object[object.entry];
        json!({
            "object": i + 1,
            "class": entry.class,
            "kind": entry.kind,
            "position_m": object.position.to_array(),
            "yaw_deg": object.yaw_rad.to_degrees(),
            "size_m": stage.size_m(scene, i).to_array(),
            "points": points[i + 1],
        })
    });
    json!({
        "sweep_frame": "the sensor's: metres, x forward, z up",
        "objects_frame": "x along the road, z up, origin on the ground below the sensor; metres",
        "sensor": stage.sensor(scene).name(),
        "sensor_pose": scene.pose,
        "object_0": "the ground",
        "objects": objects.collect::<Vec<_>>(),
    })
}
