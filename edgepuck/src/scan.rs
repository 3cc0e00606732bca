//! `edgepuck scan`: a scene, or meshes before a sensor, into a scan.

use crate::caster::CasterArgs;
use crate::effect_flags::EffectFlags;
use crate::{Outcome, Usage, flags};
use anyhow::{Context, ensure};
use edgepuck_mesh::MeshFormat;
use edgepuck_mesh::frame::{Normalize, Unit, Up};
use edgepuck_mesh::import::Format;
use formats::hash::Hashing;
use formats::plausible::{Warning, mesh_size};
use formats::scan::Attribute;
use formats::scan_file::ScanFormat;
use formats::vlp32c::{self, Returns};
use formats::{atomic, counted};
use glam::{DAffine3, DVec3};
use program::outputs::Overwrite;
use sim_gpu::effects::Intensity;
use sim_gpu::packets;
use sim_gpu::scene_files::SceneFile;
use sim_gpu::{Extent, FilePlace, Import, Mesh, MountedSensor, Pose, Scan, Scene, Sensor};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Args {
    /// Scene file (TOML), or meshes (OBJ, OFF, PLY, STL), glTF files and robots (URDF) where their files
    /// have them. The nodes of glTF and the links of robots are objects; joints are at 0
    /// [default: two chairs, written to data/default-scene for you to edit]
    #[arg(value_name = "SCENE|MESH...")]
    inputs: Vec<PathBuf>,

    /// File to write: .npz, .ply, .csv, .pcd or .pcap (VLP-32C packets, for that sensor only). If the
    /// scene has several sensors, one file per sensor is written, and the sensor's name is appended
    /// to the file's name
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    #[command(flatten)]
    overwrite: Overwrite,

    /// Returns of each beam in the packets: strongest, last, or dual (both)
    #[arg(long, value_name = "WHICH")]
    returns: Option<Returns>,

    #[command(flatten)]
    meshes: MeshArgs,

    #[command(flatten)]
    effects: EffectFlags,

    #[command(flatten)]
    caster: CasterArgs,
}

/// Flags for meshes, which a scene's file states itself.
#[derive(clap::Args)]
#[command(next_help_heading = "Scans of meshes")]
struct MeshArgs {
    /// Name of a built-in sensor, or path of a profile (TOML) or of an Ouster's metadata (JSON)
    /// [default: vlp32c]
    #[arg(long, value_name = "NAME|FILE")]
    sensor: Option<String>,

    /// Distance of the sensor from the centre of the meshes, at which it looks, metres [default:
    /// 3]
    #[arg(long, value_name = "M", value_parser = flags::positive)]
    distance: Option<f64>,

    /// Elevation of the sensor above the horizon, degrees [default: 20]
    #[arg(long, value_name = "DEG", value_parser = flags::elevation)]
    elevation: Option<f64>,

    /// Azimuth of the sensor, counterclockwise from x, degrees [default: 0]
    #[arg(long, value_name = "DEG")]
    azimuth: Option<f64>,

    /// Unit of the meshes' coordinates: m, mm, cm, in or ft [default: m]
    #[arg(long, value_name = "UNIT")]
    units: Option<Unit>,

    /// How meshes are scaled: unit-sphere, bbox or none [default: none]
    #[arg(long, value_name = "HOW")]
    normalize: Option<Normalize>,

    /// The meshes' upward axis: y or z [default: y for OBJ and glTF, z for others]
    #[arg(long, value_name = "AXIS")]
    up: Option<Up>,

    /// Attributes of each point besides its position, as of gen-dataset [default: range, beam, ring,
    /// time, object, intensity]
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    attributes: Vec<Attribute>,

    /// Seed of all random numbers [default: 0]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
}

