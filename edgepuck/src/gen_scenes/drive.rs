//! `edgepuck gen-scenes --drive`: a drive through a street, as a capture or as a sequence of sweeps.

mod turns;

use std::io::Write;
use std::path::Path;
use std::time::Instant;

use anyhow::{Context, anyhow, ensure};
use edgepuck_scenes::{Drive, Packet, Recipe, Sighting, Sightings, Stage};
use formats::atomic::{Unfinished, UnfinishedFolder};
use formats::vlp32c::{Capture, SEQUENCES_PER_PACKET};
use indicatif::{ProgressBar, ProgressStyle};

use super::Args;
use super::layout::Layout;
use super::sequence::Sequence;
use crate::flags::number;
use crate::{Outcome, Usage};
use program::outputs::need_extension;
use turns::{Turns, whole_turns};

/// Flags of a drive.
#[derive(clap::Args)]
#[command(next_help_heading = "A drive, in place of separate scenes")]
pub(super) struct DriveArgs {
    /// Drive through one street for this many seconds. --out is then the capture to write (.pcap) [default:
    /// data/drive.pcap], beside which are the sensor's poses (.tum) and the objects that it saw
    /// (.truth.jsonl); or with --layout semantickitti the folder of a sequence [default:
    /// data/sequences/00], whose sweeps are whole turns without the sensor's motion during the turn
    #[arg(long, value_name = "S", value_parser = seconds)]
    #[arg(conflicts_with_all = ["sweeps", "save", "shard", "adapter"])]
    pub drive: Option<f64>,

    /// Speed of the sensor along the road, metres a second
    #[arg(long, default_value_t = 5.0, value_name = "M/S", requires = "drive", value_parser = speed)]
    speed: f64,
}

/// A drive, of the flags.
struct Asked<'a> {
    args: &'a Args,
    seconds: f64,
    out: &'a Path,
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

/// Writes a drive of `seconds`.
pub(super) fn run(args: &Args, seconds: f64) -> anyhow::Result<Outcome> {
    let sensor = match &args.sensor[..] {
        [] => "vlp32c",
        [sensor] => sensor,
        several => {
            let cause = format!("--sensor: expected one for a drive, found {}", several.len());
            return Err(Usage(cause).into());
        }
    };
    let (default, is_sequence) = match args.layout {
        None => ("data/drive.pcap", false),
        Some(Layout::SemanticKitti) => ("data/sequences/00", true),
        Some(other) => {
            let cause = format!("--layout: expected semantickitti for a drive, found {other}");
            return Err(Usage(cause).into());
        }
    };
    let asked = Asked { args, seconds, out: args.out.as_deref().unwrap_or(Path::new(default)) };
    if is_sequence {
        let sequence = Sequence(asked.out.to_path_buf());
        args.overwrite.check_cleared([asked.out], |file| sequence.has_written(file))?;
    } else {
        need_extension("--out", asked.out, &["pcap"])?;
        let [poses, truth] = ["tum", "truth.jsonl"].map(|end| asked.out.with_extension(end));
        args.overwrite.check([asked.out, &poses, &truth])?;
    }
    let mut recipe = Recipe::resolve(&args.recipe)?;
    recipe.use_sensors(&[sensor.to_owned()]);
    let stage = Stage::new(recipe, &args.recipe, args.meshes.as_deref(), args.seed)?;
    stage.warnings().iter().for_each(|warning| program::say!("warning: {warning}"));
    let what = || format!("{sensor} with the recipe {}", args.recipe.display());
    let mut drive = Drive::new(&stage, args.drive.speed).with_context(what)?;
    let started = Instant::now();
    let n_points = if is_sequence {
        write_sequence(&stage, &mut drive, &asked)?
    } else {
        let (revolution, returns) = drive
            .in_packets()
            .map_err(|cause| anyhow!("{}: {cause}; --layout semantickitti writes none", what()))?;
        let capture = Capture::create(asked.out, drive.start_s(), revolution.rpm, returns)?;
        write(&mut drive, seconds, capture, asked.out)?
    };
    program::say!(
        "{seconds} s, {n_points} points: {}, in {:.1} s",
        asked.out.display(),
        started.elapsed().as_secs_f64()
    );
    Ok(Outcome::Success)
}

