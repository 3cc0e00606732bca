use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use edgepuck_scenes::{Drive, Sighting, Sightings, Stage};
use formats::atomic::Unfinished;
use formats::vlp32c::{Capture, SEQUENCE_US, SEQUENCES_PER_PACKET, START_S};
use indicatif::{ProgressBar, ProgressStyle};

use crate::Outcome;
use crate::flags::number;
use crate::gen_scenes::read_recipe;
use formats::outputs::{Overwrite, need_extension};

#[derive(clap::Args)]
pub struct Args {
    /// Scene recipe: street, yard, room, or the path of a TOML file
    #[arg(value_name = "RECIPE", default_value = "street")]
    recipe: PathBuf,

    /// Capture to write (.pcap); the sensor's poses (.tum) and the objects that it saw
    /// (.truth.jsonl) are written beside it
    #[arg(long, default_value = "data/drive.pcap", value_name = "FILE")]
    out: PathBuf,

    /// Duration of the drive, seconds
    #[arg(long, default_value_t = 60.0, value_name = "S")]
    #[arg(value_parser = seconds)]
    seconds: f64,

    /// Speed of the sensor along the road, metres a second
    #[arg(long, default_value_t = 5.0, value_name = "M/S")]
    #[arg(value_parser = speed)]
    speed: f64,

    /// Sensor: vlp32c, with the recipe's noise and effects, or the path of a VLP-32C's profile
    #[arg(long, default_value = "vlp32c", value_name = "NAME")]
    sensor: String,

    /// Folder of your own meshes, for the recipe's objects of kind "mesh"
    #[arg(long, value_name = "DIR")]
    meshes: Option<PathBuf>,

    /// Seed of all random numbers
    #[arg(long, default_value_t = 0)]
    seed: u64,

    #[command(flatten)]
    overwrite: Overwrite,
}

/// The number of packets that are fired together, on all cores: about one revolution.
const BATCH: usize = 150;

const POSES_HZ: u32 = 100;

/// A day, in which a capture grows to 16 GB, is the longest drive.
fn seconds(word: &str) -> Result<f64, String> {
    number(word, |s| *s > 0.0 && *s <= 86_400.0, "a number above 0 and up to 86400")
}

fn speed(word: &str) -> Result<f64, String> {
    number(word, |speed| (0.0..=100.0).contains(speed), "a number from 0 to 100")
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    need_extension("--out", &args.out, &["pcap"])?;
    let [poses, truth] = ["tum", "truth.jsonl"].map(|end| args.out.with_extension(end));
    args.overwrite.check([&*args.out, &poses, &truth])?;
    let mut recipe = read_recipe(&args.recipe)?;
    recipe.use_sensors(std::slice::from_ref(&args.sensor));
    let stage = Stage::new(recipe, &args.recipe, args.meshes.as_deref(), args.seed)?;
    stage.warnings().iter().for_each(|warning| formats::say!("warning: {warning}"));
    let what = || format!("{} with the recipe {}", args.sensor, args.recipe.display());
    let mut drive = Drive::new(&stage, args.speed).with_context(what)?;
    let started = Instant::now();
    let n_points = write(&mut drive, args.seconds, &args.out)?;
    formats::say!(
        "{} s, {n_points} points: {}, in {:.1} s",
        args.seconds,
        args.out.display(),
        started.elapsed().as_secs_f64()
    );
    Ok(Outcome::Success)
}

/// Writes the three files of a drive and returns the number of points.
fn write(drive: &mut Drive, seconds: f64, out: &Path) -> anyhow::Result<usize> {
    let packet_s = SEQUENCE_US * 1e-6 * f64::from(SEQUENCES_PER_PACKET);
    let n_packets = (seconds / packet_s).ceil() as u32;
    let mut capture = Capture::create(out, drive.revolution().rpm, drive.returns())?;
    let mut poses = Unfinished::create(&out.with_extension("tum"))?;
    let mut truth = Unfinished::create(&out.with_extension("truth.jsonl"))?;

    let style =
        ProgressStyle::with_template("{bar:40} {percent}% of the packets, {per_sec}, {eta} left")?;
    let bar = ProgressBar::new(n_packets.into()).with_style(style);
    let (mut n_points, mut sightings) = (0, Sightings::default());
    for first in (0..n_packets).step_by(BATCH) {
        let packets = drive.fire(first..n_packets.min(first + BATCH as u32))?;
        for packet in &packets {
            capture.push(&packet.scan)?;
            n_points += packet.scan.len();
        }
        append(&mut truth, &sightings.add(drive, &packets))?;
        bar.inc(packets.len() as u64);
    }
    append(&mut truth, &sightings.finish(drive))?;
    write_poses(&mut poses, drive, f64::from(n_packets) * packet_s)?;
    bar.finish_and_clear();
    poses.finish()?;
    truth.finish()?;
    capture.finish()?;
    Ok(n_points)
}

fn append(truth: &mut Unfinished, sightings: &[Sighting]) -> anyhow::Result<()> {
    for sighting in sightings {
        let line = serde_json::to_string(sighting)?;
        truth.append(|writer| writeln!(writer, "{line}"))?;
    }
    Ok(())
}

/// Writes the sensor's poses in the format of the TUM RGB-D benchmark, up to the first pose after
/// the end of the drive. Linear interpolation of the orientation is exact to 1e-3 degrees.
fn write_poses(file: &mut Unfinished, drive: &Drive, seconds: f64) -> anyhow::Result<()> {
    file.append(|writer| writeln!(writer, "# timestamp tx ty tz qx qy qz qw"))?;
    for n in 0..=(seconds * f64::from(POSES_HZ)).ceil() as u32 {
        let time_s = f64::from(n) / f64::from(POSES_HZ);
        let pose = drive.pose(time_s);
        let [x, y, z] = pose.position_m.to_array();
        let [qx, qy, qz, qw] = pose.rotation.to_array();
        let time_s = f64::from(START_S) + time_s;
        file.append(|writer| {
            writeln!(writer, "{time_s:.2} {x:.6} {y:.6} {z:.6} {qx:.9} {qy:.9} {qz:.9} {qw:.9}")
        })?;
    }
    Ok(())
}