impl MeshArgs {
    /// A flag that was given, which a scene's file states itself.
    fn given(&self) -> Option<&'static str> {
        flags::first_given(&[
            (self.sensor.is_some(), "--sensor"),
            (self.distance.is_some(), "--distance"),
            (self.elevation.is_some(), "--elevation"),
            (self.azimuth.is_some(), "--azimuth"),
            (self.units.is_some(), "--units"),
            (self.normalize.is_some(), "--normalize"),
            (self.up.is_some(), "--up"),
            (!self.attributes.is_empty(), "--attributes"),
            (self.seed.is_some(), "--seed"),
        ])
    }
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let format = ScanFormat::of_path(&args.out).map_err(|error| Usage(error.to_string()))?;
    let (mut scene, what) = scene(args)?;
    scene.warnings().iter().for_each(|warning| program::say!("warning: {warning}"));
    let mut returns = Returns::default();
    if format == ScanFormat::Pcap {
        returns = cast_packet_geometry(&mut scene, args.returns).with_context(|| what.clone())?;
    } else if args.returns.is_some() {
        let cause = "--returns applies to packets only: expected --out with the extension .pcap; \
                     the returns of other files are those of the effects: `effects.returns`";
        return Err(Usage(cause.to_owned()).into());
    }
    let several = scene.sensors.len() > 1;
    let file = |mounted: &MountedSensor| match several {
        true => beside(&args.out, &mounted.name),
        false => args.out.clone(),
    };
    let files: Vec<PathBuf> = scene.sensors.iter().map(file).collect();
    args.overwrite.check(files.iter().map(PathBuf::as_path))?;
    let caster = args.caster.caster()?;
    let mut scans = scene.scan_all(&caster).with_context(|| what.clone())?;
    for scan in scans.iter_mut().filter(|scan| scan.points.object.is_some()) {
        scan.points.object_texts = scene.object_texts();
    }
    tell_objects(&scene);
    for ((scan, mounted), file) in scans.iter().zip(&scene.sensors).zip(&files) {
        let sensor = &mounted.name;
        if scan.cast_on_cpu {
            program::say!(
                "{sensor}: one mesh exceeds the GPU's largest buffer, so the CPU cast it"
            );
        }
        match format {
            ScanFormat::Pcap => {
                let revolution = packets::revolution(mounted.sensor.profile())?;
                vlp32c::write(file, Hashing::None, &revolution, returns, scan)?;
            }
            _ => scan.save(file)?,
        }
        program::say!("{sensor}: {}: {}", summary(&scene, scan), file.display());
    }
    if scans.iter().all(|scan| scan.is_empty()) {
        let range = scene.sensors.iter().find_map(|mounted| out_of_reach(&scene, mounted));
        let why = range.unwrap_or_else(|| {
            "expected an object in the sensor's range and view, larger than the gaps between beams, \
             and not seen edge-on"
                .to_owned()
        });
        program::say!("warning: no beam returned a point: {why}");
        return Ok(Outcome::SomeRefused);
    }
    Ok(Outcome::Success)
}

/// The scene that the command line asks for, and its name in messages.
fn scene(args: &Args) -> anyhow::Result<(Scene, String)> {
    let is_mesh =
        |file: &PathBuf| MeshFormat::from_path(file).is_some() || Format::from_path(file).is_some();
    if !args.inputs.is_empty() && args.inputs.iter().all(is_mesh) {
        return Ok((scene_of_meshes(args)?, args.inputs[0].display().to_string()));
    }
    let file = match &args.inputs[..] {
        [] => Path::new(DEFAULT_SCENE).join(edgepuck_assets::DEFAULT_SCENE[0].0),
        [scene] => scene.clone(),
        [_, ..] => {
            let other = args.inputs.iter().find(|file| !is_mesh(file));
            let other = other.map(|file| file.display().to_string()).unwrap_or_default();
            let cause = format!(
                "expected one scene, or meshes (.obj, .off, .ply, .stl, .glb, .gltf, .urdf), found {other}"
            );
            return Err(Usage(cause).into());
        }
    };
    let what = file.display().to_string();
    if file.is_dir() {
        let cause = "expected a file, found a folder: `edgepuck gen-dataset` scans its meshes";
        return Err(Usage(format!("{what}: {cause}")).into());
    }
    let extension = file.extension().unwrap_or_default();
    // A pipe has no name.
    if !extension.eq_ignore_ascii_case("toml") && (file.is_file() || !extension.is_empty()) {
        let found = match extension.is_empty() {
            true => "no extension".to_owned(),
            false => format!("the extension .{}", extension.display()),
        };
        let cause =
            "expected a mesh (.obj, .off, .ply, .stl, .glb, .gltf, .urdf) or a scene (.toml)";
        return Err(Usage(format!("{what}: {cause}, found {found}")).into());
    }
    if let Some(flag) = args.meshes.given().or(args.effects.given()) {
        let cause =
            format!("{flag} applies to scans of meshes: {what} is a scene, which states it");
        return Err(Usage(cause).into());
    }
    if args.inputs.is_empty() {
        write_default_scene()?;
    }
    let scene = SceneFile::load(&file)?;
    Ok((Scene::try_from(&scene).with_context(|| what.clone())?, what))
}

