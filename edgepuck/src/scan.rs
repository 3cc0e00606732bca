//! `cargo xtask scan`: one scene, one scan per sensor.

use crate::caster::CasterArgs;
use crate::{Outcome, Usage, flags};
use anyhow::Context;
use formats::scan_file::{ScanFormat, write_scan};
use formats::vlp32c::{self, Returns};
use sim_gpu::packets;
use sim_gpu::scene::{Scene, SceneScan, cast};
use sim_gpu::simplify::Simplify;
use std::path::{Path, PathBuf};

/// Flags of `scan`.
#[derive(clap::Args)]
pub struct Args {
    /// The scene, such as assets/scenes/two_chairs.toml
    #[arg(value_name = "SCENE")]
    scene: PathBuf,

    /// File to write: .npz, .ply, .csv or .pcap; with several sensors, one file each, named
    /// after it. .pcap, a VLP-32C's packets, takes that sensor alone
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// Returns of each beam in packets: strongest, last or dual, which is both
    #[arg(long, value_name = "WHICH")]
    returns: Option<Returns>,

    /// Leave out triangles too small to be told apart, as gen-dataset does; for the objects that
    /// the scene says nothing of
    #[arg(long, value_name = "auto|M", allow_negative_numbers = true)]
    simplify: Option<Simplify>,

    #[command(flatten)]
    caster: CasterArgs,
}

/// Scans the scene.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let format = ScanFormat::of(&args.out)?;
    let mut scene = Scene::load(&args.scene)?;
    scene.simplify = args.simplify.or(scene.simplify);
    scene.check_triangles().map_err(|error| Usage(error.to_string()))?;
    if scene.simplifies() && cfg!(not(feature = "simplify")) {
        return Err(Usage(flags::BUILT_WITHOUT_SIMPLIFY.to_owned()).into());
    }
    if format == ScanFormat::Pcap {
        cast_as_packets_tell(&mut scene).with_context(|| format!("{}", args.scene.display()))?;
    } else if args.returns.is_some() {
        let cause = "--returns says what packets hold: name a .pcap file to write";
        return Err(Usage(cause.to_owned()).into());
    }
    let caster = args.caster.open(&scene.effects)?;
    let scans = cast(&scene, &caster, args.caster.culling())
        .with_context(|| format!("{}", args.scene.display()))?;
    for (number, object) in scene.objects.iter().enumerate() {
        let label = object.label.as_ref().map(|label| format!(", a {label}")).unwrap_or_default();
        let simplified = scans.first().and_then(|scan| scan.simplified[number]);
        let simplified = simplified
            .map(|s| format!(", {} triangles left, within {:.2e} m", s.triangles, s.bound_m))
            .unwrap_or_default();
        eprintln!("object {number}: {}{label}{simplified}", object.name);
    }
    let several = scans.len() > 1;
    for (SceneScan { sensor, scan, tally, too_large_for_adapter, .. }, asked) in
        scans.iter().zip(&scene.sensors)
    {
        if *too_large_for_adapter {
            eprintln!("{sensor}: a mesh is too large for one binding: the CPU cast it");
        }
        let file = if several { beside(&args.out, sensor) } else { args.out.clone() };
        match format {
            ScanFormat::Pcap => {
                let revolution = packets::revolution(&asked.sensor)?;
                vlp32c::write(&file, &revolution, args.returns.unwrap_or_default(), scan)?;
            }
            _ => write_scan(&file, format, scan)?,
        }
        eprintln!(
            "{sensor}: {} points ({} out of range, {} dropped, {} with a negative range): {}",
            tally.points,
            tally.out_of_range,
            tally.dropped,
            tally.negative,
            file.display()
        );
    }
    Ok(Outcome::Success)
}

/// Has the sensors' beams cast as their packets tell them, and the scans hold
/// what packets are made of.
fn cast_as_packets_tell(scene: &mut Scene) -> anyhow::Result<()> {
    packets::check_effects(&scene.effects)?;
    for (i, sensor) in scene.sensors.iter_mut().enumerate() {
        sensor.sensor = packets::as_packets_tell(&sensor.sensor)
            .with_context(|| format!("sensor[{i}]: no packets of \"{}\"", sensor.sensor.name))?;
    }
    scene.attributes = packets::attributes(&scene.effects);
    Ok(())
}

/// `scan.npz` and `left` give `scan_left.npz`.
fn beside(out: &Path, sensor: &str) -> PathBuf {
    let part = |part: Option<&std::ffi::OsStr>| {
        part.map(|part| part.to_string_lossy().into_owned()).unwrap_or_default()
    };
    let safe: String = sensor
        .chars()
        .map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' })
        .collect();
    out.with_file_name(format!("{}_{safe}.{}", part(out.file_stem()), part(out.extension())))
}
