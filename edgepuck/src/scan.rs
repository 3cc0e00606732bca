use crate::caster::CasterArgs;
use crate::{Outcome, Usage, flags};
use anyhow::Context;
use formats::atomic;
use formats::hash::Hashing;
use formats::scan_file::ScanFormat;
use formats::vlp32c::{self, Returns};
use sim_gpu::internals::packets;
use sim_gpu::internals::scene::SceneFile;
use sim_gpu::internals::simplify::Simplify;
use sim_gpu::{Scan, Scene};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Args {
    /// Scene file [default: two chairs, written to data/default-scene for you to edit]
    #[arg(value_name = "SCENE")]
    scene: Option<PathBuf>,

    /// File to write: .npz, .ply, .csv or .pcap (VLP-32C packets, for that sensor only). If the
    /// scene has several sensors, one file per sensor is written, and the sensor's name is appended
    /// to the file's name
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// Returns of each beam in the packets: strongest, last, or dual (both)
    #[arg(long, value_name = "WHICH")]
    returns: Option<Returns>,

    /// Simplify meshes as gen-dataset does; applies to objects without a `simplify` key in the
    /// scene file
    #[arg(long, value_name = "auto|M", allow_negative_numbers = true)]
    simplify: Option<Simplify>,

    #[command(flatten)]
    caster: CasterArgs,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let format = ScanFormat::of_path(&args.out)?;
    let scene_file = match &args.scene {
        Some(file) => file.clone(),
        None => write_default_scene()?,
    };
    let mut file = SceneFile::load(&scene_file)?;
    file.simplify = args.simplify.or(file.simplify);
    file.check_triangles().map_err(|error| Usage(error.to_string()))?;
    flags::need_simplification(file.simplifies())?;
    let mut returns = Returns::default();
    if format == ScanFormat::Pcap {
        returns = cast_packet_geometry(&mut file, args.returns)
            .with_context(|| format!("{}", scene_file.display()))?;
    } else if args.returns.is_some() {
        let cause = "--returns applies to packets only: expected --out with the extension .pcap; \
                     the returns of other files are the scene's: `effects.returns`";
        return Err(Usage(cause.to_owned()).into());
    }
    let caster = args.caster.caster()?;
    let in_scene = || scene_file.display().to_string();
    let scene = Scene::try_from(&file).with_context(in_scene)?;
    let scan =
        |number| scene.scan_mounted(number).with(&caster).culling(args.caster.culling()).run();
    let scans: Vec<Scan> =
        (0..scene.sensors.len()).map(scan).collect::<Result<_, _>>().with_context(in_scene)?;
    tell_objects(&scene);
    for (scan, mounted) in scans.iter().zip(&scene.sensors) {
        let sensor = &mounted.name;
        if scan.cast_on_cpu {
            eprintln!(
                "{sensor}: one mesh exceeds the adapter's largest binding, so the CPU cast it"
            );
        }
        let file = if scans.len() > 1 { beside(&args.out, sensor) } else { args.out.clone() };
        match format {
            ScanFormat::Pcap => {
                let revolution = packets::revolution(mounted.sensor.profile())?;
                vlp32c::write(&file, Hashing::None, &revolution, returns, scan)?;
            }
            _ => scan.save(&file)?,
        }
        eprintln!("{sensor}: {}: {}", told(&scene, scan), file.display());
    }
    Ok(Outcome::Success)
}

/// Lists the objects of `scene`, and what simplification made of them.
fn tell_objects(scene: &Scene) {
    for (number, object) in scene.instances().iter().enumerate() {
        let name = object.name.as_deref().unwrap_or_default();
        let label = object.label.as_ref().map(|label| format!(", a {label}")).unwrap_or_default();
        let simplified = object
            .simplified
            .map(|s| format!(", {} triangles left, within {:.2e} m", s.triangles, s.bound_m))
            .unwrap_or_default();
        eprintln!("object {number}: {name}{label}{simplified}");
    }
}

/// The number of points of `scan`, and what became of the other returns.
fn told(scene: &Scene, scan: &Scan) -> String {
    let (tally, effects) = (&scan.tally, &scene.effects);
    let of_the_air = effects.weather.as_ref().map(|_| format!("{} of the air, ", tally.scattered));
    let can_be_missed = effects.detection.is_some() || effects.weather.is_some();
    let undetected = can_be_missed.then(|| format!("{} undetected, ", tally.undetected));
    format!(
        "{} points ({}{} out of range, {}{} dropped, {} with a negative range)",
        tally.points,
        of_the_air.unwrap_or_default(),
        tally.out_of_range,
        undetected.unwrap_or_default(),
        tally.dropped,
        tally.negative,
    )
}

const DEFAULT_SCENE: &str = "data/default-scene";

/// Writes the default scene and its mesh, unless they are there, and returns the scene's file.
fn write_default_scene() -> anyhow::Result<PathBuf> {
    let file = |path: &str| Path::new(DEFAULT_SCENE).join(path);
    for (path, text) in edgepuck_assets::DEFAULT_SCENE {
        if !file(path).exists() {
            atomic::write_bytes(&file(path), text)?;
        }
    }
    let scene = file(edgepuck_assets::DEFAULT_SCENE[0].0);
    eprintln!("No scene was named: scanning {}.", scene.display());
    Ok(scene)
}

/// Gives the sensors the beam geometry that their packets describe, and the scans
/// the attributes that packets are made of. Says which returns they hold, where `wanted` does
/// not say otherwise.
fn cast_packet_geometry(scene: &mut SceneFile, wanted: Option<Returns>) -> anyhow::Result<Returns> {
    let returns = packets::settle_returns(&mut scene.effects, wanted)?;
    for (i, sensor) in scene.sensors.iter_mut().enumerate() {
        sensor.sensor = packets::with_packet_geometry(&sensor.sensor)
            .with_context(|| format!("sensor[{i}]: no packets of \"{}\"", sensor.sensor.name))?;
    }
    scene.attributes = packets::attributes(&scene.effects, &scene.attributes);
    Ok(returns)
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