/// The meshes where their files have them, and a sensor that looks at their middle.
fn scene_of_meshes(args: &Args) -> anyhow::Result<Scene> {
    let unit = args.meshes.units.unwrap_or_default();
    let is_scaled = args.meshes.normalize.is_some_and(|it| it != Normalize::None);
    let cause =
        "--units: expected meshes that keep their size (--normalize none), since others are scaled";
    ensure!(!is_scaled || args.meshes.units.is_none(), Usage(cause.to_owned()));
    let mut scene = Scene::new();
    scene.seed = args.meshes.seed.unwrap_or_default();
    scene.attributes.insert(Attribute::Intensity);
    if !args.meshes.attributes.is_empty() {
        scene.attributes = args.meshes.attributes.iter().copied().collect();
    }
    scene.effects = args.effects.effects()?;
    if scene.attributes.contains(&Attribute::Intensity) {
        scene.effects.intensity.get_or_insert(Intensity);
    }
    if let Some(copy) = flags::copy_among(&args.inputs)? {
        program::say!("warning: {copy}, and stands where that does: each hides the other");
    }
    let mut extents = Vec::new();
    for file in &args.inputs {
        let extent = add_input(&mut scene, args, file)?;
        let size = mesh_size(extent.size_m(), unit, "--units names another unit");
        for warning in size.into_iter().chain(extent.hidden_by(&scene.effects)) {
            program::say!("warning: {}: {warning}", file.display());
        }
        extents.push(extent);
    }
    let all = extents.iter().copied().reduce(Extent::and);
    let MeshArgs { distance, elevation, azimuth, .. } = args.meshes;
    let mut pose = Pose::looking_at_origin_deg(
        distance.unwrap_or(3.0),
        elevation.unwrap_or(20.0),
        azimuth.unwrap_or_default(),
    );
    pose.position_m += all.map_or(DVec3::ZERO, |all| 0.5 * (all.low + all.high));
    for (file, extent) in args.inputs.iter().zip(extents) {
        if extent.surrounds(&[pose.position_m]) {
            let remedy = "a larger --distance, or another of --units".to_owned();
            let warning = Warning::SensorInside(remedy);
            program::say!("warning: {}: {warning}", file.display());
        }
    }
    let sensor = Sensor::resolve(args.meshes.sensor.as_deref().unwrap_or("vlp32c"))?;
    flags::warn_of_sensor(sensor.profile());
    scene.mount(sensor.name(), &sensor, pose);
    Ok(scene)
}

/// Adds what stands in `file`. Returns its bounding box.
fn add_input(scene: &mut Scene, args: &Args, file: &Path) -> anyhow::Result<Extent> {
    let (up, unit) = (args.meshes.up, args.meshes.units.unwrap_or_default());
    let normalize = args.meshes.normalize.unwrap_or(Normalize::None);
    let stem = file.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    // What is scaled to a unit is one mesh.
    let is_one = normalize != Normalize::None && MeshFormat::from_path(file).is_some();
    if Format::from_path(file).is_none() || is_one {
        let mesh = Mesh::read_in(file, up, unit)?.normalized(normalize);
        let extent = mesh.extent();
        let id = scene.add(mesh, Pose::IDENTITY);
        scene[id].name = stem;
        return Ok(extent);
    }
    let cause =
        format!("{}: --normalize scales meshes: expected it without a robot", file.display());
    ensure!(normalize == Normalize::None, Usage(cause));
    let several = args.inputs.len() > 1;
    let place = FilePlace {
        up,
        world_from_upright: DAffine3::from_scale(DVec3::splat(unit.metres())),
        prefix: stem.filter(|_| several).map(|stem| stem + "/").unwrap_or_default(),
    };
    let ids = scene.add_file_at(file, &Import::default(), &place)?;
    let extents = ids.iter().map(|id| scene[*id].extent());
    extents.reduce(Extent::and).context("invariant: a file has a part")
}

