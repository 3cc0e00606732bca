//! `edgepuck corrupt`: applies weather, or the corruptions of Robo3D, to recorded sweeps.

mod plan;
mod sweep;
mod weather;

use crate::brightness::BrightnessArgs;
use crate::flags::{first_given, warn_of_sensor};
use crate::points::{PlaceArgs, SweepArgs};
use crate::{Outcome, Usage};
use anyhow::Context;
use formats::cloud_file::CloudFormat;
use plan::{Entry, Plan};
use program::outputs::Overwrite;
use sim_gpu::sensors::SensorProfile;
use std::io::Write;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(after_help = "\
With --rain, --snow, --fog or --haze, --out is a file with the strongest return of each beam that
still has one: `intensity` is the intensity in the weather, and `medium` the source of the return,
0 a surface, 1 rain, 2 snow, 3 fog.
Without weather, --out is a folder that gets a scan for each corruption and severity of Robo3D, such as
fog-1.npz. `edgepuck corrupt --list` describes the corruptions.")]
pub struct CorruptArgs {
    /// Sweep, as for `edgepuck detect`
    #[arg(value_name = "SWEEP", required_unless_present = "list")]
    sweep: Option<PathBuf>,

    #[command(flatten)]
    place: PlaceArgs,

    /// Folder for the corrupted scans and corruptions.csv [default: data/corrupted]; for weather the file
    /// to write: .npz, .ply, .csv or .pcd
    #[arg(long, value_name = "DIR|FILE")]
    out: Option<PathBuf>,

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

    /// Describe the corruptions, and write nothing
    #[arg(long, exclusive = true)]
    list: bool,

    /// Sensor that recorded the sweep: a built-in name or a TOML file. Its detection limit, beam width
    /// and range determine which returns are detected
    #[arg(long, default_value = "vlp32c", value_name = "NAME")]
    sensor: String,

    #[command(flatten)]
    brightness: BrightnessArgs,

    #[command(flatten)]
    weather: weather::WeatherArgs,

    /// Seed of all random numbers
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

pub fn run(args: &CorruptArgs) -> anyhow::Result<Outcome> {
    if let Some(flag) = args.weather.given() {
        return in_weather(args, flag);
    }
    let plan = Plan::read(args.plan.as_deref())?;
    if args.list {
        std::io::stdout().write_all(listed(&plan).as_bytes())?;
        return Ok(Outcome::Success);
    }
    let input = sweep_of(args)?;
    let out = args.out.as_deref().unwrap_or(Path::new(OUT));
    if CloudFormat::of_path(out).is_ok() {
        let cause = "expected a folder for the corrupted sweeps, found the name of a file: name a folder, or \
                     weather, such as --rain 25, for one sweep";
        return Err(usage(format!("--out {}: {cause}", out.display())).into());
    }
    args.overwrite.check_folder(out)?;
    let sensor = SensorProfile::resolve(&args.sensor).inspect(warn_of_sensor)?;
    sweep::run(args, &input, out, &plan, &sensor)
}

/// Adds weather to a sweep, as `flag` asks.
fn in_weather(args: &CorruptArgs, flag: &str) -> anyhow::Result<Outcome> {
    let others = [
        (!args.only.is_empty(), "--only"),
        (!args.severity.is_empty(), "--severity"),
        (args.plan.is_some(), "--plan"),
    ];
    if let Some(other) = first_given(&others) {
        return Err(usage(format!("expected {flag} or {other}, found both")).into());
    }
    let input = sweep_of(args)?;
    let sensor = SensorProfile::resolve(&args.sensor).inspect(warn_of_sensor)?;
    weather::run(args, &input, &sensor)
}

/// The sweep to corrupt, which is not a folder.
fn sweep_of(args: &CorruptArgs) -> Result<SweepArgs, Usage> {
    let sweep = args.sweep.clone().expect("invariant: required without --list");
    if sweep.is_dir() {
        let cause =
            "expected a sweep, found a folder: `gen-dataset --effects` scans meshes with effects";
        return Err(usage(format!("{}: {cause}", sweep.display())));
    }
    Ok(SweepArgs { sweep, place: args.place.clone() })
}

fn listed(plan: &Plan) -> String {
    let line =
        |Entry { name, by, severity }: &Entry| format!("{name:<16} {}  {by}\n", severity.len());
    plan.sweep.iter().map(line).collect()
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

/// The folder of the corrupted scans by default.
const OUT: &str = "data/corrupted";

/// The list of what was written.
const LIST: &str = "corruptions.csv";

/// A line of `corruptions.csv`.
#[derive(serde::Serialize)]
struct Written<'a> {
    file: String,
    corruption: &'a str,
    severity: u32,
    /// Number of points of the scan.
    count: usize,
    /// Number of points of the sweep.
    of: usize,
    by: &'a str,
}

/// The outcome; prints a warning if nothing is left of the input.
fn ended(written: &[Written<'_>]) -> Outcome {
    if written.iter().any(|written| written.count > 0) {
        return Outcome::Success;
    }
    program::say!("warning: nothing is left: expected other corruptions by --only, or milder ones");
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
