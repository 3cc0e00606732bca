//! `edgepuck corrupt`: applies the corruptions of Robo3D and ModelNet-C that have a physical cause
//! in a sensor.

mod objects;
mod plan;
mod sweep;

use crate::brightness::BrightnessArgs;
use crate::points::{PlaceArgs, SweepArgs};
use crate::{Outcome, Usage};
use anyhow::Context;
use formats::outputs::Overwrite;
use plan::{Entry, Plan};
use sim_gpu::Sensor;
use std::io::Write;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(after_help = "\
For a sweep, --out gets a scan for each corruption and severity of Robo3D, such as fog-1.npz.
SWEEP may also be a folder of meshes, as for gen-dataset. --out then gets a packed set of clouds
for each corruption and severity of ModelNet-C, such as jitter-1-test.npz, and clean-test.npz, all
of the same views of the test meshes. `edgepuck corrupt --list` describes the corruptions, and
names those that are left out.")]
pub struct CorruptArgs {
    /// Sweep, as for `edgepuck segment`, or a folder of meshes
    #[arg(value_name = "SWEEP", required_unless_present = "list")]
    sweep: Option<PathBuf>,

    #[command(flatten)]
    place: PlaceArgs,

    /// Folder for the corrupted scans, or the packed sets, and corruptions.csv
    #[arg(long, value_name = "DIR", default_value = "data/corrupted")]
    out: PathBuf,

    #[command(flatten)]
    overwrite: Overwrite,

    /// Corruptions to make, separated by commas [default: all]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    only: Vec<String>,

    /// Severities to make, separated by commas; 1 is the mildest [default: all]
    #[arg(long, value_name = "N", value_delimiter = ',')]
    severity: Vec<u32>,

    /// Corruptions of your own, in a TOML file like assets/corruptions.toml
    #[arg(long, value_name = "TOML")]
    plan: Option<PathBuf>,

    /// Describe the corruptions and those that are left out, and write nothing
    #[arg(long, exclusive = true)]
    list: bool,

    /// Sensor that recorded the sweep, or that scans the meshes: a built-in name or a TOML file
    #[arg(long, default_value = "vlp32c", value_name = "NAME")]
    profile: String,

    #[command(flatten)]
    brightness: BrightnessArgs,

    #[command(flatten)]
    objects: objects::ObjectArgs,

    /// Seed of all random numbers
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

pub fn run(args: &CorruptArgs) -> anyhow::Result<Outcome> {
    let plan = Plan::read(args.plan.as_deref())?;
    if args.list {
        std::io::stdout().write_all(listed(&plan).as_bytes())?;
        return Ok(Outcome::Success);
    }
    let sweep = args.sweep.clone().expect("invariant: required without --list");
    let (given, other, found) = match sweep.is_dir() {
        true => (args.brightness.given(), "a sweep", "a folder"),
        false => (args.objects.given(), "a folder of meshes", "a file"),
    };
    if let Some(flag) = given.filter(|_| sweep.exists()) {
        let cause = format!("{flag} applies to {other} only, and {} is {found}", sweep.display());
        return Err(Usage(cause).into());
    }
    args.overwrite.check_folder(&args.out)?;
    let input = SweepArgs { sweep, place: args.place.clone() };
    let sensor = Sensor::resolve(&args.profile)?;
    if input.sweep.is_dir() {
        return objects::run(args, &input.sweep, &plan, &sensor);
    }
    sweep::run(args, &input, &plan, sensor.profile())
}

fn listed(plan: &Plan) -> String {
    let mut text = String::new();
    let mut line = |kind: &str, name: &str, severities: usize, by: &str| {
        text += &format!("{kind:<8} {name:<16} {severities}  {by}\n");
    };
    for Entry { name, by, severity } in &plan.sweep {
        line("sweep", name, severity.len(), by);
    }
    for Entry { name, by, severity } in &plan.object {
        line("object", name, severity.len(), by);
    }
    for plan::LeftOut { name, of, because } in &plan.left_out {
        line("-", name, 0, &format!("left out of {of}: {because}"));
    }
    text
}

/// Removes what an earlier run wrote into `out`, which its list names, but for the `input`.
fn remove_former(out: &Path, input: &Path) -> anyhow::Result<()> {
    let list = out.join(LIST);
    let Ok(mut csv) = csv::Reader::from_path(&list) else { return Ok(()) };
    let names = csv.records().map(|record| Ok(record?.get(0).unwrap_or_default().to_owned()));
    let input = input.canonicalize().ok();
    for name in names.collect::<Result<Vec<_>, csv::Error>>()? {
        let path = out.join(&name);
        let is_plain = Path::new(&name).file_name().is_some_and(|own| own == name.as_str());
        if is_plain && path.is_file() && path.canonicalize().ok() != input {
            std::fs::remove_file(&path).with_context(|| path.display().to_string())?;
        }
    }
    std::fs::remove_file(&list).with_context(|| list.display().to_string())
}

/// The list of what was written.
const LIST: &str = "corruptions.csv";

/// A line of `corruptions.csv`.
#[derive(serde::Serialize)]
struct Written<'a> {
    file: String,
    corruption: &'a str,
    severity: u32,
    /// Number of points of the scan, or of clouds of the set.
    count: usize,
    /// Number of points of the sweep, or of clouds before the corruption.
    of: usize,
    by: &'a str,
}

/// The outcome; prints a warning if nothing is left of the input.
fn ended(written: &[Written<'_>]) -> Outcome {
    if written.iter().any(|written| written.count > 0) {
        return Outcome::Success;
    }
    formats::say!("warning: nothing is left: expected other corruptions by --only, or milder ones");
    Outcome::SomeRefused
}

/// Writes `corruptions.csv`.
fn write_list(written: &[Written<'_>], out: &Path) -> anyhow::Result<()> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    written.iter().try_for_each(|line| csv.serialize(line))?;
    Ok(formats::atomic::write_bytes(&out.join(LIST), csv.into_inner()?)?)
}

fn usage(error: impl std::fmt::Display) -> Usage {
    Usage(error.to_string())
}