/// Fires the first `n` packets of a drive and calls `each` with packets in order, and the number of
/// the first of them. Returns the number of points.
fn fire(
    drive: &mut Drive<'_>,
    n: f64,
    mut each: impl FnMut(&Drive<'_>, u32, &[Packet]) -> anyhow::Result<()>,
) -> anyhow::Result<usize> {
    let most = f64::from(u32::MAX / SEQUENCES_PER_PACKET);
    let cause =
        || format!("--drive: expected at most {:.0} of this sensor", most * drive.packet_s());
    ensure!(n <= most, Usage(cause()));
    let n = n as u32;
    let style =
        ProgressStyle::with_template("{bar:40} {percent}% of the packets, {per_sec}, {eta} left")?;
    let bar = ProgressBar::new(n.into()).with_style(style);
    let mut n_points = 0;
    for first in (0..n).step_by(BATCH) {
        let packets = drive.fire(first..n.min(first + BATCH as u32))?;
        n_points += packets.iter().map(|packet| packet.scan.len()).sum::<usize>();
        each(drive, first, &packets)?;
        bar.inc(packets.len() as u64);
    }
    bar.finish_and_clear();
    Ok(n_points)
}

/// Writes the whole turns of a drive as a sequence and returns the number of points.
fn write_sequence(stage: &Stage, drive: &mut Drive<'_>, asked: &Asked) -> anyhow::Result<usize> {
    let n_turns = whole_turns(drive, asked.seconds)?;
    let sequence = Sequence(asked.out.to_path_buf());
    asked.args.overwrite.clear([asked.out], |file| sequence.has_written(file))?;
    let begun = UnfinishedFolder::begin(asked.out);
    let mut turns = Turns::new(stage, sequence);
    let n_packets = (f64::from(n_turns) * drive.period_s() / drive.packet_s()).ceil();
    fire(drive, n_packets, |drive, first, packets| {
        (first..).zip(packets).try_for_each(|(number, packet)| turns.add(drive, number, packet))
    })?;
    let n_points = turns.finish(drive, n_turns)?;
    begun.finish();
    Ok(n_points)
}

/// Writes the capture of a drive with its truth and returns the number of points.
fn write(
    drive: &mut Drive<'_>,
    seconds: f64,
    mut capture: Capture,
    out: &Path,
) -> anyhow::Result<usize> {
    let n_packets = (seconds / drive.packet_s()).ceil();
    let mut poses = Unfinished::create(&out.with_extension("tum"))?;
    let mut truth = Unfinished::create(&out.with_extension("truth.jsonl"))?;
    let mut sightings = Sightings::default();
    let n_points = fire(drive, n_packets, |drive, _, packets| {
        packets.iter().try_for_each(|packet| capture.push(&packet.scan))?;
        append(&mut truth, &sightings.add(drive, packets))
    })?;
    append(&mut truth, &sightings.finish(drive))?;
    write_poses(&mut poses, drive, n_packets * drive.packet_s())?;
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
fn write_poses(file: &mut Unfinished, drive: &Drive<'_>, seconds: f64) -> anyhow::Result<()> {
    file.append(|writer| writeln!(writer, "# timestamp tx ty tz qx qy qz qw"))?;
    for n in 0..=(seconds * f64::from(POSES_HZ)).ceil() as u32 {
        let time_s = f64::from(n) / f64::from(POSES_HZ);
        let pose = drive.pose(time_s);
        let [x, y, z] = pose.position_m.to_array();
        let [qx, qy, qz, qw] = pose.rotation.to_array();
        let time_s = f64::from(drive.start_s()) + time_s;
        file.append(|writer| {
            writeln!(writer, "{time_s:.2} {x:.6} {y:.6} {z:.6} {qx:.9} {qy:.9} {qz:.9} {qw:.9}")
        })?;
    }
    Ok(())
}