/// Lists the objects of `scene`.
fn tell_objects(scene: &Scene) {
    for (number, object) in scene.instances().iter().enumerate() {
        let name = object.name.as_deref().unwrap_or_default();
        let label = object.label.as_ref().map(|label| format!(", a {label}")).unwrap_or_default();
        program::say!("object {number}: {name}{label}");
    }
}

/// Why a sensor sees nothing, if all objects are beyond its range or nearer.
fn out_of_reach(scene: &Scene, mounted: &MountedSensor) -> Option<String> {
    let at_m = mounted.motion.as_ref().map_or(mounted.pose, |it| it.at(mounted.start_s)).position_m;
    let nearest = scene.instances().iter().map(|it| it.extent().distance_m(at_m));
    let (nearest_m, range) = (nearest.reduce(f64::min)?, &mounted.sensor.profile().range);
    let name = &mounted.name;
    let limit = if nearest_m > range.max_m {
        format!("{} m far", range.max_m)
    } else if nearest_m > 0.0 && nearest_m < range.min_m {
        format!("from {} m", range.min_m)
    } else {
        return None;
    };
    Some(format!("the nearest object is {nearest_m:.1} m from {name}, which sees {limit}"))
}

/// The number of points of `scan`, and what became of the other returns.
fn summary(scene: &Scene, scan: &Scan) -> String {
    let (tally, effects) = (&scan.tally, &scene.effects);
    if tally.points + tally.out_of_range + tally.dropped + tally.undetected == 0 {
        return "no points: no beam met an object".to_owned();
    }
    let of_the_air = effects.weather.as_ref().map(|_| format!("{} of the air, ", tally.scattered));
    let can_be_missed = effects.detection.is_some() || effects.weather.is_some();
    let undetected = can_be_missed.then(|| format!("{} undetected, ", tally.undetected));
    // Noise can move a return behind a sensor that is close to it.
    let behind = (tally.negative > 0).then(|| format!(", {} behind the sensor", tally.negative));
    format!(
        "{} ({}{} out of range, {}{} dropped{})",
        counted(tally.points, "point"),
        of_the_air.unwrap_or_default(),
        tally.out_of_range,
        undetected.unwrap_or_default(),
        tally.dropped,
        behind.unwrap_or_default(),
    )
}

const DEFAULT_SCENE: &str = "data/default-scene";

/// Writes the default scene and its mesh, unless they are there.
fn write_default_scene() -> anyhow::Result<()> {
    for (path, text) in edgepuck_assets::DEFAULT_SCENE {
        let file = Path::new(DEFAULT_SCENE).join(path);
        if !file.exists() {
            atomic::write_bytes(&file, text)?;
        }
    }
    program::say!("No scene was named: scanning that of {DEFAULT_SCENE}.");
    Ok(())
}

/// Gives the sensors the beam geometry of their packets, and the scans the attributes that packets
/// are made of. Returns the returns that the packets hold: `wanted`, or those of the effects.
fn cast_packet_geometry(scene: &mut Scene, wanted: Option<Returns>) -> anyhow::Result<Returns> {
    let returns = packets::settle_returns(&mut scene.effects, wanted)?;
    for (i, mounted) in scene.sensors.iter_mut().enumerate() {
        mounted.sensor = mounted
            .sensor
            .with_packet_geometry()
            .with_context(|| format!("sensor[{i}]: no packets of \"{}\"", mounted.sensor.name()))?;
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
